"""Evaluate candidates of the model selection: quick fits to windows of the runs, and cross-validation.

All fits use the problem definition of ``FitData``, like the final fit. They differ from the final fit in two
ways: they use a representative subset of the windows, and they make only a few iterations.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.actuation import fit_actuation
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.motions import Fold, block_count, folds_of, motion_groups
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.scores import score_run
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import (
    best_different,
    continued_starts,
    descend,
    first_starts,
    random_dampers,
    screened_starts,
    thorough_starts,
)
from mrdamper.identify.selection.candidates import Candidate, FittedCandidate, ValidatedCandidate
from mrdamper.identify.selection.settings import DEFAULT_SETTINGS, SelectionSettings
from mrdamper.identify.selection.starts import (
    asymmetry_percent,
    default_coefficients,
    mean_force_level,
    starts_of_sizes,
    warm_start_from,
)
from mrdamper.identify.terms import BASE_STARTS, Archetype, Term, archetypes_of, terms_of
from mrdamper.identify.windows import FitWindow, representative_windows, run_windows
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate_each
from mrdamper.runtime.pool import ONE_CORE, Pool, cpu_seconds

GAS_TERM = "gas"
ASYMMETRY_TERMS = ("asymmetry", "flow-asymmetry")


class CandidateEvaluator:
    """Evaluator that fits and cross-validates candidates (laws with terms) on ``samples_max`` samples.

    If ``terms`` is given, every law has exactly these terms. If ``terms`` is None, the model selection can
    add and remove terms.
    """

    def __init__(
        self,
        data: FitData,
        *,
        terms: Sequence[str] | None = None,
        pool: Pool = ONE_CORE,
        samples_max: int | None = None,
        settings: SelectionSettings = DEFAULT_SETTINGS,
    ) -> None:
        self.data = data
        self.runs = data.steady
        self.changing_runs = tuple(_decimated(run, settings) for run in data.changing)
        self.folds = folds_of(self.runs)
        self.settings = settings
        self._terms = None if terms is None else tuple(terms)
        self.pool = pool
        samples_max = samples_max or settings.samples_max
        if any(run.run.constant_command is None for run in self.runs):
            samples_max = min(samples_max, data.settings.changing_samples_max)
        few = min(data.settings.screening_samples_max, settings.screening_fraction * samples_max)
        self.windows, self.search_windows, self.screening_windows = (
            representative_windows(
                self.runs, data.settings, samples_max=count, blocks=block_count(self.folds)
            )
            for count in (samples_max, settings.search_fraction * samples_max, few)
        )
        self.all_windows = run_windows(self.runs, data.settings)
        scored, total = (
            sum(len(window.force) - window.start for window in each)
            for each in (self.windows, self.all_windows)
        )
        self.is_subset = scored < total
        # Damper of the last cross-validation. Its delay and lags are initial values of the next fit.
        self.response: Damper | None = None
        # Start value of a gas term: mean force of the runs [N] and its slope versus temperature [N/K]
        has_level = data.fluid is None and data.temperature != "none"
        self._level = mean_force_level(self.runs, settings.gas_error_percent_min) if has_level else None
        self._asymmetric = asymmetry_percent(self.runs) >= settings.asymmetry_error_percent_min

    def problem(self, candidate: Candidate, start: Mapping[str, float] | None = None) -> FitProblem:
        """Return the fit problem of a candidate.

        ``start`` has start values of coefficients, divided by the typical values of the runs (``Scale``).
        """
        return self.data.problem(candidate.law, candidate.terms, start)

    def initial_candidates(self, law: str) -> list[tuple[Candidate, Archetype | None]]:
        """Return the candidates with which the selection of terms starts, each with its archetype.

        The archetype (typical set of terms) is None if the candidate has default terms or terms of the user.
        """
        archetypes = self._archetypes(law) if self._terms is None else ()
        return [(Candidate(law, kind.terms), kind) for kind in archetypes] or [
            (self.initial_candidate(law), None)
        ]

    def _archetypes(self, law: str) -> tuple[Archetype, ...]:
        """Return the archetypes of a law, with further terms if the runs require them.

        If the mean force of a run depends on temperature, every archetype includes a gas force, because a
        later addition would not lead to the best damper. If the mean force of a run grows with the amplitude
        of the force, the damper is asymmetric. An asymmetric version of every archetype is then added.
        """
        kinds = archetypes_of(LAWS[law])
        if self._level is not None:
            kinds = tuple(replace(kind, terms=(*kind.terms, GAS_TERM)) for kind in kinds)
        if not self._asymmetric:
            return kinds
        return (*kinds, *(replace(kind, terms=(*kind.terms, *ASYMMETRY_TERMS)) for kind in kinds))

    def initial_starts(self, candidate: Candidate, archetype: Archetype | None) -> tuple[list[Damper], float]:
        """Make short descents for an initial candidate; return the dampers and their smallest error [%]."""
        problem, windows = self.problem(candidate), self.screening_windows
        if archetype is None and archetypes_of(LAWS[candidate.law]):
            dampers = self.starts(candidate)
        elif archetype is None:
            dampers = first_starts(problem, random_dampers(problem, 0), windows)
        else:
            dampers = first_starts(problem, self._archetype_points(candidate, archetype), windows)
        return dampers, float(np.sqrt(Objective(problem, windows).costs_of(dampers).min()))

    def fit_starts(
        self,
        candidate: Candidate,
        archetype: Archetype | None,
        start: tuple[list[Damper], float],
        error_percent_max: float,
    ) -> list[FittedCandidate]:
        """Fit an initial candidate, starting at the dampers of ``initial_starts`` with their smallest error.

        Before the fit, the descents are continued on the screening windows. The second result is the fit of
        the alternative of the archetype. If the error exceeds ``error_percent_max``, there is no fit, and the
        damper with the smallest error is returned.
        """
        start_s, problem, (dampers, error_percent) = cpu_seconds(), self.problem(candidate), start
        if error_percent > error_percent_max:
            best = best_different(Objective(problem, self.windows), dampers)[0]
            return [self._fitted(candidate, best, start_s)]
        fits = [self.fit(candidate, continued_starts(problem, dampers, self.screening_windows))]
        if archetype is not None and archetype.alternative and self.changing_runs:
            with suppress(ConvergenceError):
                fits.append(self.fit(candidate, [self._alternative_start(archetype, fits[0])]))
        return fits

    def starts(self, candidate: Candidate) -> list[Damper]:
        """Return the dampers from which the search for a candidate's parameters starts, best first."""
        problem, starts = self.problem(candidate), []
        for archetype in self._archetypes(candidate.law):
            points = self._archetype_points(candidate, archetype)
            starts.append(screened_starts(problem, points, self.screening_windows)[0])
            if archetype.alternative and self.changing_runs:
                starts.append(self._alternative_start(archetype, self.fit(candidate, starts[-1:])))
        if not starts:
            return screened_starts(problem, random_dampers(problem, 0), self.screening_windows)
        best = best_different(Objective(problem, self.windows), starts)[0]
        starts += self._with_restarted_terms(candidate, best)
        return thorough_starts(problem, starts, self.windows, self.windows)

    def search_thoroughly(self, fitted: FittedCandidate) -> FittedCandidate:
        """Fit a candidate from many initial dampers; return the fit with the smallest training error."""
        starts = [fitted.damper, *self._with_restarted_terms(fitted.candidate, fitted.damper)]
        problem = self.problem(fitted.candidate)
        ends = thorough_starts(problem, starts, self.windows, self.search_windows)
        return self.fit(fitted.candidate, [fitted.damper, *ends])

    def _with_restarted_terms(self, candidate: Candidate, damper: Damper) -> list[Damper]:
        """Return copies of a damper. In each copy, one term is reset to one of the start values of the term.

        A term can describe two different effects. For example, friction in series with a stiff spring acts as
        friction, and friction in series with a soft spring acts as a hysteretic stiffness. A local search
        does not move from one of these effects to the other.
        """
        known = terms_of(LAWS[candidate.law])
        return [
            self._restarted(candidate, damper, {entry.name for entry in known[name].entries}, start)
            for name in candidate.terms
            for start in ({}, *known[name].starts)
        ]

    def _restarted(
        self, candidate: Candidate, damper: Damper, names: Collection[str], start: Mapping[str, float]
    ) -> Damper:
        """Return a copy of a damper in which the coefficients ``names`` are reset to start values."""
        template = self.problem(candidate, start).template.parameters
        moved = {each: value for each, value in template.items() if each.partition(".")[0] in names}
        return damper.with_parameters(moved)

    def initial_candidate(self, law: str) -> Candidate:
        """Return the first candidate of a law, with the terms of the user or the default terms."""
        if self._terms is not None:
            return Candidate(law, self._terms)
        problem = self.data.problem(law)
        moving = {each.name.partition(".")[0] for each in problem.free}
        candidate = Candidate(law, ())
        for name, group in terms_of(problem.template.law).items():
            on = not group.linear_in_temperature and {entry.name for entry in group.entries} <= moving
            on = on or (name == GAS_TERM and self._level is not None)
            if on and self._is_addable(candidate, group):
                candidate = candidate.with_term(name)
        return candidate

    def _alternative_start(self, archetype: Archetype, fitted: FittedCandidate) -> Damper:
        """Return a fitted damper with the alternative start values of an archetype."""
        start = archetype.alternative
        return self._restarted(fitted.candidate, fitted.damper, start, start)

    def _archetype_points(self, candidate: Candidate, archetype: Archetype) -> list[Damper]:
        """Combine the start values of an archetype and of the law; return the dampers."""
        starts = [{**archetype.start, **start} for start in ({}, *BASE_STARTS)]
        dampers = [self.problem(candidate, start).template for start in starts]
        if self._level is not None and GAS_TERM in candidate.terms:
            level = dict(zip(("offset.c00", "offset.c01"), self._level, strict=True))
            dampers = [damper.with_parameters(level) for damper in dampers]
        return dampers

    def addable_terms(self, candidate: Candidate) -> list[str]:
        """Return the names of the terms that can be added to a candidate and add at least one parameter."""
        known = terms_of(LAWS[candidate.law]) if self._terms is None else {}
        return [name for name, term in known.items() if self._is_addable(candidate, term)]

    def removable_terms(self, candidate: Candidate) -> list[str]:
        """Return the names of the terms of a candidate that no remaining term requires."""
        if self._terms is not None:
            return []
        known = terms_of(LAWS[candidate.law])
        needed = {need for name in candidate.terms for need in known[name].needs}
        return [name for name in candidate.terms if name not in needed]

    def _is_addable(self, candidate: Candidate, term: Term) -> bool:
        if term.name in candidate.terms or not set(term.needs) <= set(candidate.terms):
            return False
        before, after = (self.problem(each).free for each in (candidate, candidate.with_term(term.name)))
        return {free.name for free in after} != {free.name for free in before}

    def fit(self, candidate: Candidate, dampers: Sequence[Damper]) -> FittedCandidate:
        """Fit a candidate to the windows, starting from ``dampers``."""
        start_s, objective = cpu_seconds(), Objective(self.problem(candidate), self.windows)
        rounds = self.settings.fit_round_count_max, self.settings.round_gain_min
        damper, _ = descend(objective, dampers, self.settings.fit_iterations, *rounds)
        return self._fitted(candidate, damper, start_s)

    def _fitted(self, candidate: Candidate, damper: Damper, start_s: float) -> FittedCandidate:
        squares = _squared_errors(damper, self.windows)
        percent = float(np.sqrt([window.fraction for window in self.windows] @ squares))
        count = len(self.problem(candidate).free)
        return FittedCandidate(candidate, damper, count, percent, cpu_seconds() - start_s)

    def refit(
        self, candidate: Candidate, previous_dampers: Sequence[Damper], screened_damper: Damper | None = None
    ) -> FittedCandidate:
        """Fit a candidate to the windows, starting from the best of several fitted dampers.

        The previous dampers can lack terms of the candidate. A missing term is added at the smallest of its
        start sizes. ``screened_damper`` is the result of ``screen`` for the candidate.
        """
        objective = Objective(self.problem(candidate), self.windows)
        starts = [self._with_new_terms(candidate, each)[0][-1] for each in previous_dampers]
        starts += [] if screened_damper is None else [screened_damper]
        return self.fit(candidate, best_different(objective, starts))

    def screen(self, candidate: Candidate, previous: Damper) -> tuple[Damper, float]:
        """Fit a candidate by few iterations on few windows of the runs; return the damper and its error [%].

        A new term has several alternative sets of start values, and one fit is made for each set. Before a
        fit, several sizes of the new term are compared, and the size with the smallest error is used.
        """
        objective = Objective(self.problem(candidate), self.screening_windows)
        starts = [best_different(objective, sizes)[0] for sizes in self._with_new_terms(candidate, previous)]
        return descend(objective, starts, self.settings.screening_iterations)

    def error_on_all_runs_percent(self, fitted: FittedCandidate) -> float:
        """Return the error [%] of a fitted candidate on all samples of all runs."""
        problem = self.problem(fitted.candidate)
        return float(np.sqrt(Objective(problem, self.all_windows).costs_of([fitted.damper])[0]))

    def is_represented(self, fitted: FittedCandidate) -> bool:
        """Return True if a candidate's error on all runs is not much larger than on the fitted windows."""
        limit_percent = self.settings.subset_error_ratio_max * fitted.training_rms_percent
        return not self.is_subset or self.error_on_all_runs_percent(fitted) <= limit_percent

    def _with_new_terms(self, candidate: Candidate, previous: Damper) -> list[list[Damper]]:
        """Return copies of a previous damper with the new terms, grouped by start values of the terms.

        The copies in a group differ only in the size of the new terms, smallest size last.
        """
        defaults, known = default_coefficients(previous), terms_of(LAWS[candidate.law])
        new = [known[name] for name in candidate.terms if known[name].entries[0].name in defaults]
        starts: list[Mapping[str, float]] = [{}, *(start for group in new for start in group.starts)]
        sizes = [starts_of_sizes(candidate.law, new, start) for start in starts]
        problems = [[self.problem(candidate, start) for start in each] for each in sizes]
        return [[warm_start_from(previous, each.template, each.free) for each in row] for row in problems]

    def cross_validate(
        self, fitted: FittedCandidate, previous: ValidatedCandidate | None = None
    ) -> ValidatedCandidate:
        """Return a fitted candidate with its cross-validation errors.

        For each fold, the candidate is fitted to all windows that the fold does not hold out. This fit starts
        at the fit to all windows, or at the fit of the candidate ``previous`` for the same fold. The start
        with the smaller error is used.
        """
        start_s = cpu_seconds()
        problem = self.problem(fitted.candidate)

        def without(fold: Fold | None) -> tuple[Damper, list[float]]:
            if fold is None:
                return self._evaluate_changing_runs(fitted.damper, self.response)
            objective = Objective(problem, fold.training(self.windows))
            starts = [fitted.damper]
            if previous is not None:
                other = previous.dampers[self.folds.index(fold)]
                starts.append(warm_start_from(other, fitted.damper, problem.free))
            damper, _ = descend(objective, best_different(objective, starts), self.settings.fold_iterations)
            held_out = [window for window in self.windows if fold.holds_out(window)]
            return damper, _squared_errors(damper, held_out).tolist()

        # The evaluation of the changing runs takes longest and begins first.
        (self.response, changing), *results = self.pool.map(without, [None, *self.folds], threads=True)
        squares = np.full(len(self.windows), np.nan)
        folds = np.full(len(self.windows), -1, dtype=np.intp)
        for number, (fold, (_, errors)) in enumerate(zip(self.folds, results, strict=True)):
            held_out = [fold.holds_out(window) for window in self.windows]
            squares[held_out], folds[held_out] = errors, number
        in_fold = folds >= 0
        return ValidatedCandidate(
            fitted,
            tuple(damper for damper, _ in results),
            squares[in_fold],
            np.array([window.fraction for window in self.windows])[in_fold],
            folds[in_fold],
            np.array([window.run for window in self.windows], dtype=np.intp)[in_fold],
            cpu_seconds() - start_s,
            np.array(changing),
        )

    def _evaluate_changing_runs(self, damper: Damper, response: Damper | None) -> tuple[Damper, list[float]]:
        """Fit delay and lags; return the damper and the error [%] of each run with changing current.

        Delay and lags are fitted to one run of each motion, starting at the values of ``response``.
        """
        if not self.changing_runs:
            return damper, []
        settings = self.settings
        chosen = [self.changing_runs[group[0]] for group in motion_groups(self.changing_runs)]
        damper = replace(damper.on_limits(), command_lag_s=0.0, actuation=None)
        with suppress(InputError, ConvergenceError):
            damper, _ = fit_actuation(
                damper,
                chosen[: settings.changing_run_count_max],
                start=response,
                settings=settings.actuation,
            )
        return damper, [score_run(damper, run).nrmse_percent for run in self.changing_runs]


def _decimated(run: PreparedRun, settings: SelectionSettings) -> PreparedRun:
    """Resample a run with changing current to a lower rate that is sufficient to compare candidates."""
    rate = settings.changing_samples_max / (len(run) * run.trajectory.step)
    return decimate(run, float(np.clip(rate, settings.changing_rate_Hz_min, settings.changing_rate_Hz_max)))


def _squared_errors(damper: Damper, windows: Sequence[FitWindow]) -> FloatArray:
    """Return the squared error [%^2] of each window, relative to the force of the run."""
    forces = simulate_each(damper.on_limits(), [window.drive for window in windows])
    squares = [
        window.weight / window.fraction * float(np.sum(np.square((force - window.force)[window.start :])))
        for window, force in zip(windows, forces, strict=True)
    ]
    return np.array(squares)
