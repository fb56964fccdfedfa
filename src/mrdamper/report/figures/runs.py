"""Figures of runs: measured loops, errors, and forces and coefficients with their 90 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.data.records import Dataset, RigRun
from mrdamper.data.signals import measure_spectrum, smooth
from mrdamper.identify.scores import RunError
from mrdamper.jobs.evaluate import CoefficientInterval, ForceInterval
from mrdamper.models.characteristics import pick_evenly
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import HELD_OUT, MEASURED, TRAINING, WIDTH_INCH, colour_of, shortened

PANEL_COLUMNS_MAX = 7


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
    """Return a figure of the 90 % intervals of forces and coefficients."""
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


def plot_runs(runs: Sequence[RigRun] | Dataset | RigRun) -> Figure:
    """Return a figure of force versus displacement and velocity, one column for each of at most 7 runs.

    If the velocity was not measured, it is the derivative of the smoothed displacement.
    """
    chosen = pick_evenly((runs,) if isinstance(runs, RigRun) else tuple(runs), PANEL_COLUMNS_MAX)
    highest = max(_level(run) for run in chosen)
    names = _distinct_names([run.name for run in chosen])

    def panel(name: str, run: RigRun, x_label: str, x_mm: FloatArray) -> Panel:
        thin = slice(None, None, max(1, len(run) // 2000))
        line = Line(x_mm[thin], run.force[thin], colour_of(_level(run), highest), width=0.9)
        return Panel(name, x_label, [line], y_label="force, N" if run is chosen[0] else "")

    loops = [
        panel(name, run, "displacement, mm", 1e3 * run.displacement)
        for name, run in zip(names, chosen, strict=True)
    ]
    loops += [panel("", run, "velocity, mm/s", _velocity_mm_s(run)) for run in chosen]
    return panel_figure(loops, len(chosen), height=2.0, share="row")


def _distinct_names(names: Sequence[str]) -> list[str]:
    """Remove the words with which all names begin; return the rest of each name."""
    words = [name.split("_") for name in names]
    same = takewhile(lambda each: len({*each}) == 1, zip(*words, strict=False))
    common = len(list(same)) if len(names) > 1 else 0
    return ["_".join(each[common:]) or name for each, name in zip(words, names, strict=True)]


def _level(run: RigRun) -> float:
    # A quantile of the current selects the colour, so that short peaks do not change it.
    return float(np.quantile(np.abs(run.command), 0.99))


def _velocity_mm_s(run: RigRun) -> FloatArray:
    if run.velocity is not None:
        return 1e3 * run.velocity
    step = float(np.median(np.diff(run.time)))
    return 1e3 * smooth(run.displacement, step, measure_spectrum(run.displacement, step).cut_off()).velocity
