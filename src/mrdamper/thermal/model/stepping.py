"""Going through time: the steps that all thermal models share, the march through loads, the energy account.

The method is ROS2, the two-stage, L-stable Rosenbrock method of order 2 with gamma = 1 - 1/sqrt(2) (Verwer,
Spee, Blom & Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456-1480; from memory, not re-read). What one step
is on a network or on finite elements is the business of ``transient`` and ``heat_equation``; both carry the
energies of their losses and sources as extra states, the two sources (mechanical power, coil heat) last.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError

__all__ = [
    "FIRST_STEP_S",
    "GAMMA",
    "EnergyAccount",
    "Load",
    "March",
    "Stepper",
    "growing_steps",
    "loads_until",
    "march",
]

GAMMA = 1.0 - 1.0 / math.sqrt(2.0)
"""Of ROS2: the share of the step that its stages are implicit in."""

FIRST_STEP_S = 1.0
"""The fluid's film and the coil settle in seconds."""

_GROWTH = 1.4
_LEAST_S = 1e-9  # a time that is none
_SIZE_S = 1e-7  # to which a step is sized that ends at a temperature


@dataclass(frozen=True, slots=True)
class Load:
    """What heats a damper for a while: mechanical power over the fluid's temperature, and coil heat.

    ``power`` takes temperatures [K] of any shape and returns watts. ``coil_W`` is the coil's heat at 20 degC;
    it grows with its temperature as copper's resistance does.
    """

    duration: float  # [s]
    power: Callable[[FloatArray], FloatArray]
    coil_W: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.duration) and self.duration > 0.0):
            raise InputError(f"load: duration is {self.duration} s; expected a positive, finite number")
        if not (math.isfinite(self.coil_W) and self.coil_W >= 0.0):
            raise InputError(f"load: coil heat is {self.coil_W} W; expected zero or more, finite")

    def power_on(self, grid: FloatArray) -> FloatArray:
        """Return the power [W] at the temperatures of a grid [K], checked."""
        watts = np.asarray(self.power(grid), dtype=np.float64)
        if watts.shape != grid.shape or not np.isfinite(watts).all():
            raise InputError("load: its power is not finite, or not one number per temperature")
        return watts


def loads_until(loads: Sequence[Load], time_s: float) -> list[Load]:
    """Return the loads up to a time, the last one cut; none for no time at all."""
    kept, left = [], time_s
    for load in loads:
        if left <= _LEAST_S:
            break
        kept.append(replace(load, duration=min(load.duration, left)))
        left -= load.duration
    return kept


class Stepper(Protocol):
    """A thermal model under one load at a time."""

    def take(self, load: Load) -> None:
        """Put the sources of a load in."""

    def step(self, state: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
        """Return the state after a step [s], and the energies of losses and sources in it [J]."""

    def flow(self, state: FloatArray) -> FloatArray:
        """Return losses and sources at a state [W]."""

    def fluid(self, state: FloatArray) -> float:
        """Return the fluid's mean temperature at a state [K]."""


class March(NamedTuple):
    """Where a march came by: the ends of its steps."""

    time: FloatArray  # [s], shape (k,)
    state: FloatArray  # shape (k, n)
    flow: FloatArray  # losses, then the two sources [W], shape (k, m + 2)
    energy: FloatArray  # of each since the start [J], shape (k, m + 2)
    stopped: bool  # the fluid reached the temperature at which to stop


def march(
    stepper: Stepper,
    loads: Sequence[Load],
    state: FloatArray,
    *,
    first_step: float = FIRST_STEP_S,
    longest_step: float,
    stop_at: float = math.inf,
) -> March:
    """Take a state through loads, one after the other.

    Parameters
    ----------
    first_step, longest_step : steps grow from the one to the other [s] after each change of load
    stop_at : the fluid's mean temperature at which the march ends [K]
    """
    if not loads:
        raise InputError("heating: there is no load; expected at least one")
    if not (longest_step > 0.0 and first_step > 0.0):
        raise InputError(f"heating: steps are {first_step} and {longest_step} s; expected positive numbers")
    stepper.take(loads[0])
    times, states, flows = [0.0], [state], [stepper.flow(state)]
    energies = [np.zeros_like(flows[0])]
    stopped = stepper.fluid(state) >= stop_at
    for k, load in enumerate(loads):
        if stopped:
            break
        if k > 0:
            stepper.take(load)
        for step in growing_steps(load.duration, min(first_step, longest_step), longest_step):
            size = step
            new, gained = stepper.step(state, size)
            stopped = stepper.fluid(new) >= stop_at
            if stopped:
                size = _size_to(stepper, state, step, stop_at)
                new, gained = stepper.step(state, size)
            state = new
            times.append(times[-1] + size)
            states.append(state)
            flows.append(stepper.flow(state))
            energies.append(energies[-1] + gained)
            if stopped:
                break
    return March(np.array(times), np.array(states), np.array(flows), np.array(energies), stopped)


def growing_steps(duration: float, first: float, longest: float, *, growth: float = _GROWTH) -> list[float]:
    """Return steps that grow from the first to the longest and end with the duration [s]."""
    steps, left, step = [], duration, first
    while step < longest and left > step:
        steps.append(step)
        left -= step
        step = min(step * growth, longest)
    count = max(math.ceil(left / longest - 1e-9), 1)
    return steps + [left / count] * count


def _size_to(stepper: Stepper, state: FloatArray, step: float, stop_at: float) -> float:
    """Return the step, at most the given one, after which the fluid is at the temperature to stop at."""
    from scipy.optimize import brentq

    def below(size: float) -> float:
        return stop_at - stepper.fluid(stepper.step(state, size)[0])

    return float(brentq(below, 0.0, step, xtol=_SIZE_S))


class EnergyAccount(ABC):
    """Energy in, out and stored of a course, and how well they close."""

    __slots__ = ()

    energy: FloatArray  # of losses, then of the two sources, since the start [J], shape (k, m + 2)

    @property
    @abstractmethod
    def stored(self) -> FloatArray:
        """Heat stored since the start [J], shape (k,)."""

    @property
    def energy_in(self) -> FloatArray:
        """Mechanical work and coil heat since the start [J], shape (k,)."""
        return np.asarray(self.energy[:, -2:].sum(axis=1))

    @property
    def energy_out(self) -> FloatArray:
        """Heat given off since the start [J], shape (k,)."""
        return np.asarray(self.energy[:, :-2].sum(axis=1))

    @property
    def closure(self) -> float:
        """Largest miss of the energy account, over the largest energy in it [-]."""
        miss = np.abs(self.energy_in - self.energy_out - self.stored).max()
        size = max(np.abs(part).max() for part in (self.energy_in, self.energy_out, self.stored))
        return float(miss / size) if size > 0.0 else 0.0
