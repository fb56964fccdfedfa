"""The judge of a selection: fits candidates quickly, and judges them on what was left out.

A fit is a few Levenberg-Marquardt steps from a former one; a cross-validation is the same without each fold,
from the fit to all runs. Both are on the runs as a fit has them (200 Hz); the model that comes of a selection
is fitted again in full.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.actuation import Follows, fit_changes
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint, Pieces
from mrdamper.identify.groups import Archetype, archetypes_of, groups_of, starts_of
from mrdamper.identify.motions import Fold, folds_of, motion_groups
from mrdamper.identify.problem import FitProblem, PreparedFit
from mrdamper.identify.scores import score_run
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.selection.candidates import Candidate, Fitted, Judged
from mrdamper.identify.selection.runs import enough_of
from mrdamper.identify.selection.starts import (
    asymmetry_percent,
    carried,
    descend,
    in_sizes,
    least,
    level_of,
    moved,
)
from mrdamper.identify.temperature import FluidFactors, Temperature
from mrdamper.identify.templates import scale_of, template
from mrdamper.identify.uncertainty import estimates_of
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate_each
from mrdamper.runtime.pool import ONE_CORE, Found, Item, Pool, cpu_seconds

_SCREENING_STEPS = 12  # of a law from its best drawn point
_FIT_STEPS = 8  # of a candidate that starts from a former one,
_FIT_ROUNDS, _STILL_FALLS = 6, 0.996  # and so many times those, while they bring the error down to this share
_FOLD_STEPS = 4  # without a fold, from the fit to all runs
_BASE_STEPS = (10, 10)  # on short segments, from every start of a law, and from the best of them
_BASE_BEST = 2
_TWINS = 1.2  # ratio of the errors of two fits of one archetype within which changing commands part them
_GAS, _GAS_TOLD = "gas", 2.0  # group that is on from the beginning where the runs' level tells so much [%]
_ASYMMETRIES, _ASYMMETRY_TOLD = ("asymmetry", "flow-asymmetry"), 5.0  # and where mean forces grow with force
_GLANCE_STEPS = 8  # on short segments of the runs
_MOST_TOLD = 4  # runs of a changing command that lags are fitted to,
_LAGS_WITHIN = 1e-2  # so closely
_LEVELS = ("value", "at_zero", "base", "gain", "c0", "c00")  # parameters that say how large a coefficient is


class Judge:
    """The runs of a selection, their folds, and what is done with every candidate on them.

    ``changing`` are runs whose command changes, which no law is fitted to: what candidates, with the lags
    that some of these runs tell, are worth on them counts as left out. ``terms`` fixes the groups of every
    law; None: they are chosen. Of many runs some are looked at, each motion, command and temperature among
    them. A ``checkpoint`` recalls and keeps the outcome of each fit and of each cross-validation; the
    ``pool`` does what does not depend on each other.
    """

    def __init__(  # noqa: PLR0913 - how candidates are fitted, by keyword
        self,
        runs: Sequence[PreparedRun],
        *,
        changing: Sequence[PreparedRun] = (),
        terms: Sequence[str] | None = None,
        one_command: bool = False,
        temperature: Temperature = "auto",
        fluid: FluidFactors | None = None,
        session_offsets: bool = False,
        seed: int = 0,
        checkpoint: CheckpointStore | None = None,
        pool: Pool = ONE_CORE,
    ) -> None:
        self.runs = enough_of(runs)
        self.folds = folds_of(self.runs)
        self.changing = tuple(changing)
        self._terms = None if terms is None else tuple(terms)
        self._how: dict[str, Any] = {
            "one_command": one_command,
            "temperature": temperature,
            "fluid": fluid,
            "scale": scale_of(self.runs),
        }
        self._session_offsets, self._seed = session_offsets, seed
        self._checkpoint, self._pool = checkpoint or NoCheckpoint(), pool
        self._prepared: tuple[PreparedFit, ...] = ()
        self._short: tuple[PreparedFit, ...] = ()
        self._near: Follows | None = None  # how the candidate that was judged last does
        follows = fluid is None and temperature != "none"
        level = level_of(self.runs) if follows else None
        self._level = None if level is None or level.told_percent < _GAS_TOLD else level
        self._asymmetric = asymmetry_percent(self.runs) >= _ASYMMETRY_TOLD

    def side_by_side(self, work: Callable[[Item], Found], items: Sequence[Item]) -> Iterator[Found]:
        """Yield what work that uses this judge comes to on each item, in their order, by the pool.

        What it keeps is kept here, in the items' order.
        """
        store = self._checkpoint

        def apart(item: Item) -> tuple[Found, Pieces]:
            self._checkpoint = pieces = Pieces(store)
            try:
                return work(item), pieces
            finally:
                self._checkpoint = store

        with closing(self._pool.map(apart, items)) as results:
            for found, pieces in results:
                pieces.keep_in(store)
                yield found

    def kinds(self, law: str) -> tuple[Archetype | None, ...]:
        """Return the archetypes that the search for a law's groups begins with; None: the law's usual groups.

        Where groups were fixed, there is one beginning, with those. A gas whose force follows the runs'
        temperatures is part of every kind: no descent without it ends near one with it. Where strong runs
        show a force that is larger one way, every kind is begun with asymmetries as well.
        """
        return (self._archetypes(law) if self._terms is None else ()) or (None,)

    def _archetypes(self, law: str) -> tuple[Archetype, ...]:
        kinds = archetypes_of(LAWS[law])
        if self._level is not None:
            kinds = tuple(replace(kind, groups=(*kind.groups, _GAS)) for kind in kinds)
        if not self._asymmetric:
            return kinds
        return (*kinds, *(replace(kind, groups=(*kind.groups, *_ASYMMETRIES)) for kind in kinds))

    def beginning(self, law: str, kind: Archetype | None) -> tuple[Candidate, Damper | None] | None:
        """Return a candidate that a search begins with, and where its fit does, if that is known.

        That is the law with the groups that the runs ask for by themselves, or those that were fixed, or an
        archetype, brought down on short segments of the runs; None where no descent of it goes on.

        Raises
        ------
        MrdamperError
            The law cannot be fitted to the runs.
        """
        if kind is not None:
            damper = self._of_twins(law, kind)
            return None if damper is None else (Candidate(law, kind.groups), damper)
        if self._terms is None:
            return self._usual(law), None
        candidate = Candidate(law, self._terms)
        return candidate, self.staged(candidate) if archetypes_of(LAWS[law]) else None

    def _usual(self, law: str) -> Candidate:
        damper, free = template(law, self.runs, **self._how)
        moving = {each.name.partition(".")[0] for each in free}
        usual = Candidate(law, ())
        for name, group in groups_of(damper.law).items():
            on = not group.over_temperature and {entry.name for entry in group.entries} <= moving
            on = on or (name == _GAS and self._level is not None)
            if on and set(group.needs) <= set(usual.groups) and self._adds(usual, name):
                usual = usual.with_group(name)
        return usual

    def _of_twins(self, law: str, kind: Archetype) -> Damper | None:
        """Return where an archetype's fit begins: of ends alike, the one that changing commands prefer."""
        damper = self._from_base(law, kind)
        if damper is None or not kind.twin or not self.changing:
            return damper
        candidate = Candidate(law, kind.groups)
        problem = self._problem(candidate)
        objective = Objective(problem, self._opened(problem))
        found = [self._in_rounds(problem, objective, damper)]
        other = self._problem(candidate, kind.twin).template.parameters
        moved_to = {name: other[name] for name in other if name.partition(".")[0] in kind.twin}
        with suppress(ConvergenceError):
            found.append(self._in_rounds(problem, objective, found[0][0].with_parameters(moved_to)))
        least = min(error for _, error in found)
        near = [pair for pair in found if pair[1] <= _TWINS * least]
        if len(near) == 1:
            return near[0][0]
        follows: Follows | None = None
        missed = []
        for end, error in near:
            lagged, squares = self._on_changing(end, follows)
            follows = Follows.of(lagged)
            missed.append(error**2 + float(np.mean(squares)))
        return near[int(np.argmin(missed))][0]

    def _from_base(self, law: str, kind: Archetype) -> Damper | None:
        """Return an archetype after short descents from the starts of its law; None where none goes on."""
        candidate = Candidate(law, kind.groups)
        starts = [kind.start, *({**kind.start, **start} for start in starts_of(LAWS[law]))]
        return self._descended(candidate, [self._begun(candidate, start) for start in starts])

    def _begun(self, candidate: Candidate, start: Mapping[str, float]) -> Damper:
        """Return a candidate at a start, its offset at the runs' level where that follows temperature."""
        damper = self._problem(candidate, start).template
        if self._level is None or _GAS not in candidate.groups:
            return damper
        return damper.with_parameters({"offset.c00": self._level.force, "offset.c01": self._level.slope})

    def _descended(self, candidate: Candidate, dampers: Sequence[Damper]) -> Damper | None:
        """Return the best end of descents in stages on short segments; None where none goes on."""
        problem = self._problem(candidate)
        objective = self._on_segments(problem)
        for most in _BASE_STEPS:
            found = []
            for damper in dampers:
                try:
                    found.append(descend(problem, objective, [damper], most))
                except ConvergenceError:
                    continue
            found.sort(key=lambda pair: pair[1])
            dampers = [damper for damper, _ in found[:_BASE_BEST]]
        return dampers[0] if dampers else None

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

    def fit_anew(self, candidate: Candidate, hopeless_percent: float = math.inf) -> Fitted:
        """Fit a candidate from one drawn start, roughly where its error on short segments is hopeless."""
        kept = self._checkpoint.recall(f"fit {candidate.title}")
        if kept is not None:
            return self._fitted(candidate, kept)
        clock = cpu_seconds()
        problem = self._problem(candidate)
        result = fit_variable_projection(
            problem,
            starts=1,
            seed=self._seed,
            prepared=self._opened(problem),
            most=_SCREENING_STEPS,
            hopeless_percent=hopeless_percent,
            with_errors=False,
        )
        return self._keep(candidate, problem, result.damper, clock)

    def on_segments(self, fitted: Fitted) -> float:
        """Return the error [%] of a fitted candidate on short segments of the runs."""
        problem = self._problem(fitted.candidate)
        objective = self._on_segments(problem)
        offsets = np.zeros((1, len(objective.sessions)))
        found = objective.eliminate(*objective.candidate_of(fitted.damper), offsets, tangents=False)
        return float(np.sqrt(found.cost[0]))

    def fit_from(self, candidate: Candidate, formers: Sequence[Damper], near: Damper | None = None) -> Fitted:
        """Fit a candidate in a few steps from the nearest of former dampers, or from one that is ``near``.

        The former dampers may have fewer groups: what is new begins at its least size.
        """
        kept = self._checkpoint.recall(f"fit {candidate.title}")
        if kept is not None:
            return self._fitted(candidate, kept)
        clock = cpu_seconds()
        problem = self._problem(candidate)
        objective = Objective(problem, self._opened(problem))
        starts = [self._openings(candidate, former)[0][-1] for former in formers]
        starts += [] if near is None else [near]
        damper, _ = self._in_rounds(problem, objective, least(objective, starts))
        return self._keep(candidate, problem, damper, clock)

    def _in_rounds(self, problem: FitProblem, objective: Objective, damper: Damper) -> tuple[Damper, float]:
        """Return a damper after rounds of a few steps, while they bring its error [%] down, and the error."""
        return descend(problem, objective, [damper], _FIT_STEPS, _FIT_ROUNDS, _STILL_FALLS)

    def staged(self, candidate: Candidate) -> Damper | None:
        """Return a damper for a law of many groups to begin with; None where no descent goes anywhere.

        The groups that it shares with an archetype come down together; of the others the one that misses
        least on short segments is switched on, again and again. No stage begins above the end of the one
        before.
        """
        law = LAWS[candidate.law]
        self._problem(candidate)  # says which of the groups there are not
        best: tuple[Candidate, Damper, float] | None = None
        for kind in self._archetypes(law.name):
            shared = [name for name in kind.groups if name in candidate.groups]
            groups = tuple(name for name in shared if set(groups_of(law)[name].needs) <= set(shared))
            damper = self._from_base(law.name, Archetype(groups, kind.start))
            if damper is None:
                continue
            stage = Candidate(law.name, groups)
            stage, damper, error = self._staged_on(candidate, stage, damper)
            if best is None or error < best[2]:
                best = stage, damper, error
        return None if best is None else best[1]

    def _staged_on(
        self, candidate: Candidate, stage: Candidate, damper: Damper
    ) -> tuple[Candidate, Damper, float]:
        """Switch the rest of a candidate's groups on, from a damper that has some of them."""
        known = groups_of(LAWS[candidate.law])
        damper, error = self.glance(stage, damper)
        while left := [name for name in candidate.groups if name not in stage.groups]:
            opened = [name for name in left if set(known[name].needs) <= set(stage.groups)]
            tried = [
                (stage.with_group(name), *self.glance(stage.with_group(name), damper)) for name in opened
            ]
            stage, damper, error = min(tried, key=lambda each: each[2])
        return stage, damper, error

    def glance(self, candidate: Candidate, former: Damper) -> tuple[Damper, float]:
        """Return a candidate fitted in very few steps to short segments of the runs, and its error [%].

        A group that the former damper does not have begins from each of its starts, at the size that misses
        least there.
        """
        problem = self._problem(candidate)
        objective = self._on_segments(problem)
        dampers = [least(objective, sizes) for sizes in self._openings(candidate, former)]
        return descend(problem, objective, dampers, _GLANCE_STEPS)

    def _openings(self, candidate: Candidate, former: Damper) -> list[list[Damper]]:
        """Return a former damper with the groups that it lacks: at each of their starts, in several sizes."""
        there, known = set(moved(former)), groups_of(LAWS[candidate.law])
        new = [known[name] for name in candidate.groups if known[name].entries[0].name not in there]
        starts: list[Mapping[str, float]] = [{}, *(start for group in new for start in group.starts)]
        found = []
        for start in starts:
            problems = [self._problem(candidate, sized) for sized in in_sizes(candidate.law, new, start)]
            found.append([carried(former, each.template, each.free) for each in problems])
        return found

    def cross_validate(self, fitted: Fitted, former: Judged | None = None) -> Judged:
        """Return a fitted candidate's errors on each fold, of a fit to the rest.

        A fit without a fold begins at the fit to all runs or, where that is nearer, at the ``former``
        candidate's fit without the same fold.
        """
        key = f"left out {fitted.candidate.title}"
        kept = self._checkpoint.recall(key)
        if kept is not None:
            squares, changing = (np.array(kept[name], dtype=np.float64) for name in ("squares", "changing"))
            dampers = tuple(fitted.damper.with_parameters(each) for each in kept["dampers"])
            self._near = kept["near"] and Follows(kept["near"][0], Actuation(**kept["near"][1]))
            return Judged(fitted, squares, dampers, kept["cpu_s"], changing)
        clock = cpu_seconds()
        problem = self._problem(fitted.candidate)
        prepared = self._opened(problem)
        whole = Objective(problem, prepared)

        def left_out(fold: Fold | None) -> tuple[Damper, list[float]]:
            if fold is None:
                return self._on_changing(fitted.damper, self._near)
            rest = Objective(problem, fold.training(prepared), like=whole)
            starts = [fitted.damper]
            if former is not None:
                starts.append(carried(former.dampers[self.folds.index(fold)], fitted.damper, problem.free))
            damper, _ = descend(problem, rest, [least(rest, starts)], _FOLD_STEPS)
            return damper, _squared_errors(damper, prepared, fold)

        *found, (lagged, changing_errors) = self._pool.map(left_out, [*self.folds, None], threads=True)
        squares = np.full((len(self.folds), len(self.runs)), np.nan)
        for row, fold, (_, errors) in zip(squares, self.folds, found, strict=True):
            row[list(fold.runs)] = errors
        dampers = tuple(damper for damper, _ in found)
        self._near = Follows.of(lagged)
        judged = Judged(fitted, squares, dampers, cpu_seconds() - clock, np.array(changing_errors))
        kept = {
            "squares": squares.tolist(),
            "dampers": [dict(damper.parameters_and_lag) for damper in dampers],
            "cpu_s": judged.cpu_s,
            "changing": changing_errors,
            "near": self._near and (self._near.share, asdict(self._near.actuation)),
        }
        self._checkpoint.keep(key, kept)
        return judged

    def _on_changing(self, damper: Damper, near: Follows | None) -> tuple[Damper, list[float]]:
        """Return a damper with its lags, and its squared errors [%^2] on the runs whose command changes.

        The lags are those that one run of each of their motions tells, beginning at those of ``near``; none
        where none does.
        """
        if not self.changing:
            return damper, []
        told = [self.changing[group[0]] for group in motion_groups(self.changing)][:_MOST_TOLD]
        damper = replace(damper.on_limits(), command_lag_s=0.0, actuation=None)
        with suppress(InputError, ConvergenceError):
            damper, _ = fit_changes(damper, told, near=near, within=_LAGS_WITHIN)
        return damper, [score_run(damper, run).nrmse_percent ** 2 for run in self.changing]

    def identifiable(self, fitted: Fitted, group: str) -> bool:
        """Say whether the runs tell how large each coefficient of a group is; one on a bound is told."""
        problem = self._problem(fitted.candidate)
        estimates, _ = estimates_of(problem, self._opened(problem), fitted.damper, {})
        told = set()
        for each in estimates:
            name, _, parameter = each.name.partition(".")
            if parameter in _LEVELS and (each.identifiable or each.at_bound):
                told.add(name)
        return {entry.name for entry in groups_of(LAWS[fitted.candidate.law])[group].entries} <= told

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

    def _on_segments(self, problem: FitProblem) -> Objective:
        self._short = self._short or problem.prepare(excerpt=True)
        return Objective(problem, self._short)

    def _keep(self, candidate: Candidate, problem: FitProblem, damper: Damper, clock: float) -> Fitted:
        runs = self._opened(problem)
        squares = _squared_errors(damper, runs, Fold("", tuple(range(len(runs)))))
        kept = {
            "parameters": dict(damper.parameters_and_lag),
            "free": len(problem.free),
            "percent": float(np.sqrt(np.mean(squares))),
            "median": float(np.sqrt(np.median(squares))),
            "cpu_s": cpu_seconds() - clock,
        }
        self._checkpoint.keep(f"fit {candidate.title}", kept)
        return self._fitted(candidate, kept)

    def _fitted(self, candidate: Candidate, kept: Mapping[str, Any]) -> Fitted:
        damper = self._problem(candidate).template.with_parameters(kept["parameters"])
        return Fitted(candidate, damper, kept["free"], kept["percent"], kept["median"], kept["cpu_s"])


def _squared_errors(damper: Damper, runs: Sequence[PreparedFit], fold: Fold) -> list[float]:
    """Return the squared errors [%^2] of a fold's runs; of a block of time, its share of them."""
    found, held = [], [runs[k] for k in fold.runs]
    forces = simulate_each(damper.on_limits(), [run.drive for run in held])
    for run, force in zip(held, forces, strict=True):
        error = force - run.force
        part = error[fold.scored(run.start, len(error))]
        found.append(run.weight * len(runs) * float(part @ part))
    return found
