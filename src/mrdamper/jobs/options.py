"""The options of every job and of reading its inputs: one declaration for all interfaces.

Commands and their help, requests and forms of the server, Python functions and tables of the documentation
are made from these classes. Only light modules are imported here, because the help must appear at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from mrdamper.schema import OnPage, Option
from mrdamper.thermal.drawing import AIR_MAX_M_S

TOP = OnPage(group="")

Jobs = Annotated[
    int | None,
    Option(
        "Use this number of parallel processes. The result does not depend on it.",
        least=1,
        most=1024,
        metavar="NUMBER",
        default_help="all cores",
        local=True,
    ),
]
"""Of a job that gives its work to a pool (``runtime.pool``)."""


Posterior = Annotated[
    int,
    Option(
        "Compute 90 % intervals with this number of posterior samples from the folder of the card.",
        least=0,
        most=100_000,
        metavar="NUMBER",
        label="Posterior samples",
    ),
]
"""Of a job that predicts from a card (``models.card_draws``)."""


Channels = Annotated[
    Path | None,
    Option(
        "Read columns with this channel map (TOML), which assigns them to quantities.",
        metavar="FILE",
        default_help="the map in the folder of the runs, or the headers",
        label="Channel map",
        page=OnPage(
            group="", places=("inputs", "maps"), files=".toml", looks=("channels",), word="channel map"
        ),
    ),
]


Answers = Annotated[
    tuple[str, ...],
    Option(
        "Answer a question that a file leaves open, for example force.unit=kN. Topics: unit, "
        "column, scale, value, rate, part. A pattern of names and a colon before it select "
        "files. Repeatable.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to open questions",
        most_items=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapReading:
    """Options for reading one record."""

    channels: Channels = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading(MapReading):
    """Options for reading files of runs without conversion."""

    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading(FilesReading):
    """Options for reading runs."""

    flip_force: Annotated[
        bool,
        Option(
            "Reverse the sign of the force, for load cells with positive compression.",
            label="reverse the sign of the force",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LawReading:
    """Options for reading a card that can have a hysteresis model of the user."""

    law: Annotated[
        str | None,
        Option(
            "Load this class, if the card was fitted with a hysteresis model of your own.",
            metavar="FILE.py:CLASS",
            local=True,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """Options of a job that has only options for reading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Options of ``check``."""

    deep: Annotated[
        bool,
        Option(
            "Fit one model to all runs, and report runs that are inconsistent with the others.",
            label="compare all runs with one model",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """Options of ``evaluate``."""

    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options of ``fit``."""

    only: Annotated[
        tuple[str, ...],
        Option(
            "Use only runs whose names match this pattern. Repeatable.",
            metavar="GLOB",
            label="Use only these runs",
            default_help="all cores",
            most_items=20_000,
            page=OnPage(offers="runs"),
        ),
    ] = ()
    hold_out: Annotated[
        tuple[str, ...],
        Option(
            "Exclude runs whose names match this pattern, and use them as a test. Repeatable.",
            metavar="GLOB",
            label="Hold out",
            most_items=20_000,
            page=OnPage(group="Hold out", offers="runs"),
        ),
    ] = ()
    posterior: Annotated[
        int,
        Option(
            "Compute this number of posterior samples, for 90 % intervals of parameters and forces.",
            least=0,
            most=100_000,
            metavar="NUMBER",
            label="Posterior samples",
        ),
    ] = 0
    one_command: Annotated[
        bool,
        Option(
            "Accept runs with a single current. The model is then valid only for this current.",
            label="accept runs with a single current",
        ),
    ] = False
    terms: Annotated[
        tuple[
            Literal[
                "friction",
                "mass",
                "viscosity",
                "thinning",
                "gas",
                "orifice",
                "bristles",
                "spread",
                "stribeck",
                "memory",
                "position",
                "curvature",
                "stiffness",
                "asymmetry",
                "flow-asymmetry",
                "gas-volume",
                "leak",
                "play",
                "follow",
                "none",
            ],
            ...,
        ]
        | None,
        Option(
            "Add a term to the model: friction, mass, viscosity, thinning or gas. The model chain "
            "also has orifice, bristles, spread, stribeck, memory, position, curvature, stiffness, "
            "asymmetry, flow-asymmetry, gas-volume, leak, play and follow. Use none for a model "
            "without terms. Repeatable.",
            flag="--term",
            metavar="TERM",
            default_help="friction, and thinning if the runs have several temperatures",
            label="Terms",
        ),
    ] = None
    temperature: Annotated[
        Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"],
        Option(
            "Use this temperature dependence of the parameters. The choice auto is arrhenius if the"
            " runs have several temperatures.",
            label="Temperature dependence",
            page=TOP,
        ),
    ] = "auto"
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesOptions:
    """Options of ``cycles``."""

    least_stroke_mm: Annotated[
        float | None,
        Option(
            "Ignore cycles with a smaller stroke, in mm.",
            unit="mm",
            above=0.0,
            below=1e6,
            metavar="MM",
            page=TOP,
            default_help="5 % of the displacement range",
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """Options of ``track``."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Simulate the damper at this temperature, in degC. Repeatable.",
            flag="--temperature",
            metavar="DEGC",
            unit="degC",
            label="Temperatures of the damper",
            page=OnPage(group="Temperatures", begins=(20.0, 60.0)),
            default_help="20, 60, 100, 123",
            most_items=20,
        ),
    ] = ()
    rate_Hz: Annotated[
        float,
        Option(
            "Run the controllers at this sample rate, in Hz.", flag="-", unit="Hz", least=100.0, most=5000.0
        ),
    ] = 1000.0
    controllers: Annotated[
        tuple[str, ...],
        Option(
            "Test this controller: recommended, recommended-causal, paper, ... Repeatable.",
            flag="--controller",
            metavar="NAME",
            default_help="all cores",
            most_items=40,
            label="Controllers",
            page=OnPage(group="Controllers", offers="controllers", begins=("recommended", "paper")),
        ),
    ] = ()
    seed: Annotated[
        int,
        Option("Use this seed and the next one for the sensor noise.", flag="-", least=0, below=2**31),
    ] = 1
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Options of ``simulate``."""

    temperature_degC: Annotated[
        float,
        Option(
            "Use this fluid temperature, in degC, if the motion has none.",
            unit="degC",
            least=-60.0,
            most=200.0,
        ),
    ] = 20.0
    rate_Hz: Annotated[
        float,
        Option(
            "Sample the motion at this rate, in Hz, if it is given as text.", unit="Hz", above=0.0, most=1e5
        ),
    ] = 1000.0
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(
            "Write C99 source code, an FMU, a force map (CSV), or a folder for MATLAB.",
            flag="-",
            least_items=1,
            label="Files",
            page=OnPage(
                group="Files",
                titles=(
                    "C99 source, as an archive",
                    "FMU for co-simulation",
                    "force map (CSV) for simulators",
                    "card and force map for MATLAB",
                ),
                begins=("c", "fmu"),
            ),
        ),
    ] = ("c", "fmu", "table")
    content: Annotated[
        Literal["model", "controller", "both"],
        Option(
            "Export the model of the damper, its force controller, or both.",
            label="Content",
            page=OnPage(group="", titles=("the model", "the controller", "model and controller")),
        ),
    ] = "both"
    precision: Annotated[
        Literal["float", "double"],
        Option(
            "Use this floating-point type in the code.",
            label="Number type",
            page=OnPage(group="", titles=("float (32 bit)", "double (64 bit)")),
        ),
    ] = "float"
    period_s: Annotated[
        float,
        Option(
            "Call the code with this period, such as 1ms or 500us.",
            unit="s",
            above=0.0,
            most=1.0,
            flag="--step",
            metavar="TIME",
            page=TOP,
        ),
    ] = 1e-3
    controller: Annotated[
        str,
        Option(
            "Use this controller: recommended, recommended-causal, paper, ...",
            metavar="NAME",
            label="Controller",
            page=OnPage(group="", offers="controllers"),
        ),
    ] = "recommended"
    name: Annotated[
        str,
        Option(
            "Put this prefix before all names in the code.",
            metavar="IDENT",
            label="Prefix of names",
            page=TOP,
        ),
    ] = "damper"


_BUILT = OnPage(group="Limits of the design")
_DRAWN = "the drawing's sink's"


def _size(text: str, label: str, unit: str = "mm") -> Option:
    """Return the option of a limit of the heat sink's size."""
    return Option(text, label=label, page=_BUILT, unit=unit, above=0.0, below=1e6, default_help=_DRAWN)


@dataclass(frozen=True, slots=True, kw_only=True)
class DerateOptions:
    """Options of ``derate``."""

    quantity: Annotated[
        Literal["current", "stroke", "duty"],
        Option(
            "Reduce this quantity: the current, the stroke, or the fraction of time with motion.",
            page=OnPage(group="", titles=("the current", "the stroke", "the share of time at work")),
        ),
    ] = "current"
    ambient_degC: Annotated[
        tuple[Annotated[float, Option(least=-50.0, most=100.0)], ...],
        Option(
            "Compute the limits at these ambient temperatures, in degC, in rising order.",
            unit="degC",
            least_items=1,
            most_items=15,
        ),
    ] = (-20.0, 0.0, 20.0, 40.0, 50.0)
    air_m_s: Annotated[
        tuple[Annotated[float, Option(least=0.0, most=AIR_MAX_M_S)], ...],
        Option(
            "Compute the limits at these air speeds, in m/s, in rising order.",
            unit="m/s",
            least_items=1,
            most_items=15,
        ),
    ] = (0.0, 1.0, 2.0, 5.0, 10.0)
    duration_min: Annotated[
        tuple[Annotated[float, Option(above=0.0, most=1440.0)], ...],
        Option(
            "Compute the limits for these durations, in min, in rising order, and for the steady state.",
            unit="min",
            most_items=8,
            flag="-",
        ),
    ] = (5.0, 15.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Options of ``heat``."""

    past_limit: Annotated[
        bool,
        Option(
            "Continue the simulation after the mean fluid temperature has reached its limit.",
            flag="-",
            label="continue past the limit of the fluid",
            page=TOP,
        ),
    ] = False
    model: Annotated[
        Literal["reduced", "network", "lumped"],
        Option(
            "Use this thermal model: reduced finite elements, a network of three axial zones, or "
            "one lumped node.",
            page=OnPage(titles=("reduced finite elements", "three axial zones", "the paper's one node")),
        ),
    ] = "reduced"
    start_degC: Annotated[
        float | None,
        Option(
            "Start with this temperature of all parts, in degC.",
            unit="degC",
            least=-40.0,
            most=370.0,
            default_help="ambient",
            label="Temperature at the start",
        ),
    ] = None
    ambient_degC: Annotated[
        float | None,
        Option(
            "Use this ambient temperature, in degC.",
            unit="degC",
            least=-50.0,
            most=100.0,
            default_help="the value of the geometry file",
            page=OnPage(group="", begins=20.0, slider=(-30.0, 60.0, 1.0)),
        ),
    ] = None
    air_m_s: Annotated[
        float | None,
        Option(
            "Use this air speed, in m/s.",
            unit="m/s",
            least=0.0,
            most=AIR_MAX_M_S,
            default_help="the value of the geometry file",
            label="Air speed",
            page=OnPage(group="", slider=(0.0, 20.0, 0.5)),
        ),
    ] = None
    with_sink: Annotated[
        bool,
        Option(
            "Use the heat sink of the geometry file.",
            flag="-",
            label="with the heat sink of the geometry file",
            page=replace(TOP, part="sink"),
        ),
    ] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatsinkOptions:
    """Options of ``heatsink``. Default limits are the ones of the heat sink in the geometry file."""

    span_mm: Annotated[float | None, _size("Limit the length of the finned body, in mm.", "Length")] = None
    width_mm: Annotated[float | None, _size("Limit the radial width of the fins, in mm.", "Width")] = None
    mass_g: Annotated[float | None, _size("Limit the total mass of the fins, in g.", "Mass", unit="g")] = None
    materials: Annotated[
        tuple[str, ...],
        Option(
            "Allow this material: aluminium-alloy, copper, steel, stainless-steel. Repeatable.",
            flag="--material",
            metavar="NAME",
            label="Material",
            default_help="the material of the geometry file",
            page=replace(_BUILT, offers="materials"),
        ),
    ] = ()
    members: Annotated[
        int,
        Option(
            "Show this number of designs of the Pareto front, and verify them with finite elements.",
            least=2,
            most=200,
            flag="-",
            label="Designs on the front",
        ),
    ] = 12
    by_field: Annotated[
        bool,
        Option(
            "Evaluate the designs only with the fast zone network, without finite elements.",
            flag="--network-only",
            label="verify with finite elements (slow)",
            page=replace(_BUILT, begins=False),
        ),
    ] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Options of ``rig``."""

    draw: Annotated[
        int | None,
        Option(
            "Randomise the parameters of the damper within 30 % with this seed. Models are "
            "developed with even seeds, and results are reported with odd seeds.",
            metavar="SEED",
            least=0,
            below=2**31,
            default_help="not randomised",
            label="Seed of a randomised damper",
        ),
    ] = None
    seed: Annotated[int, Option("Use this seed of the random number generator.", least=0, below=2**31)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Options of ``demo``."""

    quick: Annotated[
        bool,
        Option(
            "Use fewer and shorter runs.", label="fewer and shorter runs", page=OnPage(group="", begins=True)
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    samples: Annotated[
        int | None,
        Option(
            "Test the controllers of the card on this number of random dampers.",
            metavar="NUMBER",
            least=1,
            most=100_000,
            page=TOP,
            default_help="no random dampers",
            label="Random dampers",
        ),
    ] = None
    spread_percent: Annotated[
        float,
        Option(
            "Limit the deviation of random parameters from the nominal ones, in percent.",
            flag="-",
            unit="%",
            least=0.0,
            most=30.0,
            page=TOP,
            label="Spread of random dampers",
        ),
    ] = 10.0
    seed: Annotated[
        int, Option("Use this seed of the random number generator.", flag="-", least=0, most=10_000_000)
    ] = 0
    workers: Annotated[
        int | None,
        Option(
            "Use this number of processes on this computer.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=TOP,
            default_help="all cores",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            "Run the tasks on the workers of the Dask scheduler at this address.",
            metavar="tcp://HOST:PORT",
            local=True,
        ),
    ] = None
