"""Figures of ``mrdamper track``: force, error and current over time, as in the paper's Figures 28 to 31.

The grey band is what the damper could give at that instant, between zero and the highest current; where the
target lies outside of it, less a margin, the lower panels are grey.
"""

from __future__ import annotations

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.jobs.track import Traced, TrackResult
from mrdamper.report.figures.palette import HELD_OUT, INK, TRAINING, WIDE
from mrdamper.report.figures.sheet import Axes, Band, Box, Key, Points, Sheet
from mrdamper.report.figures.ticks import nice_ticks

_COLOURS = (TRAINING, "#b08a3c", HELD_OUT, "#7a5c8e")
_REACH, _OUTSIDE = "#ececec", "#f1efe9"
_DRAWN_HZ = 500.0
_CYCLES_S = 4.0  # the longest stretch that is drawn
_TALL, _LOWER = 4.3, 2.6  # inches


def draw_tracking(traced: Traced) -> str:
    """Return ``tracking_sheet`` as SVG."""
    return tracking_sheet(traced).svg(f"Tracking of {traced.target}")


def tracking_sheet(traced: Traced) -> Sheet:
    """Return wanted and attainable force, error, and current of a target's runs."""
    course = traced.course
    thin = max(round(1.0 / (_DRAWN_HZ * course.step_s)), 1)
    last = min(course.scored_from + round(_CYCLES_S / course.step_s), len(course))
    shown = slice(course.scored_from, last, thin)
    time = course.time[shown]
    outside = ~traced.reach.feasible(course.target)[shown]
    reach = float(np.abs(course.target).max())
    sheet = Sheet(WIDE, _TALL, keys_at="top")
    left, right = 0.06 * WIDE, 0.99 * WIDE
    force = sheet.add(left, 2.15, right, _TALL - 0.28)
    error = sheet.add(left, 1.12, right, 2.05)
    current = sheet.add(left, 0.38, right, 1.02)
    force.marks.append(Band(time, traced.reach.low[shown], traced.reach.high[shown], _REACH, 1.0))
    force.line(time, course.target[shown], INK, 1.0, "--")
    runs = [
        (run, colour, run.error[shown], run.current[shown])
        for run, colour in zip(traced.runs, _COLOURS, strict=False)
    ]
    for axes, values in ((error, [each[2] for each in runs]), (current, [each[3] for each in runs])):
        axes.y_ends = _ends(values)
        _shade(axes, time, outside)
    for axes in (force, error, current):
        axes.x_ends, axes.few, axes.grid = (float(time[0]), float(time[-1])), 5, ""
        axes.x_ticks = nice_ticks(axes.x_ends, 9)
        axes.x_names = None if axes is current else [""] * len(axes.x_ticks)
    error.level(0.0)
    foreseen = {each.controller: each for each in traced.posterior}
    for run, colour, missed, command in runs:
        if run.controller in foreseen:
            ends = foreseen[run.controller]
            low, high = (each[shown] - course.target[shown] for each in (ends.low_N, ends.high_N))
            error.marks.append(Band(time, low, high, colour, 0.25))
        force.line(time, run.force[shown], colour, 1.0)
        error.line(time, missed, colour)
        current.line(time, command, colour)
    force.title = f"{traced.target} at {traced.temperature_degC:g} °C"
    force.y_label, error.y_label, current.y_label = "force, N", "error, N", "current, A"
    current.x_label = "time, s"
    force.y_ends = (-1.6 * reach, 1.6 * reach)
    sheet.keys = [
        Key("reach", "#d4d4d4", width=5.0),
        Key("wanted", INK, "--"),
        *(Key(run.controller, colour) for run, colour, *_ in runs),
    ]
    return sheet


def draw_temperatures(run: TrackResult) -> str:
    """Return ``error_sheet`` as SVG; empty where there is one temperature."""
    if len({row.temperature_degC for row in run.rows}) < 2:
        return ""
    return error_sheet(run).svg("RMS error over temperature")


def error_sheet(run: TrackResult) -> Sheet:
    """Return the feasible RMS error over temperature, a panel per target, a line per controller."""
    controllers = [each.controller for each in run.traced[0].runs] if run.traced else []
    coloured = list(zip(controllers, _COLOURS, strict=False))
    sheet = Sheet(WIDE, _LOWER, keys_at="top", keys=[Key(name, colour) for name, colour in coloured])
    panels = sheet.table(1, len(run.targets), left=0.06, right=0.99, top=0.87, bottom=0.17, wspace=0.16)
    for axes, target in zip(panels, run.targets, strict=True):
        for name, colour in coloured:
            points = sorted(
                (row.temperature_degC, row.score.rmse_feasible_N)
                for row in run.rows
                if (row.target, row.controller) == (target, name) and row.score.rmse_feasible_N is not None
            )
            if points:
                x, y = (np.array(values) for values in zip(*points, strict=True))
                axes.line(x, y, colour, 1.1)
                axes.marks.append(Points(x.tolist(), y.tolist(), colour, 3.2))
        axes.y_ends = (0.0, axes.ends[1][1])
        axes.title, axes.x_label = target, "temperature, °C"
    panels[0].y_label = "RMS error, feasible, N"
    return sheet


def _ends(curves: list[FloatArray]) -> tuple[float, float]:
    """Return the least and the largest value of all curves and zero, and a twentieth more."""
    low = min([0.0, *(float(values.min()) for values in curves)])
    high = max([0.0, *(float(values.max()) for values in curves)])
    more = 0.05 * (high - low) or 1.0
    return low - more, high + more


def _shade(axes: Axes, time: FloatArray, outside: BoolArray) -> None:
    """Shade the stretches in which the target is out of reach."""
    assert axes.y_ends is not None
    edges = np.flatnonzero(np.diff(np.concatenate([[0], outside.astype(np.int8), [0]])))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        stop = float(time[min(end, len(time) - 1)])
        axes.marks.append(Box(float(time[start]), axes.y_ends[0], stop, axes.y_ends[1], _OUTSIDE))
