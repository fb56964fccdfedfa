"""The job ``observe``: a record of a coil or a body in, the temperature of the fluid within out.

The coil is read from current and voltage first (``control.coil_thermometer``), where the record has a
voltage: samples whose current is too small or changes are no readings, and a break or a short is told. Then
the observer (``thermal.estimation.observer``) follows the drawn damper along the record, and says how much
time is left to the limit if the last minute goes on.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.control.coil_thermometer import CoilFault, CoilRecord, CoilThermometer, coil_temperature
from mrdamper.errors import InputError, option
from mrdamper.jobs.options import ObserveOptions
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.estimation.observer import (
    ObservedTemperatures,
    ObserverOptions,
    ThermalRecord,
    Thermometers,
    build_observer,
    observe_temperature,
    time_left,
)
from mrdamper.thermal.estimation.sampling import TimeToLimit
from mrdamper.thermal.estimation.thermal_log import ThermalLog
from mrdamper.thermal.model.stepping import Load

_USUAL = ObserveOptions()
_RECENT_S = 60.0  # of the record, which is taken to go on
_FAULTS = {
    CoilFault.OPEN: "its circuit is open",
    CoilFault.SHORT: "it has a short",
    CoilFault.UNKNOWN: "the current is too small, or changes",
}


@dataclass(frozen=True, slots=True, eq=False)
class PlaceTemperature:
    """Temperature at a place over the record, and its standard deviation, shape (n,) each."""

    celsius: FloatArray  # [degC]
    error_K: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ObserveResult:
    """The temperatures within a damper over a record, and the time that is left.

    Attributes
    ----------
    record : what was measured
    fluid, coil, body : by the observer
    coil_read : by the coil's resistance alone, NaN where none is known; None: the record has no voltage
    factors : what the drawing seems to be off by, with relative standard deviations
    power_W, current_A : mean and root mean square of the record's last minute, taken to go on
    probability : of ``to_limit``, and of what faces show as intervals
    to_limit : from the record's end; ``math.inf`` is "not reached"
    """

    record: ThermalLog
    fluid: PlaceTemperature
    coil: PlaceTemperature
    body: PlaceTemperature
    coil_read: PlaceTemperature | None
    factors: Mapping[str, tuple[float, float]]
    power_W: float
    current_A: float
    probability: float
    limit_degC: float
    to_limit: TimeToLimit
    notes: tuple[str, ...]

    @property
    def interval_width(self) -> float:
        """Half of an interval that holds the temperature with ``probability``, in standard deviations."""
        return NormalDist().inv_cdf(0.5 + 0.5 * self.probability)


def observe(
    record: ThermalLog,
    drawing: DamperDrawing,
    options: ObserveOptions = _USUAL,
    *,
    on_progress: Progress = silent,
) -> ObserveResult:
    """Return the temperatures within a drawn damper, from what was read of its coil or body.

    Raises
    ------
    InputError
        A record without power, a drawing without the coil's resistance, nothing read at all, uneven steps
        beside a voltage.
    """
    if options.ambient_degC is not None:
        around = replace(drawing.surroundings, ambient=options.ambient_degC + ZERO_CELSIUS_K)
        drawing = replace(drawing, surroundings=around)
    read, notes = _read_coil(record, drawing, options.wiring_ohm)
    inputs = _inputs_of(record, read, options)
    asked = ObserverOptions(
        start_K=None if options.start_degC is None else options.start_degC + ZERO_CELSIUS_K,
        start_spread_K=options.start_spread_K,
        thermometers=Thermometers(resistance=options.resistance_noise, body_K=options.body_noise_K),
    )
    on_progress(ProgressUpdate(total=2, text="observer"))
    found = observe_temperature(drawing, inputs, asked)
    limit = drawing.filling.valid_K[1]
    if options.limit_degC is not None:
        limit = options.limit_degC + ZERO_CELSIUS_K
    on_progress(ProgressUpdate(done=1, total=2, text="time left"))
    power, current = _recent(inputs)
    goes_on = Load(
        options.look_s, lambda kelvin: np.full_like(kelvin, power), current**2 * drawing.coil.resistance
    )
    to_limit = time_left(
        build_observer(drawing, asked),
        found.state,
        goes_on,
        limit,
        probability=options.probability,
        seed=options.seed,
    )
    return ObserveResult(
        record,
        **_places(found),
        coil_read=None if read is None else _celsius(read.temperature, read.standard_error),
        factors=found.factors,
        power_W=power,
        current_A=current,
        probability=options.probability,
        limit_degC=limit - ZERO_CELSIUS_K,
        to_limit=to_limit,
        notes=(*record.notes, *notes),
    )


def _read_coil(
    record: ThermalLog, drawing: DamperDrawing, wiring_ohm: float
) -> tuple[CoilRecord | None, tuple[str, ...]]:
    """Return the coil by its resistance alone, where the record has its voltage only, and notes."""
    if record.voltage is None or record.resistance is not None:
        return None, ()
    thermometer = CoilThermometer(
        resistance_20_ohm=drawing.coil.resistance,
        period_s=float(np.median(np.diff(record.time))),
        wiring_ohm=wiring_ohm,
    )
    read = coil_temperature(record.time, record.current, record.voltage, thermometer)
    counts = Counter(read.faults)
    notes = tuple(
        Note(
            f"coil_{fault.name.lower()}",
            "{count} of {samples} samples of the coil are no reading: {why}",
            count=counts[fault],
            samples=len(read.faults),
            why=words,
        )
        for fault, words in _FAULTS.items()
        if counts[fault]
    )
    return read, notes


def _inputs_of(record: ThermalLog, read: CoilRecord | None, options: ObserveOptions) -> ThermalRecord:
    """Return what the observer takes in: power, current, and the readings that count."""
    power = record.power
    if options.power_W is not None:
        power = np.full(len(record.time), options.power_W)
    if power is None:
        raise InputError(
            place=record.name,
            found="the mechanical power is not known",
            expected=f"a column power_W, or {option('power-W')}",
        )
    resistance = record.resistance
    if read is not None and record.voltage is not None:
        counts = np.array([fault is CoilFault.NONE for fault in read.faults])
        resistance = np.full(len(record.time), np.nan)
        resistance[counts] = record.voltage[counts] / record.current[counts] - options.wiring_ohm
    seen = [] if resistance is None else [np.isfinite(resistance) & (record.current != 0.0)]
    seen += [] if record.body is None else [np.isfinite(record.body)]
    if not np.any(seen):
        raise InputError(
            place=record.name,
            found="nothing was read in any row",
            expected="a body temperature, or a resistance while there is current",
        )
    return ThermalRecord(record.time, power, record.current, resistance, record.body)


def _recent(record: ThermalRecord) -> tuple[float, float]:
    """Return mean power [W] and root mean square current [A] of the record's last minute."""
    elapsed = np.diff(record.time)
    last = record.time[1:] > record.time[-1] - _RECENT_S
    weights = elapsed[last] / elapsed[last].sum()
    return float(weights @ record.power[1:][last]), float(weights @ record.current[1:][last] ** 2) ** 0.5


def _places(found: ObservedTemperatures) -> dict[str, PlaceTemperature]:
    return {
        "fluid": _celsius(found.fluid, found.fluid_error),
        "coil": _celsius(found.coil, found.coil_error),
        "body": _celsius(found.wall, found.wall_error),
    }


def _celsius(kelvin: FloatArray, error_K: FloatArray) -> PlaceTemperature:
    return PlaceTemperature(read_only(kelvin - ZERO_CELSIUS_K), read_only(error_K))
