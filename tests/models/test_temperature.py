"""Temperature factors are 1 at 20 degC and agree with formulas, derivatives and limiting cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, Vft
from mrdamper.quantities import REFERENCE_K

linears = st.builds(Linear, st.floats(-5e-3, 5e-3))
arrheniuses = st.builds(Arrhenius, st.floats(-3000.0, 8000.0))
reynoldses = st.builds(Reynolds, st.floats(-0.05, 0.05))
vfts = st.builds(Vft, st.floats(-500.0, 2000.0), st.floats(-100.0, 200.0))
polynomials = st.lists(st.floats(-1e-2, 1e-2), min_size=1, max_size=3).map(
    lambda parameters: PolynomialFactor(tuple(n / 100.0**k for k, n in enumerate(parameters)))
)
factors = st.one_of(linears, arrheniuses, reynoldses, vfts, polynomials)
temperatures = st.floats(233.15, 423.15)


@given(factors)
def test_temperature_factors_are_one_at_20_degC(factor):
    assert float(factor.value(REFERENCE_K)) == 1.0
    np.testing.assert_array_equal(factor.gradient(REFERENCE_K), np.zeros(len(factor.parameters)))


@given(arrheniuses, temperatures)
def test_arrhenius_factor_is_vft_with_zero_pole(factor, kelvin):
    same = Vft(factor.activation_K, 0.0)
    assert float(same.value(kelvin)) == float(factor.value(kelvin))
    assert same.gradient(kelvin)[0] == factor.gradient(kelvin)[0]


@given(reynoldses, temperatures)
def test_vft_factor_with_low_pole_is_reynolds(factor, kelvin):
    """For p -> -infinity and B = rate (T0 - p)^2, the VFT factor tends to exp(-rate (T - T0))."""
    pole = -1e6
    far = Vft(factor.temperature_rate * (REFERENCE_K - pole) ** 2, pole)
    exponent = math.log(float(factor.value(kelvin)))
    assert math.log(float(far.value(kelvin))) == pytest.approx(exponent, rel=2e-4, abs=1e-9)


@given(st.floats(1e-5, 5e-3), temperatures)
def test_linear_temperature_factor_is_polynomial(slope, kelvin):
    assert float(PolynomialFactor((-slope,)).value(kelvin)) == pytest.approx(
        float(Linear(slope).value(kelvin)), rel=1e-13
    )


@given(st.floats(100.0, 8000.0))
def test_arrhenius_viscosity_decreases_and_is_convex(activation):
    """The paper states a steep decrease from 20 to 60 degC and a slower decrease above 60 degC."""
    values = Arrhenius(activation).value(np.linspace(253.15, 403.15, 60))
    assert (np.diff(values) < 0.0).all()
    assert (np.diff(values, 2) > 0.0).all()


def test_vft_factor_is_infinite_below_pole():
    values = Vft(700.0, 200.0).value([150.0, 200.0, 200.001])
    assert not np.isfinite(values).any()
    assert np.isfinite(Vft(700.0, 200.0).value(210.0))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Arrhenius(math.nan), "activation_K is nan"),
        (lambda: Reynolds(math.inf), "temperature_rate is inf"),
        (lambda: Vft(700.0, 293.15), r"vft_pole_K is 293\.15 K; it must be below 293\.15 K"),
        (lambda: PolynomialFactor(()), "expected one or more finite numbers"),
        (lambda: PolynomialFactor((1.0, math.nan)), "expected one or more finite numbers"),
    ],
)
def test_invalid_temperature_factor_is_rejected(make, said):
    with pytest.raises(InputError, match=said):
        make()
