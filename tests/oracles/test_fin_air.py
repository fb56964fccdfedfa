"""Correlations of annular fins agree with air flows computed by finite volumes, in still air and wind."""

from __future__ import annotations

import pytest

from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.correlations import nusselt_horizontal_cylinder
from tests.oracles.fin_air import compute_fin_air, law_of, settle_fin_air

TUBE, OUTER, EXCESS_K = 0.046, 0.092, 60.0
AIR = air_at(293.15 + 0.5 * EXCESS_K)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, tool):
    tool("cc")
    return tmp_path_factory.mktemp("fin_air")


@pytest.mark.release
def test_flow_around_bare_tube_matches_churchill_chu(folder):
    """The computed flow agrees with a correlation that is based on measurements."""
    found = compute_fin_air(folder, 2e-3, outer=0.0, thickness=0.0)
    law = float(nusselt_horizontal_cylinder(AIR.rayleigh(TUBE, EXCESS_K), AIR.prandtl)) / TUBE
    assert found.mean == pytest.approx(law, rel=0.05)


@pytest.mark.release
def test_flow_along_single_disc_matches_pohlhausen(folder):
    """Pohlhausen's formula for flow along strips (``test_annular_fins``) gives h / k = 735 per metre."""
    found = compute_fin_air(folder, 0.02, tube=0.006, thickness=5e-4, wind=2.0, fine=1)
    assert found.sides == pytest.approx(735.0, rel=0.08)


@pytest.mark.release
@pytest.mark.parametrize(("gap", "within"), [(0.002, 0.20), (0.003, 0.20), (0.005, 0.08), (0.010, 0.08)])
def test_still_air_correlation_matches_computed_flow(folder, gap, within):
    """The correlation was not fitted to the computed flows."""
    found = settle_fin_air(folder, gap)
    assert found.doubt < 0.05
    assert law_of(gap, 0.0) == pytest.approx(found.mean, rel=within)
    assert found.floor < found.sides < found.rim


@pytest.mark.release
@pytest.mark.parametrize(("tube", "outer"), [(0.046, 0.069), (0.030, 0.090)])
def test_still_air_correlation_matches_fins_of_other_sizes(folder, tube, outer):
    found = settle_fin_air(folder, 0.003, tube=tube, outer=outer)
    assert law_of(0.003, 0.0, tube, outer) == pytest.approx(found.mean, rel=0.20)


@pytest.mark.release
@pytest.mark.parametrize("gap", [0.003, 0.0065])
def test_wind_correlation_matches_computed_flow(folder, gap):
    found = settle_fin_air(folder, gap, wind=2.0)
    assert law_of(gap, 2.0) == pytest.approx(found.sides, rel=0.20)
