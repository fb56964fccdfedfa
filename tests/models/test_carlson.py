"""Carlson's formulas of MR fluids agree with published points, a root finder, and their limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mrdamper.errors import InputError
from mrdamper.models.fluids.carlson import (
    CARRIERS,
    MU_0,
    Carlson,
    checked_fraction,
    field_strength,
    flux_density,
    saturation_stress,
)

fractions = st.floats(0.02, 0.6)
fields = st.floats(1.0, 1e7)  # Magnetic field strength [A/m]


@pytest.mark.parametrize(
    ("field", "printed", "deviation_percent"), [(18e3, 4640.0, 17), (46e3, 13770.0, -2), (80e3, 23470.0, -5)]
)
def test_carlson_formula_deviates_from_data_as_documented(field, printed, deviation_percent):
    """The points are for MRF-132DG (32 % iron in a hydrocarbon), taken from a secondary source."""
    law = Carlson(saturation_stress(0.32, CARRIERS["hydrocarbon"]))
    deviation = 100.0 * (float(law.stress(field)) / printed - 1.0)
    assert deviation == pytest.approx(deviation_percent, abs=1.0)


def test_32_percent_iron_gives_saturation_of_48_kilopascal():
    assert saturation_stress(0.32) == pytest.approx(47.9e3, rel=2e-3)
    assert float(Carlson(saturation_stress(0.32)).stress(1e7)) == pytest.approx(47.9e3, rel=2e-3)


def test_flux_density_gives_known_field_strength():
    """With 32 % iron, 100 to 600 mT require a field of 12.7 to 129.6 kA/m (computed by hand)."""
    strengths = field_strength([0.1, 0.2, 0.4, 0.6], 0.32)
    np.testing.assert_allclose(strengths, [12.7e3, 27.5e3, 66.8e3, 129.6e3], rtol=4e-3)


@given(fields, fractions)
def test_field_strength_inverts_flux_density(field, fraction):
    there = float(flux_density(field, fraction))
    assert float(field_strength(there, fraction)) == pytest.approx(field, rel=1e-9)


@pytest.mark.parametrize("flux", [0.05, 0.3, 0.8, 1.5])
def test_field_strength_matches_root_finder(flux):
    found = brentq(lambda field: float(flux_density(field, 0.32)) - flux, 0.0, 1e7, xtol=1e-6)
    assert float(field_strength(flux, 0.32)) == pytest.approx(found, rel=1e-10)


@given(fields, fractions)
def test_iron_adds_limited_flux_density(field, fraction):
    """The flux density exceeds the value in air, mu0 H, by at most the saturation of the iron."""
    added = float(flux_density(field, fraction)) - MU_0 * field
    assert 0.0 < added <= 1.91 * fraction**1.133 * (1 + 1e-9)


@given(fields, fractions)
def test_flux_is_odd_and_stress_even(field, fraction):
    law = Carlson(saturation_stress(fraction))
    assert float(flux_density(-field, fraction)) == -float(flux_density(field, fraction))
    assert float(field_strength(-0.3, fraction)) == -float(field_strength(0.3, fraction))
    assert float(law.stress(-field)) == float(law.stress(field))


def test_zero_field_gives_zero_flux_and_stress():
    assert float(flux_density(0.0, 0.3)) == 0.0
    assert float(field_strength(0.0, 0.3)) == 0.0
    assert float(Carlson(4e4).stress(0.0)) == 0.0


@given(st.floats(1.0, 1e5))
def test_yield_stress_is_linear_in_weak_field(saturation):
    law = Carlson(saturation)
    assert float(law.stress(200.0)) == pytest.approx(2.0 * float(law.stress(100.0)), rel=1e-5)


@pytest.mark.parametrize("fraction", [0.0, -0.1, 0.7, 32.0, float("nan")])
def test_invalid_iron_fraction_is_rejected(fraction):
    with pytest.raises(InputError, match=r"volume fraction of iron.*32 % by volume is 0\.32"):
        checked_fraction(fraction)


@pytest.mark.parametrize("fraction", [0.02, 0.32, 0.6])
def test_field_strength_is_exact_for_weak_flux(fraction):
    """A weak flux density is proportional to the field strength."""
    flux = np.geomspace(1e-10, 3.0, 60)
    field = field_strength(flux, fraction)
    assert flux_density(field, fraction) == pytest.approx(flux, rel=1e-13)
    steep = float(flux_density(1e-3, fraction)) / 1e-3
    assert field[:10] == pytest.approx(flux[:10] / steep, rel=1e-6)
