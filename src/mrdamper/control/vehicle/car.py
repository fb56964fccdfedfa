"""A quarter car, and the semi-active force that is asked of its damper.

States z = (x_b - x_w, x_b', x_w - x_r, x_w'): rattle space, body speed, tyre deflection, wheel speed, about
the car at rest; extension of the damper is x_b - x_w, and its force F resists extension:

    m_b x_b'' = -k_s (x_b - x_w) - F
    m_w x_w'' =  k_s (x_b - x_w) + F - k_t (x_w - x_r)

Beyond ``stroke_m`` either way an end stop pushes back with a spring of its own, beside the damper's force.

A demand is a linear feedback F* = gains . z, taken only where the damper can give it (F* v > 0), else zero:
skyhook, groundhook, a mixture of both, or the linear-quadratic regulator of body acceleration, clipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Protocol

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError


class CarDamper(Protocol):
    """A damper that moves on by single steps, since the car's motion depends on its force."""

    @property
    def step_s(self) -> float: ...

    def advance(
        self, displacement: float, velocity: float, current: float, temperature_degC: float, /
    ) -> float:
        """Move on by one step; return the force [N] at its end."""
        ...

    def copy(self) -> CarDamper: ...


def check_positive(record: object, place: str, *, zero: tuple[str, ...] = ()) -> None:
    """Raise ``InputError`` for a number of a dataclass that is not finite and positive, or zero."""
    for each in fields(record):  # type: ignore[arg-type]  # dataclasses only
        value = getattr(record, each.name)
        if not (math.isfinite(value) and (value > 0.0 or (value == 0.0 and each.name in zero))):
            raise InputError(place=place, found=f"{each.name} is {value!r}", expected="a positive number")


@dataclass(frozen=True, slots=True, kw_only=True)
class QuarterCar:
    """Body, wheel, spring and tyre of a quarter of a car; its damper is not a part of it."""

    body_kg: float = 320.0
    wheel_kg: float = 40.0
    spring_N_m: float = 20e3
    tyre_N_m: float = 200e3
    stroke_m: float = 0.08  # to either end stop
    stop_N_m: float = 300e3

    def __post_init__(self) -> None:
        check_positive(self, "quarter car")

    def stop_force(self, rattle: FloatArray) -> FloatArray:
        """Return the end stops' force [N] at rattle spaces [m], of any shape; positive against extension."""
        return np.asarray(self.stop_N_m * (rattle - np.clip(rattle, -self.stroke_m, self.stroke_m)))

    @property
    def system(self) -> FloatArray:
        """A of z' = A z + b F + c x_r', shape (4, 4)."""
        body, wheel = self.body_kg, self.wheel_kg
        spring, tyre = self.spring_N_m, self.tyre_N_m
        return np.array(
            [
                [0.0, 1.0, 0.0, -1.0],
                [-spring / body, 0.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
                [spring / wheel, 0.0, -tyre / wheel, 0.0],
            ]
        )

    @property
    def by_force(self) -> FloatArray:
        """b, shape (4,)."""
        return np.array([0.0, -1.0 / self.body_kg, 0.0, 1.0 / self.wheel_kg])

    @property
    def by_road(self) -> FloatArray:
        """c, shape (4,)."""
        return np.array([0.0, 0.0, -1.0, 0.0])

    def energy(self, states: FloatArray) -> FloatArray:
        """Return what springs and masses hold [J] in states, shape (..., 4)."""
        weights = np.array([self.spring_N_m, self.body_kg, self.tyre_N_m, self.wheel_kg])
        return np.asarray(0.5 * (states**2) @ weights)

    def advance(self, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, b, c of the exact step with force and road speed held over it."""
        from scipy.linalg import expm

        whole = np.zeros((6, 6))
        whole[:4, :4], whole[:4, 4], whole[:4, 5] = self.system, self.by_force, self.by_road
        exact = np.asarray(expm(step_s * whole), dtype=np.float64)
        return exact[:4, :4], exact[:4, 4], exact[:4, 5]


@dataclass(frozen=True, slots=True)
class Demand:
    """A wanted force F* = gains . z [N], where F* v > 0, else zero; v = x_b' - x_w' as it is measured.

    One that goes by the acceleration is wanted only while x_b'' v > 0, too.
    """

    name: str
    gains: tuple[float, float, float, float]  # [N/m, N s/m, N/m, N s/m]
    by_acceleration: bool = False

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, self.gains)):
            raise InputError(
                place=f"demand {self.name!r}", found=f"gains are {self.gains}", expected="four finite numbers"
            )


def skyhook(damping: float = 2500.0) -> Demand:
    """Return the demand of a damper [N s/m] between body and sky."""
    return Demand("skyhook", (0.0, damping, 0.0, 0.0))


def groundhook(damping: float = 2500.0) -> Demand:
    """Return the demand of a damper [N s/m] between wheel and ground."""
    return Demand("groundhook", (0.0, 0.0, 0.0, -damping))


def hybrid(damping: float = 2500.0, share: float = 0.5) -> Demand:
    """Return the mixture of skyhook (``share``) and groundhook (the rest) of a damping [N s/m]."""
    return Demand("hybrid", (0.0, share * damping, 0.0, (share - 1.0) * damping))


def acceleration_driven(damping: float = 2500.0) -> Demand:
    """Return the demand of a damper [N s/m] that is there while it opposes the body's acceleration."""
    return Demand("acceleration-driven", (0.0, damping, 0.0, -damping), by_acceleration=True)


def linear_quadratic(car: QuarterCar, *, rattle: float = 5e2, tyre: float = 1e4) -> Demand:
    """Return the regulator of least mean x_b''^2 + rattle (x_b - x_w)^2 + tyre (x_w - x_r)^2.

    Parameters
    ----------
    rattle, tyre : weights [1/s^4]
    """
    from scipy.linalg import solve_continuous_are

    # x_b'' = row . z + entry F: the cost has cross terms between state and force
    row, entry = car.system[1], float(car.by_force[1])
    weights = np.outer(row, row) + np.diag([rattle, 0.0, tyre, 0.0])
    cross, cost = (row * entry)[:, None], np.array([[entry**2]])
    b = car.by_force[:, None]
    riccati = solve_continuous_are(car.system, b, weights, cost, s=cross)
    gains = -(b.T @ riccati + cross.T)[0] / cost[0, 0]
    first, second, third, fourth = (float(gain) for gain in gains)
    return Demand("linear-quadratic", (first, second, third, fourth))


DEMANDS: Mapping[str, Callable[[QuarterCar, float], Demand]] = MappingProxyType(
    {
        "skyhook": lambda _, damping: skyhook(damping),
        "groundhook": lambda _, damping: groundhook(damping),
        "hybrid": lambda _, damping: hybrid(damping),
        "acceleration-driven": lambda _, damping: acceleration_driven(damping),
        "linear-quadratic": lambda car, _: linear_quadratic(car),
    }
)
"""The demands there are: of a car and a damping [N s/m], which is that of every one but the regulator's."""


def demand_named(name: str, car: QuarterCar, damping_N_s_m: float) -> Demand:
    """Return a demand of ``DEMANDS``.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in DEMANDS:
        raise InputError(found=f"demand is {name!r}", expected=f"one of: {', '.join(DEMANDS)}")
    return DEMANDS[name](car, damping_N_s_m)
