"""``mrdamper cycles``: the figures of every cycle of a record that no memory holds.

The record is read in batches, cycles are written as they come; for the page and the summary, cycles are put
together in groups, of which there are fewer than two times ``MOST_GROUPS``. Figures are what was measured: no
model is used.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mrdamper.app.answers import Json
from mrdamper.app.outputs import staged, write_json
from mrdamper.data.cycle_stream import CycleCounter, CycleFigures
from mrdamper.data.diagnosis.finding import worst_first
from mrdamper.data.streaming import BATCH_ROWS, LongRecord, open_record
from mrdamper.models.card_reading import read_card
from mrdamper.quantities import FloatArray

__all__ = ["FIGURES", "MOST_GROUPS", "Groups", "curves_of", "cycles"]

MOST_GROUPS = 2048
"""Of cycles, in the page and the summary; at twice as many, two neighbours become one."""

_ZERO_CELSIUS_K = 273.15
_TREND = 1000.0  # cycles
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

Report = Callable[[int, int | None, int], None]
"""Told how far the job is: rows read, rows in all where that is known, cycles found."""


@dataclass(slots=True)
class Groups:
    """Cycles in groups of equal size, in order: of each figure its mean, least and most.

    Group k holds the cycles from k * size + 1 on; the last may be shorter. A group's figures do not depend on
    how the cycles came.
    """

    size: int = 1
    count: FloatArray = field(default_factory=lambda: np.empty(0))
    mean: FloatArray = field(default_factory=lambda: np.empty((0, 0)))  # (groups, figures)
    least: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    most: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    _waiting: list[FloatArray] = field(default_factory=list)  # cycles of a group that is not whole

    def feed(self, values: FloatArray) -> None:
        """Take the figures of the next cycles, shape (m, figures)."""
        self._waiting.append(values)
        if sum(map(len, self._waiting)) < self.size:
            return
        every = np.concatenate(self._waiting)
        while len(every) >= self.size:
            room = (2 * MOST_GROUPS - len(self.count)) * self.size
            whole = min(len(every), room) // self.size * self.size
            self._take(every[:whole])
            every = every[whole:]
            if len(self.count) == 2 * MOST_GROUPS:
                self._halve()
        self._waiting = [every]

    def close(self) -> None:
        """There are no more cycles."""
        left = np.concatenate(self._waiting) if self._waiting else np.empty((0, 0))
        self._waiting = []
        if len(left):
            self.size, whole = len(left), self.size
            self._take(left)
            self.size = whole

    @property
    def number(self) -> FloatArray:
        """Mean number of the cycles in each group, the first cycle being 1; shape (groups,)."""
        return np.asarray(self.size * np.arange(len(self.count)) + 0.5 * (self.count + 1.0))

    def trend(self, k: int) -> float | None:
        """Return the slope of a figure over the number of the cycle, by least squares through the groups."""
        y = self.mean[:, k] if len(self.count) else self.count
        known = np.isfinite(y)
        if known.sum() < 2:
            return None
        weight, number, y = self.count[known], self.number[known], y[known]
        from_mean = number - np.average(number, weights=weight)
        return float(np.sum(weight * from_mean * y) / np.sum(weight * from_mean**2))

    def _take(self, values: FloatArray) -> None:
        parts = values.reshape(-1, self.size, values.shape[1])
        made = (parts.mean(axis=1), parts.min(axis=1), parts.max(axis=1))
        self.count = np.concatenate([self.count, np.full(len(parts), float(self.size))])
        if not self.mean.size:
            self.mean, self.least, self.most = made
        else:
            self.mean = np.concatenate([self.mean, made[0]])
            self.least = np.concatenate([self.least, made[1]])
            self.most = np.concatenate([self.most, made[2]])

    def _halve(self) -> None:
        self.mean = 0.5 * (self.mean[0::2] + self.mean[1::2])
        self.least = np.minimum(self.least[0::2], self.least[1::2])
        self.most = np.maximum(self.most[0::2], self.most[1::2])
        self.size *= 2
        self.count = np.full(len(self.mean), float(self.size))


def cycles(
    record: Path,
    *,
    channels: Path | None = None,
    flip_force: bool = False,
    least_stroke_mm: float | None = None,
    model: Path | None = None,
    batch_rows: int = BATCH_ROWS,
    out: Path | None = None,
    curves: bool = False,
    report: Report | None = None,
) -> Json:
    """Count a record's cycles; with ``out`` write cycles.csv, cycles.html and summary.json there.

    ``model`` is a card, replayed over the record beside what was measured.

    Ctrl-C ends the reading: what was counted until then is kept, ``cancelled`` says so.

    Returns
    -------
    The answer of ``--json``; with ``curves`` what the page draws beside it, ``curves_of`` its groups.

    Raises
    ------
    InputError
        The record cannot be read, or nothing in it can be used.
    """
    opened = open_record(record, channels)
    if model is not None:
        read_card(model)
    counter = CycleCounter(
        record.name,
        force_sign=-1.0 if flip_force else 1.0,
        least_stroke_m=None if least_stroke_mm is None else 1e-3 * least_stroke_mm,
    )
    if out is None:
        answer, groups = _run(opened, counter, batch_rows, None, report)
        return answer | {"curves": curves_of(groups)} if curves else answer
    with staged(out) as beside:
        with (beside / "cycles.csv").open("wb") as table:
            answer, groups = _run(opened, counter, batch_rows, table, report)
        from mrdamper.app.cycles_page import render_cycles

        answer |= {name: str(out / file) for name, file in _FILES.items()}
        (beside / "cycles.html").write_text(render_cycles(answer, groups), encoding="utf-8")
        write_json(beside / "summary.json", answer)
    return answer | {"curves": curves_of(groups)} if curves else answer


def curves_of(groups: Groups) -> Json:
    """Return the figures of groups as lists: of each its mean, and least and most where groups have several.

    ``cycle`` is the mean number of a group's cycles; None stands where a figure is not known.
    """
    sides = {"mean": groups.mean, "least": groups.least, "most": groups.most}
    shown = sides if groups.size > 1 else {"mean": groups.mean}
    return {
        "cycle": groups.number.tolist(),
        "figures": {
            name: {side: _listed(values[:, k]) for side, values in shown.items()}
            for k, name in enumerate(FIGURES)
            if len(groups.count) and np.isfinite(groups.mean[:, k]).any()
        },
    }


def _listed(values: FloatArray) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values]


_FILES = {"report": "cycles.html", "file": "cycles.csv", "summary_file": "summary.json"}


def _run(
    opened: LongRecord,
    counter: CycleCounter,
    batch_rows: int,
    table: BinaryIO | None,
    report: Report | None,
) -> tuple[Json, Groups]:
    groups, found = Groups(), 0

    def take(done: CycleFigures) -> None:
        nonlocal found
        if len(done) or (table is not None and not table.tell()):
            columns = _columns(done, found, opened.command_unit)
            if table is not None:
                _write(table, columns)
            if len(done):
                groups.feed(np.stack([columns[name] for name in FIGURES], axis=1))
            found += len(done)

    cancelled = False
    with _interrupt_is_noted() as noted:
        for batch in opened.batches(rows=batch_rows):
            take(counter.feed(batch))
            if report is not None:
                report(counter.rows, opened.rows, found)
            if noted:
                cancelled = True
                break
    take(counter.close())
    groups.close()
    return _answer(opened, counter, groups, cancelled=cancelled), groups


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
        "temperature_degC": done.temperature_K - _ZERO_CELSIUS_K,
        f"command_{command_unit}": done.command,
        "samples": done.samples,
    }


def _write(table: BinaryIO, columns: _Columns) -> None:
    """Write rows as CSV, the header first; what is not known is an empty cell."""
    import polars as pl

    frame = pl.DataFrame(columns).fill_nan(None)
    frame.write_csv(table, include_header=not table.tell())


def _answer(opened: LongRecord, counter: CycleCounter, groups: Groups, *, cancelled: bool) -> Json:
    count = groups.count
    figures: dict[str, Json] = {}
    for k, name in enumerate(FIGURES):
        mean = groups.mean[:, k] if len(count) else count
        known = np.isfinite(mean)
        if not known.any():
            continue
        slope = groups.trend(k)
        average = float(np.average(mean[known], weights=count[known]))
        figures[name] = {
            "mean": average,
            "least": float(np.nanmin(groups.least[:, k])),
            "most": float(np.nanmax(groups.most[:, k])),
            "first": float(mean[known][0]),
            "last": float(mean[known][-1]),
            "trend_per_1000_cycles": None if slope is None else _TREND * slope,
        }
    energy = groups.mean[:, FIGURES.index("energy_J")] @ count if len(count) else 0.0
    least = counter.least_stroke_m
    return {
        "record": str(opened.path),
        "understood": opened.understood,
        "rows": counter.rows,
        "step_s": counter.step_s,
        "least_stroke_mm": None if least is None else 1e3 * least,
        "cycles": counter.cycles,
        "broken_cycles": counter.broken,
        "energy_J": float(energy),
        "group_cycles": groups.size,
        "figures": figures,
        "findings": [dict(each.to_dict()) for each in sorted(counter.findings(), key=worst_first)],
        "cancelled": cancelled,
    }


@contextmanager
def _interrupt_is_noted() -> Iterator[list[bool]]:
    """Give a list that is no longer empty after Ctrl-C; a second one ends the program."""
    noted: list[bool] = []
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        noted.append(True)
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)
