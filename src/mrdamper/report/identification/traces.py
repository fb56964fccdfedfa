"""What is drawn of a run: one cycle or a few seconds of it, measured and modelled, thinned."""

from __future__ import annotations

from mrdamper.data.prepare import PreparedRun, decimate, shown_samples
from mrdamper.identify.assess import RunError
from mrdamper.jobs.intervals import PYTHON_RATE_Hz
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from mrdamper.report.figures.fit import Trace

__all__ = ["trace_of"]

_POINTS = 240  # of a drawn cycle


def trace_of(
    damper: Damper, run: PreparedRun, error: RunError, *, seconds: float | None = None, points: int = _POINTS
) -> Trace:
    """Return the second cycle of a run (its start has died away), or the first seconds after the start.

    ``seconds`` is how much is drawn; None: a period, or three seconds of a motion that has none.
    """
    if damper.law.kernel is None:
        run = decimate(run, PYTHON_RATE_Hz)
    path = run.trajectory
    force = simulate(damper.on_limits(), path)
    drawn = shown_samples(run, seconds=seconds, points=points)
    return Trace(
        name=error.name,
        motion=error.motion,
        command=error.command,
        command_unit=error.command_unit,
        split=error.split,
        error_percent=error.nrmse_percent,
        rmse_N=error.rmse_N,
        time_s=path.time[drawn] - path.time[drawn[0]],
        displacement_mm=1e3 * path.displacement[drawn],
        velocity_mm_s=1e3 * path.velocity[drawn],
        measured_N=run.force[drawn],
        modelled_N=force[drawn],
    )
