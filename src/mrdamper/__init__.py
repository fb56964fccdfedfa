"""Magnetorheological dampers: from measured rig runs to a model card.

>>> import mrdamper
>>> fit = mrdamper.fit({"0 A": frame, "1 A": another})  # frames, or files and folders  # doctest: +SKIP
>>> fit.plot(), fit.card().heat("paper"), fit.card().export(c="controller")  # doctest: +SKIP

The functions and classes are loaded on first use. Therefore ``import mrdamper`` and ``mrdamper --help`` do
not load NumPy.
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
    from mrdamper.jobs.public_data import FetchedData, PublicData
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
    """Check test data before a fit.

    Parameters
    ----------
    files : Read these runs: files, folders or patterns.
    channels : Read the files with this channel map (TOML), which states the quantity and unit of each column.
        Default: the map in the folder of the runs, or the headers.
    answer : State a fact that the files do not contain, for example force.unit=kN. Topics: unit, column,
        scale, value, rate, part. The answer lab_*:force.unit=kN is used only for files with such a name.
        Repeatable.
    deep : Fit one model to all runs, and report runs that are inconsistent with the other runs.
    write_map : Write the channel map that was used for the files to this file. Edit it, and pass it to
        --channels.
    """
    return _run("check", locals())


def fit(
    runs: Runs, law: Law | None = None, fluid: FluidFactors | str | Path | None = None,
    preparation: Preparation | None = None, settings: FitSettings | None = None, *,
    channels: str | Path | None = None, answer: Sequence[str] = (), flip_force: bool = False,
    only: Sequence[str] = (), hold_out: Sequence[str] = (), posterior: int = 0, one_command: bool = False,
    terms: Sequence[Literal["friction", "mass", "viscosity", "thinning", "gas", "orifice", "bristles",
    "spread", "stribeck", "memory", "position", "curvature", "stiffness", "asymmetry", "flow-asymmetry",
    "gas-volume", "leak", "play", "creep", "bypass", "knee", "cavity", "follow", "none"]] | None = None,
    temperature: Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"] = "auto",
    jobs: int | None = None, on_progress: Progress | None = None,
) -> FitResult:
    """Fit a hysteresis model to test data.

    Parameters
    ----------
    runs : Read these runs: files, folders or patterns.
    law : Fit this hysteresis model: chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating,
        spencer, lugre, dahl, bingham, tanh, or a class as FILE.py:CLASS. The choice auto selects a model by
        cross-validation. Default: auto.
    fluid : Use the temperature dependence of this fluid if the runs have one temperature: paper,
        lord-mrf-132dg, or a fluid file. The card marks the dependence as assumed. Default: none.
    preparation : Prepare the runs with these settings. None selects the settings of the job.
    settings : Use these numerical settings (FitSettings). None selects the default settings.
    channels : Read the files with this channel map (TOML), which states the quantity and unit of each column.
        Default: the map in the folder of the runs, or the headers.
    answer : State a fact that the files do not contain, for example force.unit=kN. Topics: unit, column,
        scale, value, rate, part. The answer lab_*:force.unit=kN is used only for files with such a name.
        Repeatable.
    flip_force : Reverse the sign of the force, for load cells with positive compression.
    only : Use only runs whose names match this pattern. Repeatable. Default: all runs.
    hold_out : Exclude runs whose names match this pattern from the fit, and test the model on them.
        Repeatable.
    posterior : Compute this number of posterior samples, for 90 % intervals of parameters and forces.
    one_command : Accept runs that all have the same current. The model is then valid only for this current.
    terms : Add a term to the model: friction, mass, viscosity, thinning or gas. The model chain also has
        orifice, bristles, spread, stribeck, memory, position, curvature, stiffness, asymmetry,
        flow-asymmetry, gas-volume, leak, play, creep, bypass, knee, cavity and follow. Use none for a model
        without terms. Repeatable. Default: friction, and thinning if the runs have several temperatures.
    temperature : Use this temperature dependence of the parameters. The choice auto is arrhenius if the runs
        have several temperatures, otherwise none.
    jobs : Use this number of parallel processes. The result does not depend on it. Default: all cores.
    """
    return _run("fit", locals())


def evaluate(
    card: ModelCard | Damper | Identification | str | Path, runs: Runs,
    preparation: Preparation | None = None, *, law: str | None = None, channels: str | Path | None = None,
    answer: Sequence[str] = (), flip_force: bool = False, posterior: int = 0,
) -> EvaluateResult:
    """Compute the errors of a model on test data.

    Parameters
    ----------
    card : Read this model card.
    runs : Read these runs: files, folders or patterns.
    preparation : Prepare the runs with these settings. None selects the settings of the job.
    law : Load this Python class if the card was fitted with your own hysteresis model.
    channels : Read the files with this channel map (TOML), which states the quantity and unit of each column.
        Default: the map in the folder of the runs, or the headers.
    answer : State a fact that the files do not contain, for example force.unit=kN. Topics: unit, column,
        scale, value, rate, part. The answer lab_*:force.unit=kN is used only for files with such a name.
        Repeatable.
    flip_force : Reverse the sign of the force, for load cells with positive compression.
    posterior : Compute 90 % intervals with this number of posterior samples, which fit wrote next to the
        card.
    """
    return _run("evaluate", locals())


def simulate(
    card: ModelCard | str | Path, motion: str | Path | RigRun | FrameLike | Trajectory, *,
    law: str | None = None, temperature_degC: float = 20.0, rate_Hz: float = 1000.0, posterior: int = 0,
) -> SimulateResult:
    """Simulate the damper force for a motion.

    Parameters
    ----------
    card : Read this model card.
    motion : Simulate this motion: MOTION:CURRENT:DURATION, such as sine:10mm:1Hz:1A:2s, or the file of a run.
    law : Load this Python class if the card was fitted with your own hysteresis model.
    temperature_degC : Use this fluid temperature, in degC, if the file of the run contains no temperature
        [degC], -60 to 200.
    rate_Hz : Sample a motion such as sine:10mm:1Hz:1A:2s at this rate, in Hz. A run keeps its own samples
        [Hz], above 0 and at most 100000.
    posterior : Compute 90 % intervals with this number of posterior samples, which fit wrote next to the
        card.
    """
    return _run("simulate", locals())


def compare(
    first: ModelCard | str | Path, second: ModelCard | str | Path, *, law: str | None = None,
) -> Comparison:
    """Compare two damper models.

    Parameters
    ----------
    first : Read this card as the reference.
    second : Compare this card with the reference.
    law : Load this Python class if the card was fitted with your own hysteresis model.
    """
    return _run("compare", locals())


def cycles(
    record: RigFile | PathLike, *, channels: str | Path | None = None, least_stroke_mm: float | None = None,
) -> CyclesResult:
    """Evaluate all cycles of a long record.

    Parameters
    ----------
    record : Read this record.
    channels : Read the files with this channel map (TOML), which states the quantity and unit of each column.
        Default: the map in the folder of the runs, or the headers.
    least_stroke_mm : Ignore cycles with a stroke below this value, in mm [mm], above 0 and below 1e+06.
        Default: 5 % of the displacement range.
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
    """Simulate the heating of a damper in a load cycle.

    Parameters
    ----------
    card : Read this model card.
    drawing : Read the dimensions of the damper from this geometry file (TOML). Default: paper.
    duty : Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current.
    sink : Use the heat sink of this file (TOML table [sink]). Default: the heat sink of the geometry file.
    calibrate : Adjust the thermal model to a measured heating curve of the same load cycle. The CSV file has
        two columns: time_s, and fluid_degC, body_degC or coil_degC.
    past_limit : Continue the simulation after the mean fluid temperature has reached its limit.
    model : Use this thermal model: reduced finite elements, a network of three axial zones, or one lumped
        node.
    start_degC : Start with this temperature of all parts, in degC [degC], -40 to 370. Default: ambient.
    ambient_degC : Use this ambient temperature, in degC [degC], -50 to 100. Default: the value of the
        geometry file.
    air_m_s : Use this air speed, in m/s [m/s], 0 to 50. Default: the value of the geometry file.
    with_sink : Use the heat sink of the geometry file.
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
    """Compute the permissible current, stroke or duty cycle.

    Parameters
    ----------
    card : Read this model card.
    drawing : Read the dimensions of the damper from this geometry file (TOML). Default: paper.
    duty : Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current.
    quantity : Reduce this quantity: the current, the stroke, or the fraction of time with motion.
    ambient_degC : Compute the limits at this ambient temperature, in degC. Repeatable, in rising order
        [degC], -50 to 100.
    air_m_s : Compute the limits at this air speed, in m/s. Repeatable, in rising order [m/s], 0 to 50.
    duration_min : Compute the limits for these durations, in min, in rising order, and for the steady state
        [min], above 0 and at most 1440.
    """
    return _run("derate", locals())


def fluid(
    tables: str | Path | Sequence[str | Path | RheometerTable], like: Fluid | str | Path = "paper",
) -> FluidResult:
    """Fit fluid properties to rheometer data.

    Parameters
    ----------
    tables : Read these rheometer tables.
    like : Use this fluid for properties that are missing in the tables: paper, lord-mrf-132dg, or a fluid
        file (TOML).
    """
    return _run("fluid", locals())


def track(
    card: ModelCard | str | Path, plant: TrackedDamper | VirtualDamper | ModelCard | str | Path = "nominal",
    targets: str | Path | Sequence[str | Path | Scenario] | None = None,
    unaware: ModelCard | str | Path | None = None, *, temperatures_degC: Sequence[float] = (),
    rate_Hz: float = 1000.0, controllers: Sequence[str] = (), seed: int = 1, posterior: int = 0,
    jobs: int | None = None, on_progress: Progress | None = None,
) -> TrackResult:
    """Simulate force tracking with a controller.

    Parameters
    ----------
    card : Read this model card.
    plant : Control this damper: a virtual damper such as nominal or hard, its TOML file, or a card (JSON).
    targets : Track this force: sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario file. Repeatable.
        Default: all.
    unaware : Add the controllers recommended-unaware and paper-unaware. They are designed from this card,
        which was fitted at one temperature.
    temperatures_degC : Simulate the damper at this temperature, in degC. Repeatable [degC]. Default: 20, 60,
        100, 123.
    rate_Hz : Run the controllers at this sample rate, in Hz [Hz], 100 to 5000.
    controllers : Test this controller, such as recommended, recommended-causal or paper. Repeatable. Default:
        all controllers.
    seed : Simulate each case twice: with this seed of the sensor noise, and with the next one.
    posterior : Compute 90 % intervals with this number of posterior samples, which fit wrote next to the
        card.
    jobs : Use this number of parallel processes. The result does not depend on it. Default: all cores.
    """
    return _run("track", locals())


def heatsink(
    card: ModelCard | str | Path, drawing: DamperDrawing | str | Path,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", *, span_mm: float | None = None,
    width_mm: float | None = None, mass_g: float | None = None, materials: Sequence[str] = (),
    members: int = 12, by_field: bool = True, on_progress: Progress | None = None,
) -> HeatsinkResult:
    """Optimise an annular-fin heat sink.

    Parameters
    ----------
    card : Read this model card.
    drawing : Read the dimensions of the damper from this geometry file (TOML). Default: paper.
    duty : Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current.
    span_mm : Limit the length of the finned body, in mm [mm], above 0 and below 1e+06. Default: as in the
        geometry file.
    width_mm : Limit the radial width of the fins, in mm [mm], above 0 and below 1e+06. Default: as in the
        geometry file.
    mass_g : Limit the total mass of the fins, in g [g], above 0 and below 1e+06. Default: as in the geometry
        file.
    materials : Allow this material: aluminium-alloy, copper, steel, stainless-steel. Repeatable. Default: the
        material of the geometry file.
    members : Show this number of designs of the Pareto front, and verify them with finite elements.
    by_field : Evaluate designs only with the fast network of axial zones, without finite elements. In Python:
        by_field=False.
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
    """Generate C code, an FMU, or a force map.

    Parameters
    ----------
    card : Read this model card.
    damper : Add the thermal model of this geometry file (TOML), which also detects a frozen temperature
        sensor. Default: no thermal model.
    what : Write C99 source code, an FMU, a force map (CSV), or a folder for MATLAB.
    content : Export the model of the damper, its force controller, or both.
    precision : Use this floating-point type in the code.
    period_s : Generate code for this sampling period, such as 1ms or 500us [s], above 0 and at most 1.
    controller : Use this controller, such as recommended, recommended-causal or paper.
    name : Begin all names in the code with this prefix.
    c : Write C99 source code and its report to this folder.
    fmu : Write a co-simulation FMU (FMI 2.0) to this file.
    table : Write a force map (CSV) for simulators to this file.
    matlab : Write card and force map for MATLAB to this folder.
    """
    return _run("export", locals())


