"""The page of ``mrdamper sweep``: what came out over all tasks, and every task's figures."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.jobs.sweep.plan import What
from mrdamper.report.figures.style import INK, TRAINING, WIDE, drawing_style, svg_of
from mrdamper.report.page import environment

__all__ = ["render_sweep"]

_MOST_PANELS = 12
_COLUMNS = 4
_TITLES = {
    "identify": "Identification over many campaigns",
    "tolerance": "Tracking over a tolerance of the damper",
    "sink": "Heat sinks over many dampers and duties",
}


def render_sweep(answer: What) -> str:
    """Return the page's HTML."""
    return (
        environment()
        .get_template("sweep.html.j2")
        .render(it=answer, title=_TITLES[answer["kind"]], picture=_distributions(answer))
    )


def _distributions(answer: What) -> str:
    """Return a panel for each figure: its values in rising order, the median marked."""
    names = [name for name, found in answer["summary"].items() if found["least"] < found["most"]][
        :_MOST_PANELS
    ]
    if not names:
        return ""
    rows = -(-len(names) // _COLUMNS)
    height = 1.75 * rows + 0.2
    with drawing_style():
        figure = Figure(figsize=(WIDE, height))
        for place, name in enumerate(names):
            axes = figure.add_subplot(rows, _COLUMNS, place + 1)
            values = np.sort([row[name] for row in answer["rows"] if row.get(name) is not None])
            share = 100.0 * (np.arange(len(values)) + 0.5) / len(values)
            axes.plot(values, share, ".-", color=TRAINING, markersize=3.0, linewidth=0.9)
            axes.axvline(float(np.median(values)), color=INK, linewidth=0.6, linestyle=(0, (4, 2)))
            axes.set_title(name, loc="left", pad=3, fontsize=6.5)
            axes.set_ylim(0.0, 100.0)
            axes.locator_params(axis="x", nbins=4)
            if place % _COLUMNS == 0:
                axes.set_ylabel("% of tasks below")
        figure.subplots_adjust(
            left=0.05, right=0.985, top=1.0 - 0.22 / height, bottom=0.25 / height, wspace=0.22, hspace=0.45
        )
        return svg_of(figure, "Distributions over the tasks")
