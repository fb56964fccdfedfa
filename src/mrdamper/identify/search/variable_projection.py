"""Variable projection with Levenberg-Marquardt: the usual way to fit a damper.

The force is linear in most of its parameters; those are eliminated by least squares at every step, kept
inside the law's conditions, and only the rest is searched for:

    minimise over theta   min over c   | y - F(theta, c) |^2,   F affine in c.

The derivative of the eliminated problem is taken in Kaufman's approximation: the tangents of theta,
projected off the space of the linear columns. A law without linear parameters (the series valve) is the same
algorithm with nothing to eliminate. The elimination is in ``objective``, the steps are in ``descent``; here
is where starts come from and what becomes of them.

Known as the method of Golub and Pereyra; the approximation as Kaufman's.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint
from mrdamper.identify.limits import feasible
from mrdamper.identify.problem import (
    FitProblem,
    FitResult,
    FreeParameter,
    PreparedFit,
    Start,
    canonical,
)
from mrdamper.identify.search.descent import Box, Descents
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.models.damper import Damper
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

__all__ = ["MOST_ITERATIONS", "Objective", "SearchState", "fit_variable_projection", "latin_hypercube"]


MOST_ITERATIONS = 150
"""Steps of one descent on whole runs."""

_TOGETHER = 8  # starts that are screened side by side
_DRAWN_PER_NUMBER = 8  # points looked at for each start, per nonlinear parameter,
_DRAWN = 80  # but no more
_GLANCE = 16  # of which so many by each of several starts, to begin with
_DRAWN_PYTHON = 8  # the same for a law in Python, which is slow
_DESCENDING = 5  # of which so many descend on short stretches
_FEW_ITERATIONS = 10  # of each of those
_FINALISTS = 2  # of which so many go on
_SHORT_ITERATIONS = 30  # for so long
_ALIKE = 1e-3  # share of the cost within which starts have come to the same cost,
_SAME = 1e-3  # and within which the curvature says that two places are one


@dataclass(frozen=True, slots=True)
class SearchState:
    """State of a search after a step: the ``detail`` of its progress."""

    method: str
    start: int
    starts: int
    iteration: int
    cost_percent: float
    best_percent: float

    @property
    def update(self) -> ProgressUpdate:
        """The progress that a search reports in this state."""
        text = (
            f"{self.method}  iteration {self.iteration}  error {self.cost_percent:.3f} %  best "
            f"{self.best_percent:.3f} %"
        )
        return ProgressUpdate(done=self.start, total=self.starts, text=text, detail=self)


def fit_variable_projection(  # noqa: PLR0913 - what a search is given, by keyword
    problem: FitProblem,
    *,
    starts: int = 1,
    seed: int = 0,
    on_progress: Progress = silent,
    first: Damper | None = None,
    prepared: Sequence[PreparedFit] | None = None,
    most: int = MOST_ITERATIONS,
    hopeless_percent: float = math.inf,
    with_errors: bool = True,
    checkpoint: CheckpointStore | None = None,
) -> FitResult:
    """Fit by variable projection from ``starts`` Latin-hypercube starts; the best one is returned.

    Parameters
    ----------
    first : a damper to start from as well, before the drawn ones (a former fit); alone with ``starts=0``
    prepared : the runs as ``problem.prepare()`` gives them, for many fits of one set of runs
    most : steps of a descent on the whole runs
    hopeless_percent : error on short stretches above which a start is not followed further
    with_errors : work out standard errors and correlations, which take as long as some steps
    on_progress : receives a ``SearchState`` after every accepted step; an interrupt (Ctrl-C) keeps the best
        so far
    checkpoint : recalls and keeps every start

    Raises
    ------
    ConvergenceError
        No start found a finite cost.
    """
    clock = time.process_time()
    full = problem.prepare() if prepared is None else tuple(prepared)
    checkpoint = checkpoint or NoCheckpoint()
    objective = Objective(problem, full)
    count = starts if problem.nonlinear else 1
    places = _places(objective, count, seed, checkpoint, hopeless_percent**2)
    if first is not None:
        places = itertools.chain([_opening(objective, first)], places)
        count += 1
    progress = _Progress(count, on_progress)
    outcomes: list[Start] = []
    finished: list[_Place] = []
    cancelled = False
    offset = int(first is not None)
    try:
        for index, place in enumerate(places):
            joined = None if place.joined is None else place.joined + offset
            if joined is None:
                steps = 1 if hopeless_percent**2 < place.cost < np.inf else most
                state = _finish(objective, place, index, progress, checkpoint, steps)
            else:
                state = replace(finished[joined], evaluations=place.evaluations)
            finished.append(state)
            outcomes.append(replace(_outcome(index, state), joined=joined))
    except KeyboardInterrupt:
        if progress.best is None:
            raise
        cancelled = True
    best = progress.best
    if best is None or not np.isfinite(best.cost):
        raise ConvergenceError(
            place=problem.template.law.name,
            found=(
                f"no start reached a finite cost in {count} tries; check the runs (⟦mrdamper predict⟧ shows "
                "them) or give more ⟦--starts⟧"
            ),
        )
    values = np.concatenate([Box.of(problem).to_physical(best.point), best.linear]).tolist()
    found = problem.template.with_parameters(
        dict(zip((*objective.nonlinear, *objective.linear), values, strict=True))
    )
    offsets = dict(zip(objective.sessions, best.session_offsets.tolist(), strict=True))
    damper = canonical(feasible(problem, found))
    parameters, correlation = estimates_of(problem, full, damper, offsets, with_errors=with_errors)
    return FitResult(
        damper=damper,
        method="varpro",
        cost_percent=float(np.sqrt(best.cost)),
        estimates=parameters,
        correlation=correlation,
        starts=tuple(outcomes),
        offsets_N=offsets,
        history=tuple(progress.history),
        seed=seed,
        cpu_s=time.process_time() - clock,
        cancelled=cancelled,
    )


class _Progress:
    """The best place so far and the history of its cost [%], over the steps of all starts."""

    def __init__(self, starts: int, on_progress: Progress) -> None:
        self.best: _Place | None = None
        self.history: list[float] = []
        self._starts, self._on_progress = starts, on_progress

    def step(self, index: int, iteration: int, state: _Place) -> None:
        """Take a step of a start, and report it."""
        if self.best is None or state.cost < self.best.cost:
            self.best = state
        self.history.append(float(np.sqrt(self.best.cost)))
        now = float(np.sqrt(state.cost))
        self._on_progress(SearchState("varpro", index, self._starts, iteration, now, self.history[-1]).update)

    def recall(self, costs: Sequence[float], state: _Place) -> None:
        """Take all steps of a start that was kept, and the place where it ended."""
        for cost in costs:
            least = cost if self.best is None else min(cost, self.best.cost)
            self.history.append(float(np.sqrt(least)))
        if self.best is None or state.cost < self.best.cost:
            self.best = state


def _finish(
    objective: Objective,
    place: _Place,
    index: int,
    progress: _Progress,
    checkpoint: CheckpointStore,
    most: int,
) -> _Place:
    """Return where the descent of a start ends: as it was kept, or from its place."""
    key = f"start-{index}"
    kept = checkpoint.recall(key)
    if kept is not None:
        state = _Place.read(kept)
        progress.recall(kept["costs"], state)
        return state
    costs: list[float] = []
    state = place
    for state in _descend(objective, place, most):
        costs.append(state.cost)
        progress.step(index, len(costs) - 1, state)
    checkpoint.keep(key, {**state.plain(), "costs": costs})
    return state


def latin_hypercube(free: Sequence[FreeParameter], count: int, seed: int) -> FloatArray:
    """Return ``count`` starts in search coordinates, spread over the inner four fifths of the bounds."""
    rng = np.random.default_rng(seed)
    cell = rng.permuted(np.tile(np.arange(count), (len(free), 1)), axis=1).T
    unit = (cell + rng.random((count, len(free)))) / count
    low = np.array([float(f.to_search(f.lower)) for f in free])
    high = np.array([float(f.to_search(f.upper)) for f in free])
    return np.asarray(low + (0.1 + 0.8 * unit) * (high - low))


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Where a search stands: search coordinates, linear parameters, session offsets and what they cost.

    ``joined`` is the former start whose place this is too.
    """

    point: FloatArray
    linear: FloatArray
    session_offsets: FloatArray
    cost: float
    evaluations: int
    converged: bool
    joined: int | None = None

    def plain(self) -> dict[str, Any]:
        """Return it as plain data; ``read`` gives the same again."""
        return {
            "point": self.point.tolist(),
            "linear": self.linear.tolist(),
            "tares": self.session_offsets.tolist(),
            "cost": self.cost,
            "evaluations": self.evaluations,
            "converged": self.converged,
            "joined": self.joined,
        }

    @classmethod
    def read(cls, kept: Mapping[str, Any]) -> _Place:
        point, linear, session_offsets = (
            np.array(kept[name], dtype=np.float64) for name in ("point", "linear", "tares")
        )
        return cls(
            point,
            linear,
            session_offsets,
            kept["cost"],
            kept["evaluations"],
            kept["converged"],
            kept["joined"],
        )


