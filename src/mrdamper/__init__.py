"""Magnetorheological dampers: from measured rig runs to a model card.

>>> import mrdamper
>>> fit = mrdamper.fit({"0 A": frame, "1 A": another})  # frames, or files and folders  # doctest: +SKIP
>>> fit.plot(), fit.card().heat("paper"), fit.card().export(c="controller")  # doctest: +SKIP

The objects behind the names are loaded on first use: ``import mrdamper`` and ``mrdamper --help`` do not load
NumPy.
"""

# ruff: noqa: PLR0913
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mrdamper.errors import ConvergenceError, EnvelopeError, InputError, MissingExtraError, MrdamperError
from mrdamper.results import load

if TYPE_CHECKING:
    from mrdamper.data.prepare import prepare_run
    from mrdamper.data.readers import read_runs
    from mrdamper.data.records import Dataset, RigRun
    from mrdamper.identify.fit import assess
    from mrdamper.identify.settings import FitSettings
    from mrdamper.jobs.inputs import read
    from mrdamper.models.card import ModelCard
    from mrdamper.models.card_schema import read_card
    from mrdamper.models.damper import Damper

    __version__: str

__all__ = [
    "ConvergenceError",
    "Damper",
    "Dataset",
    "EnvelopeError",
    "FitSettings",
    "InputError",
    "MissingExtraError",
    "ModelCard",
    "MrdamperError",
    "RigRun",
    "__version__",
    "assess",
    "check",
    "compare",
    "cycles",
    "demo",
    "derate",
    "evaluate",
    "export",
    "fetch_data",
    "fit",
    "fluid",
    "heat",
    "heatsink",
    "list_data",
    "prepare_run",
    "read",
    "read_card",
    "read_runs",
    "rig",
    "simulate",
    "sweep",
    "track",
]

_MODULE_OF = {
    "Damper": "mrdamper.models.damper",
    "Dataset": "mrdamper.data.records",
    "FitSettings": "mrdamper.identify.settings",
    "ModelCard": "mrdamper.models.card",
    "RigRun": "mrdamper.data.records",
    "assess": "mrdamper.identify.fit",
    "prepare_run": "mrdamper.data.prepare",
    "read": "mrdamper.jobs.inputs",
    "read_card": "mrdamper.models.card_schema",
    "read_runs": "mrdamper.data.readers",
}

