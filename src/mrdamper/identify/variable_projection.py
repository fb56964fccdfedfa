"""Variable projection with Levenberg-Marquardt: the usual way to fit a damper.

The force is linear in most of its numbers; those are eliminated by least squares at every step, kept
inside the law's conditions (a yield force that is nowhere negative), and only the rest is searched for:

    minimise over theta   min over c   | y - F(theta, c) |^2,   F affine in c.

The derivative of the eliminated problem is taken in Kaufman's approximation: the tangents of theta,
projected off the space of the linear columns. All sums are Gram sums over the runs, so a step costs one
or two passes of the kernel however many numbers there are. A law without linear numbers (the series
valve) is the same algorithm with nothing to eliminate.

Golub & Pereyra (1973), Kaufman (1975): cited from memory, not re-read.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, null_space
from scipy.optimize import nnls
from scipy.stats import qmc

from mrdamper import core
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.problem import (
    FitProblem,
    FitResult,
    Free,
    PreparedFit,
    Start,
    envelope_of,
    lifted,
    move,
    ordered,
)
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial
from mrdamper.models.simulate import LAG, Tangents
from mrdamper.models.temperature import REFERENCE_K

__all__ = ["Objective", "Progress", "Report", "fit_variable_projection", "latin_hypercube"]

FloatArray = NDArray[np.float64]

_COMMANDS = 17  # commands over the data's range at which linear coefficients are kept admissible,
_TEMPERATURES = 3  # at so many temperatures where the form itself depends on temperature
_PULL = 1e-6  # of session offsets towards zero, as a share of what the data say
_LIGHT = 1e-6  # [%^2] that a linear number at its bound costs: one that moves nothing stays near zero
_LONGEST = 1.5  # longest step of a search coordinate per iteration, in e-folds on a log scale
_MOST_ITERATIONS = 150
_DRAWN_PER_NUMBER = 8  # points looked at for each start, per nonlinear number,
_DRAWN = 80  # but no more
_DRAWN_PYTHON = 8  # the same for a law in Python, which is slow
_DESCENDING = 5  # of which so many descend on short stretches
_FEW_ITERATIONS = 10  # of each of those
_FINALISTS = 2  # of which so many go on
_SHORT_ITERATIONS = 30  # for so long


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a fit is: told to the caller after every step."""

    method: str
    start: int
    starts: int
    iteration: int
    cost_percent: float
    best_percent: float


Report = Callable[[Progress], None]


