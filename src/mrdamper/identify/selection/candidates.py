"""Candidates of a selection: a law with some of its groups, fitted quickly and judged on what was left out.

A fit is a few Levenberg-Marquardt steps from a former one; a cross-validation is the same without each fold,
from the fit to all runs. Both are on the runs as a fit has them (200 Hz); the model that comes of a selection
is fitted again in full.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint
from mrdamper.identify.groups import archetypes_of, groups_of, starts_of
from mrdamper.identify.limits import feasible
from mrdamper.identify.motions import Fold, folds_of
from mrdamper.identify.problem import FitProblem, FreeParameter, PreparedFit
from mrdamper.identify.search.descent import Box, Descents
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.selection.runs import enough_of
from mrdamper.identify.temperature import FluidFactors, Temperature
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate

__all__ = ["Candidate", "Fitted", "Judge", "Judged"]

_SCREENING_STEPS = 12  # of a law from its best drawn point
_FIT_STEPS = 8  # of a candidate that starts from a former one
_FOLD_STEPS = 5  # without a fold, from the fit to all runs
_ARCHETYPE_STEPS = 20  # of an archetype on short segments of the runs
_GLANCE_STEPS = 4  # on short segments of the runs


@dataclass(frozen=True, slots=True)
class Candidate:
    """A law with the groups that are switched on."""

    law: str
    groups: tuple[str, ...]

    @property
    def title(self) -> str:
        return " + ".join((self.law, *self.groups))

    def with_group(self, name: str) -> Candidate:
        return replace(self, groups=(*self.groups, name))

    def without(self, name: str) -> Candidate:
        return replace(self, groups=tuple(group for group in self.groups if group != name))


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A candidate fitted to all runs: its damper, and its errors on them [%]."""

    candidate: Candidate
    damper: Damper
    free_parameters: int
    training_percent: float  # the root of the mean square over the runs
    training_median: float
    cpu_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A fitted candidate's errors on what was left out.

    ``squares`` are the squared errors [%^2] of each fold's runs, NaN where the fold does not hold the run.
    """

    fitted: Fitted
    squares: FloatArray  # (folds, runs)
    cpu_s: float

    @property
    def by_run(self) -> FloatArray:
        """The errors [%] of the runs that were left out, once each."""
        known = ~np.isnan(self.squares).all(axis=0)
        return np.asarray(np.sqrt(np.nansum(self.squares[:, known], axis=0)))

    @property
    def percent(self) -> float:
        """The root of the mean squared error [%] on what was left out."""
        return float(np.sqrt(np.mean(self.by_run**2)))

    def gain_over(self, other: Judged) -> tuple[float, float]:
        """Return by how much of the other's error this one's is lower, and the mean fall over its error.

        The second is Student's t of the falls of squared error, over the folds.
        """
        falls = np.nansum(other.squares - self.squares, axis=1)
        spread = float(np.std(falls, ddof=1)) / np.sqrt(len(falls)) if len(falls) > 1 else np.inf
        t = float(np.mean(falls)) / spread if spread > 0.0 else np.inf * np.sign(float(np.mean(falls)))
        return 1.0 - self.percent / other.percent, t


class Judge:
    """The runs of a selection, their folds, and what is done with every candidate on them.

    ``terms`` fixes the groups of every law; None: they are chosen. Of many runs some are looked at, each
    motion, command and temperature among them. A ``checkpoint`` recalls and keeps the outcome of each fit and
    of each cross-validation.
    """

    def __init__(
        self,
        runs: Sequence[PreparedRun],
        *,
        terms: Sequence[str] | None = None,
        one_command: bool = False,
        temperature: Temperature = "auto",
        fluid: FluidFactors | None = None,
        session_offsets: bool = False,
        seed: int = 0,
        checkpoint: CheckpointStore | None = None,
    ) -> None:
        self.runs = enough_of(runs)
        self.folds = folds_of(self.runs)
        self._terms = None if terms is None else tuple(terms)
        self._how: dict[str, Any] = {
            "one_command": one_command,
            "temperature": temperature,
            "fluid": fluid,
        }
        self._session_offsets, self._seed = session_offsets, seed
        self._checkpoint = checkpoint or NoCheckpoint()
        self._prepared: tuple[PreparedFit, ...] = ()
        self._short: tuple[PreparedFit, ...] = ()

    def first(self, law: str) -> Candidate:
        """Return a law with the groups that the runs ask for by themselves, or those that were fixed.

        A law that has archetypes begins with the one of the least error on short segments of the runs.
        """
        if self._terms is not None:
            return Candidate(law, self._terms)
        kinds = archetypes_of(LAWS[law])
        if kinds:
            return min((Candidate(law, kind.groups) for kind in kinds), key=self._error_of_archetype)
        damper, free = template(law, self.runs, **self._how)
        moved = {each.name.partition(".")[0] for each in free}
        usual = Candidate(law, ())
        for name, group in groups_of(damper.law).items():
            on = not group.over_temperature and {entry.name for entry in group.entries} <= moved
            if on and set(group.needs) <= set(usual.groups) and self._adds(usual, name):
                usual = usual.with_group(name)
        return usual

    def _error_of_archetype(self, candidate: Candidate) -> float:
        problem = self._problem(candidate, self._begin(candidate))
        try:
            return _descend(problem, self._on_segments(problem), [problem.template], _ARCHETYPE_STEPS)[1]
        except ConvergenceError:
            return math.inf

    @staticmethod
    def _begin(candidate: Candidate) -> Mapping[str, float] | None:
        """Return where the archetype of a candidate begins; None: it is no archetype."""
        kinds = archetypes_of(LAWS[candidate.law])
        return next((kind.start for kind in kinds if kind.groups == candidate.groups), None)

    def _on_segments(self, problem: FitProblem) -> Objective:
        self._short = self._short or problem.prepare(excerpt=True)
        return Objective(problem, self._short)

    def open_groups(self, candidate: Candidate) -> list[str]:
        """Return the groups that could be switched on beside those of a candidate, and add a parameter."""
        known = groups_of(LAWS[candidate.law]) if self._terms is None else {}
        return [
            name
            for name, group in known.items()
            if name not in candidate.groups
            and all(need in candidate.groups for need in group.needs)
            and self._adds(candidate, name)
        ]

    def closable_groups(self, candidate: Candidate) -> list[str]:
        """Return the groups of a candidate that none of its others needs."""
        if self._terms is not None:
            return []
        known = groups_of(LAWS[candidate.law])
        needed = {need for name in candidate.groups for need in known[name].needs}
        return [name for name in candidate.groups if name not in needed]

    def fit_anew(self, candidate: Candidate) -> Fitted:
        """Fit a candidate from one drawn start, and from its archetype where its law has such."""
        kept = self._checkpoint.recall(f"fit {candidate.title}")
        if kept is not None:
            return self._fitted(candidate, kept)
        clock = time.process_time()
        problem = self._problem(candidate)
        begin = self._begin(candidate)
        result = fit_variable_projection(
            problem,
            starts=1,
            seed=self._seed,
            first=None if begin is None else self._problem(candidate, begin).template,
            prepared=self._opened(problem),
            most=_SCREENING_STEPS,
        )
        return self._keep(candidate, problem, result.damper, clock)

    def fit_from(self, candidate: Candidate, former: Damper) -> Fitted:
        """Fit a candidate in a few steps from a former damper, new groups from each of their starts."""
        kept = self._checkpoint.recall(f"fit {candidate.title}")
        if kept is not None:
            return self._fitted(candidate, kept)
        clock = time.process_time()
        problem, dampers = self._from(candidate, former)
        damper, _ = _descend(problem, Objective(problem, self._opened(problem)), dampers, _FIT_STEPS)
        return self._keep(candidate, problem, damper, clock)

    def staged(self, candidate: Candidate) -> Damper | None:
        """Return a damper for a law of many groups to begin with; None where no descent goes anywhere.

        The base descends from each of its starts on short segments of the runs; the groups of the candidate
        are then switched on one by one, each from the best so far.
        """
        law = LAWS[candidate.law]
        stage = Candidate(candidate.law, ())
        begun = [self._problem(stage, start) for start in starts_of(law)]
        templates = [problem.template for problem in begun]
        try:
            damper, _ = _descend(begun[0], self._on_segments(begun[0]), templates, _ARCHETYPE_STEPS)
            for name in groups_of(law):
                if name in candidate.groups:
                    stage = stage.with_group(name)
                    problem, dampers = self._from(stage, damper)
                    damper, _ = _descend(problem, self._on_segments(problem), dampers, _FIT_STEPS)
        except ConvergenceError:
            return None
        return damper

    def glance(self, candidate: Candidate, former: Damper) -> float:
        """Return the error [%] of a candidate fitted in very few steps to short segments of the runs."""
        problem, dampers = self._from(candidate, former)
        return _descend(problem, self._on_segments(problem), dampers, _GLANCE_STEPS)[1]

    def cross_validate(self, fitted: Fitted) -> Judged:
        """Return a fitted candidate's errors on each fold, of a fit to the rest."""
        key = f"left out {fitted.candidate.title}"
        kept = self._checkpoint.recall(key)
        if kept is not None:
            squares = np.array(kept["squares"], dtype=np.float64)
            return Judged(fitted, squares, kept["cpu_s"])
        clock = time.process_time()
        problem = self._problem(fitted.candidate)
        prepared = self._opened(problem)
        whole = Objective(problem, prepared)
        squares = np.full((len(self.folds), len(self.runs)), np.nan)
        for k, fold in enumerate(self.folds):
            rest = Objective(problem, fold.training(prepared), like=whole)
            damper, _ = _descend(problem, rest, [fitted.damper], _FOLD_STEPS)
            squares[k, list(fold.runs)] = _squared_errors(damper, prepared, fold)
        judged = Judged(fitted, squares, time.process_time() - clock)
        self._checkpoint.keep(key, {"squares": squares.tolist(), "cpu_s": judged.cpu_s})
        return judged

    def _from(self, candidate: Candidate, former: Damper) -> tuple[FitProblem, list[Damper]]:
        """Return a candidate's problem, and where it starts: a former damper, new groups at their starts."""
        problem = self._problem(candidate)
        known = groups_of(problem.template.law)
        first = [problem.template]
        for name in candidate.groups:
            if not {e.name for e in known[name].entries} & set(_moved(former)):
                first += [self._problem(candidate, start).template for start in known[name].starts]
        return problem, [_carried(former, each, problem.free) for each in first]

    def _problem(self, candidate: Candidate, start: Mapping[str, float] | None = None) -> FitProblem:
        damper, free = template(candidate.law, self.runs, groups=candidate.groups, start=start, **self._how)
        return FitProblem(damper, free, self.runs, self._session_offsets)

    def _adds(self, candidate: Candidate, name: str) -> bool:
        before, after = (self._problem(each).free for each in (candidate, candidate.with_group(name)))
        return {free.name for free in after} != {free.name for free in before}

    def _opened(self, problem: FitProblem) -> tuple[PreparedFit, ...]:
        """Return the runs opened for the kernel; once for all candidates."""
        self._prepared = self._prepared or problem.prepare()
        return self._prepared

    def _keep(self, candidate: Candidate, problem: FitProblem, damper: Damper, clock: float) -> Fitted:
        runs = self._opened(problem)
        squares = _squared_errors(damper, runs, Fold("", tuple(range(len(runs)))))
        kept = {
            "parameters": dict(damper.parameters_and_lag),
            "free": len(problem.free),
            "percent": float(np.sqrt(np.mean(squares))),
            "median": float(np.sqrt(np.median(squares))),
            "cpu_s": time.process_time() - clock,
        }
        self._checkpoint.keep(f"fit {candidate.title}", kept)
        return self._fitted(candidate, kept)

    def _fitted(self, candidate: Candidate, kept: Mapping[str, Any]) -> Fitted:
        damper = self._problem(candidate).template.with_parameters(kept["parameters"])
        return Fitted(candidate, damper, kept["free"], kept["percent"], kept["median"], kept["cpu_s"])


