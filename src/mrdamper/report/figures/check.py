"""Figure of ``mrdamper check``: measured force versus displacement."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.data.finding import SEVERITIES
from mrdamper.jobs.check import CheckedRun, CheckResult
from mrdamper.report.figures.style import HELD_OUT, INK, TRAINING, WIDTH_INCH, shortened


def runs_figure(result: CheckResult) -> Figure | None:
    """Return force versus displacement of the runs with the worst findings, or None without runs."""
    drawable = [run for run in result.runs if np.isfinite(run.samples_drawn).all(axis=1).any()]
    if not drawable:
        return None
    shown = sorted(drawable, key=_severity)[:8]
    columns = min(len(shown), 4)
    rows = -(-len(shown) // columns)
    width, height = min(WIDTH_INCH, 0.6 + 2.6 * columns), 1.75 * rows + 0.15
    figure = Figure(figsize=(width, height))
    for place, run in enumerate(shown):
        axes = figure.add_subplot(rows, columns, place + 1)
        axes.plot(*run.samples_drawn.T, ".", color=TRAINING, markersize=1.4)
        colour = HELD_OUT if run.max_severity == "fault" else INK
        axes.set_title(shortened(run.name, 34), loc="left", pad=3, fontsize=6.5, color=colour)
        axes.locator_params(nbins=4)
        if place % columns == 0:
            axes.set_ylabel("force, N", labelpad=1.0)
        if place >= len(shown) - columns:
            axes.set_xlabel("displacement, mm", labelpad=1.5)
    figure.subplots_adjust(
        left=0.6 / width, right=0.99, top=1.0 - 0.2 / height, bottom=0.36 / height, wspace=0.3, hspace=0.4
    )
    return figure


def _severity(run: CheckedRun) -> int:
    return len(SEVERITIES) if run.max_severity is None else SEVERITIES.index(run.max_severity)
