"""Panels of forces and coefficients with their 90 % intervals."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from mrdamper.jobs.intervals import CoefficientInterval, ForceInterval
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import MEASURED, TRAINING


def interval_figure(
    forces: Sequence[ForceInterval], coefficients: Sequence[CoefficientInterval], command_unit: str
) -> Figure:
    """Return the measured and modelled force of each run, and each coefficient versus current."""
    drawn = [
        Panel(
            f"{each.name}: force, N",
            "time, s",
            [
                Line(each.time_s, each.measured_N, MEASURED, width=2.0),
                Line(each.time_s, each.modelled_N, TRAINING, band=(each.low_N, each.high_N)),
            ],
        )
        for each in forces
    ]
    drawn += [
        Panel(
            f"{each.name.replace('_', ' ')}, {each.unit}",
            "current, A" if command_unit == "A" else "voltage, V",
            [Line(each.command, each.value, TRAINING, band=(each.low, each.high))],
        )
        for each in coefficients
    ]
    return panel_figure(drawn)
