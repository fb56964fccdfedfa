"""Inputs, options and outputs of every job: one declaration for all interfaces.

Commands and their help, requests and forms of the server, Python functions and tables of the documentation
are generated from these classes. The text below a field is its help. The classes of the job ``heat`` are
``HeatInputs``, ``HeatOptions`` and ``HeatOutputs``. If a class does not exist, the job has no such fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from mrdamper.identify.temperature import Temperature
from mrdamper.schema import Option
from mrdamper.thermal.drawing import AIR_MAX_M_S

_JOBS_HELP = "Use this number of parallel processes. The result does not depend on it."
_POSTERIOR_HELP = "Compute 90 % intervals with this number of posterior samples from the folder of the card."
_CARD_HELP = "Read this model card."
_RUNS_HELP = "Read these runs: files, folders or patterns."
_PREPARATION_HELP = "Prepare the runs with these settings. None selects the settings of the job."
_DUTY = "sine:15mm:1Hz:2A:1800s"
_DUTY_HELP = "Apply this load cycle: MOTION:CURRENT:DURATION, or a CSV file with time, motion and current."

_GIVEN = "the value of the geometry file"
_DESIGN = "Limits of the design"

Jobs = Annotated[int | None, Option(_JOBS_HELP, least=1, most=1024, default_help="all cores", local=True)]
"""Number of processes of a job that uses a pool (``runtime.pool``)."""

Posterior = Annotated[int, Option(_POSTERIOR_HELP, least=0, most=100_000, label="Posterior samples")]
"""Number of posterior samples of a job that predicts from a card (``models.card_draws``)."""


Term = Literal[
    "friction", "mass", "viscosity", "thinning", "gas", "orifice", "bristles", "spread", "stribeck", "memory",
    "position", "curvature", "stiffness", "asymmetry", "flow-asymmetry", "gas-volume", "leak", "play",
    "follow", "none",
]  # fmt: skip
"""Terms of a hysteresis model."""

Card = Annotated[Path, Option(_CARD_HELP, kind="card", argument=True)]
CardOfAnyLaw = Annotated[Path, Option(_CARD_HELP, kind="card of any law", argument=True)]
Paths = Annotated[tuple[str, ...], Option(_RUNS_HELP, kind="runs", label="Runs", argument=True)]
Preparing = Annotated[str | None, Option(_PREPARATION_HELP, kind="preparation", flag="-")]
LoadCycle = Annotated[str, Option(_DUTY_HELP, kind="duty")]
"""Inputs of several jobs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MapReading:
    """Options for reading a single record."""

    channels: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            default_help="the map in the folder of the runs, or the headers",
            label="Channel map",
            group="",
            places=("inputs", "maps"),
            files=".toml",
            looks=("channels",),
            word="channel map",
        ),
    ] = None
    """Read columns with this channel map (TOML), which assigns them to quantities."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading(MapReading):
    """Options for reading files of runs without conversion."""

    answer: Annotated[
        tuple[str, ...], Option(metavar="ROLE.TOPIC=VALUE", label="Answers to open questions", most_items=100)
    ] = ()
    """Answer a question that a file leaves open, for example force.unit=kN. Topics: unit, column, scale,
    value, rate, part. A pattern of names and a colon before it select files. Repeatable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading(FilesReading):
    """Options for reading runs."""

    flip_force: Annotated[bool, Option(label="reverse the sign of the force")] = False
    """Reverse the sign of the force, for load cells with positive compression."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LawReading:
    """Options for reading a card that can have a hysteresis model of the user."""

    law: Annotated[str | None, Option(metavar="FILE.py:CLASS", local=True)] = None
    """Load this class, if the card was fitted with a hysteresis model of your own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nothing:
    """Empty class for a job that has no inputs, no options or no outputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckInputs:
    """Inputs of ``check``."""

    files: Annotated[tuple[str, ...], Option(_RUNS_HELP, kind="files", label="Runs", argument=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Options of ``check``."""

    deep: Annotated[bool, Option(label="compare all runs with one model")] = False
    """Fit one model to all runs, and report runs that are inconsistent with the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOutputs:
    """Outputs of ``check``."""

    write_map: Annotated[Path | None, Option(metavar="FILE")] = None
    """Write the channel map with which the files were read. It can be edited and used with --channels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateInputs:
    """Inputs of ``evaluate``."""

    card: CardOfAnyLaw
    runs: Paths
    preparation: Preparing = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """Options of ``evaluate``."""

    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitInputs:
    """Inputs of ``fit``."""

    runs: Paths
    law: Annotated[str | None, Option(kind="law", default_help="auto", label="Hysteresis model")] = None
    """Fit this hysteresis model: chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating,
    spencer, lugre, dahl, bingham, tanh, or a class as FILE.py:CLASS. The choice auto selects a model by
    cross-validation."""
    fluid: Annotated[
        str | None, Option(kind="fluid", default_help="none", label="Fluid, if the runs have one temperature")
    ] = None
    """Take the temperature dependence from a fluid: paper, lord-mrf-132dg, or a fluid file. The card marks it
    as assumed."""
    preparation: Preparing = None
    settings: Annotated[str | None, Option(kind="settings", flag="-")] = None
    """Use these numerical settings (FitSettings). None selects the default settings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options of ``fit``."""

    only: Annotated[
        tuple[str, ...],
        Option(
            metavar="GLOB",
            label="Use only these runs",
            default_help="all runs",
            most_items=20_000,
            offers="runs",
        ),
    ] = ()
    """Use only runs whose names match this pattern. Repeatable."""
    hold_out: Annotated[
        tuple[str, ...], Option(metavar="GLOB", most_items=20_000, group="Hold out", offers="runs")
    ] = ()
    """Exclude runs whose names match this pattern, and use them as a test. Repeatable."""
    posterior: Annotated[int, Option(least=0, most=100_000, label="Posterior samples")] = 0
    """Compute this number of posterior samples, for 90 % intervals of parameters and forces."""
    one_command: Annotated[bool, Option(label="accept runs with a single current")] = False
    """Accept runs with a single current. The model is then valid only for this current."""
    terms: Annotated[
        tuple[Term, ...] | None,
        Option(
            flag="--term",
            metavar="TERM",
            default_help="friction, and thinning if the runs have several temperatures",
        ),
    ] = None
    """Add a term to the model: friction, mass, viscosity, thinning or gas. The model chain also has orifice,
    bristles, spread, stribeck, memory, position, curvature, stiffness, asymmetry, flow-asymmetry, gas-volume,
    leak, play and follow. Use none for a model without terms. Repeatable."""
    temperature: Annotated[Temperature, Option(label="Temperature dependence", group="")] = "auto"
    """Use this temperature dependence of the parameters. The choice auto is arrhenius if the runs have
    several temperatures."""
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareInputs:
    """Inputs of ``compare``."""

    first: Annotated[Path, Option(kind="card of any law", argument=True, in_answer=False)]
    """Read this card as the reference."""
    second: Annotated[Path, Option(kind="card of any law", argument=True, in_answer=False)]
    """Compare this card with the reference."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesInputs:
    """Inputs of ``cycles``."""

    record: Annotated[Path, Option(kind="record", argument=True)]
    """Read this record."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesOptions:
    """Options of ``cycles``."""

    least_stroke_mm: Annotated[
        float | None,
        Option(unit="mm", above=0.0, below=1e6, group="", default_help="5 % of the displacement range"),
    ] = None
    """Ignore cycles with a smaller stroke, in mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackInputs:
    """Inputs of ``track``."""

    card: Card
    plant: Annotated[str, Option(kind="plant", label="Controlled damper")] = "nominal"
    """Control this damper: nominal, hard, stiff, ..., a file of a virtual damper (TOML), or a card (JSON)."""
    targets: Annotated[
        tuple[str, ...] | None,
        Option(kind="scenario", flag="--target", default_help="all", begins=("sine-900N-1Hz",)),
    ] = None
    """Track this target: sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario file. Repeatable."""
    unaware: Annotated[Path | None, Option(kind="card", flag="-")] = None
    """Add the controllers recommended-unaware and paper-unaware from this card, which was fitted at one
    temperature."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """Options of ``track``."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            flag="--temperature",
            unit="degC",
            label="Temperatures of the damper",
            group="Temperatures",
            begins=(20.0, 60.0),
            default_help="20, 60, 100, 123",
            most_items=20,
        ),
    ] = ()
    """Simulate the damper at this temperature, in degC. Repeatable."""
    rate_Hz: Annotated[float, Option(flag="-", unit="Hz", least=100.0, most=5000.0)] = 1000.0
    """Run the controllers at this sample rate, in Hz."""
    controllers: Annotated[
        tuple[str, ...],
        Option(
            flag="--controller",
            metavar="NAME",
            default_help="all controllers",
            most_items=40,
            group="Controllers",
            offers="controllers",
            begins=("recommended", "paper"),
        ),
    ] = ()
    """Test this controller: recommended, recommended-causal, paper, ... Repeatable."""
    seed: Annotated[int, Option(flag="-", least=0, below=2**31)] = 1
    """Use this seed and the next one for the sensor noise."""
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateInputs:
    """Inputs of ``simulate``."""

    card: CardOfAnyLaw
    motion: Annotated[str, Option(kind="motion", argument=True)]
    """Simulate this motion: MOTION:CURRENT:DURATION, such as sine:10mm:1Hz:1A:2s, or the file of a run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Options of ``simulate``."""

    temperature_degC: Annotated[float, Option(unit="degC", least=-60.0, most=200.0)] = 20.0
    """Use this fluid temperature, in degC, if the motion has none."""
    rate_Hz: Annotated[float, Option(unit="Hz", above=0.0, most=1e5)] = 1000.0
    """Sample the motion at this rate, in Hz, if it is given as text."""
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportInputs:
    """Inputs of ``export``."""

    card: Card
    damper: Annotated[
        str | None,
        Option(kind="drawing", default_help="no thermal model", label="Geometry file for the thermal model"),
    ] = None
    """Add the thermal model of this geometry file (TOML), which also detects a frozen temperature sensor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOutputs:
    """Outputs of ``export``."""

    c: Annotated[Path | None, Option(metavar="DIR")] = None
    """Write C99 source code and its report to this folder."""
    fmu: Annotated[Path | None, Option(metavar="FILE")] = None
    """Write a co-simulation FMU (FMI 2.0) to this file."""
    table: Annotated[Path | None, Option(metavar="FILE")] = None
    """Write a force map (CSV) for simulators to this file."""
    matlab: Annotated[Path | None, Option(metavar="DIR")] = None
    """Write card and force map for MATLAB to this folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(
            flag="-",
            least_items=1,
            label="Files",
            group="Files",
            titles=(
                "C99 source, as an archive",
                "FMU for co-simulation",
                "force map (CSV) for simulators",
                "card and force map for MATLAB",
            ),
            begins=("c", "fmu"),
        ),
    ] = ("c", "fmu", "table")
    """Write C99 source code, an FMU, a force map (CSV), or a folder for MATLAB."""
    content: Annotated[
        Literal["model", "controller", "both"],
        Option(group="", titles=("the model", "the controller", "model and controller")),
    ] = "both"
    """Export the model of the damper, its force controller, or both."""
    precision: Annotated[
        Literal["float", "double"],
        Option(label="Number type", group="", titles=("float (32 bit)", "double (64 bit)")),
    ] = "float"
    """Use this floating-point type in the code."""
    period_s: Annotated[
        float, Option(unit="s", above=0.0, most=1.0, flag="--step", metavar="TIME", group="")
    ] = 1e-3
    """Call the code with this period, such as 1ms or 500us."""
    controller: Annotated[str, Option(metavar="NAME", group="", offers="controllers")] = "recommended"
    """Use this controller: recommended, recommended-causal, paper, ..."""
    name: Annotated[str, Option(metavar="IDENT", label="Prefix of names", group="")] = "damper"
    """Put this prefix before all names in the code."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DerateInputs:
    """Inputs of ``derate``."""

    card: Card
    drawing: Annotated[
        str,
        Option(kind="drawing", flag="--damper", key="damper", default_help="paper", label="Geometry file"),
    ]
    """Read the dimensions of the damper from this geometry file (TOML)."""
    duty: LoadCycle = _DUTY


@dataclass(frozen=True, slots=True, kw_only=True)
class DerateOptions:
    """Options of ``derate``."""

    quantity: Annotated[
        Literal["current", "stroke", "duty"],
        Option(group="", titles=("the current", "the stroke", "the share of time at work")),
    ] = "current"
    """Reduce this quantity: the current, the stroke, or the fraction of time with motion."""
    ambient_degC: Annotated[
        tuple[Annotated[float, Option(least=-50.0, most=100.0)], ...],
        Option(unit="degC", least_items=1, most_items=15),
    ] = (-20.0, 0.0, 20.0, 40.0, 50.0)
    """Compute the limits at these ambient temperatures, in degC, in rising order."""
    air_m_s: Annotated[
        tuple[Annotated[float, Option(least=0.0, most=AIR_MAX_M_S)], ...],
        Option(unit="m/s", least_items=1, most_items=15),
    ] = (0.0, 1.0, 2.0, 5.0, 10.0)
    """Compute the limits at these air speeds, in m/s, in rising order."""
    duration_min: Annotated[
        tuple[Annotated[float, Option(above=0.0, most=1440.0)], ...],
        Option(unit="min", most_items=8, flag="-"),
    ] = (5.0, 15.0, 30.0, 60.0)
    """Compute the limits for these durations, in min, in rising order, and for the steady state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatInputs(DerateInputs):
    """Inputs of ``heat``."""

    sink: Annotated[
        Path | None, Option(kind="sink", default_help="the heat sink of the geometry file", label="Heat sink")
    ] = None
    """Use the heat sink of this file (TOML table [sink])."""
    calibrate: Annotated[Path | None, Option(kind="curve", label="Measured curve for calibration")] = None
    """Calibrate the geometry file with a measured heating curve of the same load cycle. The CSV file has the
    columns time_s and fluid_degC, body_degC or coil_degC."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Options of ``heat``."""

    past_limit: Annotated[bool, Option(flag="-", label="continue past the limit of the fluid", group="")] = (
        False
    )
    """Continue the simulation after the mean fluid temperature has reached its limit."""
    model: Annotated[
        Literal["reduced", "network", "lumped"],
        Option(titles=("reduced finite elements", "three axial zones", "the paper's one node")),
    ] = "reduced"
    """Use this thermal model: reduced finite elements, a network of three axial zones, or one lumped node."""
    start_degC: Annotated[
        float | None,
        Option(
            unit="degC", least=-40.0, most=370.0, default_help="ambient", label="Temperature at the start"
        ),
    ] = None
    """Start with this temperature of all parts, in degC."""
    ambient_degC: Annotated[
        float | None,
        Option(
            unit="degC",
            least=-50.0,
            most=100.0,
            default_help=_GIVEN,
            group="",
            begins=20.0,
            slider=(-30.0, 60.0, 1.0),
        ),
    ] = None
    """Use this ambient temperature, in degC."""
    air_m_s: Annotated[
        float | None,
        Option(
            unit="m/s",
            least=0.0,
            most=AIR_MAX_M_S,
            default_help=_GIVEN,
            label="Air speed",
            group="",
            slider=(0.0, 20.0, 0.5),
        ),
    ] = None
    """Use this air speed, in m/s."""
    with_sink: Annotated[
        bool, Option(flag="-", label="with the heat sink of the geometry file", group="", part="sink")
    ] = True
    """Use the heat sink of the geometry file."""


