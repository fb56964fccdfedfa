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
from mrdamper.report.figures.palette import colour_of, shortened
from mrdamper.report.figures.small_multiples import Line, Row, grid_figure

PANEL_COLUMNS_MAX = 7


def plot_runs(runs: Sequence[RigRun] | Dataset | RigRun) -> Figure:
    """Return force versus displacement and velocity, a column for each of at most seven runs.

    If the velocity was not measured, it is the derivative of the smoothed displacement.
    """
    chosen = pick_evenly((runs,) if isinstance(runs, RigRun) else tuple(runs), PANEL_COLUMNS_MAX)
    highest = max(_level(run) for run in chosen)
    colours = [colour_of(_level(run), highest) for run in chosen]
    rows = []
    for label, of in (("displacement, mm", _displacement_mm), ("velocity, mm/s", _velocity_mm_s)):
        panels = tuple(
            (Line(_thinned(of(run)), _thinned(run.force), colour, 0.9),)
            for run, colour in zip(chosen, colours, strict=True)
        )
        rows.append(Row(label, "force, N", panels))
    longest = max(12, 110 // len(chosen))  # All titles together must fit the width of the figure.
    titles = [(shortened(name, longest), False) for name in _distinct_names([run.name for run in chosen])]
    return grid_figure(titles, rows, tall=2.0)


def _distinct_names(names: Sequence[str]) -> list[str]:
    """Return names without the words that all of them begin with."""
    words = [name.split("_") for name in names]
    same = takewhile(lambda each: len({*each}) == 1, zip(*words, strict=False))
    common = len(list(same)) if len(names) > 1 else 0
    return ["_".join(each[common:]) or name for each, name in zip(words, names, strict=True)]


def _level(run: RigRun) -> float:
    # A quantile of the current selects the colour, so that short peaks do not change it.
    return float(np.quantile(np.abs(run.command), 0.99))


def _displacement_mm(run: RigRun) -> FloatArray:
    return 1e3 * run.displacement


def _velocity_mm_s(run: RigRun) -> FloatArray:
    if run.velocity is not None:
        return 1e3 * run.velocity
    step = float(np.median(np.diff(run.time)))
    return 1e3 * smooth(run.displacement, step, measure_spectrum(run.displacement, step).cut_off()).velocity


def _thinned(values: FloatArray) -> FloatArray:
    return values[:: max(1, len(values) // 2000)]