if not TYPE_CHECKING:  # Type checkers use the imports above and report misspelled names.

    def __getattr__(name: str) -> object:
        """Load a public name on first use and keep it (PEP 562)."""
        if name == "__version__":
            value: object = load("importlib.metadata:version")("mrdamper")
        elif name in _MODULE_OF:
            value = load(f"{_MODULE_OF[name]}:{name}")
        else:
            raise AttributeError(f"module 'mrdamper' has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})


def _run(job: str, given: dict[str, Any]) -> Any:  # noqa: ANN401 - the result of any job
    """Run a job with the arguments of its function."""
    return load("mrdamper.registry:JOBS")[job].call(given)


# The rest of this module is written by `make interface` from the declarations of the jobs.
# fmt: off

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Literal

    from mrdamper.control.scenario import Scenario
    from mrdamper.data.frames import FrameLike, Runs
    from mrdamper.data.prepare import Preparation
    from mrdamper.data.proposal.recordings import RigFile
    from mrdamper.data.records import RigRun
    from mrdamper.data.rheometer import RheometerTable
    from mrdamper.excitation import Trajectory
    from mrdamper.files import PathLike
    from mrdamper.identify.fit import Identification, Law
    from mrdamper.identify.settings import FitSettings
    from mrdamper.identify.temperature import FluidFactors
    from mrdamper.jobs.check import CheckResult
    from mrdamper.jobs.cycles import CyclesResult
    from mrdamper.jobs.evaluate import EvaluateResult
    from mrdamper.jobs.export import ExportResult
    from mrdamper.jobs.fit import FitResult
    from mrdamper.jobs.fluid import FluidResult
    from mrdamper.jobs.public_data.datasets import FetchedData, PublicData
    from mrdamper.jobs.rig import RigResult
    from mrdamper.jobs.simulate import SimulateResult
    from mrdamper.jobs.sweep.sweep import SweepResult
    from mrdamper.jobs.thermal.derate import DerateResult
    from mrdamper.jobs.thermal.heat import HeatResult
    from mrdamper.jobs.thermal.heatsink import HeatsinkResult
    from mrdamper.jobs.track import TrackedDamper, TrackResult
    from mrdamper.models.card import ModelCard
    from mrdamper.models.comparison import Comparison
    from mrdamper.models.damper import Damper
    from mrdamper.models.fluids.fluid import Fluid
    from mrdamper.paper.demo import DemoResult
    from mrdamper.runtime.progress import Progress
    from mrdamper.thermal.drawing import DamperDrawing
    from mrdamper.thermal.duty import Duty
    from mrdamper.thermal.estimation.measured_curve import HeatingCurve
    from mrdamper.thermal.heatsink import HeatSink
    from mrdamper.virtual_rig.campaign import Campaign
    from mrdamper.virtual_rig.plant import VirtualDamper


def check(
    files: Runs, *, channels: str | Path | None = None, answer: Sequence[str] = (), deep: bool = False,
    write_map: str | Path | None = None, on_progress: Progress | None = None,
) -> CheckResult:
    """Tell what is wrong with runs before they are fitted, and how their files were understood.

    Parameters
    ----------
    files : Files, folders or patterns of runs.
    channels : Channel map (TOML) for headers that do not speak. Default: the one beside it, else its headers.
    answer : What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate, part.
        For some files a pattern of their names and a colon before it.
    deep : Fit one law to all runs, and tell which of them do not belong to the others, and why.
    write_map : Write the channel map by which the files were read, to be corrected and kept.
    """
    return _run("check", locals())


def fit(
    runs: Runs, law: Law | None = None, fluid: FluidFactors | str | Path | None = None,
    preparation: Preparation | None = None, settings: FitSettings | None = None, *,
    channels: str | Path | None = None, answer: Sequence[str] = (), flip_force: bool = False,
    only: Sequence[str] = (), hold_out: Sequence[str] = (), posterior: int = 0, one_command: bool = False,
    terms: Sequence[Literal["friction", "mass", "viscosity", "thinning", "gas", "orifice", "bristles",
    "spread", "stribeck", "memory", "position", "curvature", "stiffness", "asymmetry", "flow-asymmetry",
    "gas-volume", "leak", "play", "follow", "none"]] | None = None,
    temperature: Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"] = "auto",
    jobs: int | None = None, on_progress: Progress | None = None,
) -> FitResult:
    """Fit one hysteresis law to measured runs over all currents and temperatures at once.

    Parameters
    ----------
    runs : Files, folders or patterns of runs.
    law : chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating, spencer, lugre, dahl, bingham,
        tanh; auto (chosen by what is left out); or file.py:Class. Default: auto.
    fluid : Take temperature laws from a fluid (paper, lord-mrf-132dg, a file), marked as assumed. Default:
        none.
    preparation : How runs are prepared; None: as the job does by itself.
    settings : FitSettings, the numerical settings of the fit; None: the default ones.
    channels : Channel map (TOML) for headers that do not speak. Default: the one beside it, else its headers.
    answer : What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate, part.
        For some files a pattern of their names and a colon before it.
    flip_force : Turn the sign of the force (compression-positive load cells).
    only : Runs to use; all others are left aside (by name). Default: all.
    hold_out : Runs that the fit must not see (by name).
    posterior : Number of posterior samples, for 90 % intervals of parameters and predictions.
    one_command : Accept runs at a single command; the model holds for it alone.
    terms : Add a term to the law. Every law takes friction, mass, viscosity, thinning and gas; the others are
        of the law chain. Default: friction, thinning for tempered runs.
    temperature : How coefficients follow temperature (auto: arrhenius where the runs have one; none: not at
        all).
    jobs : Cores at work at a time; the result does not depend on it. Default: all.
    """
    return _run("fit", locals())


def evaluate(
    card: ModelCard | Damper | Identification | str | Path, runs: Runs,
    preparation: Preparation | None = None, *, law: str | None = None, channels: str | Path | None = None,
    answer: Sequence[str] = (), flip_force: bool = False, posterior: int = 0,
) -> EvaluateResult:
    """Score a model card on runs that it has not seen.

    Parameters
    ----------
    card : The model card.
    runs : Files, folders or patterns of runs.
    preparation : How runs are prepared; None: as the job does by itself.
    law : The user's own law, for a card that was identified with one.
    channels : Channel map (TOML) for headers that do not speak. Default: the one beside it, else its headers.
    answer : What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate, part.
        For some files a pattern of their names and a colon before it.
    flip_force : Turn the sign of the force (compression-positive load cells).
    posterior : Follow so many of the posterior draws beside the card, for 90 % intervals; 0: none.
    """
    return _run("evaluate", locals())


def simulate(
    card: ModelCard | str | Path, motion: str | Path | RigRun | FrameLike | Trajectory, *,
    law: str | None = None, temperature_degC: float = 20.0, rate_Hz: float = 1000.0, posterior: int = 0,
) -> SimulateResult:
    """Simulate a card's force along a motion: in words, a measured run, or a frame.

    Parameters
    ----------
    card : The model card.
    motion : MOTION:COMMAND:DURATION, such as sine:10mm:1Hz:1A:2s, or a run's file.
    law : The user's own law, for a card that was identified with one.
    temperature_degC : Of the fluid, where the motion does not tell it [degC], -60 to 200.
    rate_Hz : Samples per second of a motion in words [Hz], above 0 and at most 100000.
    posterior : Follow so many of the posterior draws beside the card, for 90 % intervals; 0: none.
    """
    return _run("simulate", locals())


def compare(
    first: ModelCard | str | Path, second: ModelCard | str | Path, *, law: str | None = None,
) -> Comparison:
    """Compare two dampers, or one before and after: forces, energy, response, numbers.

    Parameters
    ----------
    first : The card before.
    second : The card after.
    law : The user's own law, for a card that was identified with one.
    """
    return _run("compare", locals())


def cycles(
    record: RigFile | PathLike, *, channels: str | Path | None = None, least_stroke_mm: float | None = None,
) -> CyclesResult:
    """Count the cycles of a record: energy, peak forces, stiffness and temperature of each.

    Parameters
    ----------
    record : The record's file.
    channels : Channel map (TOML) for headers that do not speak. Default: the one beside it, else its headers.
    least_stroke_mm : A smaller to-and-fro is no cycle [mm], above 0 and below 1e+06. Default: 5 % of the
        range of displacement.
    """
    return _run("cycles", locals())


def heat(
    card: ModelCard | str | Path, drawing: DamperDrawing | str | Path,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", sink: HeatSink | str | Path | None = None,
    calibrate: HeatingCurve | str | Path | None = None, *, past_limit: bool = False,
    model: Literal["reduced", "network", "lumped"] = "reduced", start_degC: float | None = None,
    ambient_degC: float | None = None, air_m_s: float | None = None, with_sink: bool = True,
    on_progress: Progress | None = None,
) -> HeatResult:
    """Tell how hot a damper gets under a duty, how soon, and where the heat goes.

    Parameters
    ----------
    card : The model card.
    drawing : The drawing of the damper (TOML), or the paper's. Default: paper.
    duty : MOTION:COMMAND:DURATION, or a CSV of time, motion and command.
    sink : A heat sink (TOML table [sink]) in place of the drawing's. Default: the drawing's.
    calibrate : A curve measured under this duty (time_s and fluid_degC, body_degC or coil_degC): it corrects
        the drawing and narrows the interval.
    past_limit : Go on where the fluid's mean passes its limit instead of ending there.
    model : Reduced finite elements, three axial zones, or the paper's one node.
    start_degC : Of everything at the start [degC], -40 to 370. Default: ambient.
    ambient_degC : Air around the damper [degC], -50 to 100. Default: the drawing's.
    air_m_s : Speed of the air [m/s], 0 to 50. Default: the drawing's.
    with_sink : Keep the drawing's heat sink.
    """
    return _run("heat", locals())


def derate(
    card: ModelCard | str | Path, drawing: DamperDrawing | str | Path,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", *,
    quantity: Literal["current", "stroke", "duty"] = "current",
    ambient_degC: Sequence[float] = (-20.0, 0.0, 20.0, 40.0, 50.0),
    air_m_s: Sequence[float] = (0.0, 1.0, 2.0, 5.0, 10.0),
    duration_min: Sequence[float] = (5.0, 15.0, 30.0, 60.0), on_progress: Progress | None = None,
) -> DerateResult:
    """Tell the largest current (stroke, duty) that keeps every limit, over ambient, wind and time.

    Parameters
    ----------
    card : The model card.
    drawing : The drawing of the damper (TOML), or the paper's. Default: paper.
    duty : MOTION:COMMAND:DURATION, or a CSV of time, motion and command.
    quantity : What is made smaller: the duty's command, its motion, or the share of time at work.
    ambient_degC : Air around the damper, rising [degC], -50 to 100.
    air_m_s : Speeds of the air, rising [m/s], 0 to 50.
    duration_min : Times from ambient on, rising; steady is added [min], above 0 and at most 1440.
    """
    return _run("derate", locals())


def fluid(
    tables: str | Path | Sequence[str | Path | RheometerTable], like: Fluid | str | Path = "paper",
) -> FluidResult:
    """Fit viscosity and yield-stress laws to rheometer tables.

    Parameters
    ----------
    tables : Rheometer tables.
    like : Fluid that gives what the tables do not hold: paper, lord-mrf-132dg, or a fluid.toml.
    """
    return _run("fluid", locals())


def track(
    card: ModelCard | str | Path, plant: TrackedDamper | VirtualDamper | ModelCard | str | Path = "nominal",
    targets: str | Path | Sequence[str | Path | Scenario] | None = None,
    unaware: ModelCard | str | Path | None = None, *, temperatures_degC: Sequence[float] = (),
    rate_Hz: float = 1000.0, controllers: Sequence[str] = (), seed: int = 1, posterior: int = 0,
    jobs: int | None = None, on_progress: Progress | None = None,
) -> TrackResult:
    """Track forces on a virtual damper with controllers made from a card, without a force sensor.

    Parameters
    ----------
    card : The model card.
    plant : The damper that is tracked: nominal, hard, stiff, ..., a virtual damper (TOML), or a card (JSON).
    targets : sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario. Default: all.
    unaware : Identified at one temperature: adds recommended-unaware and paper-unaware.
    temperatures_degC : Temperature of the damper [degC]. Default: 20, 60, 100, 123.
    rate_Hz : Sampling of the controllers [Hz], 100 to 5000.
    controllers : recommended, paper, .... Default: all.
    seed : Seed of the sensor noise; the next seed is run as well.
    posterior : Follow so many of the posterior draws beside the card, for 90 % intervals; 0: none.
    jobs : Cores at work at a time; the result does not depend on it. Default: all.
    """
    return _run("track", locals())


def heatsink(
    card: ModelCard | str | Path, drawing: DamperDrawing | str | Path,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", *, span_mm: float | None = None,
    width_mm: float | None = None, mass_g: float | None = None, materials: Sequence[str] = (),
    members: int = 12, by_field: bool = True, on_progress: Progress | None = None,
) -> HeatsinkResult:
    """Search annular-fin heat sinks: the coolest damper for the least mass, inside limits.

    Parameters
    ----------
    card : The model card.
    drawing : The drawing of the damper (TOML), or the paper's. Default: paper.
    duty : MOTION:COMMAND:DURATION, or a CSV of time, motion and command.
    span_mm : Length of the body for the fins [mm], above 0 and below 1e+06. Default: the drawing's sink's.
    width_mm : Largest width of a fin [mm], above 0 and below 1e+06. Default: the drawing's sink's.
    mass_g : Largest mass of all fins [g], above 0 and below 1e+06. Default: the drawing's sink's.
    materials : aluminium-alloy, copper, steel, stainless-steel. Default: as drawn.
    members : Members of the front that are shown and verified by finite elements.
    by_field : Do not verify by finite elements.
    """
    return _run("heatsink", locals())


def export(
    card: ModelCard | str | Path, damper: DamperDrawing | str | Path | None = None, *,
    what: Sequence[Literal["c", "fmu", "table", "matlab"]] = ("c", "fmu", "table"),
    content: Literal["model", "controller", "both"] = "both", precision: Literal["float", "double"] = "float",
    period_s: float = 0.001, controller: str = "recommended", name: str = "damper",
    c: str | Path | None = None, fmu: str | Path | None = None, table: str | Path | None = None,
    matlab: str | Path | None = None, on_progress: Progress | None = None,
) -> ExportResult:
    """Export a card as C source, FMU, force map or for MATLAB.

    The code is compared with the model before it is written.

    Parameters
    ----------
    card : The model card.
    damper : The drawing (TOML): adds the thermal model, and tells a frozen thermometer. Default: no thermal
        model.
    what : C99 source, an FMU, a force map (CSV), a folder for MATLAB.
    content : The damper's model, its force controller, or both.
    precision : The target's number type.
    period_s : Period [s], above 0 and at most 1.
    controller : recommended, recommended-causal, paper, ...
    name : Prefix of every name in the code.
    c : Write C99 source and its report there.
    fmu : Write a co-simulation FMU (FMI 2.0).
    table : Write a force map (CSV) for simulators.
    matlab : Write card and force map for MATLAB there.
    """
    return _run("export", locals())


def rig(
    preset: VirtualDamper | str | Path = "nominal", campaign: Campaign | str | Path | None = None, *,
    draw: int | None = None, seed: int = 0, on_progress: Progress | None = None,
) -> RigResult:
    """Run a campaign of tests on the virtual rig: a damper whose physics is none of the laws.

    Parameters
    ----------
    preset : Virtual damper: a preset, or a file (TOML) with a preset and changed parameters.
    campaign : Motions, currents, temperatures, sensors (short, or TOML). Default: the damper's usual one.
    draw : Another damper of the kind, its parameters drawn within 30 % (even seeds: to build laws; odd ones:
        to report). Default: the damper itself.
    seed : Of every random draw.
    """
    return _run("rig", locals())


def list_data() -> PublicData:
    """List the public data sets."""
    return _run("data list", locals())


def fetch_data(name: str, *, on_progress: Progress | None = None) -> FetchedData:
    """Fetch a public data set and print where its files lie.

    Parameters
    ----------
    name : Of the set, as the list has it.
    """
    return _run("data fetch", locals())


def demo(*, quick: bool = False, on_progress: Progress | None = None) -> DemoResult:
    """Run every job on the virtual rig and compare with the paper (no measured data needed).

    Parameters
    ----------
    quick : Fewer and shorter runs.
    """
    return _run("demo", locals())


def sweep(
    campaigns: str | Path | Sequence[str | Path] | None = None, card: ModelCard | str | Path | None = None,
    dampers: str | Path | Sequence[str | Path | DamperDrawing] | None = None,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", law: str | None = None, *, samples: int | None = None,
    spread_percent: float = 10.0, seed: int = 0, workers: int | None = None, scheduler: str | None = None,
    on_progress: Progress | None = None,
) -> SweepResult:
    """Fit many campaigns, track random dampers, or search heat sinks for several dampers.

    Parameters
    ----------
    campaigns : Files, folders or patterns of runs to fit.
    card : The model card. Default: none.
    dampers : Search the heat sink of this damper: paper, or a geometry file.
    duty : MOTION:COMMAND:DURATION, or a CSV of time, motion and command.
    law : Hysteresis model of the fits. Default: auto.
    samples : Number of random dampers that the card's controller is tried on. Default: no random dampers.
    spread_percent : Largest deviation of a random damper's parameters from the nominal ones [%], 0 to 30.
    seed : Seed of the random number generator.
    workers : Number of processes of this machine. Default: one for each core.
    scheduler : Address of a Dask scheduler; its workers run the tasks.
    """
    return _run("sweep", locals())
