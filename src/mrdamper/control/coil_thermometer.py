"""The coil as a thermometer: its temperature from the voltage and the current at the driver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.materials import COPPER_PER_K

_UNEVEN = 0.01  # share of the period by which a record's steps may differ


class CoilFault(Enum):
    """What the coil's resistance says beside its temperature."""

    NONE = "none"
    UNKNOWN = "unknown"  # too little current to tell
    OPEN = "open"
    SHORT = "short"


@dataclass(frozen=True, slots=True)
class CoilReading:
    """Temperature of the coil [K], NaN until one is known or where the coil is at fault."""

    temperature: float
    fault: CoilFault


@dataclass(frozen=True, slots=True, kw_only=True)
class CoilThermometer:
    """Temperature from the coil's resistance: copper's rises by 0.39 % per kelvin.

    It gets the voltage and the current at the driver once a period; they count while the current hardly
    changes (inductance would count as resistance). A resistance that no temperature from ``cold_K`` to
    ``hot_K`` explains by a factor of two is a break or a short. Give the controller the reading's
    temperature: NaN is then its own matter (last good value, then nominal).
    """

    resistance_20_ohm: float
    period_s: float
    wiring_ohm: float = 0.0
    least_A: float = 0.2
    steady_A_s: float = 5.0  # a current that changes faster is not looked at
    smooth_s: float = 1.0
    cold_K: float = 233.15
    hot_K: float = 423.15
    open_V: float = 2.0  # that much voltage without current is a break

    def __post_init__(self) -> None:
        if not (self.resistance_20_ohm > 0.0 and self.period_s > 0.0 and self.least_A > 0.0):
            raise InputError(
                place="coil thermometer",
                found=(
                    f"resistance {self.resistance_20_ohm} ohm, period {self.period_s} s, least current "
                    f"{self.least_A} A"
                ),
                expected="positive numbers",
            )

    def start(self) -> tuple[float, float]:
        """Return the state: smoothed temperature [K] and last current [A], neither known."""
        return (math.nan, math.nan)

    def step(
        self, state: tuple[float, float], voltage: float, current: float
    ) -> tuple[tuple[float, float], CoilReading]:
        """Return the next state and the reading."""
        kelvin, before = state
        if not (math.isfinite(voltage) and math.isfinite(current)):
            return state, CoilReading(kelvin, CoilFault.UNKNOWN)
        after = (kelvin, current)
        if abs(current) < self.least_A:
            broken = abs(current) < 0.1 * self.least_A and abs(voltage) > self.open_V
            return after, CoilReading(
                math.nan if broken else kelvin, CoilFault.OPEN if broken else CoilFault.UNKNOWN
            )
        if not abs(current - before) <= self.steady_A_s * self.period_s:
            return after, CoilReading(kelvin, CoilFault.UNKNOWN)
        ohm = voltage / current - self.wiring_ohm
        if ohm > 2.0 * self.resistance_at(self.hot_K):
            return after, CoilReading(math.nan, CoilFault.OPEN)
        if ohm < 0.5 * self.resistance_at(self.cold_K):
            return after, CoilReading(math.nan, CoilFault.SHORT)
        read = REFERENCE_K + (ohm / self.resistance_20_ohm - 1.0) / COPPER_PER_K
        keep = math.exp(-self.period_s / self.smooth_s)
        smooth = read if math.isnan(kelvin) else read + keep * (kelvin - read)
        return (smooth, current), CoilReading(smooth, CoilFault.NONE)

    def resistance_at(self, kelvin: float) -> float:
        """Return the coil's resistance [ohm] at a temperature."""
        return self.resistance_20_ohm * (1.0 + COPPER_PER_K * (kelvin - REFERENCE_K))


@dataclass(frozen=True, slots=True, kw_only=True)
class CoilErrors:
    """Standard errors of what the temperature is made from."""

    voltage_V: float = 0.02
    current_A: float = 0.005
    wiring_ohm: float = 0.02
    resistance_share: float = 0.01  # of the coil's resistance at 20 degC

    def of_temperature(self, coil: CoilThermometer, voltage: FloatArray, current: FloatArray) -> FloatArray:
        """Return the standard error of the temperature [K] at each sample, smoothing not counted.

        Of T = T_20 + (R / R_20 - 1) / alpha, R = U / I - R_w, by its slopes in U, I, R_w and R_20.
        """
        ohm = voltage / current - coil.wiring_ohm
        slopes = (
            self.voltage_V / current,
            self.current_A * voltage / current**2,
            np.full(len(current), self.wiring_ohm),
            self.resistance_share * ohm,
        )
        total = np.sqrt(np.sum(np.square(slopes), axis=0))
        return np.asarray(total / (COPPER_PER_K * coil.resistance_20_ohm))


@dataclass(frozen=True, slots=True, eq=False)
class CoilRecord:
    """The coil's temperature over a record, shape (n,); NaN where none is known."""

    time: FloatArray  # [s]
    temperature: FloatArray  # [K], smoothed; the last one holds while none can be read
    standard_error: FloatArray  # [K], of the last sample that was read
    faults: tuple[CoilFault, ...]


def coil_temperature(
    time: FloatArray,
    current: FloatArray,
    voltage: FloatArray,
    coil: CoilThermometer,
    errors: CoilErrors | None = None,
) -> CoilRecord:
    """Return the coil's temperature and its uncertainty over a record.

    Parameters
    ----------
    time : [s], even steps of the thermometer's period, shape (n,)
    current : at the driver [A], shape (n,)
    voltage : at the driver [V], shape (n,)
    errors : standard errors of the readings and of the coil; None: the usual

    Raises
    ------
    InputError
        Lengths that differ, fewer than two samples, or steps that are not the thermometer's period.
    """
    if not len(time) == len(current) == len(voltage) or len(time) < 2:
        raise InputError(
            place="coil record",
            found=f"lengths are {len(time)}, {len(current)}, {len(voltage)}",
            expected="one and the same, at least 2",
        )
    steps = np.diff(time)
    if not (np.abs(steps - coil.period_s) <= _UNEVEN * coil.period_s).all():
        raise InputError(
            place="coil record",
            found=f"steps are {steps.min():g} to {steps.max():g} s",
            expected=f"even ones of the thermometer's period, {coil.period_s:g} s",
            remedy="Resample the record",
        )
    state, readings = coil.start(), []
    for volts, amperes in zip(voltage.tolist(), current.tolist(), strict=True):
        state, reading = coil.step(state, volts, amperes)
        readings.append(reading)
    kelvin = np.array([each.temperature for each in readings])
    was_read = np.array([each.fault is CoilFault.NONE for each in readings])
    own = np.full(len(time), np.nan)
    own[was_read] = (errors or CoilErrors()).of_temperature(coil, voltage[was_read], current[was_read])
    last = np.maximum.accumulate(np.where(was_read, np.arange(len(time)), 0))
    held = np.where(np.isfinite(kelvin), own[last], np.nan)
    return CoilRecord(time, kelvin, held, tuple(each.fault for each in readings))
