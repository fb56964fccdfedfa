"""The job ``cycles``: the figures of every cycle of a record that no memory holds.

The record is read in batches, cycles are written as they come; for the page and the summary, cycles are put
together in groups, of which there are fewer than two times ``MOST_GROUPS``.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import BATCH_ROWS, LongRecord
from mrdamper.data.cycle_groups import FigureSummary, Groups
from mrdamper.data.cycles import CycleCounter, CycleFigures
from mrdamper.data.finding import Finding, worst_first
from mrdamper.jobs.options import CyclesOptions
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.runtime.signals import on_interrupt

_USUAL = CyclesOptions()
FIGURES = (
    "period_s",
    "amplitude_mm",
    "energy_J",
    "stiffness_N_per_mm",
    "highest_force_N",
    "lowest_force_N",
    "temperature_degC",
)

_Columns = dict[str, FloatArray | NDArray[np.int64]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CyclesResult:
    """The cycles of a record, in groups, and what is wrong with the record."""

    record: LongRecord
    rows: int  # that were read
    step_s: float | None  # usual time between two rows; None before two were read
    least_stroke_m: float | None  # a smaller to-and-fro is no cycle; None before the record has moved
    cycles: int
    broken_cycles: int  # left out because the record breaks in them
    groups: Groups
    findings: tuple[Finding, ...]  # worst first
    cancelled: bool  # by an interrupt, which ended the reading

    @property
    def energy_J(self) -> float:
        """Energy that all cycles have dissipated."""
        return self.groups.total("energy_J")

    @property
    def figures(self) -> dict[str, FigureSummary]:
        """The figures over all cycles, by name; those that no cycle has are left out."""
        found = ((name, self.groups.summary(name)) for name in self.groups.names)
        return {name: summary for name, summary in found if summary is not None}


def cycles(
    record: LongRecord,
    options: CyclesOptions = _USUAL,
    *,
    on_progress: Progress = silent,
    stream: BinaryIO | None = None,
) -> CyclesResult:
    """Count a record's cycles.

    An interrupt ends the reading: what was counted until then is kept, ``cancelled`` says so; a second one
    ends the job.

    Parameters
    ----------
    stream : the cycles are written there as they come, as CSV

    Raises
    ------
    InputError
        The record cannot be read, or nothing in it can be used.
    """
    least_mm = options.least_stroke_mm
    counter = CycleCounter(record.path.name, least_stroke_m=None if least_mm is None else 1e-3 * least_mm)
    taken = _Taken(record.command_unit, stream)
    asked: list[bool] = []

    def note() -> None:
        if asked:  # a second time: now
            raise KeyboardInterrupt
        asked.append(True)

    read = 0
    with on_interrupt(note):
        for batch in record.batches(rows=options.batch_rows or BATCH_ROWS):
            read += len(batch)
            taken.add(counter.step_batch(batch))
            on_progress(ProgressUpdate(done=read, total=record.rows, text=f"{taken.count:,} cycles"))
            if asked:
                break
    taken.add(counter.close())
    taken.groups.close()
    return CyclesResult(
        record=record,
        rows=counter.rows,
        step_s=counter.step_s,
        least_stroke_m=counter.least_stroke_m,
        cycles=counter.cycles,
        broken_cycles=counter.broken,
        groups=taken.groups,
        findings=tuple(sorted(counter.findings(), key=worst_first)),
        cancelled=bool(asked),
    )


class _Taken:
    """The cycles that were found so far, in groups and in a table."""

    def __init__(self, command_unit: str, table: BinaryIO | None) -> None:
        self.groups = Groups(FIGURES)
        self.count = 0
        self._unit, self._table = command_unit, table

    def add(self, done: CycleFigures) -> None:
        """Take the next cycles; the table gets its header even where there is none."""
        if not (len(done) or (self._table is not None and not self._table.tell())):
            return
        columns = _columns(done, self.count, self._unit)
        if self._table is not None:
            _write(self._table, columns)
        if len(done):
            self.groups.feed(np.stack([columns[name] for name in self.groups.names], axis=1))
        self.count += len(done)


def _columns(done: CycleFigures, before: int, command_unit: str) -> _Columns:
    """Return the columns of cycles.csv."""
    number = np.arange(before + 1, before + len(done) + 1, dtype=np.int64)
    return {
        "cycle": number,
        "row": done.row,
        "start_s": done.start_s,
        "period_s": done.period_s,
        "amplitude_mm": 1e3 * done.amplitude_m,
        "energy_J": done.energy_J,
        "stiffness_N_per_mm": 1e-3 * done.stiffness_N_per_m,
        "highest_force_N": done.highest_force_N,
        "lowest_force_N": done.lowest_force_N,
        "temperature_degC": done.temperature_K - ZERO_CELSIUS_K,
        f"command_{command_unit}": done.command,
        "samples": done.samples,
    }


def _write(table: BinaryIO, columns: _Columns) -> None:
    """Write rows as CSV, the header first; what is not known is an empty cell."""
    text = io.TextIOWrapper(table, encoding="utf-8", newline="", write_through=True)
    rows = csv.writer(text, lineterminator="\n")
    if not table.tell():
        rows.writerow(columns)
    cells = ([None if math.isnan(each) else each for each in column.tolist()] for column in columns.values())
    rows.writerows(zip(*cells, strict=True))
    text.detach()
