"""The offline optimum: the current of least RMS error, searched with perfect knowledge of the damper.

No controller has this: it tries futures on the very damper, without noise, and knows target and motion to
the end. What is left of the error is the damper's: its lag, and where it cannot push. It is what a tracking
error is to be measured against.

The search is a projected Gauss-Newton one over the current of every sample, held in between. Stretches of the
current are moved, long ones first, then shorter ones down to a sample, then again. The force's derivative by
each move is measured: stretches that lie further apart than the damper's memory are moved at once, so that
one derivative costs as many runs as the memory has stretches. The normal equations are banded. The damper
forgets, so a step is not taken or refused as a whole: it is taken in those blocks of time in which it lowers
the error, and each block has a trust region of its own. Without that a search stalls: at the kinks of a few
reversals (lags that differ up and down, magnetic play) nearly every step makes something worse.

It starts from the best of constant currents and of static inverses with preview, or from what controllers
did, each spliced in where it is better, and never gets worse. It is a search, not a proof: only where two of
them, which start and probe apart, end within ``AGREEMENT`` is the better one taken for the optimum
(``agreed_optimum``). The budget is stated and kept.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.control.dynamic_reach import StepLags, dynamic_range, step_lags
from mrdamper.control.loop import ReferenceTrajectory, reference_trajectory, steps_per_sample
from mrdamper.control.protocol import Plant
from mrdamper.control.scenario import Scenario
from mrdamper.control.score import AttainableRange, Score, attainable_range, score_forces
from mrdamper.errors import InputError

AGREEMENT = 0.03
"""How far apart the RMS errors of two independent searches may end, of the lower one."""

_LEVELS = 9  # constant currents that the search starts from
_PREVIEWS_S = (0.0, 6e-3, 10e-3, 14e-3, 18e-3)  # of the static inverses that it starts from
_FINE = 20  # currents between two levels, for the inverse
_COARSEST_S = 8e-3  # stretch of the first moves; then half of it, and so on: fewer poor optima on the way
_TURNS = 3  # of the first round with each length but the shortest, which costs most
# How far currents are moved to measure the derivative, in turn: the force has kinks, which a small move sees
# and a large one smooths. Up or down at random: a kink has two derivatives.
# This and the next are shares of the highest current.
_PROBES = (0.15, 0.05)
_TRUST = 0.15  # how far the first step may move a current; more after a good step, less after a bad one
_MOST_TRUST, _LEAST_FIRST, _LEAST_TRUST = 0.25, 0.025, 0.002
_WIDER, _NARROWER = 1.5, 0.4
_TRIES = 4  # of one step, in smaller and smaller trust regions
_DAMPING = 1e-4  # of the mean diagonal: keeps currents that are not felt where they are
_PASSES = 12  # of the bounded least-squares problem
_LEAST_GAIN = 2e-3  # of the RMS error in one round, else the search is done
_MEMORY = 4.5  # of the damper's slower lag, after which a current is no longer felt
_LEAST_MEMORY_S = 20e-3


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """The best current that was found, at the plant's steps, and what it cost to find."""

    course: ReferenceTrajectory
    current: FloatArray  # [A], shape (n,)
    force: FloatArray  # [N], shape (n,)
    reach: AttainableRange
    score: Score
    iterations: int
    runs: int  # of the whole scenario on the plant
    converged: bool


def search_optimum(
    plant: Plant,
    scenario: Scenario,
    *,
    period_s: float = 1e-3,
    memory_s: float | None = None,
    most_runs: int = 1000,
    resistance_ohm: float | None = None,
    starts: Sequence[FloatArray] = (),
    seed: int = 0,
) -> Optimum:
    """Return the current of least RMS error over the scored part of a scenario.

    Parameters
    ----------
    plant : the damper, in the state that the scenario begins with; it is copied
    scenario : its sensors and disturbances play no part
    period_s : how long a current is held
    memory_s : how long a current is felt; None: 4.5 times the slower of the damper's lags, measured
    most_runs : budget: simulations of the whole scenario
    starts : currents [A] at the plant's steps to begin from; none: constant and static ones
    seed : of the directions in which currents are probed

    Raises
    ------
    InputError
        A period that does not fit the plant's steps, or a budget below what the start needs.
    """
    if most_runs < _LEVELS + len(_PREVIEWS_S):
        raise InputError(
            place="optimum",
            found=f"{most_runs} runs",
            expected=f"at least {_LEVELS + len(_PREVIEWS_S)} for the start",
        )
    course = reference_trajectory(scenario, plant.step_s)
    every = steps_per_sample(period_s, plant.step_s)
    if memory_s is None:
        memory_s = _memory(step_lags(plant, course, scenario.temperature_degC, scenario.highest_A))
    problem = _Problem(plant, course, scenario, most_runs)
    search = _Search(problem, every, max(round(memory_s / (every * course.step_s)), 1), seed)
    best, iterations, converged = search.improve(search.start(starts))
    reach = attainable_range(plant, course, scenario.temperature_degC, scenario.highest_A)
    score = _score(course, best, reach, resistance_ohm)
    return Optimum(course, best.current, best.force, reach, score, iterations, problem.runs, converged)


