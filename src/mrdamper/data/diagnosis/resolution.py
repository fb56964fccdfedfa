"""Findings on how finely a run shows the hysteresis: samples, noise, and how well cycles repeat."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points
from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.repeatability import alike_cycles, forces_by_phase, repeatability
from mrdamper.data.finding import Finding, percent
from mrdamper.data.prepare import PreparedRun

_PER_CYCLE = 60.0
_FAR_TOO_FEW = 20.0
_SWING = 0.3  # of the stroke range: a reversal that counts
_NOISY = 5.0  # percent of the force's standard deviation
_REPEATS = 5.0  # percent
_LINE = 0.03  # of the force's standard deviation: rms of a line between the harmonics
_PROMINENT = 0.5  # of what a cycle has beside the mean cycle is in that line
_OFF_BINS, _OFF_HARMONIC = 1.2, (0.1, 0.3)  # of the spectrum; of the motion's frequency, least and most
_LEAST_CYCLES = 3
_LOWEST_LINE = 2.0  # times the motion's frequency: below it is where a force that grows or falls has most


def find_few_samples(prepared: PreparedRun) -> Iterator[Finding]:
    """Yield a rate that is too low for the motion."""
    period, step = prepared.period_s, prepared.trajectory.step
    if period is None:
        turns = turning_points(
            prepared.trajectory.displacement, _SWING * float(np.ptp(prepared.trajectory.displacement))
        )
        apart = np.diff(turns) * step
        period = 2.0 * float(apart.min()) if len(apart) else None
    if period is not None and period / step < _PER_CYCLE:
        per_cycle = period / step
        yield Finding(
            kind="few_samples_per_cycle",
            severity="warning" if per_cycle > _FAR_TOO_FEW else "fault",
            channel="time",
            size=per_cycle,
            unit="samples",
            found=f"the fastest cycle has {per_cycle:.3g} samples (at {1 / step:.4g} Hz)",
            effect="Velocity and the corners of the loop are lost between samples",
            remedy=f"Record at {_PER_CYCLE / period:.3g} Hz or more",
        )


def find_few_cycles(prepared: PreparedRun) -> Iterator[Finding]:
    """Give a periodic run with fewer than two whole cycles that can be compared."""
    whole = cycles(prepared)
    if prepared.period_s is not None and len(whole) < 2:
        yield Finding(
            kind="few_cycles",
            severity="note",
            size=float(len(whole)),
            unit="cycles",
            found=f"the run has {len(whole)} whole cycle{'' if len(whole) == 1 else 's'} after its start",
            effect="Nothing can be said about repeatability and drift",
            remedy="Record three cycles or more",
        )


def find_noise(prepared: PreparedRun) -> Iterator[Finding]:
    """Give noise of the force and deviation from cycle to cycle, each against the force's spread."""
    spread = float(np.std(prepared.force[prepared.scored_from :]))
    noise = white_noise(prepared.force[prepared.scored_from :])
    share = 100.0 * noise / spread if spread else 0.0
    if share > _NOISY:
        yield Finding(
            kind="force_noise",
            channel="force",
            size=noise,
            unit="N",
            found=f"force has white noise of {noise:.3g} N rms ({percent(0.01 * share)} of its standard "
            "deviation)",
            effect=f"No model can have an error below {percent(0.01 * share)} on this run",
            remedy="Shield the load cell's cable, use more of its range; more cycles average it out in a fit",
        )
    apart = None if prepared.run.constant_command is None else repeatability(prepared)
    if apart is None or apart <= _REPEATS:
        return
    more = apart > 2.0 * share
    yield Finding(
        kind="poor_repeatability",
        channel="force",
        size=apart,
        unit="%",
        found=f"cycles differ from their mean by {percent(0.01 * apart)} of the force's standard deviation"
        + (f", where noise explains {percent(0.01 * share)}" if more else ", which is noise"),
        effect=f"No model of the damper alone can have an error below about {percent(0.01 * apart)} on "
        "this run",
        remedy="Look for heating, drift of the position, or a loose mounting; take the segment that repeats"
        if more
        else "More cycles average it out in a fit",
    )


def find_interference(prepared: PreparedRun) -> Iterator[Finding]:
    """Give a line in the force's spectrum where a periodic motion makes none: interference, or an alias.

    What a cycle has beside the mean cycle is noise, drift, or a slow change of the force (close to multiples
    of the motion's frequency). A line between these multiples has another source.
    """
    if prepared.period_s is None or prepared.run.constant_command is None:
        return
    cycle_forces = forces_by_phase(prepared, alike_cycles(prepared))
    if len(cycle_forces) < _LEAST_CYCLES:
        return
    spread = float(np.std(cycle_forces))
    beside = (cycle_forces - cycle_forces.mean(axis=0)).ravel()
    power = 2.0 * np.abs(np.fft.rfft(beside)) ** 2 / len(beside) ** 2
    harmonic = np.arange(len(power)) / len(cycle_forces)
    off = float(np.clip(_OFF_BINS / len(cycle_forces), *_OFF_HARMONIC))
    between = np.abs(harmonic - np.round(harmonic)) > off
    rest = np.where(between & (harmonic > _LOWEST_LINE), power, 0.0)
    top = int(np.argmax(rest))
    line = float(rest[top - 2 : top + 3].sum())
    amplitude = float(np.sqrt(line))
    if amplitude < _LINE * spread or line < _PROMINENT * float(power.sum()):
        return
    yield Finding(
        kind="interference",
        channel="force",
        size=amplitude,
        unit="N",
        found=f"the force has a line of {amplitude:.3g} N rms at {harmonic[top] / prepared.period_s:.3g} Hz, "
        f"no multiple of the motion's {1.0 / prepared.period_s:.3g} Hz",
        effect=f"No model of the damper has an error below {percent(amplitude / spread)} on this run",
        remedy="Look for mains or a converter nearby, and for its alias: sample faster, or filter "
        "before sampling",
    )


def white_noise(values: FloatArray) -> float:
    """Return the standard deviation of the white noise in a signal, from its fourth differences.

    They take out what is smooth (the motion); their median size is not moved by corners. Rounding that stays
    for many samples at one value has none.
    """
    if len(values) < 16:
        return 0.0
    fourth = np.diff(values, 4)
    return 1.4826 * float(np.median(np.abs(fourth))) / float(np.sqrt(70.0))
