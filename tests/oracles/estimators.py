"""Estimators of the controller's step (``core/kernel/track_estimate.h``) in plain Python, as a reference.

Motion from displacement alone, and the current that the force feels from the commands. Frozen values that
return their state. A reading that is not finite leaves the state unchanged.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrdamper.arrays import FloatArray
from mrdamper.control import tuning
from mrdamper.models.actuation import HYSTERESIS_WEIGHT, Actuation

__all__ = ["AppliedCurrent", "Motion", "MotionFilter"]


@dataclass(frozen=True, slots=True)
class Motion:
    """Displacement [m], velocity [m/s], acceleration [m/s^2]."""

    displacement: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0

    def after(self, time: float) -> Motion:
        """Return the motion a time [s] later, the acceleration held."""
        x = self.displacement + time * (self.velocity + 0.5 * time * self.acceleration)
        return Motion(x, self.velocity + time * self.acceleration, self.acceleration)


@dataclass(frozen=True, slots=True)
class MotionFilter:
    """The steady Kalman filter of a motion whose jerk is white; it sees displacement once a period."""

    period_s: float
    noise_m: float = 10e-6
    jerk_density: float = tuning.JERK_DENSITY

    @property
    def gains(self) -> FloatArray:
        """What position [-], velocity [1/s] and acceleration [1/s^2] take of an innovation, shape (3,)."""
        return tuning.motion_filter(self.period_s, self.noise_m, self.jerk_density)[0]

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the estimate's error [m, m/s, m/s^2], shape (3, 3)."""
        return tuning.motion_filter(self.period_s, self.noise_m, self.jerk_density)[1]

    def start(self, displacement: float = 0.0) -> Motion:
        return Motion(displacement)

    def step(self, state: Motion, displacement: float) -> Motion:
        """Return the motion one period on."""
        ahead = state.after(self.period_s)
        if not math.isfinite(displacement):
            return ahead
        gap = displacement - ahead.displacement
        x, v, a = (float(gain) * gap for gain in self.gains)
        return Motion(ahead.displacement + x, ahead.velocity + v, ahead.acceleration + a)


@dataclass(frozen=True, slots=True)
class Underway:
    """State of ``AppliedCurrent``: both lags, the play's output, and the commands still to arrive."""

    first: float
    second: float
    behind: float
    line: tuple[float, ...]  # newest first

    @property
    def applied(self) -> float:
        """Effective command [A or V]."""
        return self.second + HYSTERESIS_WEIGHT * (self.behind - self.second)


@dataclass(frozen=True, slots=True)
class AppliedCurrent:
    """Effective current of the commands: dead time, two lags, hysteresis; exact for held commands."""

    actuation: Actuation
    period_s: float

    def start(self) -> Underway:
        """Return the state without current, now or before."""
        line = (0.0,) * (tuning.sampled_actuation(self.actuation, self.period_s).dead_samples + 2)
        return Underway(0.0, 0.0, 0.0, line)

    def step(self, state: Underway, command: float) -> Underway:
        """Return the state at the end of a period through which the command was given."""
        lags = tuning.sampled_actuation(self.actuation, self.period_s)
        line = (command, *state.line[:-1])
        newer, older = line[lags.dead_samples], line[lags.dead_samples + 1]
        given = newer + lags.dead_part * (older - newer)
        rises = given > state.first
        gap = state.first - given
        couple = lags.rise_couple if rises else lags.fall_couple
        second = given + lags.second * (state.second - given) + couple * gap
        first = given + (lags.rise if rises else lags.fall) * gap
        play = self.actuation.hysteresis_width_A
        # ``behind`` is the play's output plus its half width: the command itself while it rises
        behind = min(max(state.behind, second), second + 2.0 * play)
        return Underway(first, second, behind, line)
