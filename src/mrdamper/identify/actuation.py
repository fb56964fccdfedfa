"""The actuation identified: delay and lags between command and force, from runs whose command steps.

The damper's law is fitted on runs at constant command first and stands still here. Steps that are held tell
what share of the way the force has gone, whatever position and speed do meanwhile (``step_responses``);
delay and two lags are fitted to those shares. Where no command is held, the force in windows around its
changes is compared with the damper's, with a gain and an offset free in each.

The lags hold at about the speed of these runs. A law feels a new command at once, while in a damper the force
has to be built up against its stiffness s, with the time constant F / (s v): at 30 mm/s some 7 ms of a stiff
bench damper and 20 ms of a soft one, at 500 mm/s a millisecond. It is read as lag: step at the speeds of use.

A law whose bristles hold force knows that itself: what share of it follows the command at once (the chain's
``follow_share``) is found here too, each share with its own lags, by the force over all runs that step.

The play is what is left then: a command that was reached from above is felt as more than the same command
reached from below. It is told where runs come to one command from both sides and stay there. Runs whose
command moves about tell it at all levels, by their force; overshoot and lags hide play there as they do where
a command is held, so the larger of the two is believed.

Iron saturates and has plays of more than one width, and a driver of one quadrant cannot pull the current
down: such a current falls by the coil's flux, so that a fall has no one time. Where runs show either, all
numbers are found anew by the force over all runs that step (``with_iron``), in the form that follows runs
best that were left out.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.scores import score_run
from mrdamper.identify.step_responses import (
    LEAST_STEP,
    SETTLED_S,
    SHARE,
    SteppedRun,
    StepTime,
    measured_times,
    stepped_run,
)
from mrdamper.models.actuation import PLAY_SHARE, Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import Drive, open_drive, simulate

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

_BEFORE_S, _AFTER_S = 0.02, 0.15  # of a window around a change of the command
_RESTLESS_S = 0.4  # of a window: a command that does not settle says more of the law than of the lag
_LEAST_MOVED = 0.003  # of the runs' largest force: a window in which a command moves it less tells nothing
_LONGEST_S = 0.3
_SHORTEST_S = 1e-4
_LOW = np.array([np.log(_SHORTEST_S)] * 2 + [0.0, 0.0])  # of log rise, log fall, second, delay
_HIGH = np.array([np.log(_LONGEST_S)] * 2 + [_LONGEST_S, 0.1])
_INSIDE = np.array([0.1, 0.1, 1e-4, 1e-4])  # of these bounds a search begins
_FINER = 16  # parts of a sample in which a command jumps
_WHEEL_FINER = 4  # ... of runs without windows, where it matters less
_FREE_WHEELS = 1.4  # ratio of a fall to zero to other steps, from which the driver has one quadrant
_WITHIN = 1e-4  # relative step and fall of the error at which a search for lags ends
_ROUNDS = 3  # of setting rise and fall by the measured times
_SYSTEMATIC = 0.06  # of a time to 63 %: maps and plays of the steps; chosen on even draws (docs/believe.md)
_FOLLOW_SHARE = "follow_share"
_INWARDS, _SHARE_WITHIN = 0.25, 0.05  # of the share that follows at once
_NAMES = ("rise_s", "fall_s", "second_s", "delay_s")
_PLAIN = (*_NAMES, "play")
_FREE_WHEEL = ("rise_s", "fall_s", "wheel_s", "play")
_SATURATING = (*_PLAIN, "wheel_s", "saturation")
_IRON = (*_PLAIN, "wide_play", "saturation")
_FREE_IRON = (*_IRON, "wheel_s")
_ROUNDS_OF_ALL = 20  # of the search for these
_FEW_ROUNDS = 6  # ... of one that only says what to search
_SLOWER = 5.0  # a fall that no step tells, of the time to 63 % of a rise
_LONGER = 3.0  # from a fall of 63 % that begins saturated to the time constant without saturation
_LEAST_SATURATION, _MOST_SATURATION = 0.05, 30.0  # of the largest command
_PLAYS = ("play", "wide_play")
_LEAST_REMANENCE = 0.02  # of the largest command, where a search begins
_NARROW, _WIDE = 0.6, 2.4  # of two plays' half widths over the remanence, where a search begins
# Of the squared error, that iron leaves where runs show it; chosen on even draws (docs/believe.md).
_TELLING = 0.95
_SIMPLER = 0.98  # of the squared error of runs left out, that one play is forgiven beside two
_CLEARLY = 0.3  # of the squared error of runs left out; chosen on even draws (docs/believe.md)


@dataclass(frozen=True, slots=True)
class ActuationFit:
    """An identified actuation, its standard errors, and how well it follows the steps."""

    actuation: Actuation
    standard_errors: dict[str, float]  # of the actuation's numbers by name; NaN where not told
    t63_s: float  # from a step up of the command to 63 % of the force's way
    t90_s: float  # of the command at the law
    rmse_N: float  # in the windows, level taken out
    unlagged_rmse_N: float  # the same without an actuation
    windows: int
    cpu_s: float
    t63_fall_s: float = float("nan")  # from a step down of the command
    t63_error_s: float = float("nan")  # standard errors of the two
    t63_fall_error_s: float = float("nan")
    driver_quadrants: int | None = None  # 1: the driver cannot pull the current down; None: no steps tell

    @property
    def response_times(self) -> dict[str, float]:
        """The times to 63 % of a step and their standard errors, by the names that files have."""
        names = ("t63_s", "t63_fall_s", "t63_error_s", "t63_fall_error_s")
        return {name: getattr(self, name) for name in names}


class Follows(NamedTuple):
    """How a force follows its command: the share that does at once, if the law has one, and lags."""

    share: float | None
    actuation: Actuation

    @classmethod
    def of(cls, damper: Damper) -> Follows | None:
        """Return it of a damper; None where it has no actuation."""
        share = damper.coefficients.get(_FOLLOW_SHARE)
        if damper.actuation is None:
            return None
        return cls(None if share is None else float(share.value(0.0)), damper.actuation)


def steps_of(command: FloatArray, step: float) -> list[slice]:
    """Return the windows around the changes of a command with a time step [s]; those that touch are one."""
    span = float(np.ptp(command))
    near = max(round(0.01 / step), 1)  # a change within 10 ms counts as one step
    moved = (
        np.abs(command[near:] - command[:-near]) > LEAST_STEP * span
        if span > 0.0
        else np.zeros(0, dtype=bool)
    )
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
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    resistance_20_ohm: float | None = None,
    near: Actuation | None = None,
    within: float = _WITHIN,
) -> ActuationFit:
    """Fit delay, rise, fall and second lag to runs whose command varies.

    Where commands are held long enough between their steps, the share of each step that the force has reached
    is fitted (``step_responses``), and rise and fall are then set so that the model takes the measured time
    to 63 % of a step, up and down. Else the force in windows around the changes is fitted, level taken out.
    The search begins at the lags of ``near``, those of another law on the same driver, or else at usual ones,
    and ends where a step moves them, or the error, by less than a share ``within``.

    Raises
    ------
    InputError
        No run in which a step of the command moves the force.
    ConvergenceError
        The search ended without a finite error.
    """
    clock = time.process_time()
    still = replace(damper, command_lag_s=0.0, actuation=None).on_limits()
    largest = max(float(np.abs(run.trajectory.command).max()) for run in runs)
    told = [each for run in runs if (each := stepped_run(still, run)) is not None]
    windows = _stepped_runs(still, [each.run for each in told] or runs)
    if told:
        lags, errors, times = _fit_responses(still, told, near, within)
    else:
        lags, errors = _fit_windows(still, windows, near, within)
        times = _Times(lags.response_time(SHARE), lags.response_time(SHARE, 1.0, 0.0))
    lags = replace(lags, resistance_20_ohm=resistance_20_ohm, largest_command=largest)
    play, play_error = _fit_play(replace(still, actuation=lags), runs)
    held = {id(each.run) for each in told}
    restless = [run for run in runs if id(run) not in held and np.ptp(run.trajectory.command) > 0.0]
    if told and restless and times.quadrants != 1:  # the play beside a free-wheeling current is found with it
        felt, felt_error = _felt_play(still, replace(lags, play=play), restless, largest)
        if felt > play:
            play, play_error = felt, felt_error
    left, unlagged = (_window_error(still, each, windows) for each in (lags, None))
    return ActuationFit(
        actuation=replace(lags, play=play),
        standard_errors={**errors, "play": play_error},
        t63_s=times.up_s if math.isfinite(times.up_s) else lags.response_time(SHARE),
        t90_s=lags.response_time(0.9),
        rmse_N=rms(left),
        unlagged_rmse_N=rms(unlagged),
        windows=sum(len(each) for _, _, each in windows),
        cpu_s=time.process_time() - clock,
        t63_fall_s=times.down_s,
        t63_error_s=times.up_error_s,
        t63_fall_error_s=times.down_error_s,
        driver_quadrants=times.quadrants,
    )


def fit_changes(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    resistance_20_ohm: float | None = None,
    near: Follows | None = None,
    within: float = _WITHIN,
) -> tuple[Damper, ActuationFit]:
    """Return a damper with its actuation and, if its law has one, the share that follows the command at once.

    Lags are fitted where all of the force follows at once, and where none does; in between only if a step
    inwards from the better of these lowers the error. Where ``near`` says how another law of the same damper
    follows, the lags begin at its own, with its share or, while that is better, one that is a step further.
    ``within`` is that of ``fit_actuation``.

    Raises
    ------
    InputError, ConvergenceError
        As ``fit_actuation``.
    """

    def fitted(share: float | None, begin: Actuation | None = None) -> tuple[float, Damper, ActuationFit]:
        still = damper if share is None else _following(damper, share)
        found = fit_actuation(still, runs, resistance_20_ohm=resistance_20_ohm, near=begin, within=within)
        moving = replace(still, actuation=found.actuation)
        return _error(moving, runs), moving, found

    if _FOLLOW_SHARE not in damper.coefficients:
        return fitted(None, None if near is None else near.actuation)[1:]
    if near is not None and near.share is not None:
        share, known = near.share, fitted(near.share, near.actuation)
        while True:
            others = {min(max(share + step, 0.0), 1.0) for step in (-_INWARDS, _INWARDS)} - {share}
            errors = {other: _error(_following(known[1], other), runs) for other in others}
            share = min(errors, key=errors.__getitem__)
            moved = fitted(share, known[1].actuation) if errors[share] < known[0] else known
            if moved[0] >= known[0]:
                return known[1:]
            known = moved
    tried = {share: fitted(share) for share in (0.0, 1.0)}
    end = min(tried, key=lambda share: tried[share][0])
    if _error(_following(tried[end][1], abs(end - _INWARDS)), runs) < tried[end][0]:
        from scipy.optimize import minimize_scalar  # takes a quarter of a second to load

        def error(share: float) -> float:
            tried[share] = fitted(share)
            return tried[share][0]

        minimize_scalar(error, bounds=(0.0, 1.0), method="bounded", options={"xatol": _SHARE_WITHIN})
    return min(tried.values(), key=lambda each: each[0])[1:]


def with_iron(
    damper: Damper, found: ActuationFit, runs: Sequence[PreparedRun]
) -> tuple[Damper, ActuationFit]:
    """Return a damper and its actuation with iron that saturates and has two plays, if its runs show that.

    All numbers of the actuation are then those of the least squared force error over the runs, each weighted
    by its own force, with or without a current that free-wheels: whichever follows runs better that were left
    out. Runs show it where a few rounds of a fit with all of this leave less than ``_TELLING`` of the squared
    error of one without; or where the steps tell of a driver of one quadrant. The driver has one, too, if
    free-wheeling takes ``_CLEARLY`` of the squared error away. The times to 63 % stay as measured.
    """
    told = found.driver_quadrants == 1
    still = replace(damper, command_lag_s=0.0, actuation=None).on_limits()
    fits = _IronFits(still, found, [_WeighedRun.of(run) for run in runs])
    if not told and not fits.promising:
        return damper, found
    forms = [_SATURATING, _IRON, _FREE_IRON, *([_FREE_WHEEL] if told else [])]
    tried = {names: fits.left_out(names) for names in forms}
    names = min(tried, key=lambda form: tried[form] * (1.0 if "wide_play" in form else _SIMPLER))
    best = fits.fitted(names)
    actuation, clearly = best.actuation, tried[_FREE_IRON] < (1.0 - _CLEARLY) * tried[_IRON]
    windows = _stepped_runs(still, runs)
    return replace(damper, actuation=actuation), replace(
        found,
        actuation=actuation,
        standard_errors=found.standard_errors | best.standard_errors,
        t90_s=actuation.response_time(0.9),
        rmse_N=rms(_window_error(still, actuation, windows)),
        driver_quadrants=1 if told or clearly else found.driver_quadrants,
    )


@dataclass(frozen=True, slots=True)
class _WeighedRun:
    """A run opened for the kernel, with its force and the weight of its squared error."""

    drive: Drive
    force: FloatArray  # [N]
    scored_from: int
    size: float  # [N], root of the sum of the squared force
    restless: bool  # no command is held for long

    @classmethod
    def of(cls, run: PreparedRun) -> _WeighedRun:
        changes = np.count_nonzero(np.diff(run.trajectory.command))
        held_s = len(run) * run.trajectory.step / (changes + 1)
        size = rms(run.force) * math.sqrt(len(run))
        return cls(
            open_drive(run.trajectory), run.force, run.scored_from, size, bool(held_s < 2.0 * SETTLED_S)
        )

    def error(self, still: Damper, lags: Actuation) -> FloatArray:
        """Return the model's force less the measured one where it is scored, over the size."""
        force = _lagged_force(still, lags, self.drive, _WHEEL_FINER)
        return np.asarray(((force - self.force) / self.size)[self.scored_from :])


