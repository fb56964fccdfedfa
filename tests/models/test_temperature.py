"""Temperature factors: one at 20 degC, their forms on paper, their gradients, how one contains another."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.temperature import (
    FACTORS,
    REFERENCE_K,
    Arrhenius,
    Linear,
    PolynomialFactor,
    Reynolds,
    Vft,
)

linears = st.builds(Linear, st.floats(-5e-3, 5e-3))
arrheniuses = st.builds(Arrhenius, st.floats(-3000.0, 8000.0))
reynoldses = st.builds(Reynolds, st.floats(-0.05, 0.05))
vfts = st.builds(Vft, st.floats(-500.0, 2000.0), st.floats(-100.0, 200.0))
polynomials = st.lists(st.floats(-1e-2, 1e-2), min_size=1, max_size=3).map(
    lambda parameters: PolynomialFactor(tuple(n / 100.0**k for k, n in enumerate(parameters)))
)
factors = st.one_of(linears, arrheniuses, reynoldses, vfts, polynomials)
temperatures = st.floats(233.15, 423.15)


def on_paper(factor, parameters, kelvin):
    """Return the form as one writes it down; the numbers may be complex."""
    above = kelvin - 293.15
    match factor.kind:
        case "linear":
            return 1.0 - parameters[0] * above
        case "arrhenius":
            return cmath.exp(parameters[0] * (1.0 / kelvin - 1.0 / 293.15))
        case "reynolds":
            return cmath.exp(-parameters[0] * above)
        case "vft":
            b, pole = parameters
            return cmath.exp(b / (kelvin - pole) - b / (293.15 - pole))
        case "polynomial":
            return 1.0 + sum(c * above ** (k + 1) for k, c in enumerate(parameters))


@given(factors)
def test_every_factor_is_one_at_20_degC(factor):
    assert float(factor.value(REFERENCE_K)) == 1.0
    np.testing.assert_array_equal(factor.gradient(REFERENCE_K), np.zeros(len(factor.parameters)))


@given(factors, temperatures)
def test_the_value_is_the_form_on_paper(factor, kelvin):
    expected = on_paper(factor, factor.parameters, kelvin)
    assert float(factor.value(kelvin)) == pytest.approx(complex(expected).real, rel=1e-12)


@given(factors, temperatures)
def test_the_gradient_is_the_complex_step(factor, kelvin):
    """The complex step has no difference of nearly equal numbers in it: agreement to rounding."""
    gradient = factor.gradient(kelvin)
    for k in range(len(factor.parameters)):
        moved = [complex(x, 1e-30 if i == k else 0.0) for i, x in enumerate(factor.parameters)]
        expected = complex(on_paper(factor, moved, kelvin)).imag / 1e-30
        # 1/(T - pole) - 1/(T0 - pole) cancels near 20 degC, here and on paper
        allowed = 1e-13 * float(factor.value(kelvin)) * max(1.0, abs(factor.parameters[0]))
        assert gradient[k] == pytest.approx(expected, rel=1e-9, abs=allowed)


@given(arrheniuses, temperatures)
def test_arrhenius_is_vft_with_its_pole_at_absolute_zero(factor, kelvin):
    same = Vft(factor.activation_K, 0.0)
    assert float(same.value(kelvin)) == float(factor.value(kelvin))
    assert same.gradient(kelvin)[0] == factor.gradient(kelvin)[0]


@given(reynoldses, temperatures)
def test_vft_with_a_pole_far_below_is_reynolds_law(factor, kelvin):
    """B/(T - p) - B/(T0 - p) -> -B x/p^2 as p -> -infinity, with B = rate p^2; the error falls like x/|p|."""
    pole = -1e6
    far = Vft(factor.temperature_rate * (REFERENCE_K - pole) ** 2, pole)
    exponent = math.log(float(factor.value(kelvin)))
    assert math.log(float(far.value(kelvin))) == pytest.approx(exponent, rel=2e-4, abs=1e-9)


@given(st.floats(1e-5, 5e-3), temperatures)
def test_a_linear_factor_is_a_polynomial_of_degree_one(slope, kelvin):
    assert float(PolynomialFactor((-slope,)).value(kelvin)) == pytest.approx(
        float(Linear(slope).value(kelvin)), rel=1e-13
    )


@given(st.floats(100.0, 8000.0))
def test_a_viscosity_with_positive_activation_falls_ever_slower(activation):
    """The paper's text: a steep fall from 20 to 60 degC, slower from there on."""
    values = Arrhenius(activation).value(np.linspace(253.15, 403.15, 60))
    assert (np.diff(values) < 0.0).all()
    assert (np.diff(values, 2) > 0.0).all()


def test_a_vft_law_is_not_finite_at_and_below_its_pole():
    values = Vft(700.0, 200.0).value([150.0, 200.0, 200.001])
    assert not np.isfinite(values).any()
    assert np.isfinite(Vft(700.0, 200.0).value(210.0))


@pytest.mark.parametrize(
    "factor",
    [Linear(1e-3), Arrhenius(1400.0), Reynolds(0.01), Vft(700.0, 160.0), PolynomialFactor((1e-3, 1e-6))],
)
@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3)])
def test_shapes_follow_the_temperature(factor, shape):
    kelvin = np.linspace(280.0, 390.0, int(np.prod(shape))).reshape(shape)
    assert factor.value(kelvin).shape == shape
    assert factor.gradient(kelvin).shape == (len(factor.parameters), *shape)
    assert len(factor.parameter_names) == len(factor.units) == len(factor.parameters)
    assert FACTORS[factor.kind] is type(factor)


@given(factors)
def test_the_same_numbers_make_the_same_factor(factor):
    assert factor.with_parameters(factor.parameters) == factor


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
def test_a_number_that_no_factor_can_hold_is_refused_by_name(make, said):
    with pytest.raises(InputError, match=said):
        make()
