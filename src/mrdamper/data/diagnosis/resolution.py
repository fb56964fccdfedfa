"""Findings on the resolution of the hysteresis: samples, noise, and repeatability of cycles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD, FloatArray
from mrdamper.core import turning_points
from mrdamper.data.diagnosis.repeatability import forces_by_phase, repeatability, select_typical_cycles
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.prepare import PreparedRun


def find_few_samples(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate a finding if the sampling rate is too low for the motion."""
    period, step, x = prepared.period_s, prepared.trajectory.step, prepared.trajectory.displacement
    if period is None:
        turns = turning_points(x, SETTINGS.fast_reversal_stroke_ratio_min * float(np.ptp(x)))
        period = 2.0 * float(np.min(np.diff(turns) * step, initial=np.inf))
    per_cycle = period / step
    if per_cycle < SETTINGS.cycle_samples_min:
        found = f"the fastest cycle has {per_cycle:.3g} samples (at {1 / step:.4g} Hz)"
        effect = "Velocity and the corners of the loop are lost between samples"
        remedy = f"Record at {SETTINGS.cycle_samples_min / period:.3g} Hz or more"
        few = Finding("few_samples_per_cycle", found, effect, remedy, channel="time", size=per_cycle)
        is_fault = per_cycle <= SETTINGS.cycle_samples_fault_max
        yield replace(few, unit="samples", severity="fault" if is_fault else "warning")


def find_noise(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate findings on noise and repeatability of the force, relative to its standard deviation."""
    spread = float(np.std(prepared.force[prepared.scored_from :]))
    noise = white_noise(prepared.force[prepared.scored_from :])
    share = noise / spread if spread else 0.0
    if 100.0 * share > SETTINGS.force_noise_max_percent:
        found = f"force has white noise of {noise:.3g} N rms ({percent(share)} of its standard deviation)"
        effect = f"No model can have an error below {percent(share)} on this run"
        remedy = "Shield the load cell's cable, use more of its range; more cycles average it out in a fit"
        yield Finding("force_noise", found, effect, remedy, channel="force", size=noise, unit="N")
    apart = None if prepared.run.constant_command is None else repeatability(prepared)
    if apart is None or apart <= SETTINGS.cycle_deviation_max_percent:
        return
    found = f"cycles differ from their mean by {percent(0.01 * apart)} of the force's standard deviation"
    if apart > 200.0 * share:
        found += f", where noise explains {percent(share)}"
        remedy = "Look for heating, drift of the position, or a loose mounting; take the segment that repeats"
    else:
        found += ", which is noise"
        remedy = "More cycles average it out in a fit"
    effect = f"No model of the damper alone can have an error below about {percent(0.01 * apart)} on this run"
    yield Finding("poor_repeatability", found, effect, remedy, channel="force", size=apart, unit="%")


def find_interference(prepared: PreparedRun) -> Iterator[Finding]:
    """Generate a finding on a spectral line of the force that the periodic motion does not excite.

    Such a line is caused by interference or aliasing. The line is searched in the spectrum of the deviation
    from the mean cycle. In this spectrum, drift and slow changes of the force are close to multiples of the
    motion's frequency. A line between these multiples is not caused by the motion.
    """
    if prepared.period_s is None or prepared.run.constant_command is None:
        return
    cycle_forces = forces_by_phase(prepared, select_typical_cycles(prepared))
    if len(cycle_forces) < SETTINGS.line_cycle_count_min:
        return
    spread = float(np.std(cycle_forces))
    beside = (cycle_forces - cycle_forces.mean(axis=0)).ravel()
    power = 2.0 * np.abs(np.fft.rfft(beside)) ** 2 / len(beside) ** 2
    harmonic = np.arange(len(power)) / len(cycle_forces)
    bins = SETTINGS.line_distance_min_bins / len(cycle_forces)
    off = np.clip(bins, *SETTINGS.line_distance_range_harmonics)
    between = np.abs(harmonic - np.round(harmonic)) > off
    rest = np.where(between & (harmonic > SETTINGS.line_harmonic_min), power, 0.0)
    top = int(np.argmax(rest))
    line = float(rest[top - 2 : top + 3].sum())
    amplitude = float(np.sqrt(line))
    is_weak = amplitude < SETTINGS.line_force_ratio_min * spread
    if is_weak or line < SETTINGS.line_power_ratio_min * power.sum():
        return
    found = f"the force has a line of {amplitude:.3g} N rms at {harmonic[top] / prepared.period_s:.3g} Hz, "
    found += f"no multiple of the motion's {1.0 / prepared.period_s:.3g} Hz"
    effect = f"No model of the damper has an error below {percent(amplitude / spread)} on this run"
    remedy = "Look for mains or a converter nearby, or its alias: sample faster, or filter before sampling"
    yield Finding("interference", found, effect, remedy, channel="force", size=amplitude, unit="N")


def white_noise(values: FloatArray) -> float:
    """Return the standard deviation of the white noise in a signal from its fourth differences.

    Fourth differences remove the smooth part of the signal. The median of their absolute values is
    insensitive to the few samples at corners. Quantisation is not counted as noise if the signal has the same
    value at many consecutive samples.
    """
    if len(values) < 16:
        return 0.0
    fourth = np.diff(values, 4)
    return DEVIATION_PER_MAD * float(np.median(np.abs(fourth))) / float(np.sqrt(70.0))
