"""Variable projection with Levenberg-Marquardt: the usual way to fit a damper.

The force is linear in most of its numbers; those are eliminated by least squares at every step, kept
inside the law's conditions, and only the rest is searched for:

    minimise over theta   min over c   | y - F(theta, c) |^2,   F affine in c.

The derivative of the eliminated problem is taken in Kaufman's approximation: the tangents of theta,
projected off the space of the linear columns. A law without linear numbers (the series valve) is the same
algorithm with nothing to eliminate. The elimination is in ``objective``, the steps are in ``descent``; here
is where starts come from and what becomes of them.

Golub & Pereyra (1973), Kaufman (1975): cited from memory, not re-read.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from mrdamper.errors import ConvergenceError
from mrdamper.identify.descent import Box, Descents
from mrdamper.identify.ledger import Ledger, NoLedger
from mrdamper.identify.objective import Objective
from mrdamper.identify.problem import FitProblem, FitResult, Free, PreparedFit, Start, lifted, move, ordered
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.models.damper import Damper

__all__ = ["Objective", "Progress", "Report", "fit_variable_projection", "latin_hypercube"]

FloatArray = NDArray[np.float64]

_MOST_ITERATIONS = 150
_TOGETHER = 8  # starts that are screened side by side
_DRAWN_PER_NUMBER = 8  # points looked at for each start, per nonlinear number,
_DRAWN = 80  # but no more
_GLANCE = 8  # of which so many by each of several starts, to begin with
_DRAWN_PYTHON = 8  # the same for a law in Python, which is slow
_DESCENDING = 5  # of which so many descend on short stretches
_FEW_ITERATIONS = 10  # of each of those
_FINALISTS = 2  # of which so many go on
_SHORT_ITERATIONS = 30  # for so long
_ALIKE = 1e-3  # share of the cost within which starts have come to the same cost,
_SAME = 1e-3  # and within which the curvature says that two places are one


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


def fit_variable_projection(
    problem: FitProblem,
    *,
    starts: int = 1,
    seed: int = 0,
    report: Report | None = None,
    first: Damper | None = None,
    prepared: Sequence[PreparedFit] | None = None,
    ledger: Ledger | None = None,
) -> FitResult:
    """Fit by variable projection from ``starts`` Latin-hypercube starts; the best one is returned.

    Parameters
    ----------
    first : a damper to start from as well, before the drawn ones (a former fit); alone with ``starts=0``
    prepared : the runs as ``problem.prepare()`` gives them, for many fits of one set of runs
    report : told of every accepted step; an interrupt (Ctrl-C) keeps the best so far
    ledger : asked for every start before it is made, and told of it after

    Raises
    ------
    ConvergenceError
        No start found a finite cost.
    """
    clock = time.process_time()
    full = problem.prepare() if prepared is None else tuple(prepared)
    ledger = ledger or NoLedger()
    objective = Objective(problem, full)
    count = starts if problem.nonlinear else 1
    places = _places(objective, count, seed, ledger)
    if first is not None:
        places = itertools.chain([_opening(objective, first)], places)
        count += 1
    outcomes: list[Start] = []
    finished: list[_Place] = []
    history: list[float] = []
    best: _Place | None = None
    cancelled = False
    offset = int(first is not None)
    try:
        for index, place in enumerate(places):
            if place.joined is not None:
                joined = place.joined + offset
                state = replace(finished[joined], evaluations=place.evaluations)
                finished.append(state)
                outcomes.append(replace(_outcome(index, state), joined=joined))
                continue
            key = f"start-{index}"
            kept = ledger.recall(key)
            costs: list[float] = []
            if kept is None:
                for state in _descend(objective, place):
                    costs.append(state.cost)
                    if best is None or state.cost < best.cost:
                        best = state
                    history.append(float(np.sqrt(best.cost)))
                    if report:
                        now = float(np.sqrt(state.cost))
                        report(Progress("varpro", index, count, len(costs) - 1, now, history[-1]))
                ledger.keep(key, {**state.plain(), "costs": costs})
            else:
                state = _Place.read(kept)
                for cost in kept["costs"]:
                    history.append(float(np.sqrt(cost if best is None else min(cost, best.cost))))
                if best is None or state.cost < best.cost:
                    best = state
            finished.append(state)
            outcomes.append(_outcome(index, state))
    except KeyboardInterrupt:
        if best is None:
            raise
        cancelled = True
    if best is None or not np.isfinite(best.cost):
        raise ConvergenceError(
            f"{problem.template.law.name}: no start reached a finite cost in {count} tries; check the runs "
            "(mrdamper predict shows them) or give more --starts"
        )
    values = np.concatenate([Box.of(problem).outward(best.point), best.linear]).tolist()
    found = move(problem.template, dict(zip((*objective.nonlinear, *objective.linear), values, strict=True)))
    offsets = dict(zip(objective.sessions, best.tares.tolist(), strict=True))
    damper = ordered(lifted(problem, found))
    numbers, correlation = estimates_of(problem, full, damper, offsets)
    return FitResult(
        damper=damper,
        method="varpro",
        cost_percent=float(np.sqrt(best.cost)),
        estimates=numbers,
        correlation=correlation,
        starts=tuple(outcomes),
        offsets_N=offsets,
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
class _Place:
    """Where a search stands: search coordinates, linear numbers, session offsets and what they cost.

    ``joined`` is the former start whose place this is too.
    """

    point: FloatArray
    linear: FloatArray
    tares: FloatArray
    cost: float
    evaluations: int
    converged: bool
    joined: int | None = None

    def plain(self) -> dict[str, Any]:
        """Return it as plain data; ``read`` gives the same again."""
        return {
            "point": self.point.tolist(),
            "linear": self.linear.tolist(),
            "tares": self.tares.tolist(),
            "cost": self.cost,
            "evaluations": self.evaluations,
            "converged": self.converged,
            "joined": self.joined,
        }

    @classmethod
    def read(cls, kept: Mapping[str, Any]) -> _Place:
        arrays = (np.array(kept[name], dtype=np.float64) for name in ("point", "linear", "tares"))
        return cls(*arrays, *(kept[name] for name in ("cost", "evaluations", "converged", "joined")))


def _outcome(index: int, state: _Place) -> Start:
    return Start(index, float(np.sqrt(state.cost)), state.evaluations, state.converged)


def _opening(objective: Objective, damper: Damper) -> _Place:
    """Return the place of a given damper, its numbers brought inside the bounds."""
    nonlinear, linear = objective.numbers_of(damper)
    point = Box.of(objective.problem).inward(nonlinear[0])
    return _Place(point, linear[0], np.zeros(len(objective.sessions)), np.inf, 0, converged=False)


def _descend(objective: Objective, place: _Place) -> Iterator[_Place]:
    """Yield the states of one descent on whole runs, the first and every accepted one."""
    descent = Descents(
        objective, place.point[None], place.linear[None], place.tares[None], most=_MOST_ITERATIONS
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
        descents.tares[k].copy(),
        float(descents.costs[k]),
        before + int(descents.evaluations[k]),
        bool(descents.converged[k]),
    )


def _places(whole: Objective, starts: int, seed: int, ledger: Ledger) -> Iterator[_Place]:
    """Yield one promising place for each start, a few starts at a time."""
    problem = whole.problem
    if not problem.nonlinear:
        linear = whole.numbers_of(problem.template)[1][0]
        yield _Place(np.empty(0), linear, np.zeros(len(whole.sessions)), np.inf, 0, converged=True)
        return
    objective: Objective | None = None
    for begin in range(0, starts, _TOGETHER):
        group = range(begin, min(begin + _TOGETHER, starts))
        key = f"places-{group.start}-{group.stop}"
        kept = ledger.recall(key)
        if kept is None:
            objective = objective or Objective(problem, problem.prepare(excerpt=True), like=whole)
            found = _screened(objective, group, seed)
            ledger.keep(key, {"places": [place.plain() for place in found]})
        else:
            found = [_Place.read(place) for place in kept["places"]]
        yield from found


def _screened(objective: Objective, group: range, seed: int) -> list[_Place]:
    """Return one promising place for each start of a group, found on short stretches of the runs.

    Wide bounds hold regions from which no descent finds home (a valve that never moves). Each start draws
    many Latin-hypercube points and the best one descends. Where at least half of several starts come to the
    same lowest cost that way, they are home. All others let the best few of their points descend, and go on
    with the one that came furthest. A start that came to the place of a former one has joined it.
    """
    problem = objective.problem
    box, free = Box.of(problem), problem.nonlinear
    count = min(_DRAWN, _DRAWN_PER_NUMBER * max(len(free), 2))
    if problem.template.law.kernel is None:
        count = _DRAWN_PYTHON
    drawn = np.stack([latin_hypercube(free, count, seed + 7919 * index) for index in group])
    costs = np.full(drawn.shape[:2], np.inf)
    linear = np.tile(objective.numbers_of(problem.template)[1], (*drawn.shape[:2], 1))
    tares = np.zeros((*drawn.shape[:2], len(objective.sessions)))
    settled: list[list[_Settled]] = [[] for _ in group]
    spent = np.zeros(len(group), dtype=np.intp)

    def look(owner: Sequence[int], part: range) -> None:
        each, place = np.repeat(owner, len(part)), np.tile(part, len(owner))
        points, guess, level = (a[each, place] for a in (drawn, linear, tares))
        found = objective.eliminate(box.outward(points), guess, level, tangents=False)
        costs[each, place] = np.where(np.isfinite(found.cost), found.cost, np.inf)
        linear[each, place], tares[each, place] = found.linear, found.tares
        spent[owner] += len(part)

    def descend(at: Sequence[FloatArray], owner: Sequence[int], most: int) -> list[_Settled]:
        descents = Descents(objective, *at, most=most)
        descents.run()
        np.add.at(spent, owner, descents.evaluations)
        return [_Settled(_state(descents, k), descents.hessians[k], start) for k, start in enumerate(owner)]

    def best_drawn(owner: Sequence[int], few: int, most: int) -> list[_Settled]:
        each = np.repeat(owner, few)
        rank = np.argsort(costs[owner], axis=1, kind="stable")[:, :few].ravel()
        return descend([a[each, rank] for a in (drawn, linear, tares)], each.tolist(), most)

    away = list(range(len(group)))
    seen = 0
    if len(group) > 1:
        seen = min(count, _GLANCE)
        look(away, range(seen))
        quick = best_drawn(away, 1, _SHORT_ITERATIONS)
        for each in quick:
            settled[each.start].append(each)
        least = min(each.order for each in quick)
        home = [
            each.start
            for each in quick
            if each.place.converged
            and each.order <= (1.0 + _ALIKE) * least
            and not box.stuck(each.place.point).any()
        ]
        if len(home) > 1 and 2 * len(home) >= len(group):
            away = [start for start in away if start not in home]
    if away:
        look(away, range(seen, count))
        tried = best_drawn(away, min(_DESCENDING, count // 8), _FEW_ITERATIONS)
        finalists = [
            each
            for start in away
            for each in sorted((t for t in tried if t.start == start), key=lambda t: t.order)[:_FINALISTS]
        ]
        owner = [each.start for each in finalists]
        further = descend(_at(finalists), owner, _SHORT_ITERATIONS)
        loose = [replace(each, place=freed) for each in further if (freed := _freed(box, each.place)) is not None]
        if loose:
            further += descend(_at(loose), [each.start for each in loose], _SHORT_ITERATIONS)
        for each in further:
            settled[each.start].append(each)
    return _joined([min(each, key=lambda s: s.order) for each in settled], spent.tolist(), group.start)


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


def _at(ends: Sequence[_Settled]) -> list[FloatArray]:
    """Return where descents ended: points, linear numbers, session offsets."""
    return [np.stack([getattr(each.place, name) for each in ends]) for name in ("point", "linear", "tares")]


def _freed(box: Box, place: _Place) -> _Place | None:
    """Return a place with every number that sits on a bound put back to mid-range; None when none does.

    A term that has died (a yield velocity beyond all speeds) leaves its numbers on bounds; from mid-range
    it may come to life again.
    """
    stuck = box.stuck(place.point)
    if not stuck.any():
        return None
    return replace(place, point=np.where(stuck, 0.5 * (box.low + box.high), place.point))


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
