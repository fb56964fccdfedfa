"""What a long job has finished so far, as lines of JSON in one file: a job that was killed goes on from it.

The first line says of what it is; the others are finished pieces of work by name. A line that was being
written when the job ended is dropped. The file belongs to one process at a time: its lock ends with the
process, however that ends.

A line outlives its process as soon as it is kept. It outlives a loss of power after a second at most, so that
a job of a thousand short pieces is not held up by the disk; with ``always``, at once.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from mrdamper.errors import InputError
from mrdamper.notes import Note
from mrdamper.runtime.locks import lock

OnNote = Callable[[Note], None]
"""Takes a note of what is done with an earlier checkpoint."""

_LONGEST_UNSYNCED_S = 1.0


class Checkpoint:
    """A file of finished pieces of work; opened, it holds what is already done.

    Parameters
    ----------
    head : of what it is; with another head it is not taken
    resume : go on with what the file holds; else it begins anew
    always : every line is on the disk when ``keep`` returns

    Attributes
    ----------
    finished : set by a job whose work has come to its end: its checkpoint is no longer needed

    Raises
    ------
    InputError
        It is of other work, another process has it, or it cannot be written.
    """

    def __init__(self, path: Path, head: Mapping[str, Any], *, resume: bool, always: bool = False) -> None:
        self.path = path
        self.done: dict[str, Any] = {}
        self.finished = False
        self._always, self._synced = always, -_LONGEST_UNSYNCED_S
        self._file = _taken(path)
        try:
            if resume:
                self._read(head)
            else:
                self._file.truncate(0)
        except BaseException:
            self._file.close()
            raise
        if not path.stat().st_size:
            try:
                self._write(dict(head))
            except BaseException:
                self.close()
                raise

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        """Keep a finished piece of work."""
        self._write({"name": key, "result": value})
        self.done[key] = value

    def close(self) -> None:
        """Let go of the file; one that is no longer needed, or holds nothing, vanishes."""
        if self.finished or not self.done:
            self.path.unlink(missing_ok=True)
        self._file.close()

    def _write(self, value: Mapping[str, Any]) -> None:
        try:
            self._file.write(json.dumps(value).encode() + b"\n")
            self._file.flush()
            now = time.monotonic()
            if self._always or now - self._synced >= _LONGEST_UNSYNCED_S:
                os.fsync(self._file.fileno())
                self._synced = now
        except OSError as fault:
            with suppress(OSError):
                self._file.close()  # what it still holds is torn, and is dropped
            raise InputError(
                place=self.path,
                found=(
                    f"cannot write there: {fault.strerror}; make room. What was finished is kept: the same "
                    "command with ⟦--resume⟧ goes on"
                ),
            ) from fault

    def _read(self, head: Mapping[str, Any]) -> None:
        """Take whole lines; cut off what was being written when the job ended."""
        rows: list[Any] = []
        whole = 0
        for line, end in _lines(self.path):
            try:
                rows.append(json.loads(line))
            except ValueError:
                break
            whole = end
        if rows and rows[0] != json.loads(json.dumps(head)):
            raise InputError(
                place=self.path,
                found=f"holds results of {_apart(rows[0], head)}",
                expected="those of this one",
                remedy="Choose another ⟦--out⟧, or remove that file to begin anew",
            )
        self.done = {row["name"]: row["result"] for row in rows[1:]}
        self._file.truncate(whole)


def _taken(path: Path) -> BinaryIO:
    """Open a file to append to, for this process alone."""
    while True:
        try:
            file = path.open("ab")
        except OSError as fault:
            raise InputError(
                place=path, found=f"cannot write there: {fault.strerror}; choose another ⟦--out⟧"
            ) from fault
        if lock(file.fileno()) is False:
            file.close()
            raise InputError(
                place=path,
                found="another run is at work with it",
                expected="none",
                remedy="Wait until it has ended, or choose another ⟦--out⟧",
            )
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        file.close()  # the run before this one had it, and has just removed it


def _lines(path: Path) -> Iterator[tuple[bytes, int]]:
    """Yield whole lines, each with the place in the file at which it ends."""
    end = 0
    with path.open("rb") as file:
        for line in file:
            end += len(line)
            if line.endswith(b"\n"):
                yield line, end


def _apart(found: Any, head: Mapping[str, Any]) -> str:  # noqa: ANN401 - whatever JSON holds
    """Say in what two heads differ."""
    if not isinstance(found, dict):
        return "something else"
    wanted = json.loads(json.dumps(head))
    keys = [key for key in {**wanted, **found} if wanted.get(key) != found.get(key)]
    return f"another run (another {', '.join(keys)})"
