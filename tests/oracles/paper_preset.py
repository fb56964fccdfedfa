"""Compute the parameters of the preset ``paper`` from the force loss that the reference paper states.

The paper states the peak force in its thermal test, and the relative loss of force at two temperatures. A
test computes the parameters again and compares them with the preset.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.excitation import Motion, Sine
from mrdamper.virtual_rig.lumped import LUMPED, LumpedDamper
from mrdamper.virtual_rig.plant import STEP_S, simulate

__all__ = ["CLAIMED_LOSSES", "CLAIMED_PEAK_N", "THERMAL_MOTION", "peak_force", "solve_thermal_claims"]

THERMAL_MOTION = Sine(15e-3, 1.0)
CLAIMED_PEAK_N = 1300.0  # Peak force at 20 degC and 2 A
# Temperature [degC] and relative loss of force
CLAIMED_LOSSES: tuple[tuple[float, float], ...] = ((76.9, 0.157), (129.9, 0.259))
_CURRENT_A = 2.0


def peak_force(
    damper: LumpedDamper, motion: Motion, current: float, temperature_degC: float, *, period_s: float = 1.0
) -> float:
    """Return the largest absolute force [N] in the third period of a periodic motion."""
    time = np.arange(round(3.0 * period_s / STEP_S) + 1) * STEP_S
    force = simulate(
        damper, motion.displacement(time), motion.velocity(time), current, temperature_degC
    ).force
    return float(np.abs(force[time >= 2.0 * period_s]).max())


def solve_thermal_claims(start: LumpedDamper | None = None) -> LumpedDamper:
    """Return a damper whose yield force, viscous force and loss of force agree with the paper.

    Powell's hybrid method solves three equations, beginning with ``start`` or the preset ``paper``. The
    relative losses of yield force and friction are equal.

    Raises
    ------
    ConvergenceError
        If the residuals are larger than 1e-6.
    """
    from scipy.optimize import root

    base = start or LUMPED["paper"]
    sizes = np.array([1000.0, 100.0, 1e-3])

    def with_numbers(numbers: FloatArray) -> LumpedDamper:
        field, viscous, loss = (float(value) for value in numbers * sizes)
        return replace(
            base, yield_field_N=field, viscous_N=viscous, yield_loss_per_K=loss, friction_loss_per_K=loss
        )

    def misses(numbers: FloatArray) -> FloatArray:
        damper = with_numbers(numbers)
        cold = peak_force(damper, THERMAL_MOTION, _CURRENT_A, 20.0)
        losses = [
            1.0 - peak_force(damper, THERMAL_MOTION, _CURRENT_A, warm) / cold - lost
            for warm, lost in CLAIMED_LOSSES
        ]
        return np.array([cold / CLAIMED_PEAK_N - 1.0, *losses])

    found = root(misses, np.array([1.05, 0.6, 1.6]), tol=1e-10)
    worst = float(np.abs(misses(found.x)).max())
    if not worst < 1e-6:
        raise ConvergenceError(f"paper preset: the solve stopped {worst:.2g} from the claims; expected 1e-6")
    return with_numbers(found.x)