@dataclass(frozen=True, slots=True)
class _Refitted:
    """An actuation whose numbers of these names were found over all runs, and their errors."""

    actuation: Actuation
    standard_errors: dict[str, float]


@dataclass(frozen=True, slots=True)
class _IronFits:
    """Fits of the actuation's numbers by the force over runs that step."""

    still: Damper
    found: ActuationFit
    runs: Sequence[_WeighedRun]

    @property
    def _judging(self) -> list[int]:
        """The runs that are left out in turn: those whose command moves about, else all."""
        restless = [k for k, run in enumerate(self.runs) if run.restless]
        return restless if len(restless) > 1 else list(range(len(self.runs)))

    @property
    def promising(self) -> bool:
        """Whether a few rounds over two restless runs leave much less error with iron than without."""
        restless = [k for k, run in enumerate(self.runs) if run.restless][:2]
        if len(restless) < 2:
            return False
        with_iron, without = (
            self.squares(self._fit(self._start(names), names, restless, _FEW_ROUNDS).actuation, restless)
            for names in (_FREE_IRON, _PLAIN)
        )
        return with_iron < _TELLING * without

    def fitted(self, names: tuple[str, ...]) -> _Refitted:
        """Return the fit of these numbers to all runs; what is not named there is none of."""
        return self._fit(self._start(names), names, range(len(self.runs)))

    def _start(self, names: tuple[str, ...]) -> Actuation:
        known, fall_s = self.found.actuation, self.found.t63_fall_s
        start = replace(known, saturation=0.5 * self._largest if "saturation" in names else 0.0)
        if "wide_play" in names:
            remanence = max(known.play, _LEAST_REMANENCE * self._largest)
            start = replace(start, play=_NARROW * remanence, wide_play=_WIDE * remanence)
        if "wheel_s" not in names:
            return start
        slow_s = fall_s if math.isfinite(fall_s) else _SLOWER * self.found.t63_s
        wheel_s = (_LONGER if "saturation" in names else 1.0) * slow_s
        return replace(start, fall_s=0.5 * known.fall_s, wheel_s=wheel_s)

    def left_out(self, names: tuple[str, ...]) -> float:
        """Return the squared errors of runs after a few rounds of a fit to others, in two halves."""
        judging, total = self._judging, 0.0
        for half, rest in ((judging[::2], judging[1::2]), (judging[1::2], judging[::2])):
            if half and rest:
                total += self.squares(self._fit(self._start(names), names, rest, _FEW_ROUNDS).actuation, half)
        return total

    def squares(self, lags: Actuation, runs: Sequence[int]) -> float:
        """Return the sum of the squared errors of runs."""
        return float(sum(np.sum(self.runs[k].error(self.still, lags) ** 2) for k in runs))

    @property
    def _largest(self) -> float:
        known = self.found.actuation.largest_command
        return known or max(float(np.abs(run.drive.trajectory.command).max()) for run in self.runs)

    def _fit(
        self, start: Actuation, names: tuple[str, ...], runs: Sequence[int], rounds: int = _ROUNDS_OF_ALL
    ) -> _Refitted:
        from scipy.optimize import least_squares  # takes a quarter of a second to load

        largest, logs = self._largest, [name not in _PLAYS for name in names]
        bounds = {
            **dict.fromkeys(_PLAYS, (0.0, largest)),
            "saturation": (math.log(_LEAST_SATURATION * largest), math.log(_MOST_SATURATION * largest)),
        }
        low, high = np.array([bounds.get(name, (_LOW[0], _HIGH[0])) for name in names]).T

        def moved(point: FloatArray) -> Actuation:
            values = np.where(logs, np.exp(point), point).tolist()
            return replace(start, **dict(zip(names, values, strict=True)))

        def residual(point: FloatArray) -> FloatArray:
            lags = moved(point)
            return np.concatenate([self.runs[k].error(self.still, lags) for k in runs])

        begin = [getattr(start, name) for name in names]
        inside = [math.log(max(u, _SHORTEST_S)) if log else u for u, log in zip(begin, logs, strict=True)]
        best = least_squares(
            residual,
            np.clip(inside, low, high),
            bounds=(low, high),
            x_scale=[0.3 if log else 0.02 * largest for log in logs],
            diff_step=[1e-3] * len(names),
            xtol=1e-3,
            ftol=1e-4,
            max_nfev=rounds,
        )
        errors = _errors(np.asarray(best.jac), best.fun, best.x, low, high, logs=0)
        values = [
            error * (math.exp(u) if log else 1.0) for error, u, log in zip(errors, best.x, logs, strict=True)
        ]
        return _Refitted(moved(best.x), dict(zip(names, values, strict=True)))


