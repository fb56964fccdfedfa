"""What runs show against each other: copies, two dampers among them, channels that are out of step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.core import turning_points
from mrdamper.data.diagnosis.resolution import white_noise
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording, command_slack
from mrdamper.quantities import to_degC

_SAME = 1e-4  # of the range: what rounding in another format leaves
_NEAR = 0.02  # of the stroke, by which two recordings of one motion may be apart
_OWN_NOISE = 0.7  # of a run's white noise: two recordings differ by 1.4 times theirs
_LOOKED_AT = 64  # samples of a run by which copies are told
_ALIKE = 0.03  # share by which strokes and frequencies of one motion differ
_APART = 0.15  # share by which force ranges of one damper at one command and motion may differ
_SAME_K = 3.0
_SWING = 0.2  # of the stroke: a smaller to-and-fro is no reversal
_REACH = 4  # samples on each side of a reversal, by which its time is told
_REGULAR = 0.2  # share by which the strokes of a periodic motion differ in duration
_LATE_S, _EARLY_S = 0.010, -0.002
_OCTAVE_PART = 1.3  # between two frequencies that tell a delay from compliance


@dataclass(frozen=True, slots=True)
class _Figures:
    """A run in the numbers by which it is compared."""

    name: str
    command: float
    unit: str
    stroke: float  # [m]
    half_s: float  # from one reversal to the next
    force_range: float  # [N], without the outer per cents
    temperature: float | None  # [K]
    delay_s: float  # from a reversal to the force's passage through its middle


def compare(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Give what runs show against each other.

    Runs that are one and the same (held out and trained on, they would be no test at all), runs of one
    command, motion and temperature whose forces differ as those of two dampers, and a force late or early.
    """
    sound = [run for run in runs if _is_sound(run)]
    yield from _copies(sound)
    figures = [found for run in sound if (found := _figures(run)) is not None]
    yield from _two_dampers(figures)
    yield from _delay(figures)


def _is_sound(run: Recording) -> bool:
    channels = (run.time, run.displacement, run.force, run.command)
    return len(run) > 1 and all(len(each) == len(run) and bool(np.isfinite(each).all()) for each in channels)


def _copies(runs: Sequence[Recording]) -> Iterator[Finding]:
    """Give runs whose samples are those of an earlier one, but for rounding, a factor, or a little noise."""
    seen: dict[int, list[Recording]] = {}
    looked: dict[int, list[FloatArray]] = {}
    for run in runs:
        earlier, theirs = seen.setdefault(len(run), []), looked.setdefault(len(run), [])
        rows = np.linspace(0, len(run) - 1, min(len(run), _LOOKED_AT)).astype(int)
        here, near = run.displacement[rows], _NEAR * float(np.ptp(run.displacement))
        apart = np.abs(np.reshape(theirs, (-1, len(rows))) - here).max(axis=1)
        gains = ((earlier[k], _gain_of_copy(run, earlier[k])) for k in np.flatnonzero(apart <= near))
        twin, gain = next((found for found in gains if found[1] is not None), (None, None))
        if twin is None or gain is None:
            earlier.append(run)
            theirs.append(here)
            continue
        scaled = abs(gain - 1.0) > 10.0 * _SAME
        yield Finding(
            kind="duplicate",
            severity="warning",
            channel="",
            run=run.name,
            found=f"force and displacement are those of {twin.name}, "
            + (f"the force times {gain:.4g}" if scaled else "number for number"),
            effect="The run counts twice in a fit; held out, it is no test",
            remedy="Leave one of the two out",
        )


def _gain_of_copy(one: Recording, other: Recording) -> float | None:
    """Return the factor between the forces of one recording under two names; None for two recordings.

    What is one differs by less than the noise that each has.
    """
    if not _is_rounding(one.displacement - other.displacement, one.displacement):
        return None
    around = other.force - other.force.mean()
    gain = float(around @ one.force / (around @ around)) if around.any() else 1.0
    return gain if _is_rounding(one.force - gain * around, one.force) else None


def _is_rounding(apart: FloatArray, values: FloatArray) -> bool:
    spread = float(np.std(apart))
    return spread <= _SAME * float(np.ptp(values)) or spread <= _OWN_NOISE * white_noise(values)


def _figures(run: Recording) -> _Figures | None:
    """Return a run's figures; None where motion or force are not periodic, or the time stands still."""
    stroke = float(np.ptp(run.displacement))
    if not (np.diff(run.time) > 0.0).all() or stroke == 0.0:
        return None
    turns = turning_points(run.displacement, _SWING * stroke)
    if len(turns) < 4:
        return None
    times = np.array([_vertex(run.time, run.displacement, int(k)) for k in turns[1:-1]])
    halves = np.diff(times)
    half = float(np.median(halves))
    if float(np.max(np.abs(halves - half))) > _REGULAR * half:
        return None
    low, high = np.quantile(run.force, (0.01, 0.99)).tolist()
    if low == high:
        return None
    return _Figures(
        name=run.name,
        command=float(np.median(run.command)),
        unit=run.command_unit,
        stroke=stroke,
        half_s=half,
        force_range=high - low,
        temperature=None if run.temperature is None else float(np.median(run.temperature)),
        delay_s=_passage(run, times, half, 0.5 * (low + high)),
    )


