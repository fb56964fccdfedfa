"""The jobs, end to end: all that the command line calls.

A job reads runs, computes, writes its files all at once or not at all, and returns one JSON-ready object.
Keys that scripts rely on: docs/architecture.md. Nothing is printed here.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.files import is_file
from mrdamper.identify.assess import Assessment, Kind, LawScore, choose_law
from mrdamper.identify.checkpoint import CheckpointStore, Scope
from mrdamper.identify.fit import Identification, Method, fit, versions
from mrdamper.identify.fit import assess as assess_fit
from mrdamper.identify.predict import row
from mrdamper.identify.temperature import Temperature
from mrdamper.jobs.inputs import read_dataset
from mrdamper.models.card_schema import write_card
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.models.laws import LAWS
from mrdamper.report import answers
from mrdamper.runtime.checkpoint import Tell, checkpointed
from mrdamper.runtime.outputs import atomic_output, write_table
from mrdamper.runtime.progress import Progress, silent
from mrdamper.runtime.signals import Interrupted, interrupt_ends_all
from mrdamper.schema import Json

__all__ = [
    "FitOptions",
    "data_fetch",
    "data_list",
    "identify",
    "read_dataset",
    "run_identification",
    "write_identification",
]


_CUT_SHORT = "interrupted while fitting again: the first fit is whole, what was to follow is not there"


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """What ``mrdamper identify`` can be told about the fit."""

    law: str | None = None  # a name, ``auto``, ``file.py:Class``; None: the usual one for the runs
    method: Method = "varpro"
    starts: int = 3
    seed: int = 0
    hold_out: tuple[str, ...] = ()
    leave_out: tuple[Kind, ...] = ()
    session_offsets: bool = False
    one_command: bool = False
    terms: tuple[str, ...] | None = None
    temperature: Temperature = "auto"
    fluid: str | None = None  # a preset's name or a fluid file
    coil_resistance_ohm: float | None = None
    profiled: bool = False
    draws: int = 0


def identify(
    paths: Sequence[str | Path],
    out: Path,
    options: FitOptions,
    *,
    channels: Path | None = None,
    flip_force: bool = False,
    resume: bool | None = None,
    tell: Tell | None = None,
    on_progress: Progress = silent,
) -> Json:
    """Read runs, fit, assess; write card.json, report.html and errors.csv into ``out``.

    Parameters
    ----------
    resume : go on with what a run of the same data and options had finished; False: begin anew, but keep what
        is finished; None: keep nothing (``checkpoint``)
    tell : told what is done with an earlier run's progress
    """
    dataset = read_dataset(paths, channels, flip_force=flip_force)
    sources = tuple(dict.fromkeys(Path(run.source).name for run in dataset if run.source))
    head = {} if resume is None else _decisive(dataset, options)
    with checkpointed(out, head, resume=resume, tell=tell) as kept:
        with atomic_output(out) as beside:
            answer = run_identification(
                dataset, beside, out, options, sources=sources, on_progress=on_progress, checkpoint=kept
            )
        if kept is not None:
            kept.finished = not answer["cancelled"]
        return answer


def _decisive(dataset: Dataset, options: FitOptions) -> Json:
    """Return all that decides what a fit comes to; progress is taken up only where this is the same."""
    digest = hashlib.sha256(dataset.fingerprint.encode())
    for run in dataset:
        digest.update(f"{run.name}\0{run.session}\0{run.motion}\0".encode())
    own = options.law.rpartition(":")[0] if options.law is not None and ".py:" in options.law else ""
    if own and is_file(own):  # one that is not there is told by who reads it
        digest.update(Path(own).read_bytes())
    if options.fluid is not None:
        digest.update(repr(find_fluid(options.fluid)).encode())
    return {
        "job": "identify",
        "program": versions(),
        "data": digest.hexdigest(),
        "options": {key: value for key, value in asdict(options).items() if key != "seed"},
        "seed": options.seed,
    }


def data_list() -> list[Json]:
    """Return the public data sets that can be fetched."""
    from mrdamper.data.catalog import list_sets

    return [
        {
            "name": each.name,
            "title": each.title,
            "files": len(each.files),
            "licence": each.licence,
            "doi": each.doi or None,
            "repository": each.repository,
            "commit": each.commit,
            "channels": each.channels,
            "notes": each.notes,
        }
        for each in list_sets()
    ]


def data_fetch(name: str) -> Json:
    """Fetch a public data set (or find it in the local mirror ``MRDAMPER_DATA``) and say where it lies."""
    from mrdamper.data.catalog import fetch

    folder = fetch(name)
    return {"name": name, "folder": str(folder), "files": [str(path) for path in sorted(folder.iterdir())]}


# ------------------------------------------------------------------------------------------- identify


def run_identification(  # noqa: PLR0913 - what a job is told, by keyword
    dataset: Dataset,
    beside: Path,
    out: Path,
    options: FitOptions,
    *,
    sources: Sequence[str],
    simulated: str = "",
    title: str = "",
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
) -> Json:
    """Fit, assess and write into ``beside`` what will lie in ``out``."""
    table: tuple[LawScore, ...] = ()
    law = options.law
    if law == "auto":
        table = _compare(dataset, options, on_progress, checkpoint)
        law = table[0].law
    fitted = fit(
        dataset,
        law,
        method=options.method,
        starts=options.starts,
        seed=options.seed,
        hold_out=options.hold_out,
        session_offsets=options.session_offsets,
        one_command=options.one_command,
        terms=options.terms,
        temperature=options.temperature,
        fluid=None if options.fluid is None else find_fluid(options.fluid),
        coil_resistance_ohm=options.coil_resistance_ohm,
        on_progress=on_progress,
        checkpoint=checkpoint,
    )
    fitted, judged = _assessed(fitted, options, on_progress, checkpoint)
    answer = write_identification(
        fitted, judged, beside, out, law_table=table, sources=sources, simulated=simulated, title=title
    )
    return answer | {"cancelled": answer["cancelled"] or _CUT_SHORT in fitted.result.notes}


def write_identification(
    fitted: Identification,
    judged: Assessment,
    beside: Path,
    out: Path,
    *,
    law_table: tuple[LawScore, ...] = (),
    sources: Sequence[str] = (),
    simulated: str = "",
    title: str = "",
) -> Json:
    """Write card.json, errors.csv and report.html into ``beside``; they will lie in ``out``."""
    from mrdamper.jobs.check import findings_of
    from mrdamper.report.identification.page import render_report

    write_card(fitted.card(judged, title=title, sources=sources), beside / "card.json")
    write_table(beside / "errors.csv", [row(error) for error in judged.runs])
    findings = findings_of((*fitted.training, *fitted.held_out))
    page = render_report(
        fitted, judged, law_table=law_table, simulated=simulated, title=title, findings=findings
    )
    (beside / "report.html").write_text(page, encoding="utf-8")
    answer = answers.identification(fitted, judged, out, law_table)
    return answer | {"findings": [dict(finding.to_dict()) for finding in findings]}


def _compare(
    dataset: Dataset, options: FitOptions, on_progress: Progress, checkpoint: CheckpointStore | None
) -> tuple[LawScore, ...]:
    """Compare all laws on the training runs, one motion left out; held-out runs are not looked at."""
    from mrdamper.identify.fit import split_by_command
    from mrdamper.identify.predict import prepare_all

    training = dataset.split(options.hold_out)[0] if options.hold_out else dataset
    with interrupt_ends_all():
        return choose_law(
            split_by_command(prepare_all(training, Preparation()))[0],
            tuple(LAWS),
            seed=options.seed,
            starts=min(options.starts, 2),
            one_command=options.one_command,
            temperature="none" if options.fluid is not None else options.temperature,
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
                return fitted, assess_fit(
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
    return fitted, assess_fit(fitted)