def _limit(unit: str, label: str = "") -> Option:
    """Return the declaration of an option that limits the size of the heat sink."""
    return Option(
        unit=unit, label=label, group=_DESIGN, above=0.0, below=1e6, default_help="the drawing's sink's"
    )


class HeatsinkInputs(DerateInputs):
    """Inputs of ``heatsink``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatsinkOptions:
    """Options of ``heatsink``. Default limits are the dimensions of the heat sink in the geometry file."""

    span_mm: Annotated[float | None, _limit("mm", label="Length")] = None
    """Limit the length of the finned body, in mm."""
    width_mm: Annotated[float | None, _limit("mm")] = None
    """Limit the radial width of the fins, in mm."""
    mass_g: Annotated[float | None, _limit("g")] = None
    """Limit the total mass of the fins, in g."""
    materials: Annotated[
        tuple[str, ...],
        Option(
            flag="--material",
            metavar="NAME",
            label="Material",
            default_help="the material of the geometry file",
            group=_DESIGN,
            offers="materials",
        ),
    ] = ()
    """Allow this material: aluminium-alloy, copper, steel, stainless-steel. Repeatable."""
    members: Annotated[int, Option(least=2, most=200, flag="-", label="Designs on the front")] = 12
    """Show this number of designs of the Pareto front, and verify them with finite elements."""
    by_field: Annotated[
        bool,
        Option(
            flag="--network-only", label="verify with finite elements (slow)", group=_DESIGN, begins=False
        ),
    ] = True
    """Evaluate the designs only with the fast zone network, without finite elements."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FluidInputs:
    """Inputs of ``fluid``."""

    tables: Annotated[
        tuple[str, ...],
        Option(kind="rheometer table", label="Rheometer tables", argument=True, in_answer=True),
    ]
    """Read these rheometer tables."""
    like: Annotated[str, Option(kind="fluid", label="Other properties from")] = "paper"
    """Take properties that the tables do not have from this fluid: paper, lord-mrf-132dg, or a fluid file
    (TOML)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigInputs:
    """Inputs of ``rig``."""

    preset: Annotated[str, Option(kind="virtual damper", label="Damper")] = "nominal"
    """Test this virtual damper: a preset, or a TOML file with a preset and changed parameters."""
    campaign: Annotated[
        str | None, Option(kind="campaign", default_help="the campaign of the damper", begins="short")
    ] = None
    """Run this campaign of motions, currents and temperatures: short, or a TOML file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Options of ``rig``."""

    draw: Annotated[
        int | None,
        Option(
            metavar="SEED",
            least=0,
            below=2**31,
            default_help="not randomised",
            label="Seed of a randomised damper",
        ),
    ] = None
    """Randomise the parameters of the damper within 30 % with this seed. Models are developed with even
    seeds, and results are reported with odd seeds."""
    seed: Annotated[int, Option(least=0, below=2**31)] = 0
    """Use this seed of the random number generator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DataFetchInputs:
    """Inputs of ``data fetch``."""

    name: Annotated[str, Option(kind="name", argument=True)]
    """Fetch the data set with this name. The command data list prints the names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Options of ``demo``."""

    quick: Annotated[bool, Option(label="fewer and shorter runs", group="", begins=True)] = False
    """Use fewer and shorter runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepInputs:
    """Inputs of ``sweep``."""

    campaigns: Annotated[
        tuple[str, ...] | None, Option(kind="campaigns", label="Campaigns to fit", argument=True)
    ] = None
    """Fit a model to each of these files, folders or patterns."""
    card: Annotated[Path | None, Option(_CARD_HELP, kind="card", default_help="none")] = None
    dampers: Annotated[
        tuple[str, ...] | None, Option(kind="drawings", flag="--damper", label="Dampers with a heat sink")
    ] = None
    """Optimise the heat sink of this damper: paper, or a geometry file. Repeatable."""
    duty: LoadCycle = _DUTY
    law: Annotated[str | None, Option(kind="law", default_help="auto", label="Hysteresis model")] = None
    """Fit this hysteresis model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    samples: Annotated[
        int | None,
        Option(least=1, most=100_000, group="", default_help="no random dampers", label="Random dampers"),
    ] = None
    """Test the controllers of the card on this number of random dampers."""
    spread_percent: Annotated[
        float, Option(flag="-", unit="%", least=0.0, most=30.0, group="", label="Spread of random dampers")
    ] = 10.0
    """Limit the deviation of random parameters from the nominal ones, in percent."""
    seed: Annotated[int, Option(flag="-", least=0, most=10_000_000)] = 0
    """Use this seed of the random number generator."""
    workers: Annotated[
        int | None,
        Option(metavar="NUMBER", least=1, most=1024, group="", default_help="all cores", label="Processes"),
    ] = None
    """Use this number of processes on this computer."""
    scheduler: Annotated[str | None, Option(metavar="tcp://HOST:PORT", local=True)] = None
    """Run the tasks on the workers of the Dask scheduler at this address."""


def class_of(job: str, part: str) -> type:
    """Return the class that declares the inputs, options or outputs (``part``) of a job."""
    found: type = globals().get(f"{job.title().replace(' ', '')}{part}", Nothing)
    return found
