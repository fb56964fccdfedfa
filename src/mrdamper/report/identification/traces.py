"""What is drawn of a run: one cycle or a few seconds of it, measured and modelled, thinned."""

from __future__ import annotations

import numpy as np

from mrdamper.data.prepare import PreparedRun, decimate
from mrdamper.identify.assess import RunError
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from mrdamper.report.figures.fit import Trace

__all__ = ["trace_of"]

_POINTS = 240  # of a drawn cycle
_WITHOUT_PERIOD_s = 3.0  # of a motion without a period that is drawn
_PYTHON_RATE_Hz = 200.0  # a law in Python is slow: what is drawn is simulated at this rate


def trace_of(
    damper: Damper, run: PreparedRun, error: RunError, *, seconds: float | None = None, points: int = _POINTS
) -> Trace:
    """Return the second cycle of a run (its start has died away), or the first seconds after the start.

    ``seconds`` is how much is drawn; None: a period, or three seconds of a motion that has none.
    """
    if damper.law.kernel is None:
        run = decimate(run, _PYTHON_RATE_Hz)
    path = run.trajectory
    force = simulate(damper.on_limits(), path)
    length = round((seconds or run.period_s or _WITHOUT_PERIOD_s) / path.step) + 1
    start = run.scored_from
    if run.period_s and not seconds and start + 2 * length <= len(path):
        start += length
    stop = min(start + length, len(path))
    drawn = np.unique(np.linspace(start, stop - 1, min(points, stop - start)).round().astype(np.intp))
    return Trace(
        name=error.name,
        motion=error.motion,
        command=error.command,
        command_unit=error.command_unit,
        split=error.split,
        error_percent=error.nrmse_percent,
        rmse_N=error.rmse_N,
        time_s=path.time[drawn] - path.time[start],
        displacement_mm=1e3 * path.displacement[drawn],
        velocity_mm_s=1e3 * path.velocity[drawn],
        measured_N=run.force[drawn],
        modelled_N=force[drawn],
    )
