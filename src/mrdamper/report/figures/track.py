"""Figures of ``mrdamper track``: force, error and current over time, as in the paper's Figures 28 to 31.

The grey band is what the damper could give at that instant, between zero and the highest current; where the
target lies outside of it, less a margin, the lower panels are grey.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.jobs.track import Traced, TrackResult
from mrdamper.report.figures.style import HELD_OUT, INK, TRAINING, WIDE, drawing_style, svg_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


__all__ = ["draw_temperatures", "draw_tracking", "error_figure", "tracking_figure"]

_COLOURS = (TRAINING, "#b08a3c", HELD_OUT, "#7a5c8e")
_REACH, _OUTSIDE = "#ececec", "#f1efe9"
_DRAWN_HZ = 500.0
_CYCLES_S = 4.0  # the longest stretch that is drawn


def draw_tracking(traced: Traced) -> str:
    """Return ``tracking_figure`` as SVG."""
    with drawing_style():
        return svg_of(tracking_figure(traced), f"Tracking of {traced.target}")


def tracking_figure(traced: Traced) -> Figure:
    """Return wanted and attainable force, error, and current of a target's runs."""
    course = traced.course
    thin = max(round(1.0 / (_DRAWN_HZ * course.step_s)), 1)
    last = min(course.scored_from + round(_CYCLES_S / course.step_s), len(course))
    shown = slice(course.scored_from, last, thin)
    time = course.time[shown]
    outside = ~traced.reach.feasible(course.target)[shown]
    with drawing_style():
        figure = Figure(figsize=(WIDE, 4.3))
        rows = figure.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.2, 1.0))
        force, error, current = rows
        force.fill_between(
            time, traced.reach.low[shown], traced.reach.high[shown], color=_REACH, linewidth=0, label="reach"
        )
        force.plot(
            time, course.target[shown], color=INK, linewidth=1.0, linestyle=(0, (4, 2)), label="wanted"
        )
        for axes in (error, current):
            _shade(axes, time, outside)
        error.axhline(0.0, color="#888888", linewidth=0.6)
        for run, colour in zip(traced.runs, _COLOURS, strict=False):
            force.plot(time, run.force[shown], color=colour, linewidth=1.0, label=run.controller)
            error.plot(time, run.error[shown], color=colour, linewidth=0.9)
            current.plot(time, run.current[shown], color=colour, linewidth=0.9)
        force.set_ylabel("force, N")
        error.set_ylabel("error, N")
        current.set_ylabel("current, A")
        current.set_xlabel("time, s", labelpad=1.5)
        current.set_xlim(time[0], time[-1])
        reach = float(np.abs(course.target).max())
        force.set_ylim(-1.6 * reach, 1.6 * reach)
        force.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=6, borderaxespad=0.1)
        force.set_title(f"{traced.target} at {traced.temperature_degC:g} °C", loc="left", pad=4)
        figure.subplots_adjust(left=0.06, right=0.99, top=0.94, bottom=0.085, hspace=0.1)
        figure.align_ylabels(rows.tolist())
    return figure


def draw_temperatures(run: TrackResult) -> str:
    """Return ``error_figure`` as SVG; empty where there is one temperature."""
    if len({row.temperature_degC for row in run.rows}) < 2:
        return ""
    with drawing_style():
        return svg_of(error_figure(run), "RMS error over temperature")


def error_figure(run: TrackResult) -> Figure:
    """Return the feasible RMS error over temperature, a panel per target, a line per controller."""
    controllers = [each.controller for each in run.traced[0].runs] if run.traced else []
    with drawing_style():
        figure = Figure(figsize=(WIDE, 2.6))
        for place, target in enumerate(run.targets):
            axes = figure.add_subplot(1, len(run.targets), place + 1)
            for name, colour in zip(controllers, _COLOURS, strict=False):
                of = [r for r in run.rows if r.target == target and r.controller == name]
                points = [
                    (r.temperature_degC, r.score.rmse_feasible_N)
                    for r in of
                    if r.score.rmse_feasible_N is not None
                ]
                x, y = zip(*sorted(points), strict=True) if points else ((), ())
                axes.plot(x, y, "o-", color=colour, linewidth=1.1, markersize=3.2, label=name)
            axes.set_ylim(bottom=0.0)
            axes.set_title(target, loc="left", pad=4)
            axes.set_xlabel("temperature, °C", labelpad=1.5)
            if place == 0:
                axes.set_ylabel("RMS error, feasible, N")
                axes.legend(loc="best")
        figure.subplots_adjust(left=0.06, right=0.99, top=0.91, bottom=0.17, wspace=0.16)
    return figure


def _shade(axes: Axes, time: FloatArray, outside: BoolArray) -> None:
    """Shade the stretches in which the target is out of reach."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8), [0]])))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        axes.axvspan(time[start], time[min(end, len(time) - 1)], color=_OUTSIDE, linewidth=0, zorder=0)
