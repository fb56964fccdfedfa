"""At high altitude, air of low density removes less heat."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.films.air import air_at
from mrdamper.thermal.model.surfaces import body_film

BARE = read_drawing("paper").with_sink(None)


def test_low_air_density_reduces_cooling():
    """Half the density halves Re and quarters Ra. The coefficient falls by less than the density."""
    high = replace(BARE, surroundings=replace(BARE.surroundings, altitude=5500.0))
    share = float(body_film(high, 350.0) / body_film(BARE, 350.0))
    density = float(air_at(320.0).kinematic_viscosity / air_at(320.0, 5500.0).kinematic_viscosity)
    assert density == pytest.approx(0.498, abs=0.002)  # Standard pressure ratio, 5500 m to sea level.
    assert density < share < 1.0