def _outcome(index: int, state: _Place) -> Start:
    return Start(index, float(np.sqrt(state.cost)), state.evaluations, state.converged)


def _opening(objective: Objective, damper: Damper) -> _Place:
    """Return the place of a given damper, its parameters brought inside the bounds."""
    nonlinear, linear = objective.candidate_of(damper)
    point = Box.of(objective.problem).to_search(nonlinear[0])
    return _Place(point, linear[0], np.zeros(len(objective.sessions)), np.inf, 0, converged=False)


def _descend(objective: Objective, place: _Place, most: int) -> Iterator[_Place]:
    """Yield the states of one descent on whole runs, the first and every accepted one."""
    descent = Descents(
        objective, place.point[None], place.linear[None], place.session_offsets[None], most=most
    )
    while True:
        state = _state(descent, 0, place.evaluations)
        yield state
        while not descent.done[0] and not descent.advance()[0]:
            pass
        if descent.converged[0] != state.converged:
            yield _state(descent, 0, place.evaluations)
        if descent.done[0]:
            return


def _state(descents: Descents, k: int, before: int = 0) -> _Place:
    return _Place(
        descents.points[k].copy(),
        descents.linear[k].copy(),
        descents.session_offsets[k].copy(),
        float(descents.costs[k]),
        before + int(descents.evaluations[k]),
        bool(descents.converged[k]),
    )