def _descend(
    problem: FitProblem, objective: Objective, dampers: Sequence[Damper], most: int
) -> tuple[Damper, float]:
    """Return the best end of short descents from dampers, and its error [%]."""
    box = Box.of(problem)
    nonlinear, linear = (
        np.concatenate(parts) for parts in zip(*map(objective.candidate_of, dampers), strict=True)
    )
    points = np.stack([box.to_search(row) for row in nonlinear])
    descents = Descents(
        objective, points, linear, np.zeros((len(points), len(objective.sessions))), most=most
    )
    descents.run()
    costs = np.where(np.isfinite(descents.costs), descents.costs, np.inf)
    best = int(costs.argmin())
    if not np.isfinite(costs[best]):
        raise ConvergenceError(place=problem.template.law.name, found="no descent reached a finite cost")
    values = np.concatenate([box.to_physical(descents.points[best]), descents.linear[best]]).tolist()
    names = (*objective.nonlinear, *objective.linear)
    found = problem.template.with_parameters(dict(zip(names, values, strict=True)))
    return feasible(problem, found), float(np.sqrt(costs[best]))


def _squared_errors(damper: Damper, runs: Sequence[PreparedFit], fold: Fold) -> list[float]:
    """Return the squared errors [%^2] of a fold's runs; of a block of time, its share of them."""
    found = []
    for k in fold.runs:
        run = runs[k]
        error = simulate(damper.on_limits(), run.drive) - run.force
        part = error[fold.scored(run.start, len(error))]
        found.append(run.weight * len(runs) * float(part @ part))
    return found


def _moved(damper: Damper) -> tuple[str, ...]:
    """Return the coefficients of a damper that are not at their law's default."""
    return tuple(
        c.name
        for c, form in zip(damper.law.coefficients, damper.coefficients.values(), strict=True)
        if form.kind != "constant" or form.parameters != (c.default or 0.0,)
    )


def _carried(former: Damper, onto: Damper, free: Sequence[FreeParameter]) -> Damper:
    """Return a damper with what it shares with a former one of its law; a new form at its level."""
    known, values = former.parameters_and_lag, onto.parameters_and_lag
    defaults = {c.name for c in former.law.coefficients} - set(_moved(former))
    carried = {}
    for each in free:
        name = each.name.partition(".")[0]
        if name in defaults:
            continue
        if each.name in known:
            carried[each.name] = known[each.name]
        elif name in former.coefficients and each.name.endswith((".c00", ".value", ".c0")):
            carried[each.name] = float(former.coefficients[name].value(0.0))
        else:
            carried[each.name] = 0.0 if each.name.rpartition(".")[2].startswith("c") else values[each.name]
    return onto.with_parameters(carried)
