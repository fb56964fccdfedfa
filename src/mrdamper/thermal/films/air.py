"""Properties of air as functions of temperature and altitude, for the correlations.

Viscosity and conductivity are Sutherland formulas. The air is a dry ideal gas. The pressure at sea level is
101325 Pa. From 233 to 573 K, the values are within 1 % of the reference equation of state (tested against
CoolProp).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError

GRAVITY_M_S2 = 9.80665
"""Standard gravity [m/s^2]."""

AIR_RANGE_K = (220.0, 600.0)
"""Valid range of the film temperature (mean of surface and ambient) [K]."""

STANDARD_PRESSURE_PA = 101325.0
GAS_CONSTANT_J_KG_K = 287.055  # specific gas constant of dry air


@dataclass(frozen=True, slots=True, eq=False)
class Air:
    """Properties of air at film temperatures. All arrays have the same shape."""

    temperature: FloatArray  # [K]
    conductivity: FloatArray  # [W/(m K)]
    kinematic_viscosity: FloatArray  # [m^2/s]
    prandtl: FloatArray  # [-]

    def grashof(self, length: ArrayLike, difference: ArrayLike) -> FloatArray:
        """Return the Grashof number for a length [m] and a temperature difference [K] of either sign."""
        buoyancy = GRAVITY_M_S2 * np.abs(difference) / self.temperature
        return np.asarray(buoyancy * np.asarray(length) ** 3 / self.kinematic_viscosity**2)

    def rayleigh(self, length: ArrayLike, difference: ArrayLike) -> FloatArray:
        """Return the Rayleigh number for a length [m] and a temperature difference [K] of either sign."""
        return np.asarray(self.grashof(length, difference) * self.prandtl)


def air_at(temperature_K: ArrayLike, altitude: float = 0.0) -> Air:
    """Return the properties of air at film temperatures [K], any shape, at an altitude [m].

    The pressure at the altitude z is 101325 (1 - 2.25577e-5 z)^5.25588 Pa (standard atmosphere).

    The viscosity is 1.5067e-6 T^1.5 / (T + 122.1), the conductivity 2.399e-3 T^1.5 / (T + 172.0), and the
    heat capacity 1005.4 + 380e-6 (T - 247.4)^2, in SI units. The formulas were fitted to the reference
    equation of state and transport laws (CoolProp 8) from 233 to 573 K. Their errors are below 0.35, 0.7 and
    0.06 %.

    Raises
    ------
    EnvelopeError
        If a temperature is outside ``AIR_RANGE_K``.
    """
    kelvin = np.asarray(temperature_K, dtype=np.float64)
    low, high = AIR_RANGE_K
    outside = ~((kelvin >= low) & (kelvin <= high))
    if outside.any():
        raise EnvelopeError(
            place="air",
            found=(
                f"film temperature is {kelvin[outside].flat[0]:g} K; its properties are known for {low:g} to "
                f"{high:g} K. Temperatures are in kelvin here"
            ),
        )
    root = kelvin * np.sqrt(kelvin)
    viscosity = 1.5067e-6 * root / (kelvin + 122.1)
    conductivity = 2.399e-3 * root / (kelvin + 172.0)
    heat_capacity = 1005.4 + 380e-6 * (kelvin - 247.4) ** 2
    density = STANDARD_PRESSURE_PA * (1.0 - 2.25577e-5 * altitude) ** 5.25588 / (GAS_CONSTANT_J_KG_K * kelvin)
    return Air(kelvin, conductivity, viscosity / density, viscosity * heat_capacity / conductivity)
