"""Options of the jobs on heat."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import TOP, Jobs, Posterior
from mrdamper.schema import OnPage, Option

_BUILT = OnPage(group="What can be built")
_DRAWN = "the drawing's sink's"


def _size(text: str, label: str, default_help: str, unit: str = "mm") -> Option:
    """Return the option of a size of what can be built."""
    return Option(text, label=label, page=_BUILT, unit=unit, above=0.0, below=1e6, default_help=default_help)


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
        tuple[Annotated[float, Option(least=0.0, most=50.0)], ...],
        Option("Speeds of the air, rising.", unit="m/s", least_items=1, most_items=15),
    ] = (0.0, 1.0, 2.0, 5.0, 10.0)
    duration_min: Annotated[
        tuple[Annotated[float, Option(above=0.0, most=1440.0)], ...],
        Option("Times from ambient on, rising; steady comes besides.", unit="min", most_items=8),
    ] = (5.0, 15.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Options of ``heat``."""

    past_limit: Annotated[
        bool,
        Option(
            "Go on where the fluid's mean passes its limit instead of ending there.",
            label="go on past the fluid's limit",
            page=TOP,
        ),
    ] = False
    model: Annotated[
        Literal["reduced", "network", "elements", "lumped"],
        Option(
            "Reduced finite elements, three axial zones, all the elements, or the paper's one node.",
            page=OnPage(
                titles=(
                    "reduced finite elements",
                    "three axial zones",
                    "finite elements",
                    "the paper's one node",
                )
            ),
        ),
    ] = "reduced"
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
            page=replace(TOP, part="sink"),
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
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatsinkOptions:
    """Options of ``sink``; the limits' defaults are those of the drawing's sink."""

    span_mm: Annotated[
        float | None, _size("Length of the body to stand on.", "Length to stand on", _DRAWN)
    ] = None
    width_mm: Annotated[float | None, _size("Greatest width of a fin.", "Widest fin", _DRAWN)] = None
    mass_g: Annotated[float | None, _size("Greatest mass of all fins.", "Most mass", _DRAWN, unit="g")] = None
    least_thickness_mm: Annotated[
        float | None,
        _size("Of a fin that can be made.", "Thinnest fin", "the drawing's [manufacture], else 1"),
    ] = None
    least_gap_mm: Annotated[
        float | None, _size("Between two fins.", "Narrowest gap", "the drawing's [manufacture], else 3")
    ] = None
    vary: Annotated[
        tuple[str, ...],
        Option(
            "A number of the drawing to sweep: sink.width_mm=18:33:4, surroundings.air_m_s=0,1,2 "
            "(may be repeated).",
            label="Sweep of a number of the drawing",
            metavar="KEY=VALUES",
        ),
    ] = ()
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
        Literal["annular", "channel", "vdi", "disc"] | None,
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
            page=replace(_BUILT, begins=False),
        ),
    ] = True
    jobs: Jobs = None
