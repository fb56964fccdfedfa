"""Preparation of a record that comes in batches: what ``prepare_run`` makes of a run, window by window.

The rules (step, cut-off, dead band, reference) are those that ``prepare_run`` chooses for the record's head;
then every stretch is resampled, smoothed and differentiated as a run is. A stretch that fits into one window
is conditioned as a whole. Of a longer one each window reaches ``OVERLAP`` knots of the smoothing spline
further than what it answers for, on either side: the influence of an end falls by a factor of about 0.3 a
knot, and nothing of it is left in double precision. Windows lie at fixed samples of the stretch, so that what
comes out does not depend on the batches.

Two rules look at a whole run, and go otherwise in a long stretch. Temperature is smoothed, never one number
(over ``WARM_OVERLAP`` knots: to 1e-8 of its noise). A command that kept still in the head is that number as
long as it is measured within its slack; elsewhere it is as measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import Preparation, even_step, prepare_run
from mrdamper.data.records import GAP, RigRun, command_slack, steady_command
from mrdamper.data.segments import HEAD_ROWS
from mrdamper.data.signals import differentiate, knot_spacing, smooth
from mrdamper.data.streaming import Batch
from mrdamper.data.temperature import CUTOFF_Hz, condition_temperature
from mrdamper.excitation import Trajectory
from mrdamper.quantities import QUANTITIES

__all__ = [
    "LEAST_SAMPLES",
    "OVERLAP",
    "WARM_OVERLAP",
    "Conditioner",
    "Rules",
    "choose_rules",
    "known_temperature",
]

LEAST_SAMPLES = 16
"""Of a stretch; a shorter one is not conditioned."""

OVERLAP = 48
WARM_OVERLAP = 16
_ROWS = 40  # that a window's cubic spline of resampling reaches further: 0.27 a row
_EVEN = 0.3  # of a step: a longer or shorter one is no usual one
_WHOLE = 0.1  # steps: so near to a whole number of them, samples were lost

Columns = dict[str, FloatArray]


@dataclass(frozen=True, slots=True)
class Rules:
    """How a record is prepared, the same to its end."""

    step_s: float  # of the grid
    even: bool  # rows are samples of the grid, but for lost ones; else they are resampled to it
    uneven_s: float  # by how much their steps differ from the usual one
    cutoff_Hz: float
    dead_band_m: float
    reference_m: float  # measured displacement that counts as zero
    command: float | None  # where it keeps still [A or V]
    measured_velocity: bool
    thermocouple_lag_s: float

    @property
    def spacing(self) -> int:
        """Samples between two knots of the smoothing."""
        return knot_spacing(self.step_s, self.cutoff_Hz)


def choose_rules(head: RigRun, preparation: Preparation) -> Rules:
    """Return the rules by which ``prepare_run`` prepares a record's head.

    Raises
    ------
    InputError
        What ``prepare_run`` refuses.
    """
    prepared = prepare_run(head, preparation)
    return Rules(
        step_s=prepared.trajectory.step,
        even=even_step(head.time) is not None,
        uneven_s=float(np.abs(np.diff(head.time) - prepared.trajectory.step).max()),
        cutoff_Hz=prepared.cutoff_Hz,
        dead_band_m=prepared.dead_band_m,
        reference_m=prepared.reference_m,
        command=head.constant_command,
        measured_velocity=preparation.velocity == "channel",
        thermocouple_lag_s=preparation.thermocouple_lag_s,
    )


class Conditioner:
    """One stretch as it comes: ``take`` its parts and ask for what is ``ready``, in the end for the ``rest``.

    Parameters
    ----------
    warm_K : the temperature that holds until one is measured; None: temperature is not wanted
    window : samples that are answered for at a time, at least
    """

    def __init__(self, rules: Rules, *, warm_K: float | None, window: int = HEAD_ROWS) -> None:
        self._rules = rules
        self._reach = OVERLAP * rules.spacing
        if warm_K is not None:
            self._reach = max(self._reach, (WARM_OVERLAP + 1) * knot_spacing(rules.step_s, CUTOFF_Hz))
        self._window = max(window, 2 * self._reach)
        self._held: list[Columns] = []
        self._first_s = self._last_s = 0.0
        self._at = -1.0  # place of the last row on the grid
        self.warm_K = warm_K  # at the last row
        self._given = 0  # samples of the grid that were answered for

    @property
    def pace(self) -> float:
        """Time that went by over that of as many usual steps; 1.0 but for a sampling that has changed."""
        return (self._last_s - self._first_s) / (self._rules.step_s * self._at) if self._at > 0.0 else 1.0

    def take(self, part: Batch) -> FloatArray:
        """Take the next rows; return their places on the grid, in steps from its first sample."""
        if self._at < 0.0:
            self._first_s = float(part.time[0])
            self._last_s = self._first_s - self._rules.step_s
        places = self._places(part.time)
        columns = {"place": places, "displacement": part.displacement, "command": part.command}
        if self._rules.measured_velocity and part.velocity is not None:
            columns["velocity"] = part.velocity
        if self.warm_K is not None and part.temperature is not None:
            columns["temperature"] = known_temperature(part.temperature, self.warm_K)
            self.warm_K = float(columns["temperature"][-1])
        self._held.append(columns)
        self._at, self._last_s = float(places[-1]), float(part.time[-1])
        return places

    def ready(self) -> Iterator[Trajectory]:
        """Give the windows that later rows cannot change."""
        while self._at >= self._given + self._window + self._reach + _ROWS * _MOST_LOST:
            yield self._answered(self._given + self._window, last=False)

    def rest(self) -> Iterator[Trajectory]:
        """Give what is left: the stretch ends here."""
        end = int(self._at * (1.0 + 1e-12)) + 1
        if end - self._given >= LEAST_SAMPLES:
            yield self._answered(end, last=True)

    def _places(self, time: FloatArray) -> FloatArray:
        rules = self._rules
        if not rules.even:
            return np.asarray((time - self._first_s) / rules.step_s)
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
        start = 0 if whole else max(0, (given - self._reach) // rules.spacing * rules.spacing)
        stop = end if last else end + self._reach
        held = {name: np.concatenate([each[name] for each in self._held]) for name in self._held[0]}
        grid = _on_grid(held, start, stop)
        mine = slice(given - start, end - start)
        path = smooth(grid["displacement"], rules.step_s, rules.cutoff_Hz)
        velocity, acceleration = path.velocity, path.acceleration
        if "velocity" in grid:
            velocity = grid["velocity"]
            acceleration = differentiate(velocity, rules.step_s)
        self._given = end
        keep = int(np.searchsorted(held["place"], end - self._reach - rules.spacing)) - _ROWS
        self._held = [{name: values[max(0, keep) :].copy() for name, values in held.items()}]
        return Trajectory(
            rules.step_s,
            path.displacement[mine] - rules.reference_m,
            velocity[mine],
            acceleration[mine],
            self._command(grid["command"][mine], whole=whole),
            rules.dead_band_m,
            self._temperature(grid["temperature"], start, mine, whole=whole)
            if "temperature" in grid
            else None,
        )

    def _command(self, command: FloatArray, *, whole: bool) -> FloatArray:
        if whole:
            held = steady_command(command)
            return command if held is None else np.full(len(command), held)
        held = self._rules.command
        if held is None:
            return command
        return np.where(np.abs(command - held) <= command_slack(held), held, command)

    def _temperature(self, warm: FloatArray, start: int, mine: slice, *, whole: bool) -> FloatArray:
        rules = self._rules
        if whole:
            return condition_temperature(warm, rules.step_s, rules.thermocouple_lag_s)
        spacing = knot_spacing(rules.step_s, CUTOFF_Hz)
        off = -start % spacing  # to the first knot in the window
        found = smooth(warm[off:], rules.step_s, CUTOFF_Hz)
        conditioned = found.displacement + rules.thermocouple_lag_s * found.velocity
        return np.asarray(conditioned[mine.start - off : mine.stop - off])


_MOST_LOST = math.ceil(GAP)  # steps from one row to the next


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


def _on_grid(held: Columns, start: int, stop: int) -> Columns:
    """Return the columns at the samples of the grid from ``start`` to before ``stop``."""
    place = held["place"]
    low = int(np.searchsorted(place, start))
    high = int(np.searchsorted(place, stop - 1, side="right"))
    at = np.arange(start, stop, dtype=np.float64)
    if np.array_equal(place[low:high], at):
        return {name: values[low:high] for name, values in held.items() if name != "place"}
    from scipy.interpolate import CubicSpline

    rows = slice(max(0, low - _ROWS), high + _ROWS)
    grid = {
        name: np.interp(at, place[rows], values[rows]) for name, values in held.items() if name != "place"
    }
    grid["displacement"] = np.asarray(CubicSpline(place[rows], held["displacement"][rows])(at))
    return grid
