r"""Posterior draws of a fit's parameters: the nonlinear ones by Markov chains, the linear ones given those.

Given the nonlinear parameters u the force is linear in the others, c; their posterior is then Gaussian, with
mean c(u) and covariance A(u)^-1, A being the weighted Gram matrix of their tangents. They are integrated out
of what the chains follow, and drawn at every place that a chain visits:

.. math:: \log p(u) = -\tfrac12 S(u) - \tfrac12 \log\det A(u) + \log P(c \text{ admissible} \mid u)

S is the least sum of squared residuals, weighted as the fit has it, times one number: that with which the
posterior, were it normal, had the standard errors that are told of the fit (their geometric mean). Residuals
of a real run hang together, and hold what the law leaves out; those errors allow for both (``uncertainty``).
P is the share of a few draws of c that the law admits, which leaves the chains exact (pseudo-marginal).

Prior: even over the box of the search in its coordinates (logarithms where it has them); for a linear
parameter a normal one about zero, as wide as its bound is large.

The chains are an ensemble that moves in two halves: proposals of a distribution that was fitted to the
ensemble while it settled (any marginals, joined by a normal copula), mixed with steps along differences of
the other half. Both leave the posterior as it is; the first cross it in one step, the second follow it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.errors import InputError
from mrdamper.identify.problem import FitProblem, FitResult
from mrdamper.identify.search.descent import Box
from mrdamper.identify.search.objective import Objective
from mrdamper.models.card_draws import CardDraws
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

__all__ = ["Posterior", "effective_sample_sizes", "sample_posterior"]

_WALKERS = 128
_SETTLING = 120  # moves of the ensemble before it counts; the proposal is fitted to their second half,
_REFITTED = 20  # every so many of them
_TRIES = 16  # draws of the linear parameters at a place, for the share that the law admits
_BINS = 24  # of the proposal's histograms,
_TAIL = 0.04  # and the share of it beyond them
_ROUND = 50  # moves between two looks at the effective sample size
_MOST_PER_DRAW = 60  # evaluations per draw asked for, after which it is given up
_LEAST_ACCEPTED = 0.15  # of the fitted proposals: below, steps along differences are the rule


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Equally likely parameters, and how well the chains have mixed."""

    draws: CardDraws
    effective_draws: float  # of the parameter that mixed worst
    evaluations: int
    accepted_share: float
    effective_samples: float  # as many independent ones leave the fit's standard errors
    cpu_s: float
    cancelled: bool

    @property
    def standard_deviation(self) -> dict[str, float]:
        """Spread of each parameter."""
        return dict(zip(self.draws.names, np.std(self.draws.values, axis=0, ddof=1).tolist(), strict=True))


def sample_posterior(
    problem: FitProblem,
    result: FitResult,
    *,
    draws: int = 1000,
    seed: int = 0,
    on_progress: Progress = silent,
) -> Posterior:
    """Return draws of the posterior, as many as are asked for, of an effective sample size as large.

    An interrupt keeps the draws so far. Session offsets are integrated out with the linear parameters.

    Raises
    ------
    InputError
        Fewer than two draws.
    """
    if draws < 2:
        raise InputError(f"{draws} posterior draws", expected="2 or more")
    clock = process_time()
    prepared = problem.prepare()
    sharpness = _sharpness(Objective(problem, prepared), result)
    runs = [replace(run, weight=sharpness * run.weight) for run in prepared]
    chains = _Chains(_Density(problem, Objective(problem, runs), result), np.random.default_rng(seed))
    kept: list[FloatArray] = []
    effective, cancelled = 0.0, False
    try:
        chains.settle()
        while effective < draws and chains.evaluations < _MOST_PER_DRAW * draws + 2 * _SETTLING * _WALKERS:
            kept += [chains.move() for _ in range(_ROUND)]
            effective = float(effective_sample_sizes(np.array(kept)).min())
            text = f"posterior: {effective:.0f} of {draws} independent draws"
            on_progress(ProgressUpdate(done=min(int(effective), draws), total=draws, text=text))
    except KeyboardInterrupt:
        if len(kept) < 2:
            raise
        cancelled = True
    values = np.concatenate(kept)
    at = np.linspace(0, len(values) - 1, min(draws, len(values))).round().astype(np.intp)
    return Posterior(
        draws=CardDraws(chains.names, values[at]),
        effective_draws=effective,
        evaluations=chains.evaluations,
        accepted_share=chains.accepted_share,
        effective_samples=sharpness * result.cost_percent**2,
        cpu_s=process_time() - clock,
        cancelled=cancelled,
    )


