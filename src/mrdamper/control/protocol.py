"""Interfaces of controllers and plants.

A controller is a small frozen object. At each sample, its step computes the current from the state, the
wanted force and the sensor readings, and also returns the next state. Extension is positive, and a force that
resists extension is positive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from mrdamper.arrays import FloatArray
from mrdamper.core import Tracker

__all__ = [
    "FASTEST_HZ",
    "SLOWEST_HZ",
    "CompiledController",
    "CompiledPlant",
    "Controller",
    "LoopSettings",
    "Measurement",
    "Plant",
    "Reference",
]

SLOWEST_HZ, FASTEST_HZ = 100.0, 5000.0
"""Min and max sampling rate of a controller [Hz]."""


@dataclass(frozen=True, slots=True)
class Reference:
    """The wanted force [N]: ``now`` at this sample, ``ahead`` after the controller's ``preview_s``.

    If the future target is unknown, ``ahead`` is None and the controller extrapolates the target.
    """

    now: float
    ahead: float | None = None


@dataclass(frozen=True, slots=True)
class Measurement:
    """Readings of the sensors at this sample; NaN if a sensor has failed."""

    displacement: float  # [m]
    temperature: float  # [K]
    force: float | None = None  # [N], if there is a force sensor


class Controller(Protocol):
    """A force-tracking controller."""

    @property
    def name(self) -> str: ...
    @property
    def period_s(self) -> float:
        """Return the sampling period of the controller [s]."""
        ...

    @property
    def preview_s(self) -> float:
        """Return the preview time of the target [s]; 0 if the controller needs only the present target."""
        ...

    @property
    def needs_force(self) -> bool:
        """Return True if the controller reads a force sensor."""
        ...

    def start(self) -> Any:  # noqa: ANN401 - each controller's own state
        """Return the state before the first sample."""
        ...

    def step(
        self,
        state: Any,  # noqa: ANN401
        reference: Reference,
        measurement: Measurement,
    ) -> tuple[Any, float]:
        """Return the next state and the commanded current [A]."""
        ...


class Plant(Protocol):
    """A simulated damper. Its time step is shorter than the sampling period of the controller."""

    @property
    def step_s(self) -> float: ...

    def advance_many(
        self,
        displacement: FloatArray,
        velocity: FloatArray,
        current: float | FloatArray,
        temperature_degC: float,
    ) -> FloatArray:
        """Advance one time step per array element; return the force [N] after each step.

        A scalar ``current`` is constant for all time steps.
        """
        ...

    def copy(self) -> Plant:
        """Return an independent damper in the same state."""
        ...


@runtime_checkable
class CompiledPlant(Plant, Protocol):
    """A simulated damper that C code can advance in a closed loop."""

    def hold(self, temperature_degC: float, count: int) -> object:
        """Return ``count`` copies (at most 64) of the damper for loops in C.

        The result is a Python capsule with a pointer to the struct in ``core/binding/loop_plant.h``.
        """
        ...


class LoopSettings(NamedTuple):
    """Settings of a closed loop that C code computes."""

    every: int  # time steps of the damper model per controller sample
    late: int  # delay of a command: number of whole controller samples
    apart: int  # additional delay of a command: number of time steps of the damper model
    reads_force: bool
    force_gain: float
    force_offset_N: float
    highest_A: float
    command_step_A: float  # resolution of the current driver; 0: no rounding
    force_step_N: float  # resolution of the force sensor; 0: no rounding


@runtime_checkable
class CompiledController(Controller, Protocol):
    """A controller that C code can run in a closed loop."""

    @property
    def compiled(self) -> Tracker | None:
        """Return the controller in C; None if its step is written in Python."""
        ...
