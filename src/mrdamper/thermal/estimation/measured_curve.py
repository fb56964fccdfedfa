"""A measured heating curve: temperature versus time at one point of a damper.

``HeatingCurve`` is a valid curve. ``clean_curve`` removes bad readings of a data logger. The curve is neither
smoothed nor resampled because the calibration estimates the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrdamper.arrays import DEVIATION_PER_MAD, FloatArray, read_only
from mrdamper.data.tables import read_table
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError
from mrdamper.quantities import find_quantity, to_si
from mrdamper.thermal.settings import SETTINGS

Place = Literal["fluid", "wall", "coil"]
"""Position of the thermometer; ``wall`` is the body."""


@dataclass(frozen=True, slots=True, eq=False)
class HeatingCurve:
    """Temperature versus time at one point of a damper. Arrays are read-only, and time increases."""

    time: FloatArray  # [s], shape (n,)
    temperature: FloatArray  # [K], shape (n,)
    place: Place = "fluid"
    name: str = "curve"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for array in ("time", "temperature"):
            object.__setattr__(self, array, read_only(getattr(self, array)))
        if len(self.time) < SETTINGS.readings_min or self.time.shape != self.temperature.shape:
            raise InputError(
                place=self.name,
                found=f"it has {len(self.time)} times and {len(self.temperature)} readings",
                expected=f"one reading per time, at least {SETTINGS.readings_min}",
            )
        limits = find_quantity("temperature")
        rises = np.isfinite(self.time).all() and (np.diff(self.time) > 0.0).all()
        if not rises or not ((self.temperature >= limits.low) & (self.temperature <= limits.high)).all():
            raise InputError(
                place=self.name,
                found="its time does not rise, or a temperature is not plausible",
                expected=f"rising times and {limits.low:g} to {limits.high:g} K",
                remedy="Check the unit, or use clean_curve()",
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def noise_K(self) -> float:
        """Standard deviation of the noise [K], estimated from the median of absolute second differences."""
        t, y = self.time, self.temperature
        weight = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
        off = y[1:-1] - (1.0 - weight) * y[:-2] - weight * y[2:]
        spread = off / np.sqrt(1.0 + (1.0 - weight) ** 2 + weight**2)
        return float(DEVIATION_PER_MAD * np.median(np.abs(spread)))


def clean_curve(
    time_s: ArrayLike, temperature_K: ArrayLike, *, place: Place = "fluid", name: str = "curve"
) -> HeatingCurve:
    """Return a heating curve without the bad readings of a data logger.

    The function removes samples that are not finite or not plausible, repeated times, and spikes. A spike is
    a single sample far above or far below the three samples before and the three samples after the spike.
    The distance is more than 8 standard deviations of the noise, 0.5 K, and 4 times the range of the samples
    on each side. Steps and slopes of the curve remain. ``HeatingCurve.notes`` lists the removed samples.

    Raises
    ------
    InputError
        If more than a fifth of the samples are bad, or fewer than 8 samples remain.
    """
    time = np.asarray(time_s, dtype=np.float64)
    temperature = np.asarray(temperature_K, dtype=np.float64)
    count, limits = len(time), find_quantity("temperature")
    real = np.isfinite(time) & (temperature >= limits.low) & (temperature <= limits.high)
    order = np.flatnonzero(real)[np.unique(time[real], return_index=True)[1]]
    time, temperature = time[order], temperature[order]
    spikes = _spikes(temperature)
    dropped = {
        "no plausible temperature": count - int(real.sum()),
        "a repeated time": int(real.sum()) - len(order),
        "a spike": int(spikes.sum()),
    }
    bad = dropped["no plausible temperature"] + dropped["a spike"]
    if bad > SETTINGS.bad_readings_ratio_max * count:
        raise InputError(
            place=name,
            found=f"{bad} of {count} samples are no plausible temperature or a spike",
            expected="less than a fifth",
            remedy="Check the sensor and the column's unit",
        )
    notes = [f"{number} of {count} samples dropped: {what}" for what, number in dropped.items() if number]
    return HeatingCurve(time[~spikes], temperature[~spikes], place, name, tuple(notes))


def read_curve(path: str | Path) -> HeatingCurve:
    """Return the curve in a table file with a time and a temperature column (``time_s``, ``fluid_degC``).

    The name of the temperature column states the position of the thermometer: fluid, wall, body or coil. For
    other names, the position is the fluid.
    """
    file = Path(path)
    table = read_table(file)
    time: FloatArray | None = None
    found: dict[str, FloatArray] = {}
    for name, values in table.columns.items():
        known = parse_header(name)
        if known is not None and known[0] == "time" and time is None:
            time = to_si(values, known[1], "time")
        elif (unit := _temperature_unit(name)) is not None:
            found[name] = to_si(values, unit, "temperature")
    if time is None or len(found) != 1:
        raise InputError(
            f"has columns {', '.join(table.names)}",
            place=file.name,
            expected="time_s and one temperature, such as fluid_degC",
        )
    ((name, temperature),) = found.items()
    places: dict[str, Place] = {"wall": "wall", "body": "wall", "coil": "coil"}
    place = places.get(name.split("_")[0].strip().lower(), "fluid")
    return clean_curve(time, temperature, place=place, name=file.name)


def _temperature_unit(name: str) -> str | None:
    known = parse_header(name)
    if known is not None:
        return known[1] if known[0] == "temperature" else None
    word, _, unit = name.strip().rpartition("_")
    return unit if word.split("_")[0].lower() in {"fluid", "wall", "body", "coil"} else None


def _spikes(temperature: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the spikes (see ``clean_curve``). The first and the last sample are never spikes."""
    y, n = temperature, len(temperature)
    if n < SETTINGS.readings_min:
        return np.zeros(n, dtype=bool)
    second = np.abs(y[2:] - 2.0 * y[1:-1] + y[:-2]) / math.sqrt(6.0)
    noise = SETTINGS.spike_deviations_min * DEVIATION_PER_MAD * float(np.median(second))
    least = max(noise, SETTINGS.spike_min_K)
    around = np.clip(np.arange(n)[:, None] + SETTINGS.spike_neighbours, 0, n - 1)
    sides = y[around].reshape(n, 2, -1)
    off = y[:, None] - np.median(sides, axis=2)
    least = np.maximum(least, SETTINGS.spike_ranges_min * np.ptp(sides, axis=2).max(axis=1))
    spike = (off.prod(axis=1) > 0.0) & (np.abs(off).min(axis=1) > least)
    spike[[0, -1]] = False
    return np.asarray(spike)