def effective_sample_sizes(chains: FloatArray) -> FloatArray:
    """Return the effective sample size of each parameter, of chains of shape (moves, chains, parameters).

    The autocorrelation is that about the mean of all chains, summed up to a window of five times the sum.
    """
    moves, count, size = chains.shape
    centred = chains - chains.mean(axis=(0, 1))
    spectrum = np.fft.rfft(centred, 2 * moves, axis=0)
    covariance = np.fft.irfft((spectrum * spectrum.conj()).real.sum(axis=1), axis=0)[:moves]
    covariance /= np.maximum(covariance[0], 1e-300)
    times = 2.0 * np.cumsum(covariance, axis=0) - 1.0
    inside = np.arange(moves)[:, None] >= 5.0 * times
    last = np.where(inside.any(axis=0), inside.argmax(axis=0), moves - 1)
    together = np.maximum(times[last, np.arange(size)], 1.0)
    return np.asarray(moves * count / together)


def _sharpness(objective: Objective, result: FitResult) -> float:
    """Return what the cost is multiplied with, so that a normal posterior has the fit's standard errors."""
    known = {e.name: e.standard_error for e in result.estimates if not e.at_bound}
    names = [name for name, error in known.items() if np.isfinite(error) and error > 0.0]
    if not names:
        raise InputError(place="posterior", found="no parameter of the fit has a standard error")
    gram = objective.gram(result.damper, names, result.offsets_N)[:-1, :-1]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram * np.outer(scale, scale), rcond=1e-13, hermitian=True)
    variance = (np.diag(inverse) * scale**2)[: len(names)]
    told = np.array([known[name] for name in names])
    return float(np.exp(np.mean(np.log(np.maximum(variance, 1e-300) / told**2))))


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Where walkers stand: search coordinates, one draw of the linear parameters, log density."""

    points: FloatArray
    linear: FloatArray
    log: FloatArray

    def taking(self, other: _Places, accepted: BoolArray) -> _Places:
        """Return these with the accepted ones of others."""
        return _Places(
            np.where(accepted[:, None], other.points, self.points),
            np.where(accepted[:, None], other.linear, self.linear),
            np.where(accepted, other.log, self.log),
        )


class _Density:
    """The posterior's density at places, and draws of the linear parameters there."""

    def __init__(self, problem: FitProblem, objective: Objective, result: FitResult) -> None:
        self.box, self.objective = Box.of(problem), objective
        nonlinear, linear = objective.candidate_of(result.damper)
        offsets = [result.offsets_N.get(session, 0.0) for session in objective.sessions]
        self.mode = self.box.to_search(nonlinear[0])
        self.guess = np.concatenate([linear[0], offsets])
        size = np.array([max(abs(free.lower), abs(free.upper)) for free in problem.linear])
        self._precision = np.concatenate([1.0 / size**2, np.zeros(len(offsets))])

    def at(self, points: FloatArray, rng: np.random.Generator) -> _Places:
        """Return places at points, shape (n, parameters); beyond the box their density is zero."""
        count, size = len(points), len(self.guess)
        inside = ((points > self.box.low) & (points < self.box.high)).all(axis=1)
        noise = rng.standard_normal((count, _TRIES, size))
        picked = rng.random(count)
        log, linear = np.full(count, -np.inf), np.tile(self.guess, (count, 1))
        if inside.any():
            log[inside], linear[inside] = self._inside(points[inside], noise[inside], picked[inside])
        return _Places(points, linear, log)

    def _inside(
        self, points: FloatArray, noise: FloatArray, picked: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        linear = len(self.objective.linear)
        guess = np.tile(self.guess, (len(points), 1))
        physical = self.box.to_physical(points)
        some = slice(None) if points.shape[1] else slice(1)  # without nonlinear parameters all are one
        g = self.objective.sums(physical[some], guess[some, :linear], guess[some, linear:], tangents=False)
        g = np.broadcast_to(g, (len(points), *g.shape[1:]))
        squares = g[:, -1, -1]
        if not len(self.guess):
            return np.where(np.isfinite(squares), -0.5 * squares, -np.inf), guess
        matrix = g[:, :-1, :-1] + np.diag(self._precision)
        right = g[:, :-1, -1] - self._precision * guess
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2), 1e-300))
        scaled = matrix * (scale[:, :, None] * scale[:, None, :])
        good = np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
        scaled[~good] = np.eye(scaled.shape[1])
        vectors, axes = _positive(scaled)
        along = np.einsum("bij,bi->bj", axes, scale * np.where(good[:, None], right, 0.0))
        squares = squares - np.sum(along**2 / vectors, axis=1)
        log = -0.5 * (squares + np.sum(np.log(vectors), axis=1)) + np.sum(np.log(scale), axis=1)
        steps = along[:, None, :] / vectors[:, None, :] + noise / np.sqrt(vectors)[:, None, :]
        drawn = guess[:, None, :] + scale[:, None, :] * np.einsum("bij,bkj->bki", axes, steps)
        rows, floor = self.objective.conditions
        admitted = (drawn @ rows.T >= floor).all(axis=2)
        share = admitted.mean(axis=1)
        with np.errstate(divide="ignore"):
            log = np.where(good & np.isfinite(log), log + np.log(share), -np.inf)
        # one of those that are admitted, any of them as likely
        rank = np.floor(picked * admitted.sum(axis=1))
        chosen = np.argmax(np.cumsum(admitted, axis=1) > rank[:, None], axis=1)
        return log, drawn[np.arange(len(points)), chosen]


