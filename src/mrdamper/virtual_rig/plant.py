"""Simulate a virtual damper, step by step (in closed loops) or for whole runs.

The virtual dampers share no code with the identified laws. They are implemented in C in ``native/``, a
separate extension. The hydraulic damper is described in ``docs/hydraulic_rig.md``. The following equations
describe the lumped damper (``native/plant.c``). The time step is 0.1 ms, and the inputs are the values at
the end of the step:

*Driver and coil.* I is the commanded current and i the coil current. The voltage V = R0 I + Kp (I - i) + q is
limited to +-Vmax. The integral q' = Ki (I - i) stops while the voltage is limited. With
R = R0 (1 + 0.00393 (T - 20 degC)) and L = L0 / (1 + 0.25 i^2), i relaxes to V / R at the rate R / L.

*Field.* Because of eddy currents, i1 lags behind i (more if i decreases). The fluid structure i2 lags behind
i1. A play operator of half width r, applied to i2, gives ip and describes the magnetic hysteresis. The
effective current is m = |(1 - wp) i2 + wp ip|, and g(m) is the dependence of the force on m.

*Force.* The oil compliance is modelled as a leak c1 in series with the yield and viscous elements. The speed
of these elements is w = v - (yield + viscous) / c1, with the forces of the previous step. The yield force has
three bristles that relax towards sgn(w) Fy. The viscous force is a power of |w|. Friction is a bristle with
Stribeck effect, also driven by w. The total is F = yield + viscous + friction + k1 x + f0.

Each relaxation is solved exactly over a step for constant inputs. Every closed cycle dissipates energy. Sign
convention: extension is positive, and a force that resists extension is positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.virtual_rig import _plant
from mrdamper.virtual_rig.damper import PRESETS, VirtualDamper, find_preset

__all__ = [
    "PRESETS",
    "SOLVER_STEP_S",
    "STEP_S",
    "Plant",
    "PlantResponse",
    "VirtualDamper",
    "find_preset",
    "simulate",
]

STEP_S = 1e-4
"""Time step of the plant [s]."""

SOLVER_STEP_S = 2e-5
"""Internal time step for the equations of the hydraulic damper, a part of the time step of the plant [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class PlantResponse:
    """Response of the damper in a run, one sample per time step, shape (n,)."""

    force: FloatArray  # force of the damper [N]
    coil_current: FloatArray  # current in the coil [A]
    field: FloatArray  # effective current m [A] (lumped damper), or flux density [T] (hydraulic damper)


class Plant:
    """A virtual damper with an internal state, for closed loops. The initial force and current are zero.

    The lumped damper makes its first step at the first sample. The hydraulic damper is in equilibrium at the
    first sample and makes its first step at the second sample. Methods change the state of the object. To
    simulate several continuations from one state, use ``copy``, or store and restore ``state``.

    Parameters
    ----------
    damper : parameters of the damper
    step_s : time step [s]
    solver_step_s : maximum internal step of the solver for the hydraulic equations [s]

    Raises
    ------
    InputError
        If a time step is outside its range. Methods raise InputError for samples outside the range of the
        damper.
    """

    __slots__ = ("_native", "damper", "step_s")

    def __init__(
        self, damper: VirtualDamper, *, step_s: float = STEP_S, solver_step_s: float = SOLVER_STEP_S
    ) -> None:
        if not 0.0 < step_s <= 1e-3:
            raise InputError(
                found=f"plant: step is {step_s} s", expected="above 0, at most 1e-3 (the coil's lag)"
            )
        if not 1e-7 <= solver_step_s <= 1e-3:
            raise InputError(
                found=f"plant: solver step is {solver_step_s} s", expected="1e-7 to 1e-3 (2e-5 is usual)"
            )
        self.damper = damper
        self.step_s = step_s
        names = _plant.PARAMETERS[damper.kind]
        numbers = np.array([getattr(damper, name) for name in names], dtype=np.float64)
        inner = int(np.ceil(step_s / solver_step_s - 1e-9))
        self._native = _plant.Plant(damper.kind, numbers, step_s, inner)

    @property
    def state(self) -> tuple[float, ...]:
        """Internal state of the damper, which can be stored and assigned again."""
        return self._native.state

    @state.setter
    def state(self, given: tuple[float, ...]) -> None:
        self._native.state = given

    @property
    def coil_current(self) -> float:
        """Current in the coil [A]."""
        return self._native.state[0]

    def copy(self) -> Plant:
        """Return an independent copy of the damper in the same state."""
        other = Plant.__new__(Plant)
        other.damper, other.step_s = self.damper, self.step_s
        other._native = self._native.copy()  # noqa: SLF001 - its own class
        return other

    def hold(self, temperature_degC: float, count: int) -> object:
        """Return a capsule with ``count`` (max 64) copies of the damper for closed loops in C.

        All copies have the constant temperature ``temperature_degC``.
        """
        return self._native.hold(temperature_degC + ZERO_CELSIUS_K, count)

    def advance(self, displacement: float, velocity: float, current: float, temperature_degC: float) -> float:
        """Advance by one time step; return the force [N]. Inputs and force apply at the end of the step."""
        try:
            return self._native.advance(displacement, velocity, current, temperature_degC + ZERO_CELSIUS_K)
        except ValueError as error:
            raise InputError(f"{error}", place="plant") from error

    def advance_many(
        self,
        displacement: ArrayLike,
        velocity: ArrayLike,
        current: ArrayLike,
        temperature_degC: ArrayLike,
    ) -> FloatArray:
        """Advance by one time step per sample; return the force [N] at the end of each step, shape (n,).

        The result is bit-identical to calling ``advance`` for each sample. ``current`` and
        ``temperature_degC`` can be constant numbers. If a sample is invalid, the state does not change.
        """
        force: FloatArray = self._run(displacement, velocity, current, temperature_degC, whole=False)[0]
        return force

    def respond(
        self,
        displacement: ArrayLike,
        velocity: ArrayLike,
        current: ArrayLike,
        temperature_degC: ArrayLike,
    ) -> PlantResponse:
        """Advance by one time step per sample; return force, coil current and effective field."""
        force, coil, field = self._run(displacement, velocity, current, temperature_degC, whole=True)
        return PlantResponse(force, coil, field)

    def _run(
        self,
        displacement: ArrayLike,
        velocity: ArrayLike,
        current: ArrayLike,
        temperature_degC: ArrayLike,
        *,
        whole: bool,
    ) -> FloatArray:
        """Advance by one step per sample; return the force, shape (1, n).

        With ``whole``, return force, coil current and effective field, shape (3, n).
        """
        x = np.ascontiguousarray(displacement, dtype=np.float64)
        v = np.ascontiguousarray(velocity, dtype=np.float64)
        out = np.empty((3 if whole else 1, x.size))
        rows = (out[0], out[1], out[2]) if whole else (out[0], None, None)
        try:
            self._native.run(
                x, v, _input_samples(current), _input_samples(temperature_degC, ZERO_CELSIUS_K), *rows
            )
        except ValueError as error:
            raise InputError(f"{error}", place="plant") from error
        return out


def _input_samples(given: float | ArrayLike, above: float = 0.0) -> float | FloatArray:
    """Return a number or an array of samples, increased by the offset ``above``."""
    if isinstance(given, float):
        return float(given) + above
    values: FloatArray = np.ascontiguousarray(given, dtype=np.float64)
    return values + above if above else values


def simulate(
    damper: VirtualDamper,
    displacement: ArrayLike,
    velocity: ArrayLike,
    current: ArrayLike,
    temperature_degC: ArrayLike,
    *,
    step_s: float = STEP_S,
    solver_step_s: float = SOLVER_STEP_S,
) -> PlantResponse:
    """Return the response of a damper in a run that starts with zero force and zero current.

    The global interpreter lock (GIL) is released during the simulation.

    Parameters
    ----------
    displacement : displacement [m], extension positive, shape (n,), one sample per ``step_s``
    velocity : rate of the displacement [m/s], shape (n,)
    current : current command [A], a number or shape (n,)
    temperature_degC : temperature of fluid and coil [degC], a number or shape (n,)

    Raises
    ------
    InputError
        If a sample is not finite or outside the range of all dampers, or if shapes differ.
    """
    plant = Plant(damper, step_s=step_s, solver_step_s=solver_step_s)
    return plant.respond(displacement, velocity, current, temperature_degC)
