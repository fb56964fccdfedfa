"""Interfaces of controllers and plants.

A controller is a small frozen value; its memory is a state that each step returns. One step per sample maps
the wanted force and the readings of the sensors to a current. Extension is positive, a
force that resists extension is positive.
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
"""Sampling of a controller."""


@dataclass(frozen=True, slots=True)
class Reference:
    """The wanted force [N] at this sample, and at the time ``preview_s`` of the controller after it.

    If the future target is unknown, ``ahead`` is None and the controller extrapolates.
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
        """Return the preview of the target [s]; 0: none."""
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
    """A simulated damper with its own time step, which is shorter than the sample of the controller."""

    @property
    def step_s(self) -> float: ...

    def advance_many(
        self,
        displacement: FloatArray,
        velocity: FloatArray,
        current: float | FloatArray,
        temperature_degC: float,
    ) -> FloatArray:
        """Advance one time step per array element; return the forces [N]. The current may be constant."""
        ...

    def copy(self) -> Plant:
        """Return an independent damper in the same state."""
        ...


@runtime_checkable
class CompiledPlant(Plant, Protocol):
    """A damper that the closed loop in C can step."""

    def hold(self, temperature_degC: float, count: int) -> object:
        """Return up to 64 copies at one temperature in a capsule (``core/binding/loop_plant.h``)."""
        ...


class LoopSettings(NamedTuple):
    """Settings of a closed loop in C."""

    every: int  # plant steps per sample
    late: int  # delay of a command: number of whole samples
    apart: int  # delay of a command: number of additional plant steps
    reads_force: bool
    force_gain: float
    force_offset_N: float
    highest_A: float
    command_step_A: float  # step of the driver's converter; 0: none
    force_step_N: float  # step of the force sensor's converter; 0: none


@runtime_checkable
class CompiledController(Controller, Protocol):
    """A controller that can run in the closed loop in C."""

    @property
    def compiled(self) -> Tracker | None:
        """Return the controller in C; None if its step is in Python."""
        ...
