"""Outputs of ``demo``: JSON, terminal output, report page, and the files of all jobs that it runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args

from matplotlib.figure import Figure
from rich.console import Console
from rich.markup import escape

from mrdamper.identify.fit import versions
from mrdamper.identify.scores import summary
from mrdamper.jobs.fit import FitResult
from mrdamper.models.card_schema import write_card
from mrdamper.paper.claims import Claim, Origin, Verdict
from mrdamper.paper.demo import LABEL, DemoResult
from mrdamper.paper.figures import sections_of, way_figure
from mrdamper.report.base import Place, Report, WrittenFile, write_report
from mrdamper.report.export import REPORT as EXPORT_REPORT
from mrdamper.report.identification.report import REPORT as IDENTIFY_REPORT
from mrdamper.report.identification.scores import percent, summaries
from mrdamper.report.page import FirstScreen, Page, Tile
from mrdamper.report.rig import REPORT as RIG_REPORT
from mrdamper.report.sections import terminal_table
from mrdamper.report.thermal.heat import REPORT as HEAT_REPORT
from mrdamper.report.thermal.heatsink import REPORT as SINK_REPORT
from mrdamper.report.track import REPORT as TRACK_REPORT
from mrdamper.schema import Json

_FILES = (
    ("card.json", "model card, the input of all other jobs"),
    ("identification/report.html", "fit: loops, errors by run, parameters with uncertainty"),
    ("heating/heat.html", "heating of the preset paper, with and without the heat sink of the paper"),
    ("sink/heatsink.html", "optimisation of heat sinks"),
    ("sink/best.toml", "best heat sink, an input of mrdamper heat"),
    ("tracking/track.html", "force tracking"),
    ("c/README.md", "model and controller as C99, with the record of their verification"),
    ("damper.fmu", "the same as a functional mock-up unit (FMI 2.0) with source code"),
    ("summary.json", "all values and claims"),
)
_VERDICTS: Mapping[Verdict, str] = {
    "within": "within tolerance",
    "better": "better",
    "worse": "worse than the paper",
    "contradicts": "in contradiction to the paper",
}
_EXPORTED = ("c/README.md", "damper.fmu")


def target_in_words(found: DemoResult) -> str:
    """Return a sentence about the exported code and its verification."""
    code = None if found.export is None else found.export.code
    if code is None:
        return f"C code and FMU were not written: {found.why_not_exported}"
    controller = "" if code.target.controller is None else code.target.controller.name
    return (
        f"C code and FMU: controller {controller} and model in {code.target.precision} with a period of "
        f"{1e3 * code.target.period_s:g} ms, compiled on this computer and compared with the model in "
        f"Python in {code.record.samples} samples."
    )


def _verdict(claims: Sequence[Claim]) -> str:
    """Return a sentence with the number of values that have a verdict, and with the count of each verdict."""
    found = Counter(claim.verdict for claim in claims if claim.verdict is not None)
    verdicts = ", ".join(
        f"{found[verdict]} {words}" for verdict, words in _VERDICTS.items() if found[verdict]
    )
    return f"{found.total()} of {len(claims)} values of the paper have a verdict: {verdicts}"


def _first(found: DemoResult) -> FirstScreen:
    findings = found.findings
    unseen = summary(error for error in findings.judged.runs if error.split == "held_out")
    heated, search = findings.warm_up, findings.sink
    bare = heated.rise if heated.bare is None else heated.bare
    tracked = min((row for row in findings.track.max_error_rows), key=lambda row: row.score.rmse_N)
    score = tracked.score
    least = score.rmse_N if score.rmse_feasible_N is None else score.rmse_feasible_N
    quick = ". This is a quick demo with a small campaign, whose values differ" if found.options.quick else ""
    return FirstScreen(
        title="The paper on the virtual rig",
        subject="From a test campaign to a temperature-dependent model, heating, a heat sink, a force "
        f"controller and C code, compared with the values of the paper{quick}.",
        verdict=_verdict(found.claims),
        tiles=(
            Tile(
                f"{unseen['median']:.1f} %",
                "median error of the model on held-out runs",
                f"worst {unseen['worst']:.1f} %",
            ),
            Tile(
                f"{search.gain.middle:.1f} K",
                "cooler with the best heat sink than with the heat sink of the paper",
                f"90 % interval {search.gain.low:.1f} to {search.gain.high:.1f} K; without heat sink "
                f"{bare.fluid_degC[-1]:.0f} °C",
            ),
            Tile(
                f"{least:.1f} N",
                f"RMS error of {tracked.controller} on {tracked.target} while the target is feasible",
                f"{score.rmse_N:.1f} N at all times",
            ),
        ),
        caption="Loops (measured grey, modelled coloured), heating, and force tracking "
        "(dashed: target, grey band: attainable force)",
        flags=[
            (
                "This is a simulation, not a measurement",
                "The simulated dampers (presets nominal and paper of the virtual rig) have other "
                "equations than the fitted models, which use only noisy runs",
            )
        ],
    )


def _picture(found: DemoResult) -> Figure:
    return way_figure(found.findings)


def _sections(found: DemoResult) -> dict[str, object]:
    claims, sections = found.claims, sections_of(found.findings)
    origins = Counter(claim.origin for claim in claims)
    return {
        "parts": sections,
        "claims": [[claim for claim in claims if claim.row in section.rows] for section in sections],
        "origins": [(origin, origins[origin]) for origin in get_args(Origin) if origins[origin]],
        "judged": [claim for claim in claims if claim.verdict is not None],
        "contradictions": [claim for claim in claims if claim.contradiction],
        "calibrated": [claim for claim in claims if claim.origin == "calibrated to this value"],
        "files": [
            (name, words) for name, words in _FILES if found.export is not None or name not in _EXPORTED
        ],
        "target": target_in_words(found),
        "fingerprint": found.fitted.fingerprint,
    }


PAGE = Page(
    name="report.html",
    first=_first,
    picture=_picture,
    label="From the loops to the controller",
    template="paper.html.j2",
    values=_sections,
)


# ------------------------------------------------------------------------------------------- JSON output


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
    return {
        "law": found.damper.law.name,
        "summary": summaries(found.assessment.runs),
        "cost_percent": found.cost_percent,
        "cpu_s": round(found.cpu_s, 4),
        "passivity_min": found.assessment.passivity_min,
    }


def _target(found: DemoResult) -> Json:
    if found.export is None:
        return {"written": False, "why": found.why_not_exported}
    answer = EXPORT_REPORT.answer(found.export)
    keys = ("precision", "step_s", "controller", "code_bytes", "tables_bytes", "verification")
    return {"written": True, **{key: answer[key] for key in keys}}


# --------------------------------------------------------------------------------------- terminal output


def _show(found: DemoResult, console: Console) -> None:
    console.print(escape(f"The runs are {LABEL}."))
    for line in _claims_in_words(found):
        console.print(escape(line))
    laws = []
    for each in (found.fitted, found.paper_law):
        summary = summaries(each.assessment.runs)
        cells = [_median_worst(summary.get(split)) for split in ("training", "held_out")]
        laws.append((each.damper.law.name, *cells))
    title = "Errors of two laws in % of the standard deviation of the force: median (worst)"
    console.print(terminal_table(title, ("law", "training", "held out"), laws, left=("law",)))
    claims = []
    for claim in found.claims:
        if claim.verdict in ("worse", "contradicts"):
            cells = [_figure(value) for value in (claim.compared_with, claim.ours)]
            claims.append((claim.statement, *cells, claim.unit, claim.outcome))
    title = "Simulated values that disagree with the paper. The report has all values, and the reasons."
    names = ("claim", "compared with", "simulation", "unit", "verdict")
    console.print(terminal_table(title, names, claims, left=("claim", "unit", "verdict")))


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


# ------------------------------------------------------------------------------- output files of all jobs


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