class Objective:
    """The cost of a problem, its Gram sums, and the elimination of the linear numbers.

    Order of the rows of every Gram matrix: the numbers asked for, the session offsets, the residual.
    """

    def __init__(self, problem: FitProblem, runs: Sequence[PreparedFit]) -> None:
        self.problem = problem
        self.runs = tuple(runs)
        self.nonlinear = tuple(free.name for free in problem.nonlinear)
        self.linear = tuple(free.name for free in problem.linear)
        self.sessions = tuple(sorted({run.session for run in runs})) if problem.session_offsets else ()
        self.evaluations = 0
        self._widest = max(len(run.force) for run in runs)
        self._store = np.empty((core.MOST_DIRECTIONS + 2) * self._widest)
        self._drives = [run.drive for run in runs]
        self._rows, self._floor = self._conditions()
        size = np.array([max(abs(free.lower), abs(free.upper)) for free in problem.linear])
        self._light = _LIGHT / size**2

    def gram(self, damper: Damper, numbers: Sequence[str], offsets: Mapping[str, float]) -> FloatArray:
        """Return the weighted Gram matrix of the tangents, session offsets and residual at a damper."""
        self.evaluations += 1
        size = len(numbers) + len(self.sessions) + 1
        total = np.zeros((size, size))
        tangents = Tangents(damper, numbers, self._drives)
        for index, run in enumerate(self.runs):
            n = len(run.force)
            store = self._store[: (core.MOST_DIRECTIONS + 2) * n].reshape(-1, n)
            s = tangents.along(index, store=store)
            d = len(s.columns)
            if not np.shares_memory(store, s.columns):
                store[:d] = s.columns
            store[d] = 1.0
            np.subtract(run.force, s.force, out=store[d + 1])
            if run.session in offsets:
                store[d + 1] -= offsets[run.session]
            g = core.gram(store[: d + 2], run.start)
            spread = np.zeros((size, d + 2))
            spread[: len(numbers), :d] = s.combine
            if self.sessions:
                spread[len(numbers) + self.sessions.index(run.session), d] = 1.0
            spread[-1, d + 1] = 1.0
            total += run.weight * (spread @ g @ spread.T)
        # What all sessions share is the law's own offset: a light pull of each tare towards zero.
        pull = _PULL * float(np.mean(np.diag(total)[len(numbers) : -1])) if self.sessions else 0.0
        for place, session in enumerate(self.sessions, len(numbers)):
            tare = offsets.get(session, 0.0)
            total[place, place] += pull
            total[place, -1] -= pull * tare
            total[-1, place] -= pull * tare
            total[-1, -1] += pull * tare**2
        return total

    def eliminate(
        self, damper: Damper, offsets: Mapping[str, float], *, tangents: bool = True
    ) -> tuple[float, Damper, dict[str, float], FloatArray | None]:
        """Return the cost [%^2] with the best linear numbers, the damper that has them, and the offsets.

        When there is nothing to eliminate, the Gram matrix of the nonlinear numbers comes as well (unless
        ``tangents`` are not wanted).
        """
        if not self.linear and not self.sessions:
            g = self.gram(damper, self.nonlinear if tangents else (), offsets)
            return float(g[-1, -1]), damper, {}, g if tangents else None
        g = self.gram(damper, self.linear, offsets)
        values = damper.numbers
        present = np.array([values[name] for name in self.linear])
        floor = self._floor - self._rows[:, : len(present)] @ present
        pulled, right = g[:-1, :-1].copy(), g[:-1, -1].copy()
        places = np.arange(len(present))
        pulled[places, places] += self._light
        right[places] -= self._light * present
        moved = _bounded_least_squares(pulled, right, self._rows, floor)
        cost = float(g[-1, -1] - 2.0 * moved @ g[:-1, -1] + moved @ g[:-1, :-1] @ moved)
        change = dict(zip(self.linear, (present + moved[: len(present)]).tolist(), strict=True))
        shifts = moved[len(present) :].tolist()
        tares = {s: offsets.get(s, 0.0) + d for s, d in zip(self.sessions, shifts, strict=True)}
        return max(cost, 0.0), move(damper, change), tares, None

    def projected(
        self, damper: Damper, offsets: Mapping[str, float], g: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the Gauss-Newton matrix and gradient of the nonlinear numbers, linear ones projected out."""
        names = (*self.nonlinear, *self.linear)
        if g is None:
            g = self.gram(damper, names, offsets)
        n = len(self.nonlinear)
        hessian, gradient = g[:n, :n], g[:n, -1]
        if len(names) + len(self.sessions) == n:
            return hessian, gradient
        inner, cross, right = g[n:-1, n:-1], g[n:-1, :n], g[n:-1, -1]
        values = damper.numbers
        present = np.array([values[name] for name in self.linear])
        slack = self._rows[:, : len(present)] @ present - self._floor
        size = np.abs(self._rows[:, : len(present)]) @ np.abs(present)
        active = self._rows[slack <= 1e-7 * size]
        if len(active):
            basis = null_space(active / np.linalg.norm(active, axis=1, keepdims=True))
            inner, cross, right = basis.T @ inner @ basis, basis.T @ cross, basis.T @ right
        if not len(inner):
            return hessian, gradient
        solved = _solve_scaled(inner, np.column_stack([cross, right]))
        return hessian - cross.T @ solved[:, :n], gradient - cross.T @ solved[:, n]

    def _conditions(self) -> tuple[FloatArray, FloatArray]:
        """Return rows A and floor b of A c >= b: every linear coefficient admissible at the commands."""
        template = self.problem.template
        envelope = envelope_of(self.problem.runs)
        grid = np.unique(np.linspace(*envelope.command, _COMMANDS))
        warm = np.unique(np.linspace(*(template.temperature_range or (REFERENCE_K,) * 2), _TEMPERATURES))
        width = len(self.linear) + len(self.sessions)
        rows: list[FloatArray] = []
        floor: list[float] = []
        for name, law in template.coefficients.items():
            members = [i for i, number in enumerate(self.linear) if number.partition(".")[0] == name]
            least = template.law[name].lower
            if not members or not np.isfinite(least):
                continue
            at = np.array([law.number_names.index(self.linear[i].partition(".")[2]) for i in members])
            commands, temperatures = (
                each.ravel()
                for each in np.meshgrid(
                    grid if law.kind != "constant" else grid[:1],
                    warm if isinstance(law, Bipolynomial) else [REFERENCE_K],
                )
            )
            held = [0.0 if i in at else number for i, number in enumerate(law.numbers)]
            # The share of the numbers that do not move.
            fixed = law.with_numbers(held).value(commands, temperatures)
            for gradient, share in zip(law.gradient(commands, temperatures).T, fixed, strict=True):
                if gradient[at].any():
                    row = np.zeros(width)
                    row[members] = gradient[at]
                    rows.append(row)
                    floor.append(least - share)
        return np.array(rows).reshape(len(rows), width), np.array(floor)


def fit_variable_projection(
    problem: FitProblem,
    *,
    starts: int = 1,
    seed: int = 0,
    report: Report | None = None,
    first: Damper | None = None,
    prepared: Sequence[PreparedFit] | None = None,
) -> FitResult:
    """Fit by variable projection from ``starts`` Latin-hypercube starts; the best one is returned.

    Parameters
    ----------
    first : a damper to start from as well, before the drawn ones (a former fit); alone with ``starts=0``
    prepared : the runs as ``problem.prepare()`` gives them, for many fits of one set of runs
    report : told of every accepted step; an interrupt (Ctrl-C) keeps the best so far

    Raises
    ------
    ConvergenceError
        No start found a finite cost.
    """
    clock = time.process_time()
    full = problem.prepare() if prepared is None else tuple(prepared)
    objective = Objective(problem, full)
    count = starts if problem.nonlinear else 1
    origins: Iterator[_State] = _screened(problem, count, seed)
    if first is not None:
        origins = itertools.chain([_opening(objective, first)], origins)
        count += 1
    outcomes: list[Start] = []
    history: list[float] = []
    best: _State | None = None
    cancelled = False
    try:
        for index, origin in enumerate(origins):
            for state in _descend(objective, origin.point, origin.damper, _MOST_ITERATIONS):
                if best is None or state.cost < best.cost:
                    best = state
                history.append(float(np.sqrt(best.cost)))
                if report:
                    now = float(np.sqrt(state.cost))
                    report(Progress("varpro", index, count, state.iteration, now, history[-1]))
            spent = origin.evaluations + state.evaluations
            outcomes.append(Start(index, float(np.sqrt(state.cost)), spent, state.converged))
    except KeyboardInterrupt:
        if best is None:
            raise
        cancelled = True
    if best is None or not np.isfinite(best.cost):
        raise ConvergenceError(
            f"{problem.template.law.name}: no start reached a finite cost in {count} tries; check the runs "
            "(mrdamper predict shows them) or give more --starts"
        )
    damper = ordered(lifted(problem, best.damper))
    numbers, correlation = estimates_of(problem, full, damper, best.offsets)
    return FitResult(
        damper=damper,
        method="varpro",
        cost_percent=float(np.sqrt(best.cost)),
        estimates=numbers,
        correlation=correlation,
        starts=tuple(outcomes),
        offsets_N=best.offsets,
        history=tuple(history),
        seed=seed,
        cpu_s=time.process_time() - clock,
        cancelled=cancelled,
    )


def latin_hypercube(free: Sequence[Free], count: int, seed: int) -> FloatArray:
    """Return ``count`` starts in search coordinates, spread over the inner four fifths of the bounds."""
    unit = qmc.LatinHypercube(len(free), rng=np.random.default_rng(seed)).random(count)
    low = np.array([float(f.inward(f.lower)) for f in free])
    high = np.array([float(f.inward(f.upper)) for f in free])
    return np.asarray(low + (0.1 + 0.8 * unit) * (high - low))


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Where a descent stands."""

    point: FloatArray
    damper: Damper
    offsets: dict[str, float]
    cost: float
    gram: FloatArray | None
    iteration: int
    evaluations: int
    converged: bool


def _opening(objective: Objective, damper: Damper) -> _State:
    """Return the state at a given damper, its numbers brought inside the bounds."""
    values = {**damper.numbers, LAG: damper.command_lag_s}
    free = objective.problem.nonlinear
    point = np.array([float(f.inward(min(max(values[f.name], f.lower), f.upper))) for f in free])
    cost, damper, offsets, g = objective.eliminate(_at(objective.problem, point), {})
    return _State(point, damper, offsets, cost, g, 0, 1, not free)


def _at(problem: FitProblem, point: FloatArray) -> Damper:
    """Return the template at a point in search coordinates."""
    return move(
        problem.template, {f.name: f.outward(u) for f, u in zip(problem.nonlinear, point, strict=True)}
    )


def _off_the_bounds(problem: FitProblem, point: FloatArray) -> FloatArray | None:
    """Return the point with every number that sits on a bound put back to mid-range; None when none does.

    A term that has died (a yield velocity beyond all speeds) leaves its numbers on bounds; from mid-range
    it may come to life again.
    """
    low = np.array([float(f.inward(f.lower)) for f in problem.nonlinear])
    high = np.array([float(f.inward(f.upper)) for f in problem.nonlinear])
    stuck = (point <= low) | (point >= high)
    return np.where(stuck, 0.5 * (low + high), point) if stuck.any() else None


def _screened(problem: FitProblem, starts: int, seed: int) -> Iterator[_State]:
    """Yield one promising place for each start.

    Wide bounds hold regions from which no descent finds home (a valve that never moves). Each start
    draws many Latin-hypercube points, looks at them on a short stretch of every run, lets the best few
    descend there, and hands on the one that came furthest.
    """
    if not problem.nonlinear:
        yield _State(np.empty(0), problem.template, {}, np.inf, None, 0, 0, converged=True)
        return
    objective = Objective(problem, problem.prepare(excerpt=True))
    count = min(_DRAWN, _DRAWN_PER_NUMBER * max(len(problem.nonlinear), 2))
    if problem.template.law.kernel is None:
        count = _DRAWN_PYTHON
    for index in range(starts):
        before = objective.evaluations
        costs: list[tuple[float, int]] = []
        drawn = latin_hypercube(problem.nonlinear, count, seed + 7919 * index)
        for place, point in enumerate(drawn):
            cost = objective.eliminate(_at(problem, point), {}, tangents=False)[0]
            costs.append((cost if np.isfinite(cost) else np.inf, place))
        tried = []
        for _, place in sorted(costs)[: min(_DESCENDING, count // 8)]:
            *_, state = _descend(objective, drawn[place], _at(problem, drawn[place]), _FEW_ITERATIONS)
            tried.append(state)
        best: _State | None = None
        for finalist in sorted(tried, key=lambda s: s.cost)[:_FINALISTS]:
            *_, state = _descend(objective, finalist.point, finalist.damper, _SHORT_ITERATIONS)
            freed = _off_the_bounds(problem, state.point)
            if freed is not None:
                *_, other = _descend(objective, freed, _at(problem, freed), _SHORT_ITERATIONS)
                state = min(state, other, key=lambda s: s.cost)
            if best is None or state.cost < best.cost:
                best = state
        if best is not None:
            yield replace(best, evaluations=objective.evaluations - before)


def _descend(objective: Objective, point: FloatArray, damper: Damper, most: int) -> Iterator[_State]:
    """Yield the states of one Levenberg-Marquardt descent, the first and every accepted one."""
    free = objective.problem.nonlinear
    low = np.array([float(f.inward(f.lower)) for f in free])
    high = np.array([float(f.inward(f.upper)) for f in free])
    width = high - low
    log = np.array([f.scale == "log" for f in free])
    longest = np.where(log, _LONGEST, 0.3 * width)
    before = objective.evaluations

    cost, damper, offsets, g = objective.eliminate(damper, {})
    state = _State(point, damper, offsets, cost, g, 0, 1, not len(free))
    yield state
    if not len(free):
        return
    damping, growth = 1e-2, 2.0
    quiet = 0
    for iteration in range(1, most + 1):
        hessian, gradient = objective.projected(state.damper, state.offsets, state.gram)
        chain = np.where(log, np.array([f.outward(u) for f, u in zip(free, state.point, strict=True)]), 1.0)
        hessian, gradient = hessian * np.outer(chain, chain), gradient * chain
        inside = ~(((state.point <= low) & (gradient < 0.0)) | ((state.point >= high) & (gradient > 0.0)))
        accepted = None
        while damping < 1e12:
            step = _damped_step(hessian, gradient, inside, damping)
            step *= min(1.0, float(np.min(longest / np.maximum(np.abs(step), 1e-300))))
            trial = np.clip(state.point + step, low, high)
            step = trial - state.point
            promised = float(2.0 * step @ gradient - step @ hessian @ step)
            if not np.any(step) or 0.0 <= promised <= 1e-9 * state.cost:
                break
            if promised < 0.0:  # a bound bent the step uphill
                damping *= growth
                growth *= 2.0
                continue
            values = {f.name: f.outward(u) for f, u in zip(free, trial, strict=True)}
            new, damper, offsets, g = objective.eliminate(move(state.damper, values), state.offsets)
            if np.isfinite(new) and new < state.cost:
                kept = (state.cost - new) / promised
                damping *= max(0.1, 1.0 - (2.0 * kept - 1.0) ** 3)
                growth = 2.0
                accepted = (trial, damper, offsets, new, g)
                break
            damping *= growth
            growth *= 2.0
        spent = objective.evaluations - before
        if accepted is None:
            yield replace(state, iteration=iteration, evaluations=spent, converged=True)
            return
        quiet = quiet + 1 if state.cost - accepted[3] < 1e-5 * state.cost else 0
        state = _State(*accepted, iteration, spent, quiet >= 2)
        yield state
        if state.converged:
            return


def _damped_step(
    hessian: FloatArray, gradient: FloatArray, inside: NDArray[np.bool_], damping: float
) -> FloatArray:
    """Return the Marquardt step of the coordinates that are free to move."""
    step = np.zeros(len(gradient))
    if not inside.any():
        return step
    h = hessian[np.ix_(inside, inside)]
    scale = np.diag(h).copy()
    scale[scale <= 0.0] = 1e-300
    h = h + np.diag(damping * scale + 1e-14 * scale.max())
    step[inside] = _solve_scaled(h, gradient[inside])
    return step


def _solve_scaled(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a positive semi-definite system, rows scaled to a unit diagonal, lightly regularised."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-12
    shaped = scale if right.ndim == 1 else scale[:, None]
    try:
        return np.asarray(shaped * cho_solve(cho_factor(scaled), shaped * right))
    except np.linalg.LinAlgError:
        return np.asarray(shaped * np.linalg.lstsq(scaled, shaped * right, rcond=1e-12)[0])


def _bounded_least_squares(
    matrix: FloatArray, right: FloatArray, rows: FloatArray, floor: FloatArray
) -> FloatArray:
    """Minimise x'Mx/2 - r'x subject to rows x >= floor.

    Unconstrained where that is admissible; otherwise the least-distance form of Lawson & Hanson, one
    non-negative least squares.
    """
    solution = _solve_scaled(matrix, right)
    slack = rows @ solution - floor
    if not len(rows) or np.all(slack >= -1e-12 * (np.abs(rows) @ np.abs(solution) + np.abs(floor))):
        return solution
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-10
    factor = np.linalg.cholesky(scaled).T
    # z = R (x / scale) - d, d = R x_free / scale: minimise |z| subject to G z >= h.
    g = np.linalg.solve(factor.T, (rows * scale).T).T
    h = floor - rows @ solution
    norm = np.linalg.norm(g, axis=1)
    g, h = g / norm[:, None], h / norm
    size_h = float(np.abs(h).max())
    target = np.zeros(len(g[0]) + 1)
    target[-1] = 1.0
    u, _ = nnls(np.vstack([g.T, (h / size_h)[None, :]]), target)
    residual = np.vstack([g.T, (h / size_h)[None, :]]) @ u - target
    if abs(residual[-1]) < 1e-14:
        raise InputError("the law's conditions leave no admissible linear coefficients")
    z = -residual[:-1] / residual[-1] * size_h
    return np.asarray(solution + scale * np.linalg.solve(factor, z))
