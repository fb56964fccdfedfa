"""Common base of the controllers and the real-time model, whose steps are computed in C.

A stepper is a small frozen object with a configuration and tables. A C structure (``core/kernel/track_*.h``)
is built once from configuration and tables. The state is an object of type bytes. ``StateEstimate`` contains
the values in the state. ``Flag`` contains the faults and events of the last step.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntFlag
from functools import partial
from typing import Self

from mrdamper import core
from mrdamper.control.config import Config
from mrdamper.control.tables.card_tables import DamperTables


class Flag(IntFlag):
    """Faults and events in one step of a controller or of the real-time model, as bits."""

    NO_DISPLACEMENT = 1  # the displacement is NaN or beyond its limit
    FROZEN = 2  # the displacement is constant although the damper moved
    MOTION_UNKNOWN = 4  # the displacement is missing for too long: the fall-back command is used
    NO_TEMPERATURE = 8  # the temperature is NaN or beyond its limits: the last valid value is used
    TEMPERATURE_JUMP = 16  # the temperature changes too fast for a damper: the last valid value is used
    NOMINAL_TEMPERATURE = 32  # the temperature is invalid for too long: the nominal temperature is used
    NO_TARGET = 64  # the target is NaN: zero is used
    NO_FORCE = 128  # the force reading is missing although the controller uses force feedback
    OUTSIDE_MOTION = 256  # displacement or velocity is outside the range of the data
    OUTSIDE_TEMPERATURE = 512  # temperature outside the model's range: its lowest or highest value is used
    INFEASIBLE = 1024  # the damper cannot produce the wanted force at any current
    # The controller's command is at its minimum or maximum, or the real-time model got a current beyond them.
    SATURATED = 4096
    # The real-time model received a current that is NaN or far outside its range. The model uses the last
    # valid current. After some time without a valid current, it uses zero.
    NO_CURRENT = 8192
    FROZEN_TEMPERATURE = 16384  # the temperature is constant although the supplied energy warms the damper
    NO_VELOCITY = 32768  # the velocity is beyond its limit; the model estimates it from the displacement
    INTERNAL_FAULT = 65536  # the state was not finite and was reset


FAULTS = Flag(255) | Flag.NO_CURRENT | Flag.FROZEN_TEMPERATURE | Flag.NO_VELOCITY | Flag.INTERNAL_FAULT
"""Flags of invalid or missing inputs, and of an invalid state."""


@dataclass(frozen=True, slots=True)
class StateEstimate:
    """Estimated state of the damper after a step."""

    displacement: float  # [m]
    velocity: float  # [m/s]
    acceleration: float  # [m/s^2]
    command: float  # last command [A or V]
    applied: float  # command after delay, lags and magnetic hysteresis [A or V]
    temperature: float  # [K]
    # The model force is the sum of the next four values [N], computed for the applied command.
    yield_force: float
    viscous_force: float
    friction_force: float
    other_force: float
    disturbance: float  # filtered (measured - model force) times the sign of the velocity [N]
    flags: Flag

    @property
    def force(self) -> float:
        """Return the force of the model [N]."""
        return self.yield_force + self.viscous_force + self.friction_force + self.other_force


@dataclass(frozen=True, slots=True, eq=False)
class Stepper:
    """Base of controllers and real-time model: their tables and configuration, and one step in C."""

    config: Config
    tables: DamperTables
    single: bool = False  # use single precision, like hardware without double precision
    _native: core.Tracker = field(init=False, repr=False)

    def __post_init__(self) -> None:
        tables = self.tables
        native = core.Tracker(
            self.config,
            bytes(tables.rows),
            tables.currents,
            tables.factor,
            tables.column,
            [each.native for each in tables.lookups],
            single=self.single,
            series=None if tables.series is None else tables.series.native,
        )
        object.__setattr__(self, "_native", native)

    def __reduce__(self) -> tuple[partial[Self], tuple[()]]:
        """Pickle through the constructor because the kernel object cannot be pickled."""
        parts = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        return partial(type(self), **parts), ()

    @property
    def period_s(self) -> float:
        """Return the sampling period [s]."""
        return self.config.axes.period

    @property
    def largest(self) -> float:
        return self.config.axes.largest

    def start(self) -> bytes:
        """Return the state before the first sample, without motion and current."""
        return self._native.start()

    def estimate(self, state: bytes) -> StateEstimate:
        """Return the estimated state of the damper."""
        s, parts = self._native.read(state)
        return StateEstimate(
            s.x, s.v, s.a, s.command, s.applied_current, s.temperature, *parts, s.disturbance, Flag(s.flags)
        )

    def flags(self, state: bytes) -> Flag:
        """Return the flags of the last step."""
        return self.estimate(state).flags
