"""Write the output files of a job atomically: either all files or no files.

A job writes the files into a hidden folder (``.mrdamper-...``) near their final path. When the job is
complete, the files are moved to the final path. If the job fails or is interrupted or killed, existing files
remain unchanged.

If the output folder does not exist, the hidden folder is renamed, which is one step. If the output folder
exists, the hidden folder is marked as complete, and the files are moved one by one. If a job is killed during
this time, the next job in the same folder moves the remaining files (``recover_staging``). Incomplete hidden
folders of killed jobs are removed. They are recognised because no process holds their lock: the operating
system releases the locks of a process that ends for any reason.
"""

from __future__ import annotations

import csv
import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError

fcntl: Any
msvcrt: Any
try:
    import fcntl
except ImportError:  # Windows has no fcntl.
    fcntl = None
try:
    import msvcrt
except ImportError:  # Only Windows has msvcrt.
    msvcrt = None


_PREFIX = ".mrdamper-"
# The hidden folder contains a folder of incomplete or of complete files, and a text file with the final path.
_FILES, _WHOLE, _TO = "files", "whole", "to"
_FULL = (errno.ENOSPC, errno.EDQUOT)
_REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS)
_FLUSHING = 8  # number of files that are flushed to disk in parallel
_WRITTEN: list[Path] = []


def lock(handle: int) -> bool | None:
    """Lock an open file or folder for this process.

    Return True if this process has the lock now, False if another process has the lock, and None if the
    operating system or the disk does not support locks.
    """
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            return None
    except BlockingIOError:
        return False
    except OSError:  # fcntl: the disk has no locks. msvcrt: another process has the lock.
        return None if fcntl is not None else False
    return True


