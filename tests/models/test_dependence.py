"""Parameter laws: their limits, their gradients against the complex step, their way through JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.card_schema import FORMS as KINDS
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
from mrdamper.models.temperature import FACTORS, Arrhenius, Linear, PolynomialFactor, Reynolds, Vft
from mrdamper.schema import did_you_mean, read_record, write_record

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
every_form = pytest.mark.parametrize("form", FORMS)
every_factor = pytest.mark.parametrize("factor", FACTORS_DRAWN)


def factor_on_paper(kind, parameters, kelvin):
    """Return a temperature factor as one writes it down; numbers may be complex."""
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
    """Return the form as one writes it down; numbers or command may be complex."""
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
    """Return the size of the terms that a value is summed from: what rounding is measured against."""
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
def test_the_value_is_the_form_on_paper(law, command, kelvin):
    expected = on_paper(law, law.parameters, command, kelvin)
    scale = scale_of(law, command, kelvin)
    found = float(law.value(command, kelvin))
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12 * scale + 1e-300)


def assert_gradient(law, command, kelvin):
    """Compare with the complex step: it has no difference of nearly equal numbers in it."""
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
def test_gradient_and_slope_are_the_complex_step(law, command, kelvin):
    assert_gradient(law, command, kelvin)
    assert_slope(law, command, kelvin)


@pytest.mark.system
@every_form
@every_factor
@given(data=st.data(), command=commands.filter(bool), kelvin=kelvins)
def test_gradient_and_slope_of_every_form_times_every_factor_are_the_complex_step(
    form, factor, data, command, kelvin
):
    law = TemperatureDependent(data.draw(FORMS[form]), data.draw(FACTORS_DRAWN[factor]))
    assert_gradient(law, command, kelvin)
    assert_slope(law, command, kelvin)


@pytest.mark.system
@given(laws, commands, kelvins, st.integers(0, 15), st.floats(-10.0, 10.0))
def test_the_value_is_linear_in_the_numbers_that_say_so(law, command, kelvin, k, change):
    """Affine to the definition, whatever the change: equal changes of the number, equal of the value."""
    linear = [place for place, says_so in enumerate(law.linear) if says_so]
    k = linear[k % len(linear)]
    parameters = list(law.parameters)
    parameters[k] += change
    moved = law.with_parameters(parameters).value(command, kelvin) - law.value(command, kelvin)
    share = float(law.gradient(command, kelvin)[k])
    allowed = 1e-11 * (1.0 + scale_of(law, command, kelvin) + abs(share) * (1.0 + abs(change)))
    assert moved == pytest.approx(share * change, abs=allowed)


@pytest.mark.parametrize(
    "law",
    [
        Constant(3.0),
        Polynomial((1.0, 2.0, -0.5)),
        Hill(1.0, 2.0, 1.5, 1.7),
        Saturation(1.0, 2.0, 1.5, 1.7, sharpness=2.0),
        Exponential(2.0, 0.7),
        Bipolynomial((1.0, 2.0, 0.5, 0.1), 1),
        *(
            TemperatureDependent(Constant(2.0), factor)
            for factor in (Linear(1e-3), Arrhenius(900.0), Vft(700.0, 160.0))
        ),
    ],
    ids=repr,
)
def test_the_numbers_that_say_they_are_linear_are_all_that_are_beside_a_factor_s(law):
    """Three equal steps of one number make two equal steps of the value."""
    for k, said in enumerate(law.linear):
        steps = [
            float(
                law.with_parameters(
                    [*law.parameters[:k], share * law.parameters[k], *law.parameters[k + 1 :]]
                ).value(0.8, 340.0)
            )
            for share in (1.0, 1.2, 1.4)
        ]
        bend = abs(steps[2] - 2.0 * steps[1] + steps[0])
        of_factor = isinstance(law, TemperatureDependent) and k >= len(law.form.parameters)
        assert said == (bend < 1e-12 and not of_factor)


@given(st.one_of(bipolynomials, temperature_dependent), commands, kelvins)
def test_the_linear_numbers_are_linear_together(law, command, kelvin):
    """What least squares needs: the gradient by one of them does not hold another."""
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
@pytest.mark.parametrize("shape", [(), (1,), (7,), (2, 3)])
@pytest.mark.parametrize("kelvin", [None, 330.0, "each"])
def test_shapes_follow_the_command(law, shape, kelvin):
    command = np.linspace(0.0, 2.0, int(np.prod(shape))).reshape(shape)
    warm = 300.0 + 40.0 * command if kelvin == "each" else kelvin
    assert law.value(command, warm).shape == shape
    assert law.slope(command, warm).shape == shape
    assert law.gradient(command, warm).shape == (len(law.parameters), *shape)
    assert len(law.parameter_names) == len(law.linear) == len(law.units("N", "A")) == len(law.parameters)
    assert len(set(law.parameter_names)) == len(law.parameters)


# ----------------------------------------------------------------------------------------- temperature


@given(laws, commands)
def test_without_a_temperature_it_is_20_degrees(law, command):
    np.testing.assert_array_equal(law.value(command), law.value(command, 293.15))
    np.testing.assert_array_equal(law.gradient(command), law.gradient(command, 293.15))
    np.testing.assert_array_equal(law.slope(command), law.slope(command, 293.15))


@given(temperature_dependent, commands)
def test_at_20_degrees_a_tempered_coefficient_is_its_form(law, command):
    np.testing.assert_array_equal(law.value(command, 293.15), law.form.value(command))
    np.testing.assert_array_equal(law.slope(command, 293.15), law.form.slope(command))


@given(cold_laws, commands, kelvins)
def test_a_form_of_the_command_alone_knows_no_temperature(law, command, kelvin):
    assert not law.temperature_dependent
    np.testing.assert_array_equal(law.value(command, kelvin), law.value(command))
    np.testing.assert_array_equal(law.gradient(command, kelvin), law.gradient(command))


@given(temperature_dependent, commands, commands, kelvins)
def test_command_and_temperature_separate(law, here, there, kelvin):
    """The share by which a tempered coefficient changes is one and the same at every command."""
    one, two = law.value(here, kelvin) * law.value(there), law.value(there, kelvin) * law.value(here)
    assert one == pytest.approx(two, rel=1e-12, abs=1e-300)


@given(polynomials, commands, kelvins)
def test_a_bipolynomial_of_temperature_degree_zero_is_its_polynomial(law, command, kelvin):
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
def test_the_separable_polynomial_is_the_bipolynomial_of_products(command, factor, at, kelvin):
    """(a0 + a1 I + ...)(1 + t1 dT + ...) multiplied out: c_ij = a_i t_j with t_0 = 1."""
    law = TemperatureDependent(Polynomial(tuple(command)), PolynomialFactor(tuple(factor)))
    assert law.kind == "polynomial"
    assert law.parameter_names == (
        *(f"c{i}" for i in range(len(command))),
        *(f"t{j}" for j in range(1, len(factor) + 1)),
    )
    out = Bipolynomial(tuple(a * t for a in command for t in (1.0, *factor)), len(factor))
    allowed = 1e-12 * scale_of(out, at, kelvin) + 1e-300
    assert float(law.value(at, kelvin)) == pytest.approx(float(out.value(at, kelvin)), abs=allowed)


@given(temperature_dependent, st.data())
def test_numbers_put_into_a_tempered_form_are_read_back_and_the_mark_stays(law, data):
    k = data.draw(st.integers(0, len(law.parameters) - 1))
    parameters = list(law.parameters)
    parameters[k] = parameters[k] * 0.5 or 1e-3
    changed = law.with_parameters(parameters)
    assert changed.parameters == tuple(parameters)
    assert changed.assumed == law.assumed
    assert changed.settings == law.settings
    with pytest.raises(InputError, match=f"{len(parameters) + 1} parameters given; it has"):
        law.with_parameters([*parameters, 1.0])


@given(st.one_of(hills, saturations))
def test_a_hill_is_its_base_without_command_and_base_plus_gain_at_the_reference(law):
    assert float(law.value(0.0)) == law.base
    assert float(law.value(law.reference)) == pytest.approx(law.base + law.gain, abs=1e-14 * abs(law.gain))
    np.testing.assert_array_equal(law.gradient(0.0)[1:], 0.0)


@given(hills, commands)
def test_a_saturation_whose_bend_is_a_hills_is_that_hill(law, command):
    same = Saturation(law.base, law.gain, law.half_command, law.exponent, law.reference)
    assert float(same.value(command)) == float(law.value(command))
    assert float(same.slope(command)) == float(law.slope(command))
    np.testing.assert_array_equal(same.gradient(command)[:4], law.gradient(command))


def test_a_sharp_saturation_is_a_power_up_to_its_bend_and_flat_beyond():
    law, low = Saturation(10.0, 200.0, 0.5, 1.5, 1.0, sharpness=40.0), np.array([0.125, 0.25])
    np.testing.assert_allclose(law.value(low), 10.0 + 200.0 * (low / 0.5) ** 1.5, rtol=1e-9)
    np.testing.assert_allclose(law.value([0.75, 1.0, 5.0]), 210.0, rtol=1e-9)


@given(st.one_of(hills, saturations), commands)
def test_a_hill_does_not_see_the_sign_of_the_command(law, command):
    assert float(law.value(-command)) == float(law.value(command))
    if command:
        assert float(law.slope(-command)) == -float(law.slope(command))


@given(st.floats(0.05, 20.0), st.floats(0.2, 8.0))
def test_a_hill_is_half_way_up_at_its_half_command(half, exponent):
    law = Hill(0.0, 1.0, half, exponent)
    assert float(law.value(half)) == pytest.approx((1.0 + half**exponent) / 2, rel=1e-12)


@pytest.mark.parametrize(
    ("exponent", "expected"), [(2.0, 0.0), (1.0, 300.0 * (1 + 1 / 0.5)), (0.5, math.inf)]
)
def test_the_slope_of_a_hill_at_zero_is_its_limit(exponent, expected):
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


def test_a_steep_hill_becomes_a_step_and_does_not_overflow():
    law = Hill(1.0, 2.0, 0.5, 5000.0)
    np.testing.assert_allclose(law.value([0.0, 0.49, 0.51, 1.0, 9.0]), [1.0, 1.0, 3.0, 3.0, 3.0])
    assert np.isfinite(law.gradient([0.0, 1e-300, 0.5, 1.0, 9.0])).all()


def test_units_say_per_what():
    assert Polynomial((1.0, 2.0, 3.0)).units("N s/m", "A") == ("N s/m", "N s/m/A", "N s/m/A^2")
    assert Polynomial((1.0, 2.0)).units("-", "V") == ("-", "1/V")
    assert Hill(1.0, 1.0, 1.0, 1.0).units("N", "A") == ("N", "N", "A", "-")
    assert Exponential(1.0, 1.0).units("1/m", "V") == ("1/m", "1/V")
    assert Bipolynomial((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 2).units("N", "A") == (
        *("N", "N/K", "N/K^2"),
        *("N/A", "N/A/K", "N/A/K^2"),
    )
    assert TemperatureDependent(Polynomial((1.0, 2.0)), Arrhenius(1000.0)).units("N s/m", "V") == (
        *("N s/m", "N s/m/V"),
        "K",
    )
    assert PolynomialFactor((1e-3, 1e-6, 1e-9)).units == ("1/K", "1/K^2", "1/K^3")


def test_every_form_and_factor_that_a_card_may_name_is_tried_here():
    assert {*FORMS, "bipolynomial"} == set(KINDS)
    assert set(FACTORS_DRAWN) == set(FACTORS)


def written(law):
    """Return a law as the JSON of a card."""
    return json.loads(json.dumps(write_record(record_of_law(law, "N", "A"), defaults=True, nulls=True)))


def read(data):
    """Return the law in a card's JSON; its numbers may stand without unit and standard error."""
    numbers = data.get("numbers")
    if isinstance(numbers, dict):
        numbers = {
            name: value if isinstance(value, dict) else {"value": value, "unit": "-", "standard_error": None}
            for name, value in numbers.items()
        }
        data = {**data, "numbers": numbers}
    return parameter_law(read_record(CoefficientRecord, {"unit": "N", **data}, "card"))


