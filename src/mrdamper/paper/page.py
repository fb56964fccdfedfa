"""The demo's report: the way from loops to controller at first, then the paper figure by figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import get_args

from matplotlib.figure import Figure

from mrdamper.identify.scores import summary
from mrdamper.paper.claims import Claim, Origin, Verdict
from mrdamper.paper.demo import DemoResult
from mrdamper.paper.figures import sections_of, way_figure
from mrdamper.report.base import FirstScreen, Page, Tile

_FILES = (
    ("card.json", "the model card: all that the other jobs need of a damper"),
    ("identification/report.html", "identification: loops, errors by run, parameters with uncertainty"),
    ("heating/heat.html", "heating of the preset paper, with the paper's heat sink and without"),
    ("sink/heatsink.html", "search of heat sinks"),
    ("sink/best.toml", "the best heat sink, as mrdamper heat reads it"),
    ("tracking/track.html", "force tracking"),
    ("c/README.md", "model and controller as C99, with the record of their verification"),
    ("damper.fmu", "the same as a functional mock-up unit (FMI 2.0), sources inside"),
    ("summary.json", "all figures, with the claims"),
)
_VERDICTS: Mapping[Verdict, str] = {
    "within": "within tolerance",
    "better": "better",
    "short": "short of the paper",
    "contradicts": "in contradiction to it",
}
_EXPORTED = ("c/README.md", "damper.fmu")


def target_in_words(found: DemoResult) -> str:
    """Return what was exported, and how it was proved."""
    code = None if found.export is None else found.export.code
    if code is None:
        return f"C code and FMU were not written: {found.why_not_exported}"
    controller = "" if code.target.controller is None else code.target.controller.name
    return (
        f"C code and FMU: the controller {controller} and the model in {code.target.precision}, a step every "
        f"{1e3 * code.target.period_s:g} ms, compiled here and compared with the model in Python over "
        f"{code.record.samples} samples."
    )


def _verdict(claims: Sequence[Claim]) -> str:
    """Return how many figures have a verdict, and how those came out."""
    found = Counter(claim.verdict for claim in claims if claim.verdict is not None)
    said = ", ".join(f"{found[verdict]} {words}" for verdict, words in _VERDICTS.items() if found[verdict])
    return f"of {len(claims)} figures of the paper {found.total()} have a verdict: {said}"


def _first(found: DemoResult) -> FirstScreen:
    findings = found.findings
    unseen = summary(error for error in findings.judged.runs if error.split == "held_out")
    heated, search = findings.warm_up, findings.sink
    bare = heated.rise if heated.bare is None else heated.bare
    tracked = min((row for row in findings.track.worst), key=lambda row: row.score.rmse_N)
    score = tracked.score
    least = score.rmse_N if score.rmse_feasible_N is None else score.rmse_feasible_N
    quick = (
        "; quick demo: a small campaign, figures differ from the whole one's" if found.options.quick else ""
    )
    return FirstScreen(
        title="The paper on the virtual rig",
        subject="From a test campaign to a temperature-dependent model, the heating, a heat sink, a force "
        f"controller and its C code, beside the paper's figures{quick}.",
        verdict=_verdict(found.claims),
        tiles=(
            Tile(
                f"{unseen['median']:.1f} %",
                "error of the model on held-out runs, median",
                f"worst {unseen['worst']:.1f} %",
            ),
            Tile(
                f"{search.gain.middle:.1f} K",
                "cooler with the best heat sink than with the paper's",
                f"90 %: {search.gain.low:.1f} to {search.gain.high:.1f} K; without any "
                f"{bare.fluid_degC[-1]:.0f} °C",
            ),
            Tile(
                f"{least:.1f} N",
                f"RMS error, {tracked.controller} on {tracked.target}, where feasible",
                f"at all times {score.rmse_N:.1f} N",
            ),
        ),
        caption="From the loops (grey measured, coloured modelled) over the heating to the controller "
        "(dashed: the target; grey band: the attainable force)",
        flags=[
            (
                "Nothing here was measured",
                "The dampers are simulated by physics that is none of the identified laws (the presets "
                "nominal and paper of the virtual rig); the models know them only through noisy runs",
            )
        ],
    )


def _figure(found: DemoResult) -> Figure:
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
        "calibrated": [claim for claim in claims if claim.origin == "calibrated to this figure"],
        "files": [
            (name, words) for name, words in _FILES if found.export is not None or name not in _EXPORTED
        ],
        "target": target_in_words(found),
        "fingerprint": found.fitted.fingerprint,
    }


PAGE = Page(
    name="report.html",
    first=_first,
    picture=_figure,
    label="From the loops to the controller",
    template="paper.html.j2",
    values=_sections,
)