def _places(
    whole: Objective, starts: int, seed: int, checkpoint: CheckpointStore, hopeless: float
) -> Iterator[_Place]:
    """Yield one promising place for each start, a few starts at a time."""
    problem = whole.problem
    if not problem.nonlinear:
        linear = whole.candidate_of(problem.template)[1][0]
        yield _Place(np.empty(0), linear, np.zeros(len(whole.sessions)), np.inf, 0, converged=True)
        return
    objective: Objective | None = None
    for begin in range(0, starts, _TOGETHER):
        group = range(begin, min(begin + _TOGETHER, starts))
        key = f"places-{group.start}-{group.stop}"
        kept = checkpoint.recall(key)
        if kept is None:
            objective = objective or Objective(problem, problem.prepare(excerpt=True), like=whole)
            found = _Screening(objective, group, seed, hopeless).places()
            checkpoint.keep(key, {"places": [place.plain() for place in found]})
        else:
            found = [_Place.read(place) for place in kept["places"]]
        yield from found


class _Screening:
    """The search of a group of starts for promising places, on short stretches of the runs.

    Wide bounds hold regions from which no descent finds home (a valve that never moves). Every start draws
    many Latin-hypercube points of its own. Several starts first look at a few of theirs and let the best one
    descend; where at least half of them come to the same lowest cost that way, those are home. All others
    look at all of their points, let the best few descend, and go on with those that came furthest, unless
    their costs are above what is ``hopeless``.
    """

    def __init__(self, objective: Objective, group: range, seed: int, hopeless: float = math.inf) -> None:
        problem, size = objective.problem, len(objective.problem.nonlinear)
        self._objective, self._group, self._hopeless = objective, group, hopeless
        self._box = Box.of(problem)
        self._count = min(_DRAWN, _DRAWN_PER_NUMBER * max(size, 2))
        if problem.template.law.kernel is None:
            self._count = _DRAWN_PYTHON
        draws = [latin_hypercube(problem.nonlinear, self._count, seed + 7919 * index) for index in group]
        self._points = np.stack(draws)
        shape = self._points.shape[:2]
        self._linear = np.tile(objective.candidate_of(problem.template)[1], (*shape, 1))
        self._session_offsets = np.zeros((*shape, len(objective.sessions)))
        self._costs = np.full(shape, np.inf)
        self._spent = np.zeros(len(group), dtype=np.intp)

    def places(self) -> list[_Place]:
        """Return the place of each start; one that came to the place of a former one has joined it."""
        everyone = list(range(len(self._group)))
        ends: list[_Settled] = []
        away, seen = everyone, 0
        if len(everyone) > 1:
            seen = min(_GLANCE, self._count)
            self._look(everyone, range(seen))
            ends = self._freed(self._best_drawn(everyone, 1, _SHORT_ITERATIONS))
            lowest = [min(each.order for each in ends if each.start == start) for start in everyone]
            home = {s.start for s in ends if s.place.converged and s.order <= (1.0 + _ALIKE) * min(lowest)}
            if len(home) > 1 and 2 * len(home) >= len(everyone):
                away = [start for start in everyone if start not in home]
        if away:
            self._look(away, range(seen, self._count))
            tried = self._best_drawn(away, min(_DESCENDING, self._count // 8), _FEW_ITERATIONS)
            finalists = []
            for start in away:
                own = sorted((each for each in tried if each.start == start), key=lambda each: each.order)
                if own[0].order > self._hopeless:
                    ends.append(own[0])
                else:
                    finalists += own[:_FINALISTS]
            ends += self._freed(
                self._further([each.place for each in finalists], [e.start for e in finalists])
            )
        best = [min((s for s in ends if s.start == start), key=lambda each: each.order) for start in everyone]
        return _joined(best, self._spent.tolist(), self._group.start)

    def _look(self, starts: Sequence[int], part: range) -> None:
        """Work out the costs of some of the points that starts drew, and the linear parameters there."""
        at = np.repeat(starts, len(part)), np.tile(part, len(starts))
        points = self._box.to_physical(self._points[at])
        found = self._objective.eliminate(points, self._linear[at], self._session_offsets[at], tangents=False)
        self._costs[at] = np.where(np.isfinite(found.cost), found.cost, np.inf)
        self._linear[at], self._session_offsets[at] = found.linear, found.session_offsets
        self._spent[list(starts)] += len(part)

    def _best_drawn(self, starts: Sequence[int], few: int, most: int) -> list[_Settled]:
        """Return where descents from the best few points of each start end."""
        rank = np.argsort(self._costs[list(starts)], axis=1, kind="stable")[:, :few].ravel()
        owners = np.repeat(starts, few)
        at = owners, rank
        return self._descend(
            self._points[at], self._linear[at], self._session_offsets[at], owners.tolist(), most
        )

    def _further(self, places: Sequence[_Place], owners: Sequence[int]) -> list[_Settled]:
        """Return where descents from places end."""
        if not places:
            return []
        points = np.stack([place.point for place in places])
        linear, session_offsets = (
            np.stack([p.linear for p in places]),
            np.stack([p.session_offsets for p in places]),
        )
        return self._descend(points, linear, session_offsets, owners, _SHORT_ITERATIONS)

    def _freed(self, ends: list[_Settled]) -> list[_Settled]:
        """Return ends and, of those with a parameter on a bound, where a descent from mid-range ends.

        A term that has died (a yield velocity beyond all speeds) leaves its parameters on bounds; from
        mid-range it may come to life again.
        """
        at_bound = [each for each in ends if self._box.at_bound(each.place.point).any()]
        if not at_bound:
            return ends
        middle = 0.5 * (self._box.low + self._box.high)
        free = [
            replace(
                each.place, point=np.where(self._box.at_bound(each.place.point), middle, each.place.point)
            )
            for each in at_bound
        ]
        return [*ends, *self._further(free, [each.start for each in at_bound])]

    def _descend(
        self,
        points: FloatArray,
        linear: FloatArray,
        session_offsets: FloatArray,
        owners: Sequence[int],
        most: int,
    ) -> list[_Settled]:
        descents = Descents(self._objective, points, linear, session_offsets, most=most)
        descents.run()
        np.add.at(self._spent, list(owners), descents.evaluations)
        return [_Settled(_state(descents, k), descents.hessians[k], start) for k, start in enumerate(owners)]


@dataclass(frozen=True, slots=True, eq=False)
class _Settled:
    """The end of a descent, the Gauss-Newton matrix there, and the start of the group that it belongs to."""

    place: _Place
    hessian: FloatArray
    start: int

    @property
    def order(self) -> float:
        """The cost, for comparison."""
        return self.place.cost if np.isfinite(self.place.cost) else np.inf


def _joined(ends: Sequence[_Settled], spent: Sequence[int], begin: int) -> list[_Place]:
    """Return the places of a group's starts, saying of each which former one it has come to."""
    places: list[_Place] = []
    for each, evaluations in zip(ends, spent, strict=True):
        joined = None
        for k, other in enumerate(ends[: len(places)]):
            apart = each.place.point - other.place.point
            allowed = other.place.cost
            if (
                places[k].joined is None
                and abs(each.place.cost - allowed) <= _ALIKE * allowed
                and apart @ other.hessian @ apart <= _SAME * allowed
            ):
                joined = begin + k
                break
        places.append(replace(each.place, evaluations=evaluations, joined=joined, converged=False))
    return places
