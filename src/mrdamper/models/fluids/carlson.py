"""Yield stress and flux density of an MR fluid versus magnetic field strength, after Carlson.

    tau(H) = tau_s tanh(H / H_s)        tau_s = C 271700 Pa phi^1.5239,  1 / H_s = 6.33e-6 m/A
    B(H) = 1.91 phi^1.133 [1 - exp(-10.97 mu0 H)] + mu0 H                (B, mu0 H in tesla)

phi is the volume fraction of iron; C depends on the carrier: 1 for hydrocarbon, 0.95 for silicone, 1.16 for
water. The module ``temperature`` describes how the yield stress changes with temperature. The magnetisation
curve is assumed to be the same at every temperature. The stress does not depend on the sign of the field,
and B is odd in H.

Source: Carlson's empirical formulas, from a public source file. The values of C are assumptions of this
project. The manufacturer's points for MRF-132DG (from a secondary source) are 4.64, 13.77 and 23.47 kPa at
18, 46 and 80 kA/m. With phi = 0.32 and C = 1, the formula deviates from these points by +17, -2 and -5 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.schema import Positive, check_ranges

MU_0 = 1.25663706212e-6
"""Magnetic constant [V s/(A m)], CODATA 2018."""

FIELD_SCALE_A_m = 1.0 / 6.33e-6
"""Carlson's field scale H_s [A/m], 158 kA/m."""

CARRIERS: Mapping[str, float] = MappingProxyType({"hydrocarbon": 1.0, "silicone": 0.95, "water": 1.16})
"""Carlson's constant C of a carrier liquid [-]. The values are assumptions of this project."""

_STRESS_PA, _STRESS_POWER = 271700.0, 1.5239
_IRON_T, _IRON_POWER, _IRON_RATE = 1.91, 1.133, 10.97


@dataclass(frozen=True, slots=True)
class Carlson:
    """Yield stress as a function of the field at 20 degC: tau = saturation tanh(H / field_scale)."""

    saturation_Pa: Positive
    field_scale_A_m: Positive = FIELD_SCALE_A_m

    def __post_init__(self) -> None:
        check_ranges(self, "yield stress")

    def stress(self, field_A_m: ArrayLike) -> FloatArray:
        """Return the yield stress [Pa] at field strengths H [A/m] of any shape."""
        field = np.abs(np.asarray(field_A_m, dtype=np.float64))
        return np.asarray(self.saturation_Pa * np.tanh(field / self.field_scale_A_m))


def saturation_stress(particle_fraction: float, carrier_constant: float = 1.0) -> float:
    """Return Carlson's saturated yield stress C 271700 phi^1.5239 [Pa].

    Parameters
    ----------
    particle_fraction : volume fraction of iron phi [-], 0 to 0.6
    carrier_constant : C [-], see ``CARRIERS``
    """
    return carrier_constant * _STRESS_PA * math.pow(checked_fraction(particle_fraction), _STRESS_POWER)


def flux_density(field_A_m: ArrayLike, particle_fraction: float) -> FloatArray:
    """Return the flux density B [T] in the fluid at field strengths H [A/m] of any shape."""
    outside = MU_0 * np.asarray(field_A_m, dtype=np.float64)
    iron = _saturated_polarisation_T(particle_fraction)
    return np.asarray(outside - np.sign(outside) * iron * np.expm1(-_IRON_RATE * np.abs(outside)))


def field_strength(flux_density_T: ArrayLike, particle_fraction: float) -> FloatArray:
    """Return the field strength H [A/m] for flux densities B [T] in the fluid (inverse of B(H)).

    With b = mu0 H, a = 1.91 phi^1.133 and k = 10.97/T the curve is b + a (1 - exp(-k b)) = B. The solution is
    b = B - a + W(k a exp[k (a - B)]) / k with Lambert's W. One subsequent Newton step removes the remaining
    cancellation error at small B.
    """
    from scipy.special import lambertw

    given = np.asarray(flux_density_T, dtype=np.float64)
    target = np.abs(given)
    iron = _saturated_polarisation_T(particle_fraction)
    k = _IRON_RATE
    branch = lambertw(k * iron * np.exp(k * (iron - target)))  # type: ignore[call-overload]  # any shape
    outside = target - iron + np.real(branch) / k
    excess = outside - iron * np.expm1(-k * outside) - target
    outside = outside - excess / (1.0 + iron * k * np.exp(-k * outside))
    return np.asarray(np.sign(given) * outside / MU_0)


def _saturated_polarisation_T(particle_fraction: float) -> float:
    return _IRON_T * math.pow(checked_fraction(particle_fraction), _IRON_POWER)


def checked_fraction(particle_fraction: float) -> float:
    """Return the volume fraction of iron; raise InputError outside (0, 0.6] (packed spheres reach 0.64)."""
    if not 0.0 < particle_fraction <= 0.6:
        raise InputError(
            found=f"particle fraction is {particle_fraction:g}",
            expected="the volume fraction of iron, above 0 and up to 0.6 (32 % by volume is 0.32)",
        )
    return particle_fraction
