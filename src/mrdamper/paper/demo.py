"""The demo: every job in order on the embedded default, the virtual rig, in one report along the paper.

A campaign on the preset ``nominal`` is written as any laboratory would write it, and identified with
temperatures and a motion held out; the paper's own law and a card of one temperature stand beside it. The
preset ``paper``, which loses its force as the paper's damper does, is heated, finned and cooled. Controllers
made from the card track forces on the virtual damper; what they are made of is exported and verified.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.identify.fit import fit, versions
from mrdamper.identify.predict import finite
from mrdamper.jobs.export import export
from mrdamper.jobs.heat import HeatResult, heat
from mrdamper.jobs.identify import IdentifyResult, identify
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import (
    ExportOptions,
    FitOptions,
    HeatOptions,
    RigOptions,
    SinkOptions,
    TrackOptions,
)
from mrdamper.jobs.rig import rig
from mrdamper.jobs.sink import sink
from mrdamper.jobs.track import read_plant, track
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card, write_card
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.paper.claims import claims_of
from mrdamper.paper.figures import sections_of
from mrdamper.paper.findings import Findings
from mrdamper.paper.page import render_paper
from mrdamper.report.base import Place, write_report
from mrdamper.report.export import REPORT as EXPORT_REPORT
from mrdamper.report.heat import REPORT as HEAT_REPORT
from mrdamper.report.identify import REPORT as IDENTIFY_REPORT
from mrdamper.report.rig import REPORT as RIG_REPORT
from mrdamper.report.scores import summaries
from mrdamper.report.sink import REPORT as SINK_REPORT
from mrdamper.report.track import REPORT as TRACK_REPORT
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import find_preset
from mrdamper.runtime.outputs import atomic_output, write_json
from mrdamper.runtime.signals import interrupt_ends_all
from mrdamper.schema import Json
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.temperature_rise import works_of

__all__ = ["Report", "demo"]

Report = Callable[[int, int, str], None]
"""Told how many of how many steps are done, and which one comes now."""

_LABEL = "simulated: virtual rig, damper nominal; not measured"
_WARM_UP = "sine:15mm:1Hz:2A:2100s"  # the paper's 35 min
_HALF_HOUR = "sine:15mm:1Hz:2A:1800s"
_OTHERS = ("sine:5mm:1Hz:2A:1800s", "sine:3mm:2Hz:2A:1800s")
_WARMED = Campaign(
    temperatures_degC=(20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0)
)  # 140: the paper's hottest
_QUICKLY_WARMED = Campaign(
    motions=("sine5mm1Hz", "sine3mm2Hz", "nonperiodic", "chirp3mm"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 100.0, 140.0),
)
_CONTROLLERS = ("recommended", "paper", "recommended-unaware", "paper-unaware")
_FILES = (
    ("card.json", "the model card: all that the other jobs need of a damper"),
    ("identification/report.html", "identification: loops, errors by run, parameters with uncertainty"),
    ("heating/heat.html", "heating of the preset paper, with the paper's heat sink and without"),
    ("sink/sink.html", "search of heat sinks"),
    ("sink/best.toml", "the best heat sink, as ⟦mrdamper heat⟧ reads it"),
    ("tracking/track.html", "force tracking"),
    ("c/README.md", "model and controller as C99, with the record of their verification"),
    ("damper.fmu", "the same as a functional mock-up unit (FMI 3.0), sources inside"),
    ("summary.json", "all figures, with the claims"),
)
_EXPORTED: Mapping[Literal["c", "fmu"], str] = {"c": "c", "fmu": "damper.fmu"}
_STEPS = (
    "campaign on the virtual rig", "identification", "the paper's law, and one temperature alone",
    "the paper's damper", "heating", "heat sinks", "force tracking", "C code and FMU", "report",
)  # fmt: skip


def demo(out: Path, *, quick: bool = False, seed: int = 0, report: Report | None = None) -> Json:
    """Run every job on the virtual rig; write report.html, summary.json, card.json and what they are made of.

    ``quick`` runs a small campaign, tracks at two temperatures and judges heat sinks by the network alone.
    """
    clock = time.process_time()
    campaign = _quick() if quick else Campaign()

    def now(step: int) -> None:
        if report is not None:
            report(step, len(_STEPS), _STEPS[step])

    with atomic_output(out) as beside, interrupt_ends_all():  # claims are made of whole fits
        place = _Place(beside, out)
        now(0)
        dataset = _measured(place, campaign, seed)
        now(1)
        starts = 1 if quick else 3  # of the fits that are compared with this one
        fitted = identify(dataset, options=FitOptions(seed=seed, hold_out=campaign.hold_out))
        first = _write_identification(fitted, place)
        now(2)
        literal = identify(
            dataset,
            "bouc-wen",
            options=FitOptions(temperature="paper", starts=starts, seed=seed, hold_out=campaign.hold_out),
        )
        cold = fit(dataset.select("*_020C_*"), temperature="none", starts=starts, seed=seed)
        write_card(cold.card(title="identified at 20 degC alone"), beside / "cold_card.json")
        now(3)
        warmer = _QUICKLY_WARMED if quick else _WARMED
        runs = [run for run, _ in measure(find_preset("paper"), warmer, seed=seed)]
        warm = fit(runs, starts=starts, seed=seed).card(title="the virtual rig's preset paper")
        write_card(warm, beside / "paper_card.json")
        now(4)
        heated = [_heated(warm, text, past_limit=text == _WARM_UP) for text in (_WARM_UP, *_OTHERS)]
        head = {"card": str(out / "paper_card.json"), "damper": "paper"}
        heating = write_report(HEAT_REPORT, heated[0], {"": Place(*place.part("heating"))}, head)
        now(5)
        options = SinkOptions(by_field=not quick)
        sinks = sink(warm, read_drawing("paper"), read_duty(_HALF_HOUR), options)
        searched = write_report(SINK_REPORT, sinks, {"": Place(*place.part("sink"))}, head)
        now(6)
        tracked = track(
            read_card(beside / "card.json"),
            read_plant("nominal"),
            TrackOptions(
                controllers=_CONTROLLERS,
                temperatures_degC=(20.0, 123.0) if quick else (),
                seed=seed + 1,
            ),
            unaware=read_card(beside / "cold_card.json"),
        )
        head = {"card": str(out / "card.json")}
        tracking = write_report(TRACK_REPORT, tracked, {"": Place(*place.part("tracking"))}, head)
        now(7)
        target = _exported(beside)
        now(8)
        found = Findings(
            fitted=fitted,
            judged=fitted.assessment,
            paper_law=literal.assessment,
            fluid=find_fluid("paper"),
            warm_up=heated[0],
            small=heated[1],
            fast=heated[2],
            works=tuple((each.duty.text, works_of(warm.damper, each.duty)[0]) for each in heated),
            sink=sinks,
            track=tracked,
        )
        claims = claims_of(found)
        answer: Json = {
            **first,
            "simulated": True,
            "runs_are": _LABEL,
            "laws": [_law_line(fitted), _law_line(literal)],
            "claims": [claim.to_json() for claim in claims],
            "heating": {
                key: heating[key] for key in ("time_to_limit_s", "force_loss_percent", "energy_closure")
            },
            "sink": {key: searched[key] for key in ("reference", "best", "cooler_K")},
            "tracking": tracking["worst"],
            "target": target,
            "cpu_s": round(time.process_time() - clock, 3),
            "report": str(out / "report.html"),
            "summary_file": str(out / "summary.json"),
            "versions": versions(),
        }
        page = render_paper(
            sections_of(found),
            claims,
            [(path, words) for path, words in _FILES if (beside / path).exists()],
            target=_target_in_words(target),
            quick=quick,
            fingerprint=fitted.fingerprint,
            seed=seed,
            versions=versions(),
        )
        (beside / "report.html").write_text(page, encoding="utf-8")
        write_json(beside / "summary.json", answer)
    return answer


@dataclass(frozen=True, slots=True)
class _Place:
    """Where files are written, and where they will lie."""

    beside: Path
    out: Path

    def part(self, name: str) -> tuple[Path, Path]:
        """Return a new folder of that name, and where it will lie."""
        (self.beside / name).mkdir()
        return self.beside / name, self.out / name


def _measured(place: _Place, campaign: Campaign, seed: int) -> Dataset:
    """Run a campaign on the preset ``nominal``, write it and read it back as any rig's runs."""
    runs, truth = (Place(*place.part(name)) for name in ("runs", "runs.truth"))
    found = rig(RigOptions(preset="nominal", seed=seed), campaign=campaign)
    write_report(RIG_REPORT, found, {"": runs, "truth": truth}, {})
    return read_dataset([runs.stage])


