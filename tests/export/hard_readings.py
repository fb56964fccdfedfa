"""Controllers and difficult sensor readings for the tests on a microcontroller.

The readings contain many reversals, infeasible targets, temperatures inside and outside the range of the
card, and sensor faults.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.models.damper import Damper
from tests.support.cards import CHAIN, DAMPERS, LAGS, SERIES

__all__ = ["CARD_RANGE_K", "SHOWN", "Shown", "dampers", "readings"]

SAMPLES = 100_000
CARD_RANGE_K = (293.15, 396.15)
"""Temperatures of a card that is identified from 20 to 123 degC."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A controller with an optimisation level, and limits of instructions per step, code and stack size."""

    controller: str
    damper: str
    optimised: str
    most: int | None = None
    most_code: int = 12  # Limit of the code size [kB]
    most_stack: int = 1024  # Limit of the stack size [bytes]

    def made(self) -> ForceController:
        return controllers_for(dampers()[self.damper])[self.controller]


SHOWN = (
    Shown("paper", "bouc-wen", "-O3", 2400, 10),
    Shown("paper", "bouc-wen", "-O2"),
    Shown("paper", "double-bouc-wen", "-O3"),
    Shown("recommended", "bouc-wen", "-O2", 12_000),
    Shown("recommended", "double-bouc-wen", "-O2", 12_000),
    Shown("recommended", "bouc-wen-saturating", "-O2", 12_000),
    Shown("recommended-observer", "double-bouc-wen", "-O2"),
    Shown("recommended", "series-valve", "-O2", 12_000, most_code=16),
    Shown("recommended", "series-valve", "-O3", most_code=24),
    Shown("recommended-observer", "series-valve", "-O2", most_code=16),
    Shown("recommended", "chain", "-O2", 12_000, most_code=16),
    Shown("recommended", "chain, iron that saturates", "-O2", 12_000, most_code=16),
)
"""Measured controllers. With ``-O3``, the compiler unrolls loops, which needs up to 50 % more code."""


def dampers() -> dict[str, Damper]:
    """Return dampers for the range 20 to 123 degC, with the names of their hysteresis laws as keys."""
    every = DAMPERS | {"series-valve": SERIES, "chain": CHAIN}
    made = {name: replace(damper, temperature_range=CARD_RANGE_K) for name, damper in every.items()}
    iron = replace(
        LAGS, freewheel_time_s=0.03, saturation=1.5, hysteresis_width_A=0.02, wide_hysteresis_width_A=0.08
    )
    saturates = replace(made["chain"], actuation=iron)
    return made | {"chain, iron that saturates": saturates}


def readings(controller: ForceController, samples: int = SAMPLES, *, seed: int = 1) -> FloatArray:
    """Return input rows of shape (samples, 5): target, previewed target, displacement, temperature and force.

    The random motion (up to 0.3 m/s) has rests, vibrations and jumps. The target force is too large in a
    fifth of the time and opposite to the velocity in another fifth. The temperature covers the whole range.
    In some intervals, readings are NaN, infinite or constant.
    """
    rng, h = np.random.default_rng(seed), controller.period_s
    t = h * np.arange(samples)
    slow = np.zeros(samples)
    for hertz, size in ((0.7, 6e-3), (2.3, 3e-3), (6.1, 1e-3), (11.0, 3e-4)):
        drift = np.cumsum(rng.standard_normal(samples)) * 0.02
        slow += size * np.sin(2.0 * np.pi * hertz * t + drift)
    envelope = 0.5 + 0.5 * np.tanh(3.0 * np.sin(2.0 * np.pi * t / 7.0))
    x = slow * envelope + 1e-5 * rng.standard_normal(samples)
    x += np.where(np.sin(2.0 * np.pi * t / 11.0) > 0.9, 2e-4 * np.sin(2.0 * np.pi * 45.0 * t), 0.0)
    speed = np.gradient(lfilter([0.2], [1.0, -0.8], x), h)
    amplitude = np.repeat(rng.choice([300.0, 900.0, 1400.0, 3000.0, -600.0], samples // 500 + 1), 500)[
        :samples
    ]
    wanted = amplitude * np.tanh(speed / 0.02)
    low, high = CARD_RANGE_K
    ramp = 0.5 * (low + high) + 0.55 * (high - low) * np.sin(2.0 * np.pi * t / 40.0)
    rows = np.column_stack(
        [wanted, np.roll(wanted, -round(controller.config.inverse.preview / h)), x, ramp, 0.9 * wanted]
    )
    rows[:, 3] += 0.3 * rng.standard_normal(samples)
    if not controller.known_ahead:
        rows[:, 1] = np.nan
    for begin in range(3000, samples, 9000):
        column, value = int(rng.integers(5)), float(rng.choice([np.nan, np.inf, -np.inf, 1e6]))
        rows[begin : begin + int(rng.integers(1, 120)), column] = value
        still = slice(begin + 4000, begin + 4000 + int(rng.integers(20, 200)))
        rows[still, 2] = rows[min(begin + 4000, samples - 1), 2]
        rows[begin + 6000 : begin + 6100, 3] += 40.0
    return rows