def rig(
    preset: VirtualDamper | str | Path = "nominal", campaign: Campaign | str | Path | None = None, *,
    draw: int | None = None, seed: int = 0, on_progress: Progress | None = None,
) -> RigResult:
    """Simulate a test campaign on a virtual rig.

    Parameters
    ----------
    preset : Test this virtual damper: a preset, or a TOML file with a preset and changed parameters.
    campaign : Run this campaign of motions, currents and temperatures: short, or a TOML file. Default: the
        campaign of the damper.
    draw : Change all parameters of the damper at random by up to 30 %, with this seed. Even seeds were used
        to develop mrdamper, and odd seeds for its published results. Default: not randomised.
    seed : Use this seed of the random number generator.
    """
    return _run("rig", locals())


def list_data() -> PublicData:
    """List the public data sets."""
    return _run("data list", locals())


def fetch_data(name: str, *, on_progress: Progress | None = None) -> FetchedData:
    """Fetch a public data set and print the paths of its files.

    Parameters
    ----------
    name : Fetch the data set with this name. The command data list prints the names.
    """
    return _run("data fetch", locals())


def demo(*, quick: bool = False, on_progress: Progress | None = None) -> DemoResult:
    """Run all steps on simulated test data.

    Parameters
    ----------
    quick : Use fewer and shorter runs.
    """
    return _run("demo", locals())


