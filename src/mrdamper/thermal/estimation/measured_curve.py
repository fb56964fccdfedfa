"""A measured temperature curve of a damper: what calibration and prediction start from.

``HeatingCurve`` is the checked value; ``clean_curve`` makes one of what a logger wrote: gaps, repeated stamps
and lone spikes go, and it says how many. Nothing is smoothed or resampled: noise is for the fits to judge.
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
from mrdamper.notes import Note
from mrdamper.quantities import find_quantity, to_si

Place = Literal["fluid", "wall", "coil"]
"""Where the thermometer sits; ``wall`` is the body."""

MOST_BAD_SHARE = 0.2
"""Share of a thermometer's readings that may be wrong; more is a broken sensor."""

_LEAST_READINGS = 8  # readings of a curve
_SPIKE = 8.0  # standard deviations of the noise
_LEAST_SPIKE_K = 0.5
_APART = 4.0
_NEIGHBOURS = 3  # samples on either side
_NORMAL = 1.4826  # standard deviation over median absolute deviation


@dataclass(frozen=True, slots=True, eq=False)
class HeatingCurve:
    """Temperature over time at one place of a damper; arrays are read-only, time rises."""

    time: FloatArray  # [s], shape (n,)
    temperature: FloatArray  # [K], shape (n,)
    place: Place = "fluid"
    lag_s: float = 0.0  # of the sensor, first order, as far as it is known
    name: str = "curve"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for array in ("time", "temperature"):
            object.__setattr__(self, array, read_only(getattr(self, array)))
        if self.place not in get_args(Place):
            raise InputError(
                place=self.name, found=f"place is {self.place!r}; use one of: {', '.join(get_args(Place))}"
            )
        _check_shapes(self.time, self.temperature, self.name)
        if len(self.time) < _LEAST_READINGS:
            raise InputError(
                place=self.name,
                found=f"it has {len(self.time)} readings",
                expected=f"at least {_LEAST_READINGS}",
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
                found=(
                    f"temperature is {self.temperature[k]:g} K at {self.time[k]:g} s ({bad.sum()} such "
                    "samples)"
                ),
                expected=f"{limits.low:g} to {limits.high:g} K",
                remedy="Check its unit, or use clean_curve()",
            )
        if not (math.isfinite(self.lag_s) and self.lag_s >= 0.0):
            raise InputError(
                place=self.name, found=f"lag_s is {self.lag_s}", expected="seconds, zero or more"
            )

    def __len__(self) -> int:
        return len(self.time)

    def until(self, time_s: float) -> HeatingCurve:
        """Return the part up to a time [s]."""
        keep = self.time <= time_s
        return HeatingCurve(
            self.time[keep], self.temperature[keep], self.place, self.lag_s, self.name, self.notes
        )

    @property
    def noise_K(self) -> float:
        """Standard deviation of the noise [K], robust, from second differences: no smooth course is in it."""
        t, y = self.time, self.temperature
        weight = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
        off = y[1:-1] - (1.0 - weight) * y[:-2] - weight * y[2:]
        spread = off / np.sqrt(1.0 + (1.0 - weight) ** 2 + weight**2)
        return float(_NORMAL * np.median(np.abs(spread)))


