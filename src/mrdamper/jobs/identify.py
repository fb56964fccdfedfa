"""The job ``identify``: measured runs in; a fitted damper, what is known about the fit, and its card out."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from mrdamper.control.tables.card_tables import STEPPED, TABULATED
from mrdamper.data.finding import Finding, Inference
from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.files import is_file
from mrdamper.identify import fit as fitting
from mrdamper.identify.assess import Assessment
from mrdamper.identify.checkpoint import CheckpointStore, Scope
from mrdamper.identify.confidence.posterior import Posterior, sample_posterior
from mrdamper.identify.fit import Identification, Law
from mrdamper.identify.predict import at_reference, prepare_all
from mrdamper.identify.selection.judge import Judge
from mrdamper.identify.selection.select import LawScore, Selection, select
from mrdamper.identify.temperature import FluidFactors, settle_temperature
from mrdamper.jobs.check import findings_of
from mrdamper.jobs.options import FitOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.runtime.pool import Pool, cpu_seconds
from mrdamper.runtime.progress import Progress, silent
from mrdamper.runtime.signals import Interrupted, interrupt_ends_all
from mrdamper.schema import Json

_USUAL = FitOptions()
AUTO = "auto"
"""The name of the law that is chosen by what was left out."""

_CUT_SHORT = "interrupted while fitting again: the first fit is whole, what was to follow is not there"


@dataclass(frozen=True, kw_only=True)
class IdentifyResult(Identification):
    """A fit with what is known about it: all that its card and its report are made of."""

    assessment: Assessment
    law_table: tuple[LawScore, ...] = ()  # the candidates that were compared, the chosen first
    posterior: Posterior | None = None  # where draws of it were asked for
    chosen_by: str = ""  # what was left out to choose by; nothing where the law was given
    findings: tuple[Finding, ...] = ()  # what reading did to the runs, and what they show by themselves
    inferred: tuple[Inference, ...] = ()  # commands and temperatures that stood in words, with their source
    sources: tuple[str, ...] = ()  # names of the files that the runs are from
    title: str = ""  # of card and report, where it is not the usual one
    simulated: str = ""  # what the runs are, where nobody measured them

    @property
    def cancelled(self) -> bool:
        """Whether an interrupt has cut short the fit, or what was to follow it."""
        return self.result.cancelled or _CUT_SHORT in self.result.notes

    def card(
        self, assessment: Assessment | None = None, *, title: str = "", sources: Iterable[str] = ()
    ) -> ModelCard:
        """Return the model card, by default with the result's own assessment, title and sources."""
        return super().card(
            assessment or self.assessment,
            title=title or self.title,
            sources=tuple(sources) or self.sources,
        )


def identify(
    runs: Dataset,
    law: Law | None = None,
    fluid: FluidFactors | None = None,
    preparation: Preparation | None = None,
    options: FitOptions = _USUAL,
    *,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
) -> IdentifyResult:
    """Fit one law to runs, over all their commands and temperatures at once, and judge the fit.

    An interrupt keeps the best fit so far; one while runs are left out keeps the fit and drops the rest.

    Parameters
    ----------
    law : a law's name, ``file.py:Class``, or a user's own law in Python; ``auto`` or None: the one of the
        least error on motions that were left out, with its terms (None with another method than ``varpro``:
        ``series-valve``, ``double-bouc-wen`` for runs at several temperatures)
    fluid : its temperature laws are assumed; runs without a temperature channel count as at 20 degC
    preparation : how the runs are prepared; None: as each asks for
    checkpoint : recalls and keeps what the searches have finished

    Raises
    ------
    InputError
        Runs, law and options do not fit together.
    ConvergenceError
        No start of the search found a finite cost.
    """
    runs = runs.select(*options.only) if options.only else runs
    clock, selection = cpu_seconds(), None
    if law == AUTO or (law is None and options.method == "varpro"):
        selection = _select(runs, fluid, preparation, options, on_progress, checkpoint)
        law = selection.chosen.candidate.law
    fitted = fitting.fit(
        runs,
        law,
        method=options.method,
        starts=options.starts,
        first=None if selection is None else selection.chosen.damper,
        cut_short=selection is not None and selection.interrupted,
        seed=options.seed,
        hold_out=options.hold_out,
        session_offsets=options.session_offsets,
        one_command=options.one_command,
        terms=_terms(options) if selection is None else selection.chosen.candidate.groups,
        temperature=options.temperature,
        fluid=fluid,
        coil_resistance_ohm=options.coil_resistance_ohm,
        preparation=preparation,
        on_progress=on_progress,
        checkpoint=checkpoint,
    )
    if selection is not None:
        notes = (*fitted.result.notes, *_untracked(fitted.damper, selection))
        fitted = replace(fitted, result=replace(fitted.result, notes=notes))
    fitted, judged = _assessed(fitted, options, on_progress, checkpoint)
    fitted, posterior = _sampled(fitted, options, on_progress)
    found = IdentifyResult(
        **vars(fitted),
        assessment=judged,
        posterior=posterior,
        law_table=() if selection is None else selection.table,
        chosen_by="" if selection is None else selection.left_out,
        findings=findings_of(
            (*fitted.training, *fitted.held_out),
            fitted.damper,
            runs.findings,
            free=[each.name for each in fitted.estimates if not each.at_bound],
        ),
        inferred=runs.inferred,
        sources=tuple(dict.fromkeys(Path(run.source).name for run in runs if run.source)),
    )
    return replace(found, cpu_s=cpu_seconds() - clock)


