"""Profile likelihood: the best cost with one parameter held at steps, and the interval that follows.

Samples that count: residuals of a real run hang together, so raw samples are not what a threshold may be
based on, and half cycles alone would be far too few where they do not. A parameter's *effective samples* are
as many independent ones as would leave it the standard error that ``uncertainty`` states, which counts
half cycles (blocks between two reversals): near the number of those when residuals hang together over half
a cycle, near the number of raw samples when they are white.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mrdamper.arrays import pseudoinverse
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint
from mrdamper.identify.confidence.direction import Direction, fit_held, half_cycles
from mrdamper.identify.problem import Estimate, FitProblem, FitResult, FreeParameter, PreparedFit
from mrdamper.identify.search.variable_projection import Objective, SearchState
from mrdamper.identify.uncertainty import covariances
from mrdamper.models.damper import Damper
from mrdamper.runtime.progress import Progress, silent
from mrdamper.schema import unknown_name

End = Literal["closed", "bound", "no fit", "span"]

_CHI_SQUARE_95 = 3.841458820694124  # 95 % point, one degree of freedom
_SHARPER = 3  # refits at most to sharpen one end of an interval,
_CLOSE = 0.02  # until the rise of the cost is this near the allowed one


@dataclass(frozen=True, slots=True)
class Profile:
    """The best cost with one parameter held at steps, all others refitted.

    ``interval`` (95 %) is where the squared cost stays below its least by ``1 + 3.84 / effective_samples``.
    An end is ``closed`` when that was met, else it is the last value reached: a ``bound`` of the parameter,
    the last before ``no fit`` was found, or the end of the ``span`` asked for.
    """

    name: str
    unit: str
    values: tuple[float, ...]  # at which the parameter was held, ascending
    costs_percent: tuple[float, ...]
    others: Mapping[str, tuple[float, ...]]  # the refitted parameters there
    threshold_percent: float
    interval: tuple[float, float]
    ends: tuple[End, End]
    effective_samples: float
    blocks: int  # half cycles
    samples: int  # raw
    cancelled: bool = False


def profile(
    problem: FitProblem,
    result: FitResult,
    along: Direction | str,
    *,
    points: int = 7,
    span: float = 3.0,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
) -> Profile:
    """Return the profile likelihood of one parameter; of a direction, that of its heaviest parameter.

    Parameters
    ----------
    points : places at which the parameter is held, odd; a few more sharpen the ends of the interval
    span : how far to each side, in standard errors; bounds cut it short
    on_progress : receives a ``SearchState`` after every refit; an interrupt (Ctrl-C) keeps the places so far
    checkpoint : recalls and keeps every refit

    Raises
    ------
    InputError
        The parameter is not one of the fit's, or rests on a bound; ``points`` even or below three.
    """
    name = along if isinstance(along, str) else along.names[0]
    free, estimate = _find(problem, result, name)
    if estimate.at_bound:
        raise InputError(
            f"rests on its {estimate.at_bound} bound",
            place=name,
            expected="a value inside, to have a profile about it",
        )
    if points < 3 or points % 2 == 0 or not span > 0.0:
        raise InputError(
            place="profile",
            found=f"{points} points over {span:g} standard errors",
            expected="3, 5, 7, ... over > 0",
        )
    runs = problem.prepare()
    effective = _effective_samples(problem, runs, result, name)
    held = _Held(problem, result, runs, free, on_progress, checkpoint or NoCheckpoint(), count=points)
    centre = float(free.to_search(estimate.value))
    error = estimate.standard_error / (abs(estimate.value) if free.scale == "log" else 1.0)
    if not held.at(centre):
        if held.cancelled:
            raise KeyboardInterrupt
        raise ConvergenceError(
            place=name, found=f"no fit with it held at {estimate.value:g}, its own fitted value"
        )
    reached: list[tuple[float, End]] = []
    for side, bound in ((-1.0, free.lower), (1.0, free.upper)):
        room = side * (float(free.to_search(bound)) - centre)
        far = min(span * error, room) if room > 0.0 else span * error
        steps = np.linspace(0.0, far, points // 2 + 1)[1:]
        ahead = all(held.at(centre + side * float(step)) for step in steps)
        reached.append((side, "no fit" if not ahead else "bound" if 0.0 < room <= span * error else "span"))
    least = min(held.costs.values())
    allowed = least * _CHI_SQUARE_95 / effective
    ends = [held.crossing(side, allowed, otherwise) for side, otherwise in reached]
    places = sorted(held.costs)
    others = [f.name for f in problem.free if f.name != name]
    return Profile(
        name=name,
        unit=estimate.unit,
        values=tuple(free.to_physical(u) for u in places),
        costs_percent=tuple(math.sqrt(held.costs[u]) for u in places),
        others={other: tuple(held.parameters[u][other] for u in places) for other in others},
        threshold_percent=math.sqrt(min(held.costs.values()) + allowed),
        interval=(free.to_physical(ends[0][0]), free.to_physical(ends[1][0])),
        ends=(ends[0][1], ends[1][1]),
        effective_samples=effective,
        blocks=half_cycles(runs),
        samples=sum(len(run.force) - run.start for run in runs),
        cancelled=held.cancelled,
    )


class _Held:
    """Refits with one parameter held, each from the nearest one before, by search coordinate."""

    def __init__(
        self,
        problem: FitProblem,
        result: FitResult,
        runs: Sequence[PreparedFit],
        free: FreeParameter,
        on_progress: Progress,
        checkpoint: CheckpointStore,
        *,
        count: int,
    ) -> None:
        self.costs: dict[float, float] = {}
        self.parameters: dict[float, dict[str, float]] = {}
        self.cancelled = False
        self._problem, self._result, self._runs = problem, result, runs
        self._free, self._on_progress, self._count = free, on_progress, count
        self._checkpoint = checkpoint
        self._dampers: dict[float, Damper] = {}

    def at(self, place: float) -> bool:
        """Fit with the parameter held there; return whether there was a fit."""
        if self.cancelled:
            return False
        key = f"profile {self._free.name} {place!r}"
        known = self._checkpoint.recall(key)
        if known is None:
            known = self._fitted(place)
            if known is None:
                return False
            self._checkpoint.keep(key, known)
        if not known["fitted"]:
            return False
        self.costs[place] = known["cost_percent"] ** 2
        self.parameters[place] = known["estimates"]
        self._dampers[place] = self._result.damper.with_parameters(known["parameters"])
        done, now = len(self.costs), known["cost_percent"]
        total, best = max(self._count, done), min(now, self._result.cost_percent)
        try:
            self._on_progress(SearchState("profile", done - 1, total, known["evaluations"], now, best).update)
        except KeyboardInterrupt:
            self.cancelled = True
        return True

    def _fitted(self, place: float) -> dict[str, Any] | None:
        """Return the fit with the parameter held there, as a checkpoint keeps it; None when interrupted."""
        near = min(self._dampers, key=lambda u: abs(u - place), default=None)
        first = self._result.damper if near is None else self._dampers[near]
        value, template = self._free.to_physical(place), self._result.damper
        try:
            fit = fit_held(self._problem, template, self._free, value, self._runs, first=first)
        except (ConvergenceError, InputError):
            return {"fitted": False}
        except KeyboardInterrupt:
            self.cancelled = True
            return None
        if fit.cancelled:
            self.cancelled = True
            return None
        return {
            "fitted": True,
            "cost_percent": fit.cost_percent,
            "estimates": {e.name: e.value for e in fit.estimates},
            "parameters": fit.damper.parameters_and_lag,
            "evaluations": fit.starts[0].evaluations,
        }

    def crossing(self, side: float, allowed: float, otherwise: End) -> tuple[float, End]:
        """Return where the cost has risen by ``allowed`` on one side, sharpened by a few refits.

        Between two places the root of the rise is taken as a straight line: exact for a parabola.
        """
        for attempt in range(_SHARPER + 1):
            lowest = min(self.costs, key=self.costs.__getitem__)
            away = sorted((u for u in self.costs if side * (u - lowest) >= 0.0), key=lambda u: side * u)
            root = [math.sqrt(max(self.costs[u] - self.costs[lowest], 0.0)) for u in away]
            goal = math.sqrt(allowed)
            beyond = next((i for i, r in enumerate(root) if r >= goal), None)
            if beyond is None:
                return away[-1], "span" if self.cancelled else otherwise
            (u0, u1), (r0, r1) = away[beyond - 1 : beyond + 1], root[beyond - 1 : beyond + 1]
            place = u0 + (u1 - u0) * (goal - r0) / (r1 - r0)
            near = min(abs(r0**2 - allowed), abs(r1**2 - allowed))
            if near <= _CLOSE * allowed or attempt == _SHARPER or not self.at(place):
                break
        return place, "closed"


def _effective_samples(
    problem: FitProblem, runs: Sequence[PreparedFit], result: FitResult, name: str
) -> float:
    """Return as many independent samples as would leave the parameter its stated standard error."""
    names = [e.name for e in result.estimates if not e.at_bound]
    i = names.index(name)
    g = Objective(problem, runs).gram(result.damper, names, result.offsets_N)
    curvature = g[: len(names), : len(names)]
    softness = float(pseudoinverse(curvature)[i, i])
    variance = max(float(c[i, i]) for c in covariances(runs, result.damper, names, result.offsets_N))
    return float(g[-1, -1] * softness / variance)


def _find(problem: FitProblem, result: FitResult, name: str) -> tuple[FreeParameter, Estimate]:
    for free, estimate in zip(problem.free, result.estimates, strict=True):
        if free.name == name:
            return free, estimate
    raise unknown_name(f"the fit has no parameter {name!r}", name, [free.name for free in problem.free])
