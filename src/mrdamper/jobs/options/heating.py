"""Options of the jobs ``heat``, ``derate`` and ``heatsink``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import TOP
from mrdamper.schema import OnPage, Option
from mrdamper.thermal.drawing import AIR_MAX_M_S

_BUILT = OnPage(group="Limits of the design")
_DRAWN = "the heat sink of the geometry file"


def _size(text: str, label: str, unit: str = "mm") -> Option:
    """Return the option of a limit of the size of the heat sink."""
    return Option(text, label=label, page=_BUILT, unit=unit, above=0.0, below=1e6, default_help=_DRAWN)


@dataclass(frozen=True, slots=True, kw_only=True)
class DerateOptions:
    """Options of ``derate``."""

    quantity: Annotated[
        Literal["current", "stroke", "duty"],
        Option(
            "Reduce this quantity: the current, the stroke, or the fraction of time with motion.",
            page=OnPage(group="", titles=("the current", "the stroke", "the fraction of time with motion")),
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
            "Use this thermal model: reduced finite elements, a network of three axial zones, or one "
            "lumped node.",
            page=OnPage(titles=("reduced finite elements", "three axial zones", "one node, as in the paper")),
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
    """Options of ``heatsink``. The default limits are those of the heat sink in the geometry file."""

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
