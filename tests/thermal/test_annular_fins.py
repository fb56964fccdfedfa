"""Correlations of annular fins agree with limits, closed forms, and published rules for the best gap."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.films.annular_fins import (
    best_gap_in_wind,
    forced_side_film,
    nusselt_annular_fins,
)
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.surfaces import fin_films

TUBE, OUTER, EXCESS_K = 0.046, 0.092, 60.0
AIR = air_at(293.15 + 0.5 * EXCESS_K)
WIND = (AIR.kinematic_viscosity, AIR.prandtl)
DRAWING = read_drawing("paper")


def still(gap: float) -> float:
    """Return the heat-transfer coefficient of fins in still air divided by the conductivity of air [1/m]."""
    rayleigh = AIR.rayleigh(gap, EXCESS_K) * gap / OUTER
    return float(nusselt_annular_fins(rayleigh, OUTER / TUBE)) / gap


def windy(gap: float, speed: float = 2.0) -> float:
    return float(forced_side_film(speed, gap, TUBE, OUTER, *WIND))


@pytest.mark.parametrize("ratio", [1.2, 2.0, 3.0])
def test_narrow_fin_gaps_have_developed_flow(ratio):
    """The reference is the potential flow between two fins. All of this air leaves at the fin temperature."""
    inner = 1.0 / ratio
    # Pressure and buoyancy are proportional to sin(theta). The pressure is zero at the rim, and no air flows
    # through the tube.
    ring = solve_bvp(
        lambda r, p: np.vstack([p[1], p[0] / r**2 - p[1] / r]),
        lambda at_tube, at_rim: np.array([1.0 - at_tube[1], at_rim[0]]),
        np.linspace(inner, 1.0, 50),
        np.zeros((2, 50)),
        tol=1e-9,
    )
    # Flow through the lower half of the rim, divided by the speed Ra / 12
    enters = 2.0 * (1.0 - ring.sol(1.0)[1])
    # The flow is divided by 12 and by the area of both faces of a fin, in units of (D / 2)^2.
    exact = enters / (12.0 * math.pi * (1.0 - inner**2))
    assert float(nusselt_annular_fins(1e-3, ratio)) / 1e-3 == pytest.approx(exact, rel=1e-6)


def test_single_fin_disc_agrees_with_pohlhausen():
    """The reference sums strips of a disc without tube as laminar plates, Nu = 0.664 Re^1/2 Pr^1/3."""
    nu, pr = float(AIR.kinematic_viscosity), float(AIR.prandtl)
    height = 0.5 * OUTER * (np.arange(4000) + 0.5) / 4000
    chord = np.sqrt(OUTER**2 - 4.0 * height**2)
    exact = (0.664 * np.sqrt(2.0 * chord / nu) * pr ** (1 / 3)).sum() / chord.sum()
    ours = float(forced_side_film(2.0, 0.2, 0.0, OUTER, *WIND, driving=1.0, correction=1.0))
    assert ours == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize(
    ("speed", "low", "high"), [(0.0, 5.0, 6.5), (2.0, 2.0, 3.5), (10.0, 0.8, 1.8), (0.7, 3.5, 6.0)]
)
def test_best_fin_gap_agrees_with_publications(speed, low, high):
    """The best gap of fins of 1 mm agrees with Senapati (2016) in still air and with Bejan's rule in wind."""
    gaps = np.arange(0.5e-3, 12e-3, 0.05e-3)
    film = still if speed == 0.0 else lambda gap: windy(gap, speed)
    best = gaps[int(np.argmax([film(gap) / (gap + 1e-3) for gap in gaps]))]
    assert low <= 1e3 * best <= high
    if speed > 0.0:
        rule = float(best_gap_in_wind(speed, OUTER, *WIND))
        assert best == pytest.approx(rule, rel=0.25)


def test_interpolated_fin_coefficients_agree_with_exact_values():
    """Forced convection is computed at a few temperatures. The interpolation error is below 1e-6."""
    sink = HeatSink(fins=8, width=0.02, thickness=1e-3, pitch=4e-3, film_multiplier=1.3)
    drawing = replace(DRAWING, sink=sink, surroundings=replace(DRAWING.surroundings, air_speed=1.5))
    kelvin = np.linspace(240.0, 460.0, 100)
    many = fin_films(drawing, kelvin)
    for place in (3, 47, 96):
        one = fin_films(drawing, kelvin[place])
        for name in ("sides", "rim", "floor"):
            assert float(getattr(one, name)) == pytest.approx(getattr(many, name)[place], rel=1e-6)
