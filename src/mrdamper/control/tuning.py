"""Values of a controller by rule, from the card's actuation, the sampling and the noise of the sensor.

No value is tuned to one damper. The rules:

*Motion filter.* Position, velocity and acceleration from displacement alone: the steady Kalman filter of a
motion whose jerk is white. A density of 1 m/s^3 per root Hz leaves 0.9 mm/s of a sensor of 10 um at 1 kHz.

*Preview.* The time in which a step of the command brings ``PREVIEW_SHARE`` of itself to the force, and half
a sampling period, by which a held command is late on average.

*Lag compensation.* The command compensates ``COMPENSATION`` of the gap that the lags have left at the
preview. Full inversion gains little and moves the command twice as much.

*Reversal clamp.* The command stays below the static answer plus ``CLAMP_SHARE`` of the largest command.

*Prediction.* The motion is assumed to be harmonic, so the filter expects ``SWING_JERK`` of the density. The
horizon begins behind the dead time. It has ``HORIZON_STEPS`` steps and lasts until ``HORIZON_SHARE`` of a
step of the command has passed the lags. No step is shorter than ``STEP_SHARE`` of the time of the motion
filter. If the driver cannot pull the current down, the horizon lasts for ``WHEEL_SHARE`` of a fall from the
largest command to zero, and the steps of the last move are ``WHEEL_STRETCH`` times as long. The dead time
is rounded up to a period, or down if it would be late by more than ``LATE_SHARE`` of a step. The error of a
step has ``HORIZON_FADE`` of the weight of the step before. A move of the command costs ``CALM_SHARE`` of
its force, and ``CALM_TIMES`` the error that the card states, because a wrong law makes the command swing
from end to end. The prediction of a law with an implicit step is spread over at most ``SPREAD_SAMPLES``
periods, and the steps through the dead time are ``DEAD_STRIDE`` times as long as those of the horizon.

*Feedback.* Proportional and integral gain by Skogestad's rule on the actuation: the first lag is the time
constant, all that follows is the dead time, and the closed loop is as slow as that dead time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control import config
from mrdamper.control.protocol import SLOWEST_HZ
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper

JERK_DENSITY = 1.0
"""Of the motion filter [m/s^3 per root Hz]."""

PREVIEW_SHARE = 0.57
COMPENSATION = 0.2
CLAMP_SHARE = 0.05

HORIZON_SHARE = 0.8
HORIZON_STEPS = 6
WHEEL_SHARE = 0.95
WHEEL_STRETCH = 3
STEP_SHARE = 0.25
LATE_SHARE = 0.5
HORIZON_FADE = 0.8
SPREAD_SAMPLES = 3
DEAD_STRIDE = 2.25
CALM_SHARE = 0.03
CALM_TIMES = 12.0

SWING_S = 1.0
"""Time constant of the means that tell how the motion swings [s]."""

SWING_JERK = 0.3
"""What is left of the jerk's density when the swing is known."""

SLOWER = 3.0
"""A swing is believed that is so many times slower than the motion filter: it cannot excite itself."""

SETTLING = 8.0
"""In so many of its time constants a motion filter has found the motion."""

OBSERVER_S = 0.15
"""Time constant of the disturbance observer [s]."""

SERIES_STEP_S = 1e-3
"""Longest step in which the state of the series valve is carried on [s]."""

_CLOSE_STEPS = 3  # of the first two moves of a prediction
_DELAY_LINE = 128  # MRD_TRACK_DELAY_LINE of the kernel


def actuation_of(damper: Damper) -> Actuation:
    """Return the damper's actuation; one lag where it has only a command lag."""
    if damper.actuation is not None:
        return damper.actuation
    return Actuation(damper.command_lag_s, damper.command_lag_s)


