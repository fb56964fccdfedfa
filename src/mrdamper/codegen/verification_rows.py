"""What an export is run through before it leaves: the envelope, its edges, and readings that cannot be true.

Rows of inputs, a sample each, drawn from a seed: random motion, reversals of all sizes, motion and commands
beyond the data, temperature ramps, steps of command and target, and failing sensors. Every segment is a share
of the whole, so that a short run sees a little of everything. Nothing here knows the answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.codegen.target import Target
from mrdamper.excitation import Sine
from mrdamper.models.characteristics import settled_cycle

COLUMNS = ("displacement", "velocity", "current", "temperature", "wanted", "wanted_ahead", "force")
"""m, m/s, A or V, K, N, N (``preview`` later), N; NaN for an unknown value."""

_WARM_K = (233.15, 423.15)  # beyond which a temperature is a fault
_SINES = 12


@dataclass(frozen=True, slots=True)
class _Limits:
    """What a segment may go up to."""

    step: float
    stroke: float
    speed: float
    command: float
    force: float
    temperature: tuple[float, float]


_Segment = Callable[[_Limits, int, np.random.Generator], dict[str, FloatArray]]


def envelope_rows(target: Target, samples: int = 100_000, seed: int = 1) -> dict[str, FloatArray]:
    """Return the inputs of a run over a target's envelope and beyond, by name, each of shape (samples,).

    The same target, samples and seed give the same rows. ``velocity`` is not-a-number over half of them.
    """
    rng = np.random.default_rng(seed)
    limits = _limits_of(target)
    segments: tuple[tuple[float, _Segment], ...] = (
        (0.16, _random), (0.12, _reversing), (0.12, _beyond), (0.20, _warming), (0.12, _stepping),
        (0.20, _failing),
    )  # fmt: skip
    counts = [int(share * samples) for share, _ in segments]
    pieces = [make(limits, count, rng) for count, (_, make) in zip(counts, segments, strict=True)]
    pieces.append(_random(limits, samples - sum(counts), rng))  # what was not known is known again
    rows = {name: np.concatenate([piece[name] for piece in pieces]) for name in COLUMNS}
    rows["temperature"][:20] = np.nan  # no reading yet
    # Whether the velocity is known changes every now and then.
    known = np.repeat(rng.random(samples // 130 + 1) < 0.5, 130)[:samples]
    rows["velocity"] = np.where(known, rows["velocity"], np.nan)
    return rows


def _limits_of(target: Target) -> _Limits:
    envelope, axes = target.card.envelope, target.any_part.config.axes
    stroke = max(map(abs, envelope.displacement)) or 1e-3
    speed = max(map(abs, envelope.velocity)) or 1e-2
    within = max(min(map(abs, envelope.displacement)), 0.1 * stroke)  # on either side of the middle
    motion = Sine(within, speed / (2.0 * np.pi * within))
    strongest = settled_cycle(target.card.damper, motion, target.largest, axes.coldest)
    force = strongest.peak_N + 1.0
    warm = (axes.coldest - 12.0, axes.warmest + 12.0)
    warm = (max(warm[0], _WARM_K[0] + 1.0), min(warm[1], _WARM_K[1] - 1.0))
    return _Limits(target.period_s, stroke, speed, target.largest, force, warm)


def _drawn(rng: np.random.Generator, count: int, step: float, slowest: float, fastest: float) -> FloatArray:
    """Return a sum of sines, periods drawn between two [s], within -1 to 1."""
    t = step * np.arange(count)
    periods = np.exp(rng.uniform(np.log(slowest), np.log(fastest), _SINES))
    weight, phase = rng.random(_SINES), rng.uniform(0.0, 2.0 * np.pi, _SINES)
    waves = weight[:, None] * np.sin(2.0 * np.pi * t / periods[:, None] + phase[:, None])
    return np.asarray(waves.sum(axis=0) / weight.sum())


def _moving(limits: _Limits, count: int, rng: np.random.Generator, times: float = 1.0) -> FloatArray:
    """Return a random displacement with the envelope's stroke and about its speed [m]."""
    slow = 2.0 * np.pi * limits.stroke / limits.speed
    return times * limits.stroke * _drawn(rng, count, limits.step, 0.3 * slow, 3.0 * slow) * 2.0


