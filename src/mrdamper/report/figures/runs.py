"""The picture of measured runs: their loops, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.data.signals import measure_spectrum, smooth
from mrdamper.models.characteristics import pick_evenly
from mrdamper.report.figures.palette import colour_of, shortened
from mrdamper.report.figures.small_multiples import Line, Row, grid_figure

_MOST_COLUMNS = 7
_MOST_POINTS = 2000
_MOST_LETTERS = 110  # of all titles
_HIGHEST = 0.99  # quantile of a run's command that colours it


def measured_loops(runs: Sequence[RigRun]) -> Figure:
    """Return force over displacement and over velocity, a column for each of at most seven runs.

    Where no channel measures it, velocity is that of the smoothed displacement.
    """
    chosen = pick_evenly(runs, _MOST_COLUMNS)
    highest = max(_level(run) for run in chosen)
    colours = [colour_of(_level(run), highest) for run in chosen]
    rows = []
    for label, of in (("displacement, mm", _displacement_mm), ("velocity, mm/s", _velocity_mm_s)):
        panels = tuple(
            (Line(_thinned(of(run)), _thinned(run.force), colour, 0.9),)
            for run, colour in zip(chosen, colours, strict=True)
        )
        rows.append(Row(label, "force, N", panels))
    longest = max(12, _MOST_LETTERS // len(chosen))
    titles = [(shortened(name, longest), False) for name in _told_apart([run.name for run in chosen])]
    return grid_figure(titles, rows, tall=2.0)


def _told_apart(names: Sequence[str]) -> list[str]:
    """Return names without the words that all begin with."""
    words = [name.split("_") for name in names]
    same = takewhile(lambda each: len({*each}) == 1, zip(*words, strict=False))
    common = len(list(same)) if len(names) > 1 else 0
    return ["_".join(each[common:]) or name for each, name in zip(words, names, strict=True)]


def _level(run: RigRun) -> float:
    return float(np.quantile(np.abs(run.command), _HIGHEST))


def _displacement_mm(run: RigRun) -> FloatArray:
    return 1e3 * run.displacement


def _velocity_mm_s(run: RigRun) -> FloatArray:
    if run.velocity is not None:
        return 1e3 * run.velocity
    step = float(np.median(np.diff(run.time)))
    return 1e3 * smooth(run.displacement, step, measure_spectrum(run.displacement, step).cut_off()).velocity


def _thinned(values: FloatArray) -> FloatArray:
    return values[:: max(1, len(values) // _MOST_POINTS)]
