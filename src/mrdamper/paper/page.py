"""Report page of the demo: loops, heating and control on the first screen, then the figures of the paper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import get_args

from matplotlib.figure import Figure

from mrdamper.identify.scores import summary
from mrdamper.paper.claims import Claim, Origin, Verdict
from mrdamper.paper.demo import DemoResult
from mrdamper.paper.figures import sections_of, way_figure
from mrdamper.report.page import FirstScreen, Page, Tile

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
    picture=_figure,
    label="From the loops to the controller",
    template="paper.html.j2",
    values=_sections,
)
