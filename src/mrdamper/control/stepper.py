"""A step in C behind Python: the part that controllers and the real-time model share.

A stepper is a small frozen value of a configuration and tables, from which the kernel's part is built once
(``core/kernel/track_*.c``). Its state is bytes; what the bytes hold to be true is a ``Prior``, and what a
step had to say about its readings are its flags.
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
    """What a step had to say about its readings and its answer; ``FAULTS`` are those of readings."""

    NO_DISPLACEMENT = 1  # not a number, or far outside
    FROZEN = 2  # the displacement stands still though the damper moved
    MOTION_UNKNOWN = 4  # for too long: the command is the fall-back
    NO_TEMPERATURE = 8  # not a number, or beyond its limits: the last good one is used
    TEMPERATURE_JUMP = 16  # faster than a damper can warm: the same
    NOMINAL_TEMPERATURE = 32  # for too long: the nominal one is used
    NO_TARGET = 64  # not a number: zero is taken
    NO_FORCE = 128  # no reading where the controller feeds force back
    OUTSIDE_MOTION = 256  # outside the data's displacement or velocity
    OUTSIDE_TEMPERATURE = 512  # outside the model's: its edge is held
    INFEASIBLE = 1024  # no current gives the wanted force
    CLAMPED = 2048  # the reversal clamp holds
    SATURATED = 4096  # the command is at one of its ends, or a model's current beyond them
    NO_CURRENT = 8192  # a model's: not a number, or far outside; the last good one is used, then none
    FROZEN_TEMPERATURE = 16384  # it stands still though the damper warms: carried on by the energy put in
    NO_VELOCITY = 32768  # a model's: beyond what can be; estimated from the displacement instead
    INTERNAL_FAULT = 65536  # the state held what cannot be: it begins anew with this step's readings
    WRONG_TEMPERATURE = 131072  # the thermometer is far from the coil, whose temperature is used


FAULTS = (
    Flag(127) | Flag.NO_CURRENT | Flag.FROZEN_TEMPERATURE | Flag.NO_VELOCITY | Flag.INTERNAL_FAULT
    | Flag.WRONG_TEMPERATURE
)  # fmt: skip
"""The flags that say that a reading was not believed."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What a controller holds to be true after a step."""

    displacement: float  # [m]
    velocity: float  # [m/s]
    acceleration: float  # [m/s^2]
    command: float  # the last one given [A or V]
    applied: float  # what the force feels of the commands [A or V]
    temperature: float  # [K]
    yield_force: float  # parts of the model's force at the applied command [N]
    viscous_force: float
    friction_force: float
    other_force: float
    gains: tuple[float, float, float]  # learnt, of the first three parts
    disturbance: float  # observed, in the direction of motion [N]
    flags: Flag

    @property
    def force(self) -> float:
        """The model's force [N]."""
        return self.yield_force + self.viscous_force + self.friction_force + self.other_force


@dataclass(frozen=True, slots=True, eq=False)
class Stepper:
    """Configuration and tables in the kernel's form; those who inherit say what a step takes and gives."""

    config: Config
    tables: DamperTables
    single: bool = False  # the arithmetic, tables and state of a target without double precision
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
        """Pickle through the constructor: the kernel's part cannot be pickled."""
        parts = {each.name: getattr(self, each.name) for each in fields(self) if each.init}
        return partial(type(self), **parts), ()

    @property
    def period_s(self) -> float:
        """Sampling period [s]."""
        return self.config.axes.period

    @property
    def largest(self) -> float:
        """Largest command, or current of the tables [A or V]."""
        return self.config.axes.largest

    def start(self) -> bytes:
        """Return the state before the first sample: no motion, no current."""
        return self._native.start()

    def believes(self, state: bytes) -> Prior:
        """Return what is held to be true in a state."""
        read = self._native.read(state)
        return Prior(
            *read["motion"],
            read["command"],
            read["applied"],
            read["temperature"],
            *read["parts"],
            read["gains"],
            read["disturbance"],
            Flag(read["flags"]),
        )

    def flags(self, state: bytes) -> Flag:
        """Return the flags of the last step."""
        return self.believes(state).flags
