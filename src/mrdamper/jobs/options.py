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
        "Cores at work at a time; the result does not depend on it.",
        least=1,
        most=1024,
        metavar="NUMBER",
        default_help="all",
        local=True,
    ),
]
"""Of a job that gives its work to a pool (``runtime.pool``)."""


Posterior = Annotated[
    int,
    Option(
        "Follow so many of the posterior draws beside the card, for 90 % intervals; 0: none.",
        least=0,
        most=100_000,
        metavar="DRAWS",
        label="Posterior draws to follow",
    ),
]
"""Of a job that predicts from a card (``models.card_draws``)."""


Channels = Annotated[
    Path | None,
    Option(
        "Channel map (TOML) for headers that do not speak.",
        metavar="FILE",
        default_help="the one beside it, else its headers",
        label="Channel map",
        page=OnPage(
            group="", places=("inputs", "maps"), files=".toml", looks=("channels",), word="channel map"
        ),
    ),
]


Answers = Annotated[
    tuple[str, ...],
    Option(
        "What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate, part. "
        "For some files a pattern of their names and a colon before it.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to what files leave open",
        most_items=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapReading:
    """Options of reading one record."""

    channels: Channels = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading(MapReading):
    """Options of reading files of runs as they are."""

    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading(FilesReading):
    """Options of reading runs."""

    flip_force: Annotated[
        bool,
        Option(
            "Turn the sign of the force (compression-positive load cells).",
            label="turn the sign of the force",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LawReading:
    """Options of reading a card that may be of a user's own law."""

    law: Annotated[
        str | None,
        Option(
            "The user's own law, for a card that was identified with one.",
            metavar="FILE.py:CLASS",
            local=True,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """Of a job that has none but those of reading."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Options of ``check``."""

    deep: Annotated[
        bool,
        Option(
            "Fit one law to all runs, and tell which of them do not belong to the others, and why.",
            label="test all runs together",
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
            "Runs to use; all others are left aside (by name; may be repeated).",
            metavar="GLOB",
            label="Use these runs alone",
            default_help="all",
            most_items=20_000,
            page=OnPage(offers="runs"),
        ),
    ] = ()
    hold_out: Annotated[
        tuple[str, ...],
        Option(
            "Runs that the fit must not see (by name; may be repeated).",
            metavar="GLOB",
            label="Hold out",
            most_items=20_000,
            page=OnPage(group="Hold out", offers="runs"),
        ),
    ] = ()
    posterior: Annotated[
        int,
        Option(
            "Number of posterior samples, for 90 % intervals of parameters and predictions.",
            least=0,
            most=100_000,
            metavar="DRAWS",
            label="Posterior draws",
        ),
    ] = 0
    one_command: Annotated[
        bool,
        Option(
            "Accept runs at a single command; the model holds for it alone.",
            label="accept runs at one current only",
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
            "Add a term to the law (may be repeated). Every law takes friction, mass, viscosity, "
            "thinning and gas; the others are of the law chain.",
            flag="--term",
            default_help="friction, thinning for tempered runs",
            label="Parallel terms",
        ),
    ] = None
    temperature: Annotated[
        Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"],
        Option(
            "How coefficients follow temperature (auto: arrhenius where the runs have one; "
            "none: not at all).",
            label="Temperature",
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
            "A smaller to-and-fro is no cycle.",
            unit="mm",
            above=0.0,
            below=1e6,
            metavar="MM",
            page=TOP,
            default_help="5 % of the range of displacement",
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions:
    """Options of ``track``."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Temperature of the damper (may be repeated).",
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
        Option("Sampling of the controllers.", flag="-", unit="Hz", least=100.0, most=5000.0),
    ] = 1000.0
    controllers: Annotated[
        tuple[str, ...],
        Option(
            "recommended, paper, ... (may be repeated).",
            flag="--controller",
            metavar="NAME",
            default_help="all",
            most_items=40,
            label="Controllers",
            page=OnPage(group="Controllers", offers="controllers", begins=("recommended", "paper")),
        ),
    ] = ()
    seed: Annotated[
        int,
        Option("Seed of the sensor noise; the next seed is run as well.", flag="-", least=0, below=2**31),
    ] = 1
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Options of ``simulate``."""

    temperature_degC: Annotated[
        float,
        Option("Of the fluid, where the motion does not tell it.", unit="degC", least=-60.0, most=200.0),
    ] = 20.0
    rate_Hz: Annotated[
        float, Option("Samples per second of a motion in words.", unit="Hz", above=0.0, most=1e5)
    ] = 1000.0
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(
            "C99 source, an FMU, a force map (CSV), a folder for MATLAB.",
            flag="-",
            least_items=1,
            label="Make",
            page=OnPage(
                group="Make",
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
            "The damper's model, its force controller, or both.",
            label="Holds",
            page=OnPage(group="", titles=("the model", "the controller", "model and controller")),
        ),
    ] = "both"
    precision: Annotated[
        Literal["float", "double"],
        Option(
            "The target's number type.",
            label="Numbers",
            page=OnPage(group="", titles=("float (32 bit)", "double (64 bit)")),
        ),
    ] = "float"
    period_s: Annotated[
        float,
        Option("Period.", unit="s", above=0.0, most=1.0, flag="--step", metavar="TIME", page=TOP),
    ] = 1e-3
    controller: Annotated[
        str,
        Option(
            "recommended, recommended-causal, paper, ...",
            metavar="NAME",
            label="Controller",
            page=OnPage(group="", offers="controllers"),
        ),
    ] = "recommended"
    name: Annotated[
        str,
        Option("Prefix of every name in the code.", metavar="IDENT", label="Prefix of names", page=TOP),
    ] = "damper"


_BUILT = OnPage(group="What can be built")
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
            "What is made smaller: the duty's command, its motion, or the share of time at work.",
            page=OnPage(group="", titles=("the current", "the stroke", "the share of time at work")),
        ),
    ] = "current"
    ambient_degC: Annotated[
        tuple[Annotated[float, Option(least=-50.0, most=100.0)], ...],
        Option("Air around the damper, rising.", unit="degC", least_items=1, most_items=15),
    ] = (-20.0, 0.0, 20.0, 40.0, 50.0)
    air_m_s: Annotated[
        tuple[Annotated[float, Option(least=0.0, most=AIR_MAX_M_S)], ...],
        Option("Speeds of the air, rising.", unit="m/s", least_items=1, most_items=15),
    ] = (0.0, 1.0, 2.0, 5.0, 10.0)
    duration_min: Annotated[
        tuple[Annotated[float, Option(above=0.0, most=1440.0)], ...],
        Option("Times from ambient on, rising; steady is added.", unit="min", most_items=8, flag="-"),
    ] = (5.0, 15.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Options of ``heat``."""

    past_limit: Annotated[
        bool,
        Option(
            "Go on where the fluid's mean passes its limit instead of ending there.",
            flag="-",
            label="go on past the fluid's limit",
            page=TOP,
        ),
    ] = False
    model: Annotated[
        Literal["reduced", "network", "lumped"],
        Option(
            "Reduced finite elements, three axial zones, or the paper's one node.",
            page=OnPage(titles=("reduced finite elements", "three axial zones", "the paper's one node")),
        ),
    ] = "reduced"
    start_degC: Annotated[
        float | None,
        Option(
            "Of everything at the start.",
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
            "Air around the damper.",
            unit="degC",
            least=-50.0,
            most=100.0,
            default_help="the drawing's",
            page=OnPage(group="", begins=20.0, slider=(-30.0, 60.0, 1.0)),
        ),
    ] = None
    air_m_s: Annotated[
        float | None,
        Option(
            "Speed of the air.",
            unit="m/s",
            least=0.0,
            most=AIR_MAX_M_S,
            default_help="the drawing's",
            label="Air speed",
            page=OnPage(group="", slider=(0.0, 20.0, 0.5)),
        ),
    ] = None
    with_sink: Annotated[
        bool,
        Option(
            "Keep the drawing's heat sink.",
            flag="-",
            label="with the drawing's heat sink",
            page=replace(TOP, part="sink"),
        ),
    ] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatsinkOptions:
    """Options of ``heatsink``; the defaults of the limits are those of the drawing's sink."""

    span_mm: Annotated[float | None, _size("Length of the body for the fins.", "Length for the fins")] = None
    width_mm: Annotated[float | None, _size("Largest width of a fin.", "Widest fin")] = None
    mass_g: Annotated[float | None, _size("Largest mass of all fins.", "Largest mass", unit="g")] = None
    materials: Annotated[
        tuple[str, ...],
        Option(
            "aluminium-alloy, copper, steel, stainless-steel (may be repeated).",
            flag="--material",
            metavar="NAME",
            label="Material",
            default_help="as drawn",
            page=replace(_BUILT, offers="materials"),
        ),
    ] = ()
    members: Annotated[
        int,
        Option(
            "Members of the front that are shown and verified by finite elements.",
            least=2,
            most=200,
            flag="-",
            label="Designs on the front",
        ),
    ] = 12
    by_field: Annotated[
        bool,
        Option(
            "Do not verify by finite elements.",
            flag="--network-only",
            label="verify by finite elements, too (slow)",
            page=replace(_BUILT, begins=False),
        ),
    ] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Options of ``rig``."""

    draw: Annotated[
        int | None,
        Option(
            "Another damper of the kind, its parameters drawn within 30 % (even seeds: to build laws; odd "
            "ones: to report).",
            metavar="SEED",
            least=0,
            below=2**31,
            default_help="the damper itself",
            label="Draw of another damper",
        ),
    ] = None
    seed: Annotated[int, Option("Of every random draw.", least=0, below=2**31)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Options of ``demo``."""

    quick: Annotated[
        bool,
        Option("Fewer and shorter runs.", label="fewer and shorter runs", page=OnPage(group="", begins=True)),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    samples: Annotated[
        int | None,
        Option(
            "Number of random dampers that the card's controller is tried on.",
            metavar="NUMBER",
            least=1,
            most=100_000,
            page=TOP,
            default_help="no random dampers",
            label="Random dampers to track",
        ),
    ] = None
    spread_percent: Annotated[
        float,
        Option(
            "Largest deviation of a random damper's parameters from the nominal ones.",
            flag="-",
            unit="%",
            least=0.0,
            most=30.0,
            page=TOP,
            label="Spread of random dampers",
        ),
    ] = 10.0
    seed: Annotated[
        int, Option("Seed of the random number generator.", flag="-", least=0, most=10_000_000)
    ] = 0
    workers: Annotated[
        int | None,
        Option(
            "Number of processes of this machine.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=TOP,
            default_help="one for each core",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            "Address of a Dask scheduler; its workers run the tasks.", metavar="tcp://HOST:PORT", local=True
        ),
    ] = None
