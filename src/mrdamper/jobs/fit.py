"""The job ``fit``: fit a damper model to measured runs, assess the fit, and make the model card."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from mrdamper.control.tables.card_tables import STEPPED, TABULATED
from mrdamper.data.finding import Finding, Inference
from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.identify import fit as fitting
from mrdamper.identify.assess import Assessment
from mrdamper.identify.confidence.posterior import sample_posterior
from mrdamper.identify.consistency.errors import find_contradictions
from mrdamper.identify.fit import Identification, Law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.scores import ErrorSummary, summarize_errors
from mrdamper.identify.selection.evaluator import CandidateEvaluator
from mrdamper.identify.selection.select import Selection, select_model
from mrdamper.identify.selection.settings import SelectionSettings
from mrdamper.identify.settings import DEFAULT_SETTINGS, FitSettings
from mrdamper.identify.temperature import FluidFactors
from mrdamper.interrupts import interrupt_ends_all
from mrdamper.jobs.check import findings_of
from mrdamper.jobs.options import FitOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_draws import CardDraws
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.results import JobResult
from mrdamper.runtime.pool import Pool, cpu_seconds, parallel_computations
from mrdamper.runtime.progress import Progress, silent

_USUAL = FitOptions()
AUTO = "auto"
"""Name that requests model selection: the law with the smallest cross-validation error is fitted."""


@dataclass(frozen=True, kw_only=True, repr=False)
class FitResult(JobResult, Identification):
    """A fit with its assessment: the content of the model card and of the report."""

    _job = "fit"
    assessment: Assessment
    selection: Selection | None = None  # result of the model selection; None if the user specified the law
    posterior: CardDraws | None = None
    findings: tuple[Finding, ...] = ()  # changes made to the runs while reading, and faults of the runs
    inferred: tuple[Inference, ...] = ()  # currents and temperatures that were read from names and texts
    sources: tuple[str, ...] = ()  # names of the files with the runs
    title: str = ""  # title of card and report; empty: the default title
    simulated: str = ""  # description of simulated runs; empty: the runs were measured

    @property
    def errors(self) -> tuple[ErrorSummary, ...]:
        """Return the error statistics of held-out runs, training runs and cross-validation."""
        if self.selection is None:
            return summarize_errors(self.assessment.runs)
        chosen = self.selection.scores[0]
        return summarize_errors(
            self.assessment.runs, chosen.cv_percent_by_run, chosen.changing_percent_by_run
        )

    @property
    def cancelled(self) -> bool:
        """Return True if the user has interrupted the fit before its end."""
        return self.result.cancelled

    def card(
        self, assessment: Assessment | None = None, *, title: str = "", sources: Iterable[str] = ()
    ) -> ModelCard:
        """Return the model card. Omitted arguments are taken from this result."""
        return super().card(
            assessment or self.assessment,
            title=title or self.title,
            sources=tuple(sources) or self.sources,
        )


def fit(
    runs: Dataset,
    law: Law | None = None,
    fluid: FluidFactors | None = None,
    preparation: Preparation | None = None,
    settings: FitSettings | None = None,
    options: FitOptions = _USUAL,
    *,
    on_progress: Progress = silent,
) -> FitResult:
    """Fit one damper model to runs at all commands and temperatures; assess the fit.

    If the user interrupts the job, the best fit so far is returned.

    Parameters
    ----------
    law : law (hysteresis model) as name, ``file.py:Class`` or Python object; ``auto`` or None: the law and
        the optional terms with the smallest cross-validation error
    fluid : fluid with a known temperature dependence, which is assumed instead of fitted; runs that have no
        temperature channel then get a constant temperature of 20 degC
    preparation : preparation of the runs; None: chosen for each run
    settings : numerical settings of the fit; None: the default ones

    Raises
    ------
    InputError
        If the runs are not sufficient for the law and the options.
    ConvergenceError
        If no initial point of the search has a finite cost.
    """
    runs = runs.select(*options.only) if options.only else runs
    settings = settings or DEFAULT_SETTINGS
    clock = cpu_seconds()
    selection: Selection | None = None
    selection_notes: tuple[str, ...] = ()
    data = FitData.prepare(
        runs,
        hold_out=options.hold_out,
        preparation=preparation,
        temperature=options.temperature,
        fluid=fluid,
        one_command=options.one_command,
        settings=settings,
    )
    if law is None and settings.method == "genetic":
        law = fitting.default_law(data.steady)
    with parallel_computations(options.jobs):
        if law is None or law == AUTO:
            selection, selection_notes = _select(data, options, on_progress)
            law = selection.chosen.candidate.law
        fitted = fitting.fit_law(
            data,
            law,
            terms=_terms(options) if selection is None else selection.chosen.candidate.terms,
            dampers=() if selection is None else selection.alternatives,
            response=None if selection is None else selection.response,
            interrupted=selection is not None and selection.interrupted,
            on_progress=on_progress,
        )
    if selection is not None:
        notes = (*fitted.result.notes, *selection_notes, *_missing_controller_note(fitted.damper, selection))
        fitted = replace(fitted, result=replace(fitted.result, notes=notes))
    fitted, posterior = _sampled(fitted, options)
    found = FitResult(
        **vars(fitted),
        assessment=fitting.assess(fitted),
        posterior=posterior,
        selection=selection,
        findings=findings_of(
            fitted.training,
            fitted.held_out,
            fitted.damper,
            runs.findings,
            free=[each.name for each in fitted.estimates if not each.at_bound],
        ),
        inferred=runs.inferred,
        sources=tuple(dict.fromkeys(Path(run.source).name for run in runs if run.source)),
    )
    findings = (*find_contradictions(found.errors), *found.findings)
    return replace(found, findings=findings, cpu_s=cpu_seconds() - clock)


def _terms(options: FitOptions) -> tuple[str, ...] | None:
    """Return the optional terms that the user requested; None without a request."""
    return None if options.terms is None else tuple(term for term in options.terms if term != "none")


def options_for(runs: Dataset, options: FitOptions) -> FitOptions:
    """Remove patterns in ``hold_out`` that match no run; return the changed options."""
    present = [glob for glob in options.hold_out if any(fnmatchcase(name, glob) for name in runs.names)]
    return replace(options, hold_out=tuple(present))


def _select(data: FitData, options: FitOptions, on_progress: Progress) -> tuple[Selection, tuple[str, ...]]:
    """Select a law and terms by cross-validation on sections of the runs.

    The error of the chosen model on the sections must not be much smaller than the error on all runs.
    Otherwise the selection is repeated with more sections or all data, and a note reports the repetition.
    """
    settings, samples_max = SelectionSettings(), SelectionSettings().samples_max
    first: Selection | None = None
    while True:
        with interrupt_ends_all():
            evaluator = CandidateEvaluator(
                data,
                terms=_terms(options),
                pool=Pool(options.jobs),
                samples_max=samples_max,
            )
            selection = select_model(
                evaluator, tuple(LAWS), has_controller=_has_controller, on_progress=on_progress
            )
        selection = replace(
            selection,
            subset_error_percent=selection.chosen.training_rms_percent,
            all_runs_error_percent=evaluator.error_on_all_runs_percent(selection.chosen),
            sample_count=sum(len(window.force) for window in evaluator.windows),
            is_subset=evaluator.is_subset,
        )
        if selection.interrupted or evaluator.is_represented(selection.chosen):
            return selection, () if first is None else (_repetition_note(first, selection),)
        first = first or selection
        samples_max = round(settings.subset_growth * samples_max)


def _repetition_note(first: Selection, last: Selection) -> str:
    """Return a note that the model selection was repeated, with the errors that caused the repetition."""
    data = "more data" if last.is_subset else "all data, because no subset represented the runs"
    return (
        f"The selection was repeated with {data}. "
        f"The first choice had an error of {first.subset_error_percent:.3g} % on the "
        f"{first.sample_count} samples of the selection and "
        f"{first.all_runs_error_percent:.3g} % on all runs"
    )


def _has_controller(damper: Damper) -> bool:
    return damper.law.name in (*TABULATED, *STEPPED)


def _missing_controller_note(damper: Damper, selection: Selection) -> tuple[str, ...]:
    """Return a note if the law with the smallest error has no force controller.

    The note compares this law with the best law that has a controller. Otherwise, the tuple is empty.
    """
    chosen = selection.scores[0]
    if _has_controller(damper):
        better = [row for row in selection.scores[1:] if row.cv_mean_percent < 0.99 * chosen.cv_mean_percent]
        other = next((row for row in better if row.law not in (*TABULATED, *STEPPED)), None)
        return () if other is None else (
            f"--law {other.law} has a cross-validation error of {other.cv_mean_percent:.2f} % instead of "
            f"{chosen.cv_mean_percent:.2f} %, but no controller can be made from it",
        )  # fmt: skip
    known = [
        row
        for row in selection.scores
        if row.law in (*TABULATED, *STEPPED) and not math.isnan(row.cv_mean_percent)
    ]
    if not known:
        return (f"no controller can be made from the law {selection.chosen.candidate.title}",)
    best = min(known, key=lambda row: row.cv_mean_percent)
    return (
        f"no controller can be made from the law {selection.chosen.candidate.title}; controllers support "
        f"{' --term '.join((f'--law {best.law}', *best.terms))}, with a cross-validation error of "
        f"{best.cv_mean_percent:.2f} % instead of {chosen.cv_mean_percent:.2f} %",
    )


def _sampled(fitted: Identification, options: FitOptions) -> tuple[Identification, CardDraws | None]:
    """Return the fit and its posterior samples (None if they are not requested or cannot be drawn).

    If sampling fails, a note is added to the fit.
    """
    if fitted.result.cancelled or not options.posterior:
        return fitted, None
    try:
        return fitted, sample_posterior(fitted.problem, fitted.result, draws=options.posterior)
    except InputError as error:
        note = f"without posterior samples: {error}"
        notes = (*fitted.result.notes, note)
        return replace(fitted, result=replace(fitted.result, notes=notes)), None
