"""Air at atmospheric pressure: what the correlations need, over temperature.

Laws of Sutherland's form for viscosity and conductivity, the ideal gas at 101325 Pa, dry; within 1 % of the
reference equation of state from 233 to 573 K (a test compares with CoolProp).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError

GRAVITY = 9.80665
"""Standard gravity [m/s^2]."""

AIR_RANGE_K = (220.0, 600.0)
"""Film temperatures for which air is described [K]."""

_PRESSURE = 101325.0  # [Pa]
_GAS = 287.055  # of dry air [J/(kg K)]


@dataclass(frozen=True, slots=True, eq=False)
class Air:
    """Properties of air at film temperatures; every field has the temperature's shape."""

    temperature: FloatArray  # [K]
    conductivity: FloatArray  # [W/(m K)]
    kinematic_viscosity: FloatArray  # [m^2/s]
    prandtl: FloatArray  # [-]

    def grashof(self, length: ArrayLike, difference: ArrayLike) -> FloatArray:
        """Return the Grashof number of a length [m] and a temperature difference [K], of either sign."""
        buoyancy = GRAVITY * np.abs(difference) / self.temperature
        return np.asarray(buoyancy * np.asarray(length) ** 3 / self.kinematic_viscosity**2)

    def rayleigh(self, length: ArrayLike, difference: ArrayLike) -> FloatArray:
        """Return the Rayleigh number of a length [m] and a temperature difference [K], of either sign."""
        return np.asarray(self.grashof(length, difference) * self.prandtl)


def air_at(temperature_K: ArrayLike, altitude: float = 0.0) -> Air:
    """Return the properties of air at film temperatures [K], any shape, at an altitude [m].

    The pressure is that of the standard atmosphere's lowest layer, 101325 (1 - 2.25577e-5 z)^5.25588 Pa.

    Viscosity is 1.5067e-6 T^1.5 / (T + 122.1), conductivity 2.399e-3 T^1.5 / (T + 172.0), heat capacity
    1005.4 + 380e-6 (T - 247.4)^2, fitted to the reference equation of state and transport laws (CoolProp 8)
    over 233 to 573 K: within 0.35, 0.7 and 0.06 %.

    Raises
    ------
    EnvelopeError
        A temperature outside ``AIR_RANGE_K``.
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
    density = _PRESSURE * (1.0 - 2.25577e-5 * altitude) ** 5.25588 / (_GAS * kelvin)
    return Air(kelvin, conductivity, viscosity / density, viscosity * heat_capacity / conductivity)
