"""Output of the command ``fit``: JSON, terminal, model card, page, errors as CSV."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mrdamper.data.finding import by_kind
from mrdamper.identify.actuation.fit import ActuationFit
from mrdamper.identify.evaluate import row
from mrdamper.identify.problem import Estimate
from mrdamper.identify.selection.select import Selection
from mrdamper.jobs.fit import FitResult
from mrdamper.models.card_draws import DRAWS_FILE, write_draws
from mrdamper.models.card_schema import write_card
from mrdamper.report.base import DONE, NO_FILES, Outcome, Report, WrittenFile, csv_file, interrupted
from mrdamper.report.identification.page import PAGE
from mrdamper.report.identification.scores import summaries
from mrdamper.report.identification.tables import (
    best_candidates,
    error_summary_table,
    subset_sentence,
)
from mrdamper.report.identification.verdict import verdict_lines
from mrdamper.report.page import sentence
from mrdamper.report.sections import print_compact
from mrdamper.schema import Json

NOTE_COUNT_MAX = 1


def _fields(found: FitResult) -> dict[str, object]:
    """Return the values that ``mrdamper fit --json`` prints, without the paths of the files."""
    result, judged, selection, posterior = found.result, found.assessment, found.selection, found.posterior
    return {
        "law": found.damper.law.name,
        "method": result.method,
        "coefficients": {each.name: _estimate(each) for each in result.estimates},
        "cpu_s": round(found.cpu_s, 4),
        "runs": _rows(found),
        "summary": summaries(judged.runs),
        "cost_percent": result.cost_percent,
        "seed": result.seed,
        "starts": result.starts,
        "passivity_min": judged.passivity_min,
        "converged": found.converged,
        "cancelled": found.cancelled,
        "errors": found.errors,
        "notes": [*result.notes, *judged.words],
        "actuation": None if found.actuation is None else _actuation(found.actuation),
        "force_band": found.force_band,
        "next_tests": found.next_tests,
        "assumed": found.damper.assumed,
        "posterior": None
        if posterior is None
        else {
            "draws": len(posterior),
            "standard_deviation": posterior.standard_deviation,
            "percentiles_5_95": posterior.percentiles,
        },
        "selection": None
        if selection is None
        else {
            "validation_data": selection.validation_data,
            "is_subset": selection.is_subset,
            "sample_count": selection.sample_count,
            "subset_error_percent": selection.subset_error_percent,
            "all_runs_error_percent": selection.all_runs_error_percent,
            "candidates": selection.scores,
        },
        "findings": [each.to_dict() for each in found.findings],
        "inferred": found.inferred,
    }


def _rows(found: FitResult) -> list[dict[str, object]]:
    """Return the errors as table rows, one row for each run."""
    return [row(error) for error in found.assessment.runs]


def _estimate(estimate: Estimate) -> dict[str, object]:
    return {**asdict(estimate), "identifiable": estimate.identifiable}


def _actuation(fitted: ActuationFit) -> dict[str, object]:
    errors = {f"{name}_standard_error": error for name, error in fitted.standard_errors.items()}
    return {**asdict(fitted.actuation), **errors, **fitted.to_dict()}


def _write_posterior(found: FitResult, path: Path) -> None:
    if found.posterior is not None:
        write_draws(found.posterior, found.damper, path)


def _show(found: FitResult, console: Console) -> None:
    """Print first the verdict, then the errors, the selected model, warnings and notes."""
    # The terminal shows the most important rows. The report has all of them.
    model_count_max = 3
    for line in verdict_lines(found):
        console.print(escape(line))
    console.print()
    print_compact(error_summary_table(found.errors).printed(), console)
    if found.selection is not None:
        console.print(escape(_selection_line(found.selection)))
        print_compact(best_candidates(found.selection, model_count_max).printed(), console)
    for line in (*_warning_lines(found), *_note_lines(found)):
        console.print(line)


def _selection_line(selection: Selection) -> str:
    candidate = selection.chosen.candidate
    terms = f" with {', '.join(candidate.terms)}" if candidate.terms else ""
    return (
        f"Selected {candidate.law}{terms} from {len(selection.scores)} candidates by cross-validation "
        f"({selection.validation_data}). {subset_sentence(selection)}"
    )


def _warning_lines(found: FitResult) -> list[str]:
    """Return the worst finding of each kind, as console markup."""
    warning_count_max = 2
    kinds = [(finding, count) for finding, count in by_kind(found.findings) if finding.severity != "note"]
    lines = []
    for finding, run_count in kinds[:warning_count_max]:
        runs = f"{run_count} runs, worst {finding.run}" if run_count > 1 else finding.run or "all runs"
        text = f"{runs}: {finding.found}."
        colour = "red" if finding.severity == "fault" else "yellow"
        lines.append(f"[{colour}]{finding.severity.capitalize()}[/{colour}]: {escape(text)}")
    if len(kinds) > warning_count_max:
        lines.append(f"The report has {len(kinds) - warning_count_max} more warnings, and remedies.")
    return lines


def _note_lines(found: FitResult) -> list[str]:
    """Return the most important notes, as console markup. The report contains all notes."""
    lines = [escape(f"Note: {sentence(note)}") for note in found.result.notes[:NOTE_COUNT_MAX]]
    if found.inferred:
        lines.append(f"Note: {len(found.inferred)} values were read from the names of files and folders.")
    bound = sum(bool(estimate.at_bound) for estimate in found.estimates)
    free = sum(not (estimate.at_bound or estimate.identifiable) for estimate in found.estimates)
    counts = ((free, "not identifiable"), (bound, "at a bound"))
    states = [f"{count} {'is' if count == 1 else 'are'} {state}" for count, state in counts if count]
    if states:
        lines.append(f"Note: Of {len(found.estimates)} parameters, {' and '.join(states)}.")
    if found.next_tests:
        lines.append(escape(f"Suggested test: {found.next_tests[0].partition(':')[0]}."))
    return lines


def _closing(_: FitResult, answer: Json) -> list[str]:
    """Return the written files and the next command."""
    if "card" not in answer:
        return [NO_FILES]
    next_command = f"Next: mrdamper evaluate {answer['card']} NEW_RUNS"
    return [f"Wrote {answer['card']} and {answer['report']}.", next_command]


def _outcome(found: FitResult) -> Outcome:
    return interrupted() if found.cancelled else DONE


REPORT: Report[FitResult] = Report(
    fields=_fields,
    show=_show,
    closing=_closing,
    page=PAGE,
    files=(
        WrittenFile(name="card.json", key="card", write=lambda found, path: write_card(found.card(), path)),
        WrittenFile(
            name=DRAWS_FILE,
            key="posterior_file",
            write=_write_posterior,
            when=lambda found: found.posterior is not None,
        ),
        csv_file("errors.csv", _rows),
    ),
    rows=_rows,
    outcome=_outcome,
)