def _vertex(time: FloatArray, displacement: FloatArray, k: int) -> float:
    """Return the time of a reversal: the vertex of a parabola through the samples around it."""
    around = slice(max(k - _REACH, 0), k + _REACH + 1)
    near = time[around]
    a, b, _ = np.polyfit(near - time[k], displacement[around], 2)
    return float(np.clip(time[k] - 0.5 * b / a, near[0], near[-1])) if a else float(time[k])


def _passage(run: Recording, reversals: FloatArray, half: float, middle: float) -> float:
    """Return the median time [s] from a reversal to the force's passage through its middle, or NaN."""
    force = run.force - middle
    rows = np.flatnonzero(np.diff(force < 0.0))  # a zero may have either sign bit
    steps = force[rows + 1] - force[rows]
    passages = run.time[rows] - force[rows] * (run.time[rows + 1] - run.time[rows]) / steps
    found = []
    for reversal in reversals:
        near = passages[np.abs(passages - reversal) < 0.25 * half]
        if len(near):
            found.append(float(np.median(near)) - float(reversal))
    return float(np.median(found)) if found else float("nan")


def _two_dampers(figures: Sequence[_Figures]) -> Iterator[Finding]:
    """Give the pair of like runs whose force ranges are furthest apart, if too far for one damper."""
    pairs = (
        (one, other) for k, one in enumerate(figures) for other in figures[k + 1 :] if _alike(one, other)
    )
    apart, one, other = max(
        ((abs(one.force_range / other.force_range - 1.0), one, other) for one, other in pairs),
        key=lambda pair: pair[0],
        default=(0.0, None, None),
    )
    if one is None or other is None or apart <= _APART:
        return
    warm = "" if one.temperature is None else f", {to_degC(one.temperature):.0f} degC"
    yield Finding(
        kind="two_dampers",
        severity="warning",
        channel="force",
        size=100.0 * apart,
        unit="%",
        run=one.name,
        found=f"its force range differs by {percent(apart)} from that of {other.name} at the same motion and "
        f"{one.command:.3g} {one.unit}{warm}: perhaps the runs are of two dampers",
        effect="One law for both fits neither",
        remedy="Fit the runs of each damper by themselves, or look for what else changed between the two",
    )


def _alike(one: _Figures, other: _Figures) -> bool:
    """Tell whether two runs have the same command, motion and temperature, as far as these are known."""
    if one.unit != other.unit or abs(one.command - other.command) > command_slack(one.command):
        return False
    if one.temperature is None or other.temperature is None:
        if one.temperature != other.temperature:
            return False
    elif abs(one.temperature - other.temperature) > _SAME_K:
        return False
    motions = ((one.stroke, other.stroke), (one.half_s, other.half_s))
    return all(abs(a / b - 1.0) < _ALIKE for a, b in motions)


def _spread(group: Sequence[_Figures]) -> float:
    """Return the highest over the lowest frequency of some runs."""
    halves = [each.half_s for each in group]
    return max(halves) / min(halves)


def _at_no_period(group: Sequence[_Figures], power: int) -> float:
    """Return what is left of the delays [s] as the period goes to nothing, if they grow with its power."""
    halves = np.array([each.half_s for each in group])
    return float(np.polyfit(halves**power, [each.delay_s for each in group], 1)[1])


def _delay(figures: Sequence[_Figures]) -> Iterator[Finding]:
    """Give the delay of the force that compliance does not explain.

    At the lowest command a reversal turns the force about after d = tau + a/f: elastic parts need a share of
    the stroke, whatever its duration, and a delay between the channels is a time. Two frequencies of one
    stroke tell them apart. With viscosity or a gas spring beside little friction it is tau + b/f^2 rather,
    which the other form takes for an early force: early is what is so by both. At one frequency alone only a
    force that turns before the motion is a proof. A viscosity c in series with a stiffness k is late by c/k at
    all frequencies, as a channel is: it is told as either.
    """
    timed = [each for each in figures if np.isfinite(each.delay_s)]
    if not timed:
        return
    least = min(timed, key=lambda each: abs(each.command))
    lowest = [each for each in timed if abs(each.command - least.command) <= command_slack(least.command)]
    alike = [[other for other in lowest if abs(other.stroke / each.stroke - 1.0) < _ALIKE] for each in lowest]
    groups = [group for group in alike if _spread(group) >= _OCTAVE_PART] or [lowest]
    apart = _spread(lowest) >= _OCTAVE_PART
    if apart:
        by_share, by_square = (
            float(np.median([_at_no_period(group, power) for group in groups])) for power in (1, 2)
        )
        tau = by_share if by_share > 0.0 else min(by_square, 0.0)
    else:
        tau = float(np.median([each.delay_s for each in lowest]))
    if tau < _EARLY_S or (apart and tau > _LATE_S):
        late = tau > 0.0
        yield Finding(
            kind="force_late" if late else "force_early",
            severity="warning",
            channel="force",
            size=1e3 * tau,
            unit="ms",
            run=lowest[0].name,
            found=f"the force is {1e3 * abs(tau):.1f} ms {'late' if late else 'early'}: a lag of its channel "
            f"that {'is the same at all frequencies' if apart else 'no damper has'}"
            + (", or a damper whose viscosity over its stiffness is that time" if late else ""),
            effect="Hysteresis and viscosity take up what is a delay between two channels",
            remedy="Shift the force by it, or give both channels the same filter"
            + ("; leave it where the damper itself is that soft" if late else ""),
        )
