"""Findings on single channels: clipping, stuck values, coarse resolution, spikes, lost samples, jumps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD, FloatArray, rms
from mrdamper.data.cycles import true_segments
from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording, channels_of
from mrdamper.quantities import QUANTITIES


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
            length_min = SETTINGS.clipped_segment_samples_min
            segments = [
                (a, b) for a, b in true_segments(at_top) if b - a >= length_min and _has_slope(folded, a, b)
            ]
            least = max(SETTINGS.clipped_samples_min, SETTINGS.clipped_count_ratio_min * below)
            if sum(b - a for a, b in segments) < least:
                continue
            count = int(np.count_nonzero(at_top))
            share = count / len(values)
            found = f"{role} stays at its {side} end of {values[segments[0][0]]:.5g} {QUANTITIES[role].unit} "
            found += f"for {count} samples ({percent(share)}) in {len(segments)} segments: clipped"
            effect = "Velocity is zero where the damper moves, and the law is driven wrongly"
            if role == "force":
                effect = "Peak forces, viscosity and yield force come out too small"
            remedy = "Set the amplifier's range larger and record again; leave the run out until then"
            clipped = Finding("clipped", found, effect, remedy, channel=role, size=100.0 * share, unit="%")
            clipped = clipped.between(*recording.time[[segments[0][0], segments[-1][1] - 1]])
            # The plateau of a force may be the extreme level of a coarse converter.
            is_plateau = role == "force" and _coarse_step(values)[1] > SETTINGS.coarse_note_ratio
            is_fault = share > SETTINGS.clipped_ratio_max and not is_plateau
            yield replace(clipped, severity="fault") if is_fault else clipped


def find_stuck_sensors(recording: Recording) -> Iterator[Finding]:
    """Generate findings on a constant force or displacement while the other changes."""
    x, force = recording.displacement, recording.force
    for role, values, other in (("force", force, x), ("displacement", x, force)):
        segments = sorted(true_segments(np.append(np.diff(values) == 0.0, False)), key=lambda s: s[0] - s[1])
        steps = _steps(values)
        resolution = _coarse_step(values)[0]
        moved = float(np.ptp(other))
        for a, b in segments:
            if b - a < SETTINGS.stuck_steps_min:
                break
            # A slow signal, or the force between two reversals, stays within one step of a coarse converter.
            is_slow = max(steps[a], steps[b + 1]) <= SETTINGS.stuck_level_max_steps * resolution
            is_one_way = abs(other[b] - other[a]) > 0.95 * np.ptp(other[a : b + 1])
            if is_slow or (resolution and role == "force" and is_one_way):
                continue
            # The force of a damper at rest may relax. Therefore a larger change of the force is required.
            share = SETTINGS.stuck_motion_ratio_min if role == "force" else 0.5
            if np.ptp(other[a : b + 1]) < share * moved:
                continue
            from_s, to_s = recording.time[[a, b]].tolist()
            found = f"{role} keeps {values[a]:.5g} {QUANTITIES[role].unit} from {from_s:.4g} s to {to_s:.4g} "
            found += "s while the other channel goes on: a stuck sensor or a lost connection"
            effect = "The loop has a segment that no law can follow, and all coefficients become biased"
            remedy = "Cut the run before that place (from_s, to_s of the preparation), or record it again"
            stuck = Finding("stuck_sensor", found, effect, remedy, severity="fault", channel=role)
            yield replace(stuck, size=to_s - from_s, unit="s").between(from_s, to_s)
            break


def find_coarse_steps(recording: Recording) -> Iterator[Finding]:
    """Generate findings on channels whose resolution is coarse relative to the variation of the values."""
    for role, values in _varying_channels(recording):
        resolution, error = _coarse_step(values)
        if error <= SETTINGS.coarse_note_ratio:
            continue
        unit = QUANTITIES[role].unit
        shown, factor = (unit, 1.0) if role == "force" else (f"m{unit}", 1e3)
        levels = round(float(np.ptp(values)) / resolution) + 1
        found = f"{role} has steps of {factor * resolution:.3g} {shown}: {levels} levels over the run"
        effect = "Steps of the displacement become jumps of the velocity; smoothing takes out what it can"
        if role == "force":
            effect = f"No model can have an error below {percent(error)} of the force's standard deviation"
        remedy = "Use more of the converter's range (a smaller range, a larger gain)"
        coarse = Finding("coarse_steps", found, effect, remedy, channel=role, size=resolution, unit=unit)
        yield coarse if error > SETTINGS.coarse_warning_ratio else replace(coarse, severity="note")


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
        size, unit = float(away[worst - 1]), QUANTITIES[role].unit
        found = f"{role} has {len(bad)} spike{'s' if len(bad) > 1 else ''}, the largest of {size:.3g} {unit} "
        found += f"at {recording.time[worst]:.4g} s"
        effect = "Squared errors give a spike far more weight than a valid sample"
        remedy = "Cut the samples out, and look for a loose plug or a switching device nearby"
        spikes = Finding("spikes", found, effect, remedy, channel=role, size=size, unit=unit)
        yield spikes.between(*recording.time[[bad[0], bad[-1]]])


def find_lost_samples(recording: Recording) -> Iterator[Finding]:
    """Generate a finding on lost samples: time steps longer than 1.5 times the median time step."""
    steps = np.diff(recording.time)
    usual = float(np.median(steps))
    lost = np.flatnonzero(steps > SETTINGS.lost_step_ratio_min * usual)
    if len(lost):
        missing = float(np.sum(np.round(steps[lost] / usual) - 1.0))
        share = missing / len(recording)
        found = f"about {missing:.0f} samples are missing at {len(lost)} places ({percent(share)}), the "
        found += f"first after sample {lost[0]}"
        effect = "They are filled in by interpolation, which flattens the force at reversals"
        remedy = "Check the load of the recording computer; record again if there are many such places"
        gaps = Finding("lost_samples", found, effect, remedy, channel="time", size=missing, unit="samples")
        gaps = gaps.between(*recording.time[[lost[0], lost[-1] + 1]])
        yield gaps if share > 0.001 else replace(gaps, severity="note")


def find_phase_jumps(recording: Recording) -> Iterator[Finding]:
    """Generate findings on jumps of the displacement between two samples with regular time stamps.

    Lost or doubled samples cause such jumps. A spike is not a jump because the signal returns after it.
    """
    x = recording.displacement
    if len(x) < SETTINGS.jump_samples_min:
        return
    steps = np.diff(x) / np.diff(recording.time)
    near = np.median([steps[:-4], steps[1:-3], steps[3:-1], steps[4:]], axis=0)
    away = np.pad(steps[2:-2] - near, 2)
    usual = rms(steps)
    noise = DEVIATION_PER_MAD * float(np.median(np.abs(away)))
    far = np.abs(away) > max(SETTINGS.jump_slope_ratio_min * usual, SETTINGS.jump_noise_ratio_min * noise)
    # A spike has two consecutive steps of opposite sign, a jump has one step. Spikes are excluded.
    back = np.abs(away[:-1] + away[1:]) < 0.5 * np.maximum(np.abs(away[:-1]), np.abs(away[1:]))
    far[:-1] &= ~back
    far[1:] &= ~back
    places = np.flatnonzero(far)
    if not len(places) or len(places) > 0.01 * len(x):
        return
    lost = np.abs(away[places]) / np.maximum(np.abs(near[places - 2]), 0.3 * usual)
    samples = float(np.sum(np.round(lost)))
    found = f"the displacement jumps at {len(places)} place{'s' if len(places) > 1 else ''} where time goes "
    found += f"on evenly, the first at {recording.time[places[0]]:.4g} s: about {samples:.0f} samples are "
    found += "lost or doubled"
    effect = "Velocity there is wrong, and all later samples are shifted in time"
    remedy = "Check the load of the recording computer and its buffers; cut the run at these places"
    jumps = Finding("phase_jumps", found, effect, remedy, channel="time", size=samples, unit="samples")
    yield jumps.between(*recording.time[[places[0], places[-1] + 1]])


def _coarse_step(values: FloatArray) -> tuple[float, float]:
    """Return step and rounding error / standard deviation of a channel with up to 256 levels, else zeros."""
    levels = np.unique(values)
    if len(levels) < 3 or len(levels) > min(256, 0.5 * len(values)):
        return 0.0, 0.0
    apart = np.diff(levels)
    apart = apart[apart > 1e-9 * np.ptp(levels)]  # Smaller distances are rounding errors.
    resolution = float(np.median(apart))
    multiples = np.round(apart / resolution)
    regular = (np.abs(apart / resolution - multiples) < 0.1) & (multiples >= 1.0)
    error = resolution / math.sqrt(12.0) / float(np.std(values))
    is_quantised = np.count_nonzero(regular) >= SETTINGS.quantised_ratio_min * len(apart)
    return (resolution, error) if is_quantised else (0.0, 0.0)


def _varying_channels(recording: Recording) -> Iterator[tuple[str, FloatArray]]:
    for role, values in channels_of(recording).items():
        if role in {"displacement", "force", "velocity"} and np.ptp(values) > 0.0:
            yield role, values


def _steps(values: FloatArray) -> FloatArray:
    """Return abs(values[k] - values[k - 1]) for k = 0 to n. The first and the last are 0."""
    return np.abs(np.diff(values, prepend=values[:1], append=values[-1:]))


def _has_slope(values: FloatArray, a: int, b: int) -> bool:
    """Return True if the signal changes just before row ``a`` or just after row ``b - 1``."""
    steps = _steps(values)
    return a > 0 and b < len(values) and max(steps[a], steps[b]) > 0.05 * rms(steps[1:-1])
