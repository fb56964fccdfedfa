"""Tables of a fit: coefficients, correlations, errors, model selection."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

from mrdamper.identify.problem import Estimate, SearchResult
from mrdamper.identify.scores import ErrorSummary
from mrdamper.identify.selection.select import CandidateScore, Selection
from mrdamper.report.page import significant
from mrdamper.report.sections import Column, Table


def coefficient_table(estimates: Sequence[Estimate]) -> Table[Estimate]:
    """Return the table of fitted parameters: value, standard error, and whether the runs determine it."""
    return Table(
        title="Coefficients",
        columns=[
            Column("parameter", "name"),
            Column("value", "value", form=".5g"),
            Column("± standard error", lambda each: significant(each.standard_error, 2) or None, form="s"),
            Column("unit", "unit"),
            Column("identifiable", _identifiability),
        ],
        rows=estimates,
        held=lambda each: bool(each.at_bound) or not each.identifiable,
        caption="The standard error accounts for residuals that are correlated within half a cycle. The "
        "design error, in brackets, is the standard error for independent noise of the size of the residual. "
        "A parameter is identifiable if its design error is below 30 %. Other parameters are highlighted.",
    )


def _identifiability(estimate: Estimate) -> str:
    if estimate.at_bound:
        bound = estimate.lower if estimate.at_bound == "lower" else estimate.upper
        return f"on its {estimate.at_bound} bound, {bound:.3g}"
    design = estimate.design_error_percent
    known = " (over 1000 %)" if design > 1e3 else f" ({design:.2g} %)" if design >= 0.0 else ""
    return ("yes" if estimate.identifiable else "no") + known


def correlation_table(result: SearchResult) -> Table[tuple[str, str, float]]:
    """Return the table of parameter pairs with a strong correlation, the strongest first."""
    strong_correlation_min = 0.8
    names = [estimate.name for estimate in result.estimates]
    pairs = [
        (names[i], names[j], float(result.correlation[i, j]))
        for i, j in combinations(range(len(names)), 2)
        if abs(result.correlation[i, j]) >= strong_correlation_min
    ]
    return Table(
        title="Strong correlations",
        columns=[
            Column("parameter", lambda pair: pair[0]),
            Column("with", lambda pair: pair[1]),
            Column("correlation", lambda pair: pair[2], form=".2f"),
        ],
        rows=sorted(pairs, key=lambda pair: -abs(pair[2])),
        caption=f"Pairs of parameters with a correlation of {strong_correlation_min:g} or more. The runs "
        "determine a combination of such parameters better than each of them.",
    )


def error_summary_table(errors: Sequence[ErrorSummary]) -> Table[ErrorSummary]:
    """Return the table of error statistics of held-out runs, training runs and cross-validation."""
    return Table(
        title="Errors",
        columns=[
            Column("error", lambda error: error.kind.replace("_", "-")),
            Column("current", "current"),
            Column("runs", "run_count", form="d"),
            Column("median", "median_percent", "%", ".2f"),
            Column("RMS", "rms_percent", "%", ".2f"),
            Column("worst", "worst_percent", "%", ".2f"),
        ],
        rows=errors,
        held=lambda error: error.kind == "held_out",
        caption="Error of a run: RMS error divided by the standard deviation of the measured force. RMS: "
        "root mean square of the errors of the runs. Cross-validation: errors of the selected model on runs "
        "that were held out of its fits during the selection. The fit uses runs with constant current. "
        "Marked: held out.",
    )


def candidate_table(selection: Selection) -> Table[CandidateScore]:
    """Return the table of all candidates of the model selection, the selected candidate first."""
    return Table(
        title="Model selection",
        columns=[
            Column("model", "law"),
            Column("terms", lambda score: ", ".join(score.terms)),
            Column("parameters", lambda score: score.free_parameters or None, form="d"),
            Column("training RMS", "training_rms_percent", "%", ".2f"),
            Column("cross-validation mean", "cv_mean_percent", "%", ".2f"),
            Column("median", "cv_median_percent", "%", ".2f"),
            Column("worst", "cv_worst_percent", "%", ".2f"),
            Column("reason", "reason"),
        ],
        rows=selection.scores,
        caption=f"Cross-validation: {selection.validation_data}. The candidate with the smallest root mean "
        "square is selected; constant and changing current have the same weight. Median and worst are those "
        f"of the runs in cross-validation. {subset_sentence(selection)}",
    )


def best_candidates(selection: Selection, count_max: int) -> Table[CandidateScore]:
    """Return a table of the best cross-validated candidate of each hysteresis model."""
    best: dict[str, CandidateScore] = {}
    for score in selection.scores:
        if score.reason == "chosen" or not math.isnan(score.cv_mean_percent):
            best.setdefault(score.law, score)
    return Table(
        title="",
        columns=[
            Column("model", lambda score: score.law + " (selected)" * (score.reason == "chosen")),
            Column("terms", lambda score: len(score.terms), form="d"),
            Column("parameters", "free_parameters", form="d"),
            Column("cross-validation", "cv_mean_percent", "%", ".2f"),
        ],
        rows=list(best.values())[:count_max],
    )


def subset_sentence(selection: Selection) -> str:
    """Return a sentence with two errors of the selected candidate.

    The errors refer to the samples of the model selection, and to all samples of the runs.
    """
    if not selection.is_subset:
        return f"The selection used all {selection.sample_count} samples."
    return (
        f"The selection used {selection.sample_count} samples: the error of the selected candidate is "
        f"{selection.subset_error_percent:.2f} % on them and {selection.all_runs_error_percent:.2f} % on all "
        "runs."
    )
