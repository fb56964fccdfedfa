"""The offline optimum: the current of least RMS error, searched with perfect knowledge of the damper.

No controller has this: it tries futures on the very damper, without noise, and knows target and motion to
the end. What is left of the error is the damper's: its lag, and where it cannot push. It is what a tracking
error is to be measured against.

The search is a projected Gauss-Newton one over the current of every sample, held in between. The force's
derivative by each sample's current is measured: currents that lie further apart than the damper's memory are
moved at once, so that one derivative costs as many runs as the memory has samples. The normal equations are
banded. It starts from the best of constant currents and of static inverses with preview, and never gets
worse. It is a search, not a proof: only where a second one, which
starts from what a controller did, ends within ``AGREEMENT`` of it is it taken for the optimum
(``agreed_optimum``). The budget is stated and kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.loop import ReferenceTrajectory, reference_trajectory, steps_per_sample
from mrdamper.control.protocol import Plant
from mrdamper.control.scenario import Scenario
from mrdamper.control.score import AttainableRange, Score, attainable_range, score_forces
from mrdamper.errors import InputError

AGREEMENT = 0.03
"""How far apart the RMS errors of two independent searches may end, of the lower one."""

_LEVELS = 9  # constant currents that the search starts from
_PREVIEWS_S = (0.0, 6e-3, 10e-3, 14e-3, 18e-3)  # of the static inverses that it starts from
_COARSEST_S = 8e-3  # hold of the first stage; then half of it, and so on: fewer poor optima on the way
_FINE = 20  # currents between two levels, for the inverse
# How far currents are moved to measure the derivative, in turn: the force has kinks (lags that differ up and
# down, magnetic play), which a small move sees and a large one smooths.
_PROBES_A = (0.3, 0.1)
_TRUST_A = 0.3  # how far the first step may move a current; more after a good step, less after a bad one
_LEAST_FIRST_A = 0.05
_LEAST_TRUST_A = 4e-3
_DAMPING = 1e-4  # of the mean diagonal: keeps currents that are not felt where they are
_PASSES = 12  # of the bounded least-squares problem
_LEAST_GAIN = 1e-3  # of the RMS error in one iteration, else the search is done


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
    memory_s: float = 0.06,
    most_runs: int = 1000,
    resistance_ohm: float | None = None,
    start: FloatArray | None = None,
) -> Optimum:
    """Return the current of least RMS error over the scored part of a scenario.

    Parameters
    ----------
    plant : the damper, in the state that the scenario begins with; it is copied
    scenario : its sensors and disturbances play no part
    period_s : how long a current is held
    memory_s : how long a current is felt, at least four times the damper's lag
    most_runs : budget: simulations of the whole scenario
    start : current [A] at the plant's steps to begin from; None: the best of constant and static ones

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
    problem = _Problem(plant, course, scenario, most_runs)
    coarsest = every * 2 ** max(0, round(math.log2(_COARSEST_S / period_s)))
    if start is None:
        current, force = _start(problem, coarsest)
    else:
        coarsest = every
        current = problem.held(np.clip(start[::every], 0.0, scenario.highest_A), every)
        force = problem.force(current)
    iterations, hold, converged = 0, coarsest, False
    while hold >= every:
        current, force, more, converged = _descend(problem, current, force, hold, memory_s)
        iterations, hold = iterations + more, hold // 2
    reach = attainable_range(plant, course, scenario.temperature_degC, scenario.highest_A)
    begin = course.scored_from
    score = score_forces(
        course.target[begin:],
        force[begin:],
        current[begin:],
        AttainableRange(reach.low[begin:], reach.high[begin:]),
        step_s=course.step_s,
        resistance_ohm=resistance_ohm,
    )
    return Optimum(course, current, force, reach, score, iterations, problem.runs, converged)


@dataclass(frozen=True, slots=True, eq=False)
class AgreedOptimum:
    """The better one of two searches, and how far apart they ended."""

    best: Optimum
    rmse_N: tuple[float, float]  # of the search from nothing, of that from a controller's current

    @property
    def agrees(self) -> bool:
        """Whether the two are within ``AGREEMENT``: only then a ratio to the optimum means something."""
        return max(self.rmse_N) <= (1.0 + AGREEMENT) * min(self.rmse_N)


def agreed_optimum(
    plant: Plant,
    scenario: Scenario,
    start: FloatArray,
    *,
    period_s: float = 1e-3,
    most_runs: int = 1000,
    resistance_ohm: float | None = None,
) -> AgreedOptimum:
    """Return the better one of a search from nothing and one from the current ``start`` [A] of a controller.

    ``most_runs`` is the budget of each.
    """
    cold, warm = (
        search_optimum(
            plant,
            scenario,
            period_s=period_s,
            most_runs=most_runs,
            resistance_ohm=resistance_ohm,
            start=begin,
        )
        for begin in (None, start)
    )
    best = min(cold, warm, key=lambda each: each.score.rmse_N)
    return AgreedOptimum(best, (cold.score.rmse_N, warm.score.rmse_N))


