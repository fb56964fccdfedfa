"""A measured heating curve: temperature over time at one place of a damper.

``HeatingCurve`` is the checked value. ``clean_curve`` makes one of a logger's columns: it drops gaps,
repeated time stamps and single spikes, and reports how many. Nothing is smoothed or resampled because the
fit judges the noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data.tables import read_table
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError
from mrdamper.quantities import find_quantity, to_si

Place = Literal["fluid", "wall", "coil"]
"""Where the thermometer is; ``wall`` is the body."""

BAD_READINGS_MAX_RATIO = 0.2  # More bad readings mean a broken sensor.
READINGS_MIN_COUNT = 8
SPIKE_MIN_DEVIATIONS = 8.0
SPIKE_MIN_K = 0.5
SPIKE_MIN_SPREADS = 4.0  # A spike is this many times further off than its neighbours are from each other.
NEIGHBOUR_COUNT = 3  # on either side
NORMAL_PER_MAD = 1.4826  # standard deviation divided by median absolute deviation


@dataclass(frozen=True, slots=True, eq=False)
class HeatingCurve:
    """Temperature over time at one place of a damper; arrays are read-only, time rises."""

    time: FloatArray  # [s], shape (n,)
    temperature: FloatArray  # [K], shape (n,)
    place: Place = "fluid"
    name: str = "curve"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for array in ("time", "temperature"):
            object.__setattr__(self, array, read_only(getattr(self, array)))
        if self.place not in get_args(Place):
            raise InputError(
                place=self.name, found=f"place is {self.place!r}", expected=", ".join(get_args(Place))
            )
        _check_shapes(self.time, self.temperature, self.name)
        if len(self.time) < READINGS_MIN_COUNT:
            raise InputError(
                place=self.name,
                found=f"it has {len(self.time)} readings",
                expected=f"at least {READINGS_MIN_COUNT}",
            )
        if not np.isfinite(self.time).all() or not (np.diff(self.time) > 0.0).all():
            raise InputError(
                place=self.name, found="time does not rise", expected="seconds in order, none twice"
            )
        limits = find_quantity("temperature")
        bad = ~((self.temperature >= limits.low) & (self.temperature <= limits.high))
        if bad.any():
            k = int(np.flatnonzero(bad)[0])
            raise InputError(
                place=self.name,
                found=f"temperature is {self.temperature[k]:g} K at {self.time[k]:g} s "
                f"({bad.sum()} such samples)",
                expected=f"{limits.low:g} to {limits.high:g} K",
                remedy="Check its unit, or use clean_curve()",
            )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def noise_K(self) -> float:
        """Standard deviation of the noise [K], from the median of second differences."""
        t, y = self.time, self.temperature
        weight = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
        off = y[1:-1] - (1.0 - weight) * y[:-2] - weight * y[2:]
        spread = off / np.sqrt(1.0 + (1.0 - weight) ** 2 + weight**2)
        return float(NORMAL_PER_MAD * np.median(np.abs(spread)))


def clean_curve(
    time_s: ArrayLike, temperature_K: ArrayLike, *, place: Place = "fluid", name: str = "curve"
) -> HeatingCurve:
    """Return a curve of a logger's columns without bad readings; its notes report them.

    Dropped are samples that are not finite or not plausible, later rows of an equal time, and spikes:
    single samples that are off the median of the three samples on both sides, to the same side, by 8
    deviations of the noise and 4 times the neighbours' range. Steps and rises stay.

    Raises
    ------
    InputError
        More than a fifth would be dropped, or fewer than 8 samples stay.
    """
    time = np.asarray(time_s, dtype=np.float64)
    temperature = np.asarray(temperature_K, dtype=np.float64)
    _check_shapes(time, temperature, name)
    count, limits = len(time), find_quantity("temperature")
    real = np.isfinite(time) & (temperature >= limits.low) & (temperature <= limits.high)
    time, temperature = time[real], temperature[real]
    order = np.unique(time, return_index=True)[1]
    twice = len(time) - len(order)
    time, temperature = time[order], temperature[order]
    spikes = _spikes(temperature) if len(time) > 2 * NEIGHBOUR_COUNT else np.zeros(len(time), dtype=bool)
    dropped = {"no plausible temperature": count - int(real.sum()), "a spike": int(spikes.sum())}
    for what, number in dropped.items():
        if number > BAD_READINGS_MAX_RATIO * count:
            raise InputError(
                place=name,
                found=f"{number} of {count} samples are {what}",
                expected="less than a fifth",
                remedy="Check the sensor and the column's unit",
            )
    dropped["a repeated time"] = twice
    notes = [f"{number} of {count} samples dropped: {what}" for what, number in dropped.items() if number]
    return HeatingCurve(time[~spikes], temperature[~spikes], place, name, tuple(notes))


def read_curve(path: str | Path) -> HeatingCurve:
    """Return the curve in a table with a time column and one temperature column (``time_s``, ``fluid_degC``).

    The column's name states where the thermometer is (fluid, wall, body, coil); else it is the fluid.
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


def _check_shapes(time: FloatArray, temperature: FloatArray, place: str) -> None:
    if time.ndim != 1 or time.shape != temperature.shape:
        raise InputError(
            place=place,
            found=f"time has shape {time.shape}, temperature {temperature.shape}",
            expected="one temperature per time",
        )


def _temperature_unit(name: str) -> str | None:
    known = parse_header(name)
    if known is not None:
        return known[1] if known[0] == "temperature" else None
    word, _, unit = name.strip().rpartition("_")
    return unit if word.split("_")[0].lower() in {"fluid", "wall", "body", "coil"} else None


def _spikes(temperature: FloatArray) -> NDArray[np.bool_]:
    """Return which samples are off both sides alone."""
    y, n = temperature, len(temperature)
    second = np.abs(y[2:] - 2.0 * y[1:-1] + y[:-2]) / math.sqrt(6.0)
    least = max(SPIKE_MIN_DEVIATIONS * NORMAL_PER_MAD * float(np.median(second)), SPIKE_MIN_K)
    steps = np.arange(1, NEIGHBOUR_COUNT + 1)
    before = y[np.maximum(np.arange(n)[:, None] - steps, 0)]
    after = y[np.minimum(np.arange(n)[:, None] + steps, n - 1)]
    off = np.array([y - np.median(side, axis=1) for side in (before, after)])
    apart = np.maximum(np.ptp(before, axis=1), np.ptp(after, axis=1))
    spike = (off[0] * off[1] > 0.0) & (np.abs(off).min(axis=0) > np.maximum(least, SPIKE_MIN_SPREADS * apart))
    spike[[0, -1]] = False  # The first and last sample have neighbours on one side only.
    return np.asarray(spike)
