"""The cost of a problem with its linear parameters eliminated, for many candidates at once.

At every set of nonlinear parameters the best linear ones follow from the Gram sums, kept inside the law's
conditions (a yield force that is nowhere negative). One pass gives the cost and, in Kaufman's
approximation, the Gauss-Newton matrix of what remains. Where to go next is the business of ``descent``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import BoolArray, FloatArray, inverse_sizes
from mrdamper.errors import InputError
from mrdamper.identify.problem import FitProblem, PreparedFit, envelope_of
from mrdamper.identify.search.gram_sums import GramSums
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial
from mrdamper.quantities import REFERENCE_K
from mrdamper.runtime.pool import ONE_CORE, Pool

_COMMANDS = 17  # commands over the data's range at which linear coefficients are kept admissible,
_TEMPERATURES = 3  # at so many temperatures where the form itself depends on temperature
_LIGHT = 1e-6  # [%^2] that a linear parameter at its bound costs: one that moves nothing stays near zero
_RESOLVED = 1e-9  # share of the guess' own cost below which what is left has no digits
_PIECE = 16  # candidates, a multiple of the kernel's lanes, that a core takes at a time
_ROUNDS = 12  # of active sets, before the slower way is taken
_HOLD = 1e8  # stiffness, beside one, of a condition that holds with equality


@dataclass(frozen=True, slots=True, eq=False)
class Eliminated:
    """Candidates with their best linear parameters; the first axis of everything counts candidates.

    ``gram`` has rows for the nonlinear and linear parameters, the sessions and the residual, the residual
    being that of the best linear parameters; the tangents are those of the linear parameters that were
    guessed. ``drift`` says how far off the guess was: the force that changed over the force there is.
    """

    cost: FloatArray  # [%^2]
    linear: FloatArray
    session_offsets: FloatArray  # [N]
    gram: FloatArray | None
    drift: FloatArray


class Objective:
    """The cost of a problem on prepared runs, its Gram sums, and the elimination of the linear parameters.

    ``like`` is an objective of the same problem on other runs: what depends on the problem alone is shared.
    """

    def __init__(
        self, problem: FitProblem, runs: Sequence[PreparedFit], *, like: Objective | None = None
    ) -> None:
        self.problem = problem
        self.runs = tuple(runs)
        self.nonlinear = tuple(free.name for free in problem.nonlinear)
        self.linear = tuple(free.name for free in problem.linear)
        self.sessions = tuple(sorted({run.session for run in runs})) if problem.session_offsets else ()
        self.evaluations = 0
        names = (*self.nonlinear, *self.linear)
        self._all = GramSums(problem.template, names, names, runs, self.sessions)
        self._inner = GramSums(problem.template, names, self.linear, runs, self.sessions)
        self.conditions: tuple[FloatArray, FloatArray] = (
            self._conditions() if like is None else like.conditions
        )
        self._rows, self._floor = self.conditions
        size = np.array([max(abs(free.lower), abs(free.upper)) for free in problem.linear])
        self._light = np.concatenate([_LIGHT / size**2, np.zeros(len(self.sessions))])

    def gram(self, damper: Damper, parameters: Sequence[str], offsets: Mapping[str, float]) -> FloatArray:
        """Return the weighted Gram matrix of the tangents, session offsets and residual at a damper."""
        self.evaluations += 1
        sums = GramSums(damper, (), parameters, self.runs, self.sessions)
        gram: FloatArray = sums.at(np.empty((1, 0)), self._session_offsets(offsets))[0]
        return gram

    def candidate_of(self, damper: Damper) -> tuple[FloatArray, FloatArray]:
        """Return a damper's nonlinear and linear parameters, as one candidate."""
        values = damper.parameters_and_lag
        return (
            np.array([[values[name] for name in self.nonlinear]]),
            np.array([[values[name] for name in self.linear]]),
        )

    def eliminate(
        self, nonlinear: FloatArray, linear: FloatArray, session_offsets: FloatArray, *, tangents: bool = True
    ) -> Eliminated:
        """Return candidates with their best linear parameters, from a guess of those.

        ``tangents`` are those of the nonlinear parameters; without them there is no Gram matrix. A cost is
        the difference of sums as large as the guess' own cost: where that leaves no digits, what was found is
        the next guess, and where it still leaves none, that guess and its cost stand.
        """
        found, blurred = self._from_guess(nonlinear, linear, session_offsets, tangents=tangents, last=False)
        k = np.flatnonzero(blurred)
        if len(k):
            again, _ = self._from_guess(
                nonlinear[k], found.linear[k], found.session_offsets[k], tangents=tangents, last=True
            )
            found.cost[k], found.linear[k], found.session_offsets[k] = (
                again.cost,
                again.linear,
                again.session_offsets,
            )
            found.drift[k] = again.drift
            if found.gram is not None:
                found.gram[k] = again.gram
        return found

    def _from_guess(
        self,
        nonlinear: FloatArray,
        linear: FloatArray,
        session_offsets: FloatArray,
        *,
        tangents: bool,
        last: bool,
    ) -> tuple[Eliminated, BoolArray]:
        """Do it in one pass; say which costs have no digits (of the ``last`` pass, the guess' stand then)."""
        g = self.sums(nonlinear, linear, session_offsets, tangents=tangents)
        skip = len(self.nonlinear) if tangents else 0
        inner, right = g[:, skip:-1, skip:-1], g[:, skip:-1, -1]
        guessed = g[:, -1, -1].copy()
        if not inner.shape[1]:
            nothing = np.zeros(len(g))
            return Eliminated(
                guessed, linear, session_offsets, g if tangents else None, nothing
            ), nothing > 0.0
        count = len(self.linear)
        present = np.concatenate([linear, session_offsets], axis=1)
        floor = self._floor - linear @ self._rows[:, :count].T
        pulled = inner + np.diag(self._light)
        moved = _bounded_least_squares(pulled, right - self._light * present, self._rows, floor)
        change = np.einsum("bij,bj->bi", inner, moved)
        cost = np.maximum(guessed + np.sum(moved * (change - 2.0 * right), axis=1), 0.0)
        blurred = cost < _RESOLVED * guessed
        if last:
            moved[blurred], change[blurred], cost[blurred] = 0.0, 0.0, guessed[blurred]
        present += moved
        force = np.einsum("bi,bij,bj->b", present[:, :count], inner[:, :count, :count], present[:, :count])
        drift = np.sqrt(np.maximum(np.sum(moved * change, axis=1), 0.0) / np.maximum(force, 1e-300))
        if tangents:
            g[:, :-1, -1] -= np.einsum("bij,bj->bi", g[:, :-1, skip:-1], moved)
            g[:, -1, :-1] = g[:, :-1, -1]
            g[:, -1, -1] = cost
        found = Eliminated(cost, present[:, :count], present[:, count:], g if tangents else None, drift)
        return found, blurred

    def sums(
        self, nonlinear: FloatArray, linear: FloatArray, session_offsets: FloatArray, *, tangents: bool = True
    ) -> FloatArray:
        """Return the Gram matrices at candidates; without ``tangents``, of the linear parameters alone."""
        self.evaluations += len(nonlinear)
        values = np.concatenate([nonlinear, linear], axis=1)
        return (self._all if tangents else self._inner).at(values, session_offsets)

    def linear_sums(
        self, nonlinear: FloatArray, linear: FloatArray, session_offsets: FloatArray, pool: Pool
    ) -> FloatArray:
        """Return the Gram matrices of the linear parameters alone, candidates in pieces on a pool's cores.

        The pieces are the same for any number of jobs.
        """
        self.evaluations += len(nonlinear)
        values = np.concatenate([nonlinear, linear], axis=1)
        pieces = [slice(begin, begin + _PIECE) for begin in range(0, len(values), _PIECE)]
        if self.problem.template.law.kernel is None:
            pool = ONE_CORE  # a law in Python may keep something between two calls
        found = pool.map(lambda at: self._inner.at(values[at], session_offsets[at]), pieces, threads=True)
        return np.concatenate(list(found))

    def projected(self, g: FloatArray, linear: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return Gauss-Newton matrices and gradients of the nonlinear parameters, linear ones projected out.

        The third array says how linear parameters and offsets follow a change of the nonlinear ones.
        """
        n, count = len(self.nonlinear), len(self.linear)
        hessian, gradient = g[:, :n, :n], g[:, :n, -1]
        if g.shape[1] == n + 1:
            return hessian, gradient, np.empty((len(g), 0, n))
        inner, both = g[:, n:-1, n:-1], np.concatenate([g[:, n:-1, :n], g[:, n:-1, -1:]], axis=2)
        rows = self._rows
        if len(rows):
            slack = linear @ rows[:, :count].T - self._floor
            active = slack <= 1e-7 * (np.abs(linear) @ np.abs(rows[:, :count]).T)
            if active.any():  # a condition that holds with equality: stiff against leaving it
                spread = 1.0 / np.maximum(np.diagonal(inner, axis1=1, axis2=2), 1e-300)
                stiffness = _HOLD * active / (spread @ (rows**2).T)
                inner = inner + (rows.T * stiffness[:, None, :]) @ rows
        solved = solve_scaled(inner, both)
        reduced = g[:, :n, n:-1] @ solved
        return hessian - reduced[:, :, :n], gradient - reduced[:, :, n], -solved[:, :, :n]

    def _session_offsets(self, offsets: Mapping[str, float]) -> FloatArray:
        return np.array([[offsets.get(session, 0.0) for session in self.sessions]], dtype=np.float64)

    def _conditions(self) -> tuple[FloatArray, FloatArray]:
        """Return rows A and floor b of A c >= b: every linear coefficient admissible at the commands."""
        template = self.problem.template
        envelope = envelope_of(self.problem.runs)
        grid = np.unique(np.linspace(*envelope.command, _COMMANDS))
        kelvin = np.unique(np.linspace(*(template.temperature_range or (REFERENCE_K,) * 2), _TEMPERATURES))
        width = len(self.linear) + len(self.sessions)
        rows: list[FloatArray] = []
        floor: list[float] = []
        for name, law in template.coefficients.items():
            members = [i for i, number in enumerate(self.linear) if number.partition(".")[0] == name]
            least = template.law[name].lower
            if not members or not np.isfinite(least):
                continue
            at = np.array([law.parameter_names.index(self.linear[i].partition(".")[2]) for i in members])
            commands, temperatures = (
                each.ravel()
                for each in np.meshgrid(
                    grid if law.kind != "constant" else grid[:1],
                    kelvin if isinstance(law, Bipolynomial) else [REFERENCE_K],
                )
            )
            held = [0.0 if i in at else number for i, number in enumerate(law.parameters)]
            # The share of the parameters that do not move.
            fixed = law.with_parameters(held).value(commands, temperatures)
            gradients = law.gradient(commands, temperatures)[at].T
            for k in _needed(gradients, least - fixed):
                row = np.zeros(width)
                row[members] = gradients[k]
                rows.append(row)
                floor.append(least - fixed[k])
        return np.array(rows).reshape(len(rows), width), np.array(floor)


def _needed(rows: FloatArray, floor: FloatArray) -> NDArray[np.intp]:
    """Return the conditions rows x >= floor that matter: two parameters against zero have two."""
    some: NDArray[np.intp] = np.flatnonzero(rows.any(axis=1)).astype(np.intp)
    if rows.shape[1] > 2 or floor.any() or not (rows[some, 0] > 0.0).all():
        return some
    lean = rows[some, -1] / rows[some, 0]
    ends: NDArray[np.intp] = some[np.unique([lean.argmin(), lean.argmax()])]
    return ends


def solve_scaled(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve positive semi-definite systems, rows scaled to a unit diagonal, lightly regularised.

    Shapes (.., n, n) and (.., n, k).
    """
    scale = inverse_sizes(matrix)
    scaled = matrix * (scale[..., :, None] * scale[..., None, :])
    places = np.arange(matrix.shape[-1])
    scaled[..., places, places] += 1e-12
    right = scale[..., None] * right
    try:
        solved = np.linalg.solve(scaled, right)
    except np.linalg.LinAlgError:
        each = [np.linalg.lstsq(a, b, rcond=1e-12)[0] for a, b in zip(scaled, right, strict=True)]
        solved = np.stack(each)
    return np.asarray(scale[..., None] * solved)


def _bounded_least_squares(
    matrix: FloatArray, right: FloatArray, rows: FloatArray, floor: FloatArray
) -> FloatArray:
    """Minimise x'Mx/2 - r'x subject to rows x >= floor, for many M, r and floors.

    Unconstrained where that is admissible; otherwise by active sets, and where those do not settle by the
    least-distance form of Lawson & Hanson.
    """
    solution = solve_scaled(matrix, right[..., None])[..., 0]
    if not len(rows):
        return solution
    slack = solution @ rows.T - floor
    beyond = slack < -1e-12 * (np.abs(solution) @ np.abs(rows).T + np.abs(floor))
    k = np.flatnonzero(beyond.any(axis=1))
    if len(k):
        edge, settled = _by_active_sets(matrix[k], solution[k], rows, slack[k])
        solution[k[settled]] = edge[settled]
        for each in k[~settled]:
            solution[each] = _by_least_distance(matrix[each], solution[each], rows, floor[each])
    return solution


def _by_active_sets(
    matrix: FloatArray, solution: FloatArray, rows: FloatArray, slack: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the admissible points nearest to others that are not, and which of them were found.

    Each round takes up the condition that fails worst and lets go of those that pull instead of push.
    """
    away = solve_scaled(matrix, np.broadcast_to(rows.T, (len(matrix), *rows.T.shape)))
    between = rows @ away
    size = 1.0 / np.sqrt(np.diagonal(between, axis1=1, axis2=2))
    between = between * (size[:, :, None] * size[:, None, :])
    slack = slack * size
    tolerance = 1e-9 * np.abs(slack).max(axis=1)
    active = np.zeros(slack.shape, dtype=np.bool_)
    force = np.zeros(slack.shape)
    each, places = np.arange(len(slack)), np.arange(len(rows))
    for _ in range(_ROUNDS):
        left = slack + np.einsum("bij,bj->bi", between, force)
        worst = left.argmin(axis=1)
        fails = left[each, worst] < -tolerance
        pulls = (force < 0.0).any(axis=1)
        if not (fails | pulls).any():
            break
        active &= force >= 0.0
        active[each[fails], worst[fails]] = True
        system = np.where(active[:, :, None] & active[:, None, :], between, 0.0)
        system[:, places, places] = 1.0 + 1e-10
        force = np.linalg.solve(system, np.where(active, -slack, 0.0)[..., None])[..., 0]
    settled = ~(fails | pulls) & np.isfinite(left).all(axis=1)
    return solution + np.einsum("bij,bj->bi", away, size * force), settled


def _by_least_distance(
    matrix: FloatArray, solution: FloatArray, rows: FloatArray, floor: FloatArray
) -> FloatArray:
    """Return the admissible point that is nearest, in the matrix' own metric, to one that is not."""
    scale = inverse_sizes(matrix)
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-10
    factor = np.linalg.cholesky(scaled).T
    # z = R (x / scale) - d, d = R x_free / scale: minimise |z| subject to G z >= h.
    g = np.linalg.solve(factor.T, (rows * scale).T).T
    h = floor - rows @ solution
    norm = np.linalg.norm(g, axis=1)
    g, h = g / norm[:, None], h / norm
    from scipy.optimize import nnls  # takes a quarter of a second to load, and is hardly ever needed

    size_h = float(np.abs(h).max())
    target = np.zeros(len(g[0]) + 1)
    target[-1] = 1.0
    u, _ = nnls(np.vstack([g.T, (h / size_h)[None, :]]), target)
    residual = np.vstack([g.T, (h / size_h)[None, :]]) @ u - target
    if abs(residual[-1]) < 1e-14:
        raise InputError("the law's conditions leave no admissible linear coefficients")
    z = -residual[:-1] / residual[-1] * size_h
    return np.asarray(solution + scale * np.linalg.solve(factor, z))