def clean_curve(
    time_s: ArrayLike,
    temperature_K: ArrayLike,
    *,
    place: Place = "fluid",
    lag_s: float = 0.0,
    name: str = "curve",
) -> HeatingCurve:
    """Return a curve of what a logger wrote, without what is no reading; its notes say what went.

    Samples that are not finite or no plausible temperature go, rows are put in order of time, of rows with
    the same time the first stays, and a sample that stands out from the three on either side goes (a loose
    contact): to the same side of both, by 8 deviations of the noise and 4 times as far as they lie apart
    among themselves. A step that stays is not touched, nor is any rise.

    Raises
    ------
    InputError
        More than a fifth would go, or fewer than 8 samples stay.
    """
    time = np.asarray(time_s, dtype=np.float64)
    temperature = np.asarray(temperature_K, dtype=np.float64)
    _check_shapes(time, temperature, name)
    limits = find_quantity("temperature")
    real = np.isfinite(time) & (temperature >= limits.low) & (temperature <= limits.high)
    lost = len(time) - int(real.sum())
    time, temperature = time[real], temperature[real]
    order = np.unique(time, return_index=True)[1]
    twice = len(time) - len(order)
    time, temperature = time[order], temperature[order]
    spiky = _spikes(temperature) if len(time) > 2 * _NEIGHBOURS else np.zeros(len(time), dtype=bool)
    gone = {"no plausible temperature": lost, "a spike": int(spiky.sum())}
    count = len(real)
    for what, number in gone.items():
        if number > MOST_BAD_SHARE * count:
            raise InputError(
                place=name,
                found=f"{number} of {count} samples are {what}",
                expected="less than a fifth",
                remedy="Check the sensor and the column's unit",
            )
    form = "{number} of {samples} samples left out: {what}"
    gone["a time that is there already"] = twice
    said = [
        Note("left_out", form, number=number, samples=count, what=what)
        for what, number in gone.items()
        if number
    ]
    return HeatingCurve(time[~spiky], temperature[~spiky], place, lag_s, name, tuple(said))


def read_curve(path: str | Path, *, column: str | None = None) -> HeatingCurve:
    """Return the curve in a table with a time column and a temperature column (``time_s``, ``fluid_degC``).

    The column's name says where the thermometer sits (fluid, wall, body, coil); else it is the fluid.

    Parameters
    ----------
    column : name of the temperature's column, when there are several
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
    if column is not None:
        found = {name: values for name, values in found.items() if name == column}
    if time is None or len(found) != 1:
        has = ", ".join(table.names)
        raise InputError(
            f"has columns {has}",
            place=file.name,
            expected="time_s and one temperature, such as fluid_degC"
            + (" (name it by column)" if len(found) > 1 else ""),
        )
    ((name, temperature),) = found.items()
    word = name.split("_")[0].strip().lower()
    guessed: dict[str, Place] = {"wall": "wall", "body": "wall", "coil": "coil"}
    return clean_curve(time, temperature, place=guessed.get(word, "fluid"), name=file.name)


def lag_signal(time: FloatArray, values: FloatArray, lag_s: float | FloatArray) -> FloatArray:
    """Return what first order sensors show of signals that are straight between their samples.

    Parameters
    ----------
    time : rising [s], shape (n,)
    values : shape (n,) or (n, k); a sensor starts at the first
    lag_s : time constant [s], one, or one for each of k; 0 returns the values
    """
    if not np.any(lag_s):
        return values
    lag = np.maximum(lag_s, 1e-9)  # a sensor without lag among others
    steps = np.diff(time).reshape(-1, *([1] * (values.ndim - 1)))
    kept = np.exp(-steps / lag)
    # y1 = e y0 + (1 - e) x0 + slope (h - lag (1 - e)): exact for a straight line
    driven = (1.0 - kept) * values[:-1] + (1.0 - lag * (1.0 - kept) / steps) * np.diff(values, axis=0)
    shown = np.array(values, dtype=np.float64)
    for k in range(len(steps)):
        shown[k + 1] = kept[k] * shown[k] + driven[k]
    return shown


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
    """Return which samples stand alone, off both sides."""
    y, n = temperature, len(temperature)
    second = np.abs(y[2:] - 2.0 * y[1:-1] + y[:-2]) / math.sqrt(6.0)
    least = max(_SPIKE * _NORMAL * float(np.median(second)), _LEAST_SPIKE_K)
    before = y[np.maximum(np.arange(n)[:, None] - np.arange(1, _NEIGHBOURS + 1), 0)]
    after = y[np.minimum(np.arange(n)[:, None] + np.arange(1, _NEIGHBOURS + 1), n - 1)]
    off = np.array([y - np.median(side, axis=1) for side in (before, after)])
    apart = np.maximum(np.ptp(before, axis=1), np.ptp(after, axis=1))
    alone = (off[0] * off[1] > 0.0) & (np.abs(off).min(axis=0) > np.maximum(least, _APART * apart))
    alone[[0, -1]] = False  # with neighbours on one side only, nobody can say
    return np.asarray(alone)
