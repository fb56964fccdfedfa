"""Output of the command ``simulate``: range of the force, loops, all samples."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.arrays import FloatArray, rms
from mrdamper.jobs.simulate import SimulateResult
from mrdamper.models.card_draws import INTERVAL_PROBABILITY
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import Report, WrittenFile, csv_file
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import INK, MEASURED, TRAINING
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.sections import table_of
from mrdamper.schema import Json


def _fields(found: SimulateResult) -> Json:
    path = found.trajectory
    scored = slice(found.scored_from, None)
    error = None if found.measured is None else rms((found.force - found.measured)[scored])
    return {
        "title": found.title,
        "motion": found.motion,
        "samples": len(path),
        "step_s": path.step,
        "force_N": [float(found.force.min()), float(found.force.max())],
        "power_W": float(np.mean(found.force * path.velocity)),
        "rmse_N": error,
        "interval_width_N": None if found.interval is None else _width(found.interval),
    }


def _width(interval: tuple[FloatArray, FloatArray]) -> float:
    return float(np.mean(interval[1] - interval[0]))


def _summary(found: SimulateResult) -> list[str]:
    answer = _fields(found)
    low, high = answer["force_N"]
    lines = [
        f"{found.motion}: {answer['samples']} samples of {1e3 * answer['step_s']:g} ms",
        f"force {low:.4g} to {high:.4g} N, mean dissipated power {answer['power_W']:.4g} W",
    ]
    if found.measured is not None:
        lines.append(f"RMS error {answer['rmse_N']:.4g} N compared with the measured force")
    if found.interval is not None:
        width = f"mean width {answer['interval_width_N']:.3g} N"
        lines.append(f"{100.0 * INTERVAL_PROBABILITY:.0f} % interval of the force: {width}")
    return lines


def _show(found: SimulateResult, console: Console) -> None:
    for line in _summary(found):
        console.print(line, markup=False)


def _figure(found: SimulateResult) -> Figure:
    """Return a figure of force versus displacement and velocity; a measured force is grey."""
    point_count_max = 4000  # More points make the figure large but not more accurate.
    path = found.trajectory
    thin = slice(None, None, max(1, len(path) // point_count_max))
    drawn: list[Panel] = []
    for x_m, label in ((path.displacement, "displacement, mm"), (path.velocity, "velocity, mm/s")):
        x = 1e3 * x_m[thin]
        lines = [Line(x, end[thin], INK, width=0.5, style=":") for end in found.interval or ()]
        if found.measured is not None:
            lines.insert(0, Line(x, found.measured[thin], MEASURED, width=2.6))
        lines.append(Line(x, found.force[thin], TRAINING, width=0.9))
        drawn.append(Panel("", label, lines, y_label="" if drawn else "force, N"))
    return panel_figure(drawn, height=2.7, share="row")


def _rows(found: SimulateResult) -> list[dict[str, object]]:
    path = found.trajectory
    columns = {
        "time_s": path.time,
        "displacement_mm": 1e3 * path.displacement,
        "velocity_mm_s": 1e3 * path.velocity,
        f"{'current' if found.command_unit == 'A' else 'voltage'}_{found.command_unit}": path.command,
        "force_N": found.force,
    }
    if path.temperature is not None:
        columns |= {"temperature_degC": path.temperature - ZERO_CELSIUS_K}
    if found.interval is not None:
        columns |= dict(zip(("low_N", "high_N"), found.interval, strict=True))
    if found.measured is not None:
        columns |= {"measured_N": found.measured}
    rounded = [np.round(values, 6).tolist() for values in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*rounded, strict=True)]


def _first(found: SimulateResult) -> FirstScreen:
    answer, path = _fields(found), found.trajectory
    low, high = answer["force_N"]
    error = Tile(f"{len(path)}", "samples", f"time step {1e3 * path.step:g} ms")
    if found.measured is not None:
        spread = float(np.std(found.measured[found.scored_from :]))
        ratio = f"{100.0 * answer['rmse_N'] / spread:.1f} % of its standard deviation" if spread else ""
        error = Tile(f"{answer['rmse_N']:.4g} N", "RMS error of the measured force", ratio)
    return FirstScreen(
        title=f"Simulated force: {found.title or 'the card'}",
        subject=f"{found.motion}.",
        verdict=_summary(found)[-1],
        tiles=(
            Tile(f"{high:.4g} N", "largest force", f"from {low:.4g} N"),
            Tile(f"{answer['power_W']:.4g} W", "mean dissipated power"),
            error,
        ),
        caption="Coloured lines are the model, grey lines the measured force"
        + ("" if found.interval is None else ", and dotted lines the 90 % interval"),
    )


REPORT = Report(
    fields=_fields,
    show=_show,
    summary=_summary,
    page=Page(
        name="simulate.html",
        first=_first,
        picture=_figure,
        label="Simulated loops",
        sections=lambda found: table_of(_rows(found)),
    ),
    files=(WrittenFile(name="simulate.json", key="file"), csv_file("simulate.csv", _rows)),
    rows=_rows,
)
