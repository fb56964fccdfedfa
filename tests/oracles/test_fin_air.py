"""Laws of annular fins against air computed by finite volumes: two gaps, still and in wind."""

from __future__ import annotations

import math

import pytest

from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.annular_fins import forced_side_film, nusselt_annular_fins
from mrdamper.thermal.films.correlations import nusselt_fin_channel, nusselt_horizontal_cylinder
from tests.oracles.fin_air import compute_fin_air

TUBE, OUTER, EXCESS_K = 0.046, 0.092, 60.0
AIR = air_at(293.15 + 0.5 * EXCESS_K)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, tool):
    tool("cc")
    return tmp_path_factory.mktemp("fin_air")


@pytest.mark.release
def test_a_bare_tube_in_still_air_is_churchill_and_chu_s(folder):
    """The computation itself against a law that measurements are behind."""
    found = compute_fin_air(folder, 1e-3, outer=0.0, thickness=0.0)
    law = float(nusselt_horizontal_cylinder(AIR.rayleigh(TUBE, EXCESS_K), AIR.prandtl)) / TUBE
    assert found.floor == pytest.approx(law, rel=0.10)


@pytest.mark.release
@pytest.mark.parametrize("gap", [0.005, 0.010])
def test_still_air_between_fins(folder, gap):
    """The law averages sides and floor, and so does this; channels that know no tube are far too good."""
    found = compute_fin_air(folder, gap)
    sides, floor = math.pi * (OUTER**2 - TUBE**2) / 4.0, math.pi * TUBE * 0.5 * gap  # a half of a groove's
    mean = (sides * found.sides + floor * found.floor) / (sides + floor)
    law = float(nusselt_annular_fins(AIR.rayleigh(gap, EXCESS_K) * gap / OUTER, OUTER / TUBE)) / gap
    assert law == pytest.approx(mean, rel=0.20)
    channel = nusselt_fin_channel(AIR.rayleigh(gap, EXCESS_K), gap / (0.25 * math.pi * OUTER)) / gap
    assert float(channel) > 1.3 * mean
    assert found.floor < found.sides < found.rim


@pytest.mark.release
@pytest.mark.parametrize("gap", [0.003, 0.0065])
def test_wind_between_fins(folder, gap):
    found = compute_fin_air(folder, gap, wind=2.0)
    law = float(forced_side_film(2.0, gap, TUBE, OUTER, AIR.kinematic_viscosity, AIR.prandtl))
    assert law == pytest.approx(found.sides, rel=0.20)
    assert found.floor < found.sides
