"""The actuation identified: delay and lags between command and force, from runs whose command steps.

The damper's law is fitted on runs at constant command first and stands still here. Around every change of
the command the measured force is compared with the damper's, driven through a delay and two lags; in each
such window a gain and an offset are free, so that what the law gets wrong in level says nothing about time.

The lags hold at about the speed of these runs. A law feels a new command at once, while in a damper the force
has to be built up against its stiffness s, with the time constant F / (s v): at 30 mm/s some 7 ms of a stiff
bench damper and 20 ms of a soft one, at 500 mm/s a millisecond. It is read as lag: step at the speeds of use.

The play is what is left then: a command that was reached from above is felt as more than the same command
reached from below. It is told where runs come to one command from both sides and stay there.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.models.actuation import PLAY_SHARE, Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate

__all__ = ["ActuationFit", "fit_actuation", "steps_of"]

_BEFORE_S, _AFTER_S = 0.02, 0.15  # of a window around a change of the command
_RESTLESS_S = 0.4  # of a window: a command that does not settle says more of the law than of the lag
_STEP = 0.05  # of the command's range: a smaller change opens no window
_LEAST_MOVED_N = 5.0  # a window in which the damper's force moves by less tells nothing
_LONGEST_S = 0.3
_SHORTEST_S = 1e-4
_NAMES = ("rise_s", "fall_s", "second_s", "delay_s")
_SETTLED_S = 0.1  # after a change of the command, before its level is looked at


@dataclass(frozen=True, slots=True)
class ActuationFit:
    """An identified actuation, its standard errors, and how well it follows the steps."""

    actuation: Actuation
    standard_errors: dict[str, float]  # of rise_s, fall_s, second_s, delay_s [s], play; NaN where not told
    t63_s: float  # from a step up of the command to 63 % of the way
    t90_s: float
    rmse_N: float  # in the windows, level taken out
    unlagged_rmse_N: float  # the same without an actuation
    windows: int
    cpu_s: float


def steps_of(command: FloatArray, step: float) -> list[slice]:
    """Return the windows around the changes of a command with a time step [s]; those that touch are one."""
    span = float(np.ptp(command))
    near = max(round(0.01 / step), 1)  # a change within 10 ms counts as one step
    moved = np.abs(command[near:] - command[:-near]) > _STEP * span if span > 0.0 else np.zeros(0, dtype=bool)
    windows: list[slice] = []
    for k in np.flatnonzero(moved).tolist():
        start = max(k - round(_BEFORE_S / step), 0)
        stop = min(k + near + round(_AFTER_S / step), len(command))
        if windows and start <= windows[-1].stop:
            windows[-1] = slice(windows[-1].start, stop)
        else:
            windows.append(slice(start, stop))
    return windows


def fit_actuation(
    damper: Damper, runs: Sequence[PreparedRun], *, resistance_20_ohm: float | None = None
) -> ActuationFit:
    """Fit delay, rise, fall and second lag to runs whose command varies; of them to those where it settles.

    Raises
    ------
    InputError
        No run in which a step of the command moves the force.
    ConvergenceError
        The search ended without a finite error.
    """
    clock = time.process_time()
    still = replace(damper, command_lag_s=0.0, actuation=None)
    stepped = _stepped_runs(still, runs)
    largest = max(float(np.abs(run.trajectory.command).max()) for run in runs)

    def made(point: FloatArray) -> Actuation:
        rise, fall = np.exp(point[:2]).tolist()
        return Actuation(rise, fall, float(point[2]), float(point[3]), resistance_20_ohm, largest)

    def residual(actuation: Actuation | None) -> FloatArray:
        moved = replace(still, actuation=actuation)
        parts = []
        for drive, measured, windows in stepped:
            force = simulate(moved, drive)
            parts += [_level_free(force[window], measured[window]) for window in windows]
        return np.concatenate(parts)

    low = np.array([np.log(_SHORTEST_S)] * 2 + [0.0, 0.0])
    high = np.array([np.log(_LONGEST_S)] * 2 + [_LONGEST_S, 0.1])
    found = _search(lambda point: residual(made(point)), low, high)
    lags = made(found.x)
    play, play_error = _fit_play(replace(still, actuation=lags), runs)
    actuation = replace(lags, play=play)
    errors = _errors(np.asarray(found.jac), found.fun, found.x, (low, high))
    return ActuationFit(
        actuation=actuation,
        standard_errors={**errors, "play": play_error},
        t63_s=actuation.response_time(0.63),
        t90_s=actuation.response_time(0.9),
        rmse_N=float(np.sqrt(np.mean(found.fun**2))),
        unlagged_rmse_N=float(np.sqrt(np.mean(residual(None) ** 2))),
        windows=sum(len(windows) for _, _, windows in stepped),
        cpu_s=time.process_time() - clock,
    )


def _stepped_runs(still: Damper, runs: Sequence[PreparedRun]) -> list[tuple[Drive, FloatArray, list[slice]]]:
    """Return drive, force [N] and windows of the runs in which a step of the command moves the force."""
    found, settled = [], []
    for run in runs:
        path = run.trajectory
        drive = open_drive(path)
        held = replace(path, command=np.full(len(path), path.command.min()))
        moved = simulate(still, drive) - simulate(still, held)  # by the command, not by the motion
        windows = [
            window
            for window in steps_of(path.command, path.step)
            if np.ptp(moved[window]) > _LEAST_MOVED_N and window.start >= run.scored_from
        ]
        if windows:
            found.append((drive, run.force, windows))
            if max(each.stop - each.start for each in windows) * path.step <= _RESTLESS_S:
                settled.append(found[-1])
    if not found:
        raise InputError(
            found="no run has a step of the command that moves the force",
            expected="runs such as a triangle of constant speed with the current stepped at mid-stroke",
            remedy="Without one the lags are unknown",
        )
    return settled or found


def _search(
    residual: Callable[[FloatArray], FloatArray], low: FloatArray, high: FloatArray
) -> OptimizeResult:
    """Return the better of two least-squares searches, from quick and from slow lags."""
    tried = []
    for slow in (0.008, 0.03):
        start = np.array([np.log(slow)] * 2 + [0.3 * slow, 0.1 * slow])
        tried.append(
            least_squares(
                residual, start, bounds=(low, high), x_scale=[0.3, 0.3, 2e-3, 1e-3], diff_step=[1e-4] * 4
            )
        )
    best = tried[1] if tried[1].cost < tried[0].cost else tried[0]
    if not np.isfinite(best.cost):
        raise ConvergenceError(
            place="actuation", found="no finite error; check that current and force belong together in time"
        )
    return best


@dataclass(frozen=True, slots=True)
class _PlayEvidence:
    """Evidence of runs on the play: sums of squares, of the column that it multiplies and of the error."""

    squares: float  # of the column [N^2/A^2]
    products: float  # of column and error [N^2/A]
    rest: float  # of the error [N^2]
    freedom: int  # samples less levels

    @property
    def play(self) -> float:
        return self.products / self.squares

    @property
    def error(self) -> float:
        left = max(self.rest - self.play * self.products, 0.0) / max(self.freedom - 1, 1)
        return float(np.sqrt(left / self.squares))


def _fit_play(damper: Damper, runs: Sequence[PreparedRun]) -> tuple[float, float]:
    """Return the half width of the play [A or V] and its standard error; 0 and NaN where no run tells.

    A driver's overshoot goes ahead into the dead band, from both sides: it hides play and never adds any. It
    is largest where the coil is cold. So the runs that show the most are believed, and those that do not
    contradict them (by two standard errors).
    """
    told = [each for run in runs if (each := _play_evidence(damper, run)) is not None]
    if not told:
        return 0.0, float("nan")
    most = max(told, key=lambda each: each.play - 2.0 * each.error)
    kept = [each for each in told if most.play - each.play <= 2.0 * np.hypot(most.error, each.error)]
    whole = _PlayEvidence(
        sum(each.squares for each in kept),
        sum(each.products for each in kept),
        sum(each.rest for each in kept),
        sum(each.freedom for each in kept),
    )
    return max(whole.play, 0.0), whole.error


def _play_evidence(damper: Damper, run: PreparedRun) -> _PlayEvidence | None:
    """Return what one run tells of the play, None where it tells nothing.

    Where a command is held, force less the damper's is a level for each command and direction of motion, and,
    where the command was reached from above, the play's width times the force's growth with the command.
    """
    path = run.trajectory
    span = float(np.ptp(path.command))
    if span == 0.0 or np.min(path.command) < 0.0:
        return None
    step = 0.01 * span
    force = simulate(damper, path)
    growth = (simulate(damper, replace(path, command=path.command + step)) - force) / step
    growth *= 2.0 * PLAY_SHARE  # by the half width
    from_above, since = _how_reached(path.command, path.step)
    held = (since >= _SETTLED_S) & (np.arange(len(force)) >= run.scored_from)
    direction = np.sign(path.velocity)
    squares, products, rest, freedom = 0.0, 0.0, 0.0, 0
    for level in np.unique(np.round(path.command[held], 6)):
        for side in (-1.0, 1.0):
            here = held & (np.abs(path.command - level) < 1e-6 * max(span, 1.0)) & (direction == side)
            if here.any():  # away from reversals, where the law errs in other ways
                here &= side * growth > 0.9 * float(np.quantile(side * growth[here], 0.9))
            above = here & (from_above > 0.0)
            if above.sum() < 20 or (here & (from_above < 0.0)).sum() < 20:
                continue
            error = (run.force - force)[here]
            column = np.where(above[here], growth[here], 0.0)
            error, column = error - error.mean(), column - column.mean()
            squares += float(column @ column)
            products += float(column @ error)
            rest += float(error @ error)
            freedom += len(error) - 1
    return _PlayEvidence(squares, products, rest, freedom) if squares > 0.0 else None


def _how_reached(command: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return whether the command last fell (1), rose (-1) or never moved (0), and how long ago [s]."""
    moved = np.diff(command, prepend=command[0])
    places = np.where(moved != 0.0, np.arange(len(command)), -1)
    last = np.maximum.accumulate(places)
    way = np.where(last >= 0, -np.sign(moved[np.maximum(last, 0)]), 0.0)
    since = np.where(last >= 0, (np.arange(len(command)) - last) * step, np.inf)
    return way, since


def _level_free(model: FloatArray, measured: FloatArray) -> FloatArray:
    """Return measured - (a + b model), a and b by least squares: an error of shape, not of level."""
    centred, wanted = model - model.mean(), measured - measured.mean()
    square = float(centred @ centred)
    gain = float(centred @ wanted) / square if square > 0.0 else 0.0
    return np.asarray(wanted - gain * centred)


def _errors(
    jacobian: FloatArray, residual: FloatArray, point: FloatArray, bounds: tuple[FloatArray, FloatArray]
) -> dict[str, float]:
    """Return standard errors [s] for independent residuals; NaN where one sits on its bound."""
    span = bounds[1] - bounds[0]
    free = (point > bounds[0] + 1e-6 * span) & (point < bounds[1] - 1e-6 * span)
    errors = np.full(len(point), np.nan)
    if free.any():
        j = jacobian[:, free]
        noise = float(residual @ residual) / max(len(residual) - int(free.sum()), 1)
        errors[free] = np.sqrt(np.maximum(np.diag(noise * np.linalg.pinv(j.T @ j)), 0.0))
    errors[:2] *= np.exp(point[:2])
    return dict(zip(_NAMES, errors.tolist(), strict=True))
