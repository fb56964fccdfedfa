"""Heat transfer at the surfaces of a damper: coefficients, areas and emissivities of a geometry.

The zone network and the finite elements use this module. The heat-transfer coefficients of this module
describe convection, including multipliers from the geometry file. Radiation is described by an emissivity
(``radiation_film``). Natural and forced convection are combined as h^3 = h_natural^3 + h_forced^3.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.air import Air, air_at
from mrdamper.thermal.films.annular_fins import (
    RIM_FORCED,
    RIM_UNCERTAINTY,
    floor_share,
    forced_side_film,
    natural_rim_share,
    nusselt_annular_fins,
    side_uncertainty,
)
from mrdamper.thermal.films.correlations import (
    annular_fin_efficiency,
    mixed_nusselt,
    nusselt_cross_flow,
    nusselt_fin_disc,
    nusselt_horizontal_cylinder,
    nusselt_slender_vertical_cylinder,
    radiation_film,
)
from mrdamper.thermal.heatsink import HeatSink

GAP_RATIO_MAX = 0.6  # max gap / outer diameter of fins in still air; a wider gap is replaced by this gap
FORCED_POINT_COUNT_MAX = 12  # number of temperatures at which forced convection is computed


def body_film(drawing: DamperDrawing, surface_K: ArrayLike) -> FloatArray:
    """Return the convective heat-transfer coefficient of the bare body [W/(m^2 K)].

    Caps have the same coefficient as the tube. The factor ``calibration.film`` is included.

    Parameters
    ----------
    surface_K : temperature of the surface [K], any shape

    Raises
    ------
    EnvelopeError
        If air or a correlation is outside its range.
    """
    with _locate_errors(drawing, "body"):
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


@dataclass(frozen=True, slots=True, eq=False)
class FinFilms:
    """Convective heat-transfer coefficients of the fins and the body between them [W/(m^2 K)].

    The factor ``film_multiplier`` of the heat sink is included.
    """

    sides: FloatArray  # sides of the fins
    rim: FloatArray  # outer rim of the fins
    floor: FloatArray  # body between the fins

    def mean(self, sink: HeatSink, body_diameter: float) -> FloatArray:
        """Return the mean coefficient of sides and rim, weighted by area [W/(m^2 K)]."""
        tip = sink.tip_radius(body_diameter)
        sides, rim = 2.0 * (tip**2 - 0.25 * body_diameter**2), 2.0 * tip * sink.thickness
        return np.asarray((sides * self.sides + rim * self.rim) / (sides + rim))


def fin_film(drawing: DamperDrawing, surface_K: ArrayLike) -> FloatArray:
    """Return the mean convective coefficient of a fin [W/(m^2 K)], see ``fin_films``."""
    return fin_films(drawing, surface_K).mean(_sink(drawing), drawing.body.outer_diameter)


def fin_efficiency(drawing: DamperDrawing, root_K: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the mean heat-transfer coefficient of a fin and the fin efficiency.

    The coefficient [W/(m^2 K)] contains convection and radiation. Coefficient and efficiency are computed at
    the temperature of the fin root [K], any shape.
    """
    sink, diameter = _sink(drawing), drawing.body.outer_diameter
    emissivity, _ = fin_radiation(drawing)
    film = fin_film(drawing, root_K) + radiation_film(emissivity, root_K, drawing.surroundings.ambient)
    tip = sink.corrected_radius(diameter)
    return film, annular_fin_efficiency(film, 0.5 * diameter, tip, sink.thickness, sink.material.conductivity)


def fin_films(drawing: DamperDrawing, surface_K: ArrayLike) -> FinFilms:
    """Return the convective heat-transfer coefficients of the fins and of the body between the fins.

    In still air, the correlation depends on the orientation of the body: annular fins if it is horizontal,
    single discs if it is vertical. With air across the axis, the correlation describes a developing
    flow between two discs. The outer sides of the first and the last fin have the same coefficient as sides
    between two fins.

    Parameters
    ----------
    surface_K : mean temperature of the fins [K], any shape

    Raises
    ------
    EnvelopeError
        If air or a correlation is outside its range.
    """
    sink = _sink(drawing)
    with _locate_errors(drawing, "fins"):
        natural = _natural_on_fins(drawing, sink, surface_K)
        if drawing.surroundings.air_speed > 0.0:
            forced = _over_temperature(lambda kelvin: _forced_on_fins(drawing, sink, kelvin), surface_K)
            natural = [mixed_nusselt(still, wind) for still, wind in zip(natural, forced, strict=True)]
    return FinFilms(*(sink.film_multiplier * film for film in natural))


def _natural_on_fins(drawing: DamperDrawing, sink: HeatSink, surface_K: ArrayLike) -> list[FloatArray]:
    """Return the coefficients of sides, rim and floor in still air [W/(m^2 K)]."""
    diameter = drawing.body.outer_diameter
    tip = sink.tip_radius(diameter)
    gap = _gap(drawing, sink, tip)
    air, difference = _air(drawing, surface_K)
    if drawing.body.orientation == "vertical":
        # The characteristic length of a disc is the area of a side divided by its outer perimeter.
        length = (tip**2 - 0.25 * diameter**2) / (2.0 * tip)
        film = nusselt_fin_disc(air.rayleigh(length, difference)) * air.conductivity / length
        return [film] * 3
    outer = 2.0 * tip
    # Fins with a wider gap behave like single fins. The gap is limited because the coefficient of the
    # correlation would still decrease slowly.
    gap = min(gap, GAP_RATIO_MAX * outer)
    sides = nusselt_annular_fins(air.rayleigh(gap, difference) * gap / outer, outer / diameter)
    around = nusselt_horizontal_cylinder(air.rayleigh(outer, difference), air.prandtl) / outer
    around = around * natural_rim_share(sink.thickness, 1.0 / around)
    film = sides * air.conductivity / gap
    return [film, around * air.conductivity, film]


