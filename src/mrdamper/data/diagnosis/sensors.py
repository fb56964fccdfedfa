"""Findings on single channels: clipped, stuck, coarse, with spikes, or of a size that no damper has."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.diagnosis.timing import channels_of
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording
from mrdamper.quantities import QUANTITIES

_MEASURED = ("displacement", "force", "velocity")
_FLAT = 3  # samples in a row at the very extreme
_CROWDED = 8.0  # the extreme level holds so many times the samples of the levels below it
_LEVELS = 4  # below the extreme, for comparison
_LEAST_AT_EXTREME = 8  # samples at the extreme
_MUCH = 0.01  # of the samples at an extreme: a fault

_ROUNDING = math.sqrt(12.0)  # of a step is its standard error
_COARSE, _VERY_COARSE = 0.01, 0.03  # rounding error as a share of the channel's standard deviation
_GRID = 0.8  # of the distances between neighbouring values are the resolution, twice or three times it

_STUCK = 20  # samples in a row
_MOVES = 0.15  # of the other channel's range, meanwhile
_LONGER = 5.0  # than the usual longest segment of equal values

_ONE_STEP = 1.5  # of the resolution: a neighbouring level, with room for rounding

_SPIKE = 0.1  # of the range that all but a few samples keep to
_ABOVE_NOISE = 30.0
_FEWEST = 100  # samples in which one may be a spike


def find_implausible_sizes(recording: Recording) -> Iterator[Finding]:
    """Yield channels beyond the range of a damper on a rig."""
    for role, values in channels_of(recording).items():
        quantity = QUANTITIES[role]
        outside = np.flatnonzero(~((values >= quantity.low) & (values <= quantity.high)))
        if len(outside):
            k, few = int(outside[0]), len(outside) < 0.01 * len(values)
            worst = float(values[outside][np.argmax(np.abs(values[outside]))])
            yield Finding(
                kind="outliers" if few else "implausible_size",
                severity="fault",
                channel=role,
                size=worst,
                unit=quantity.unit,
                from_s=float(recording.time[k]),
                to_s=float(recording.time[outside[-1]]),
                found=f"{role} is {worst:.4g} {quantity.unit} at worst, beyond {quantity.low:g} to "
                f"{quantity.high:g} {quantity.unit} at {len(outside)} samples, the first at sample {k}",
                effect="A single such sample outweighs the rest of the run in a fit",
                remedy="Cut the samples out of the file, or repair the sensor's wiring"
                if few
                else "Check the column's unit and gain in the channel map",
            )


def find_clipping(recording: Recording) -> Iterator[Finding]:
    """Give channels that stay at exactly their largest or smallest value, far more often than near it.

    The level at the extreme is compared with the four below it, which a smooth signal visits nearly as often.
    A segment counts when the signal comes to it at speed, so that a turn of a coarsely measured sine is none.
    """
    for role, values in _moving(recording):
        counts = np.unique(values, return_counts=True)[1]
        for side, folded, often in (("upper", values, counts[::-1]), ("lower", -values, counts)):
            at_top = folded == folded.max()
            below = float(np.mean(often[1 : 1 + _LEVELS]))
            segments = [
                (a, b) for a, b in _segments(at_top) if b - a >= _FLAT and _comes_at_speed(folded, a, b)
            ]
            if not segments or sum(b - a for a, b in segments) < max(_LEAST_AT_EXTREME, _CROWDED * below):
                continue
            count = int(np.count_nonzero(at_top))
            share = count / len(values)
            unit = QUANTITIES[role].unit
            yield Finding(
                kind="clipped",
                severity="fault" if share > _MUCH else "warning",
                channel=role,
                size=100.0 * share,
                unit="%",
                from_s=float(recording.time[segments[0][0]]),
                to_s=float(recording.time[segments[-1][1] - 1]),
                found=f"{role} stays at its {side} end of {values[segments[0][0]]:.5g} {unit} for "
                f"{count} samples ({percent(share)}) in {len(segments)} segments: clipped",
                effect="Peak forces, viscosity and yield force come out too small"
                if role == "force"
                else "Velocity is zero where the damper moves, and the law is driven wrongly",
                remedy="Set the amplifier's range larger and record again; leave the run out until then",
            )


def find_stuck_sensors(recording: Recording) -> Iterator[Finding]:
    """Give segments in which one channel keeps one value while the other goes on."""
    x, force = recording.displacement, recording.force
    for role, values, other in (("force", force, x), ("displacement", x, force)):
        segments = sorted(_segments(np.append(np.diff(values) == 0.0, False)), key=lambda s: s[0] - s[1])
        least, near, steps = _least_stuck(segments), _ONE_STEP * _coarse_step(values), _steps(values)
        moved = float(np.ptp(other))
        for a, b in segments:
            if b - a < least:
                break
            if max(steps[a], steps[b + 1]) <= near:
                continue  # a slow motion between two levels of the converter
            share = _MOVES if role == "force" else 0.5  # a held displacement may let the force relax
            if np.ptp(other[a : b + 1]) < share * moved:
                continue
            yield Finding(
                kind="stuck_sensor",
                severity="fault",
                channel=role,
                size=float(recording.time[b] - recording.time[a]),
                unit="s",
                from_s=float(recording.time[a]),
                to_s=float(recording.time[b]),
                found=f"{role} keeps {values[a]:.5g} {QUANTITIES[role].unit} from "
                f"{recording.time[a]:.4g} s to {recording.time[b]:.4g} s while the other channel goes "
                "on: a stuck sensor or a lost connection",
                effect="The loop has a segment that no law can follow, and all coefficients bend towards it",
                remedy="Cut the run before that place (from_s, to_s of the preparation), or record it again",
            )
            break


def _coarse_step(values: FloatArray) -> float:
    """Return the resolution of a channel whose rounding error is coarse beside its spread, else 0."""
    resolution = resolution_of(values)
    return resolution if resolution / _ROUNDING > _COARSE * float(np.std(values)) else 0.0


def find_coarse_steps(recording: Recording) -> Iterator[Finding]:
    """Give channels whose resolution is coarse beside what they measure."""
    for role, values in _moving(recording):
        resolution = _coarse_step(values)
        if not resolution:
            continue
        error = resolution / _ROUNDING / float(np.std(values))
        unit = QUANTITIES[role].unit
        shown, factor = (unit, 1.0) if role == "force" else (f"m{unit}", 1e3)
        yield Finding(
            kind="coarse_steps",
            severity="warning" if error > _VERY_COARSE else "note",
            channel=role,
            size=resolution,
            unit=unit,
            found=f"{role} has steps of {factor * resolution:.3g} {shown}: "
            f"{round(float(np.ptp(values)) / resolution) + 1} levels over the run",
            effect=f"No model can come closer than {percent(error)} of the force's spread"
            if role == "force"
            else "Steps of the displacement become jumps of the velocity; smoothing takes out what it can",
            remedy="Use more of the converter's range (a smaller range, a larger gain)",
        )


def find_spikes(recording: Recording) -> Iterator[Finding]:
    """Give single samples far from both neighbours."""
    for role, values in _moving(recording):
        if len(values) < _FEWEST:
            continue
        before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
        away = np.minimum(np.abs(before), np.sign(before) * after)
        low, high = np.quantile(values, (0.005, 0.995))
        bad = np.flatnonzero(away > max(_SPIKE * (high - low), _ABOVE_NOISE * white_noise(values))) + 1
        if not len(bad) or len(bad) > len(values) / _FEWEST:
            continue
        worst = int(bad[np.argmax(away[bad - 1])])
        unit = QUANTITIES[role].unit
        yield Finding(
            kind="spikes",
            channel=role,
            size=float(away[worst - 1]),
            unit=unit,
            from_s=float(recording.time[bad[0]]),
            to_s=float(recording.time[bad[-1]]),
            found=f"{role} has {len(bad)} spike{'s' if len(bad) > 1 else ''}, the largest of "
            f"{away[worst - 1]:.3g} {unit} at {recording.time[worst]:.4g} s",
            effect="Squared errors give a spike far more weight than a sample",
            remedy="Cut the samples out, and look for a loose plug or a switching device nearby",
        )


def resolution_of(values: FloatArray) -> float:
    """Return the step of a channel that keeps to a grid, 0 when it does not."""
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > 0.5 * len(values):
        return 0.0
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * np.ptp(levels)]  # what is less is one level, rounded twice
    resolution = float(np.median(apart))
    multiples = apart / resolution
    nearest = np.round(multiples)
    regular = (np.abs(multiples - nearest) < 0.1) & (nearest >= 1.0) & (nearest <= 3.0)
    return resolution if np.count_nonzero(regular) >= _GRID * len(apart) else 0.0


def _segments(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return the segments of flags that are set, each as (first, one after the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def _moving(recording: Recording) -> Iterator[tuple[str, FloatArray]]:
    """Give the measured channels that are not one number throughout."""
    for role, values in channels_of(recording).items():
        if role in _MEASURED and np.ptp(values) > 0.0:
            yield role, values


def _steps(values: FloatArray) -> FloatArray:
    """Return by how much a signal changes before each sample, shape (n + 1,); 0 at either end."""
    return np.abs(np.diff(values, prepend=values[:1], append=values[-1:]))


def _comes_at_speed(values: FloatArray, a: int, b: int) -> bool:
    """Tell whether the signal reaches a segment with a slope, or leaves it so, as a turn does not."""
    steps, usual = _steps(values), float(np.sqrt(np.mean(np.diff(values) ** 2)))
    return a > 0 and b < len(values) and max(steps[a], steps[b]) > 0.05 * usual


def _least_stuck(segments: list[tuple[int, int]]) -> float:
    """Return how many steps of no change are too many; five segments tell what is usual."""
    if len(segments) < 5:
        return _STUCK
    return max(_STUCK, _LONGER * float(np.quantile([b - a for a, b in segments], 0.9)))