def _following(damper: Damper, share: float) -> Damper:
    return replace(damper, coefficients={**damper.coefficients, _FOLLOW_SHARE: Constant(share)})


def _error(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    """Return the mean over runs of the squared error [%^2]."""
    return float(np.mean([score_run(damper, run).nrmse_percent ** 2 for run in runs]))


# --------------------------------------------------------------------------------- steps that are held


@dataclass(frozen=True, slots=True)
class _Times:
    """Times [s] to 63 % of a step of the command, up and down, and their standard errors.

    ``up_noise_s`` and ``down_noise_s`` are the shares of the errors that repeated steps of one kind show.
    """

    up_s: float
    down_s: float
    up_error_s: float = math.nan
    down_error_s: float = math.nan
    up_noise_s: float = 0.0
    down_noise_s: float = 0.0
    quadrants: int | None = None

    @classmethod
    def of(cls, steps: Sequence[StepTime], *, model: bool = False) -> _Times:
        """Return the means over kinds of step; the error holds their scatter and what maps may be off by."""
        found: list[tuple[float, float, float]] = []
        for upwards in (True, False):
            kinds: dict[tuple[int, int], list[float]] = {}
            for each in steps:
                if each.upwards == upwards:
                    kinds.setdefault(each.levels, []).append(each.model_s if model else each.measured_s)
            found.append(_mean_over_kinds([np.array(times) for times in kinds.values()]))
        (up, up_error, up_noise), (down, down_error, down_noise) = found
        return cls(up, down, up_error, down_error, up_noise, down_noise, _quadrants(steps, up))


def _quadrants(steps: Sequence[StepTime], up_s: float) -> int | None:
    """Return 1 where a fall to zero takes far longer than one to a level and than a rise, else 2.

    A driver of one quadrant can only let the current free-wheel: it falls by the coil's own time constant, of
    which a fall to a level above zero needs a part. None where falls of both kinds are not there.
    """
    to_zero, to_level = (
        [each.measured_s for each in steps if not each.upwards and (each.levels[1] == 0) == zero]
        for zero in (True, False)
    )
    if not (to_zero and to_level and math.isfinite(up_s)):
        return None
    slowest_other = max(float(np.mean(to_level)), up_s)
    return 1 if float(np.mean(to_zero)) > _FREE_WHEELS * slowest_other else 2


def _mean_over_kinds(kinds: Sequence[FloatArray]) -> tuple[float, float, float]:
    """Return the mean of the kinds' mean times [s], its standard error, and the part of repeated steps."""
    if not kinds:
        return math.nan, math.nan, 0.0
    means = np.array([times.mean() for times in kinds])
    mean, count = float(means.mean()), len(kinds)
    freedom = sum(len(times) - 1 for times in kinds)
    within = sum(float(np.sum((times - times.mean()) ** 2)) for times in kinds) / max(freedom, 1)
    noise = math.sqrt(within * sum(1.0 / len(times) for times in kinds)) / count
    scatter = float(np.std(means, ddof=1)) / math.sqrt(count) if count > 1 else noise
    return mean, math.hypot(max(scatter, noise), _SYSTEMATIC * mean), noise


def _fit_responses(
    still: Damper, told: Sequence[SteppedRun], near: Actuation | None, within: float
) -> tuple[Actuation, dict[str, float], _Times]:
    """Return the lags that follow the measured responses, their errors, and the times to 63 % of a step."""

    def force_of(lags: Actuation) -> Callable[[SteppedRun], FloatArray]:
        return lambda each: _lagged_force(still, lags, each.drive)

    def residual(point: FloatArray) -> FloatArray:
        lags, parts = _lags(point), []
        for each in told:
            shares = each.model_shares(_lagged_force(still, lags, each.drive))
            parts += [
                (model - response.share) * np.abs(response.size)
                for model, response in zip(shares, each.responses, strict=True)
            ]
        return np.concatenate(parts)

    found = _search(residual, (0.008,), near, within)
    lags = _lags(found.x)
    times = _Times.of(measured_times(told, force_of(lags)))
    for _ in range(_ROUNDS):
        model = _Times.of(measured_times(told, force_of(lags)), model=True)
        lags = replace(
            lags,
            rise_s=_moved(lags.rise_s, times.up_s - model.up_s),
            fall_s=_moved(lags.fall_s, times.down_s - model.down_s),
        )
    errors = _named_errors(found)
    for name, noise in (("rise_s", times.up_noise_s), ("fall_s", times.down_noise_s)):
        errors[name] = math.hypot(errors[name], noise)
    return lags, errors, times


def _moved(lag_s: float, later_s: float) -> float:
    """Return a lag after which 63 % of a step comes later by so much; where nothing is known, as it is."""
    if not np.isfinite(later_s):
        return lag_s
    return float(np.clip(lag_s + later_s, max(0.3 * lag_s, _SHORTEST_S), min(3.0 * lag_s, _LONGEST_S)))


def _lags(point: FloatArray) -> Actuation:
    rise, fall = np.exp(point[:2]).tolist()
    return Actuation(rise, fall, float(point[2]), float(point[3]))


def _lagged_force(still: Damper, lags: Actuation | None, drive: Drive, finer: int = _FINER) -> FloatArray:
    """Return the force [N] over a run whose command holds between its samples and jumps at them."""
    path = drive.trajectory
    felt = path.command
    if lags is not None:
        felt = lags.applied(np.repeat(felt, finer), path.step / finer)[::finer]
    return simulate(still, replace(drive, trajectory=replace(path, command=felt), constant=None))


# --------------------------------------------------------------------------------- windows around changes


def _fit_windows(
    still: Damper,
    windows: Sequence[tuple[Drive, FloatArray, list[slice]]],
    near: Actuation | None,
    within: float,
) -> tuple[Actuation, dict[str, float]]:
    """Return the lags by the force in windows around the changes, and their errors."""
    found = _search(lambda point: _window_error(still, _lags(point), windows), (0.008, 0.03), near, within)
    return _lags(found.x), _named_errors(found)


def _window_error(
    still: Damper, lags: Actuation | None, windows: Sequence[tuple[Drive, FloatArray, list[slice]]]
) -> FloatArray:
    """Return measured less modelled force [N] in all windows, each with its level taken out."""
    parts = []
    for drive, measured, inside in windows:
        force = _lagged_force(still, lags, drive)
        parts += [_level_free(force[window], measured[window]) for window in inside]
    return np.concatenate(parts)


def _stepped_runs(still: Damper, runs: Sequence[PreparedRun]) -> list[tuple[Drive, FloatArray, list[slice]]]:
    """Return drive, force [N] and windows of the runs in which a step of the command moves the force."""
    found, settled = [], []
    least_N = _LEAST_MOVED * max((float(np.abs(run.force).max()) for run in runs), default=0.0)
    for run in runs:
        path = run.trajectory
        drive = open_drive(path)
        held = replace(path, command=np.full(len(path), path.command.min()))
        moved = simulate(still, drive) - simulate(still, held)  # by the command, not by the motion
        windows = [
            window
            for window in steps_of(path.command, path.step)
            if np.ptp(moved[window]) > least_N and window.start >= run.scored_from
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
    residual: Callable[[FloatArray], FloatArray],
    usual_s: Sequence[float],
    near: Actuation | None,
    within: float,
) -> OptimizeResult:
    """Return the best of least-squares searches from lags of usual lengths [s], or from known ones."""
    from scipy.optimize import least_squares  # takes a quarter of a second to load

    starts = [np.array([np.log(slow)] * 2 + [0.3 * slow, 0.1 * slow]) for slow in usual_s]
    if near is not None:
        known = [*np.log([near.rise_s, near.fall_s]), near.second_s, near.delay_s]
        starts = [np.clip(known, _LOW + _INSIDE, _HIGH - _INSIDE)]
    tried = [
        least_squares(
            residual,
            start,
            bounds=(_LOW, _HIGH),
            x_scale=[0.3, 0.3, 2e-3, 1e-3],
            diff_step=[1e-4] * 4,
            xtol=within,
            ftol=within,
        )
        for start in starts
    ]
    best = min(tried, key=lambda each: each.cost)
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


def _felt_play(
    still: Damper, lags: Actuation, runs: Sequence[PreparedRun], largest: float
) -> tuple[float, float]:
    """Return the half width of the play [A or V] of the least squared force error over runs, and its error.

    Held commands tell the play at their own levels, and iron has more of it the farther from saturation.
    A command that moves about is felt at all levels, as a controller's is.
    """
    from scipy.optimize import least_squares  # takes a quarter of a second to load

    drives = [open_drive(run.trajectory) for run in runs]
    sizes = [rms(run.force) * math.sqrt(len(run)) for run in runs]

    def residual(point: FloatArray) -> FloatArray:
        felt = replace(lags, play=float(point[0]))
        return np.concatenate(
            [
                ((_lagged_force(still, felt, drive, _WHEEL_FINER) - run.force) / size)[run.scored_from :]
                for drive, run, size in zip(drives, runs, sizes, strict=True)
            ]
        )

    low, high = np.zeros(1), np.array([largest])
    start = np.clip(np.array([lags.play]), 1e-3 * largest, 0.5 * largest)
    best = least_squares(
        residual, start, bounds=(low, high), x_scale=0.02 * largest, diff_step=[1e-2], xtol=1e-3, ftol=1e-4
    )
    (error,) = _errors(np.asarray(best.jac), best.fun, best.x, low, high, logs=0)
    return float(best.x[0]), error


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
    held = (since >= SETTLED_S) & (np.arange(len(force)) >= run.scored_from)
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


def _named_errors(found: OptimizeResult) -> dict[str, float]:
    errors = _errors(np.asarray(found.jac), found.fun, found.x, _LOW, _HIGH, logs=2)
    return dict(zip(_NAMES, errors, strict=True))


def _errors(
    jacobian: FloatArray,
    residual: FloatArray,
    point: FloatArray,
    low: FloatArray,
    high: FloatArray,
    *,
    logs: int,
) -> list[float]:
    """Return standard errors for independent residuals; NaN where one sits on its bound.

    The first ``logs`` are searched as logarithms; their errors are of themselves.
    """
    span = high - low
    free = (point > low + 1e-6 * span) & (point < high - 1e-6 * span)
    errors = np.full(len(point), np.nan)
    if free.any():
        j = jacobian[:, free]
        noise = float(residual @ residual) / max(len(residual) - int(free.sum()), 1)
        errors[free] = np.sqrt(np.maximum(np.diag(noise * np.linalg.pinv(j.T @ j)), 0.0))
    errors[:logs] *= np.exp(point[:logs])
    return [float(error) for error in errors]
