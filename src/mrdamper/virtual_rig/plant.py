"""Physics of the virtual damper, step by step (closed loops) or for whole runs.

It shares no code with the identified laws. The arithmetic is in ``native/``, a separate extension. The
hydraulic damper is described in ``docs/hydraulic_rig.md``. The lumped damper (``native/plant.c``) has a
time step of 0.1 ms; the inputs are the values at the end of the step:

*Driver and coil.* V = R0 I + Kp (I - i) + q within +-Vmax, q' = Ki (I - i) while not limited;
R = R0 (1 + 0.00393 (T - 20 C)), L = L0 / (1 + 0.25 i^2); i relaxes to V / R at the rate R / L.

*Field.* Eddy currents: i1 lags i (more when it falls); the fluid's structure: i2 lags i1; magnetic hysteresis
(play operator of half width r): ip. Effective current m = |(1 - wp) i2 + wp ip|, field shape g(m).

*Force.* The oil compliance is modelled as a leak c1 in series with the yield and viscous elements. Their
speed is w = v - (yield + viscous)/c1, with the forces of the previous step. Friction and spring act on the
rod. Yield force: three bristles relax towards sgn(w) Fy. Viscous force: a power of |w|. Friction: a bristle
with Stribeck effect, also driven by w. F = yield + viscous + friction + k1 x + f0.

Each relaxation is solved exactly over a step for constant inputs. Every closed cycle dissipates energy. Sign
convention: extension positive, force resisting extension positive.
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
"""Time step in which the hydraulic damper's equations are solved within the plant's [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class PlantResponse:
    """Response of the damper in a run, one sample per step, shape (n,)."""

    force: FloatArray  # [N]
    coil_current: FloatArray  # i [A]
    field: FloatArray  # effective field: m [A] (lumped) or flux density [T] (hydraulic)


class Plant:
    """A virtual damper with state, for closed loops. The initial force and current are zero.

    The lumped damper makes a step at the first sample. The hydraulic damper is in equilibrium at the
    first sample and makes its first step at the second sample. The object is mutable: use ``copy``, or store
    and restore ``state``, to compare continuations.

    Parameters
    ----------
    damper : parameters of the damper
    step_s : time step [s]
    solver_step_s : maximum internal step of the solver for the hydraulic equations [s]

    Raises
    ------
    InputError
        If a step is outside its range. Methods raise it for samples beyond the damper's range.
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
        """The internal state of the damper; a stored state can be assigned."""
        return self._native.state

    @state.setter
    def state(self, given: tuple[float, ...]) -> None:
        self._native.state = given

    @property
    def coil_current(self) -> float:
        """Current in the coil [A]."""
        return self._native.state[0]

    def copy(self) -> Plant:
        """Return an independent damper in the same state."""
        other = Plant.__new__(Plant)
        other.damper, other.step_s = self.damper, self.step_s
        other._native = self._native.copy()  # noqa: SLF001 - its own class
        return other

    def hold(self, temperature_degC: float, count: int) -> object:
        """Return a capsule with ``count`` (max 64) copies at one temperature, for closed loops in C."""
        return self._native.hold(temperature_degC + ZERO_CELSIUS_K, count)

    def advance(self, displacement: float, velocity: float, current: float, temperature_degC: float) -> float:
        """Advance by one step; return the force [N] at its end. The inputs are the values at the end."""
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
        """Advance by one step per sample; return the force [N] at the end of each step, shape (n,).

        The result is bit-identical to ``advance`` for each sample. ``current`` and ``temperature_degC`` may
        be constant numbers. If a sample is rejected, the state remains as it was before the call.
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
        """Advance like ``advance_many``; return force, coil current and effective field."""
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
        """Return the force, shape (1, n), or force, coil current and effective field, shape (3, n)."""
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
    """Return a number or an array of samples, plus an offset."""
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
    """Return the response of a damper that starts without force and current. The GIL is released.

    Parameters
    ----------
    displacement : extension positive [m], shape (n,), one sample per ``step_s``
    velocity : rate of the displacement [m/s], shape (n,)
    current : commanded [A], a number or shape (n,)
    temperature_degC : of fluid and coil [degC], a number or shape (n,)

    Raises
    ------
    InputError
        If a sample is not finite or beyond the range of any damper, or shapes differ.
    """
    plant = Plant(damper, step_s=step_s, solver_step_s=solver_step_s)
    return plant.respond(displacement, velocity, current, temperature_degC)
