"""Conditioning: from measured rows on some grid to the trajectory that a law is driven through.

Rows are put on a uniform grid, their displacement is smoothed and differentiated, command and temperature are
freed of their sensors' noise. By which numbers, ``Rules`` say; ``prepare`` chooses them. A whole run is one
window of rows. A :class:`Conditioner` takes rows as they come, and answers for them window by window.

A segment that fits into one window is conditioned as a whole run. Of a longer one each window reaches
``OVERLAP`` knots of the smoothing spline further than what it answers for, on either side: the influence of
an end falls by a factor of about 0.3 a knot, and nothing of it is left in double precision. Windows lie at
fixed samples of the segment, so that what comes out does not depend on the batches.

Two rules look at a whole run, and differ in a long segment. Temperature is smoothed, never one number (over
``TEMPERATURE_OVERLAP`` knots: to 1e-6 of its noise). A command that kept still in the head is that number as
long as it is measured within its slack; elsewhere it is as measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.batches import Batch
from mrdamper.data.records import GAP, LEAST_SAMPLES, command_slack, steady_command
from mrdamper.data.segments import HEAD_ROWS
from mrdamper.data.signals import Kinematics, differentiate, knot_spacing, smooth
from mrdamper.excitation import Trajectory
from mrdamper.quantities import QUANTITIES

__all__ = [
    "LEAST_SAMPLES",
    "OVERLAP",
    "TEMPERATURE_OVERLAP",
    "Conditioner",
    "Grid",
    "Rules",
    "condition_run",
    "condition_temperature",
    "even_step",
    "known_temperature",
    "on_grid",
]

OVERLAP = 48
TEMPERATURE_OVERLAP = 16
_ROWS = 40  # that a window's cubic spline of resampling reaches further: 0.27 a row
_MOST_LOST = math.ceil(GAP)  # steps from one row to the next
_JITTER = 1e-3  # of a step: time stamps further from a uniform grid are resampled
_EVEN = 0.3  # of a step: a longer or shorter one is no usual one
_WHOLE = 0.1  # steps: so near to a whole number of them, samples were lost

_STEADY_K = 1.0  # a run whose temperature drifts by less is at one temperature
_PARTS = 8  # of a run, whose means tell one that warms up and cools again
_TEMPERATURE_CUTOFF_Hz = 0.25  # of the smoothing of a temperature that drifts: heat is slow


@dataclass(frozen=True, slots=True)
class Rules:
    """How a record is conditioned, the same to its end."""

    step_s: float  # of the grid
    even: bool  # rows are samples of the grid, but for lost ones; else they are resampled to it
    uneven_s: float  # by how much their steps differ from the usual one
    cutoff_Hz: float  # of the smoothing; the Nyquist frequency of the grid when nothing is removed
    dead_band_m: float
    reference_m: float  # measured displacement that counts as zero
    command: float | None  # where it keeps still [A or V]
    measured_velocity: bool
    thermocouple_lag_s: float

    @property
    def spacing(self) -> int:
        """Samples between two knots of the smoothing."""
        return knot_spacing(self.step_s, self.cutoff_Hz)


@dataclass(frozen=True, slots=True)
class Grid:
    """Where the samples lie, on the axis of the rows' time: whole numbers for even rows, else [s]."""

    first: float = 0.0
    step: float = 1.0

    def place(self, sample: int) -> float:
        return self.first + self.step * sample

    def places(self, start: int, stop: int) -> FloatArray:
        return np.asarray(self.first + self.step * np.arange(start, stop))

    def samples_to(self, last: float) -> int:
        """Return the number of samples up to a place, that place included."""
        return int((last - self.first) / self.step * (1.0 + 1e-12)) + 1


def even_step(time: FloatArray) -> float | None:
    """Return the step [s] of timestamps that are taken as a uniform grid; None where they are resampled."""
    step = float(time[-1] - time[0]) / (len(time) - 1)
    off = float(np.max(np.abs(time - (time[0] + step * np.arange(len(time))))))
    return step if off <= max(_JITTER * step, 0.6 * _rounding(time, off)) else None


def _rounding(time: FloatArray, off: float) -> float:
    """Return the decimal unit [s], no smaller than ``off``, to which timestamps are rounded; 0 when none."""
    unit = 10.0 ** math.ceil(math.log10(off)) if off > 0.0 else 0.0
    for candidate in (unit, 10.0 * unit):
        if candidate and np.allclose(time / candidate, np.round(time / candidate), rtol=0.0, atol=1e-4):
            return candidate
    return 0.0