@given(laws)
def test_json_and_back_is_the_same_law(law):
    assert read(written(law)) == law
    assert law.with_parameters(law.parameters) == law


WARM = {
    "kind": "constant",
    "numbers": {"value": 1.0, "activation_K": 1200.0},
    "temperature": {"kind": "arrhenius", "assumed": False},
}


def test_json_in_another_order_is_the_same_law():
    """A table has no order: t2 before t1 is still t2."""
    for law in SOME:
        data = written(law)
        parameters = data["numbers"]
        assert isinstance(parameters, dict)
        turned = {**data, "numbers": dict(reversed(parameters.items()))}
        assert read(dict(reversed(turned.items()))) == law


def test_an_assumed_factor_stays_assumed_and_is_identified_where_nothing_is_said():
    law = TemperatureDependent(Constant(2.0), Arrhenius(1200.0), assumed=True)
    data = written(law)
    assert data["temperature"] == {"kind": "arrhenius", "assumed": True}
    assert read(data) == law
    assert read({**data, "temperature": {"kind": "arrhenius"}}) == TemperatureDependent(law.form, law.factor)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: Bipolynomial((1.0, 2.0, 3.0), 1),
            "bipolynomial: 3 parameters, temperature degree 1; expected",
        ),
        (lambda: Bipolynomial((), 1), "bipolynomial: 0 parameters"),
        (lambda: Bipolynomial((1.0,), -1), "temperature degree -1"),
        (lambda: Bipolynomial((1.0, math.nan), 1), "bipolynomial: c01 is nan"),
        (lambda: Linear(math.inf), "temperature factor: temperature_slope is inf"),
        (lambda: Constant(math.nan), "constant: value is nan; it must be a finite number"),
        (lambda: Polynomial(()), r"expected at least one"),
        (lambda: Polynomial((1.0, math.inf)), "polynomial: c1 is inf"),
        (lambda: Hill(1.0, 1.0, 0.0, 1.0), "hill: half_command is 0; it must be positive"),
        (lambda: Hill(1.0, 1.0, 1.0, -2.0), "hill: exponent is -2"),
        (lambda: Hill(1.0, 1.0, 1.0, 1.0, reference=math.nan), "hill: reference is nan"),
        (lambda: Exponential(math.inf, 0.0), "exponential: at_zero is inf"),
        (
            lambda: Hill(1.0, 1.0, 1.0, 1.0).with_parameters([1.0]),
            "hill: 1 parameters given; it has base, gain",
        ),
    ],
)
def test_a_number_that_no_law_can_hold_is_refused_by_name(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"kind": "hil", "numbers": {}}, "no parameter law of kind 'hil'; did you mean hill?"),
        ({"kind": "constant", "number": {"value": 1.0}}, "unknown key 'number'; did you mean numbers"),
        ({"kind": "constant", "numbers": 3.0}, "numbers is 3.0; expected a table"),
        (
            {"kind": "constant", "numbers": {"valu": 1.0}},
            "constant has no parameter 'valu'; did you mean value?",
        ),
        ({"kind": "polynomial", "numbers": {"c0": 1.0, "c2": 1.0}}, "polynomial has no parameter 'c2'"),
        ({"kind": "polynomial", "numbers": {}}, "polynomial: parameter c0 is missing"),
        (
            {"kind": "exponential", "numbers": {"at_zero": 1.0, "rate": True}},
            "numbers.rate.value is True; expected a number",
        ),
        ({"kind": "constant", "numbers": {"value": 1.0}, "settings": {"reference": 1.0}}, "no setting"),
        (
            {"kind": "hill", "numbers": {"base": 1, "gain": 1, "half_command": 1, "exponent": 1}},
            "hill: setting reference is missing",
        ),
        ({**WARM, "temperature": "arrhenius"}, "temperature is 'arrhenius'; expected a table"),
        (
            {**WARM, "temperature": {"kind": "exp"}},
            "no temperature factor of kind 'exp'; expected one of: " + ", ".join(FACTORS),
        ),
        ({**WARM, "temperature": {"kind": "linear"}}, "linear: parameter temperature_slope is missing"),
        (
            {**WARM, "temperature": {"kind": "arrhenius", "assumed": 1}},
            "temperature.assumed is 1; expected true or false",
        ),
        (
            {"kind": "constant", "numbers": WARM["numbers"]},
            "constant has no parameter 'activation_K'; expected one of: value",
        ),
        (
            {
                "kind": "constant",
                "numbers": {"value": 1.0, "t1": 1e-3, "t3": 1e-6},
                "temperature": {"kind": "polynomial"},
            },
            "polynomial: parameter t2 is missing",
        ),
        (
            {"kind": "constant", "numbers": {"value": 1.0}, "temperature": {"kind": "polynomial"}},
            "polynomial: parameter t1 is missing",
        ),
        (
            {
                "kind": "bipolynomial",
                "numbers": {"c00": 1.0, "c01": 0.1, "temperature_slope": 1e-3},
                "settings": {"temperature_degree": 1},
                "temperature": {"kind": "linear"},
            },
            "bipolynomial depends on temperature itself; expected no temperature factor",
        ),
        (
            {"kind": "bipolynomial", "numbers": {"c00": 1.0}},
            "bipolynomial: setting temperature_degree is missing",
        ),
        (
            {"kind": "bipolynomial", "numbers": {"c00": 1.0}, "settings": {"temperature_degree": 0.5}},
            "temperature_degree is 0.5; it must be a whole number",
        ),
        (
            {"kind": "bipolynomial", "numbers": {"c00": 1.0}, "settings": {"temperature_degree": 1e9}},
            r"temperature_degree is 1e\+09; it must be a whole number",
        ),
        (
            {
                "kind": "bipolynomial",
                "numbers": {"c00": 1.0, "c01": 1.0, "c10": 1.0},
                "settings": {"temperature_degree": 1},
            },
            "bipolynomial has no parameter 'c10'",
        ),
    ],
)
def test_json_of_no_law_is_refused_with_what_there_is(data, said):
    with pytest.raises(InputError, match=said):
        read(data)


def test_an_unknown_name_is_answered_by_the_nearest_or_by_all():
    assert did_you_mean("yeild_force", ["yield_force", "rho"]) == "did you mean yield_force?"
    assert did_you_mean("zzz", ["yield_force", "rho"]) == "expected one of: yield_force, rho"
    assert did_you_mean("zzz", []) == "expected none"
