"""Traces of a run for figures: one cycle or a few seconds, measured and modelled, with reduced samples."""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate, select_plot_samples
from mrdamper.identify.scores import RunError
from mrdamper.jobs.intervals import PYTHON_RATE_Hz
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate_each
from mrdamper.report.figures.fit import Trace

CYCLE_POINT_COUNT = 240


def trace_of(
    damper: Damper,
    run: PreparedRun,
    error: RunError,
    *,
    seconds: float | None = None,
    points: int = CYCLE_POINT_COUNT,
) -> Trace:
    """Return the second cycle of a run, or the first seconds of a motion without a period.

    The transient has decayed in the second cycle. ``seconds`` is the duration of the trace. The default is a
    period, or three seconds for a motion without a period.
    """
    return traces_of(damper, [(run, error)], seconds=seconds, points=points)[0]


def traces_of(
    damper: Damper,
    pairs: Sequence[tuple[PreparedRun, RunError]],
    *,
    seconds: float | None = None,
    points: int = CYCLE_POINT_COUNT,
) -> list[Trace]:
    """Return the traces of several runs, which are simulated together."""
    if damper.law.kernel is None:
        pairs = [(decimate(run, PYTHON_RATE_Hz), error) for run, error in pairs]
    forces = simulate_each(damper.on_limits(), [run.trajectory for run, _ in pairs])
    return [
        _trace(run, error, force, seconds, points) for (run, error), force in zip(pairs, forces, strict=True)
    ]


def _trace(run: PreparedRun, error: RunError, force: FloatArray, seconds: float | None, points: int) -> Trace:
    path = run.trajectory
    drawn = select_plot_samples(run, seconds=seconds, points=points)
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