@dataclass(frozen=True, slots=True, eq=False)
class AgreedOptimum:
    """The better one of two searches, how far apart they ended, and what its driver can reach from there."""

    best: Optimum  # its reach and its score know the driver's limits
    rmse_N: tuple[float, float]  # of the search from nothing, of that from the controllers' currents

    @property
    def agrees(self) -> bool:
        """Whether the two are within ``AGREEMENT``: only then a ratio to the optimum means something."""
        return max(self.rmse_N) <= (1.0 + AGREEMENT) * min(self.rmse_N)


def agreed_optimum(
    plant: Plant,
    scenario: Scenario,
    starts: Sequence[FloatArray],
    *,
    period_s: float = 1e-3,
    most_runs: int = 1000,
    resistance_ohm: float | None = None,
) -> AgreedOptimum:
    """Return the better one of a search from nothing and one from the currents ``starts`` [A] of controllers.

    ``most_runs`` is the budget of each.
    """
    course = reference_trajectory(scenario, plant.step_s)
    degrees, highest = scenario.temperature_degC, scenario.highest_A
    lags = step_lags(plant, course, degrees, highest)
    told = {"period_s": period_s, "memory_s": _memory(lags)}
    cold, warm = (
        search_optimum(plant, scenario, **told, most_runs=most_runs, starts=begin, seed=seed)
        for seed, begin in enumerate(((), starts))
    )
    best = min(cold, warm, key=lambda each: each.score.rmse_N)
    dynamic = dynamic_range(plant, course, best.current, degrees, highest, lead_s=lags.rise_s)
    reach = replace(best.reach, dynamic=dynamic)
    score = _score(course, _Point(best.current, best.force), reach, resistance_ohm)
    return AgreedOptimum(replace(best, reach=reach, score=score), (cold.score.rmse_N, warm.score.rmse_N))


def _memory(lags: StepLags) -> float:
    """Return the time [s] after which a current is no longer felt."""
    return max(_MEMORY * max(lags.rise_s, lags.fall_s), _LEAST_MEMORY_S)


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    """A current [A] and the force [N] that it gives, at the plant's steps."""

    current: FloatArray
    force: FloatArray


def _score(
    course: ReferenceTrajectory, point: _Point, reach: AttainableRange, resistance_ohm: float | None
) -> Score:
    scored = slice(course.scored_from, None)
    return score_forces(
        course.target[scored],
        point.force[scored],
        point.current[scored],
        reach.part(scored),
        step_s=course.step_s,
        resistance_ohm=resistance_ohm,
    )


class _Problem:
    """The scenario on the plant, with a count of how often it was run."""

    def __init__(self, plant: Plant, course: ReferenceTrajectory, scenario: Scenario, most_runs: int) -> None:
        self.course, self.runs, self.most_runs = course, 0, most_runs
        self.highest = scenario.highest_A
        self._plant, self._warm = plant, scenario.temperature_degC

    @property
    def left(self) -> int:
        """How many runs the budget has left."""
        return self.most_runs - self.runs

    def at(self, current: FloatArray) -> _Point:
        """Return what a current gives, clipped to what the driver has."""
        self.runs += 1
        course, clipped = self.course, np.clip(current, 0.0, self.highest)
        force = self._plant.copy().advance_many(course.displacement, course.velocity, clipped, self._warm)
        return _Point(clipped, force)

    def error(self, point: _Point) -> FloatArray:
        """Return force less target [N], zero where it is not scored."""
        error = point.force - self.course.target
        error[: self.course.scored_from] = 0.0
        return error

    def cost(self, point: _Point) -> float:
        """Return the RMS error [N] where it is scored."""
        return float(np.sqrt(np.mean(self.error(point)[self.course.scored_from :] ** 2)))