def _rows(
    limits: _Limits,
    rng: np.random.Generator,
    displacement: FloatArray,
    *,
    current: FloatArray | None = None,
    temperature: FloatArray | None = None,
    wanted: FloatArray | None = None,
) -> dict[str, FloatArray]:
    """Complete a segment: what is not given is drawn."""
    count, step = len(displacement), limits.step
    low, high = limits.temperature
    t = step * np.arange(count)
    if current is None:
        current = 0.5 * limits.command * (1.0 + 1.2 * _drawn(rng, count, step, 0.02, 2.0))
    if temperature is None:
        middle = 0.5 * (low + high)
        temperature = middle + 2.0 * np.sin(0.3 * t) + 0.02 * rng.standard_normal(count)
    velocity = np.gradient(displacement, step) if count > 1 else np.zeros(count)
    if wanted is None:  # along the motion, as a damper can, and against it
        wanted = limits.force * _drawn(rng, count, step, 0.05, 2.0) * 2.0
        along = np.repeat(rng.random(count // 300 + 1) < 0.7, 300)[:count]
        wanted = np.where(along, np.copysign(wanted, velocity), wanted)
    ahead = np.concatenate([wanted[min(15, count) :], np.repeat(wanted[-1:], min(15, count))])
    ahead = np.where(np.repeat(rng.random(count // 300 + 1) < 0.3, 300)[:count], np.nan, ahead)
    measured = 0.8 * wanted + 5.0 * rng.standard_normal(count)
    values = (displacement, velocity, current, temperature, wanted, ahead, measured)
    return dict(zip(COLUMNS, values, strict=True))


def _random(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    noise = 1e-5 * rng.standard_normal(count)
    return _rows(limits, rng, _moving(limits, count, rng) + noise)


def _reversing(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Straight pieces of random length between turns: reversals from a micrometre to the stroke."""
    steps = np.empty(0)
    while len(steps) < count:
        speed = limits.speed * 10.0 ** rng.uniform(-3.0, 0.0) * (-1.0) ** rng.integers(2)
        steps = np.append(steps, np.full(rng.integers(1, 120), speed * limits.step))
    # Turned back at the stroke's ends: the path is folded, the reversals are sharp.
    path = np.cumsum(steps[:count])
    folded = np.abs((path + limits.stroke) % (4.0 * limits.stroke) - 2.0 * limits.stroke) - limits.stroke
    return _rows(limits, rng, folded)


def _beyond(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Motion, commands and targets past what the data cover; a thermometer that stands still meanwhile."""
    current = limits.command * (0.5 + 1.6 * _drawn(rng, count, limits.step, 0.05, 1.0))
    wanted = 4.0 * limits.force * np.sign(_drawn(rng, count, limits.step, 0.1, 1.0))
    still = np.full(count, 0.5 * sum(limits.temperature))
    moving = _moving(limits, count, rng, 2.5)
    return _rows(limits, rng, moving, current=current, temperature=still, wanted=wanted)


def _warming(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """From below the tables' coldest sheet to above their warmest, and back, as fast as is believed."""
    low, high = limits.temperature
    ramp = np.interp(np.arange(count), [0, 0.45 * count, 0.55 * count, count], [low, high, high, low])
    return _rows(limits, rng, _moving(limits, count, rng), temperature=ramp)


def _stepping(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Step command and target between ends and anywhere, at steady sines."""
    t = limits.step * np.arange(count)
    motion = limits.stroke * np.sin(limits.speed / limits.stroke * t)
    levels = np.array([0.0, 1.0, 0.5])

    def stepped(low: int, high: int) -> FloatArray:
        held = np.empty(0)
        while len(held) < count:
            level = rng.choice(levels) if rng.random() < 0.5 else rng.random()
            held = np.append(held, np.full(rng.integers(low, high), level))
        return held[:count]

    wanted = limits.force * (2.0 * stepped(20, 400) - 1.0)
    return _rows(limits, rng, motion, current=limits.command * stepped(5, 200), wanted=wanted)


def _failing(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Put in readings that cannot be true, each for a few samples and for long, alone and together."""
    rows = _rows(limits, rng, _moving(limits, count, rng))
    wrong = {
        "displacement": (np.nan, np.inf, -np.inf, 1e6, "frozen"),
        "velocity": (np.inf, -np.inf, 1e6),
        "current": (np.nan, np.inf, -np.inf, 1e6, -1e6),
        "temperature": (np.nan, np.inf, -np.inf, 20.0, 1e6, "jump"),
        "wanted": (np.nan, np.inf, -np.inf, 1e30),
        "wanted_ahead": (np.inf, -np.inf, 1e30),
        "force": (np.nan, np.inf, 1e30),
    }
    quarter = max(count // 4, 1)
    for name, faults in wrong.items():
        start = 0
        while start < 2 * quarter:
            start += int(rng.integers(40, 400))
            length = int(rng.choice([1, 3, 15, 60, 150]))
            _spoil(rows[name], start, length, faults[rng.integers(len(faults))])
            start += length
    # At 1 kHz and 1e5 samples long enough for the nominal temperature to be used.
    _spoil(rows["temperature"], int(0.45 * count), int(0.54 * count), np.nan)
    _spoil(rows["displacement"], 3 * quarter, 200, "frozen")
    return rows


def _spoil(values: FloatArray, start: int, length: int, fault: float | str) -> None:
    part = slice(start, min(start + length, len(values)))
    if part.start >= len(values):
        return
    if fault == "frozen":
        values[part] = values[part.start]
    elif fault == "jump":
        values[part] += 40.0
    else:
        values[part] = fault
