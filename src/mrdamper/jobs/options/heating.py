"""Options of the jobs on heat."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import TOP
from mrdamper.schema import OnPage, Option
from mrdamper.thermal.drawing import AIR_MAX_M_S

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