class _Search:
    """A search on a problem: samples of ``every`` steps, a memory of so many samples."""

    def __init__(self, problem: _Problem, every: int, memory: int, seed: int) -> None:
        self._problem, self._every, self._memory = problem, every, memory
        self._samples = -(-len(problem.course) // every)
        self._trust = np.full(self._samples, _TRUST * problem.highest)
        self._rng = np.random.default_rng(seed)
        self._turn = 0

    def held(self, samples: FloatArray) -> FloatArray:
        """Return at the plant's steps what is held for a sample each."""
        return np.repeat(samples, self._every)[: len(self._problem.course)]

    def start(self, currents: Sequence[FloatArray]) -> _Point:
        """Return the best of these currents, or of constant and static ones, with the others spliced in."""
        problem = self._problem
        if currents:
            tried = [problem.at(self.held(current[:: self._every])) for current in currents]
        else:
            tried = _static(problem, self._every * self._stretch(_COARSEST_S))
        tried.sort(key=problem.cost)
        best = tried[0]
        for other in tried[1:]:
            if problem.left > 0:
                best = self._spliced(best, other)[0]
        return best

    def improve(self, point: _Point) -> tuple[_Point, int, bool]:
        """Return the last point, the iterations, and whether a round ended without gain: not the budget."""
        problem, iterations, first = self._problem, 0, True
        coarsest = self._stretch(_COARSEST_S)
        while True:
            before, length = problem.cost(point), coarsest if first else max(coarsest // 2, 1)
            while length >= 1:
                for _ in range(_TURNS if first and length > 1 else 1):
                    if problem.left < self._blocks_of(length) + 2:
                        return point, iterations, False
                    point, iterations = self._step(point, length), iterations + 1
                length //= 2
            if problem.cost(point) > (1.0 - _LEAST_GAIN) * before and not first:
                return point, iterations, True
            first = False

    def _stretch(self, seconds: float) -> int:
        """Return the samples of a stretch: a power of two."""
        return int(2 ** max(0, round(math.log2(seconds / (self._every * self._problem.course.step_s)))))

    def _blocks_of(self, length: int) -> int:
        """Return how many stretches the memory has: they are measured in as many runs."""
        return max(round(self._memory / length), 1)

    def _step(self, point: _Point, length: int) -> _Point:
        """Return the point after a Gauss-Newton step of stretches of so many samples."""
        problem, every = self._problem, self._every
        offset = int(self._rng.integers(length))
        count = -(-(self._samples + offset) // length)
        edges = np.clip(np.arange(count) * length - offset, 0, None)
        sizes = np.diff(np.append(edges, self._samples))
        mean = np.add.reduceat(point.current[::every], edges) / sizes
        probe = problem.highest * _PROBES[self._turn % len(_PROBES)]
        self._turn += 1
        signs = np.where(self._rng.random(count) < 0.5, 1.0, -1.0)
        signs[mean < probe], signs[mean > problem.highest - probe] = 1.0, -1.0
        slopes = self._derivative(point, probe * signs, length, offset)
        lead = np.zeros(offset * every)
        error = np.concatenate([lead, problem.error(point)])
        band, gradient = _normal_equations(
            slopes, error, problem.course.scored_from + len(lead), length * every
        )
        self._trust = np.maximum(self._trust, _LEAST_FIRST * problem.highest)
        for _ in range(min(_TRIES, problem.left // 2)):
            trust = np.add.reduceat(self._trust, edges) / sizes
            low, high = np.maximum(-trust, -mean), np.minimum(trust, problem.highest - mean)
            step = _boxed_step(band, gradient, low, high)
            moved = problem.at(point.current + self._spread(step, length, offset))
            found, better = self._spliced(point, moved)
            scale = np.where(better, _WIDER, _NARROWER)
            self._trust = np.clip(
                self._trust * scale, _LEAST_TRUST * problem.highest, _MOST_TRUST * problem.highest
            )
            if found is not point:
                return found
        return point

    def _spread(self, values: FloatArray, length: int, offset: int) -> FloatArray:
        """Return at the plant's steps what is held over stretches, the first of them begun before."""
        return self.held(np.repeat(values, length)[offset : offset + self._samples])

    def _derivative(self, point: _Point, moves: FloatArray, length: int, offset: int) -> FloatArray:
        """Return d force / d current [N/A] at the steps after each stretch: stretches x (window * hold)."""
        window, hold = self._blocks_of(length), length * self._every
        slopes = np.zeros((len(moves), window * hold))
        lead = np.zeros(offset * self._every)
        for first in range(min(window, len(moves))):
            some = np.zeros(len(moves))
            some[first::window] = moves[first::window]
            moved = self._problem.at(point.current + self._spread(some, length, offset))
            change = np.concatenate([lead, moved.force - point.force])
            for j in range(first, len(moves), window):
                part = change[j * hold : (j + window) * hold]
                slopes[j, : len(part)] = part / moves[j]
        return slopes

    def _spliced(self, point: _Point, moved: _Point) -> tuple[_Point, BoolArray]:
        """Return the best of a point, another, and the two spliced where the other is better; and there.

        Blocks are as long as the memory, begun at random: what was done in one is hardly felt after the next.
        """
        problem = self._problem
        gain = problem.error(moved) ** 2 - problem.error(point) ** 2
        per_sample = np.add.reduceat(gain, np.arange(0, len(gain), self._every))
        block = (np.arange(self._samples) + int(self._rng.integers(self._memory))) // self._memory
        better: BoolArray = (np.bincount(block, per_sample) < 0.0)[block]
        tried = [moved]
        if better.any() and not better.all() and problem.left > 0:
            taken = np.repeat(better, self._every)[: len(gain)]
            tried.append(problem.at(np.where(taken, moved.current, point.current)))
        best = min(tried, key=problem.cost)
        return best if problem.cost(best) < problem.cost(point) else point, better


def _static(problem: _Problem, hold: int) -> list[_Point]:
    """Return constant currents and static inverses, held for ``hold`` steps."""
    course = problem.course
    levels = np.linspace(0.0, problem.highest, _LEVELS)
    tried = [problem.at(np.full(len(course), level)) for level in levels]
    fine = np.arange(_FINE * (_LEVELS - 1) + 1)
    low = np.minimum(fine // _FINE, _LEVELS - 2)
    share = (fine / _FINE - low)[:, None]
    for preview in _PREVIEWS_S:
        ahead = round(preview / course.step_s) + hold // 2
        at = np.minimum(np.arange(0, len(course), hold) + ahead, len(course) - 1)
        table = np.array([each.force[at] for each in tried[:_LEVELS]])
        given = (1.0 - share) * table[low] + share * table[low + 1]
        place = np.argmin(np.abs(given - course.target[at]), axis=0)
        inverse = np.repeat(problem.highest * place / (len(fine) - 1), hold)
        tried.append(problem.at(inverse[: len(course)]))
    return tried


def _normal_equations(
    slopes: FloatArray, error: FloatArray, scored_from: int, hold: int
) -> tuple[FloatArray, FloatArray]:
    """Return J'J as the upper form of ``scipy.linalg.solveh_banded``, and J'e, of what is scored.

    Rows that are not scored have no error, and are left out of J as well.
    """
    samples, reach = slopes.shape
    window = reach // hold
    padded = np.concatenate([error, np.zeros(samples * hold + reach - len(error))])
    seen = np.lib.stride_tricks.sliding_window_view(padded, reach)[::hold][:samples]
    row = hold * np.arange(samples)[:, None] + np.arange(reach)
    slopes = np.where((row >= scored_from) & (row < len(error)), slopes, 0.0)
    gradient = np.einsum("jr,jr->j", slopes, seen)
    band = np.zeros((window, samples))
    for apart in range(min(window, samples)):
        earlier = slopes[: samples - apart, apart * hold :]
        later = slopes[apart:, : reach - apart * hold]
        band[window - 1 - apart, apart:] = np.einsum("jr,jr->j", earlier, later)
    return band, gradient


def _boxed_step(band: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return a step between ``low`` and ``high`` that makes g's + s'(J'J + damping) s / 2 small.

    Solved, what left the box is put on its side and kept there, and the rest is solved again; what would
    leave its side is then let free, as often as passes are left.
    """
    from scipy.linalg import solveh_banded

    system = band.copy()
    system[-1] += _DAMPING * max(float(system[-1].mean()), 1e-12)
    step: FloatArray = np.zeros(len(gradient))
    stuck = np.zeros(len(gradient), dtype=np.bool_)
    for _ in range(_PASSES):
        # what is stuck moves to the right-hand side
        right = -gradient - _times(system, np.where(stuck, step, 0.0))
        free = system.copy()
        for apart in range(len(system)):
            row = free[len(system) - 1 - apart, apart:]
            row[stuck[apart:] | stuck[: len(stuck) - apart]] = 0.0
        free[-1, stuck] = 1.0
        right[stuck] = step[stuck]
        step = np.asarray(solveh_banded(free, right, overwrite_ab=True, check_finite=False))
        outside = (step < low) | (step > high)
        step = np.clip(step, low, high)
        slope = gradient + _times(system, step)
        leaving = stuck & (((step == low) & (slope < 0.0)) | ((step == high) & (slope > 0.0)))
        if not outside.any() and not leaving.any():
            break
        stuck = (stuck & ~leaving) | outside
    return step


def _times(band: FloatArray, vector: FloatArray) -> FloatArray:
    """Return a symmetric banded matrix, in its upper form, times a vector."""
    product: FloatArray = band[-1] * vector
    for apart in range(1, len(band)):
        row = band[len(band) - 1 - apart, apart:]
        product[apart:] += row * vector[: len(vector) - apart]
        product[: len(vector) - apart] += row * vector[apart:]
    return product
