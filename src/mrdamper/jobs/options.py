"""What each job can be told: one declaration a job, from which every face is made.

The command line's options and help, the server's requests and forms, columns of sweeps and tables of options
in the documentation come from these classes. Only light modules are loaded here, so that help answers at
once; names that live in heavy ones are asked for late (``among``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from mrdamper.schema import OnPage, Option

__all__ = [
    "CyclesOptions",
    "DemoOptions",
    "ExportOptions",
    "FilesReading",
    "FitOptions",
    "FluidOptions",
    "ForecastOptions",
    "HeatOptions",
    "LawReading",
    "NoOptions",
    "ObserveOptions",
    "RideOptions",
    "RigOptions",
    "RunsReading",
    "SinkOptions",
    "SweepOptions",
    "TrackConditions",
    "TrackOptions",
]


Seed = Annotated[int, Option("Of every random draw.", least=0, below=2**31)]

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

_TOP = OnPage(group="")
_BUILT = OnPage(group="What can be built")

Answers = Annotated[
    tuple[str, ...],
    Option(
        "What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate. For some "
        "files a pattern of their names and a colon before it.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to what files leave open",
        most_items=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading:
    """Options of reading files of runs as they are."""

    channels: Channels = None
    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading:
    """Options of reading runs, or one long record."""

    channels: Channels = None
    answer: Answers = ()
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
class FitOptions:
    """Options of ``identify``."""

    method: Annotated[
        Literal["varpro", "genetic", "cma"],
        Option(
            "How to search.",
            label="Search",
            page=OnPage(titles=("variable projection", "genetic", "CMA-ES")),
        ),
    ] = "varpro"
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
    seed: Seed = 0
    starts: Annotated[int, Option("Starts of the search (varpro); each draws many points.", least=1)] = 3
    leave_out: Annotated[
        tuple[Literal["run", "current", "motion", "temperature"], ...],
        Option(
            "Fit again without each run, current, motion or temperature in turn.",
            label="Fit again without each",
        ),
    ] = ()
    profiled: Annotated[
        bool,
        Option(
            "Follow the least known combination along its profile.",
            flag="--profile",
            label="follow the least known combination along its profile",
        ),
    ] = False
    draws: Annotated[
        int,
        Option(
            "Fit again to runs drawn with replacement, so many times.",
            least=0,
            flag="--bootstrap",
            metavar="DRAWS",
            label="Bootstrap draws",
        ),
    ] = 0
    session_offsets: Annotated[
        bool,
        Option(
            "Let each session have its own constant force.",
            label="each session has its own constant force",
        ),
    ] = False
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
            page=_TOP,
        ),
    ] = "auto"
    coil_resistance_ohm: Annotated[
        float | None,
        Option(
            "Of the coil at 20 degC, for the card.",
            unit="ohm",
            above=0.0,
            flag="--coil-resistance",
            metavar="OHM",
            label="Coil resistance at 20 °C",
            default_help="not known",
        ),
    ] = None


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
            page=_TOP,
            default_help="5 % of the range of the first rows",
        ),
    ] = None
    batch_rows: Annotated[
        int | None,
        Option("Rows of a batch; what is found does not depend on it.", least=1, flag="-", local=True),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FluidOptions:
    """Options of ``fluid``."""

    particle_fraction: Annotated[
        float | None,
        Option(
            "Volume share of iron, which leads from mT to kA/m.",
            metavar="SHARE",
            label="Volume share of iron",
            above=0.0,
            below=1.0,
            default_help="that of the fluid it is like",
            page=_TOP,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ForecastOptions:
    """Options of ``forecast``."""

    ambient_degC: Annotated[float, Option("Air around the damper.", unit="degC", least=-50.0, most=100.0)] = (
        20.0
    )
    limit_degC: Annotated[
        float, Option("Temperature whose time is asked for.", unit="degC", least=-50.0, most=400.0)
    ] = 130.0
    until_s: Annotated[
        float,
        Option(
            "How far from the curve's start.",
            unit="s",
            above=60.0,
            most=1e5,
            flag="--until",
            metavar="SECONDS",
        ),
    ] = 3600.0
    probability: Annotated[
        float, Option("That the interval holds the temperature.", least=0.5, most=0.99)
    ] = 0.9
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Options of ``heat``."""

    past_limit: Annotated[
        bool,
        Option(
            "Go on beyond the fluid's limit instead of ending there.",
            label="go on past the fluid's limit",
            page=_TOP,
        ),
    ] = False
    model: Annotated[
        Literal["zones", "lumped", "reduced"],
        Option(
            "Three axial zones, the paper's one node, or the finite elements reduced to 16 unknowns.",
            page=OnPage(titles=("three axial zones", "the paper's one node", "reduced finite elements")),
        ),
    ] = "zones"
    start_degC: Annotated[
        float | None,
        Option(
            "Of everything at the start.",
            unit="degC",
            default_help="ambient",
            label="Temperature at the start",
        ),
    ] = None
    ambient_degC: Annotated[
        float | None,
        Option(
            "Air around the damper.",
            unit="degC",
            least=-100.0,
            most=400.0,
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
            most=200.0,
            default_help="the drawing's",
            label="Air speed",
            page=OnPage(group="", slider=(0.0, 20.0, 0.5)),
        ),
    ] = None
    with_sink: Annotated[
        bool,
        Option(
            "Leave the drawing's heat sink away.",
            flag="--no-sink",
            label="with the drawing's heat sink",
            page=_TOP,
        ),
    ] = True
    by_field: Annotated[
        bool | None,
        Option(
            "Judge the end by finite elements; None: where files are written.",
            flag="-",
            label="heat paths by finite elements",
            page=OnPage(begins=True),
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserveOptions:
    """Options of ``observe``."""

    ambient_degC: Annotated[
        float | None,
        Option("Air around the damper.", unit="degC", least=-50.0, most=100.0, default_help="the drawing's"),
    ] = None
    start_degC: Annotated[
        float | None,
        Option(
            "Of everything at the record's start.",
            unit="degC",
            least=-50.0,
            most=200.0,
            default_help="ambient",
        ),
    ] = None
    start_spread_K: Annotated[
        float,
        Option(
            "Standard deviation of that; some 20 for a damper that is still warm.",
            unit="K",
            above=0.0,
            most=200.0,
        ),
    ] = 0.5
    power_W: Annotated[
        float | None,
        Option(
            "Mean mechanical power, in place of the record's.",
            unit="W",
            least=0.0,
            most=1e6,
            default_help="the record's power_W",
        ),
    ] = None
    wiring_ohm: Annotated[
        float, Option("Of the wires between driver and coil.", unit="ohm", least=0.0, most=100.0)
    ] = 0.0
    resistance_noise: Annotated[
        float, Option("Standard deviation of a reading of the resistance, as a share.", above=0.0, most=0.5)
    ] = 0.01
    body_noise_K: Annotated[
        float, Option("Standard deviation of a reading of the body.", unit="K", above=0.0, most=50.0)
    ] = 0.5
    limit_degC: Annotated[
        float | None,
        Option(
            "Temperature of the fluid whose time is asked for.",
            unit="degC",
            least=-50.0,
            most=400.0,
            default_help="the fluid's limit in the drawing",
        ),
    ] = None
    look_s: Annotated[
        float,
        Option("How far beyond the record.", unit="s", above=0.0, most=1e5, flag="--look", metavar="SECONDS"),
    ] = 7200.0
    probability: Annotated[
        float, Option("That an interval holds the temperature, or the time.", least=0.5, most=0.99)
    ] = 0.9
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class RideOptions:
    """Options of ``ride``."""

    controller: Annotated[
        str,
        Option(
            "recommended, recommended-causal, paper, ...",
            metavar="NAME",
            label="Controller",
            page=OnPage(group="", offers="controllers"),
        ),
    ] = "recommended"
    demand: Annotated[
        Literal["skyhook", "groundhook", "hybrid", "linear-quadratic"],
        Option("The force that is asked of the damper."),
    ] = "linear-quadratic"
    damping_N_s_m: Annotated[
        float,
        Option("Of skyhook, groundhook and hybrid.", unit="N s/m", above=0.0, most=1e6, flag="--damping"),
    ] = 2500.0
    road_class: Annotated[
        Literal["A", "B", "C", "D", "E", "F", "G", "H"],
        Option("Class of ISO 8608, A (smooth) to H.", flag="--road"),
    ] = "C"
    speed_m_s: Annotated[float, Option("Of the car.", unit="m/s", above=0.0, most=100.0)] = 20.0
    duration_s: Annotated[
        float,
        Option(
            "Of the ride that is scored; its first 2 s are not.",
            unit="s",
            above=2.0,
            most=600.0,
            flag="--duration",
            metavar="SECONDS",
        ),
    ] = 20.0
    warm_up_s: Annotated[
        float,
        Option(
            "Drive on for so long while the damper warms; 0: not at all.",
            unit="s",
            least=0.0,
            most=14400.0,
            flag="--warm-up",
            metavar="SECONDS",
        ),
    ] = 1800.0
    temperature_degC: Annotated[
        float, Option("Of the damper during the scored ride.", unit="degC", least=-50.0, most=200.0)
    ] = 20.0
    ambient_degC: Annotated[
        float,
        Option("Air around the damper, where its warming begins.", unit="degC", least=-50.0, most=100.0),
    ] = 20.0
    housing_J_K: Annotated[
        float, Option("Heat capacity of the damper without its fluid.", unit="J/K", above=0.0, most=1e6)
    ] = 950.0
    cooling_W_K: Annotated[
        float, Option("Heat that the housing gives to the air, per kelvin.", unit="W/K", least=0.0, most=1e3)
    ] = 2.0
    coil_resistance_ohm: Annotated[
        float,
        Option(
            "Of the coil at 20 degC.",
            unit="ohm",
            least=0.0,
            most=1e3,
            flag="--coil-resistance",
            metavar="OHM",
        ),
    ] = 5.0
    body_kg: Annotated[float, Option("Of the body above the wheel.", unit="kg", above=0.0, most=1e5)] = 320.0
    wheel_kg: Annotated[float, Option("Of the wheel.", unit="kg", above=0.0, most=1e4)] = 40.0
    spring_N_m: Annotated[float, Option("Stiffness of the spring.", unit="N/m", above=0.0, most=1e7)] = 20e3
    tyre_N_m: Annotated[float, Option("Stiffness of the tyre.", unit="N/m", above=0.0, most=1e8)] = 200e3
    seed: Annotated[int, Option("Of road and sensors.", least=0, below=2**31)] = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkOptions:
    """Options of ``sink``; the limits' defaults are those of the drawing's sink."""

    span_mm: Annotated[
        float | None,
        Option(
            "Length of the body to stand on.",
            label="Length to stand on",
            page=_BUILT,
            unit="mm",
            above=0.0,
            below=1e6,
            default_help="the drawing's sink's",
        ),
    ] = None
    width_mm: Annotated[
        float | None,
        Option(
            "Greatest width of a fin.",
            label="Widest fin",
            page=_BUILT,
            unit="mm",
            above=0.0,
            below=1e6,
            default_help="the drawing's sink's",
        ),
    ] = None
    mass_g: Annotated[
        float | None,
        Option(
            "Greatest mass of all fins.",
            label="Most mass",
            page=_BUILT,
            unit="g",
            above=0.0,
            below=1e6,
            default_help="the drawing's sink's",
        ),
    ] = None
    least_thickness_mm: Annotated[
        float,
        Option(
            "Of a fin that can be made.", label="Thinnest fin", page=_BUILT, unit="mm", above=0.0, below=1e6
        ),
    ] = 1.0
    least_gap_mm: Annotated[
        float,
        Option("Between two fins.", label="Narrowest gap", page=_BUILT, unit="mm", above=0.0, below=1e6),
    ] = 3.0
    materials: Annotated[
        tuple[str, ...],
        Option(
            "aluminium-alloy, copper, steel, stainless-steel (may be repeated).",
            flag="--material",
            metavar="NAME",
            label="Material",
            default_help="as drawn",
            page=OnPage(group="What can be built", offers="materials"),
        ),
    ] = ()
    emissivities: Annotated[
        tuple[Annotated[float, Option(least=0.0, most=1.0)], ...],
        Option(
            "Of the finish: 0.1 bare, 0.85 anodised (may be repeated).",
            label="Emissivities of the finish",
            default_help="as drawn",
            page=_BUILT,
            flag="--emissivity",
            metavar="SHARE",
        ),
    ] = ()
    correlation: Annotated[
        Literal["channel", "vdi", "disc"] | None,
        Option("The fins' law.", label="Law of the fins", default_help="as drawn"),
    ] = None
    film_multiplier: Annotated[
        float | None,
        Option(
            "On the fins' law.",
            metavar="NUMBER",
            above=0.0,
            below=1e6,
            label="Factor on that law",
            default_help="as drawn",
        ),
    ] = None
    method: Annotated[
        Literal["grid", "nsga2"],
        Option(
            "Every sink of a grid, or NSGA-II.",
            label="Search",
            page=OnPage(titles=("every sink of a grid", "NSGA-II")),
        ),
    ] = "grid"
    members: Annotated[
        int,
        Option(
            "Members of the front that are shown and judged by finite elements.",
            least=2,
            most=200,
            flag="--front",
            metavar="NUMBER",
            label="Designs on the front",
        ),
    ] = 12
    by_field: Annotated[
        bool,
        Option(
            "Do not judge by finite elements.",
            flag="--network-only",
            label="judge by finite elements, too (slow)",
            page=OnPage(group="What can be built", begins=False),
        ),
    ] = True
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackConditions:
    """At what a loop is tracked."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Of fluid and coil (may be repeated).",
            flag="--temperature",
            metavar="DEGC",
            unit="degC",
            label="Temperatures of fluid and coil",
            page=OnPage(group="Temperatures", begins=(20.0, 60.0)),
            default_help="20, 60, 100, 123",
            most_items=20,
        ),
    ] = ()
    rate_Hz: Annotated[
        float,
        Option(
            "Sampling.", flag="--rate", metavar="HZ", unit="Hz", label="Sampling", least=100.0, most=5000.0
        ),
    ] = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions(TrackConditions):
    """Options of ``track``."""

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
    optimum: Annotated[
        bool,
        Option(
            "Search the best current, too (minutes), for the ratios to it.",
            label="search the best current, too (minutes)",
        ),
    ] = False
    seed: Annotated[
        int, Option("Of the sensors' noise; the next one is run as well.", least=0, below=2**31)
    ] = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table"], ...],
        Option(
            "C99 source, an FMU, a force map (CSV).",
            flag="-",
            least_items=1,
            label="Make",
            page=OnPage(
                group="Make",
                titles=(
                    "C99 source, as an archive",
                    "FMU for co-simulation",
                    "force map (CSV) for simulators",
                ),
                begins=("c", "fmu"),
            ),
        ),
    ] = ("c", "fmu", "table")
    fmi: Annotated[
        Literal["2.0", "3.0"],
        Option("Version of the FMU.", label="FMU", page=OnPage(group="", titles=("FMI 2.0", "FMI 3.0"))),
    ] = "3.0"
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
        Option("Period.", unit="s", above=0.0, most=1.0, flag="--step", metavar="TIME", page=_TOP),
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
        Option("Prefix of every name in the code.", metavar="IDENT", label="Prefix of names", page=_TOP),
    ] = "damper"
    verify: Annotated[
        bool, Option("Write the C folder without compiling and comparing it.", flag="--no-verify", local=True)
    ] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Options of ``rig``."""

    preset: Annotated[
        Literal["nominal", "hard", "stiff", "vehicle", "paper", "hydraulic-bench", "hydraulic-monotube"]
        | None,
        Option("Whose parameters the virtual damper has.", default_help="nominal", label="Damper", page=_TOP),
    ] = None
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
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Options of ``demo``."""

    quick: Annotated[
        bool,
        Option("Fewer and shorter runs.", label="fewer and shorter runs", page=OnPage(group="", begins=True)),
    ] = False
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    workers: Annotated[
        int | None,
        Option(
            "Processes of this machine.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=_TOP,
            default_help="its cores",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option("A Dask scheduler, whose workers do the tasks.", metavar="tcp://HOST:PORT", local=True),
    ] = None
