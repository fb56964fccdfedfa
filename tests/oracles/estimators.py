"""Reference in plain Python for the estimators of the controller (``core/kernel/track_estimate.h``).

The motion is estimated from the displacement, and the effective current from the commands. The estimators are
immutable and return a new state. A reading that is not finite does not change the state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrdamper.arrays import FloatArray
from mrdamper.control import tuning
from mrdamper.control.settings import SETTINGS
from mrdamper.models.actuation import HYSTERESIS_WEIGHT, Actuation

__all__ = ["AppliedCurrent", "Motion", "MotionFilter"]


@dataclass(frozen=True, slots=True)
class Motion:
    """Hold displacement [m], velocity [m/s] and acceleration [m/s^2]."""

    displacement: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0

    def after(self, time: float) -> Motion:
        """Return the motion after a time [s] at constant acceleration."""
        x = self.displacement + time * (self.velocity + 0.5 * time * self.acceleration)
        return Motion(x, self.velocity + time * self.acceleration, self.acceleration)


@dataclass(frozen=True, slots=True)
class MotionFilter:
    """Steady-state Kalman filter of a motion with white jerk and one displacement reading per period."""

    period_s: float
    noise_m: float = 10e-6
    jerk_density: float = SETTINGS.jerk_density

    @property
    def gains(self) -> FloatArray:
        """Kalman gains of displacement [-], velocity [1/s] and acceleration [1/s^2], shape (3,)."""
        return tuning.motion_filter(self.period_s, self.noise_m, self.jerk_density)[0]

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the estimation error [m, m/s, m/s^2], shape (3, 3)."""
        return tuning.motion_filter(self.period_s, self.noise_m, self.jerk_density)[1]

    def start(self, displacement: float = 0.0) -> Motion:
        return Motion(displacement)

    def step(self, state: Motion, displacement: float) -> Motion:
        """Return the motion one period later, corrected by a displacement reading [m]."""
        ahead = state.after(self.period_s)
        if not math.isfinite(displacement):
            return ahead
        gap = displacement - ahead.displacement
        x, v, a = (float(gain) * gap for gain in self.gains)
        return Motion(ahead.displacement + x, ahead.velocity + v, ahead.acceleration + a)


@dataclass(frozen=True, slots=True)
class LagState:
    """State of ``AppliedCurrent``: outputs of two lags and of the hysteresis, and delayed commands."""

    first: float
    second: float
    behind: float
    line: tuple[float, ...]  # Delayed commands, the newest first

    @property
    def applied(self) -> float:
        """Current or voltage that determines the force, after lags and hysteresis [A or V]."""
        return self.second + HYSTERESIS_WEIGHT * (self.behind - self.second)


@dataclass(frozen=True, slots=True)
class AppliedCurrent:
    """Effective current after dead time, two lags and hysteresis, for piecewise constant commands."""

    actuation: Actuation
    period_s: float

    def start(self) -> LagState:
        """Return the initial state: the current is zero, also in the past."""
        line = (0.0,) * (tuning.sampled_actuation(self.actuation, self.period_s).dead_samples + 2)
        return LagState(0.0, 0.0, 0.0, line)

    def step(self, state: LagState, command: float) -> LagState:
        """Return the state at the end of a period with this constant command."""
        sampled = tuning.sampled_actuation(self.actuation, self.period_s)
        lags = sampled.lags
        line = (command, *state.line[:-1])
        newer, older = line[sampled.dead_samples], line[sampled.dead_samples + 1]
        given = newer + sampled.dead_part * (older - newer)
        rises = given > state.first
        gap = state.first - given
        couple = lags.rise_couple if rises else lags.fall_couple
        second = given + lags.second * (state.second - given) + couple * gap
        first = given + (lags.rise if rises else lags.fall) * gap
        play = self.actuation.hysteresis_width_A
        # ``behind`` equals a rising current and exceeds a falling current by up to two widths.
        behind = min(max(state.behind, second), second + 2.0 * play)
        return LagState(first, second, behind, line)
