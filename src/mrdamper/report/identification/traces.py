"""What is drawn of a run: one cycle or a few seconds of it, measured and modelled, thinned."""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate, shown_samples
from mrdamper.identify.scores import RunError
from mrdamper.jobs.intervals import PYTHON_RATE_Hz
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate_each
from mrdamper.report.figures.fit import Trace

_POINTS = 240  # of a drawn cycle


def trace_of(
    damper: Damper, run: PreparedRun, error: RunError, *, seconds: float | None = None, points: int = _POINTS
) -> Trace:
    """Return the second cycle of a run (its start has died away), or the first seconds after the start.

    ``seconds`` is how much is drawn; None: a period, or three seconds of a motion that has none.
    """
    return traces_of(damper, [(run, error)], seconds=seconds, points=points)[0]


def traces_of(
    damper: Damper,
    pairs: Sequence[tuple[PreparedRun, RunError]],
    *,
    seconds: float | None = None,
    points: int = _POINTS,
) -> list[Trace]:
    """Return the same of several runs, which are simulated together."""
    if damper.law.kernel is None:
        pairs = [(decimate(run, PYTHON_RATE_Hz), error) for run, error in pairs]
    forces = simulate_each(damper.on_limits(), [run.trajectory for run, _ in pairs])
    return [
        _trace(run, error, force, seconds, points) for (run, error), force in zip(pairs, forces, strict=True)
    ]


def _trace(run: PreparedRun, error: RunError, force: FloatArray, seconds: float | None, points: int) -> Trace:
    path = run.trajectory
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