def sweep(
    campaigns: str | Path | Sequence[str | Path] | None = None, card: ModelCard | str | Path | None = None,
    dampers: str | Path | Sequence[str | Path | DamperDrawing] | None = None,
    duty: Duty | str | Path = "sine:15mm:1Hz:2A:1800s", law: str | None = None, *, samples: int | None = None,
    spread_percent: float = 10.0, seed: int = 0, workers: int | None = None, scheduler: str | None = None,
    on_progress: Progress | None = None,
) -> SweepResult:
    """Run many fits, simulations or optimisations.

    Parameters
    ----------
    campaigns : Fit a model to each of these files, folders or patterns.
    card : Use this model card for random dampers and heat sinks. Default: none.
    dampers : Optimise the heat sink of this damper: paper, or a geometry file. Repeatable.
    duty : Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current.
    law : Fit this hysteresis model. Default: auto.
    samples : Test the controllers of the card on this number of random dampers. Default: no random dampers.
    spread_percent : Change the parameters of random dampers by at most this percentage of the nominal values
        [%], 0 to 30.
    seed : Use this seed of the random number generator.
    workers : Use this number of processes on this computer. Default: all cores.
    scheduler : Run the tasks on the workers of the Dask scheduler at this address.
    """
    return _run("sweep", locals())
