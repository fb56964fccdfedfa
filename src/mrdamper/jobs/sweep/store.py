"""Store the results of a sweep in a file of its folder, one line of JSON for each finished task.

Each result is flushed to disk when its task is finished, so that a killed sweep can be resumed. An incomplete
last line is removed. Only one process at a time can open the file.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import lock

RESULTS_FILE = "sweep.jsonl"
_KEPT = "The finished results are stored. Make room, then use --resume"


class Store:
    """The results of the finished tasks of one sweep, in a file that is open for appending."""

    def __init__(self, path: Path, file: BinaryIO, *, resume: bool) -> None:
        self._path, self._file, self._resume = path, file, resume
        self._head: dict[str, Any] | None = None
        self.done: dict[str, dict[str, Any]] = {}
        self._read()

    def begin(self, head: Mapping[str, Any]) -> None:
        """Write ``head``, which identifies the sweep, or compare it with the stored head.

        Raises
        ------
        InputError
            If the folder contains results of a different sweep.
        """
        if self._head is None:
            self._write(head)
        elif self._head != dict(head):
            names = [name for name in head if self._head.get(name) != head[name]]
            raise InputError(
                f"holds results of another sweep (different {', '.join(names)})",
                place=self._path,
                expected="results of the same sweep",
                remedy="Choose another --out",
            )

    def add(self, name: str, result: dict[str, Any]) -> None:
        """Store the result of the task ``name`` and flush it to disk."""
        self._write({"name": name, "result": result})
        self.done[name] = result

    def _write(self, value: Mapping[str, Any]) -> None:
        try:
            self._file.write(json.dumps(value).encode() + b"\n")
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as fault:
            raise InputError(
                f"cannot write there: {fault.strerror}", place=self._path, remedy=_KEPT
            ) from fault

    def _read(self) -> None:
        """Read the complete lines of the file, and remove an incomplete last line of a killed sweep."""
        whole, rows = 0, []
        for line in self._path.read_bytes().splitlines(keepends=True):
            try:
                rows.append(json.loads(line))
            except ValueError:
                break
            if not line.endswith(b"\n"):
                break
            whole += len(line)
        if rows and not self._resume:
            raise InputError(
                "holds results of a sweep",
                place=self._path.parent,
                expected="an empty folder",
                remedy="Use --resume to go on with it, or another --out",
            )
        if rows and whole:
            self._head = rows[0]
            self.done = {row["name"]: row["result"] for row in rows[1:]}
        self._file.truncate(whole)


@contextmanager
def open_store(folder: Path, *, resume: bool) -> Iterator[Store]:
    """Open the results file of a sweep and lock the file against other processes.

    Raises
    ------
    InputError
        If the folder is not writable, another sweep is using the folder, or the folder contains results and
        ``resume`` is false.
    """
    path = folder / RESULTS_FILE
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("ab")
    except OSError as fault:
        raise InputError(
            f"cannot write there: {fault.strerror}", place=folder, remedy="Choose another --out"
        ) from fault
    try:
        with file:
            if lock(file.fileno()) is False:
                raise InputError(
                    "another sweep is at work there", place=folder, remedy="Wait, or choose another --out"
                )
            yield Store(path, file, resume=resume)
    finally:
        if path.exists() and not path.stat().st_size:
            path.unlink()