def on_grid(rows: Batch, grid: Grid, start: int, stop: int) -> Batch:
    """Return rows at the samples of a grid from ``start`` to before ``stop``.

    Displacement is resampled by a cubic spline, the rest linearly; rows that lie on the grid stay as they
    are.
    """
    at = grid.places(start, stop)
    low = int(np.searchsorted(rows.time, at[0]))
    high = int(np.searchsorted(rows.time, at[-1], side="right"))
    if np.array_equal(rows.time[low:high], at):
        return rows.part(slice(low, high))
    from scipy.interpolate import CubicSpline

    near = rows.part(slice(max(0, low - _ROWS), high + _ROWS))
    resampled = near.each(lambda column: np.interp(at, near.time, column))
    displacement = np.asarray(CubicSpline(near.time, near.displacement)(at), dtype=np.float64)
    return replace(resampled, time=at, displacement=displacement)


def condition_run(sampled: Batch, path: Kinematics, rules: Rules) -> Trajectory:
    """Return the trajectory of a whole run, given its rows on the grid and its smoothed displacement."""
    temperature = sampled.temperature
    if temperature is not None:
        temperature = condition_temperature(temperature, rules.step_s, rules.thermocouple_lag_s)
    command = sampled.command if rules.command is None else np.full(len(sampled), rules.command)
    return _trajectory(rules, sampled, path, command, temperature, slice(None))


def _trajectory(
    rules: Rules,
    sampled: Batch,
    path: Kinematics,
    command: FloatArray,
    temperature: FloatArray | None,
    mine: slice,
) -> Trajectory:
    """Return some samples of a window, for which command and temperature are given."""
    velocity, acceleration = path.velocity, path.acceleration
    if rules.measured_velocity and sampled.velocity is not None:
        velocity = sampled.velocity
        acceleration = differentiate(velocity, rules.step_s)
    return Trajectory(
        step=rules.step_s,
        displacement=path.displacement[mine] - rules.reference_m,
        velocity=velocity[mine],
        acceleration=acceleration[mine],
        command=command,
        dead_band=rules.dead_band_m,
        temperature=temperature,
    )


