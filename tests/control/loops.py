"""Ideal plants and simple controllers with a known response, for tests of the control loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.protocol import Measurement, Reference


class Ideal:
    """An ideal damper without memory or lag: F = (low + gain I) sign(v) + viscosity v."""

    def __init__(self, *, low=50.0, gain=800.0, viscosity=0.0, step_s=1e-4):
        self.low, self.gain, self.viscosity, self.step_s = low, gain, viscosity, step_s

    def advance_many(
        self,
        displacement: FloatArray,
        velocity: FloatArray,
        current: float | FloatArray,
        temperature_degC: float,
    ) -> FloatArray:
        return np.asarray((self.low + self.gain * current) * np.sign(velocity) + self.viscosity * velocity)

    def copy(self) -> Ideal:
        return self

    def advance(self, displacement: float, velocity: float, current: float, temperature_degC: float) -> float:
        side = math.copysign(1.0, velocity) if velocity else 0.0
        return float((self.low + self.gain * current) * side + self.viscosity * velocity)


class Lagging(Ideal):
    """An ``Ideal`` damper whose current has a first-order lag. Its state is the lagged current."""

    def __init__(self, lag_s=0.01, **changed):
        super().__init__(**changed)
        self.lag_s, self.applied = lag_s, 0.0

    def advance_many(self, displacement, velocity, current, temperature_degC):
        keep = np.exp(-self.step_s / self.lag_s)
        felt = []
        for level in np.broadcast_to(current, velocity.shape).tolist():
            self.applied = level + (self.applied - level) * keep
            felt.append(self.applied)
        return super().advance_many(displacement, velocity, np.array(felt), temperature_degC)

    def copy(self):
        other = Lagging(
            self.lag_s, low=self.low, gain=self.gain, viscosity=self.viscosity, step_s=self.step_s
        )
        other.applied = self.applied
        return other


@dataclass(frozen=True)
class Constant:
    """A controller that always returns the same current."""

    current: float = 1.0
    name: str = "constant"
    period_s: float = 1e-3
    preview_s: float = 0.0
    needs_force: bool = False

    def start(self) -> Any:
        return None

    def step(self, state: Any, wanted: Reference, seen: Measurement) -> tuple[Any, float]:
        return state, self.current


@dataclass(frozen=True)
class OnOff(Constant):
    """Return 2 A if the force has the sign of the target and is smaller than the target, otherwise 0 A."""

    name: str = "on-off"
    needs_force: bool = True

    def step(self, state, wanted, seen):
        short = wanted.now * (wanted.now - seen.force) > 0.0 and wanted.now * seen.force >= 0.0
        return state, 2.0 if short else 0.0


@dataclass(frozen=True)
class Inverse(Constant):
    """The exact inverse of ``Ideal``: I = (|F*| - low) / gain for the target F*, previewed if possible."""

    name: str = "inverse"
    low: float = 50.0
    gain: float = 800.0

    def step(self, state, wanted, seen):
        force = wanted.now if wanted.ahead is None else wanted.ahead
        return state, (abs(force) - self.low) / self.gain


@dataclass(frozen=True)
class Recording(Constant):
    """A controller that returns a current ramp and records its inputs (target and readings) in ``LAST``."""

    name: str = "recording"
    needs_force: bool = True
    slope: float = 0.5  # [A/s]

    def start(self) -> Any:
        return ()

    def step(self, state, wanted, seen):
        LAST[:] = [*state, (wanted, seen)]
        return (*state, (wanted, seen)), self.slope * self.period_s * len(state)


LAST: list[tuple[Reference, Measurement]] = []
"""Inputs of the last ``Recording``: a pair of target and readings per sample."""


def quiet(scenario, **changed):
    """Return a scenario whose sensors have no noise."""
    still = replace(
        scenario.sensors, displacement_noise_m=0.0, force_noise_N=0.0, temperature_noise_K=0.0, **changed
    )
    return replace(scenario, sensors=still)
