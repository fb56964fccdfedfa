"""Figure of measured runs: loops of the force."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.data.records import Dataset, RigRun
from mrdamper.data.signals import measure_spectrum, smooth
from mrdamper.models.characteristics import pick_evenly
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import colour_of

PANEL_COLUMNS_MAX = 7


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
