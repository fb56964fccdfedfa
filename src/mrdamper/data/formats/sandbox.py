"""Formats that are decoded in a process of their own, because a damaged file can crash their libraries.

On some damaged bytes libhdf5 and the compiled parts of SciPy's MAT reader, of asammdf and of calamine end
the process, and Polars prints a trace of its own; a run that cannot be read must end in one message instead.
The process (``decoder``) is started at the first such file and serves the next ones; when it crashes, the
file is at fault, and another is started for the next.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from threading import RLock

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import FileOptions, Layout, OnUse, Table, Texts, require_extra
from mrdamper.errors import InputError, MrdamperError
from mrdamper.runtime.worker import (
    Answer,
    Worker,
    WorkerEndedError,
    WorkerFaultError,
    WorkerLateError,
    WorkerOptions,
)
from mrdamper.schema import Json

_DEADLINE_s = 60.0  # for one answer, and a second more for each megabyte of the file; some loop for ever
_LONGEST_DEADLINE_s = 600.0

DECODER = WorkerOptions(
    handler="mrdamper.data.formats.decoder:decoder",
    memory_bytes=12 << 30,  # three times the longest column that is read
    own_group=False,
    quiet=True,
)


class _Decoder:
    """The process that decodes, and the file that it has opened last."""

    def __init__(self) -> None:
        self.worker = Worker(DECODER)
        self._opened: tuple[int | None, Json] = (None, {})

    def open(self, path: Path, file: Json) -> Json:
        """Open a file; return what its table holds beside columns.

        A process that has served other files may have been harmed by them: a new one is asked once more.
        """
        used = self.worker.pid is not None
        try:
            answer = self._answer(path, file)
        except WorkerEndedError as fault:
            if not used:
                raise _unreadable(path, fault) from fault
            try:
                answer = self._answer(path, file)
            except WorkerEndedError as again:
                raise _unreadable(path, again) from again
        self._opened = self.worker.pid, file
        return answer.value

    def ask(self, path: Path, file: Json, question: Json) -> Answer:
        """Return the answer to a question about a file, which is opened first where it is not."""
        if self._opened != (self.worker.pid, file):
            self.open(path, file)
        try:
            return self._answer(path, question)
        except WorkerEndedError as fault:
            raise _unreadable(path, fault) from fault

    def _answer(self, path: Path, question: Json) -> Answer:
        try:
            return self.worker.ask(question, deadline_s=_deadline_s(path), room=_room)
        except (WorkerLateError, WorkerFaultError) as fault:
            raise _unreadable(path, fault) from fault
        except InputError as fault:
            raise fault.renamed(str(path.absolute()), str(path)) from fault


def sandboxed(
    format_name: str, package: str, what: str, module: str = ""
) -> Callable[[Path, FileOptions], Table]:
    """Return the reader of a format that asks the decoder; ``package`` is the library it needs there.

    ``module`` is what the library is imported as, where that is not its name.
    """

    def read(path: Path, options: FileOptions) -> Table:
        require_extra(module or package, package, what)
        file = {
            "open": str(path.absolute()),
            "format": format_name,
            "options": {"part": options.part, "delimiter": options.delimiter, "decimal": options.decimal},
        }
        with _LOCK:
            given = _DECODER.open(path, file)
        layout, rows = given["layout"], int(given["rows"])
        numbers = [name for name in given["names"] if name not in given["texts"]]
        return Table(
            names=tuple(given["names"]),
            columns=OnUse({name: partial(_column, path, file, name, rows) for name in numbers}),
            texts=OnUse({name: partial(_cells, path, file, name) for name in given["texts"]}),
            layout=Layout(**{**layout, "notes": tuple(layout["notes"])}),
            rows=rows,
            units=given["units"],
            clocks=given["clocks"],
            stamps=frozenset(given["stamps"]),
            read_rows=partial(_rows, path, file) if given["by_rows"] else None,
            step_s=given["step_s"],
            title=given["title"],
            said=tuple(given["said"]),
            more=tuple(given["more"]),
        )

    return read


def _column(path: Path, file: Json, name: str, rows: int) -> FloatArray:
    with _LOCK:
        (part,) = _DECODER.ask(path, file, {"columns": [name]}).parts
    values = _values(part)
    if len(values) > rows:
        raise InputError(
            place=path,
            found=f"column {name!r} holds {len(values)} numbers in {rows} rows",
            expected="one in each",
            remedy="The file is damaged, or holds arrays: export the run as CSV",
        )
    return values


def _cells(path: Path, file: Json, name: str) -> Texts:
    with _LOCK:
        return list(_DECODER.ask(path, file, {"text": name}).value["cells"])


def _rows(
    path: Path, file: Mapping[str, object], names: Sequence[str], start: int, count: int
) -> list[FloatArray]:
    with _LOCK:
        asked = {"rows": list(names), "start": start, "count": count}
        return [_values(part) for part in _DECODER.ask(path, dict(file), asked).parts]


def _room(size: int) -> memoryview:
    return np.empty(size // 8).data.cast("B")


def _values(part: memoryview) -> FloatArray:
    values = np.frombuffer(part, dtype=np.float64)
    values.setflags(write=False)
    return values


def _deadline_s(path: Path) -> float:
    try:
        size = path.stat().st_size
    except OSError:  # what cannot be looked at is the decoder's to tell
        size = 0
    return min(_DEADLINE_s + 1e-6 * size, _LONGEST_DEADLINE_s)


def _unreadable(path: Path, fault: MrdamperError) -> InputError:
    why = (
        f"its decoder has not come to an end in {fault.deadline_s:.0f} s"
        if isinstance(fault, WorkerLateError)
        else "its decoder has crashed"
    )
    return InputError(
        place=path,
        found=f"not a readable file: {why}. The file is damaged: copy it again, or export the run as CSV",
    )


_LOCK = RLock()
_DECODER = _Decoder()


def stop() -> None:
    """End the decoder's process; the next file starts another."""
    with _LOCK:
        _DECODER.worker.stop()


atexit.register(stop)
