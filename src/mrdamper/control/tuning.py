"""Rules that compute controller parameters from lags, sampling period and sensor noise.

The names in double quotes are constants in the module ``settings``. They are the same for all dampers.

*Motion filter.* A steady-state Kalman filter estimates position, velocity and acceleration from the
displacement. Its motion model has white-noise jerk. A jerk density of 1 m/s^3 per root Hz gives a velocity
noise of 0.9 mm/s for a sensor with 10 um noise at 1 kHz.

*Prediction horizon.* The motion is assumed to be harmonic, so the jerk density of the filter is multiplied by
``harmonic_jerk_ratio``. The horizon begins at the end of the dead time and has ``horizon_steps`` time steps.
It ends when the lags have completed ``horizon_ratio`` of their response to a sudden change of the command. No
time step is shorter than ``step_ratio_min`` times the time constant of the motion filter. A one-quadrant
driver cannot force the current down. With such a driver, the horizon lasts at least until the current has
completed ``freewheel_ratio`` of its fall from the largest command to zero. The time steps from the fourth on
are then ``freewheel_stretch`` times as long. The dead time is rounded up to a whole number of periods, or
rounded down if rounding up would add more than ``late_ratio_max`` time steps.

*Prediction cost.* The squared force errors in the horizon are minimised. The weight decreases from each time
step to the next by the factor ``horizon_fade``. A change of the command (*move*) costs ``move_cost_ratio``
times the force change that it causes. It also costs ``move_cost_error_ratio`` times the force error in the
model card, because an inaccurate model makes the command swing between its limits. The cost is at most
``move_cost_ratio_max`` times the force change. For the hysteresis laws ``chain`` and ``series-valve``, it is
at most ``implicit_move_cost_ratio_max`` times the force change. After a reversal, ``recommended`` assumes
that ``settled_ratio`` of the remaining build-up of the hysteresis is complete. ``predictive`` uses the
hysteresis of the model unchanged. For ``chain`` and ``series-valve``, one prediction is computed in up to
``spread_sample_count_max`` periods. The time steps during the dead time are then ``dead_time_stride`` times
as long as the time steps of the horizon.

*Feedback.* Proportional and integral gain follow from Skogestad's (SIMC) rule. The first lag of the actuation
is the time constant of the process. The dead time, the second lag and the sampling period together are the
dead time of the process. The time constant of the closed loop equals this dead time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control import config
from mrdamper.control.protocol import SLOWEST_HZ
from mrdamper.control.settings import SETTINGS
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper

_CLOSE_STEPS = 3  # number of time steps at the beginning of the horizon that are never stretched
_DELAY_LINE = 128  # number of past commands that the kernel stores; equals MRD_TRACK_DELAY_LINE


def actuation_of(damper: Damper) -> Actuation:
    """Return the delay and lags of a damper, also if it has only a command lag."""
    if damper.actuation is not None:
        return damper.actuation
    return Actuation(damper.command_lag_s, damper.command_lag_s)


def sampled_actuation(actuation: Actuation, period_s: float) -> config.Actuation:
    """Return the discrete-time model of delay and lags of the force for a sampling period [s].

    The response is exact if the command is constant during each period.
    """
    samples, part = divmod(actuation.delay_s / period_s, 1.0)
    return config.Actuation(
        dead_samples=int(samples),
        dead_part=part,
        lags=_lags(actuation, period_s),
        inverse_saturation_flux=1.0 / actuation.saturation if actuation.saturation > 0.0 else 0.0,
        hysteresis_width=actuation.hysteresis_width_A,
        hysteresis_weight=actuation.hysteresis_weights[0],
        wide_hysteresis_width=actuation.wide_hysteresis_width_A,
        wide_hysteresis_weight=actuation.hysteresis_weights[1],
    )


def check_sampling(actuation: Actuation, period_s: float) -> None:
    """Raise ``InputError`` if the sampling is too slow for the lag of the force."""
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
    """Raise ``InputError`` if the kernel cannot store all commands of the dead time."""
    samples = actuation.delay_s // period_s
    if samples > _DELAY_LINE - 3:
        raise InputError(
            place="real-time model",
            found=f"the dead time of {1e3 * actuation.delay_s:g} ms is {samples:.0f} periods",
            expected=f"at most {_DELAY_LINE - 3}",
            remedy="Sample more slowly",
        )


def motion_filter(period_s: float, noise: float, density: float) -> tuple[FloatArray, FloatArray]:
    """Return gains and covariance of the steady-state Kalman filter of a signal and its two derivatives.

    The signal is sampled once a period with white ``noise`` (RMS). The third derivative of the signal is
    white noise with a ``density`` (per root Hz). The three gains have the units [-], [1/s] and [1/s^2]. The
    covariance of the estimate after a reading has shape (3, 3).
    """
    from scipy.linalg import solve_discrete_are  # SciPy takes a quarter of a second to load.

    if not (noise > 0.0 and density > 0.0):
        raise InputError(
            place="motion filter",
            found=f"noise {noise} and density {density}",
            expected="two positive numbers",
        )
    # The equation depends on only one number, ``power``, if period and noise are the units.
    power = (density / noise) ** 2 * period_s**5
    step = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    drive = power * np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    p = solve_discrete_are(step.T, np.eye(3, 1), drive, np.eye(1))  # error covariance before a reading
    gains = p[:, 0] / (p[0, 0] + 1.0)
    left = p - np.outer(gains, p[0])
    unit = noise / period_s ** np.arange(3)
    return gains / period_s ** np.arange(3), left * np.outer(unit, unit)


def motion_of(
    period_s: float, held_s: float, noise: float, density: float, *, is_harmonic: bool
) -> config.MotionFilter:
    """Return the motion filter for a displacement with new readings every ``held_s`` [s].

    If ``is_harmonic`` is True, the motion between readings is assumed to be harmonic, else the acceleration
    is constant.
    """
    gains, spread = motion_filter(
        held_s, noise, density * (SETTINGS.harmonic_jerk_ratio if is_harmonic else 1.0)
    )
    filter_s = _filter_time(held_s, float(gains[2]))
    return config.MotionFilter(
        gain_x=float(gains[0]),
        gain_v=float(gains[1]),
        gain_a=float(gains[2]),
        holds_readings=held_s > 1.5 * period_s,
        frequency_filter_gain=1.0 - math.exp(-period_s / SETTINGS.frequency_filter_s) if is_harmonic else 0.0,
        settle_samples=math.ceil(SETTINGS.settling_ratio * filter_s / period_s),
        omega_squared_max=(SETTINGS.inverse_frequency_ratio_min * filter_s) ** -2.0,
        velocity_noise_variance=float(spread[1, 1]),
        acceleration_noise_variance=float(spread[2, 2]),
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
    """Return prediction horizon and cost of a model-predictive controller.

    Parameters
    ----------
    motion : motion filter; no time step is shorter than a quarter of its time constant
    force_per_command : increase of the force with the command in a fast motion [N/A]
    error_per_command : force error in the model card, divided by the largest command [N/A]
    spread : True: compute one prediction in several periods, because the hysteresis law needs a long
        computing time
    """
    lags = replace(actuation, delay_s=0.0)
    risen, stretch = lags.response_time(SETTINGS.horizon_ratio), 1
    if actuation.freewheel_time_s > 0.0:
        fallen = lags.response_time(SETTINGS.freewheel_ratio, actuation.largest_command or 1.0, 0.0)
        risen, stretch = max(risen, fallen), SETTINGS.freewheel_stretch
    parts = _parts(SETTINGS.horizon_steps, stretch)
    # Time constant of the motion filter [s], from its frequency limit
    known = 1.0 / (SETTINGS.inverse_frequency_ratio_min * math.sqrt(motion.omega_squared_max))
    step = max(risen / parts, SETTINGS.step_ratio_min * known, period_s)
    dead = math.ceil(actuation.delay_s / period_s - 1e-9) * period_s
    if dead - actuation.delay_s > SETTINGS.late_ratio_max * step:
        dead -= period_s
    longest = (_DELAY_LINE - 3 - SETTINGS.spread_sample_count_max) * period_s - dead
    step = min(step, longest / parts)
    samples = min(SETTINGS.spread_sample_count_max, max(1, round(step / period_s))) if spread else 1
    return config.Prediction(
        steps=SETTINGS.horizon_steps,
        samples=samples,
        together=max(1, round((SETTINGS.dead_time_stride if spread else 1.0) * step / period_s)),
        step=step,
        stretch=stretch,
        dead=dead + (samples - 1) * period_s,
        fade=SETTINGS.horizon_fade,
        settled=SETTINGS.settled_ratio,
        calm=min(
            SETTINGS.move_cost_ratio * abs(force_per_command)
            + SETTINGS.move_cost_error_ratio * error_per_command,
            (SETTINGS.implicit_move_cost_ratio_max if spread else SETTINGS.move_cost_ratio_max)
            * abs(force_per_command),
        ),
        lags=_lags(actuation, step),
    )


def horizon_end(prediction: config.Prediction) -> float:
    """Return the time from now to the last time of the prediction horizon [s]."""
    return prediction.dead + _parts(prediction.steps, prediction.stretch) * prediction.step


def _parts(steps: int, stretch: int) -> int:
    """Return the length of the horizon, divided by the length of its first time step."""
    return steps + max(steps - _CLOSE_STEPS, 0) * (stretch - 1)


def feedback_gains(actuation: Actuation, period_s: float, force_per_command: float) -> tuple[float, float]:
    """Return proportional gain [A/N] and integral gain [A/(N s)] of a force feedback."""
    slow = max(actuation.rise_s, actuation.fall_s, period_s)
    dead = actuation.delay_s + actuation.second_s + period_s
    gain = slow / (force_per_command * 2.0 * dead)
    return gain, gain / min(slow, 8.0 * dead)


def _filter_time(period_s: float, gain_a: float) -> float:
    return math.pow(period_s / gain_a, 1.0 / 3.0)


def _lags(actuation: Actuation, time: float) -> config.Lags:
    """Return both lags for a time interval [s], with the effect of the first lag on the second lag."""
    rise, fall, second = actuation.rise_s, actuation.fall_s, actuation.second_s
    return config.Lags(
        rise=_remaining(rise, time),
        fall=_remaining(fall, time),
        second=_remaining(second, time),
        rise_couple=_couple(rise, second, time),
        fall_couple=_couple(fall, second, time),
        second_ramp=_ramp(second, time),
        freewheel_ratio=time / actuation.freewheel_time_s if actuation.freewheel_time_s > 0.0 else 0.0,
    )


def _remaining(lag: float, time: float) -> float:
    return math.exp(-time / lag) if lag > 0.0 else (0.0 if time > 0.0 else 1.0)


def _ramp(lag: float, time: float) -> float:
    """Return (input - output) / input change of a lag after an input ramp from rest."""
    return lag / time * (1.0 - _remaining(lag, time)) if lag > 0.0 and time > 0.0 else _remaining(lag, time)


def _couple(first: float, second: float, time: float) -> float:
    """Return the part of the first lag's gap that has become a gap of the second lag.

    A gap is the input of the first lag minus the output of a lag.
    """
    if second <= 0.0:
        return _remaining(first, time)
    if first <= 0.0:
        return 0.0
    if abs(first - second) < 1e-6 * first:
        return time / first * math.exp(-time / first)
    return first / (first - second) * (_remaining(first, time) - _remaining(second, time))
