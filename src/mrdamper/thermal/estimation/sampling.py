"""Answers from dampers that were drawn: even draws, when each reaches a limit, intervals.

What is drawn, and by which model it is run, is the business of ``uncertainty`` (a network that may be off
its drawing) and ``prediction`` (a damper nobody has drawn).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.quantities import to_degC


@dataclass(frozen=True, slots=True)
class TimeToLimit:
    """When a temperature is reached; ``math.inf`` is "not reached" (within the time looked at)."""

    limit_K: float
    median_s: float
    low_s: float  # with ``high_s``, holds the true time with the asked probability
    high_s: float
    not_reached: float  # probability that it is not reached within ``looked_s`` [-]
    looked_s: float

    def __str__(self) -> str:
        spelled = [
            f"{time / 60.0:.1f} min" if math.isfinite(time) else "not reached"
            for time in (self.median_s, self.low_s, self.high_s)
        ]
        return (
            f"{to_degC(self.limit_K):.4g} degC: {spelled[0]} ({spelled[1]} to {spelled[2]}; not reached "
            f"within {self.looked_s / 60.0:.0f} min: {100.0 * self.not_reached:.0f} %)"
        )


def draw_evenly(rng: np.random.Generator, rows: int, columns: int, least: int | None = None) -> FloatArray:
    """Return normal numbers, shape (rows, columns), with means 0 and covariance 1 as far as columns allow.

    Each column has its opposite (so the means), and rows are made orthogonal: all, or with few columns the
    last ``least``. What is left to chance is then hardly the middle or the width of an answer.
    """
    half = rng.standard_normal((rows, (columns + 1) // 2))
    count = half.shape[1]
    chosen = slice(0 if count > rows or least is None else rows - least, rows)
    if count > rows - chosen.start:
        turned, triangle = np.linalg.qr(half[chosen].T)
        half[chosen] = (turned * np.sign(np.diag(triangle))).T * math.sqrt(count)
    return np.hstack([half, -half])[:, :columns]


def interval_of(values: FloatArray, probability: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return median, low and high end over the last axis of finite values."""
    tail = 0.5 * (1.0 - probability)
    low, middle, high = np.quantile(values, (tail, 0.5, 1.0 - tail), axis=-1)
    return np.asarray(middle), np.asarray(low), np.asarray(high)


def first_crossing(time: FloatArray, values: FloatArray, limit: float) -> FloatArray:
    """Return when [s] each column, shape (t, k), first is at the limit or above; infinity: never."""
    above = values >= limit
    k = above.argmax(axis=0)
    column = np.arange(values.shape[1])
    before = np.maximum(k - 1, 0)
    low, high = values[before, column], values[k, column]
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(high > low, (limit - low) / (high - low), 0.0)
    when = time[before] + part * (time[k] - time[before])
    return np.where(above.any(axis=0), np.where(k == 0, time[0], when), np.inf)


def summarise_times(when: FloatArray, limit_K: float, probability: float, look_s: float) -> TimeToLimit:
    """Return median, interval and the share of "not reached" of times, infinity among them."""
    tail = 0.5 * (1.0 - probability)
    low, middle, high = (float(q) for q in np.quantile(when, (tail, 0.5, 1.0 - tail), method="nearest"))
    return TimeToLimit(limit_K, middle, low, high, float(np.isinf(when).mean()), look_s)
