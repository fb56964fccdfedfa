"""Folders of runs: which files in them may hold any.

A folder gives its files and those of the folders in it, whose names may say what the files do not. Left out
are hidden files, notes, and folders that this program has written its results into.
"""

from __future__ import annotations

import errno
import glob
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from mrdamper.data.formats.lines.encodings import open_text_bytes
from mrdamper.data.formats.lines.header import find_data
from mrdamper.data.tables import FORMATS, HEAD_BYTES
from mrdamper.errors import InputError
from mrdamper.files import PathLike, is_folder, is_there

_RESULTS = frozenset(
    f"{name}.{kind}"
    for name in (
        "card",
        "check",
        "compare",
        "cycles",
        "derate",
        "heat",
        "heatsink",
        "summary",
        "sweep",
        "verification",
    )
    for kind in ("json", "html")
) | {"report.html", "sweep.html", "track.html", "track.json"}
_DEEPEST = 4  # folders in folders
_PROSE = frozenset({".txt", ".log"})  # what people write notes in
_OF_ANYTHING = frozenset({".bin", ".raw"})  # suffixes that other programs use too


def find_files(paths: Sequence[PathLike]) -> list[Path]:
    """Return the files that paths, folders and patterns name, in the given order.

    A file that is named twice, such as by a relative and by an absolute path, is returned once.
    """
    files: dict[Path, Path] = {}
    if not paths:
        raise InputError(found="no paths given", expected="files, folders or patterns")
    for given in paths:
        path = Path(given)
        if is_folder(path):
            inside = list(_files_below(path))
            if not inside:
                raise InputError(
                    place=path, found="no runs in this folder", expected=", ".join(sorted(_suffixes()))
                )
        elif is_there(path):
            inside = [path]
        elif glob.has_magic(str(given)):
            inside = sorted(Path(name) for name in glob.glob(str(given), recursive=True))  # noqa: PTH207
            inside = [file for file in inside if file.is_file()]
            if not inside:
                raise InputError(place=given, found="the pattern matches no file")
        else:
            raise InputError(place=path, found=_why_absent(path))
        for file in inside:
            files.setdefault(file.resolve(), file)
    return list(files.values())


def distinct_names(names: Sequence[str], sources: Sequence[str]) -> list[str]:
    """Return the names of runs, those of one name told apart by their files' folders where these differ."""
    found = list(names)
    folders = [Path(source).parent if source else None for source in sources]
    for _ in range(_DEEPEST):
        often = Counter(found)
        if len(often) == len(found):
            break
        for name in [name for name, count in often.items() if count > 1]:
            same = [k for k, other in enumerate(found) if other == name]
            if len({folders[k] for k in same}) < 2:
                continue  # no folder tells them apart
            for k in same:
                folder = folders[k]
                if folder is not None:
                    found[k], folders[k] = f"{folder.name}_{name}", folder.parent
    return found


def _suffixes() -> set[str]:
    return {suffix for known in FORMATS for suffix in known.suffixes}


def _files_below(folder: Path, depth: int = _DEEPEST) -> Iterator[Path]:
    """Give the files of runs in a folder, then those in the folders in it."""
    entries = sorted(each for each in folder.iterdir() if not each.name.startswith((".", "~$")))
    known = _suffixes()
    for file in entries:
        if not file.is_file() or file.suffix.lower() not in known or file.name in _RESULTS:
            continue
        if not (_is_prose(file) or _is_foreign(file) or _is_card(file)):
            yield file
    for inner in entries:
        if depth and inner.is_dir() and not inner.is_symlink() and not _holds_results(inner):
            yield from _files_below(inner, depth - 1)


def _holds_results(folder: Path) -> bool:
    return any((folder / name).is_file() for name in _RESULTS)


def _is_prose(file: Path) -> bool:
    """Tell whether a text is a note beside the runs: it holds words, and no two rows of numbers."""
    if file.suffix.lower() not in _PROSE:
        return False
    try:
        with open_text_bytes(file) as stream:
            head = stream.read(HEAD_BYTES)
    except (OSError, InputError):  # what cannot be read is told where it is read
        return False
    lines = head.decode("utf-8", "replace").splitlines()
    words = sum(line[:1].isalpha() for line in lines)
    return words > 0 and len(head) < HEAD_BYTES and find_data(lines)[1] is None


def _is_card(file: Path) -> bool:
    """Tell whether a JSON file is a card of a damper, whatever its name."""
    if file.suffix.lower() != ".json":
        return False
    try:
        with file.open("rb") as stream:
            return b'"schema_version"' in stream.read(512)
    except OSError:  # what cannot be read is told where it is read
        return False


def _is_foreign(file: Path) -> bool:
    """Tell whether a binary file of a suffix that many programs use is of no format that is read here."""
    if file.suffix.lower() not in _OF_ANYTHING:
        return False
    try:
        with file.open("rb") as stream:
            head = stream.read(512)
    except OSError:  # what cannot be read is told where it is read
        return False
    return not any(known.recognises(head) for known in FORMATS if file.suffix.lower() in known.suffixes)


def _why_absent(path: Path) -> str:
    try:
        path.stat()
    except OSError as error:
        if error.errno not in {errno.ENOENT, errno.ENOTDIR, errno.ELOOP}:
            return f"cannot be read: {error.strerror}"
    return "no such file or folder"
