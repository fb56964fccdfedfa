"""Heat losses of surfaces equal separate computations, with the library ``ht`` where possible.

The computations divide annular fins into strips and follow the radiation between the walls of a groove. They
use the three published equations of the moving fluid.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films import annular_fins
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.annular_fins import (
    floor_share,
    forced_side_film,
    nusselt_annular_fins,
)
from mrdamper.thermal.heatsink import HeatSink, Manufacture
from mrdamper.thermal.model.surfaces import (
    body_film,
    fin_film,
    fin_films,
    fin_radiation,
)
from mrdamper.thermal.stirring import Channel, Stroke, conduct_fluid

ht = pytest.importorskip("ht")
PAPER = read_drawing("paper")
G = 9.80665


def published_still(rayleigh: float, ratio: float) -> float:
    """Return the Nusselt number of Tsubouchi and Masuda. ``ratio`` is fin diameter by tube diameter."""
    share = 1.0 / ratio
    beta = 0.17 * share + math.exp(-4.8 * share)
    c = ((23.7 - 1.1 * (1.0 + 152.0 * share**2) ** 0.5) / (1.0 + beta)) ** (4.0 / 3.0)
    passed = 1.0 / (1.0 + share**2)
    bend = (c / rayleigh) ** 0.75 / passed
    return passed * rayleigh / (12.0 * math.pi) * ((1.0 - math.exp(-bend)) + (1.0 - math.exp(-beta * bend)))


def published_wind(
    speed: float, gap: float, tube: float, outer: float, nu: float, pr: float, driving: float
) -> float:
    """Return the heat-transfer coefficient of a fin in wind divided by the conductivity of air [1/m]."""
    heat = length = 0.0
    for k in range(annular_fins.STRIP_COUNT):
        y = 0.5 * outer * (k + 0.5) / annular_fins.STRIP_COUNT
        chord = 2.0 * (math.sqrt(0.25 * outer**2 - y**2) - math.sqrt(max(0.25 * tube**2 - y**2, 0.0)))

        def shah(u: float, chord: float = chord) -> float:
            reynolds = 2.0 * gap * u / nu
            x = chord / (2.0 * gap) / reynolds
            bulk = (24.0 + 0.1685 / x - 3.44 * x**-0.5) / (1.0 + 0.000029 * x**-2)
            return float((3.44 * x**-0.5 + bulk) / reynolds)

        u = brentq(
            lambda u, c=chord, f=shah: driving * speed**2 - u**2 * (1.0 + 4.0 * f(u) * c / (2.0 * gap)),
            1e-9, 10.0 * speed, xtol=1e-14,
        )  # fmt: skip
        x = chord / (2.0 * gap) / (2.0 * gap * u / nu) / pr
        stephan = 7.55 + 0.024 * x**-1.14 / (1.0 + 0.0358 * pr**0.17 * x**-0.64)
        heat += u * gap / 2.0 * pr / nu * (1.0 - math.exp(-4.0 * stephan * x))
        length += chord
    return heat / length


@given(exponent=st.floats(-2.0, 7.0), ratio=st.floats(1.1, 4.9))
def test_fins_in_still_air_follow_tsubouchi_masuda(exponent, ratio):
    assert nusselt_annular_fins(10.0**exponent, ratio) == pytest.approx(
        published_still(10.0**exponent, ratio), rel=1e-10
    )


@given(
    speed=st.floats(0.3, 10.0),
    gap=st.floats(5e-4, 0.03),
    tube=st.floats(0.02, 0.08),
    ratio=st.floats(1.1, 4.0),
)
def test_fins_in_wind_agree_with_publications(speed, gap, tube, ratio):
    air = air_at(320.0)
    nu, pr, outer = float(air.kinematic_viscosity), float(air.prandtl), ratio * tube
    found = forced_side_film(speed, gap, tube, outer, nu, pr, driving=1.3, correction=0.8)
    expected = 0.8 / (1.0 + ratio**-2) * published_wind(speed, gap, tube, outer, nu, pr, 1.3)
    assert found == pytest.approx(expected, rel=1e-6)


# --------------------------------------------------------------- heat-transfer coefficients of a geometry


def drawn(law: str, speed: float, *, altitude: float = 0.0) -> DamperDrawing:
    upright = law == "disc"
    sink = HeatSink(fins=4, width=0.021, thickness=1.5e-3, pitch=0.014, film_multiplier=1.3)
    return replace(
        PAPER,
        body=replace(PAPER.body, orientation="vertical" if upright else "horizontal"),
        surroundings=replace(PAPER.surroundings, air_speed=speed, ambient=288.15, altitude=altitude),
        calibration=replace(PAPER.calibration, film=1.15),
        manufacture=Manufacture(tolerance=3e-4, fouling=1e-4),
        sink=sink,
    )  # fmt: skip


def by_hand(law: str, speed: float, kelvin: float, altitude: float) -> tuple[float, ...]:
    """Return the heat-transfer coefficients of body, fin sides, rim and floor [W/(m^2 K)]."""
    air = air_at(0.5 * (kelvin + 288.15), altitude)
    k, nu, pr = (float(each) for each in (air.conductivity, air.kinematic_viscosity, air.prandtl))
    tube, outer, gap, excess = 0.046, 0.088, 0.0125 - 5e-4, abs(kelvin - 288.15)

    def gr(size: float) -> float:
        return G * excess / (0.5 * (kelvin + 288.15)) * size**3 / nu**2

    def blown(size: float) -> float:
        return float(ht.Nu_cylinder_Churchill_Bernstein(speed * size / nu, pr)) * k / size

    def both(still: float, wind: float) -> float:
        return math.cbrt(still**3 + wind**3)

    cylinder = ht.Nu_horizontal_cylinder_Churchill_Chu
    body = cylinder(Pr=pr, Gr=gr(tube)) * k / tube
    if law == "disc":
        length = 0.2
        body = ht.Nu_vertical_cylinder_Popiel_Churchill(Pr=pr, Gr=gr(length), L=length, D=tube) * k / length
        open_m = (outer**2 - tube**2) / (4.0 * outer)
        up, down = (ht.Nu_horizontal_plate_McAdams(Pr=pr, Gr=gr(open_m), buoyancy=b) for b in (True, False))
        still = (0.5 * (up + down) * k / open_m,) * 3
    else:
        sides = published_still(gr(gap) * pr * gap / outer, outer / tube) * k / gap
        around = cylinder(Pr=pr, Gr=gr(outer)) * k / outer
        layer = k / around
        still = (sides, around * (1.0 + 1.5 * (1e-3 + layer) / (1.5e-3 + layer)), sides)
    if speed > 0.0:
        body = both(body, blown(tube))
        side = k * float(forced_side_film(speed, gap, tube, outer, nu, pr))
        wind = (side, 1.2 * blown(outer), side * float(floor_share(speed, gap, outer, nu, pr)))
        mixed = [both(one, other) for one, other in zip(still, wind, strict=True)]
        return (1.15 * body, *(1.3 * each for each in mixed))
    return (1.15 * body, *(1.3 * each for each in still))


@pytest.mark.parametrize(("speed", "altitude"), [(0.0, 0.0), (2.0, 1500.0)])
@pytest.mark.parametrize("law", ["annular", "disc"])
def test_heat_transfer_coefficients_equal_hand_computation(law, speed, altitude):
    drawing = drawn(law, speed, altitude=altitude)
    for kelvin in (270.0, 340.0, 420.0):
        fins = fin_films(drawing, kelvin)
        found = (body_film(drawing, kelvin), fins.sides, fins.rim, fins.floor)
        expected = by_hand(law, speed, kelvin, altitude)
        assert [float(each) for each in found] == pytest.approx(expected, rel=1e-9)
        faces, rim = 2.0 * math.pi * (0.044**2 - 0.023**2), 2.0 * math.pi * 0.044 * 1.5e-3
        mean = (faces * expected[1] + rim * expected[2]) / (faces + rim)
        assert float(fin_film(drawing, kelvin)) == pytest.approx(mean, rel=1e-9)


def sent_back_and_forth(
    emissivities: tuple[float, float], areas: tuple[float, float], opening: float
) -> float:
    """Return the emitted radiation of a groove relative to black walls, summed over reflections.

    All walls have the mean emissivity and exchange radiation uniformly.
    """
    walls = sum(areas)
    mean = sum(e * a for e, a in zip(emissivities, areas, strict=True)) / walls
    out, on_the_way = 0.0, mean
    for _ in range(2000):
        out += on_the_way * opening / walls
        on_the_way *= (1.0 - opening / walls) * (1.0 - mean)
    return out


@pytest.mark.parametrize("finish", [0.05, 0.3, 0.9])
def test_groove_radiation_equals_sum_of_reflections(finish):
    sink = HeatSink(fins=5, width=0.02, thickness=2e-3, pitch=0.008, emissivity=finish)
    drawing = replace(PAPER, sink=sink, surroundings=replace(PAPER.surroundings, emissivity=0.6))
    root, tip = 0.023, 0.043
    faces, floor = 2.0 * math.pi * (tip**2 - root**2), 2.0 * math.pi * root * 0.006
    expected = sent_back_and_forth((finish, 0.6), (faces, floor), 2.0 * math.pi * tip * 0.006)
    assert sink.groove_share(0.046, 0.6) == pytest.approx(expected, rel=1e-9)
    of_fin, groove = fin_radiation(drawing)
    assert groove == pytest.approx(expected, rel=1e-9)
    outside = faces + 5.0 * 2.0 * math.pi * tip * 2e-3
    whole = 2.0 * math.pi * ((tip + 1e-3) ** 2 - root**2)
    assert of_fin == pytest.approx((4.0 * faces * expected + outside * finish) / (5.0 * whole), rel=1e-9)


# ---------------------------------------------------------------------------------------------- moving fluid


@given(amplitude=st.floats(5e-4, 0.1), frequency=st.floats(0.05, 20.0), gap=st.floats(5e-4, 3e-3))
def test_moving_fluid_conductances_match_published_equations(amplitude, frequency, gap):
    """Each conductance is compared with a published equation.

    Gap: Stephan's equation for slits. Chamber: heat penetration into fluid that is renewed. Exchange: heat
    that the displaced fluid carries.
    """
    k, heat, piston, gap_area, long, chamber, width = 0.3, 1.9e6, 8e-4, 1.1e-4, 0.07, 0.06, 0.011
    channel = Channel(gap, gap_area, piston, long, chamber, width, k, heat)
    found = conduct_fluid(channel, Stroke(amplitude, frequency))
    speed = 4.0 * amplitude * frequency * piston / gap_area
    x = long / (2.0 * gap) / (2.0 * gap * speed * heat / k)
    stephan = 7.55 + 0.024 * x**-1.14 / (1.0 + 0.0358 * 300.0**0.17 * x**-0.64)
    assert found.gap == pytest.approx(k * stephan / 12.0, rel=1e-9)
    renewed = frequency * min(1.0, 2.0 * amplitude / chamber)
    penetration = 2.0 * math.sqrt(2.0 / math.pi * k * heat * renewed)
    assert found.chamber == pytest.approx(max(k, penetration * width / 4.0), rel=1e-9)
    pushed = 2.0 * amplitude * piston
    carried = heat * frequency * pushed * min(1.0, pushed / (gap_area * long))
    assert found.exchange == pytest.approx(0.5 * carried, rel=1e-9)
