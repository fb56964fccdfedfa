"""Mechanical power of a damper as a function of temperature.

The damper model of the model card simulates force-displacement loops at several temperatures. Mean power and
peak force of the loops are tabulated. Between these temperatures, power and peak force are interpolated by
monotone piecewise cubic Hermite interpolation (Fritsch and Carlson). The thermal simulation uses the table
instead of the damper model. The mean power is sufficient because the fluid temperature changes by less than
0.1 K in a cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray, read_only
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.duty import Segment
from mrdamper.thermal.settings import SETTINGS


@dataclass(frozen=True, slots=True, eq=False)
class LoopWork:
    """Mean power and peak force versus temperature, for one motion and one command.

    Outside the range of temperatures, power and peak force are constant.
    """

    temperature: FloatArray  # [K], shape (k,), rising
    power: FloatArray  # mean mechanical power [W], shape (k,)
    peak: FloatArray  # maximum absolute force [N], shape (k,)

    def __post_init__(self) -> None:
        for name in ("temperature", "power", "peak"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def constant(self) -> bool:
        """Return True if power and peak force are known at only one temperature."""
        return len(self.temperature) == 1

    def power_at(self, temperature_K: ArrayLike) -> FloatArray:
        """Return the mean power [W] at temperatures [K] of any shape; the result has the same shape."""
        return self._interpolate(self.power, temperature_K)

    def peak_at(self, temperature_K: ArrayLike) -> FloatArray:
        """Return the peak force [N] at temperatures [K] of any shape; the result has the same shape."""
        return self._interpolate(self.peak, temperature_K)

    def _interpolate(self, values: FloatArray, temperature_K: ArrayLike) -> FloatArray:
        kelvin = np.asarray(temperature_K, dtype=np.float64)
        if self.constant:
            return np.full(kelvin.shape, values[0])
        held = np.clip(kelvin, self.temperature[0], self.temperature[-1])
        return np.asarray(PchipInterpolator(self.temperature, values)(held))


def tabulate_work(damper: Damper, segment: Segment, *, temperature_K: FloatArray | None = None) -> LoopWork:
    """Tabulate mean power and peak force of a damper in one segment of a load cycle.

    Parameters
    ----------
    temperature_K : temperatures of the simulated loops; None: 20 degC and 11 temperatures between 0 and
            150 degC, within the range of the damper model; only 20 degC if it ignores temperature
    """
    at = _temperatures(damper) if temperature_K is None else np.asarray(temperature_K, dtype=np.float64)
    if segment.path is None:
        return LoopWork(at, np.zeros_like(at), np.zeros_like(at))
    path, first = segment.path, segment.counted_from
    x = path.displacement[first:]
    power, peak = np.empty_like(at), np.empty_like(at)
    for k, kelvin in enumerate(at):
        warm = replace(path, temperature=np.full(len(path), kelvin))
        force = simulate(damper, warm)[first:]
        taken = 0.5 * (force[1:] + force[:-1]) * np.diff(x)
        power[k] = taken.sum() / (path.step * len(taken))
        peak[k] = np.abs(force).max()
    return LoopWork(at, power, peak)


def _temperatures(damper: Damper) -> FloatArray:
    if not damper.temperature_dependent:
        return np.array([REFERENCE_K])
    low, high = SETTINGS.loss_temperature_range_K
    if damper.temperature_range is not None:
        low, high = max(low, damper.temperature_range[0]), min(high, damper.temperature_range[1])
    if not low < high:
        middle = 0.5 * sum(damper.temperature_range or SETTINGS.loss_temperature_range_K)
        return np.array([middle])
    found = np.linspace(low, high, SETTINGS.loss_temperature_count)
    if low < REFERENCE_K < high and not math.isclose(float(np.abs(found - REFERENCE_K).min()), 0.0):
        found = np.sort(np.append(found, REFERENCE_K))
    return found
