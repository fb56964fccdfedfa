"""Compute the errors of a model on runs.

``nrmse_percent`` of a run is 100 x RMS error / standard deviation of the measured force. The first half
period of the motion is ignored. The force is not filtered and has the full sampling rate. The error is also
computed for the whole run, and after removal of a constant offset because load cells are not always zeroed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.models.simulate import simulate_each
from mrdamper.quantities import ZERO_CELSIUS_K

Split = Literal["training", "held_out"]
ErrorKind = Literal["held_out", "training", "cross_validation"]
CurrentKind = Literal["constant", "changing"]


@dataclass(frozen=True, slots=True)
class RunError:
    """Errors of a model on one run. ``command`` is None if the command changes during the run."""

    name: str
    split: Split
    rmse_N: float
    nrmse_percent: float
    nrmse_whole_percent: float
    nrmse_offset_free_percent: float
    command: float | None
    command_unit: str
    motion: str
    temperature_degC: float | None
    energy_measured_J: float  # dissipated work in one period, or in the scored run if the run has no period
    energy_model_J: float
    peak_measured_N: float
    peak_model_N: float
    in_band_percent: float | None = None  # percentage of scored samples within the expected force error


def score_run(
    damper: Damper, prepared: PreparedRun, split: Split = "held_out", band: ForceBand | None = None
) -> RunError:
    """Return the errors of a damper on one run; with ``band`` also the percentage of samples in the band."""
    return score_each(damper, [prepared], split, band)[0]


def score_each(
    damper: Damper, runs: Sequence[PreparedRun], split: Split = "held_out", band: ForceBand | None = None
) -> tuple[RunError, ...]:
    """Return the errors of a damper on each of several runs. All runs are simulated in one call."""
    for run in (each.run for each in runs):
        if run.command_unit != damper.command_unit:
            raise InputError(
                place=run.name,
                found=(
                    f"the command is in {run.command_unit}, the model's in {damper.command_unit}; map the "
                    "channel that the model was identified with"
                ),
            )
    forces = simulate_each(damper.on_limits(), [each.trajectory for each in runs])
    return tuple(_score(each, force, split, band) for each, force in zip(runs, forces, strict=True))


def _score(prepared: PreparedRun, force: FloatArray, split: Split, band: ForceBand | None) -> RunError:
    run, path, start = prepared.run, prepared.trajectory, prepared.scored_from
    error = force - prepared.force
    spread, whole = float(np.std(prepared.force[start:])), float(np.std(prepared.force))
    if not spread > 0.0:
        raise InputError(place=run.name, found="the force does not change after the motion starts")
    count, cycles = len(force) - start, 1
    if prepared.period_s:
        period = max(round(prepared.period_s / path.step), 1)
        cycles = max(count // period, 1)
        count = min(cycles * period, count)
    span = slice(start, start + count)
    power = path.velocity[span] * path.step / cycles
    kelvin = path.temperature
    return RunError(
        name=run.name,
        split=split,
        rmse_N=rms(error[start:]),
        nrmse_percent=100.0 * rms(error[start:]) / spread,
        nrmse_whole_percent=100.0 * rms(error) / whole,
        nrmse_offset_free_percent=100.0 * float(np.std(error[start:])) / spread,
        command=run.constant_command,
        command_unit=run.command_unit,
        motion=prepared.motion,
        temperature_degC=None if kelvin is None else float(np.mean(kelvin)) - ZERO_CELSIUS_K,
        energy_measured_J=float(prepared.force[span] @ power),
        energy_model_J=float(force[span] @ power),
        peak_measured_N=float(np.abs(prepared.force[start:]).max()),
        peak_model_N=float(np.abs(force[start:]).max()),
        in_band_percent=None
        if band is None
        else 100.0 * band.coverage(force[start:], prepared.force[start:], band.widened(path)),
    )


def command_threshold(commands: Iterable[float | None]) -> float:
    """Return the limit [A or V] below which a command counts as zero: 3 % of the maximum, at least 0.02."""
    return max(0.02, 0.03 * max((abs(c) for c in commands if c is not None), default=0.0))


def summary(errors: Iterable[RunError]) -> dict[str, float]:
    """Return the median and the maximum of ``nrmse_percent``, and the maximum over runs with nonzero command.

    A value is NaN if there are no such runs.
    """
    errors = tuple(errors)
    every = np.array([e.nrmse_percent for e in errors])
    least = command_threshold(e.command for e in errors)
    above = np.array([e.nrmse_percent for e in errors if e.command is None or abs(e.command) > least])
    return {
        "median": float(np.median(every)) if len(every) else float("nan"),
        "worst": float(every.max()) if len(every) else float("nan"),
        "worst_above_zero": float(above.max()) if len(above) else float("nan"),
    }


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """Median, RMS and maximum of the errors ``nrmse_percent`` of a set of runs."""

    kind: ErrorKind
    current: CurrentKind
    run_count: int
    median_percent: float
    rms_percent: float
    worst_percent: float


def summarize_errors(
    runs: Iterable[RunError], cv_percent: Sequence[float] = (), changing_cv_percent: Sequence[float] = ()
) -> tuple[ErrorSummary, ...]:
    """Return the error statistics of held-out runs, training runs and cross-validation.

    There are separate statistics for constant and for changing current. Statistics without any run are
    omitted. The last two arguments are the cross-validation errors of runs with constant and with changing
    current.
    """
    errors: dict[tuple[ErrorKind, CurrentKind], list[float]] = {
        (kind, current): [] for kind in get_args(ErrorKind) for current in get_args(CurrentKind)
    }
    for run in runs:
        errors[run.split, "changing" if run.command is None else "constant"].append(run.nrmse_percent)
    errors["cross_validation", "constant"] += cv_percent
    errors["cross_validation", "changing"] += changing_cv_percent
    return tuple(
        ErrorSummary(kind, current, len(values), float(np.median(values)), rms(np.array(values)), max(values))
        for (kind, current), values in errors.items()
        if values
    )
