"""At high altitude, air of low density removes less heat."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.model.surfaces import body_film

BARE = read_drawing("paper").with_sink(None)


def test_low_air_density_reduces_cooling():
    """At half the air density, the heat-transfer coefficient falls, but by less than the density."""
    high = replace(BARE, surroundings=replace(BARE.surroundings, altitude=5500.0))
    share = float(body_film(high, 350.0) / body_film(BARE, 350.0))
    density = float(air_at(320.0).kinematic_viscosity / air_at(320.0, 5500.0).kinematic_viscosity)
    assert density == pytest.approx(0.498, abs=0.002)  # Pressure at 5500 m divided by pressure at sea level
    assert density < share < 1.0
