"""Functions for coefficients (of current and temperature) have correct limits, gradients and JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.models.card_schema import CoefficientRecord, parameter_law, record_of_law
from mrdamper.models.dependence import (
    Bipolynomial,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    Saturation,
    TemperatureDependent,
)
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, Vft
from mrdamper.schema import read_record, write_record

amounts = st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-6)
constants = st.builds(Constant, amounts)
polynomials = st.lists(amounts, min_size=1, max_size=5).map(lambda parameters: Polynomial(tuple(parameters)))
hills = st.builds(
    Hill,
    amounts,
    amounts,
    st.floats(0.05, 20.0),
    st.floats(0.2, 8.0),
    reference=st.sampled_from([1.0, 0.5, 3.0]),
)
saturations = st.builds(
    Saturation,
    amounts,
    amounts,
    st.floats(0.05, 20.0),
    st.floats(0.2, 8.0),
    reference=st.sampled_from([1.0, 0.5, 3.0]),
    sharpness=st.floats(0.3, 6.0),
)
exponentials = st.builds(Exponential, amounts, st.floats(-3.0, 3.0))
bipolynomials = st.integers(0, 3).flatmap(
    lambda degree: st.integers(1, 4).flatmap(
        lambda rows: st.lists(amounts, min_size=rows * (degree + 1), max_size=rows * (degree + 1)).map(
            lambda parameters: Bipolynomial(tuple(parameters), degree)
        )
    )
)
FORMS = {
    "constant": constants,
    "polynomial": polynomials,
    "hill": hills,
    "saturation": saturations,
    "exponential": exponentials,
}
FACTORS_DRAWN = {
    "linear": st.builds(Linear, st.floats(-0.01, 0.01)),
    "arrhenius": st.builds(Arrhenius, st.floats(-1000.0, 6000.0)),
    "reynolds": st.builds(Reynolds, st.floats(-0.02, 0.08)),
    "vft": st.builds(Vft, st.floats(20.0, 3000.0), st.floats(20.0, 200.0)),
    "polynomial": st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=3).map(
        lambda parameters: PolynomialFactor(tuple(parameters))
    ),
}
temperature_dependent = st.builds(
    TemperatureDependent, st.one_of(*FORMS.values()), st.one_of(*FACTORS_DRAWN.values()), st.booleans()
)
cold_laws = st.one_of(*FORMS.values())
laws = st.one_of(cold_laws, bipolynomials, temperature_dependent)
commands = st.floats(-5.0, 5.0).filter(lambda x: x == 0.0 or abs(x) > 1e-3)
kelvins = st.floats(233.15, 423.15)  # -40 to 150 degC
every_factor = pytest.mark.parametrize("factor", FACTORS_DRAWN)


def factor_on_paper(kind, parameters, kelvin):
    """Return a temperature factor from its textbook formula. The arguments may be complex."""
    above = kelvin - 293.15
    match kind:
        case "linear":
            return 1 - parameters[0] * above
        case "arrhenius":
            return np.exp(parameters[0] * (1 / kelvin - 1 / 293.15))
        case "reynolds":
            return np.exp(-parameters[0] * above)
        case "vft":
            strength, pole = parameters
            return np.exp(strength * (1 / (kelvin - pole) - 1 / (293.15 - pole)))
        case "polynomial":
            return 1 + sum(t * above**power for power, t in enumerate(parameters, start=1))


def on_paper(law, parameters, command, kelvin=293.15):
    """Return a coefficient from its textbook formula. Parameters or command may be complex."""
    if isinstance(law, TemperatureDependent):
        split = len(law.form.parameters)
        factor = factor_on_paper(law.factor.kind, parameters[split:], kelvin)
        return on_paper(law.form, parameters[:split], command) * factor
    match law.kind:
        case "bipolynomial":
            columns = law.temperature_degree + 1
            above = kelvin - 293.15
            return sum(
                c * command ** (k // columns) * above ** (k % columns) for k, c in enumerate(parameters)
            )
        case "constant":
            return parameters[0] + 0 * command
        case "polynomial":
            return sum(c * command**power for power, c in enumerate(parameters))
        case "hill" | "saturation":
            base, gain, half, q, r = [*parameters, 1][:5]
            u = command * (1 if command.real >= 0 else -1) / law.reference
            h = half / law.reference
            return base + gain * ((1 + h ** (q * r)) / (u ** (q * r) + h ** (q * r))) ** (1 / r) * u**q
        case "exponential":
            return parameters[0] * np.exp(parameters[1] * command)


def scale_of(law, command, kelvin):
    """Return the sum of the absolute terms of a value. Rounding errors are proportional to this sum."""
    if isinstance(law, TemperatureDependent):
        factor = abs(float(law.factor.value(kelvin)))
        if isinstance(law.factor, PolynomialFactor):
            factor += sum(
                abs(t) * abs(kelvin - 293.15) ** k for k, t in enumerate(law.factor.parameters, start=1)
            )
        return scale_of(law.form, command, kelvin) * (1.0 + factor)
    if isinstance(law, Bipolynomial):
        return float(np.abs(law.gradient(command, kelvin)) @ np.abs(law.parameters))
    return sum(map(abs, law.parameters)) + abs(float(law.value(command)))


@given(laws, commands, kelvins)
def test_coefficient_value_equals_formula(law, command, kelvin):
    expected = on_paper(law, law.parameters, command, kelvin)
    scale = scale_of(law, command, kelvin)
    found = float(law.value(command, kelvin))
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12 * scale + 1e-300)


def assert_gradient(law, command, kelvin):
    """Compare the gradient with the complex step, which has no cancellation error."""
    for k in range(len(law.parameters)):
        step = 1e-30
        moved = [complex(x, step if i == k else 0.0) for i, x in enumerate(law.parameters)]
        expected = on_paper(law, moved, complex(command), kelvin).imag / step
        scale = 1e-12 * scale_of(law, command, kelvin) + 1e-300
        assert law.gradient(command, kelvin)[k] == pytest.approx(expected, rel=1e-10, abs=scale)


def assert_slope(law, command, kelvin):
    parameters = [complex(x) for x in law.parameters]
    expected = on_paper(law, parameters, complex(command, 1e-30), kelvin).imag / 1e-30
    scale = 1e-12 * scale_of(law, command, kelvin) + 1e-300
    assert float(law.slope(command, kelvin)) == pytest.approx(expected, rel=1e-10, abs=scale)


@given(st.one_of(cold_laws, bipolynomials), commands.filter(bool), kelvins)
def test_coefficient_gradient_equals_complex_step(law, command, kelvin):
    assert_gradient(law, command, kelvin)
    assert_slope(law, command, kelvin)


@pytest.mark.system
@every_factor
@given(data=st.data(), command=commands.filter(bool), kelvin=kelvins)
def test_gradient_with_temperature_equals_complex_step(factor, data, command, kelvin):
    law = TemperatureDependent(data.draw(cold_laws), data.draw(FACTORS_DRAWN[factor]))
    assert_gradient(law, command, kelvin)
    assert_slope(law, command, kelvin)


@given(st.one_of(bipolynomials, temperature_dependent), commands, kelvins)
def test_coefficient_is_jointly_linear_in_linear_parameters(law, command, kelvin):
    """The derivative by a linear parameter does not depend on any linear parameter."""
    twice = [2.0 * x if linear else x for x, linear in zip(law.parameters, law.linear, strict=True)]
    both = law.with_parameters(twice)
    for k, linear in enumerate(law.linear):
        if linear:
            np.testing.assert_array_equal(both.gradient(command, kelvin)[k], law.gradient(command, kelvin)[k])


SOME: list[ParameterLaw] = [
    Constant(2.0),
    Polynomial((1.0, 2.0, 3.0)),
    Hill(1.0, 2.0, 0.7, 1.5),
    Exponential(2.0, -0.5),
    Bipolynomial((1.0, 2.0, 3.0, 4.0), 1),
    TemperatureDependent(Hill(1.0, 2.0, 0.7, 1.5), Vft(600.0, 150.0)),
    TemperatureDependent(Polynomial((1.0, 2.0)), PolynomialFactor((1e-3, 1e-6))),
]


@pytest.mark.parametrize("law", SOME, ids=lambda law: f"{type(law).__name__} {law.kind}")
@pytest.mark.parametrize("shape", [(), (7,), (2, 3)])
@pytest.mark.parametrize("kelvin", [None, "each"])
def test_coefficient_values_have_shape_of_command(law, shape, kelvin):
    command = np.linspace(0.0, 2.0, int(np.prod(shape))).reshape(shape)
    warm = 300.0 + 40.0 * command if kelvin == "each" else kelvin
    assert law.value(command, warm).shape == shape
    assert law.slope(command, warm).shape == shape
    assert law.gradient(command, warm).shape == (len(law.parameters), *shape)
    assert len(law.parameter_names) == len(law.linear) == len(law.units("N", "A")) == len(law.parameters)
    assert len(set(law.parameter_names)) == len(law.parameters)


# ---------------------------------------------------------------------------------- dependence on temperature


@given(laws, commands)
def test_missing_temperature_means_20_degrees(law, command):
    np.testing.assert_array_equal(law.value(command), law.value(command, 293.15))
    np.testing.assert_array_equal(law.gradient(command), law.gradient(command, 293.15))
    np.testing.assert_array_equal(law.slope(command), law.slope(command, 293.15))


@given(temperature_dependent, commands, commands, kelvins)
def test_relative_temperature_effect_is_independent_of_command(law, here, there, kelvin):
    """The relative change of a coefficient with temperature is the same at every command."""
    one, two = law.value(here, kelvin) * law.value(there), law.value(there, kelvin) * law.value(here)
    assert one == pytest.approx(two, rel=1e-12, abs=1e-300)


@given(polynomials, commands, kelvins)
def test_bipolynomial_of_degree_zero_in_temperature_is_polynomial(law, command, kelvin):
    flat = Bipolynomial(law.parameters, 0)
    assert not flat.temperature_dependent
    scale = 1e-13 * scale_of(flat, command, kelvin) + 1e-300
    np.testing.assert_allclose(flat.gradient(command, kelvin), law.gradient(command), rtol=1e-14)
    assert float(flat.value(command, kelvin)) == pytest.approx(float(law.value(command)), abs=scale)
    slope = float(law.slope(command))
    assert float(flat.slope(command, kelvin)) == pytest.approx(slope, rel=1e-12, abs=20.0 * scale)
    assert flat.units("N", "A") == law.units("N", "A")


@given(
    st.lists(amounts, min_size=1, max_size=3),
    st.lists(st.floats(-0.01, 0.01), min_size=1, max_size=2),
    commands,
    kelvins,
)
def test_separable_polynomial_equals_bipolynomial(command, factor, at, kelvin):
    """(a0 + a1 I + ...)(1 + t1 dT + ...) has the bipolynomial coefficients c_ij = a_i t_j with t_0 = 1."""
    law = TemperatureDependent(Polynomial(tuple(command)), PolynomialFactor(tuple(factor)))
    assert law.kind == "polynomial"
    assert law.parameter_names == (
        *(f"c{i}" for i in range(len(command))),
        *(f"t{j}" for j in range(1, len(factor) + 1)),
    )
    out = Bipolynomial(tuple(a * t for a in command for t in (1.0, *factor)), len(factor))
    allowed = 1e-12 * scale_of(out, at, kelvin) + 1e-300
    assert float(law.value(at, kelvin)) == pytest.approx(float(out.value(at, kelvin)), abs=allowed)


@given(hills, commands)
def test_saturation_with_sharpness_one_equals_hill_function(law, command):
    same = Saturation(law.base, law.gain, law.half_command, law.exponent, law.reference)
    assert float(same.value(command)) == float(law.value(command))
    assert float(same.slope(command)) == float(law.slope(command))
    np.testing.assert_array_equal(same.gradient(command)[:4], law.gradient(command))


def test_sharp_saturation_is_power_then_constant():
    law, low = Saturation(10.0, 200.0, 0.5, 1.5, 1.0, sharpness=40.0), np.array([0.125, 0.25])
    np.testing.assert_allclose(law.value(low), 10.0 + 200.0 * (low / 0.5) ** 1.5, rtol=1e-9)
    np.testing.assert_allclose(law.value([0.75, 1.0, 5.0]), 210.0, rtol=1e-9)


@given(st.one_of(hills, saturations), commands)
def test_hill_function_is_even_in_command(law, command):
    assert float(law.value(-command)) == float(law.value(command))
    if command:
        assert float(law.slope(-command)) == -float(law.slope(command))


@pytest.mark.parametrize(
    ("exponent", "expected"), [(2.0, 0.0), (1.0, 300.0 * (1 + 1 / 0.5)), (0.5, math.inf)]
)
def test_slope_of_hill_function_is_correct_at_zero(exponent, expected):
    law = Hill(90.0, 300.0, 0.5, exponent)
    assert float(law.slope(0.0)) == pytest.approx(expected)
    if math.isfinite(expected):
        assert float(law.slope(1e-9)) == pytest.approx(expected, rel=1e-6, abs=1e-4)
    else:
        assert float(law.slope(1e-18)) > 1e10
    assert float(Hill(90.0, -300.0, 0.5, exponent).slope(0.0)) == -expected
    assert float(Hill(90.0, 0.0, 0.5, exponent).slope(0.0)) == 0.0
    sharp = Saturation(90.0, 300.0, 0.5, exponent, sharpness=3.0)
    slope = 300.0 * (1 + 0.5**-3) ** (1 / 3)
    assert float(sharp.slope(0.0)) == pytest.approx(expected if exponent != 1.0 else slope)


def test_steep_hill_function_is_step():
    law = Hill(1.0, 2.0, 0.5, 5000.0)
    np.testing.assert_allclose(law.value([0.0, 0.49, 0.51, 1.0, 9.0]), [1.0, 1.0, 3.0, 3.0, 3.0])
    assert np.isfinite(law.gradient([0.0, 1e-300, 0.5, 1.0, 9.0])).all()


def written(law):
    """Return a coefficient function as the JSON of a card."""
    return json.loads(json.dumps(write_record(record_of_law(law, "N", "A"), defaults=True, nulls=True)))


def read(data):
    """Read a coefficient function from the JSON of a card, without units and standard errors."""
    numbers = data.get("numbers")
    if isinstance(numbers, dict):
        numbers = {
            name: value if isinstance(value, dict) else {"value": value, "unit": "-", "standard_error": None}
            for name, value in numbers.items()
        }
        data = {**data, "numbers": numbers}
    return parameter_law(read_record(CoefficientRecord, {"unit": "N", **data}, "card"))


@given(laws)
def test_coefficient_survives_json_round_trip(law):
    assert read(written(law)) == law
    assert law.with_parameters(law.parameters) == law