def sampled_actuation(actuation: Actuation, period_s: float, preview_s: float = 0.0) -> config.Actuation:
    """Return the actuation over a sampling period [s], and from the end of its dead time to a preview [s].

    With the ``couple`` of the first lag's gap in the second a held command is followed exactly.
    """
    samples, part = divmod(actuation.delay_s / period_s, 1.0)
    (rise, fall), second = (actuation.rise_s, actuation.fall_s), actuation.second_s
    past = math.ceil(actuation.delay_s / period_s - 1e-9) * period_s
    rest, free = max(preview_s - past, 0.0), max(preview_s - actuation.delay_s, 0.0)
    return config.Actuation(
        dead_samples=int(samples),
        dead_part=part,
        rise=_left(rise, period_s),
        fall=_left(fall, period_s),
        second=_left(second, period_s),
        rise_couple=_couple(rise, second, period_s),
        fall_couple=_couple(fall, second, period_s),
        second_ramp=_ramp(second, period_s),
        wheel=_wheel(actuation, period_s),
        bend=1.0 / actuation.saturation if actuation.saturation > 0.0 else 0.0,
        second_ahead=_left(second, rest),
        rise_couple_ahead=_couple(rise, second, rest),
        fall_couple_ahead=_couple(fall, second, rest),
        second_ramp_ahead=_ramp(second, rest),
        wheel_ahead=_wheel(actuation, rest),
        rise_answer=1.0 - _left(second, free) - _couple(rise, second, free),
        fall_answer=1.0 - _left(second, free) - _couple(fall, second, free),
        play=actuation.play,
        play_share=actuation.play_shares[0],
        wide_play=actuation.wide_play,
        wide_share=actuation.play_shares[1],
    )


def check_sampling(actuation: Actuation, period_s: float) -> None:
    """Raise ``InputError`` if a controller samples too slowly for the lag of the force."""
    lagless = actuation.delay_s + actuation.rise_s + actuation.second_s == 0.0
    slowest = math.inf if lagless else actuation.response_time(0.95)
    if period_s > slowest:
        raise InputError(
            place="controller",
            found=(
                f"the period is {1e3 * period_s:g} ms, and the force follows a command within "
                f"{1e3 * slowest:.3g} ms (95 %)"
            ),
            expected="a shorter period",
            remedy=f"Sample at {math.ceil(max(1.0 / slowest, SLOWEST_HZ))} Hz or faster",
        )


def check_delay(actuation: Actuation, period_s: float) -> None:
    """Raise ``InputError`` if the commands of the dead time do not fit into the kernel's delay line."""
    samples = actuation.delay_s // period_s
    if samples > _DELAY_LINE - 3:
        raise InputError(
            place="real-time model",
            found=f"the dead time of {1e3 * actuation.delay_s:g} ms is {samples:.0f} periods",
            expected=f"at most {_DELAY_LINE - 3}",
            remedy="Sample more slowly",
        )


def preview_of(actuation: Actuation, period_s: float) -> float:
    """Return how far ahead [s] a controller sets the force."""
    return actuation.response_time(PREVIEW_SHARE) + 0.5 * period_s


def motion_filter(period_s: float, noise: float, density: float) -> tuple[FloatArray, FloatArray]:
    """Return the steady gains of a filter for value, rate and bend, and the covariance that it leaves.

    The value is read with white ``noise`` (rms) once a period; its third derivative is white with ``density``
    (per root Hz). Gains [-], [1/s], [1/s^2]; covariance after a reading, shape (3, 3).
    """
    if not (noise > 0.0 and density > 0.0):
        raise InputError(
            place="motion filter",
            found=f"noise {noise} and density {density}",
            expected="two positive numbers",
        )
    # In units of noise and period the step is 1, the noise 1, and one number is left.
    power = (density / noise) ** 2 * period_s**5
    step = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    drive = power * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    # Doubling of the Riccati equation of the predicted covariance: the k-th round is 2^k steps.
    a, g, p = step.T.copy(), np.diag([1.0, 0.0, 0.0]), drive
    for _ in range(60):
        inner = np.linalg.inv(np.eye(3) + g @ p)
        moved = p + a.T @ p @ inner @ a
        g = g + a @ inner @ g @ a.T
        a = a @ inner @ a
        done = np.abs(moved - p).max() <= 1e-14 * np.abs(moved).max()
        p = moved
        if done:
            break
    gains = p[:, 0] / (p[0, 0] + 1.0)
    left = p - np.outer(gains, p[0])
    unit = noise / period_s ** np.arange(3)
    return gains / period_s ** np.arange(3), left * np.outer(unit, unit)


def motion_of(
    period_s: float, held_s: float, noise: float, density: float, *, swings: bool
) -> config.MotionFilter:
    """Return the filter for readings that are held for a time [s]; of a motion that swings, or of any."""
    gains, spread = motion_filter(held_s, noise, density * (SWING_JERK if swings else 1.0))
    filter_s = _filter_time(held_s, float(gains[2]))
    return config.MotionFilter(
        gain_x=float(gains[0]),
        gain_v=float(gains[1]),
        gain_a=float(gains[2]),
        held=held_s > 1.5 * period_s,
        swing_share=1.0 - math.exp(-period_s / SWING_S) if swings else 0.0,
        settle_samples=math.ceil(SETTLING * filter_s / period_s),
        most_swing=(SLOWER * filter_s) ** -2.0,
        speed_noise=float(spread[1, 1]),
        bend_noise=float(spread[2, 2]),
    )


