"""The job ``identify``: measured runs in; a fitted damper, what is known about the fit, and its card out."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from mrdamper.data.finding import Finding
from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.files import is_file
from mrdamper.identify import fit as fitting
from mrdamper.identify.assess import Assessment, LawScore, choose_law
from mrdamper.identify.checkpoint import CheckpointStore, Scope
from mrdamper.identify.fit import Identification, Law
from mrdamper.identify.predict import prepare_all
from mrdamper.identify.temperature import FluidFactors
from mrdamper.jobs.check import findings_of
from mrdamper.jobs.options import FitOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.laws import LAWS
from mrdamper.runtime.progress import Progress, silent
from mrdamper.runtime.signals import Interrupted, interrupt_ends_all
from mrdamper.schema import Json

__all__ = ["IdentifyResult", "decisive", "identify"]

_USUAL = FitOptions()
_CUT_SHORT = "interrupted while fitting again: the first fit is whole, what was to follow is not there"


@dataclass(frozen=True, kw_only=True)
class IdentifyResult(Identification):
    """A fit with what is known about it: all that its card and its report are made of."""

    assessment: Assessment
    law_table: tuple[LawScore, ...] = ()  # the laws that were compared, the best first; none without a choice
    findings: tuple[Finding, ...] = ()  # what the runs show by themselves
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
    law : a law's name, ``auto``, ``file.py:Class``, or a user's own law in Python; None: the usual one
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
    table: tuple[LawScore, ...] = ()
    if isinstance(law, str) and law == "auto":
        table = _compare(runs, fluid, preparation, options, on_progress, checkpoint)
        law = table[0].law
    fitted = fitting.fit(
        runs,
        law,
        method=options.method,
        starts=options.starts,
        seed=options.seed,
        hold_out=options.hold_out,
        session_offsets=options.session_offsets,
        one_command=options.one_command,
        terms=_terms(options),
        temperature=options.temperature,
        fluid=fluid,
        coil_resistance_ohm=options.coil_resistance_ohm,
        preparation=preparation,
        on_progress=on_progress,
        checkpoint=checkpoint,
    )
    fitted, judged = _assessed(fitted, options, on_progress, checkpoint)
    return IdentifyResult(
        **vars(fitted),
        assessment=judged,
        law_table=table,
        findings=findings_of((*fitted.training, *fitted.held_out)),
        sources=tuple(dict.fromkeys(Path(run.source).name for run in runs if run.source)),
    )


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
    seed = told.pop("seed")
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


def _compare(
    runs: Dataset,
    fluid: FluidFactors | None,
    preparation: Preparation | None,
    options: FitOptions,
    on_progress: Progress,
    checkpoint: CheckpointStore | None,
) -> tuple[LawScore, ...]:
    """Compare all laws on the training runs, one motion left out; held-out runs are not looked at."""
    training = runs.split(options.hold_out)[0] if options.hold_out else runs
    with interrupt_ends_all():
        return choose_law(
            fitting.split_by_command(prepare_all(training, preparation or Preparation()))[0],
            tuple(LAWS),
            seed=options.seed,
            starts=min(options.starts, 2),
            one_command=options.one_command,
            temperature="none" if fluid is not None else options.temperature,
            on_progress=on_progress,
            checkpoint=Scope(checkpoint, "laws"),
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
                )
        except Interrupted:
            notes = (*fitted.result.notes, _CUT_SHORT)
            fitted = replace(fitted, result=replace(fitted.result, notes=notes))
    return fitted, fitting.assess(fitted)