@contextmanager
def atomic_output(out: Path, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """Provide a temporary folder in a ``with`` statement; move its files to ``out``.

    If the code in the ``with`` statement raises an exception, the temporary folder is removed. ``out`` is
    then unchanged.

    Parameters
    ----------
    inputs : input files of the job, which must not be replaced

    Raises
    ------
    InputError
        If ``out`` is a file or not writable, the disk is full, or a file would replace an input.
    """
    place = out.absolute()
    try:
        standing = next(folder for folder in (place, *place.parents) if folder.exists())
    except OSError as fault:  # The name is invalid, or the folder is not readable.
        raise _cannot(out, place, fault) from fault
    if not standing.is_dir():
        raise InputError(
            place=out,
            found=f"{standing} is a file",
            expected="a folder to write to",
            remedy="Choose another folder",
        )
    recover_staging(standing)
    try:
        hidden, handle = _hidden_in(standing)
    except OSError as fault:
        raise _cannot(out, standing, fault) from fault
    try:
        try:
            beside = hidden / _FILES
            beside.mkdir()
            (hidden / _TO).write_text(os.path.relpath(place, standing), encoding="utf-8")
        except OSError as fault:
            raise _cannot(out, standing, fault) from fault
        try:
            yield beside
        except (OSError, InputError) as fault:
            # The caller may already have converted an OSError to an InputError.
            cause = fault if isinstance(fault, OSError) else fault.__cause__
            if isinstance(cause, OSError) and no_room(cause) and _is_ours(cause, hidden):
                raise _cannot(out, standing, cause, hidden) from fault
            raise
        targets = [place / each.relative_to(beside) for each in beside.rglob("*") if each.is_file()]
        refuse_inputs(targets, inputs)
        try:
            _flush(beside)
            _settle(hidden, place)
        except OSError as fault:
            raise _cannot(out, standing, fault, hidden) from fault
        except BaseException:  # If an interrupt occurs while files are moved, move the remaining files first.
            if (hidden / _WHOLE).exists():
                _move(hidden / _WHOLE, place)
            raise
    finally:
        if not (hidden / _WHOLE).exists():  # If complete files remain, the next job moves them.
            shutil.rmtree(hidden, ignore_errors=True)
        os.close(handle)


def output_folders() -> Sequence[Path]:
    """Return the folders with complete outputs that this program has written so far."""
    return tuple(_WRITTEN)


def refuse_inputs(targets: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise InputError if an output file would replace an input file.

    Files are compared by identity, so that links and different names of one file are recognised.

    Raises
    ------
    InputError
        If one of ``targets`` is the same file as one of ``inputs``.
    """
    read = {_identity(each): each for each in inputs}
    for target in targets:
        source = read.get(_identity(target))
        if source is not None:
            raise InputError(
                place=target,
                found=f"writing there would replace {source}, which this job reads; nothing was changed",
                expected="a place of its own for what is written",
                remedy="Choose another place",
            )


def _identity(path: Path) -> object:
    """Return a key that is equal for all names of a file, including links."""
    try:
        found = path.stat()
    except OSError:  # The file does not exist yet.
        return path.absolute()
    return found.st_dev, found.st_ino


def recover_staging(folder: Path) -> None:
    """Move the complete outputs of killed jobs to their final path, and remove their incomplete outputs."""
    for hidden in folder.glob(f"{_PREFIX}*"):
        with suppress(OSError):
            handle = os.open(hidden, os.O_RDONLY)
            try:
                if hidden.is_dir() and lock(handle):  # A locked folder belongs to a running job.
                    if (hidden / _WHOLE).is_dir():
                        _move(hidden / _WHOLE, folder / (hidden / _TO).read_text(encoding="utf-8"))
                    shutil.rmtree(hidden)
            finally:
                os.close(handle)


def no_room(fault: OSError) -> str:
    """Return a message if disk, file size or permission prevents writing; else ""."""
    if fault.errno in _FULL:
        return "the disk is full"
    if fault.errno == errno.EFBIG:
        return "a file would be larger than this session may write (ulimit -f)"
    if fault.errno in _REFUSED and fault.filename is not None:
        return f"cannot write there: {fault.strerror}"
    return ""


def _hidden_in(folder: Path) -> tuple[Path, int]:
    """Create and lock a hidden folder; return its path and its open file descriptor."""
    while True:
        hidden = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=folder))
        try:
            handle = os.open(hidden, os.O_RDONLY)
        except FileNotFoundError:  # Another job has removed the folder before it was locked.
            continue
        if lock(handle) is not False and hidden.is_dir():
            return hidden, handle
        os.close(handle)


def _flush(folder: Path) -> None:
    """Flush the files of a folder to the disk, so that a power loss leaves no empty files."""

    def flush(path: Path) -> None:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    with ThreadPoolExecutor(_FLUSHING) as pool:
        list(pool.map(flush, [path for path in folder.rglob("*") if path.is_file()]))


def _settle(hidden: Path, place: Path) -> None:
    """Move the complete files from the hidden folder to their final path."""
    files = hidden / _FILES
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        try:
            files.rename(place)
        except OSError:
            if not place.exists():  # Another job may have created the folder at the same time.
                raise
        else:
            _WRITTEN.append(place)
            return
    for path in files.rglob("*"):
        target = place / path.relative_to(files)
        if path.is_dir() != target.is_dir() and target.exists():
            raise IsADirectoryError(errno.EISDIR, "a folder and a file of one name", str(target))
        if target.parent.is_dir() and not os.access(target.parent, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(target))
    whole = files.rename(hidden / _WHOLE)
    _WRITTEN.append(place)  # The output is now complete, even if an interrupt occurs while files are moved.
    _move(whole, place)


def _move(whole: Path, place: Path) -> None:
    for path in sorted(whole.rglob("*")):
        target = place / path.relative_to(whole)
        if path.is_dir():
            target.mkdir(parents=True, exist_ok=True)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            path.replace(target)
    shutil.rmtree(whole)


def _is_ours(fault: OSError, hidden: Path) -> bool:
    """Return True if an error concerns an output file of the job."""
    # An error without a file name occurred in a write to an open file.
    return fault.filename is None or Path(os.fsdecode(fault.filename)).is_relative_to(hidden)


def _cannot(out: Path, standing: Path, fault: OSError, hidden: Path | None = None) -> InputError:
    """Return the InputError for output files that cannot be written."""
    why = no_room(fault)
    if hidden is not None and (hidden / _WHOLE).exists():
        return InputError(
            place=out,
            found=(
                f"{why or fault.strerror}; some files are in their place, and the others in {hidden}. The "
                "next job there moves them"
            ),
        )
    if fault.errno in _FULL:
        with suppress(OSError):
            free = shutil.disk_usage(standing).free
            size = 0 if hidden is None else sum(p.stat().st_size for p in hidden.rglob("*") if p.is_file())
            why += f" ({free / 1e6:.1f} MB are free, {size / 1e6:.1f} MB were written so far)"
        return InputError(
            place=out,
            found=f"{why}; nothing was changed there",
            remedy="Make room, or choose another folder",
        )
    why = why or f"cannot write there: {fault.strerror}"
    return InputError(place=out, found=f"{why}; nothing was changed there", remedy="Choose another folder")


def write_json(path: Path, value: Mapping[str, object]) -> None:
    """Write a JSON object to a file; values that are not finite are rejected."""
    write_text(path, json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8; characters that are not valid in UTF-8 are escaped."""
    path.write_text(text, encoding="utf-8", errors="backslashreplace")


def write_table(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows as a CSV file. The keys of the first row are the header. None becomes an empty cell."""
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]) if rows else [], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