def _law_line(found: IdentifyResult) -> Json:
    """Return one law's line of the comparison."""
    return {
        "law": found.damper.law.name,
        "summary": summaries(found.assessment.runs),
        "cost_percent": found.cost_percent,
        "cpu_s": round(found.cpu_s, 4),
        "passivity_min": finite(found.assessment.passivity_min),
    }


def _write_identification(fitted: IdentifyResult, place: _Place) -> Json:
    """Write the identification's files; the card lies at the top."""
    beside, out = place.part("identification")
    title = "The virtual rig's preset nominal"
    named = replace(fitted, sources=(_LABEL,), simulated=_LABEL, title=title)
    answer = write_report(IDENTIFY_REPORT, named, {"": Place(beside, out)}, {})
    (beside / "card.json").replace(place.beside / "card.json")
    return {**answer, "card": str(place.out / "card.json")}


def _exported(beside: Path) -> dict[str, Any]:
    """Export controller and model as C and FMU, or say why not: no C compiler, say."""
    places: dict[str, Place] = {n: Place(beside / path, beside / path) for n, path in _EXPORTED.items()}
    try:
        made = export(read_card(beside / "card.json"), ExportOptions(what=tuple(_EXPORTED)))
        answer = write_report(EXPORT_REPORT, made, places, {})
    except InputError as fault:
        return {"written": False, "why": str(fault)}
    return {
        "written": True,
        **{key: answer[key] for key in ("precision", "step_s", "controller", "code_bytes", "tables_bytes")},
        "verification": json.loads(json.dumps(answer["verification"])),
    }


def _target_in_words(target: dict[str, Any]) -> str:
    if not target["written"]:
        return f"C code and FMU were not written: {target['why']}"
    record = target["verification"]
    return (
        f"C code and FMU: the controller {target['controller']} and the model in {target['precision']}, a "
        f"step every {1e3 * target['step_s']:g} ms, compiled here and compared with the model in Python over "
        f"{record['samples']} samples."
    )


def _heated(card: ModelCard, duty: str, *, past_limit: bool) -> HeatResult:
    return heat(card, read_drawing("paper"), read_duty(duty), HeatOptions(past_limit=past_limit))


def _quick() -> Campaign:
    """Return a campaign of 30 runs that still has a temperature and a motion to hold out."""
    return Campaign(
        motions=("sine5mm1Hz", "nonperiodic"),
        currents_A=(0.0, 1.0, 2.0),
        temperatures_degC=(20.0, 60.0, 80.0, 120.0),
        held_out_temperatures_degC=(60.0,),
        held_out_motions=(),
    )
