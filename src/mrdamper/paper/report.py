"""Outputs of ``demo``: JSON, terminal output, report page, and the files of all jobs that it runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.markup import escape

from mrdamper.identify.fit import versions
from mrdamper.jobs.fit import FitResult
from mrdamper.models.card_schema import write_card
from mrdamper.paper.demo import LABEL, DemoResult
from mrdamper.paper.page import PAGE, target_in_words
from mrdamper.report.base import Place, Report, WrittenFile, write_report
from mrdamper.report.export import REPORT as EXPORT_REPORT
from mrdamper.report.identification.report import REPORT as IDENTIFY_REPORT
from mrdamper.report.identification.scores import percent, summaries
from mrdamper.report.rig import REPORT as RIG_REPORT
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.heat import REPORT as HEAT_REPORT
from mrdamper.report.thermal.heatsink import REPORT as SINK_REPORT
from mrdamper.report.track import REPORT as TRACK_REPORT
from mrdamper.schema import Json

# ------------------------------------------------------------------------------------------- the answer


def _fields(found: DemoResult) -> dict[str, object]:
    findings = found.findings
    rise = findings.warm_up.rise
    searched, tracked = SINK_REPORT.answer(findings.sink), TRACK_REPORT.answer(findings.track)
    return {
        **IDENTIFY_REPORT.fields(found.fitted),
        "simulated": True,
        "runs_are": LABEL,
        "laws": [_law_line(each) for each in (found.fitted, found.paper_law)],
        "claims": _rows(found),
        "heating": {
            "time_to_limit_s": rise.time_to_limit_s,
            "force_loss_percent": rise.force_loss_percent,
            "energy_closure": rise.energy_closure,
        },
        "sink": {key: searched[key] for key in ("reference", "best", "cooler_K")},
        "tracking": tracked["worst"],
        "target": _target(found),
        "cpu_s": round(found.cpu_s, 3),
        "versions": versions(),
    }


def _law_line(found: FitResult) -> Json:
    """Return the name and the errors of one law, for the comparison of laws."""
    return {
        "law": found.damper.law.name,
        "summary": summaries(found.assessment.runs),
        "cost_percent": found.cost_percent,
        "cpu_s": round(found.cpu_s, 4),
        "passivity_min": found.assessment.passivity_min,
    }


def _target(found: DemoResult) -> Json:
    """Return the main values of the export and of its verification."""
    if found.export is None:
        return {"written": False, "why": found.why_not_exported}
    answer = EXPORT_REPORT.answer(found.export)
    keys = ("precision", "step_s", "controller", "code_bytes", "tables_bytes", "verification")
    return {"written": True, **{key: answer[key] for key in keys}}


# ------------------------------------------------------------------------------------------- a terminal


def _show(found: DemoResult, console: Console) -> None:
    """Print the errors of both laws, then the claims of the paper with their verdicts."""
    console.print(escape(f"The runs are {LABEL}."))
    laws = []
    for each in (found.fitted, found.paper_law):
        summary = summaries(each.assessment.runs)
        cells = [_median_worst(summary.get(split)) for split in ("training", "held_out")]
        laws.append((each.damper.law.name, *cells))
    title = "Errors of two laws in % of the standard deviation of the force: median (worst)"
    console.print(terminal_table(title, ("law", "training", "held out"), laws, left=("law",)))
    claims = []
    for claim in found.claims:
        cells = [_figure(value) for value in (claim.paper, claim.ours)]
        claims.append((str(claim.row), claim.statement, *cells, claim.unit, claim.origin, claim.outcome))
    title = "Values in the paper and in this simulation. The report gives the reasons."
    words = ("claim", "unit", "origin", "verdict")
    names = ("#", words[0], "paper", "simulation", *words[1:])
    console.print(terminal_table(title, names, claims, left=words))
    for line in _claims_in_words(found):
        console.print(escape(line))


def _median_worst(values: Json | None) -> str:
    if values is None:
        return ""
    median, worst = (values[f"{key}_nrmse_percent"] for key in ("median", "worst"))
    return f"{percent(median)} ({percent(worst)})"


def _figure(value: float | str | None) -> str:
    return "-" if value is None else value if isinstance(value, str) else f"{value:.4g}"


def _summary(found: DemoResult) -> list[str]:
    return [*_claims_in_words(found), target_in_words(found)]


def _claims_in_words(found: DemoResult) -> list[str]:
    """Return sentences with the numbers of claims with a verdict, without a verdict, and in contradiction."""
    judged = [claim for claim in found.claims if claim.verdict is not None]
    verdicts = Counter(f"{claim.origin}: {claim.verdict}" for claim in judged)
    others = Counter(claim.origin for claim in found.claims if claim.verdict is None)
    contradictions = sum(claim.contradiction for claim in found.claims)
    return [
        f"The paper has {len(found.claims)} values. {len(judged)} have a verdict: "
        + ", ".join(f"{count} {words}" for words, count in sorted(verdicts.items())),
        "Without a verdict: " + ", ".join(f"{count} {words}" for words, count in sorted(others.items())),
        f"{contradictions} values contradict other values of the paper, or physics",
    ]


# ------------------------------------------------------------------------------------------- the files


def _job_writer(
    report: Report[Any], result_of: Callable[[DemoResult], Any], card: str
) -> Callable[[DemoResult, Place], None]:
    """Return a function that writes the files of one job of the demo into a separate folder.

    Parameters
    ----------
    result_of : function that returns the result of the job from the result of the demo
    card : file name of the card that the job used
    """

    def write(found: DemoResult, place: Place) -> None:
        place.stage.mkdir()
        head = {"card": str(place.path.parent / card), **({} if card == "card.json" else {"damper": "paper"})}
        write_report(report, result_of(found), {"": place}, head)

    return write


def _write_runs(found: DemoResult, place: Place) -> None:
    places = {
        "": place,
        "truth": Place(*(path.with_name("runs.truth") for path in (place.stage, place.path))),
    }
    for folder in places.values():
        folder.stage.mkdir()
    write_report(RIG_REPORT, found.campaign, places, {})


def _write_identification(found: DemoResult, place: Place) -> None:
    """Write the files of the fit, except for the card, which is in the parent folder."""
    place.stage.mkdir()
    write_report(IDENTIFY_REPORT, found.fitted, {"": place}, {})
    (place.stage / "card.json").unlink()


def _write_export(found: DemoResult, place: Place) -> None:
    assert found.export is not None
    fmu = Place(*(path.with_name("damper.fmu") for path in (place.stage, place.path)))
    write_report(EXPORT_REPORT, found.export, {"c": place, "fmu": fmu}, {})


def _rows(found: DemoResult) -> list[Json]:
    return [claim.to_json() for claim in found.claims]


REPORT = Report(
    fields=_fields,
    show=_show,
    summary=_summary,
    page=PAGE,
    files=(
        WrittenFile(name="runs", write_in=_write_runs),
        WrittenFile(
            name="card.json", key="card", write=lambda found, path: write_card(found.fitted.card(), path)
        ),
        WrittenFile(name="cold_card.json", write=lambda found, path: write_card(found.cold, path)),
        WrittenFile(name="paper_card.json", write=lambda found, path: write_card(found.warm, path)),
        WrittenFile(name="identification", write_in=_write_identification),
        WrittenFile(
            name="heating",
            write_in=_job_writer(HEAT_REPORT, lambda found: found.findings.warm_up, "paper_card.json"),
        ),
        WrittenFile(
            name="sink",
            write_in=_job_writer(SINK_REPORT, lambda found: found.findings.sink, "paper_card.json"),
        ),
        WrittenFile(
            name="tracking",
            write_in=_job_writer(TRACK_REPORT, lambda found: found.findings.track, "card.json"),
        ),
        WrittenFile(name="c", write_in=_write_export, when=lambda found: found.export is not None),
        WrittenFile(name="summary.json", key="summary_file"),
    ),
    rows=_rows,
)