def prediction_of(
    actuation: Actuation,
    period_s: float,
    motion: config.MotionFilter,
    force_per_command: float,
    error_per_command: float = 0.0,
    *,
    spread: bool = False,
) -> config.Prediction:
    """Return the horizon of a prediction.

    Parameters
    ----------
    motion : the filter that the motion is known from; no step is shorter than a quarter of its time
    force_per_command : of a steady, fast motion [N/A]
    error_per_command : what the card tells of its own error, over the largest command [N/A]
    spread : over several periods, for a law that costs many instructions
    """
    lags = replace(actuation, delay_s=0.0)
    risen, stretch = lags.response_time(HORIZON_SHARE), 1
    if actuation.wheel_s > 0.0:
        fallen = lags.response_time(WHEEL_SHARE, actuation.largest_command or 1.0, 0.0)
        risen, stretch = max(risen, fallen), WHEEL_STRETCH
    parts = _parts(HORIZON_STEPS, stretch)
    known = 1.0 / (SLOWER * math.sqrt(motion.most_swing))  # the filter's time
    step = max(risen / parts, STEP_SHARE * known, period_s)
    dead = math.ceil(actuation.delay_s / period_s - 1e-9) * period_s
    if dead - actuation.delay_s > LATE_SHARE * step:
        dead -= period_s
    longest = (_DELAY_LINE - 3 - SPREAD_SAMPLES) * period_s - dead
    step = min(step, longest / parts)
    samples = min(SPREAD_SAMPLES, max(1, round(step / period_s))) if spread else 1
    return config.Prediction(
        steps=HORIZON_STEPS,
        samples=samples,
        together=max(1, round((DEAD_STRIDE if spread else 1.0) * step / period_s)),
        step=step,
        stretch=stretch,
        dead=dead + (samples - 1) * period_s,
        fade=HORIZON_FADE,
        calm=CALM_SHARE * abs(force_per_command) + CALM_TIMES * error_per_command,
        rise=_left(actuation.rise_s, step),
        fall=_left(actuation.fall_s, step),
        second=_left(actuation.second_s, step),
        rise_couple=_couple(actuation.rise_s, actuation.second_s, step),
        fall_couple=_couple(actuation.fall_s, actuation.second_s, step),
        second_ramp=_ramp(actuation.second_s, step),
        wheel=_wheel(actuation, step),
    )


def horizon_end(prediction: config.Prediction) -> float:
    """Return the time from now to the end of a horizon [s]."""
    return prediction.dead + _parts(prediction.steps, prediction.stretch) * prediction.step


def _parts(steps: int, stretch: int) -> int:
    """Return how often the shortest step goes into a horizon; those from the fourth on are stretched."""
    return steps + max(steps - _CLOSE_STEPS, 0) * (stretch - 1)


def feedback_gains(actuation: Actuation, period_s: float, force_per_command: float) -> tuple[float, float]:
    """Return proportional gain [A/N] and integral rate [A/(N s)] of a force feedback."""
    slow = max(actuation.rise_s, actuation.fall_s, period_s)
    dead = actuation.delay_s + actuation.second_s + period_s
    gain = slow / (force_per_command * 2.0 * dead)
    return gain, gain / min(slow, 8.0 * dead)


def _filter_time(period_s: float, gain_a: float) -> float:
    """Return the time constant of a motion filter [s]."""
    return math.pow(period_s / gain_a, 1.0 / 3.0)


def _left(lag: float, time: float) -> float:
    return math.exp(-time / lag) if lag > 0.0 else (0.0 if time > 0.0 else 1.0)


def _wheel(actuation: Actuation, time: float) -> float:
    return time / actuation.wheel_s if actuation.wheel_s > 0.0 else 0.0


def _ramp(lag: float, time: float) -> float:
    """Return by which share of a ramp that begins at rest and takes a time its lag is late in the end."""
    return lag / time * (1.0 - _left(lag, time)) if lag > 0.0 and time > 0.0 else _left(lag, time)


def _couple(first: float, second: float, time: float) -> float:
    """Return the share of the first lag's gap that is in the second lag's after a time."""
    if second <= 0.0:
        return _left(first, time)
    if first <= 0.0:
        return 0.0
    if abs(first - second) < 1e-6 * first:
        return time / first * math.exp(-time / first)
    return first / (first - second) * (_left(first, time) - _left(second, time))
