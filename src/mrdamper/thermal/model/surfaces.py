"""What a damper's surfaces give off: film coefficients, areas and emissivities of a drawing.

Shared by the zone network and the finite elements, so that both cool by the same laws. A film coefficient
here is convection's alone, its multiplier included; radiation goes by an emissivity (``radiation_film``).
Still air and air across the axis blend as h^3 = h_natural^3 + h_forced^3.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.air import Air, air_at
from mrdamper.thermal.films.correlations import (
    mixed_nusselt,
    nusselt_cross_flow,
    nusselt_fin_channel,
    nusselt_fin_disc,
    nusselt_fin_vdi,
    nusselt_flat_plate,
    nusselt_horizontal_cylinder,
    nusselt_slender_vertical_cylinder,
)
from mrdamper.thermal.heatsink import HeatSink

__all__ = ["body_film", "cap_area", "fin_film", "fin_radiation", "name_correlations"]


def body_film(drawing: DamperDrawing, surface_K: ArrayLike) -> FloatArray:
    """Return the convective film coefficient of the bare body [W/(m^2 K)].

    Caps take the tube's. ``calibration.film`` is included.

    Parameters
    ----------
    surface_K : temperature of the surface [K], any shape

    Raises
    ------
    EnvelopeError
        Air or a correlation outside its range.
    """
    with _placed(drawing, "body"):
        return drawing.calibration.film * _bare_film(drawing, surface_K)


def _bare_film(drawing: DamperDrawing, surface_K: ArrayLike) -> FloatArray:
    body, around = drawing.body, drawing.surroundings
    air, difference = _air(drawing, surface_K)
    if body.orientation == "horizontal":
        length = body.outer_diameter
        natural = nusselt_horizontal_cylinder(air.rayleigh(length, difference), air.prandtl)
    else:
        length = body.length
        slenderness = length / body.outer_diameter
        natural = nusselt_slender_vertical_cylinder(air.grashof(length, difference), air.prandtl, slenderness)
    film = natural * air.conductivity / length
    if around.air_speed > 0.0:
        reynolds = around.air_speed * body.outer_diameter / air.kinematic_viscosity
        forced = nusselt_cross_flow(reynolds, air.prandtl) * air.conductivity / body.outer_diameter
        film = mixed_nusselt(film, forced)
    return film


def fin_film(drawing: DamperDrawing, surface_K: ArrayLike) -> FloatArray:
    """Return the convective film coefficient of the fins and of the body between them [W/(m^2 K)].

    By the law that the sink names; in air, blended with a laminar plate of the length pi/4 D_o.
    ``film_multiplier`` is included.

    Parameters
    ----------
    surface_K : mean temperature of the fins [K], any shape
    """
    sink = _sink(drawing)
    with _placed(drawing, "fins"):
        return sink.film_multiplier * _between_fins(drawing, sink, surface_K)


def _between_fins(drawing: DamperDrawing, sink: HeatSink, surface_K: ArrayLike) -> FloatArray:
    diameter = drawing.body.outer_diameter
    tip = sink.tip_radius(diameter)
    chord = 0.25 * math.pi * 2.0 * tip
    # a single fin has no neighbour: as wide a gap as it is high
    gap = sink.gap if sink.fins > 1 else 2.0 * tip
    air, difference = _air(drawing, surface_K)
    if sink.correlation == "channel":
        nusselt = nusselt_fin_channel(air.rayleigh(gap, difference), gap / chord)
        film = nusselt * air.conductivity / gap
    elif sink.correlation == "vdi":
        nusselt = nusselt_fin_vdi(air.rayleigh(diameter, difference), gap / diameter)
        film = nusselt * air.conductivity / diameter
    else:
        length = (tip**2 - 0.25 * diameter**2) / (2.0 * tip)  # open area over open perimeter
        film = nusselt_fin_disc(air.rayleigh(length, difference)) * air.conductivity / length
    speed = drawing.surroundings.air_speed
    if speed > 0.0:
        forced = nusselt_flat_plate(speed * chord / air.kinematic_viscosity, air.prandtl)
        film = mixed_nusselt(film, forced * air.conductivity / chord)
    return film


def fin_radiation(drawing: DamperDrawing) -> tuple[float, float]:
    """Return the emissivity per area of a fin on the average, and that of the body between fins [-].

    Faces and floors of grooves go by the groove's apparent emissivity, spread over its walls; the two outer
    faces and the tips see the surroundings alone. The average is over ``HeatSink.fin_area``.
    """
    sink = _sink(drawing)
    diameter, tip = drawing.body.outer_diameter, sink.tip_radius(drawing.body.outer_diameter)
    groove = sink.groove_share(diameter, drawing.surroundings.emissivity)
    face = math.pi * (tip**2 - 0.25 * diameter**2)
    inner, outer = 2.0 * (sink.fins - 1) * face, 2.0 * face
    tips = sink.fins * 2.0 * math.pi * tip * sink.thickness
    total = groove * inner + sink.emissivity * (outer + tips)
    return total / (sink.fins * sink.fin_area(diameter)), groove


def cap_area(drawing: DamperDrawing, *, with_rod: bool) -> float:
    """Return the area of one cap's outer face [m^2], without the rod where it leaves."""
    rod = drawing.rod.diameter if with_rod else 0.0
    return 0.25 * math.pi * (drawing.body.outer_diameter**2 - rod**2)


def name_correlations(drawing: DamperDrawing) -> Mapping[str, str]:
    """Return which correlations the drawing's surfaces use, by surface."""
    upright = drawing.body.orientation == "vertical"
    moving = drawing.surroundings.air_speed > 0.0
    body = (
        "slender vertical cylinder, Popiel on Churchill and Chu"
        if upright
        else "horizontal cylinder, Churchill and Chu"
    )
    found = {"body": body + (", with cross-flow by Churchill and Bernstein" if moving else "")}
    if drawing.sink is not None:
        fins = {
            "channel": "channel law of Elenbaas",
            "vdi": "VDI Heat Atlas F2.4.4",
            "disc": "single horizontal discs, McAdams",
        }[drawing.sink.correlation]
        if drawing.sink.film_multiplier != 1.0:
            fins += f", times {drawing.sink.film_multiplier:g}"
        found["fins"] = fins + (", with a laminar plate's forced convection" if moving else "")
    return found


@contextmanager
def _placed(drawing: DamperDrawing, surface: str) -> Iterator[None]:
    """Say of which drawing and surface a number is outside a correlation's range."""
    try:
        yield
    except EnvelopeError as fault:
        raise EnvelopeError(
            place=drawing.name,
            found=f"convection of the {surface}: {fault}",
            remedy=(
                "Check surroundings.air_m_s (0 is still air) and ambient_degC, and that lengths are in "
                "millimetres"
            ),
        ) from fault


def _sink(drawing: DamperDrawing) -> HeatSink:
    if drawing.sink is None:
        raise ValueError("the drawing has no heat sink")  # a fault of ours: callers ask first
    return drawing.sink


def _air(drawing: DamperDrawing, surface_K: ArrayLike) -> tuple[Air, FloatArray]:
    """Return the air at film temperature, and how much warmer than it the surface is [K]."""
    surface, ambient = np.asarray(surface_K, dtype=np.float64), drawing.surroundings.ambient
    return air_at(0.5 * (surface + ambient)), np.asarray(surface - ambient)
