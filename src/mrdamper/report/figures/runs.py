"""The picture of measured runs: their loops, before anything is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.models.characterisation import spread_out
from mrdamper.report.figures.small_multiples import Line, Row, grid_figure
from mrdamper.report.figures.style import colour_of, shortened

__all__ = ["measured_loops"]

_MOST_COLUMNS = 7
_MOST_POINTS = 2000
_HIGHEST = 0.99  # quantile of a run's command that colours it


def measured_loops(runs: Sequence[RigRun]) -> Figure:
    """Return force over displacement and over velocity, a column for each of at most seven runs.

    Velocity is the difference of neighbouring samples where no channel measures it.
    """
    chosen = spread_out(runs, _MOST_COLUMNS)
    highest = max(_level(run) for run in chosen)
    colours = [colour_of(_level(run), highest) for run in chosen]
    rows = []
    for label, of in (("displacement, mm", _displacement_mm), ("velocity, mm/s", _velocity_mm_s)):
        panels = tuple(
            (Line(_thinned(of(run)), _thinned(run.force), colour, 0.9),)
            for run, colour in zip(chosen, colours, strict=True)
        )
        rows.append(Row(label, "force, N", panels))
    return grid_figure([(shortened(run.name, 28), False) for run in chosen], rows, tall=2.0)


def _level(run: RigRun) -> float:
    return float(np.quantile(np.abs(run.command), _HIGHEST))


def _displacement_mm(run: RigRun) -> FloatArray:
    return 1e3 * run.displacement


def _velocity_mm_s(run: RigRun) -> FloatArray:
    velocity = np.gradient(run.displacement, run.time) if run.velocity is None else run.velocity
    return np.asarray(1e3 * velocity, dtype=np.float64)


def _thinned(values: FloatArray) -> FloatArray:
    return values[:: max(1, len(values) // _MOST_POINTS)]
