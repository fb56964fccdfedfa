"""What ``identify`` found: the answer's keys, the tables of a terminal, card, report and errors as files."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mrdamper.errors import option
from mrdamper.identify.assess import CrossValidated, summary
from mrdamper.identify.confidence.sentences import sentence
from mrdamper.identify.predict import finite, row
from mrdamper.identify.problem import Estimate
from mrdamper.identify.selection.select import LawScore
from mrdamper.jobs.identify import IdentifyResult
from mrdamper.models.card_draws import DRAWS_FILE, write_draws
from mrdamper.models.card_schema import write_card
from mrdamper.report.base import BEST_SO_FAR, DONE, Outcome, Report, WrittenFile, interrupted, print_notes
from mrdamper.report.check import show_findings
from mrdamper.report.identification.page import PAGE, new_run_lines
from mrdamper.report.identification.scores import (
    in_percent,
    pooled_json,
    show_errors,
    show_summaries,
    summaries,
)
from mrdamper.report.identification.tables import (
    coefficient_table,
    law_table,
    left_out_summaries,
    left_out_table,
)
from mrdamper.report.sections import Table
from mrdamper.runtime.outputs import write_table
from mrdamper.runtime.pool import cpu_seconds
from mrdamper.schema import Json

_MOST_CANDIDATES = 12  # rows of a choice of laws on a terminal


def _answer(found: IdentifyResult) -> Json:
    """Return what ``mrdamper identify --json`` prints, but for the files."""
    result, judged = found.result, found.assessment
    return {
        "law": found.damper.law.name,
        "method": result.method,
        "coefficients": {estimate.name: _estimate(estimate) for estimate in result.estimates},
        "cpu_s": round(found.cpu_s, 4),
        "runs": _rows(found),
        "summary": summaries(judged.runs),
        "cost_percent": result.cost_percent,
        "seed": result.seed,
        "starts": [
            {
                "index": start.index,
                "cost_percent": finite(start.cost_percent),
                "evaluations": start.evaluations,
                "converged": start.converged,
            }
            for start in result.starts
        ],
        "session_offsets_N": dict(result.offsets_N),
        "passivity_min": finite(judged.passivity_min),
        "cancelled": found.cancelled,
        "notes": _notes(found),
        "by_temperature": pooled_json(judged.runs),
        "actuation": _actuation(found),
        "force_band": None if found.force_band is None else asdict(found.force_band),
        "next_tests": [{**asdict(each), "sentence": each.sentence} for each in found.next_tests],
        "assumed": list(found.damper.assumed),
        "identifiability": _identifiability(found),
        "posterior": _posterior(found),
        "left_out": [_left(left) for left in judged.left_out],
        "left_out_summary": {kind: in_percent(each) for kind, _, each in left_out_summaries(judged.left_out)},
        "chosen_by": found.chosen_by or None,
        "law_table": [_law_score(score) for score in found.law_table],
        "findings": [dict(finding.to_dict()) for finding in found.findings],
        "inferred": [asdict(inference) for inference in found.inferred],
    }


def _notes(found: IdentifyResult) -> list[str]:
    return [*found.result.notes, *found.assessment.words]


def _rows(found: IdentifyResult) -> list[dict[str, object]]:
    """Return the errors as a table, one row for each run."""
    return [row(error) for error in found.assessment.runs]


def _estimate(estimate: Estimate) -> Json:
    return {
        "value": estimate.value,
        "unit": estimate.unit,
        "standard_error": finite(estimate.standard_error),
        "design_error_percent": finite(estimate.design_error_percent),
        "identifiable": bool(estimate.identifiable),
        "at_bound": estimate.at_bound or None,
        "lower": finite(estimate.lower),
        "upper": finite(estimate.upper),
    }


def _law_score(score: LawScore) -> Json:
    return {
        "law": score.law,
        "numbers": score.free_parameters,
        "training_median_percent": finite(score.training_median),
        "held_out_median_percent": finite(score.held_out_median),
        "held_out_worst_percent": finite(score.held_out_worst),
        "terms": list(score.groups),
        "training_rms_percent": finite(score.training_percent),
        "held_out_rms_percent": finite(score.left_out_percent),
        "reason": score.reason,
        "cpu_s": round(score.cpu_s, 3),
    }


def _actuation(found: IdentifyResult) -> Json | None:
    fitted = found.actuation
    if fitted is None:
        return None
    errors = {f"{name}_standard_error": finite(error) for name, error in fitted.standard_errors.items()}
    told: Json = {**asdict(fitted.actuation), **errors}
    return {
        **told,
        **{name: finite(time) for name, time in fitted.response_times.items()},
        "driver_quadrants": fitted.driver_quadrants,
        "t90_s": fitted.t90_s,
        "rmse_N": fitted.rmse_N,
        "unlagged_rmse_N": fitted.unlagged_rmse_N,
        "windows": fitted.windows,
    }


def _identifiability(found: IdentifyResult) -> Json | None:
    """Return what the data cannot tell apart, with the profile and the bootstrap where they were made."""
    judged = found.assessment
    direction, profile, bootstrap = judged.direction, judged.profile, judged.bootstrap
    if direction is None:
        return None
    told: Json = {
        "worst_direction": dict(zip(direction.names, map(float, direction.weights), strict=True)),
        "standard_error_percent": finite(direction.standard_error_percent),
        "condition": finite(direction.condition),
        "sentence": sentence(direction),
    }
    if profile is not None:
        told["profile"] = {
            "name": profile.name,
            "values": [float(value) for value in profile.values],
            "cost_percent": [finite(cost) for cost in profile.costs_percent],
            "interval": [finite(end) for end in profile.interval],
            "ends": list(profile.ends),
        }
    if bootstrap is not None:
        told["bootstrap"] = {
            "draws": bootstrap.draws,
            "failed": bootstrap.failed,
            "standard_deviation": {n: finite(v) for n, v in bootstrap.standard_deviation.items()},
            "percentiles_5_95": {n: [finite(x) for x in v] for n, v in bootstrap.percentiles.items()},
        }
    return told


def _posterior(found: IdentifyResult) -> Json | None:
    """Return what the posterior says of each parameter, and how well its chains mixed."""
    posterior = found.posterior
    if posterior is None:
        return None
    return {
        "draws": len(posterior.draws),
        "effective_draws": round(posterior.effective_draws),
        "effective_samples": round(posterior.effective_samples),
        "evaluations": posterior.evaluations,
        "accepted_share": posterior.accepted_share,
        "cancelled": posterior.cancelled,
        "cpu_s": round(posterior.cpu_s, 3),
        "standard_deviation": posterior.standard_deviation,
        "percentiles_5_95": {name: list(ends) for name, ends in posterior.draws.percentiles.items()},
    }


def _write_posterior(found: IdentifyResult, path: Path) -> None:
    if found.posterior is not None:
        write_draws(found.posterior.draws, found.damper, path)


def _left(left: CrossValidated) -> Json:
    errors = [{**row(error), "split": "held_out"} for error in left.errors]
    return {"kind": left.kind, "left_out": left.left_out, **in_percent(summary(left.errors)), "runs": errors}


# --------------------------------------------------------------------------------------------- the terminal


def _show(found: IdentifyResult, console: Console) -> None:
    """Print errors by run, coefficients with their uncertainty, and what a reader should know."""
    errors = found.assessment.runs
    for inference in found.inferred:
        console.print(escape(inference.in_words()))
    if found.law_table:
        console.print(_best_laws(found).printed())
    show_errors(errors, found.damper.law.name, console)
    show_summaries(errors, console)
    left = left_out_summaries(found.assessment.left_out)
    if left:
        title = "Left out in turn: error on what the fit did not see"
        console.print(left_out_table(left, title).printed())
    console.print(coefficient_table(found.estimates).printed())
    for session, offset in found.result.offsets_N.items():
        console.print(f"force offset of session {escape(session) or '(unnamed)'}: {offset:+.1f} N")
    show_findings([each for each in found.findings if each.severity != "note"], console)
    print_notes([*_notes(found), *new_run_lines(found)], console)


def _wrote(found: IdentifyResult, answer: Json, console: Console) -> None:
    """Print what the command has taken, from its start, and where card and report are."""
    files = f"; wrote {answer['card']} and {answer['report']}" if "card" in answer else ""
    console.print(f"{cpu_seconds():.2f} s of CPU{files}", markup=False)


def _best_laws(found: IdentifyResult) -> Table[LawScore]:
    """Return the best candidates."""
    scores, title = (
        found.law_table,
        f"Laws and terms, chosen by the error on what was left out ({found.chosen_by})",
    )
    if len(scores) > _MOST_CANDIDATES:
        title += f"; the first {_MOST_CANDIDATES} of {len(scores)}, all are in the report"
    return law_table(scores[:_MOST_CANDIDATES], found.chosen_by, title)


def _outcome(found: IdentifyResult) -> Outcome:
    if not found.cancelled:
        return DONE
    return interrupted(f"{BEST_SO_FAR}; the same command with {option('resume')} goes on")


# ----------------------------------------------------------------------------------------------- the files


REPORT: Report[IdentifyResult] = Report(
    answer=_answer,
    show=_show,
    wrote=_wrote,
    page=PAGE,
    files=(
        WrittenFile(name="card.json", key="card", write=lambda found, path: write_card(found.card(), path)),
        WrittenFile(
            name=DRAWS_FILE,
            key="posterior_file",
            write=_write_posterior,
            when=lambda found: found.posterior is not None,
        ),
        WrittenFile(name="errors.csv", write=lambda found, path: write_table(path, _rows(found))),
    ),
    rows=_rows,
    outcome=_outcome,
)
