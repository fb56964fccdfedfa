"""Generate random inputs for the verification of an export, inside and outside the envelope of the card.

The inputs consist of segments: random motion; sharp reversals with sudden changes of command and target;
values outside the envelope; failing sensors. The length of a segment is a fraction of all samples. Therefore
a short verification contains every segment as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.codegen.target import Target
from mrdamper.excitation import Sine
from mrdamper.models.characteristics import steady_cycle

COLUMNS = ("displacement", "velocity", "current", "temperature", "wanted", "wanted_ahead", "force")
"""Names of the inputs. Their units are m, m/s, A or V, K, N, N, N.

``wanted`` is the target force now, and ``wanted_ahead`` the target force after the preview time of the
controller. NaN means that an input is unknown.
"""


@dataclass(frozen=True, slots=True)
class _Limits:
    """Time step [s] and limits of motion, command, force and temperature for the inputs."""

    step: float
    stroke: float
    speed: float
    command: float
    force: float
    temperature: tuple[float, float]


_Segment = Callable[[_Limits, int, np.random.Generator], dict[str, FloatArray]]


def envelope_rows(target: Target, samples: int = 100_000, seed: int = 1) -> dict[str, FloatArray]:
    """Return the inputs of a verification by name, each of shape (samples,).

    The values are inside and outside the envelope of the target. The same arguments give the same inputs.
    ``velocity`` is NaN (unknown) in half of the samples.
    """
    rng = np.random.default_rng(seed)
    limits = _limits_of(target)
    segments: tuple[tuple[float, _Segment], ...] = (
        (0.2, _random_segment), (0.2, _reversing_segment), (0.3, _outside_segment), (0.2, _failing_segment),
    )  # fmt: skip
    counts = [int(fraction * samples) for fraction, _ in segments]
    pieces = [make(limits, count, rng) for count, (_, make) in zip(counts, segments, strict=True)]
    # All readings are valid again in the last segment.
    pieces.append(_random_segment(limits, samples - sum(counts), rng))
    rows = {name: np.concatenate([piece[name] for piece in pieces]) for name in COLUMNS}
    rows["temperature"][:20] = np.nan  # Begin without a temperature reading.
    velocity_known = np.repeat(rng.random(samples // 130 + 1) < 0.5, 130)[:samples]
    rows["velocity"][~velocity_known] = np.nan
    return rows


def replay_columns(target: Target) -> dict[str, str]:
    """Return the name of each input's column in the CSV file of the replay program."""
    both = {"displacement": "displacement_m", "temperature": "temperature_K"}
    model = {"velocity": "velocity_m_s", "current": command_column(target)}
    controller = {
        "wanted": "wanted_N", "wanted_ahead": "wanted_ahead_N", "force": "force_N",
    }  # fmt: skip
    return {
        **both,
        **(model if target.model is not None else {}),
        **(controller if target.controller is not None else {}),
    }


def replay_outputs(target: Target) -> dict[str, dict[str, str]]:
    """Return, for each part, the name of each output's column in the CSV file of the replay program."""
    columns = {
        "model": {"force": "force_N", "applied": f"applied_{target.command_unit}", "flags": "model_flags"},
        "controller": {
            "current": command_column(target), "force": "controller_force_N", "flags": "controller_flags",
        },
    }  # fmt: skip
    return {part: columns[part] for part in target.parts}


def command_column(target: Target) -> str:
    """Return the name of the CSV column with the command."""
    return "current_A" if target.command_unit == "A" else "voltage_V"


def _limits_of(target: Target) -> _Limits:
    valid_temperature_K = (233.15, 423.15)  # Temperatures outside this range are faults.
    envelope, axes = target.card.envelope, target.any_part.config.axes
    stroke = max(map(abs, envelope.displacement)) or 1e-3
    speed = max(map(abs, envelope.velocity)) or 1e-2
    # amplitude [m] inside both stroke limits
    within = max(min(map(abs, envelope.displacement)), 0.1 * stroke)
    motion = Sine(within, speed / (2.0 * np.pi * within))
    strongest = steady_cycle(target.card.damper, motion, target.largest, axes.coldest)
    force = strongest.peak_N + 1.0
    low, high = valid_temperature_K
    temperature = (max(axes.coldest - 12.0, low + 1.0), min(axes.warmest + 12.0, high - 1.0))
    return _Limits(target.period_s, stroke, speed, target.largest, force, temperature)


def _noise(rng: np.random.Generator, count: int, step: float, slowest: float, fastest: float) -> FloatArray:
    """Return a sum of sines with random periods [s] from ``fastest`` to ``slowest``.

    The values are within -1 to 1.
    """
    sine_count = 12
    t = step * np.arange(count)
    periods = np.exp(rng.uniform(np.log(slowest), np.log(fastest), sine_count))
    weight, phase = rng.random(sine_count), rng.uniform(0.0, 2.0 * np.pi, sine_count)
    waves = weight[:, None] * np.sin(2.0 * np.pi * t / periods[:, None] + phase[:, None])
    return np.asarray(waves.sum(axis=0) / weight.sum())


