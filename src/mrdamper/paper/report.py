"""What the demo found: the answer's keys, laws and claims on a terminal, the page and all jobs' files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.markup import escape

from mrdamper.identify.evaluate import finite
from mrdamper.identify.fit import versions
from mrdamper.jobs.fit import FitResult
from mrdamper.models.card_schema import write_card
from mrdamper.paper.demo import LABEL, DemoResult
from mrdamper.paper.page import PAGE, target_in_words
from mrdamper.report.base import Place, Report, WrittenFile, write_report
from mrdamper.report.export import REPORT as EXPORT_REPORT
from mrdamper.report.identification.report import REPORT as IDENTIFY_REPORT
from mrdamper.report.identification.scores import summaries
from mrdamper.report.rig import REPORT as RIG_REPORT
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.heat import REPORT as HEAT_REPORT
from mrdamper.report.thermal.heatsink import REPORT as SINK_REPORT
from mrdamper.report.track import REPORT as TRACK_REPORT
from mrdamper.schema import Json

# ------------------------------------------------------------------------------------------- the answer


def _answer(found: DemoResult) -> Json:
    findings = found.findings
    rise = findings.warm_up.rise
    searched, tracked = SINK_REPORT.answer(findings.sink), TRACK_REPORT.answer(findings.track)
    return {
        **IDENTIFY_REPORT.answer(found.fitted),
        "simulated": True,
        "runs_are": LABEL,
        "laws": [_law_line(each) for each in (found.fitted, found.paper_law)],
        "claims": [claim.to_json() for claim in found.claims],
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
    """Return one law's line of the comparison."""
    return {
        "law": found.damper.law.name,
        "summary": summaries(found.assessment.runs),
        "cost_percent": found.cost_percent,
        "cpu_s": round(found.cpu_s, 4),
        "passivity_min": finite(found.assessment.passivity_min),
    }


def _target(found: DemoResult) -> Json:
    """Return what was exported, and its proof."""
    if found.export is None:
        return {"written": False, "why": found.why_not_exported}
    answer = EXPORT_REPORT.answer(found.export)
    keys = ("precision", "step_s", "controller", "code_bytes", "tables_bytes", "verification")
    return {"written": True, **{key: answer[key] for key in keys}}


# ------------------------------------------------------------------------------------------- a terminal


def _show(found: DemoResult, console: Console) -> None:
    """Print the laws side by side, then the paper's claims with their verdicts."""
    console.print(escape(f"The runs are {LABEL}."))
    laws = []
    for each in (found.fitted, found.paper_law):
        summary = summaries(each.assessment.runs)
        cells = [_median_worst(summary.get(split)) for split in ("training", "held_out")]
        laws.append((each.damper.law.name, *cells))
    title = "Laws side by side: error in % of the force's spread, median (worst)"
    console.print(terminal_table(title, ("law", "training", "held out"), laws, left=("law",)))
    claims = []
    for claim in found.claims:
        cells = [_figure(value) for value in (claim.paper, claim.ours)]
        claims.append((str(claim.row), claim.says, *cells, claim.unit, claim.origin, claim.outcome))
    title = "The paper's figures, and what came out here (reasons are in the report)"
    words = ("the paper says", "unit", "origin", "verdict")
    names = ("#", words[0], "paper", "here", *words[1:])
    console.print(terminal_table(title, names, claims, left=words))
    for line in _claims_in_words(found):
        console.print(escape(line))


def _wrote(_: DemoResult, answer: Json, console: Console) -> None:
    console.print(escape(f"report: {answer['report']}"))


def _median_worst(values: Json | None) -> str:
    if values is None:
        return ""
    median, worst = (values[f"{key}_nrmse_percent"] for key in ("median", "worst"))
    return f"{_percent(median)} ({_percent(worst)})"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} %"


def _figure(value: float | str | None) -> str:
    return "-" if value is None else value if isinstance(value, str) else f"{value:.4g}"


def _summary(found: DemoResult) -> list[str]:
    return [*_claims_in_words(found), target_in_words(found)]


def _claims_in_words(found: DemoResult) -> list[str]:
    """Return how many figures prove something, and how those came out."""
    judged = [claim for claim in found.claims if claim.verdict is not None]
    proved = Counter(f"{claim.origin}: {claim.verdict}" for claim in judged)
    rest = Counter(claim.origin for claim in found.claims if claim.verdict is None)
    doubted = sum(claim.contradiction for claim in found.claims)
    return [
        f"{len(found.claims)} figures of the paper, {len(judged)} of them with a verdict: "
        + ", ".join(f"{count} {words}" for words, count in sorted(proved.items())),
        "no proof of anything: " + ", ".join(f"{count} {words}" for words, count in sorted(rest.items())),
        f"at {doubted} figures the paper contradicts itself or physics",
    ]


# ------------------------------------------------------------------------------------------- the files


def _part(
    report: Report[Any], of: Callable[[DemoResult], Any], card: str
) -> Callable[[DemoResult, Place], None]:
    """Return what writes a job's files into a folder of their own; ``card`` is what it was done with."""

    def write(found: DemoResult, place: Place) -> None:
        place.stage.mkdir()
        head = {"card": str(place.path.parent / card), **({} if card == "card.json" else {"damper": "paper"})}
        write_report(report, of(found), {"": place}, head)

    return write


def _write_runs(found: DemoResult, place: Place) -> None:
    places = {
        "": place,
        "truth": Place(*(each.with_name("runs.truth") for each in (place.stage, place.path))),
    }
    for each in places.values():
        each.stage.mkdir()
    write_report(RIG_REPORT, found.campaign, places, {})


def _write_identification(found: DemoResult, place: Place) -> None:
    """Write the identification's files; the card lies at the top."""
    place.stage.mkdir()
    write_report(IDENTIFY_REPORT, found.fitted, {"": place}, {})
    (place.stage / "card.json").unlink()


def _write_export(found: DemoResult, place: Place) -> None:
    assert found.export is not None
    fmu = Place(*(each.with_name("damper.fmu") for each in (place.stage, place.path)))
    write_report(EXPORT_REPORT, found.export, {"c": place, "fmu": fmu}, {})


def _rows(found: DemoResult) -> list[Json]:
    return [claim.to_json() for claim in found.claims]


REPORT = Report(
    answer=_answer,
    show=_show,
    wrote=_wrote,
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
            write_in=_part(HEAT_REPORT, lambda found: found.findings.warm_up, "paper_card.json"),
        ),
        WrittenFile(
            name="sink", write_in=_part(SINK_REPORT, lambda found: found.findings.sink, "paper_card.json")
        ),
        WrittenFile(
            name="tracking", write_in=_part(TRACK_REPORT, lambda found: found.findings.track, "card.json")
        ),
        WrittenFile(name="c", write_in=_write_export, when=lambda found: found.export is not None),
        WrittenFile(name="summary.json", key="summary_file"),
    ),
    rows=_rows,
)