class _Problem:
    """The scenario on the plant, with a count of how often it was run. Currents are at the plant's steps."""

    def __init__(self, plant: Plant, course: ReferenceTrajectory, scenario: Scenario, most_runs: int) -> None:
        self.course, self.runs, self.most_runs = course, 0, most_runs
        self.highest = scenario.highest_A
        self._plant, self._warm = plant, scenario.temperature_degC

    def held(self, samples: FloatArray, hold: int) -> FloatArray:
        """Return the current at the plant's steps of one that is held for so many of them."""
        return np.repeat(samples, hold)[: len(self.course)]

    def force(self, current: FloatArray) -> FloatArray:
        """Return the force [N]."""
        self.runs += 1
        course = self.course
        return self._plant.copy().advance_many(course.displacement, course.velocity, current, self._warm)

    def error(self, force: FloatArray) -> FloatArray:
        """Return force less target [N], zero where it is not scored."""
        error = force - self.course.target
        error[: self.course.scored_from] = 0.0
        return error

    def cost(self, force: FloatArray) -> float:
        """Return the RMS error [N] where it is scored."""
        return float(np.sqrt(np.mean((force - self.course.target)[self.course.scored_from :] ** 2)))


def _descend(
    problem: _Problem, current: FloatArray, force: FloatArray, hold: int, memory_s: float
) -> tuple[FloatArray, FloatArray, int, bool]:
    """Improve a current that is held for ``hold`` steps; return it, force, iterations, and if it ended."""
    window = max(round(memory_s / (hold * problem.course.step_s)), 1)
    iterations, trust, failed = 0, _TRUST_A, 0
    while failed < len(_PROBES_A) and problem.runs + window + 1 <= problem.most_runs:
        before, samples = problem.cost(force), current[::hold]
        slopes = _derivative(problem, samples, force, hold, window, _PROBES_A[iterations % len(_PROBES_A)])
        band, gradient = _normal_equations(slopes, problem.error(force), problem.course.scored_from, hold)
        iterations, taken, trust = iterations + 1, False, max(trust, _LEAST_FIRST_A)
        while not taken and trust >= _LEAST_TRUST_A and problem.runs < problem.most_runs:
            low, high = np.maximum(-trust, -samples), np.minimum(trust, problem.highest - samples)
            moved = np.clip(samples + _boxed_step(band, gradient, low, high), 0.0, problem.highest)
            tried = problem.held(moved, hold)
            given = problem.force(tried)
            taken = problem.cost(given) < before
            if taken:
                current, force = tried, given
            trust *= 1.5 if taken else 0.4
        failed = 0 if problem.cost(force) < (1.0 - _LEAST_GAIN) * before else failed + 1
    return current, force, iterations, failed == len(_PROBES_A)


def _start(problem: _Problem, hold: int) -> tuple[FloatArray, FloatArray]:
    """Return the best of constant currents and static inverses, held for ``hold`` steps, and its force."""
    course = problem.course
    levels = np.linspace(0.0, problem.highest, _LEVELS)
    tried = [(each, problem.force(each)) for each in (np.full(len(course), level) for level in levels)]
    fine = np.arange(_FINE * (_LEVELS - 1) + 1)
    low = np.minimum(fine // _FINE, _LEVELS - 2)
    share = (fine / _FINE - low)[:, None]
    for preview in _PREVIEWS_S:
        ahead = round(preview / course.step_s) + hold // 2
        at = np.minimum(np.arange(0, len(course), hold) + ahead, len(course) - 1)
        table = np.array([force[at] for _, force in tried[:_LEVELS]])
        given = (1.0 - share) * table[low] + share * table[low + 1]
        place = np.argmin(np.abs(given - course.target[at]), axis=0)
        inverse = problem.held(problem.highest * place / (len(fine) - 1), hold)
        tried.append((inverse, problem.force(inverse)))
    return min(tried, key=lambda pair: problem.cost(pair[1]))


def _derivative(
    problem: _Problem, samples: FloatArray, force: FloatArray, hold: int, window: int, probe_A: float
) -> FloatArray:
    """Return d force / d current [N/A] at the steps after each sample, shape (samples, window * hold)."""
    slopes = np.zeros((len(samples), window * hold))
    move = np.where(samples + probe_A <= problem.highest, probe_A, -probe_A)
    for first in range(min(window, len(samples))):
        moved = samples.copy()
        moved[first::window] += move[first::window]
        change = problem.force(problem.held(moved, hold)) - force
        for j in range(first, len(samples), window):
            part = change[j * hold : (j + window) * hold]
            slopes[j, : len(part)] = part / move[j]
    return slopes


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
