"""Errors of a model by run, as JSON and as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rich.console import Console
from rich.table import Table as RichTable

from mrdamper.identify.scores import RunError, Split, summary
from mrdamper.jobs.intervals import ForceInterval
from mrdamper.report.sections import Column, Table, terminal_table
from mrdamper.schema import Json, finite_or_none

NO_FORCES: Mapping[str, ForceInterval] = MappingProxyType({})
_SPLITS: tuple[Split, ...] = ("training", "held_out")


def by_split(errors: Iterable[RunError]) -> dict[str, dict[str, float]]:
    """Return median, worst, and worst with current of ``nrmse_percent``, by split."""
    every = tuple(errors)
    parts = {split: [error for error in every if error.split == split] for split in _SPLITS}
    return {split: summary(part) for split, part in parts.items() if part}


def summaries(errors: Iterable[RunError]) -> Json:
    """Return median and worst of ``nrmse_percent`` by split as JSON."""
    return {split: in_percent(values) for split, values in by_split(errors).items()}


def in_percent(values: Mapping[str, float]) -> Json:
    """Return a summary whose keys contain the unit."""
    return {f"{name}_nrmse_percent": finite_or_none(value) for name, value in values.items()}


@dataclass(frozen=True, slots=True)
class PooledError:
    """The RMS error of the runs of one motion, temperature (rounded to 1 degC) and split."""

    motion: str
    temperature_degC: int
    split: Split
    runs: int
    rmse_N: float


def pooled_by_temperature(errors: Iterable[RunError]) -> tuple[PooledError, ...]:
    """Return the errors of all currents pooled by temperature. Runs without a temperature are ignored."""
    groups: dict[tuple[str, int, Split], list[float]] = {}
    for error in errors:
        if error.temperature_degC is not None:
            key = (error.motion, round(error.temperature_degC), error.split)
            groups.setdefault(key, []).append(error.rmse_N**2)
    return tuple(
        PooledError(motion, degrees, split, len(squares), math.sqrt(sum(squares) / len(squares)))
        for (motion, degrees, split), squares in sorted(groups.items())
    )


def pooled_json(errors: Iterable[RunError]) -> list[Json]:
    """Return the pooled errors as JSON."""
    return [
        {
            "motion": each.motion,
            "temperature_degC": each.temperature_degC,
            "split": each.split,
            "runs": each.runs,
            "rmse_N": each.rmse_N,
        }
        for each in pooled_by_temperature(errors)
    ]


# --------------------------------------------------------------------------------------------- the terminal


def show_errors(errors: Sequence[RunError], law: str, console: Console) -> None:
    """Print the error of every run, or of many runs the pooled errors and the worst runs."""
    title = f"{law}: error by run"
    if len(errors) <= 40:  # More runs are shown by motion and temperature.
        console.print(_terminal_table(errors, title))
        return
    pooled = pooled_by_temperature(errors)
    if pooled:
        console.print(_pooled_table(pooled, law))
    worst = sorted(errors, key=lambda error: -error.nrmse_percent)[:10]
    console.print(
        _terminal_table(worst, f"{title}, the {len(worst)} worst of {len(errors)} runs (errors.csv has all)")
    )


def _terminal_table(errors: Sequence[RunError], title: str) -> RichTable:
    ordered = sorted(errors, key=lambda e: (e.split != "training", e.command == 0.0))
    return error_table(ordered, title=title).printed()


def summary_lines(errors: Iterable[RunError]) -> Iterator[str]:
    """Generate a line for each split: median and worst errors."""
    for split, values in by_split(errors).items():
        text = ", ".join(
            f"{word} {percent(values[name])}"
            for word, name in (
                ("median", "median"),
                ("worst with current", "worst_above_zero"),
                ("worst", "worst"),
            )
        )
        yield f"{split.replace('_', ' ')}: {text}"


def show_summaries(errors: Iterable[RunError], console: Console) -> None:
    """Print median and worst errors by split."""
    for line in summary_lines(errors):
        split, _, text = line.partition(":")
        console.print(f"[bold]{split}[/bold]:{text}")


def percent(value: float) -> str:
    """Format a percentage, with a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.2f} %"


# ------------------------------------------------------------------------------------------- the tables


def error_table(
    errors: Sequence[RunError], forces: Mapping[str, ForceInterval] = NO_FORCES, title: str = "Error by run"
) -> Table[RunError]:
    """Return the table of errors by run, with the uncertainty of the forces if ``forces`` is given."""

    def interval(error: RunError) -> str | None:
        found = forces.get(error.name)
        return None if found is None else f"{found.rmse_N[0]:.1f} to {found.rmse_N[1]:.1f}"

    columns: list[Column[RunError]] = [
        Column("run", "name", names_run=True),
        Column("split", lambda error: error.split.replace("_", " ")),
        Column("motion", "motion", printed=False),
        Column("command", _command, form="s"),
        Column("RMS error", "rmse_N", "N", ".1f"),
        Column("error", "nrmse_percent", "%", ".2f"),
        Column("whole run", "nrmse_whole_percent", "%", ".2f"),
        Column("offset free", "nrmse_offset_free_percent", "%", ".2f"),
        Column("peak, measured", "peak_measured_N", "N", ".0f", printed=False),
        Column("peak, model", "peak_model_N", "N", ".0f", printed=False),
        Column("work, measured", "energy_measured_J", "J", ".3g", printed=False),
        Column("work, model", "energy_model_J", "J", ".3g", printed=False),
    ]
    if any(error.temperature_degC is not None for error in errors):
        columns.insert(4, Column("temperature", "temperature_degC", "degC", ".0f", printed=False))
    if forces:
        columns.append(Column("RMS error, 90 %", interval, "N", "s", printed=False))
        width = lambda error: forces[error.name].width_N if error.name in forces else None  # noqa: E731
        columns.append(Column("width of the force, 90 %", width, "N", ".3g", printed=False))
    return Table(
        title=title,
        columns=columns,
        rows=errors,
        caption="Error: RMS error divided by the standard deviation of the measured force. Whole run: "
        "including "
        "the start of the run. Offset free: after adding the best constant force. Work: energy of a "
        "cycle, or of the whole run for a motion without a period. Held-out runs are highlighted.",
        held=lambda error: error.split == "held_out",
        part=lambda error: (error.split, error.command == 0.0),
        folded=f"All {len(errors)} runs" if len(errors) > 48 else "",  # A longer table is folded on a page.
    )


def _command(error: RunError) -> str:
    return "varies" if error.command is None else f"{error.command:g} {error.command_unit}"


def _pooled_table(pooled: Sequence[PooledError], law: str) -> RichTable:
    """Return the RMS error by motion and temperature. Held-out errors are in brackets."""
    degrees = sorted({each.temperature_degC for each in pooled})
    rows = []
    for motion in dict.fromkeys(each.motion for each in pooled):
        cells = []
        for degree in degrees:
            found = [each for each in pooled if (each.motion, each.temperature_degC) == (motion, degree)]
            values = [
                f"{each.rmse_N:.1f}" if each.split == "training" else f"({each.rmse_N:.1f})" for each in found
            ]
            cells.append(" ".join(values))
        rows.append((motion, *cells))
    title = f"{law}: RMS error in N of all currents, held-out runs in brackets"
    names = ("motion", *(f"{degree} degC" for degree in degrees))
    return terminal_table(title, names, rows, left=("motion",))
