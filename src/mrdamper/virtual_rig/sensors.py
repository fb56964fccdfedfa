"""Sensors of the virtual rig: sampling, noise, quantisation and offsets.

Displacement, force and temperature are measured. Velocity and coil current are not measured. Noise is white.
The caller passes the random number generator, so that the seed is part of a scenario.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.schema import Option, check_ranges
from mrdamper.virtual_rig.plant import STEP_S


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """Sensor signals of a run, arrays of shape (n,)."""

    time: FloatArray  # time since the first sample [s]
    displacement: FloatArray  # [m]
    force: FloatArray  # [N]
    temperature_degC: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """Sampling rate and errors of the sensors: noise (standard deviation), quantisation step and offset."""

    rate_Hz: Annotated[float, Option(unit="Hz", above=0.0)] = 1000.0
    displacement_noise_m: Annotated[float, Option(unit="m", least=0.0)] = 10e-6
    displacement_step_m: Annotated[float, Option(unit="m", least=0.0)] = 0.0
    force_noise_N: Annotated[float, Option(unit="N", least=0.0)] = 5.0
    force_step_N: Annotated[float, Option(unit="N", least=0.0)] = 0.0
    force_offset_N: Annotated[float, Option(unit="N")] = 0.0
    cell_mass_kg: Annotated[float, Option(unit="kg", least=0.0)] = 0.0
    """Moving mass between the rod and the force cell."""
    thermocouple_noise_K: Annotated[float, Option(unit="K", least=0.0)] = 0.3
    thermocouple_offset_K: Annotated[float, Option(unit="K")] = 0.0

    def __post_init__(self) -> None:
        check_ranges(self, "sensors")
        every = 1.0 / (STEP_S * self.rate_Hz)
        if every < 1.0 - 1e-9 or abs(every - round(every)) > 1e-6:
            raise InputError(
                place="sensors",
                found=f"rate is {self.rate_Hz:g} Hz",
                expected=f"a whole part of {1.0 / STEP_S:g} Hz, the plant's rate, such as 500 or 1000",
            )

    @property
    def steps_per_sample(self) -> int:
        """Number of time steps of the simulated damper per sensor sample."""
        return round(1.0 / (STEP_S * self.rate_Hz))

    def read(
        self,
        displacement: FloatArray,
        force: FloatArray,
        temperature_degC: FloatArray,
        noise: np.random.Generator,
        acceleration: FloatArray | None = None,
    ) -> Readings:
        """Return the sensor signals for exact signals that have the time step of the simulated damper.

        The log begins at the first sample of the exact signals. If the ``acceleration`` of the rod [m/s^2] is
        given, the inertia force of the mass at the force cell is added to the force.
        """
        every = self.steps_per_sample
        x, f, true = displacement[::every], force[::every], temperature_degC[::every]
        if acceleration is not None:
            f = f + self.cell_mass_kg * acceleration[::every]
        return Readings(
            time=np.arange(len(x)) / self.rate_Hz,
            displacement=self.displacement(x, noise),
            force=self.force(f, noise),
            temperature_degC=self.temperature(true, noise),
        )

    def displacement(self, true: FloatArray, noise: np.random.Generator) -> FloatArray:
        """Return the measured displacement [m] for the true displacement, shape (n,)."""
        read = true + self.displacement_noise_m * noise.standard_normal(len(true))
        return _quantised(read, self.displacement_step_m)

    def force(self, true: FloatArray, noise: np.random.Generator) -> FloatArray:
        """Return the measured force [N] for the true force, shape (n,)."""
        read = true + self.force_offset_N + self.force_noise_N * noise.standard_normal(len(true))
        return _quantised(read, self.force_step_N)

    def temperature(self, true_degC: FloatArray, noise: np.random.Generator) -> FloatArray:
        """Return the measured temperature [degC] for the true temperature, shape (n,)."""
        white = self.thermocouple_noise_K * noise.standard_normal(len(true_degC))
        return true_degC + self.thermocouple_offset_K + white


def _quantised(values: FloatArray, step: float) -> FloatArray:
    return step * np.round(values / step) if step > 0.0 else values
