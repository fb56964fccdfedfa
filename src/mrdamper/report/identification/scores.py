"""Errors of a model by run, as JSON and as tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from rich.console import Console

from mrdamper.identify.scores import RunError, Split, summary
from mrdamper.jobs.evaluate import ForceInterval
from mrdamper.report.identification.campaign import levels_of, pooled_rms
from mrdamper.report.sections import Column, Table
from mrdamper.schema import Json

NO_FORCES: Mapping[str, ForceInterval] = MappingProxyType({})
_SPLITS: tuple[Split, ...] = ("training", "held_out")


def by_split(errors: Iterable[RunError]) -> dict[str, dict[str, float]]:
    """Return error statistics [%] of the training runs and of the held-out runs."""
    every = tuple(errors)
    parts = {split: [error for error in every if error.split == split] for split in _SPLITS}
    return {split: summary(part) for split, part in parts.items() if part}


def summaries(errors: Iterable[RunError]) -> Json:
    """Return the statistics of ``by_split``, keys such as ``median_nrmse_percent``."""
    return {
        split: {f"{name}_nrmse_percent": value for name, value in values.items()}
        for split, values in by_split(errors).items()
    }


def show_errors(errors: Sequence[RunError], law: str, console: Console) -> None:
    """Print the error of every run. For more than 40 runs, print pooled errors and the worst runs."""
    title, shown = f"{law}: error by run", errors
    if len(errors) > 40:  # A longer table does not fit on a terminal.
        console.print(pooled_table(errors).printed())
        shown = sorted(errors, key=lambda error: -error.nrmse_percent)[:10]
        title += f", the {len(shown)} worst of {len(errors)} runs (errors.csv has all)"
    ordered = sorted(shown, key=lambda e: (e.split != "training", e.command == 0.0))
    console.print(error_table(ordered, title=title).printed())


def show_summaries(errors: Iterable[RunError], console: Console) -> None:
    """Print the median and the worst error of training runs and of held-out runs."""
    words = {"median": "median", "worst with current": "worst_above_zero", "worst": "worst"}
    for split, values in by_split(errors).items():
        text = ", ".join(f"{word} {percent(values[name])}" for word, name in words.items())
        console.print(f"[bold]{split.replace('_', ' ')}[/bold]: {text}")


def percent(value: float) -> str:
    """Format a percentage, with a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.2f} %"


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


def pooled_table(errors: Sequence[RunError]) -> Table[tuple[str, Sequence[RunError]]]:
    """Return a table of pooled RMS errors: a row for each motion, a column for each temperature or current.

    Held-out errors are in brackets.
    """
    levels = levels_of(errors)
    placed = [error for error in errors if levels.level_of(error) is not None]

    def column(level: float) -> Column[tuple[str, Sequence[RunError]]]:
        def value(row: tuple[str, Sequence[RunError]]) -> str | None:
            parts = []
            for split, form in (("training", "{:.1f}"), ("held_out", "({:.1f})")):
                members = [e for e in row[1] if levels.level_of(e) == level and e.split == split]
                if members:
                    parts.append(form.format(pooled_rms(members)))
            return " ".join(parts) or None

        return Column(levels.label(level), value, form="s")

    motions = dict.fromkeys(error.motion for error in placed)
    rows = [(motion, [error for error in placed if error.motion == motion]) for motion in motions]
    return Table(
        title="RMS error in N by motion",
        columns=[Column("motion", lambda row: row[0]), *map(column, levels.values)],
        rows=[*rows, ("all motions", placed)],
        caption="RMS error in N of the runs of one motion. Held-out runs are in brackets.",
    )