def decisive(
    runs: Dataset,
    law: Law | None,
    fluid: FluidFactors | None,
    preparation: Preparation | None,
    options: FitOptions,
) -> Json:
    """Return all that decides what a fit comes to; progress is taken up only where this is the same."""
    digest = hashlib.sha256(runs.fingerprint.encode())
    for run in runs:
        digest.update(f"{run.name}\0{run.session}\0{run.motion}\0".encode())
    own = law.rpartition(":")[0] if isinstance(law, str) and ".py:" in law else ""
    if own and is_file(own):  # one that is not there is told by who reads it
        digest.update(Path(own).read_bytes())
    for given in (fluid, preparation):
        if given is not None:
            digest.update(repr(given).encode())
    told: dict[str, Any] = asdict(options)
    seed, _ = told.pop("seed"), told.pop("jobs")
    return {
        "job": "identify",
        "program": fitting.versions(),
        "data": digest.hexdigest(),
        "options": {"law": law if law is None else str(law), "fluid": fluid is not None, **told},
        "seed": seed,
    }


def _terms(options: FitOptions) -> tuple[str, ...] | None:
    """Return the parallel terms to add; None: what the runs ask for."""
    return None if options.terms is None else tuple(term for term in options.terms if term != "none")


def options_for(runs: Dataset, options: FitOptions) -> FitOptions:
    """Return options that name no run to hold out which this campaign, one of many, does not have."""
    present = [glob for glob in options.hold_out if any(fnmatchcase(name, glob) for name in runs.names)]
    return replace(options, hold_out=tuple(present))


def _select(
    runs: Dataset,
    fluid: FluidFactors | None,
    preparation: Preparation | None,
    options: FitOptions,
    on_progress: Progress,
    checkpoint: CheckpointStore | None,
) -> Selection:
    """Choose a law by what is left out of the training runs; held-out runs are not looked at."""
    training = runs.split(options.hold_out)[0] if options.hold_out else runs
    prepared = prepare_all(training, preparation or Preparation())
    temperature = options.temperature
    if fluid is None:
        prepared, temperature, _ = settle_temperature(prepared, temperature)
    else:
        prepared = tuple(map(at_reference, prepared))
    steady, changing = fitting.split_by_command(prepared)
    with interrupt_ends_all():
        judge = Judge(
            steady,
            changing=changing,
            terms=_terms(options),
            one_command=options.one_command,
            temperature=temperature,
            fluid=fluid,
            session_offsets=options.session_offsets,
            seed=options.seed,
            checkpoint=Scope(checkpoint, "selection"),
            pool=Pool(options.jobs),
        )
        return select(judge, tuple(LAWS), supports=_inverted, on_progress=on_progress)


def _inverted(damper: Damper) -> bool:
    """Say whether every controller is made from such a damper: that of a chain predicts only."""
    return _tracked(damper) and damper.law.name != "chain"


def _tracked(damper: Damper) -> bool:
    """Say whether a controller of ``track`` and of ``export`` is made from such a damper."""
    return damper.law.name in (*TABULATED, *STEPPED)


def _untracked(damper: Damper, selection: Selection) -> tuple[str, ...]:
    """Return a note where no controller takes the chosen law: the best that they take, and its error."""
    if _tracked(damper):
        chosen = selection.table[0]
        better = [row for row in selection.table[1:] if row.left_out_percent < 0.99 * chosen.left_out_percent]
        other = next((row for row in better if row.law not in (*TABULATED, *STEPPED)), None)
        return () if other is None else (
            f"⟦--law {other.law}⟧ comes to {other.left_out_percent:.2f} % on what was left out instead of "
            f"{chosen.left_out_percent:.2f} %, but no controller takes it",
        )  # fmt: skip
    others = [row for row in selection.table if row.law in (*TABULATED, *STEPPED)]
    known = [row for row in others if row.left_out_percent == row.left_out_percent]
    if not known:
        return (f"no controller takes the law {selection.chosen.candidate.title}",)
    best, chosen = min(known, key=lambda row: row.left_out_percent), selection.table[0]
    return (
        f"no controller takes the law {selection.chosen.candidate.title}; "
        f"⟦{' --term '.join((f'--law {best.law}', *best.groups))}⟧ is one that they take, with "
        f"{best.left_out_percent:.2f} % on what was left out instead of {chosen.left_out_percent:.2f} %",
    )


def _assessed(
    fitted: Identification, options: FitOptions, on_progress: Progress, checkpoint: CheckpointStore | None
) -> tuple[Identification, Assessment]:
    """Assess a fit; an interrupt while fitting or while leaving runs out keeps the fit and skips the rest."""
    more = options.leave_out or options.profiled or options.draws
    if not fitted.result.cancelled and more:
        try:
            with interrupt_ends_all():
                return fitted, fitting.assess(
                    fitted,
                    leave_out=options.leave_out,
                    profiled=options.profiled,
                    draws=options.draws,
                    on_progress=on_progress,
                    checkpoint=Scope(checkpoint, "assessment"),
                    pool=Pool(options.jobs),
                )
        except Interrupted:
            notes = (*fitted.result.notes, _CUT_SHORT)
            fitted = replace(fitted, result=replace(fitted.result, notes=notes))
    return fitted, fitting.assess(fitted)


def _sampled(
    fitted: Identification, options: FitOptions, on_progress: Progress
) -> tuple[Identification, Posterior | None]:
    """Draw from the posterior where that is asked for; an interrupt keeps the fit, and the draws so far."""
    if fitted.result.cancelled or not options.posterior:
        return fitted, None
    try:
        with interrupt_ends_all():
            return fitted, sample_posterior(
                fitted.problem,
                fitted.result,
                draws=options.posterior,
                seed=options.seed,
                on_progress=on_progress,
                pool=Pool(options.jobs),
            )
    except Interrupted:
        notes = (*fitted.result.notes, _CUT_SHORT)
        return replace(fitted, result=replace(fitted.result, notes=notes)), None