def _forced_on_fins(drawing: DamperDrawing, sink: HeatSink, surface_K: ArrayLike) -> list[FloatArray]:
    """Return the coefficients of sides, rim and floor with an air flow across the axis [W/(m^2 K)]."""
    diameter, speed = drawing.body.outer_diameter, drawing.surroundings.air_speed
    tip = sink.tip_radius(diameter)
    outer, gap = 2.0 * tip, _gap(drawing, sink, tip)
    air, _ = _air(drawing, surface_K)
    of_air = (air.kinematic_viscosity, air.prandtl)
    sides = air.conductivity * forced_side_film(speed, gap, diameter, outer, *of_air)
    around = nusselt_cross_flow(speed * outer / air.kinematic_viscosity, air.prandtl)
    rim = RIM_FORCED * around * air.conductivity / outer
    return [sides, rim, sides * floor_share(speed, gap, outer, *of_air)]


def _gap(drawing: DamperDrawing, sink: HeatSink, tip: float) -> float:
    """Return the gap minus tolerance and fouling [m]; for one fin: its diameter."""
    return sink.gap - drawing.manufacture.closing if sink.fins > 1 else 2.0 * tip


def _over_temperature(
    films: Callable[[FloatArray], list[FloatArray]], surface_K: ArrayLike
) -> list[FloatArray]:
    """Return coefficients at many temperatures by Chebyshev interpolation.

    The function ``films`` computes the coefficients at 12 temperatures. The relative error of the
    interpolation is below 1e-6 because forced convection is smooth in temperature.
    """
    kelvin = np.asarray(surface_K, dtype=np.float64)
    if kelvin.size <= FORCED_POINT_COUNT_MAX:
        return films(kelvin)
    low, high = float(kelvin.min()), float(kelvin.max())
    at = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(
        np.pi * (np.arange(FORCED_POINT_COUNT_MAX) + 0.5) / FORCED_POINT_COUNT_MAX
    )
    curves = [
        chebyshev.Chebyshev.fit(at, film, FORCED_POINT_COUNT_MAX - 1, domain=[low, high])
        for film in films(at)
    ]
    return [np.asarray(curve(kelvin)) for curve in curves]


def fin_uncertainty(drawing: DamperDrawing) -> float:
    """Return the relative error of ``fin_film``: half width of the 90 % interval."""
    sink, diameter = _sink(drawing), drawing.body.outer_diameter
    tip, speed = sink.tip_radius(diameter), drawing.surroundings.air_speed
    share = sink.thickness * tip / (tip**2 - 0.25 * diameter**2 + sink.thickness * tip)
    sides = side_uncertainty(_gap(drawing, sink, tip), 2.0 * tip / diameter, speed)
    return (1.0 - share) * sides + share * RIM_UNCERTAINTY


def fin_radiation(drawing: DamperDrawing) -> tuple[float, float]:
    """Return the effective emissivities of a fin and of the body between two fins [-].

    The space between two fins loses heat only through its opening. This heat is attributed uniformly to the
    sides of the fins and to the body between the fins. The outer sides of the first and the last fin, and all
    tips, radiate directly to the surroundings. The emissivity of a fin refers to ``HeatSink.fin_area``.
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
    """Return the area of the outer side of one cap [m^2], minus the area of the rod if ``with_rod``."""
    rod = drawing.rod.diameter if with_rod else 0.0
    return 0.25 * math.pi * (drawing.body.outer_diameter**2 - rod**2)


def name_correlations(drawing: DamperDrawing) -> Mapping[str, str]:
    """Return the names of the correlations that a geometry uses, by surface."""
    upright = drawing.body.orientation == "vertical"
    moving = drawing.surroundings.air_speed > 0.0
    body = (
        "slender vertical cylinder, Popiel on Churchill and Chu"
        if upright
        else "horizontal cylinder, Churchill and Chu"
    )
    found = {"body": body + (", with cross-flow by Churchill and Bernstein" if moving else "")}
    if drawing.sink is not None:
        fins = "single horizontal discs, McAdams" if upright else "annular fins, Tsubouchi and Masuda"
        if drawing.sink.film_multiplier != 1.0:
            fins += f", times {drawing.sink.film_multiplier:g}"
        found |= {"fins": fins + (", with flow that develops between discs" if moving else "")}
    return found


@contextmanager
def _locate_errors(drawing: DamperDrawing, surface: str) -> Iterator[None]:
    """Add names of geometry and surface to an EnvelopeError of a correlation."""
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
        raise ValueError("the drawing has no heat sink")  # This is an internal error. Callers check first.
    return drawing.sink


def _air(drawing: DamperDrawing, surface_K: ArrayLike) -> tuple[Air, FloatArray]:
    """Return the properties of air at film temperature, and surface minus ambient temperature [K]."""
    surface, ambient = np.asarray(surface_K, dtype=np.float64), drawing.surroundings.ambient
    air = air_at(0.5 * (surface + ambient), drawing.surroundings.altitude)
    return air, np.asarray(surface - ambient)
