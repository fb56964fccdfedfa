"""Inputs, options and outputs of every job: one class for each job, and one declaration for all interfaces.

Commands with their help, web forms, requests to the server, Python functions and tables of the documentation
are generated from these classes. The text below a field is its help. The class of the job ``heat`` is
``HeatOptions``. Class variables are the inputs and outputs of the job, fields are its options. If a class has
no fields, the function of the job has no argument ``options``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from mrdamper.identify.temperature import Temperature
from mrdamper.schema import MORE, Option
from mrdamper.thermal.drawing import AIR_MAX_M_S

_DUTY = "sine:15mm:1Hz:2A:1800s"
_DESIGN = "Limits of the design"
_LIMIT = Option(group=_DESIGN, above=0.0, below=1e6, default_help="as in the geometry file")
_NETWORK_ONLY = Option(flag="--network-only", begins=False, group=_DESIGN)
_GIVEN = Option(default_help="the value of the geometry file")
_EXPORTS = (
    "C99 source, as an archive",
    "FMU for co-simulation",
    "force map (CSV) for simulators",
    "card and force map for MATLAB",
)


def _input(word: str, read: str, metavar: str, *places: str, **more: Any) -> Option:  # noqa: ANN401
    """Return the properties of a job input of the kind ``word``.

    ``read`` is the function that reads the file, as ``module:function`` in this package. A web form offers
    the files in the folders ``places``, but in the folder ``inputs`` only the files of this kind.
    """
    places = places or ("inputs",)
    looks = (word,) if "inputs" in places else ()
    return Option(word=word, read=f"mrdamper.{read}", metavar=metavar, places=places, looks=looks, **more)


# Properties of the inputs, by kind of input.
_CARD = _input("card", "models.card_schema:read_card", "CARD", "cards")
_RECORD = _input("record", "data.readers:read_file", "RECORD", "records", "runs")
_FLUID = _input("fluid", "models.fluids.fluid_file:find_fluid", "PRESET|FILE", offers="fluids")
_DRAWING = _input(
    "geometry", "thermal.drawing_file:read_drawing", "FILE|paper", offers="dampers", flag="--damper"
)
_SINK = _input("sink", "thermal.drawing_file:read_sink", "FILE", label="Heat sink")
_CYCLE = _input("duty", "thermal.duty:read_duty", "DUTY", files=".csv")
_CURVE = _input("curve", "thermal.estimation.measured_curve:read_curve", "CURVE.csv", files=".csv")
_RHEOMETER = _input("rheometer table", "data.rheometer:read_rheometer_tables", "TABLE.csv...", files=".csv")
_DAMPER = Option(offers="plants", looks=("damper",))
_PLANT = _input("plant", "jobs.track:read_plant", "PRESET|FILE|CARD", "inputs", "cards")
_PRESET = _input("virtual damper", "virtual_rig.damper:find_damper", "PRESET|FILE")
_CAMPAIGN = _input("campaign", "virtual_rig.campaign:find_campaign", "PRESET|FILE", offers="campaigns")
_SCENARIO = _input("scenario", "jobs.track:read_targets", "NAME|FILE", offers="targets")
_DATA_SET = Option(word="data set", metavar="NAME", argument=True, offers="data", label="Data set")
_PATHS = Option(metavar="PATH...", argument=True, key="files", places=("runs",), most_items=20_000)
_FILES = Option(read="mrdamper.jobs.inputs:read_files", reading=("channels", "answer"))
_LAW_READING = Option(read="mrdamper.jobs.inputs:read_card_of_law", reading=("law",))

# Additional properties for the inputs of single jobs.
_ONE_FLUID = Option(default_help="none", label="Fluid, if the runs have one temperature")
_TARGETS = Option(flag="--target", default_help="all", begins=("sine-900N-1Hz",), most_items=20)
_THERMAL_MODEL = Option(default_help="no thermal model", label="Geometry file for the thermal model")
_PAPER = Option(key="damper", label="Geometry file", default_help="paper", begins="paper")
_DRAWINGS = Option(read="mrdamper.jobs.sweep.plan:read_drawings", word="geometry file", most_items=20)
_ANY_SINK = Option(looks=("sink", "geometry"), group=MORE, default_help="the heat sink of the geometry file")
_TABLES = Option(argument=True, most_items=20, looks=("rheometer",), label="Rheometer tables")

# Types of inputs, outputs and options that several jobs have in common.
Card = Annotated[Path, _CARD, Option("Read this model card.", argument=True)]
CardOfAnyLaw = Annotated[Card, _LAW_READING]
Runs = Annotated[
    tuple[str, ...],
    _PATHS,
    Option("Read these runs: files, folders or patterns.", label="Runs", word="runs"),
    Option(read="mrdamper.jobs.inputs:read_dataset", reading=("channels", "answer", "flip_force")),
]
LoadCycle = Annotated[
    str,
    _CYCLE,
    Option("Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current."),
]
Preparing = Annotated[
    str | None,
    Option("Prepare the runs with these settings. None selects the settings of the job.", flag="-"),
]
LawName = Annotated[
    str | None, Option(metavar="LAW", default_help="auto", label="Hysteresis model", offers="laws")
]
OutputFile = Annotated[Path | None, Option(metavar="FILE", output=True)]
OutputFolder = Annotated[Path | None, Option(metavar="DIR", output=True)]
Processes = Annotated[int | None, Option(least=1, most=1024, default_help="all cores")]
Jobs = Annotated[
    Processes,
    Option("Use this number of parallel processes. The result does not depend on it.", local=True),
]
Posterior = Annotated[
    int,
    Option(least=0, most=100_000, label="Posterior samples", group=MORE),
    Option("Compute 90 % intervals with this number of posterior samples, which fit wrote next to the card."),
]
Seed = Annotated[int, Option("Use this seed of the random number generator.", least=0, group=MORE)]
Ambient = Annotated[float, Option(unit="degC", least=-50.0, most=100.0)]
AirSpeed = Annotated[float, Option(unit="m/s", least=0.0, most=AIR_MAX_M_S)]
Duration = Annotated[float, Option(above=0.0, most=1440.0)]
_LEVELS = Option(least_items=1, most_items=15, group=MORE)
Ambients = Annotated[tuple[Ambient, ...], _LEVELS, Option(unit="degC")]
AirSpeeds = Annotated[tuple[AirSpeed, ...], _LEVELS, Option(unit="m/s")]
Durations = Annotated[tuple[Duration, ...], Option(unit="min", most_items=8, flag="-", group=MORE)]
RunNames = Annotated[tuple[str, ...], Option(metavar="GLOB", most_items=20_000, offers="runs")]
Term = Literal[
    "friction", "mass", "viscosity", "thinning", "gas", "orifice", "bristles", "spread", "stribeck", "memory",
    "position", "curvature", "stiffness", "asymmetry", "flow-asymmetry", "gas-volume", "leak", "play",
    "creep", "bypass", "knee", "cavity", "follow", "none",
]  # fmt: skip
"""Terms of a hysteresis model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Options for reading inputs. Each input lists the accepted options as ``reading``."""

    law: Annotated[str | None, Option(metavar="FILE.py:CLASS", local=True)] = None
    """Load this Python class if the card was fitted with your own hysteresis model."""
    channels: Annotated[
        Path | None,
        Option(metavar="FILE", places=("inputs", "maps"), looks=("channels",), word="channel map"),
        Option(label="Channel map", default_help="the map in the folder of the runs, or the headers"),
    ] = None
    """Read the files with this channel map (TOML), which states the quantity and unit of each column."""
    answer: Annotated[
        tuple[str, ...],
        Option(metavar="ROLE.TOPIC=VALUE", label="Answers to open questions", most_items=100, group=MORE),
    ] = ()
    """State a fact that the files do not contain, for example force.unit=kN. Topics: unit, column, scale,
    value, rate, part. The answer lab_*:force.unit=kN is used only for files with such a name. Repeatable."""
    flip_force: Annotated[bool, Option(label="reverse the sign of the force", group=MORE)] = False
    """Reverse the sign of the force, for load cells with positive compression."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Inputs and options of ``check``."""

    files: ClassVar[Annotated[Runs, _FILES]]
    write_map: ClassVar[OutputFile] = None
    """Write the channel map that was used for the files to this file. Edit it, and pass it to --channels."""
    deep: Annotated[bool, Option(label="compare all runs with one model", group=MORE)] = False
    """Fit one model to all runs, and report runs that are inconsistent with the other runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """Inputs and options of ``evaluate``."""

    card: ClassVar[CardOfAnyLaw]
    runs: ClassVar[Runs]
    preparation: ClassVar[Preparing] = None
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Inputs and options of ``fit``."""

    runs: ClassVar[Runs]
    law: ClassVar[LawName] = None
    """Fit this hysteresis model: chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating,
    spencer, lugre, dahl, bingham, tanh, or a class as FILE.py:CLASS. The choice auto selects a model by
    cross-validation."""
    fluid: ClassVar[Annotated[str | None, _FLUID, _ONE_FLUID]] = None
    """Use the temperature dependence of this fluid if the runs have one temperature: paper, lord-mrf-132dg,
    or a fluid file. The card marks the dependence as assumed."""
    preparation: ClassVar[Preparing] = None
    settings: ClassVar[Annotated[str | None, Option(flag="-")]] = None
    """Use these numerical settings (FitSettings). None selects the default settings."""
    only: Annotated[RunNames, Option(label="Use only these runs", default_help="all runs", group=MORE)] = ()
    """Use only runs whose names match this pattern. Repeatable."""
    hold_out: Annotated[RunNames, Option(group="Hold out")] = ()
    """Exclude runs whose names match this pattern from the fit, and test the model on them. Repeatable."""
    posterior: Posterior = 0
    """Compute this number of posterior samples, for 90 % intervals of parameters and forces."""
    one_command: Annotated[bool, Option(label="accept runs at a single current", group=MORE)] = False
    """Accept runs that all have the same current. The model is then valid only for this current."""
    terms: Annotated[
        tuple[Term, ...] | None,
        Option(flag="--term", metavar="TERM", group=MORE),
        Option(default_help="friction, and thinning if the runs have several temperatures"),
    ] = None
    """Add a term to the model: friction, mass, viscosity, thinning or gas. The model chain also has orifice,
    bristles, spread, stribeck, memory, position, curvature, stiffness, asymmetry, flow-asymmetry, gas-volume,
    leak, play, creep, bypass, knee, cavity and follow. Use none for a model without terms. Repeatable."""
    temperature: Annotated[Temperature, Option(label="Temperature dependence")] = "auto"
    """Use this temperature dependence of the parameters. The choice auto is arrhenius if the runs have
    several temperatures, otherwise none."""
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions:
    """Inputs and options of ``compare``."""

    first: ClassVar[CardOfAnyLaw]
    """Read this card as the reference."""
    second: ClassVar[CardOfAnyLaw]
    """Compare this card with the reference."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesOptions:
    """Inputs and options of ``cycles``."""

    record: ClassVar[Annotated[Path, _RECORD, Option(argument=True, reading=("channels",))]]
    """Read this record."""
    least_stroke_mm: Annotated[
        float | None, Option(unit="mm", above=0.0, below=1e6, default_help="5 % of the displacement range")
    ] = None
    """Ignore cycles with a stroke below this value, in mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """Inputs and options of ``track``."""

    card: ClassVar[Card]
    plant: ClassVar[Annotated[str, _PLANT, _DAMPER, Option(label="Controlled damper")]] = "nominal"
    """Control this damper: a virtual damper such as nominal or hard, its TOML file, or a card (JSON)."""
    targets: ClassVar[Annotated[tuple[str, ...] | None, _SCENARIO, _TARGETS]] = None
    """Track this force: sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario file. Repeatable."""
    unaware: ClassVar[Annotated[Path | None, _CARD, Option(flag="-")]] = None
    """Add the controllers recommended-unaware and paper-unaware. They are designed from this card, which was
    fitted at one temperature."""
    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(flag="--temperature", unit="degC", default_help="20, 60, 100, 123", most_items=20),
        Option(label="Temperatures of the damper", group="Temperatures", begins=(20.0, 60.0)),
    ] = ()
    """Simulate the damper at this temperature, in degC. Repeatable."""
    rate_Hz: Annotated[float, Option(flag="-", unit="Hz", least=100.0, most=5000.0, group=MORE)] = 1000.0
    """Run the controllers at this sample rate, in Hz."""
    controllers: Annotated[
        tuple[str, ...],
        Option(flag="--controller", metavar="NAME", default_help="all controllers", most_items=40),
        Option(group="Controllers", offers="controllers", begins=("recommended", "paper")),
    ] = ()
    """Test this controller, such as recommended, recommended-causal or paper. Repeatable."""
    seed: Annotated[Seed, Option(flag="-", below=2**31)] = 1
    """Simulate each case twice: with this seed of the sensor noise, and with the next one."""
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Inputs and options of ``simulate``."""

    card: ClassVar[CardOfAnyLaw]
    motion: ClassVar[Annotated[str, Option(metavar="MOTION|RUN", argument=True)]]
    """Simulate this motion: MOTION:CURRENT:DURATION, such as sine:10mm:1Hz:1A:2s, or the file of a run."""
    temperature_degC: Annotated[float, Option(unit="degC", least=-60.0, most=200.0)] = 20.0
    """Use this fluid temperature, in degC, if the file of the run contains no temperature."""
    rate_Hz: Annotated[float, Option(unit="Hz", above=0.0, most=1e5)] = 1000.0
    """Sample a motion such as sine:10mm:1Hz:1A:2s at this rate, in Hz. A run keeps its own samples."""
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Inputs and options of ``export``."""

    card: ClassVar[Card]
    damper: ClassVar[Annotated[str | None, _DRAWING, _THERMAL_MODEL]] = None
    """Add the thermal model of this geometry file (TOML), which also detects a frozen temperature sensor."""
    c: ClassVar[OutputFolder] = None
    """Write C99 source code and its report to this folder."""
    fmu: ClassVar[OutputFile] = None
    """Write a co-simulation FMU (FMI 2.0) to this file."""
    table: ClassVar[OutputFile] = None
    """Write a force map (CSV) for simulators to this file."""
    matlab: ClassVar[OutputFolder] = None
    """Write card and force map for MATLAB to this folder."""
    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(flag="-", least_items=1, label="Files", group="Files", begins=("c", "fmu"), titles=_EXPORTS),
    ] = ("c", "fmu", "table")
    """Write C99 source code, an FMU, a force map (CSV), or a folder for MATLAB."""
    content: Annotated[
        Literal["model", "controller", "both"],
        Option(titles=("the model", "the controller", "model and controller")),
    ] = "both"
    """Export the model of the damper, its force controller, or both."""
    precision: Annotated[
        Literal["float", "double"], Option(label="Number type", titles=("float (32 bit)", "double (64 bit)"))
    ] = "float"
    """Use this floating-point type in the code."""
    period_s: Annotated[float, Option(unit="s", above=0.0, most=1.0, flag="--step", metavar="TIME")] = 1e-3
    """Generate code for this sampling period, such as 1ms or 500us."""
    controller: Annotated[str, Option(metavar="NAME", offers="controllers")] = "recommended"
    """Use this controller, such as recommended, recommended-causal or paper."""
    name: Annotated[str, Option(metavar="IDENT", label="Prefix of names")] = "damper"
    """Begin all names in the code with this prefix."""


