"""Figures of the errors of runs, and of forces and coefficients with their 90 % intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrdamper.identify.scores import RunError
from mrdamper.jobs.intervals import CoefficientInterval, ForceInterval
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import HELD_OUT, MEASURED, TRAINING, WIDTH_INCH, shortened


def errors_figure(errors: Sequence[RunError]) -> Figure:
    """Return a bar chart of the errors [%] of the worst runs, the worst run first."""
    worst = sorted(errors, key=lambda each: -each.nrmse_percent)[:20]
    height = 0.55 + 0.175 * len(worst)
    figure = Figure(figsize=(WIDTH_INCH, height))
    axes = figure.add_axes((0.23, 0.36 / height, 0.755, 1.0 - 0.56 / height))
    for split, colour, word in (("training", TRAINING, "training"), ("held_out", HELD_OUT, "held out")):
        values = {k: each.nrmse_percent for k, each in enumerate(worst) if each.split == split}
        if values:
            median = float(np.median([*values.values()]))
            axes.axvline(median, color=colour, lw=0.9, ls="--")
            label = f"{word} (median {median:.1f} %, dashed)"
            bars = axes.barh([*values], [*values.values()], 0.66, color=colour, label=label)
            axes.bar_label(bars, fmt="%.1f", fontsize=6.5, color="#555555", padding=2.0)
    axes.set_yticks(range(len(worst)), [shortened(each.name) for each in worst])
    axes.set(ylim=(len(worst) - 0.4, -0.6), xlim=(0.0, 1.08 * worst[0].nrmse_percent))
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("RMS error, % of the standard deviation of the measured force")
    figure.legend(loc="upper right", ncols=2, borderaxespad=0.1)
    return figure


def interval_figure(
    forces: Sequence[ForceInterval], coefficients: Sequence[CoefficientInterval], command_unit: str
) -> Figure:
    """Return a figure: measured and modelled force of each run, then each coefficient versus current."""
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
