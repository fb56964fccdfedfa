"""Result of ``simulate``: range of the force, figure of the loops, table of all samples."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from mrdamper.arrays import FloatArray, rms
from mrdamper.jobs.simulate import SimulateResult
from mrdamper.models.card_draws import INTERVAL_PROBABILITY
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.report.base import FirstScreen, Tile, course_report
from mrdamper.report.figures.style import INK, MEASURED, colour_of
from mrdamper.schema import Json


def _answer(found: SimulateResult) -> Json:
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
    """Return the mean width of an interval [N]."""
    return float(np.mean(interval[1] - interval[0]))


def _summary(found: SimulateResult) -> list[str]:
    answer = _answer(found)
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
    """Return the loops of force versus displacement and velocity, with a measured force in grey."""
    point_count_max = 4000  # More points make the figure large but not more accurate.
    path = found.trajectory
    thin = slice(None, None, max(1, len(path) // point_count_max))
    level = float(np.abs(path.command).max())
    figure = Figure(figsize=(8.0, 3.4))
    both = zip(figure.subplots(1, 2, sharey=True), (path.displacement, path.velocity), strict=True)
    for (axes, x), label in zip(both, ("displacement, mm", "velocity, mm/s"), strict=True):
        if found.measured is not None:
            axes.plot(1e3 * x[thin], found.measured[thin], color=MEASURED, linewidth=2.6)
        for end in found.interval or ():
            axes.plot(1e3 * x[thin], end[thin], color=INK, linewidth=0.5, linestyle=":")
        axes.plot(1e3 * x[thin], found.force[thin], color=colour_of(level, level), linewidth=0.9)
        axes.set_xlabel(label)
    figure.axes[0].set_ylabel("force, N")
    figure.subplots_adjust(left=0.08, right=0.98, top=0.96, bottom=0.14, wspace=0.06)
    return figure


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
    answer, path = _answer(found), found.trajectory
    low, high = answer["force_N"]
    error = Tile(f"{len(path)}", "samples", f"time step {1e3 * path.step:g} ms")
    if found.measured is not None:
        spread = float(np.std(found.measured[found.scored_from :]))
        share = (
            f"{100.0 * answer['rmse_N'] / spread:.1f} % of the standard deviation of the measured force"
            if spread > 0.0
            else ""
        )
        error = Tile(f"{answer['rmse_N']:.4g} N", "RMS error of the measured force", share)
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


REPORT = course_report(
    "simulate",
    answer=_answer,
    show=_show,
    summary=_summary,
    first=_first,
    picture=_figure,
    label="Simulated loops",
    rows=_rows,
)
