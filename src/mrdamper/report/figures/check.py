"""Figure of ``mrdamper check``: measured force versus displacement."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mrdamper.data.finding import SEVERITIES
from mrdamper.jobs.check import CheckedRun, CheckResult
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import TRAINING

PANEL_COUNT_MAX = 8


def runs_figure(result: CheckResult) -> Figure | None:
    """Return force versus displacement of the runs with the worst findings, or None without runs."""
    drawable = [run for run in result.runs if np.isfinite(run.samples_drawn).all(axis=1).any()]
    if not drawable:
        return None
    return panel_figure(
        [
            Panel(
                run.name,
                "displacement, mm",
                [Line(run.samples_drawn[:, 0], run.samples_drawn[:, 1], TRAINING, style=",")],
                run.max_severity == "fault",
                "force, N",
            )
            for run in sorted(drawable, key=_severity)[:PANEL_COUNT_MAX]
        ]
    )


def _severity(run: CheckedRun) -> int:
    return len(SEVERITIES) if run.max_severity is None else SEVERITIES.index(run.max_severity)
