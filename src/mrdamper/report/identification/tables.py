"""Tables of an identification beside its errors by run: coefficients, laws, what was left out."""

from __future__ import annotations

from collections.abc import Sequence

from mrdamper.identify.assess import CrossValidated, summary
from mrdamper.identify.problem import Estimate
from mrdamper.identify.selection.select import LawScore
from mrdamper.report.page import significant
from mrdamper.report.sections import Column, Table

LeftOut = tuple[str, int, dict[str, float]]
"""What was left out, how many runs, a summary of their errors."""


def coefficient_table(estimates: Sequence[Estimate]) -> Table[Estimate]:
    """Return values with their standard errors, and whether the runs determine them."""
    return Table(
        title="Coefficients",
        columns=[
            Column("number", "name"),
            Column("value", "value", form=".5g"),
            Column("± standard error", lambda each: significant(each.standard_error, 2) or None, form="s"),
            Column("unit", "unit"),
            Column("identifiable", _judged),
        ],
        rows=estimates,
        held=lambda each: bool(each.at_bound) or not each.identifiable,
        caption="The standard error allows for residuals that hang together within half a cycle. In "
        "brackets the design error, which independent noise of the residual's size would leave: below 30 % "
        "a number counts as identifiable. Marked: what the runs do not determine.",
    )


def _judged(estimate: Estimate) -> str:
    if estimate.at_bound:
        bound = estimate.lower if estimate.at_bound == "lower" else estimate.upper
        return f"on its {estimate.at_bound} bound, {bound:.3g}"
    design = estimate.design_error_percent
    known = " (over 1000 %)" if design > 1e3 else f" ({design:.2g} %)" if design >= 0.0 else ""
    return ("yes" if estimate.identifiable else "no") + known


def law_table(scores: Sequence[LawScore], left_out: str, title: str = "Laws compared") -> Table[LawScore]:
    """Return the candidates: errors over all runs, and over those that were left out in turn."""
    return Table(
        title=title,
        columns=[
            Column("law", lambda score: " + ".join((score.law, *score.groups))),
            Column("numbers", lambda score: score.free_parameters or None, form="d"),
            Column("training", "training_percent", "%", ".2f"),
            Column("left out", "left_out_percent", "%", ".2f"),
            Column("median", "held_out_median", "%", ".2f"),
            Column("worst", "held_out_worst", "%", ".2f"),
            Column("reason", "reason"),
        ],
        rows=scores,
        caption=f"Candidates fitted to the training runs, then without each of {left_out} in turn; the first "
        "is chosen. Errors: root mean squares over runs, then median and worst of what was left out.",
    )


def left_out_summaries(left_out: Sequence[CrossValidated]) -> list[LeftOut]:
    """Return the errors on all that was left out, by what that was."""
    return [
        (kind, sum(len(each.errors) for each in of), summary(error for each in of for error in each.errors))
        for kind, of in _by_kind(left_out).items()
    ]


def left_out_tables(left_out: Sequence[CrossValidated]) -> list[Table[LeftOut]]:
    """Return a table for each kind of what was left out."""
    return [
        left_out_table(
            [(each.left_out, len(each.errors), summary(each.errors)) for each in of], f"Each {kind} left out"
        )
        for kind, of in _by_kind(left_out).items()
    ]


def left_out_table(rows: Sequence[LeftOut], title: str) -> Table[LeftOut]:
    """Return errors on what a fit did not see."""

    def error(title: str, name: str) -> Column[LeftOut]:
        return Column(title, lambda row: row[2][name], "%", ".2f")

    return Table(
        title=title,
        columns=[
            Column("left out", lambda row: row[0]),
            Column("runs", lambda row: row[1], form="d", printed=False),
            error("median", "median"),
            error("worst above zero", "worst_above_zero"),
            error("worst", "worst"),
        ],
        rows=rows,
        caption="The same law fitted again without each part; errors are those on the part that was left "
        "out.",
    )


def _by_kind(left_out: Sequence[CrossValidated]) -> dict[str, list[CrossValidated]]:
    found: dict[str, list[CrossValidated]] = {}
    for each in left_out:
        found.setdefault(each.kind, []).append(each)
    return found
