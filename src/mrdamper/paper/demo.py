"""The job ``demo``: run all other jobs on simulated data, in the order of the paper.

A campaign on the preset ``nominal`` is simulated and written as files. A model is selected, fitted, tested on
held-out temperatures and motions, and compared with the law of the paper. Heating and heat sinks are
simulated with the preset ``paper``, whose force decreases with temperature like the force of the damper in
the paper. Controllers that are made from a card with the law ``double-bouc-wen`` track forces on the virtual
damper. Model and controller are exported as code, and the code is verified.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.settings import FitSettings
from mrdamper.interrupts import interrupt_ends_all
from mrdamper.jobs.export import ExportResult, export
from mrdamper.jobs.fit import FitResult, fit
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import (
    DemoOptions,
    ExportOptions,
    FitOptions,
    HeatOptions,
    HeatsinkOptions,
    RigOptions,
    TrackOptions,
)
from mrdamper.jobs.rig import RigResult, rig
from mrdamper.jobs.thermal.heat import HeatResult, heat
from mrdamper.jobs.thermal.heatsink import heatsink
from mrdamper.jobs.track import TrackResult, read_plant, track
from mrdamper.models.card import ModelCard
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.paper.claim_table import claims_of
from mrdamper.paper.claims import Claim, Findings
from mrdamper.report.rig import write_runs
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.temperature_rise import works_of
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

LABEL = "simulated: virtual rig, damper nominal; not measured"
CONTROL_LAW = "double-bouc-wen"
NOISE_SEED = 0
_USUAL = DemoOptions()
_WARM_UP = "sine:15mm:1Hz:2A:2100s"  # heating for 35 min, as in the reference paper
_HALF_HOUR = "sine:15mm:1Hz:2A:1800s"
_OTHERS = ("sine:5mm:1Hz:2A:1800s", "sine:3mm:2Hz:2A:1800s")
_WARMED = Campaign(
    temperatures_degC=(20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0)
)  # The highest temperature of the paper is 140 degC.
_QUICKLY_WARMED = Campaign(
    motions=("sine5mm1Hz", "sine3mm2Hz", "nonperiodic", "chirp3mm"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 100.0, 140.0),
)
_QUICK = Campaign(  # small campaign that still has a held-out temperature
    motions=("sine5mm1Hz", "nonperiodic"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 80.0, 120.0),
    held_out_temperatures_degC=(60.0,),
    held_out_motions=(),
)
_CONTROLLERS = ("recommended", "paper", "recommended-unaware", "paper-unaware")
_STEPS = (
    "campaign on the virtual rig", "identification", "the paper's law, and one temperature alone",
    "the paper's damper", "heating", "heat sinks", "force tracking", "C code and FMU", "report",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DemoResult(JobResult):
    """Results of all jobs, and the claims of the paper with their verdicts."""

    _job = "demo"
    options: DemoOptions
    campaign: RigResult
    fitted: FitResult  # model selected by cross-validation
    paper_law: FitResult
    cold: ModelCard  # fitted to the runs at 20 degC
    warm: ModelCard  # fitted to runs of the preset ``paper``
    findings: Findings
    export: ExportResult | None
    why_not_exported: str
    claims: tuple[Claim, ...]
    cpu_s: float


def demo(options: DemoOptions = _USUAL, *, on_progress: Progress = silent) -> DemoResult:
    """Run all jobs on data of the virtual rig.

    With the option ``quick``, the campaign is small, tracking is tested at two temperatures, and heat sinks
    are evaluated only with the thermal network.
    """
    clock = time.process_time()
    steps = _report_steps(on_progress)
    quick = options.quick
    settings = FitSettings(random_start_count=1 if quick else 3)  # settings of all fits except the selection
    with interrupt_ends_all():  # Incomplete fits cannot confirm claims. Therefore an interrupt ends the demo.
        next(steps)
        campaign = rig(RigOptions(seed=NOISE_SEED), campaign=_QUICK if quick else Campaign())
        dataset, hold_out = _read_back(campaign), campaign.campaign.hold_out
        next(steps)
        fitted = fit(dataset, options=FitOptions(hold_out=hold_out))
        title = "The virtual rig's preset nominal"
        fitted = replace(fitted, sources=(LABEL,), simulated=LABEL, title=title)
        next(steps)
        literal_options = FitOptions(temperature="paper", hold_out=hold_out)
        literal = fit(dataset, "bouc-wen", options=literal_options, settings=settings)
        # The controllers of the reference paper are derived from a Bouc-Wen model.
        all_runs = FitData.prepare(dataset, settings=settings, hold_out=hold_out)
        control = fit_law(all_runs, CONTROL_LAW)
        control_card = control.card(title=f"{CONTROL_LAW} for controllers", sources=(LABEL,))
        cold_runs = dataset.select("*_020C_*")
        cold = fit_law(FitData.prepare(cold_runs, temperature="none", settings=settings))
        cold_card = cold.card(title="fitted only at 20 degC")
        next(steps)
        warm = _paper_damper(settings, options)
        next(steps)
        heated = [_heated(warm, text, past_limit=text == _WARM_UP) for text in (_WARM_UP, *_OTHERS)]
        next(steps)
        duty, sink_options = read_duty(_HALF_HOUR), HeatsinkOptions(by_field=not quick)
        sinks = heatsink(warm, read_drawing("paper"), duty, sink_options)
        next(steps)
        tracked = _tracked(control_card, cold_card, options)
        next(steps)
        made, why_not = _exported(control_card)
        next(steps)
    findings = Findings(
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
    return DemoResult(
        options=options,
        campaign=campaign,
        fitted=fitted,
        paper_law=literal,
        cold=cold_card,
        warm=warm,
        findings=findings,
        export=made,
        why_not_exported=why_not,
        claims=tuple(claims_of(findings)),
        cpu_s=time.process_time() - clock,
    )


def _report_steps(on_progress: Progress) -> Iterator[None]:
    """Generate one value for each step of the demo, and report the progress at each value."""
    for done, text in enumerate(_STEPS):
        on_progress(ProgressUpdate(done=done, total=len(_STEPS), text=text))
        yield


def _read_back(campaign: RigResult) -> Dataset:
    """Write the runs to files and read them again, like measured data."""
    with tempfile.TemporaryDirectory() as name:
        write_runs(campaign, Path(name))
        return read_dataset([name])


def _paper_damper(settings: FitSettings, options: DemoOptions) -> ModelCard:
    """Return a card of the preset ``paper``, whose force decreases with temperature as in the paper."""
    campaign = _QUICKLY_WARMED if options.quick else _WARMED
    runs = Dataset(tuple(run for run, _ in measure(find_preset("paper"), campaign, seed=NOISE_SEED)))
    return fit_law(FitData.prepare(runs, settings=settings)).card(title="the virtual rig's preset paper")


def _heated(card: ModelCard, duty: str, *, past_limit: bool) -> HeatResult:
    return heat(card, read_drawing("paper"), read_duty(duty), HeatOptions(past_limit=past_limit))


def _tracked(card: ModelCard, cold: ModelCard, options: DemoOptions) -> TrackResult:
    temperatures = (20.0, 123.0) if options.quick else ()
    chosen = TrackOptions(controllers=_CONTROLLERS, temperatures_degC=temperatures, seed=NOISE_SEED + 1)
    return track(card, read_plant("nominal"), chosen, unaware=cold)


def _exported(card: ModelCard) -> tuple[ExportResult | None, str]:
    """Export model and controller as C code and FMU; without a C compiler, return None and the reason."""
    try:
        return export(card, ExportOptions(what=("c", "fmu"))), ""
    except InputError as fault:
        return None, str(fault)
