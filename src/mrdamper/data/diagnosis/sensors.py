"""Findings on single channels: clipping, stuck values, coarse resolution, spikes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording, channels_of
from mrdamper.quantities import QUANTITIES

_MEASURED = ("displacement", "force", "velocity")

STEP_RATIO = math.sqrt(12.0)  # rounding step / standard deviation of the rounding error


def find_clipping(recording: Recording) -> Iterator[Finding]:
    """Generate findings on clipped channels: far more samples have the extreme value than the next values.

    The number of samples with the extreme value is compared with the mean number at the next four values. A
    smooth signal reaches these values nearly as often. Consecutive extreme values count only if the signal
    has a slope just before or after them, unlike a coarsely quantised sine at a reversal.
    """
    for role, values in _varying_channels(recording):
        counts = np.unique(values, return_counts=True)[1]
        for side, folded, often in (("upper", values, counts[::-1]), ("lower", -values, counts)):
            at_top = folded == folded.max()
            below = float(np.mean(often[1 : 1 + SETTINGS.clipped_level_count]))
            segments = [
                (a, b)
                for a, b in _segments(at_top)
                if b - a >= SETTINGS.clipped_segment_samples_min and _has_slope(folded, a, b)
            ]
            least = max(SETTINGS.clipped_samples_min, SETTINGS.clipped_count_ratio_min * below)
            if not segments or sum(b - a for a, b in segments) < least:
                continue
            count = int(np.count_nonzero(at_top))
            share = count / len(values)
            unit = QUANTITIES[role].unit
            yield Finding(
                kind="clipped",
                severity="fault" if share > SETTINGS.clipped_ratio_max else "warning",
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
    """Generate findings on a constant force or displacement while the other changes."""
    x, force = recording.displacement, recording.force
    for role, values, other in (("force", force, x), ("displacement", x, force)):
        segments = sorted(_segments(np.append(np.diff(values) == 0.0, False)), key=lambda s: s[0] - s[1])
        least, steps = _stuck_length(segments), _steps(values)
        near = SETTINGS.stuck_level_max_steps * _coarse_step(values)
        moved = float(np.ptp(other))
        for a, b in segments:
            if b - a < least:
                break
            if max(steps[a], steps[b + 1]) <= near:
                continue  # A slow signal stays within one step of the converter.
            # The force of a damper at rest may relax. Therefore a larger change of the force is required.
            share = SETTINGS.stuck_motion_ratio_min if role == "force" else 0.5
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
                effect="The loop has a segment that no law can follow, and all coefficients become biased",
                remedy="Cut the run before that place (from_s, to_s of the preparation), or record it again",
            )
            break


def _coarse_step(values: FloatArray) -> float:
    """Return a channel's resolution, 0 if it is fine relative to the standard deviation."""
    resolution = resolution_of(values)
    return resolution if resolution / STEP_RATIO > SETTINGS.coarse_note_ratio * float(np.std(values)) else 0.0


def find_coarse_steps(recording: Recording) -> Iterator[Finding]:
    """Generate findings on channels whose resolution is coarse relative to the variation of the values."""
    for role, values in _varying_channels(recording):
        resolution = _coarse_step(values)
        if not resolution:
            continue
        error = resolution / STEP_RATIO / float(np.std(values))
        unit = QUANTITIES[role].unit
        shown, factor = (unit, 1.0) if role == "force" else (f"m{unit}", 1e3)
        yield Finding(
            kind="coarse_steps",
            severity="warning" if error > SETTINGS.coarse_warning_ratio else "note",
            channel=role,
            size=resolution,
            unit=unit,
            found=f"{role} has steps of {factor * resolution:.3g} {shown}: "
            f"{round(float(np.ptp(values)) / resolution) + 1} levels over the run",
            effect=f"No model can have an error below {percent(error)} of the force's standard deviation"
            if role == "force"
            else "Steps of the displacement become jumps of the velocity; smoothing takes out what it can",
            remedy="Use more of the converter's range (a smaller range, a larger gain)",
        )


def find_spikes(recording: Recording) -> Iterator[Finding]:
    """Generate findings on spikes: single samples that differ strongly from both neighbours."""
    for role, values in _varying_channels(recording):
        if len(values) < SETTINGS.spike_samples_min:
            continue
        before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
        away = np.minimum(np.abs(before), np.sign(before) * after)
        low, high = np.quantile(values, (0.005, 0.995))
        noise = SETTINGS.spike_noise_ratio_min * white_noise(values)
        bad = np.flatnonzero(away > max(SETTINGS.spike_height_ratio_min * (high - low), noise)) + 1
        if not len(bad) or len(bad) > len(values) / SETTINGS.spike_samples_min:
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
            effect="Squared errors give a spike far more weight than a valid sample",
            remedy="Cut the samples out, and look for a loose plug or a switching device nearby",
        )


def resolution_of(values: FloatArray) -> float:
    """Return the step of a quantised channel, 0 for a continuous channel."""
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > 0.5 * len(values):
        return 0.0
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * np.ptp(levels)]  # Smaller distances are rounding errors.
    resolution = float(np.median(apart))
    multiples = apart / resolution
    nearest = np.round(multiples)
    regular = (np.abs(multiples - nearest) < 0.1) & (nearest >= 1.0) & (nearest <= 3.0)
    return resolution if np.count_nonzero(regular) >= SETTINGS.quantised_ratio_min * len(apart) else 0.0


def _segments(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return (first, last + 1) of each group of consecutive flags that are True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def _varying_channels(recording: Recording) -> Iterator[tuple[str, FloatArray]]:
    for role, values in channels_of(recording).items():
        if role in _MEASURED and np.ptp(values) > 0.0:
            yield role, values


def _steps(values: FloatArray) -> FloatArray:
    """Return abs(values[k] - values[k - 1]) for k = 0 to n. The first and the last are 0."""
    return np.abs(np.diff(values, prepend=values[:1], append=values[-1:]))


def _has_slope(values: FloatArray, a: int, b: int) -> bool:
    """Return True if the signal changes just before row ``a`` or just after row ``b - 1``."""
    steps, usual = _steps(values), float(np.sqrt(np.mean(np.diff(values) ** 2)))
    return a > 0 and b < len(values) and max(steps[a], steps[b]) > 0.05 * usual


def _stuck_length(segments: list[tuple[int, int]]) -> float:
    """Return the length [time steps] from which a constant segment indicates a stuck sensor.

    The length is larger if the channel has at least five constant segments and many of them are long.
    """
    if len(segments) < 5:
        return SETTINGS.stuck_steps_min
    typical = float(np.quantile([b - a for a, b in segments], 0.9))
    return max(SETTINGS.stuck_steps_min, SETTINGS.stuck_length_ratio_min * typical)
