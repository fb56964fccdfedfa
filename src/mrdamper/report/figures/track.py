"""Figures of ``mrdamper track``: force, error and current over time, as in Figures 28 to 31 of the paper.

The grey band is the attainable force between zero and maximum current. The lower panels are grey if the
target is outside this band less a margin.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.jobs.track import Traced, TrackResult
from mrdamper.report.figures.palette import HELD_OUT, INK, TRAINING, WIDTH_INCH
from mrdamper.report.figures.style import add_legend, axes_table, svg_drawn_by

COLOURS = (TRAINING, "#b08a3c", HELD_OUT, "#7a5c8e")
REACH_COLOUR, OUTSIDE_COLOUR = "#ececec", "#f1efe9"


def draw_tracking(traced: Traced) -> str:
    """Return ``tracking_figure`` as SVG."""
    return svg_drawn_by(lambda: tracking_figure(traced), f"Tracking of {traced.target}")


def tracking_figure(traced: Traced) -> Figure:
    """Return target and attainable force, error, and current of the runs of one target."""
    drawn_rate_Hz = 500.0
    drawn_time_s_max = 4.0
    course = traced.course
    thin = max(round(1.0 / (drawn_rate_Hz * course.step_s)), 1)
    last = min(course.scored_from + round(drawn_time_s_max / course.step_s), len(course))
    shown = slice(course.scored_from, last, thin)
    time, target = course.time[shown], course.target[shown]
    figure = Figure(figsize=(WIDTH_INCH, 4.3))
    force, error, current = figure.subplots(
        3,
        1,
        sharex=True,
        gridspec_kw={
            "height_ratios": [1.87, 0.93, 0.64],
            **{"left": 0.06, "right": 0.99, "bottom": 0.09, "top": 0.935, "hspace": 0.1},
        },
    )
    force.fill_between(time, traced.reach.low[shown], traced.reach.high[shown], color=REACH_COLOUR, lw=0.0)
    force.plot(time, target, color=INK, lw=1.0, ls="--")
    error.axhline(0.0, color="#888888", lw=0.6)
    intervals = {each.controller: each for each in traced.posterior}
    entries = [("attainable", "#d4d4d4", "-"), ("target", INK, "--")]
    for run, colour in zip(traced.runs, COLOURS, strict=False):
        if run.controller in intervals:
            ends = intervals[run.controller]
            low, high = ends.low_N[shown] - target, ends.high_N[shown] - target
            error.fill_between(time, low, high, color=colour, alpha=0.25, lw=0.0)
        force.plot(time, run.force[shown], color=colour, lw=1.0)
        error.plot(time, run.error[shown], color=colour, lw=0.9)
        current.plot(time, run.current[shown], color=colour, lw=0.9)
        entries.append((run.controller, colour, "-"))
    outside = ~traced.reach.feasible(course.target)[shown]
    for axes in (error, current):
        _shade(axes, time, outside)
    for axes in (force, error, current):
        axes.grid(visible=False)
        axes.locator_params(nbins=5, axis="y")
    reach = float(np.abs(course.target).max())
    force.set(ylabel="force, N", ylim=(-1.6 * reach, 1.6 * reach), xlim=(time[0], time[-1]))
    force.set_title(f"{traced.target} at {traced.temperature_degC:g} °C")
    error.set_ylabel("error, N")
    current.set(ylabel="current, A", xlabel="time, s")
    figure.align_ylabels()
    add_legend(figure, entries, at_top=True)
    return figure


def draw_temperatures(run: TrackResult) -> str:
    """Return ``error_figure`` as SVG, or an empty string if there is only one temperature."""
    if len({row.temperature_degC for row in run.rows}) < 2:
        return ""
    return svg_drawn_by(lambda: error_figure(run), "RMS error versus temperature")


def error_figure(run: TrackResult) -> Figure:
    """Return the feasible RMS error versus temperature, with a panel for each target."""
    controllers = [each.controller for each in run.traced[0].runs] if run.traced else []
    coloured = list(zip(controllers, COLOURS, strict=False))
    figure = Figure(figsize=(WIDTH_INCH, 2.6))
    panels = axes_table(figure, 1, len(run.targets), margins=(0.63, 0.44, 0.1, 0.34), gaps=(0.5, 0.0))
    for axes, target in zip(panels, run.targets, strict=True):
        for name, colour in coloured:
            points = sorted(
                (row.temperature_degC, row.score.rmse_feasible_N)
                for row in run.rows
                if (row.target, row.controller) == (target, name) and row.score.rmse_feasible_N is not None
            )
            if points:
                axes.plot(*zip(*points, strict=True), "o-", color=colour, lw=1.1, ms=3.2)
        axes.set_ylim(bottom=0.0)
        axes.set(title=target, xlabel="temperature, °C")
    panels[0].set_ylabel("RMS error, feasible, N")
    add_legend(figure, [(name, colour, "-") for name, colour in coloured], at_top=True)
    return figure


def _shade(axes: Axes, time: FloatArray, outside: BoolArray) -> None:
    """Shade the times at which the target is not feasible."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8), [0]])))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        axes.axvspan(time[start], time[min(end, len(time) - 1)], color=OUTSIDE_COLOUR, lw=0.0, zorder=0.5)
