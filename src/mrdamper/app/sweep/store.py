"""Results as they come: one line of JSON each, on the disk before the next one is asked for.

A sweep that is killed keeps every result that was told; the line that was being written is dropped when the
sweep goes on.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from mrdamper.app.sweep.plan import Plan, What
from mrdamper.errors import InputError

__all__ = ["CHECKPOINT", "Store"]

CHECKPOINT = "sweep.jsonl"


class Store:
    """The checkpoint of one sweep in its folder; opened, it holds what is already done.

    Raises
    ------
    InputError
        The folder holds results and ``resume`` was not asked for, or they are of another plan.
    """

    def __init__(self, folder: Path, plan: Plan, *, resume: bool) -> None:
        self._path = folder / CHECKPOINT
        head = {"plan": plan.fingerprint, "kind": plan.kind, "seed": plan.seed, "tasks": len(plan.tasks)}
        self.done: dict[str, What] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            standing = self._path.exists() and self._path.stat().st_size > 0
            if standing:
                if not resume:
                    raise InputError(
                        f"{folder}: holds results of a sweep; expected an empty place. Pass --resume to go "
                        "on with it, or another --out"
                    )
                self._read(head)
            self._file = self._path.open("ab")
        except OSError as fault:
            raise InputError(
                f"{folder}: cannot write there: {fault.strerror}; choose another --out"
            ) from fault
        if not standing or not self._path.stat().st_size:
            self._write(head)

    def add(self, name: str, result: What) -> None:
        """Keep a result; it is on the disk when this returns."""
        self._write({"name": name, "result": result})
        self.done[name] = result

    def close(self) -> None:
        self._file.close()

    def _write(self, value: What) -> None:
        self._file.write(json.dumps(value, allow_nan=False).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self, head: What) -> None:
        """Take whole lines; cut off what was being written when the sweep ended."""
        lines = self._path.read_bytes().split(b"\n")
        whole = 0
        rows: list[Any] = []
        for line in lines[:-1]:
            try:
                rows.append(json.loads(line))
            except ValueError:
                break
            whole += len(line) + 1
        if rows and rows[0] != head:
            raise InputError(
                f"{self._path}: holds results of another plan; expected those of this one. The plan or the "
                "files that it names have changed: choose another --out"
            )
        self.done = {row["name"]: row["result"] for row in rows[1:]}
        with self._path.open("r+b") as file:
            file.truncate(whole)
