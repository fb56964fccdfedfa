"""Figures of ``mrdamper track``: force, error and current versus time, as in Figures 28 to 31 of the paper.

The grey band is the attainable force between zero and maximum current. The lower panels are grey if the
target is outside this band less a margin.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.track import Traced, TrackResult
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import INK, SERIES, WIDTH_INCH, add_legend

REACH_COLOUR, OUTSIDE_COLOUR = "#ececec", "#f1efe9"
DRAWN_RATE_HZ = 500.0
DRAWN_TIME_S_MAX = 4.0


def tracking_figure(traced: Traced) -> Figure:
    """Return a figure of one target: target and attainable force, errors and currents of the controllers."""
    course = traced.course
    thin = max(round(1.0 / (DRAWN_RATE_HZ * course.step_s)), 1)
    last = min(course.scored_from + round(DRAWN_TIME_S_MAX / course.step_s), len(course))
    shown = slice(course.scored_from, last, thin)
    time, target = course.time[shown], course.target[shown]
    figure = Figure(figsize=(WIDTH_INCH, 4.3))
    margins = {"left": 0.06, "right": 0.99, "bottom": 0.09, "top": 0.935, "hspace": 0.1}
    force, error, current = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [1.87, 0.93, 0.64], **margins}
    )
    force.fill_between(time, traced.reach.low[shown], traced.reach.high[shown], color=REACH_COLOUR, lw=0.0)
    force.plot(time, target, color=INK, lw=1.0, ls="--")
    error.axhline(0.0, color="#888888", lw=0.6)
    intervals = {each.controller: each for each in traced.posterior}
    entries = [("attainable", "#d4d4d4", "-"), ("target", INK, "--")]
    for run, colour in zip(traced.runs, SERIES, strict=False):
        if run.controller in intervals:
            ends = intervals[run.controller]
            low, high = ends.low_N[shown] - target, ends.high_N[shown] - target
            error.fill_between(time, low, high, color=colour, alpha=0.25, lw=0.0)
        for axes, values in ((force, run.force), (error, run.error), (current, run.current)):
            axes.plot(time, values[shown], color=colour, lw=0.9)
        entries.append((run.controller, colour, "-"))
    outside = ~traced.reach.feasible(course.target)[shown]
    for axes in (error, current):
        bottom, top = axes.get_ylim()
        axes.fill_between(time, bottom, top, where=outside, color=OUTSIDE_COLOUR, lw=0.0, zorder=0.5)
        axes.set_ylim(bottom, top)
    for axes in (force, error, current):
        axes.grid(visible=False)
        axes.locator_params(nbins=5, axis="y")
    reach = 1.6 * float(np.abs(course.target).max())
    force.set(ylabel="force, N", ylim=(-reach, reach), xlim=(time[0], time[-1]))
    force.set_title(f"{traced.target} at {traced.temperature_degC:g} °C")
    error.set_ylabel("error, N")
    current.set(ylabel="current, A", xlabel="time, s")
    figure.align_ylabels()
    add_legend(figure, entries, at_top=True)
    return figure


def error_figure(run: TrackResult) -> Figure:
    """Return a figure of the RMS error while the target is feasible, versus temperature, by target."""
    drawn: list[Panel] = []
    for target in run.targets:
        lines = []
        for name, colour in zip(dict.fromkeys(row.controller for row in run.rows), SERIES, strict=False):
            points = sorted(
                (row.temperature_degC, row.score.rmse_feasible_N)
                for row in run.rows
                if (row.target, row.controller) == (target, name) and row.score.rmse_feasible_N is not None
            )
            x, y = ([point[k] for point in points] for k in (0, 1))
            lines.append(Line(x, y, colour, name, dots=x))
        drawn.append(
            Panel(target, "temperature, °C", lines, y_label="" if drawn else "RMS error, feasible, N")
        )
    return panel_figure(drawn, height=1.8, legend="")
