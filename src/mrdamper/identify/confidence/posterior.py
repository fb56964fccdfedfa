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
ensemble while it settled (any marginals, joined by a normal copula), and steps along differences of the
other half. The first cross the posterior in one step, the second follow it. Most moves are many of these on a
``surrogate`` of the density, fitted to all places that were looked at while the ensemble settled; where they
lead is proposed to the density itself (Christen & Fox, J. Comput. Graph. Stat. 14 (2005) 795-810). Their
order reads the same backwards, so that they are reversible. All of it leaves the posterior as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray, inverse_sizes, pseudoinverse
from mrdamper.errors import InputError
from mrdamper.identify.confidence.copula import Copula
from mrdamper.identify.confidence.surrogate import Surrogate
from mrdamper.identify.problem import FitProblem, FitResult
from mrdamper.identify.search.descent import Box
from mrdamper.identify.search.objective import Objective
from mrdamper.models.card_draws import CardDraws
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

_WALKERS = 128
_SETTLING = 120  # moves of the ensemble before it counts; the proposal is fitted to their second half,
_REFITTED = 30  # every so many of them
_TRIES = 64  # draws of the linear parameters at a place, for the share that the law admits
_ROUND = 20  # moves between two looks at the effective sample size
_MOST_PER_DRAW = 60  # evaluations per draw asked for, after which it is given up
_LEAST_ACCEPTED = 0.15  # of a kind of proposals: below, it is not the rule
_RULE, _REST = 0.85, 0.25  # how often the kind that is the rule proposes, and how often one that is not
_LEGS, _ACROSS = 4, 8  # that a surrogate leads: each of so many fitted proposals; between two a step along


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
    pool: Pool = ONE_CORE,
) -> Posterior:
    """Return draws of the posterior, as many as are asked for, of an effective sample size as large.

    They are the same bits for any number of jobs of the ``pool``.

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
    chains = _Chains(_Density(problem, Objective(problem, runs), result, pool), np.random.default_rng(seed))
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
    variance = np.diag(pseudoinverse(gram))[: len(names)]
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

    def __init__(self, problem: FitProblem, objective: Objective, result: FitResult, pool: Pool) -> None:
        self.box, self.objective, self._pool = Box.of(problem), objective, pool
        nonlinear, linear = objective.candidate_of(result.damper)
        offsets = [result.offsets_N.get(session, 0.0) for session in objective.sessions]
        self.mode = self.box.to_search(nonlinear[0])
        self.guess = np.concatenate([linear[0], offsets])
        size = np.array([max(abs(free.lower), abs(free.upper)) for free in problem.linear])
        self._precision = np.concatenate([1.0 / size**2, np.zeros(len(offsets))])

    def at(self, points: FloatArray, rng: np.random.Generator) -> _Places:
        """Return places at points, shape (n, parameters); beyond the box their density is zero."""
        count, size = len(points), len(self.guess)
        inside = self.inside(points)
        noise = rng.standard_normal((count, _TRIES, size))
        picked = rng.random(count)
        log, linear = np.full(count, -np.inf), np.tile(self.guess, (count, 1))
        if inside.any():
            log[inside], linear[inside] = self._inside(points[inside], noise[inside], picked[inside])
        return _Places(points, linear, log)

    def inside(self, points: FloatArray) -> BoolArray:
        """Return which points lie in the box."""
        return np.asarray(((points > self.box.low) & (points < self.box.high)).all(axis=1))

    def _inside(
        self, points: FloatArray, noise: FloatArray, picked: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        linear = len(self.objective.linear)
        guess = np.tile(self.guess, (len(points), 1))
        physical = self.box.to_physical(points)
        some = slice(None) if points.shape[1] else slice(1)  # without nonlinear parameters all are one
        g = self.objective.linear_sums(physical[some], guess[some, :linear], guess[some, linear:], self._pool)
        g = np.broadcast_to(g, (len(points), *g.shape[1:]))
        squares = g[:, -1, -1]
        if not len(self.guess):
            return np.where(np.isfinite(squares), -0.5 * squares, -np.inf), guess
        matrix = g[:, :-1, :-1] + np.diag(self._precision)
        right = g[:, :-1, -1] - self._precision * guess
        scale = inverse_sizes(matrix)
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


class _Chains:
    """The ensemble of walkers."""

    def __init__(self, density: _Density, rng: np.random.Generator) -> None:
        self._density, self._rng = density, rng
        self.names = (*density.objective.nonlinear, *density.objective.linear)
        self.evaluations, self._tried, self._taken = 0, 0, 0
        self._widths = density.box.high - density.box.low
        self._proposal = self._fitted(self._first_points(8 * _WALKERS))
        self._surrogate: Surrogate | None = None
        self._independent = 0.5  # how often the surrogate proposes, or without one the fitted distribution
        self._settling, self._seen = True, list[_Places]()
        self._halves = [self._begun(), self._begun()]

    @property
    def accepted_share(self) -> float:
        """Share of the proposals that were taken since the ensemble had settled."""
        return self._taken / max(self._tried, 1)

    def settle(self) -> None:
        """Let the ensemble spread, and fit the proposal to it."""
        if not len(self._widths):
            return
        stood: list[FloatArray] = []
        for k in range(1, _SETTLING + 1):
            self.move()
            if 2 * k <= _SETTLING:
                continue
            stood += [half.points for half in self._halves]
            if k % _REFITTED == 0:
                self._proposal = self._fitted(np.concatenate(stood))
                self._surrogate = Surrogate.of(
                    np.concatenate([each.points for each in self._seen]),
                    np.concatenate([each.log for each in self._seen]),
                    self._rng,
                )
        self._settling = False
        self._seen.clear()
        self._independent = 1.0
        if self._surrogate is not None and self._tested() < _LEAST_ACCEPTED:
            self._surrogate = None
        self._independent = _RULE if self._tested() >= _LEAST_ACCEPTED else _REST
        self._tried = self._taken = 0

    def _tested(self) -> float:
        """Return the share accepted of a few moves."""
        self._tried = self._taken = 0
        for _ in range(5):
            self.move()
        return self.accepted_share

    def move(self) -> FloatArray:
        """Move every walker once; return their parameters, shape (walkers, parameters)."""
        for k in range(2):
            here, others = self._halves[k], self._halves[1 - k]
            if self._rng.random() >= self._independent:
                points, gain = self._along(here.points, others.points), np.zeros(len(here.log))
            elif self._surrogate is not None:
                points, gain = self._following(self._surrogate, here.points, others.points)
            else:
                points = self._proposal.draw(len(here.log), self._rng)
                gain = self._proposal.log(here.points) - self._proposal.log(points)
            there = self._at(points)
            with np.errstate(invalid="ignore"):
                accepted = np.log(self._rng.random(len(gain))) < there.log - here.log + gain
            self._tried, self._taken = self._tried + len(gain), self._taken + int(accepted.sum())
            self._halves[k] = here.taking(there, accepted)
        linear = len(self._density.objective.linear)
        return np.concatenate(
            [
                np.concatenate([self._density.box.to_physical(half.points), half.linear[:, :linear]], axis=1)
                for half in self._halves
            ]
        )

    def _following(
        self, surrogate: Surrogate, points: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return where chains on the surrogate lead from points, and what it says against that."""
        count, size = points.shape
        fresh = self._proposal.draw(_LEGS * _ACROSS * count, self._rng)
        there, itself = (
            each.reshape(-1, count) for each in (self._within(surrogate, fresh), self._proposal.log(fresh))
        )
        fresh = fresh.reshape(-1, count, size)
        first = now = surrogate.log(points)
        for leg in range(_LEGS):
            if leg:
                points, now = self._stepped(surrogate, points, now, others)
            against = self._proposal.log(points)
            for k in range(leg * _ACROSS, (leg + 1) * _ACROSS):
                gain = there[k] - now + against - itself[k]
                taken = np.log(self._rng.random(count)) < gain
                points = np.where(taken[:, None], fresh[k], points)
                now, against = np.where(taken, there[k], now), np.where(taken, itself[k], against)
        return points, first - now

    def _stepped(
        self, surrogate: Surrogate, points: FloatArray, now: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return points after one step along the others' differences on the surrogate, and its log there."""
        tried = self._along(points, others)
        there = self._within(surrogate, tried)
        taken = np.log(self._rng.random(len(now))) < there - now
        return np.where(taken[:, None], tried, points), np.where(taken, there, now)

    def _within(self, surrogate: Surrogate, points: FloatArray) -> FloatArray:
        """Return the surrogate's log density; it vanishes beyond the box."""
        return np.where(self._density.inside(points), surrogate.log(points), -np.inf)

    def _fitted(self, points: FloatArray) -> Copula:
        return Copula(points, self._density.box.low, self._density.box.high)

    def _along(self, points: FloatArray, others: FloatArray) -> FloatArray:
        """Return steps along the difference of two walkers of the other half, now and then a whole one."""
        count, size = points.shape
        first = self._rng.integers(0, count, count)
        second = (first + self._rng.integers(1, count, count)) % count
        length = np.where(self._rng.random(count) < 0.1, 1.0, 2.38 / np.sqrt(2.0 * max(size, 1)))
        jitter = 1e-5 * self._widths * self._rng.standard_normal((count, size))
        return np.asarray(points + length[:, None] * (others[first] - others[second]) + jitter)

    def _at(self, points: FloatArray) -> _Places:
        self.evaluations += len(points)
        found = self._density.at(points, self._rng)
        if self._settling:
            self._seen.append(found)
        return found

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
