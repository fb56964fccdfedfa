"""Fit one law to prepared runs: parameters, their uncertainty, actuation and model card."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version

import numpy as np

from mrdamper.data.prepare import PreparedRun, decimate
from mrdamper.errors import InputError
from mrdamper.identify.actuation import ActuationFit, fit_actuation, refine_actuation
from mrdamper.identify.assess import Assessment, assess
from mrdamper.identify.confidence.held_out_folds import (
    force_band,
    refit_without_folds,
    with_changing_current,
    with_errors_between_motions,
)
from mrdamper.identify.confidence.proposals import propose_tests
from mrdamper.identify.evaluate import operating_envelope, row
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.limits import limit_coefficients
from mrdamper.identify.problem import Estimate, FitProblem, FittedDamper, SearchResult, envelope_of
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.population import fit_genetic
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.selection.evaluator import CandidateEvaluator
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.temperature import scale_thinning
from mrdamper.identify.terms import archetypes_of
from mrdamper.identify.windows import run_windows
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.models.laws import HysteresisLaw, PythonLaw, find_law
from mrdamper.models.python_law import law_from_python, load_python_law
from mrdamper.runtime.pool import cpu_seconds
from mrdamper.runtime.progress import Progress, silent
from mrdamper.schema import finite_or_none

__all__ = ["Identification", "Law", "assess", "default_law", "fit_law", "versions"]

Law = str | HysteresisLaw | PythonLaw | type[PythonLaw]


@dataclass(frozen=True)
class Identification(FittedDamper):
    """A fit with all data that are needed to assess the fit and to write its model card."""

    problem: FitProblem
    fingerprint: str  # hash of the training data
    cpu_s: float  # CPU time of preparation and fit; the job adds model selection and assessment
    python_law: str | None = None  # source of a user-defined law, ``file.py:Class``
    actuation: ActuationFit | None = None  # delay and lags, fitted to training runs with changing current
    force_band: ForceBand | None = None  # estimated by cross-validation over motions
    next_tests: tuple[str, ...] = ()  # proposed tests, the most useful test first

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        return self.result.estimates

    @property
    def converged(self) -> bool:
        """True if the search ended at a minimum; False if it did not converge or was interrupted."""
        return self.result.converged and not self.result.cancelled

    @property
    def cost_percent(self) -> float:
        """Root mean square of ``nrmse_percent`` over the training runs."""
        return self.result.cost_percent

    def card(
        self, assessment: Assessment | None = None, *, title: str = "", sources: Iterable[str] = ()
    ) -> ModelCard:
        """Return the model card. Without an ``assessment``, the fit is assessed on its own runs."""
        judged, result = assessment or assess(self), self.result
        notes: dict[str, object] = {"words": list(judged.words), "passivity_min": judged.passivity_min}
        if self.actuation is not None:
            errors = {name: finite_or_none(error) for name, error in self.actuation.standard_errors.items()}
            notes["actuation"] = {"standard_errors": errors, **self.actuation.to_dict()}
        lists = {"method": result.notes, "next_tests": self.next_tests, "assumed": self.damper.assumed}
        notes |= {name: list(texts) for name, texts in lists.items() if texts}
        if result.cancelled:
            notes["cancelled"] = "interrupted: the best parameters so far, not converged ones"
        return ModelCard(
            title=title or f"{self.damper.law.name}, {len(self.training)} training runs",
            damper=self.damper,
            envelope=operating_envelope(self.training),
            evidence=Evidence(
                runs=tuple(row(error) for error in judged.runs),
                method=result.method,
                cost=result.cost_percent,
                converged=self.converged,
                dataset_fingerprint=self.fingerprint,
                seed=result.seed,
                versions=versions(),
            ),
            standard_errors={e.name: finite_or_none(e.standard_error) for e in self.estimates},
            preparation=self.preparation.to_dict(),
            sources=tuple(sources),
            notes=notes,
            python_law=self.python_law,
            force_band=self.force_band,
        )


def fit_law(
    data: FitData,
    law: Law | None = None,
    *,
    terms: Sequence[str] | None = None,
    dampers: Sequence[Damper] = (),
    response: Damper | None = None,
    interrupted: bool = False,
    on_progress: Progress = silent,
) -> Identification:
    """Fit one law to runs with constant current, and the delay of the force to runs with changing current.

    Parameters
    ----------
    law : name of a law, or a law in Python (object or class); None: ``default_law``
    terms : names of the terms of the law; None: the default terms
    dampers : start values of the search; if empty, the search finds its own start values
    response : damper whose delay and lags are start values of the fit to runs with changing current; None:
        several default values
    interrupted : True if the user has interrupted the job; the search then makes one iteration from the first
        damper
    on_progress : function that receives a ``SearchState`` as ``detail`` after every step
    """
    clock = cpu_seconds()
    chosen, python_law = resolve_law(default_law(data.steady) if law is None else law)
    problem = data.problem(chosen, terms)
    if data.settings.method == "genetic":
        result = fit_genetic(problem, seed=data.settings.genetic_seed, on_progress=on_progress)
    elif interrupted:
        one_step = replace(problem, settings=replace(data.settings, iterations_max=1))
        result = replace(_fit_windows(one_step, dampers[:1], on_progress), cancelled=True)
    else:
        if not dampers and archetypes_of(chosen):
            evaluator = CandidateEvaluator(data, terms=terms)
            dampers = evaluator.starts(evaluator.initial_candidate(chosen.name))
        result = _fit_windows(problem, dampers, on_progress)
    result, band, tests = _for_other_motions(problem, result)
    if data.fluid is not None:
        result = replace(result, damper=scale_thinning(result.damper))
    damper, held = limit_coefficients(result.damper, envelope_of(data.training))
    result = replace(result, damper=damper, notes=(*result.notes, *data.notes, *held))
    actuation: ActuationFit | None = None
    if data.changing and not result.cancelled:
        result, actuation = _with_actuation(result, data.changing, response)
        if band is not None:
            band = with_changing_current(band, result.damper.on_limits(), data.changing)
    return Identification(
        result,
        data.training,
        data.held_out,
        data.preparation,
        problem,
        data.fingerprint,
        cpu_seconds() - clock,
        python_law,
        actuation,
        band,
        tests,
    )


def _fit_windows(problem: FitProblem, dampers: Sequence[Damper], on_progress: Progress) -> SearchResult:
    """Fit parameters to sections of the runs; then to whole runs if the sections are not representative."""
    settings = problem.settings
    windows, whole = problem.windows(), run_windows(problem.runs, settings)
    result = fit_variable_projection(
        problem,
        dampers=dampers,
        starts=0 if dampers else settings.random_start_count,
        windows=windows,
        on_progress=on_progress,
    )
    if len(windows) == len(whole) or result.cancelled:
        return result
    percent = float(np.sqrt(Objective(problem, whole).costs_of([result.damper])[0]))
    if percent <= settings.windows_error_ratio_max * result.cost_percent:
        return replace(result, cost_percent=percent)
    return fit_variable_projection(problem, dampers=[result.damper], windows=whole, on_progress=on_progress)


def _for_other_motions(
    problem: FitProblem, result: SearchResult
) -> tuple[SearchResult, ForceBand | None, tuple[str, ...]]:
    """Return the fit with standard errors for new motions, the force band, and proposed tests.

    The force band is None if there are fewer than two folds, so that cross-validation is impossible.
    """
    if result.cancelled or result.damper.law.kernel is None:
        return result, None, ()
    tests, folds = propose_tests(problem, result), refit_without_folds(problem, result)
    if folds is None:
        return result, None, tests
    return with_errors_between_motions(problem, result, folds), force_band(folds), tests


def _with_actuation(
    result: SearchResult, stepping: Sequence[PreparedRun], start: Damper | None
) -> tuple[SearchResult, ActuationFit | None]:
    """Add delay and lags of the force, fitted to runs with changing current, to the damper of ``result``.

    If delay and lags cannot be fitted, the reason is added to ``result.notes`` and the second value is None.
    """
    samples_per_Hz = sum(len(run) * run.trajectory.step for run in stepping)
    rate_Hz = max(NUMERICS.actuation_rate_min_Hz, NUMERICS.actuation_samples_max / samples_per_Hz)
    stepping = [decimate(run, rate_Hz) for run in stepping]
    try:
        found = fit_actuation(result.damper, stepping, start=start)
    except InputError as error:
        return replace(result, notes=(*result.notes, f"without an actuation: {error}")), None
    damper, actuation = refine_actuation(*found, stepping)
    return replace(result, damper=damper), actuation


def default_law(runs: Sequence[PreparedRun]) -> str:
    """Return the name of the default law, which depends on whether all runs have a temperature."""
    temperature_dependent = all(run.trajectory.temperature is not None for run in runs)
    return "double-bouc-wen" if temperature_dependent else "series-valve"


def resolve_law(law: Law) -> tuple[HysteresisLaw, str | None]:
    """Return the law object, and the source (``file.py:Class``) if the law is user-defined, else None.

    If ``law`` contains the name of a Python file, the file is executed.
    """
    if isinstance(law, HysteresisLaw):
        return law, None if law.python is None else _place_of(law.python)
    if isinstance(law, str):
        if ".py:" in law:
            return load_python_law(law), law
        return find_law(law), None
    own = law() if isinstance(law, type) else law
    return law_from_python(own), _place_of(own)


def versions() -> dict[str, str]:
    """Return the versions of the packages on which a result depends, by package name."""
    return {name: version(name) for name in ("mrdamper", "numpy", "scipy")}


def _place_of(law: PythonLaw) -> str:
    try:
        return f"{inspect.getfile(type(law))}:{type(law).__name__}"
    except (OSError, TypeError):
        return f"<interactive>:{type(law).__name__}"