def _positive(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return eigenvalues, kept above rounding, and eigenvectors of matrices with a unit diagonal."""
    values, vectors = np.linalg.eigh(matrices)
    return np.maximum(values, 1e-13), vectors


class _Copula:
    """A distribution of proposals fitted to points: histograms of equal counts, joined by a normal copula.

    It reaches over the whole box, so that chains that follow it come everywhere.
    """

    def __init__(self, points: FloatArray, low: FloatArray, high: FloatArray) -> None:
        edge = _TAIL / 2.0
        inner = np.quantile(points, np.linspace(edge, 1.0 - edge, _BINS + 1), axis=0)
        reach = 0.5 * (inner[-1] - inner[0])
        near = np.maximum(inner[:1] - reach, 0.5 * (low + inner[0]))
        far = np.minimum(inner[-1:] + reach, 0.5 * (high + inner[-1]))
        knots = np.concatenate([low[None], near, inner, far, high[None]])
        gaps = 1e-9 * (high - low)
        self._knots = np.maximum.accumulate(knots + gaps * np.arange(len(knots))[:, None] / len(knots))
        ends = (0.2 * edge, edge)
        self._levels = np.concatenate(
            [[0.0], ends[:1], np.linspace(edge, 1.0 - edge, _BINS + 1), [1.0 - ends[0], 1.0]]
        )
        self._density = np.diff(self._levels)[:, None] / np.diff(self._knots, axis=0)
        normal = self._normal(points)
        size = points.shape[1]
        correlation = np.corrcoef(normal.T).reshape(size, size) if size else np.empty((0, 0))
        self._root = np.linalg.cholesky(0.98 * correlation + 0.02 * np.eye(size))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return points, shape (count, parameters)."""
        from scipy.special import ndtr  # SciPy takes long to load, and most fits ask for no draws

        share = ndtr(rng.standard_normal((count, len(self._root))) @ self._root.T)
        columns = [np.interp(share[:, k], self._levels, self._knots[:, k]) for k in range(len(self._root))]
        return np.stack(columns, axis=1) if columns else np.empty((count, 0))

    def log(self, points: FloatArray) -> FloatArray:
        """Return the log density at points inside the box, but for a constant."""
        normal = self._normal(points)
        own = np.linalg.solve(self._root, normal.T)
        log = 0.5 * np.sum(normal**2, axis=1) - 0.5 * np.sum(own**2, axis=0)
        for k in range(points.shape[1]):
            cell = np.searchsorted(self._knots[1:-1, k], points[:, k], side="right")
            log += np.log(self._density[cell, k])
        return np.asarray(log)

    def _normal(self, points: FloatArray) -> FloatArray:
        """Return the points' normal scores."""
        from scipy.special import ndtri

        scores = np.empty_like(points)
        for k in range(points.shape[1]):
            share = np.interp(points[:, k], self._knots[:, k], self._levels)
            scores[:, k] = ndtri(np.clip(share, 1e-12, 1.0 - 1e-12))
        return scores


class _Chains:
    """The ensemble of walkers."""

    def __init__(self, density: _Density, rng: np.random.Generator) -> None:
        self._density, self._rng = density, rng
        self.names = (*density.objective.nonlinear, *density.objective.linear)
        self.evaluations, self._tried, self._taken = 0, 0, 0
        self._widths = density.box.high - density.box.low
        self._proposal = self._fitted(self._first_points(8 * _WALKERS))
        self._independent = 0.5  # how often the fitted distribution proposes
        self._halves = [self._begun(), self._begun()]

    @property
    def accepted_share(self) -> float:
        """Share of the proposals that were taken since the ensemble had settled."""
        return self._taken / max(self._tried, 1)

    def settle(self) -> None:
        """Let the ensemble spread, and fit the proposal to it."""
        if not len(self._widths):
            return
        seen: list[FloatArray] = []
        for k in range(_SETTLING):
            self.move()
            if 2 * k >= _SETTLING:
                seen += [half.points for half in self._halves]
                if (k + 1) % _REFITTED == 0:
                    self._proposal = self._fitted(np.concatenate(seen))
        self._tried = self._taken = 0
        self._independent = 1.0
        for _ in range(5):
            self.move()
        self._independent = 0.85 if self.accepted_share >= _LEAST_ACCEPTED else 0.25
        self._tried = self._taken = 0

    def move(self) -> FloatArray:
        """Move every walker once; return their parameters, shape (walkers, parameters)."""
        for k in range(2):
            here, others = self._halves[k], self._halves[1 - k]
            independent = self._rng.random() < self._independent
            points = (
                self._proposal.draw(len(here.log), self._rng) if independent else self._along(here, others)
            )
            there = self._at(points)
            with np.errstate(invalid="ignore"):
                gain = there.log - here.log
                if independent:
                    gain += self._proposal.log(here.points) - self._proposal.log(points)
                accepted = np.log(self._rng.random(len(gain))) < gain
            self._tried, self._taken = self._tried + len(gain), self._taken + int(accepted.sum())
            self._halves[k] = here.taking(there, accepted)
        linear = len(self._density.objective.linear)
        return np.concatenate(
            [
                np.concatenate([self._density.box.to_physical(half.points), half.linear[:, :linear]], axis=1)
                for half in self._halves
            ]
        )

    def _fitted(self, points: FloatArray) -> _Copula:
        return _Copula(points, self._density.box.low, self._density.box.high)

    def _along(self, here: _Places, others: _Places) -> FloatArray:
        """Return steps along the difference of two walkers of the other half, now and then a whole one."""
        count, size = here.points.shape
        first = self._rng.integers(0, count, count)
        second = (first + self._rng.integers(1, count, count)) % count
        length = np.where(self._rng.random(count) < 0.1, 1.0, 2.38 / np.sqrt(2.0 * max(size, 1)))
        jitter = 1e-5 * self._widths * self._rng.standard_normal((count, size))
        along = others.points[first] - others.points[second]
        return np.asarray(here.points + length[:, None] * along + jitter)

    def _at(self, points: FloatArray) -> _Places:
        self.evaluations += len(points)
        return self._density.at(points, self._rng)

    def _begun(self) -> _Places:
        """Return half of the walkers about the mode; what has no density there begins at the mode."""
        count = _WALKERS // 2
        found = self._at(self._first_points(count))
        for share in (0.3, 0.1, 0.01, 0.0):
            lost = ~np.isfinite(found.log)
            if not lost.any():
                break
            nearer = self._density.mode + share * (self._first_points(count) - self._density.mode)
            found = found.taking(self._at(nearer), lost)
        if not np.isfinite(found.log).any():
            raise InputError(place="posterior", found="no admissible parameters about the fit")
        good = np.flatnonzero(np.isfinite(found.log))
        at = np.where(np.isfinite(found.log), np.arange(count), self._rng.choice(good, count))
        return _Places(found.points[at], found.linear[at], found.log[at])

    def _first_points(self, count: int) -> FloatArray:
        """Return points about the mode, spread as its curvature says and inside the box."""
        density = self._density
        size = len(density.mode)
        if not size:
            return np.empty((count, 0))
        linear = len(density.objective.linear)
        physical = density.box.to_physical(density.mode[None])
        g = density.objective.sums(physical, density.guess[None, :linear], density.guess[None, linear:])
        hessian = density.objective.projected(g, density.guess[None, :linear])[0][0]
        slope = np.where(density.box.log, physical[0], 1.0)
        curvature = hessian * np.outer(slope, slope) + np.diag((6.0 / self._widths) ** 2)
        values, axes = np.linalg.eigh(curvature)
        spread = 1.0 / np.sqrt(np.maximum(values, values.max() * 1e-12))
        points = density.mode + (self._rng.standard_normal((count, size)) * spread) @ axes.T
        room = 1e-3 * self._widths
        return np.asarray(np.clip(points, density.box.low + room, density.box.high - room))