class HeatingInputs:
    """Inputs of all jobs that simulate heating."""

    card: ClassVar[Card]
    drawing: ClassVar[Annotated[str, _DRAWING, _PAPER]]
    """Read the dimensions of the damper from this geometry file (TOML)."""
    duty: ClassVar[LoadCycle] = _DUTY


@dataclass(frozen=True, slots=True, kw_only=True)
class DerateOptions(HeatingInputs):
    """Inputs and options of ``derate``."""

    quantity: Annotated[
        Literal["current", "stroke", "duty"],
        Option(titles=("the current", "the stroke", "the share of time at work")),
    ] = "current"
    """Reduce this quantity: the current, the stroke, or the fraction of time with motion."""
    ambient_degC: Ambients = (-20.0, 0.0, 20.0, 40.0, 50.0)
    """Compute the limits at this ambient temperature, in degC. Repeatable, in rising order."""
    air_m_s: AirSpeeds = (0.0, 1.0, 2.0, 5.0, 10.0)
    """Compute the limits at this air speed, in m/s. Repeatable, in rising order."""
    duration_min: Durations = (5.0, 15.0, 30.0, 60.0)
    """Compute the limits for these durations, in min, in rising order, and for the steady state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions(HeatingInputs):
    """Inputs and options of ``heat``."""

    sink: ClassVar[Annotated[Path | None, _SINK, _ANY_SINK]] = None
    """Use the heat sink of this file (TOML table [sink])."""
    calibrate: ClassVar[
        Annotated[Path | None, _CURVE, Option(label="Measured curve for calibration", group=MORE)]
    ] = None
    """Adjust the thermal model to a measured heating curve of the same load cycle. The CSV file has two
    columns: time_s, and fluid_degC, body_degC or coil_degC."""
    past_limit: Annotated[bool, Option(flag="-", label="continue past the limit of the fluid")] = False
    """Continue the simulation after the mean fluid temperature has reached its limit."""
    model: Annotated[
        Literal["reduced", "network", "lumped"],
        Option(titles=("reduced finite elements", "three axial zones", "the paper's one node"), group=MORE),
    ] = "reduced"
    """Use this thermal model: reduced finite elements, a network of three axial zones, or one lumped node."""
    start_degC: Annotated[
        float | None,
        Option(unit="degC", least=-40.0, most=370.0, default_help="ambient"),
        Option(label="Temperature at the start", group=MORE),
    ] = None
    """Start with this temperature of all parts, in degC."""
    ambient_degC: Annotated[Ambient | None, _GIVEN, Option(begins=20.0)] = None
    """Use this ambient temperature, in degC."""
    air_m_s: Annotated[AirSpeed | None, _GIVEN, Option(label="Air speed")] = None
    """Use this air speed, in m/s."""
    with_sink: Annotated[
        bool, Option(flag="-", label="with the heat sink of the geometry file", part="sink")
    ] = True
    """Use the heat sink of the geometry file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatsinkOptions(HeatingInputs):
    """Inputs and options of ``heatsink``. Default limits are from the geometry file."""

    span_mm: Annotated[float | None, _LIMIT, Option(unit="mm", label="Length")] = None
    """Limit the length of the finned body, in mm."""
    width_mm: Annotated[float | None, _LIMIT, Option(unit="mm")] = None
    """Limit the radial width of the fins, in mm."""
    mass_g: Annotated[float | None, _LIMIT, Option(unit="g")] = None
    """Limit the total mass of the fins, in g."""
    materials: Annotated[
        tuple[str, ...],
        Option(flag="--material", metavar="NAME", default_help="the material of the geometry file"),
        Option(label="Material", group=_DESIGN, offers="materials"),
    ] = ()
    """Allow this material: aluminium-alloy, copper, steel, stainless-steel. Repeatable."""
    members: Annotated[int, Option(least=2, most=200, flag="-", label="Designs shown", group=MORE)] = 12
    """Show this number of designs of the Pareto front, and verify them with finite elements."""
    by_field: Annotated[bool, _NETWORK_ONLY, Option(label="verify with finite elements (slow)")] = True
    """Evaluate designs only with the fast network of axial zones, without finite elements. In Python:
    by_field=False."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FluidOptions:
    """Inputs and options of ``fluid``."""

    tables: ClassVar[Annotated[tuple[str, ...], _RHEOMETER, _TABLES]]
    """Read these rheometer tables."""
    like: ClassVar[Annotated[str, _FLUID, Option(label="Other properties from")]] = "paper"
    """Use this fluid for properties that are missing in the tables: paper, lord-mrf-132dg, or a fluid file
    (TOML)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Inputs and options of ``rig``."""

    preset: ClassVar[Annotated[str, _PRESET, _DAMPER, Option(label="Damper")]] = "nominal"
    """Test this virtual damper: a preset, or a TOML file with a preset and changed parameters."""
    campaign: ClassVar[
        Annotated[str | None, _CAMPAIGN, Option(default_help="the campaign of the damper", begins="short")]
    ] = None
    """Run this campaign of motions, currents and temperatures: short, or a TOML file."""
    draw: Annotated[
        int | None,
        Option(metavar="SEED", least=0, below=2**31, default_help="not randomised"),
        Option(label="Seed of a randomised damper", group=MORE),
    ] = None
    """Change all parameters of the damper at random by up to 30 %, with this seed. Even seeds were used to
    develop mrdamper, and odd seeds for its published results."""
    seed: Annotated[Seed, Option(below=2**31)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DataListOptions:
    """The job ``data list`` has no inputs and no options."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFetchOptions:
    """Inputs and options of ``data fetch``."""

    name: ClassVar[Annotated[str, _DATA_SET]]
    """Fetch the data set with this name. The command data list prints the names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Inputs and options of ``demo``."""

    quick: Annotated[bool, Option(label="fewer and shorter runs", begins=True)] = False
    """Use fewer and shorter runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Inputs and options of ``sweep``."""

    campaigns: ClassVar[
        Annotated[tuple[str, ...] | None, _PATHS, Option(label="Campaigns to fit", word="campaigns")]
    ] = None
    """Fit a model to each of these files, folders or patterns."""
    card: ClassVar[Annotated[Path | None, _CARD, Option(default_help="none")]] = None
    """Use this model card for random dampers and heat sinks."""
    dampers: ClassVar[
        Annotated[tuple[str, ...] | None, _DRAWING, _DRAWINGS, Option(label="Dampers with a heat sink")]
    ] = None
    """Optimise the heat sink of this damper: paper, or a geometry file. Repeatable."""
    duty: ClassVar[LoadCycle] = _DUTY
    law: ClassVar[LawName] = None
    """Fit this hysteresis model."""
    samples: Annotated[
        int | None, Option(least=1, most=100_000, default_help="no random dampers", label="Random dampers")
    ] = None
    """Test the controllers of the card on this number of random dampers."""
    spread_percent: Annotated[
        float, Option(flag="-", unit="%", least=0.0, most=30.0, label="Spread of random dampers")
    ] = 10.0
    """Change the parameters of random dampers by at most this percentage of the nominal values."""
    seed: Annotated[Seed, Option(flag="-", most=10_000_000)] = 0
    workers: Annotated[Processes, Option(metavar="NUMBER", label="Processes")] = None
    """Use this number of processes on this computer."""
    scheduler: Annotated[str | None, Option(metavar="tcp://HOST:PORT", local=True)] = None
    """Run the tasks on the workers of the Dask scheduler at this address."""
