"""Results as they come: one line of JSON each, on the disk before the next one is asked for.

A sweep that is killed keeps every result that was told. The file itself is the business of ``checkpoint``; it
stays in the sweep's folder when the sweep is done.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path

from mrdamper.errors import InputError, option
from mrdamper.jobs.sweep.plan import What
from mrdamper.runtime.checkpoint import Checkpoint, OnNote
from mrdamper.schema import Json

CHECKPOINT = "sweep.jsonl"


class Store:
    """The checkpoint of one sweep in its folder; opened, it holds what is already done.

    Raises
    ------
    InputError
        The folder holds results and ``resume`` was not asked for, they are of another plan, or another sweep
        is at work there.
    """

    def __init__(self, folder: Path, head: Json, *, resume: bool) -> None:
        path = folder / CHECKPOINT
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as fault:
            raise InputError(
                f"cannot write there: {fault.strerror}",
                place=folder,
                remedy=f"choose another {option('out')}",
            ) from fault
        if not resume and path.exists() and path.stat().st_size > 0:
            raise InputError(
                "holds results of a sweep",
                place=folder,
                expected="an empty place",
                remedy=f"Use {option('resume')} to go on with it, or another {option('out')}",
            )
        self.finished = False  # of no account: the results stay where they are
        self._kept = Checkpoint(path, head, resume=True, always=True)

    @property
    def done(self) -> Mapping[str, What]:
        return self._kept.done

    def add(self, name: str, result: What) -> None:
        """Keep a result; it is on the disk when this returns."""
        self._kept.keep(name, result)

    def close(self) -> None:
        self._kept.close()


@contextmanager
def open_store(folder: Path, head: Json, *, resume: bool | None, on_note: OnNote | None) -> Iterator[Store]:
    """Give the checkpoint of a sweep, as jobs that can be resumed are given one."""
    with closing(Store(folder, head, resume=bool(resume))) as store:
        yield store