def _moving(limits: _Limits, count: int, rng: np.random.Generator, times: float = 1.0) -> FloatArray:
    """Return a random displacement [m] with the stroke and roughly the speed in ``limits``.

    The result is multiplied by ``times``.
    """
    slow = 2.0 * np.pi * limits.stroke / limits.speed
    return times * limits.stroke * _noise(rng, count, limits.step, 0.3 * slow, 3.0 * slow) * 2.0


def _rows(
    limits: _Limits,
    rng: np.random.Generator,
    displacement: FloatArray,
    *,
    current: FloatArray | None = None,
    temperature: FloatArray | None = None,
    wanted: FloatArray | None = None,
) -> dict[str, FloatArray]:
    """Return all inputs of a segment, by name; inputs that are not given are random."""
    count, step = len(displacement), limits.step
    low, high = limits.temperature
    t = step * np.arange(count)
    if current is None:
        current = 0.5 * limits.command * (1.0 + 1.2 * _noise(rng, count, step, 0.02, 2.0))
    if temperature is None:
        middle = 0.5 * (low + high)
        temperature = middle + 2.0 * np.sin(0.3 * t) + 0.02 * rng.standard_normal(count)
    velocity = np.gradient(displacement, step) if count > 1 else np.zeros(count)
    if wanted is None:  # Most targets resist the motion, so that a damper can produce them.
        wanted = limits.force * _noise(rng, count, step, 0.05, 2.0) * 2.0
        along = np.repeat(rng.random(count // 300 + 1) < 0.7, 300)[:count]
        wanted = np.where(along, np.copysign(wanted, velocity), wanted)
    ahead = np.concatenate([wanted[min(15, count) :], np.repeat(wanted[-1:], min(15, count))])
    ahead = np.where(np.repeat(rng.random(count // 300 + 1) < 0.3, 300)[:count], np.nan, ahead)
    measured = 0.8 * wanted + 5.0 * rng.standard_normal(count)
    values = (displacement, velocity, current, temperature, wanted, ahead, measured)
    return dict(zip(COLUMNS, values, strict=True))


def _random_segment(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    noise = 1e-5 * rng.standard_normal(count)
    return _rows(limits, rng, _moving(limits, count, rng) + noise)


def _reversing_segment(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    def random_steps(shortest: int, longest: int) -> FloatArray:
        lengths = rng.integers(shortest, longest, count // shortest + 1)
        levels = rng.choice([0.0, 0.5, 1.0, *rng.random(3)], len(lengths))
        return np.asarray(np.repeat(levels, lengths)[:count])

    speed = (
        limits.speed * 10.0 ** (-3.0 * random_steps(1, 120)) * np.where(random_steps(1, 120) < 0.5, -1.0, 1.0)
    )
    # Reflect the path at the ends of the stroke.
    path = np.cumsum(speed * limits.step)
    folded = np.abs((path + limits.stroke) % (4.0 * limits.stroke) - 2.0 * limits.stroke) - limits.stroke
    wanted = limits.force * (2.0 * random_steps(20, 400) - 1.0)
    return _rows(limits, rng, folded, current=limits.command * random_steps(5, 200), wanted=wanted)


def _outside_segment(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    current = limits.command * (0.5 + 1.6 * _noise(rng, count, limits.step, 0.05, 1.0))
    wanted = 4.0 * limits.force * np.sign(_noise(rng, count, limits.step, 0.1, 1.0))
    low, high = limits.temperature
    ramp = np.interp(
        np.arange(count) / max(count, 1), [0.4, 0.41, 0.7, 1.0], [0.5 * (low + high), low, high, low]
    )
    moving = _moving(limits, count, rng, 2.5)
    return _rows(limits, rng, moving, current=current, temperature=ramp, wanted=wanted)


def _failing_segment(limits: _Limits, count: int, rng: np.random.Generator) -> dict[str, FloatArray]:
    rows = _rows(limits, rng, _moving(limits, count, rng))
    for name in COLUMNS:
        start = 0
        while start < count // 2:
            start += int(rng.integers(40, 400))
            length = int(rng.choice([1, 3, 15, 60, 150]))
            rows[name][start : start + length] = rng.choice([np.nan, np.inf, -np.inf, 1e6, -1e6, 330.0])
            start += length
    # If there are 1e5 samples at 1 kHz, these faults last long enough that the controller changes to the
    # nominal temperature and detects the stuck displacement sensor.
    temperature, displacement = (rows[name] for name in ("temperature", "displacement"))
    temperature[int(0.5 * count) : int(0.95 * count)] = np.nan
    temperature[int(0.45 * count) : int(0.46 * count)] += 40.0
    displacement[int(0.7 * count) : int(0.72 * count)] = displacement[int(0.7 * count)]
    return rows
