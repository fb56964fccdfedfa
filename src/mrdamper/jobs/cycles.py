"""``mrdamper cycles``: the figures of every cycle of a record that no memory holds.

The record is read in batches, cycles are written as they come; for the page and the summary, cycles are put
together in groups, of which there are fewer than two times ``MOST_GROUPS``. Figures are what was measured: no
model is used.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import BATCH_ROWS, LongRecord, open_record
from mrdamper.data.cycle_groups import Groups
from mrdamper.data.cycles import CycleCounter, CycleFigures
from mrdamper.data.diagnosis.finding import worst_first
from mrdamper.identify.cycle_errors import FIGURES as MODEL_FIGURES
from mrdamper.identify.cycle_errors import ModelOver, columns_of, open_model
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.outputs import atomic_output, write_json
from mrdamper.runtime.signals import on_interrupt
from mrdamper.schema import Json

__all__ = ["FIGURES", "cycles"]

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


def cycles(  # noqa: PLR0913 - a job's options, by keyword
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
    The answer of ``--json``; with ``curves`` beside it those of the page, as ``Groups.curves`` gives them.

    Raises
    ------
    InputError
        The record cannot be read, or nothing in it can be used.
    """
    opened = open_record(record, channels)
    along = None if model is None else open_model(model, opened, flip_force=flip_force)
    counter = CycleCounter(
        record.name,
        force_sign=-1.0 if flip_force else 1.0,
        least_stroke_m=None if least_stroke_mm is None else 1e-3 * least_stroke_mm,
    )
    if out is None:
        answer, groups = _run(opened, counter, along, batch_rows, None, report)
        return answer | {"curves": groups.curves()} if curves else answer
    with atomic_output(out) as beside:
        with (beside / "cycles.csv").open("wb") as table:
            answer, groups = _run(opened, counter, along, batch_rows, table, report)
        from mrdamper.report.cycles import render_cycles

        answer |= {name: str(out / file) for name, file in _FILES.items()}
        (beside / "cycles.html").write_text(render_cycles(answer, groups), encoding="utf-8")
        write_json(beside / "summary.json", answer)
    return answer | {"curves": groups.curves()} if curves else answer


_FILES = {"report": "cycles.html", "file": "cycles.csv", "summary_file": "summary.json"}


def _run(
    opened: LongRecord,
    counter: CycleCounter,
    along: ModelOver | None,
    batch_rows: int,
    table: BinaryIO | None,
    report: Report | None,
) -> tuple[Json, Groups]:
    groups, found, read = Groups(FIGURES + (MODEL_FIGURES if along is not None else ())), 0, 0

    def take(done: CycleFigures) -> None:
        nonlocal found
        if len(done) or (table is not None and not table.tell()):
            columns = _columns(done, found, opened.command_unit)
            if along is not None:
                columns |= columns_of(done) or dict.fromkeys(MODEL_FIGURES, np.empty(0))
                along.add(done)
            if table is not None:
                _write(table, columns)
            if len(done):
                groups.feed(np.stack([columns[name] for name in groups.names], axis=1))
            found += len(done)

    cancelled = False
    noted: list[bool] = []

    def note() -> None:
        if noted:  # a second time: now
            raise KeyboardInterrupt
        noted.append(True)

    with on_interrupt(note):
        for batch in opened.batches(rows=batch_rows):
            read += len(batch)
            for part in (batch,) if along is None else along.replay.step_batch(batch):
                take(counter.step_batch(part))
            if report is not None:
                report(read, opened.rows, found)
            if noted:
                cancelled = True
                break
    for part in () if along is None else along.replay.close(cut_short=cancelled):
        take(counter.step_batch(part))
    take(counter.close())
    groups.close()
    return _answer(opened, counter, along, groups, cancelled=cancelled), groups


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
    import polars as pl

    frame = pl.DataFrame(columns).fill_nan(None)
    frame.write_csv(table, include_header=not table.tell())


def _answer(
    opened: LongRecord, counter: CycleCounter, along: ModelOver | None, groups: Groups, *, cancelled: bool
) -> Json:
    figures: dict[str, Json] = {}
    for name in groups.names:
        if (found := groups.summary(name)) is not None:
            slope = found.pop("slope")
            figures[name] = {**found, "trend_per_1000_cycles": None if slope is None else _TREND * slope}
    k = groups.names.index("energy_J")
    energy = np.nan_to_num(groups.mean[:, k]) @ groups.known[:, k]
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
        "model": None if along is None else along.answer(),
        "findings": [dict(each.to_dict()) for each in sorted(counter.findings(), key=worst_first)],
        "cancelled": cancelled,
    }