class Conditioner:
    """One segment as it comes: ``take`` its parts, ask for what is ``ready``, in the end for the ``rest``.

    Parameters
    ----------
    temperature_K : the one that holds until one is measured; None: temperature is not wanted
    window : samples that are answered for at a time, at least
    """

    def __init__(self, rules: Rules, *, temperature_K: float | None, window: int = HEAD_ROWS) -> None:
        self._rules = rules
        self._overlap = OVERLAP * rules.spacing
        if temperature_K is not None:
            knots = knot_spacing(rules.step_s, _TEMPERATURE_CUTOFF_Hz)
            self._overlap = max(self._overlap, (TEMPERATURE_OVERLAP + 1) * knots)
        self._window = max(window, 2 * self._overlap)
        self._held: list[Batch] = []  # their time is the place on the grid
        self._grid = Grid()
        self._first_s = self._last_s = 0.0
        self._at = -1.0  # place of the last row, in samples of the grid
        self.temperature_K = temperature_K  # at the last row
        self._given = 0  # samples of the grid that were answered for

    @property
    def pace(self) -> float:
        """Time that went by over that of as many usual steps; 1.0 but for a sampling that has changed."""
        return (self._last_s - self._first_s) / (self._rules.step_s * self._at) if self._at > 0.0 else 1.0

    def take(self, part: Batch) -> FloatArray:
        """Take the next rows; return their places on the grid, in steps from its first sample."""
        rules = self._rules
        if self._at < 0.0:
            self._first_s = float(part.time[0])
            self._last_s = self._first_s - rules.step_s
            self._grid = Grid() if rules.even else Grid(self._first_s, rules.step_s)
        if rules.even:
            at = places = self._even_places(part.time)
        else:
            at = part.time
            places = np.asarray((part.time - self._first_s) / rules.step_s)
        temperature = None
        if self.temperature_K is not None and part.temperature is not None:
            temperature = known_temperature(part.temperature, self.temperature_K)
            self.temperature_K = float(temperature[-1])
        velocity = part.velocity if rules.measured_velocity else None
        self._held.append(replace(part, time=at, velocity=velocity, temperature=temperature))
        self._at, self._last_s = float(places[-1]), float(part.time[-1])
        return places

    def ready(self) -> Iterator[Trajectory]:
        """Give the windows that later rows cannot change."""
        while self._at >= self._given + self._window + self._overlap + _ROWS * _MOST_LOST:
            yield self._answered(self._given + self._window, last=False)

    def rest(self) -> Iterator[Trajectory]:
        """Give what is left: the segment ends here."""
        end = Grid().samples_to(self._at)
        if end - self._given >= LEAST_SAMPLES:
            yield self._answered(end, last=True)

    def _even_places(self, time: FloatArray) -> FloatArray:
        """Return the samples of the grid that rows are, some of which may be lost."""
        rules = self._rules
        steps = np.diff(time, prepend=self._last_s)
        odd = np.abs(steps - rules.step_s) > max(_EVEN * rules.step_s, 1.5 * rules.uneven_s)
        moves = np.ones(len(time))
        if odd.any():
            share = steps[odd] / rules.step_s
            whole = np.round(share)  # samples were lost; anything else is another pace
            moves[odd] = np.where((np.abs(share - whole) < _WHOLE) & (whole > 0.0), whole, share)
        return np.asarray(self._at + np.cumsum(moves))

    def _answered(self, end: int, *, last: bool) -> Trajectory:
        """Return the samples up to ``end`` that were not given yet, and let go of what no later one needs."""
        rules, given = self._rules, self._given
        whole = last and not given
        start = 0 if whole else max(0, (given - self._overlap) // rules.spacing * rules.spacing)
        held = Batch.joined(self._held)
        sampled = on_grid(held, self._grid, start, end if last else end + self._overlap)
        path = smooth(sampled.displacement, rules.step_s, rules.cutoff_Hz)
        self._given = end
        needed = self._grid.place(end - self._overlap - rules.spacing)
        keep = max(0, int(np.searchsorted(held.time, needed)) - _ROWS)
        self._held = [held.part(slice(keep, None)).each(np.copy)]
        if whole:
            return condition_run(sampled, path, replace(rules, command=steady_command(held.command)))
        mine = slice(given - start, end - start)
        temperature = sampled.temperature
        if temperature is not None:
            temperature = self._smoothed_temperature(temperature, start, mine)
        return _trajectory(rules, sampled, path, self._command(sampled.command[mine]), temperature, mine)

    def _command(self, command: FloatArray) -> FloatArray:
        steady = self._rules.command
        if steady is None:
            return command
        return np.where(np.abs(command - steady) <= command_slack(steady), steady, command)

    def _smoothed_temperature(self, temperature: FloatArray, start: int, mine: slice) -> FloatArray:
        rules = self._rules
        off = -start % knot_spacing(rules.step_s, _TEMPERATURE_CUTOFF_Hz)  # to the first knot in the window
        found = smooth(temperature[off:], rules.step_s, _TEMPERATURE_CUTOFF_Hz)
        conditioned = found.displacement + rules.thermocouple_lag_s * found.velocity
        return np.asarray(conditioned[mine.start - off : mine.stop - off])


# ------------------------------------------------------------------------------------------- temperature


def condition_temperature(temperature: FloatArray, step: float, lag_s: float = 0.0) -> FloatArray:
    """Return the temperature [K] without the sensor's noise, and ahead by its lag, shape (n,).

    A run whose straight line of best fit drifts by less than 1 K (or by less than three standard errors), and
    whose eighths have means within 1 K (or six of their standard errors), is at one temperature: its mean,
    at every sample. Any other is smoothed with a cut-off of 0.25 Hz, or is its line below 16 s. A first order
    lag ``lag_s`` of the sensor is taken back: T + lag dT/dt.
    """
    n = len(temperature)
    time = step * (np.arange(n) - 0.5 * (n - 1))
    slope = float(time @ temperature / (time @ time))
    mean = float(np.mean(temperature))
    noise = float(np.std(temperature - mean - slope * time))
    drift = abs(slope) * step * n
    short = step * n < 4.0 / _TEMPERATURE_CUTOFF_Hz  # too short for knots
    wander = 0.0 if short else float(np.ptp([part.mean() for part in np.array_split(temperature, _PARTS)]))
    if drift < max(_STEADY_K, 3.0 * noise * math.sqrt(12.0 / n)) and wander < max(
        _STEADY_K, 6.0 * noise * math.sqrt(_PARTS / n)
    ):
        return np.full(n, mean)
    if short:
        return np.asarray(mean + slope * (time + lag_s))
    smoothed = smooth(temperature, step, _TEMPERATURE_CUTOFF_Hz)
    return smoothed.displacement + lag_s * smoothed.velocity


def known_temperature(temperature: FloatArray, before_K: float) -> FloatArray:
    """Return a temperature [K] with the last possible number in place of one that is none, shape (n,).

    ``before_K`` is the number before the first.
    """
    quantity = QUANTITIES["temperature"]
    known = (temperature >= quantity.low) & (temperature <= quantity.high)
    if known.all():
        return temperature
    padded = np.concatenate(([before_K], temperature))
    latest = np.maximum.accumulate(np.where(np.append(True, known), np.arange(len(padded)), 0))
    return np.asarray(padded[latest][1:])
