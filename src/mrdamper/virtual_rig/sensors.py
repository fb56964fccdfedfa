"""The virtual rig's sensors: sampling, noise, the converter's step, a thermocouple's lag and offset.

Displacement, force and temperature are measured; velocity and the coil's current are not. Noise is white and
comes from a generator that the caller gives, so that seeds are part of a scenario.
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
    """What the sensors wrote, shape (n,) each."""

    time: FloatArray  # [s], from zero
    displacement: FloatArray  # [m]
    force: FloatArray  # [N]
    temperature_degC: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensors:
    """The faults of the sensors: noise as standard deviation; a step of zero is a converter without steps."""

    rate_Hz: Annotated[float, Option(unit="Hz", above=0.0)] = 1000.0
    displacement_noise_m: Annotated[float, Option(unit="m", least=0.0)] = 10e-6
    displacement_step_m: Annotated[float, Option(unit="m", least=0.0)] = 0.0
    force_noise_N: Annotated[float, Option(unit="N", least=0.0)] = 5.0
    force_step_N: Annotated[float, Option(unit="N", least=0.0)] = 0.0
    force_offset_N: Annotated[float, Option(unit="N")] = 0.0
    cell_mass_kg: Annotated[
        float, Option("moving with the rod, between it and the force cell", unit="kg", least=0.0)
    ] = 0.0
    thermocouple_noise_K: Annotated[float, Option(unit="K", least=0.0)] = 0.3
    thermocouple_lag_s: Annotated[float, Option(unit="s", least=0.0)] = 10.0
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
        """Steps of the plant from one sample to the next."""
        return round(1.0 / (STEP_S * self.rate_Hz))

    def read(
        self,
        displacement: FloatArray,
        force: FloatArray,
        temperature_degC: FloatArray,
        noise: np.random.Generator,
        acceleration: FloatArray | None = None,
    ) -> Readings:
        """Return what is written of a run that is given at the plant's rate, from its first sample on.

        The rod's acceleration [m/s^2] is felt by the mass at the cell; without it that mass stands still.
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
        """Return the displacement [m] that is read at each sample of the true one, shape (n,)."""
        read = true + self.displacement_noise_m * noise.standard_normal(len(true))
        return _quantised(read, self.displacement_step_m)

    def force(self, true: FloatArray, noise: np.random.Generator) -> FloatArray:
        """Return the force [N] that is read at each sample of the true one, shape (n,)."""
        read = true + self.force_offset_N + self.force_noise_N * noise.standard_normal(len(true))
        return _quantised(read, self.force_step_N)

    def temperature(self, true_degC: FloatArray, noise: np.random.Generator) -> FloatArray:
        """Return the temperature [degC] that is read at each sample; the thermocouple starts soaked."""
        lagged = np.array(true_degC, dtype=np.float64)
        if self.thermocouple_lag_s > 0.0 and np.ptp(lagged) > 0.0:
            from scipy.signal import lfilter

            keep = np.exp(-1.0 / (self.rate_Hz * self.thermocouple_lag_s))
            first = lagged[0]
            lagged = first + lfilter([1.0 - keep], [1.0, -keep], lagged - first)
        return (
            lagged
            + self.thermocouple_offset_K
            + self.thermocouple_noise_K * noise.standard_normal(len(lagged))
        )


def _quantised(values: FloatArray, step: float) -> FloatArray:
    return step * np.round(values / step) if step > 0.0 else values
