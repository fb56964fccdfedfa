"""Ticks of axes: a few round numbers inside the limits, and how they are written."""

from __future__ import annotations

import math
from collections.abc import Sequence

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_PLAIN = (-3, 5)  # powers of ten between which numbers are written out
_MOST_LOG = 8


def nice_ticks(ends: tuple[float, float], few: int) -> list[float]:
    """Return multiples of 1, 2, 2.5 or 5 x 10^n inside the limits, in at most ``few`` steps."""
    low, high = ends
    if not high > low or not math.isfinite(high - low):
        return [low]
    size = 10.0 ** math.floor(math.log10((high - low) / few))
    step = next((each * size for each in _STEPS if each * size * few >= high - low), 10.0 * size)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def log_ticks(low: float, high: float) -> list[float]:
    """Return 1-2-5 ticks of a logarithmic axis; powers of ten where those are too many."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [m * 10.0**d for d in decades for m in (1, 2, 5) if low <= m * 10.0**d <= high]
    tens = [t for t in ticks if abs(math.log10(t) - round(math.log10(t))) < 1e-9]
    return ticks if len(ticks) <= _MOST_LOG else tens


def labels_of(ticks: Sequence[float]) -> tuple[list[str], str]:
    """Return ticks as texts with the same number of decimals, and the power of ten that they count."""
    largest = max((abs(tick) for tick in ticks), default=0.0)
    power = math.floor(math.log10(largest)) if largest > 0.0 else 0
    power = 0 if _PLAIN[0] < power < _PLAIN[1] else power
    scaled = [tick / 10.0**power for tick in ticks]
    decimals = next(
        (k for k in range(9) if all(abs(each - round(each, k)) < 1e-6 * max(largest / 10.0**power, 1e-12)
                                    for each in scaled)), 9)  # fmt: skip
    texts = [f"{each:.{decimals}f}".replace("-", "−") for each in scaled]
    return [text.lstrip("−") if not float(text.replace("−", "-")) else text for text in texts], (
        f"1e{power}".replace("-", "−") if power else ""
    )
