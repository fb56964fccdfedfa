"""Parameter laws: their limits, their gradients against the complex step, their way through JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.dependence import (
    KINDS,
    Constant,
    Exponential,
    Hill,
    Polynomial,
    dependence_from_json,
    dependence_to_json,
    did_you_mean,
)

amounts = st.floats(-1e3, 1e3).filter(lambda x: x == 0.0 or abs(x) > 1e-6)
constants = st.builds(Constant, amounts)
polynomials = st.lists(amounts, min_size=1, max_size=5).map(lambda numbers: Polynomial(tuple(numbers)))
hills = st.builds(
    Hill,
    amounts,
    amounts,
    st.floats(0.05, 20.0),
    st.floats(0.2, 8.0),
    reference=st.sampled_from([1.0, 0.5, 3.0]),
)
exponentials = st.builds(Exponential, amounts, st.floats(-3.0, 3.0))
laws = st.one_of(constants, polynomials, hills, exponentials)
commands = st.floats(-5.0, 5.0).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


def on_paper(law, numbers, command):
    """Return the form as one writes it down; numbers or command may be complex."""
    match law.kind:
        case "constant":
            return numbers[0] + 0 * command
        case "polynomial":
            return sum(c * command**power for power, c in enumerate(numbers))
        case "hill":
            base, gain, half, q = numbers
            u = command * (1 if command.real >= 0 else -1) / law.reference
            h = half / law.reference
            return base + gain * (1 + h**q) * u**q / (u**q + h**q)
        case "exponential":
            return numbers[0] * np.exp(numbers[1] * command)


@given(laws, commands)
def test_the_value_is_the_form_on_paper(law, command):
    expected = on_paper(law, law.numbers, command)
    scale = abs(law.numbers[0]) + abs(expected)
    assert float(law.value(command)) == pytest.approx(expected, rel=1e-12, abs=1e-12 * scale + 1e-300)


@given(laws, commands.filter(bool))
def test_the_gradient_is_the_complex_step(law, command):
    """The complex step has no difference of nearly equal numbers in it: agreement to rounding."""
    for k in range(len(law.numbers)):
        step = 1e-30
        moved = [complex(x, step if i == k else 0.0) for i, x in enumerate(law.numbers)]
        expected = on_paper(law, moved, complex(command)).imag / step
        scale = 1e-12 * sum(map(abs, law.numbers)) + 1e-300
        assert law.gradient(command)[k] == pytest.approx(expected, rel=1e-10, abs=scale)


@given(laws, commands.filter(bool))
def test_the_slope_is_the_complex_step(law, command):
    expected = on_paper(law, [complex(x) for x in law.numbers], complex(command, 1e-30)).imag / 1e-30
    scale = 1e-12 * sum(map(abs, law.numbers)) + 1e-300
    assert float(law.slope(command)) == pytest.approx(expected, rel=1e-10, abs=scale)


@given(laws, commands, st.integers(0, 4), st.floats(-10.0, 10.0))
def test_the_value_is_linear_in_the_numbers_that_say_so(law, command, k, change):
    k %= len(law.numbers)
    if not law.linear[k]:
        return
    numbers = list(law.numbers)
    numbers[k] += change
    moved = law.with_numbers(numbers).value(command) - law.value(command)
    allowed = 1e-11 * (1 + float(np.abs(law.gradient(command)) @ np.abs(law.numbers)))
    assert moved == pytest.approx(law.gradient(command)[k] * change, abs=allowed)


@pytest.mark.parametrize(
    "law", [Constant(2.0), Polynomial((1.0, 2.0, 3.0)), Hill(1.0, 2.0, 0.7, 1.5), Exponential(2.0, -0.5)]
)
@pytest.mark.parametrize("shape", [(), (1,), (7,), (2, 3)])
def test_shapes_follow_the_command(law, shape):
    command = np.linspace(0.0, 2.0, int(np.prod(shape))).reshape(shape)
    assert law.value(command).shape == shape
    assert law.slope(command).shape == shape
    assert law.gradient(command).shape == (len(law.numbers), *shape)
    assert len(law.number_names) == len(law.linear) == len(law.units("N", "A")) == len(law.numbers)


@given(hills)
def test_a_hill_is_its_base_without_command_and_base_plus_gain_at_the_reference(law):
    assert float(law.value(0.0)) == law.base
    assert float(law.value(law.reference)) == pytest.approx(law.base + law.gain, abs=1e-14 * abs(law.gain))
    np.testing.assert_array_equal(law.gradient(0.0), [1.0, 0.0, 0.0, 0.0])


@given(hills, commands)
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


def test_a_steep_hill_becomes_a_step_and_does_not_overflow():
    law = Hill(1.0, 2.0, 0.5, 5000.0)
    np.testing.assert_allclose(law.value([0.0, 0.49, 0.51, 1.0, 9.0]), [1.0, 1.0, 3.0, 3.0, 3.0])
    assert np.isfinite(law.gradient([0.0, 1e-300, 0.5, 1.0, 9.0])).all()


def test_units_say_per_what():
    assert Polynomial((1.0, 2.0, 3.0)).units("N s/m", "A") == ("N s/m", "N s/m/A", "N s/m/A^2")
    assert Polynomial((1.0, 2.0)).units("-", "V") == ("-", "1/V")
    assert Hill(1.0, 1.0, 1.0, 1.0).units("N", "A") == ("N", "N", "A", "-")
    assert Exponential(1.0, 1.0).units("1/m", "V") == ("1/m", "1/V")


@given(laws)
def test_json_and_back_is_the_same_law(law):
    assert dependence_from_json(json.loads(json.dumps(dependence_to_json(law)))) == law
    assert law.with_numbers(law.numbers) == law


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Constant(math.nan), "constant: value is nan; it must be a finite number"),
        (lambda: Polynomial(()), r"needs at least one number"),
        (lambda: Polynomial((1.0, math.inf)), "polynomial: c1 is inf"),
        (lambda: Hill(1.0, 1.0, 0.0, 1.0), "hill: half_command is 0; it must be positive"),
        (lambda: Hill(1.0, 1.0, 1.0, -2.0), "hill: exponent is -2"),
        (lambda: Hill(1.0, 1.0, 1.0, 1.0, reference=math.nan), "hill: reference is nan"),
        (lambda: Exponential(math.inf, 0.0), "exponential: at_zero is inf"),
        (lambda: Hill(1.0, 1.0, 1.0, 1.0).with_numbers([1.0]), "hill: 1 numbers given; it has base, gain"),
    ],
)
def test_a_number_that_no_law_can_hold_is_refused_by_name(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"kind": "hil", "numbers": {}}, "no dependence of kind 'hil'; there are " + ", ".join(KINDS)),
        ({"kind": "constant", "number": {"value": 1.0}}, "unknown key 'number'"),
        ({"kind": "constant", "numbers": 3.0}, "constant: numbers and settings must be tables"),
        (
            {"kind": "constant", "numbers": {"valu": 1.0}},
            "constant has no number 'valu'; did you mean value?",
        ),
        ({"kind": "polynomial", "numbers": {"c0": 1.0, "c2": 1.0}}, "polynomial has no number 'c2'"),
        ({"kind": "polynomial", "numbers": {}}, "polynomial: number c0 is missing"),
        ({"kind": "exponential", "numbers": {"at_zero": 1.0, "rate": True}}, "number rate is True"),
        ({"kind": "constant", "numbers": {"value": 1.0}, "settings": {"reference": 1.0}}, "no setting"),
        (
            {"kind": "hill", "numbers": {"base": 1, "gain": 1, "half_command": 1, "exponent": 1}},
            "hill: setting reference is missing",
        ),
    ],
)
def test_json_of_no_law_is_refused_with_what_there_is(data, said):
    with pytest.raises(InputError, match=said):
        dependence_from_json(data)


def test_an_unknown_name_is_answered_by_the_nearest_or_by_all():
    assert did_you_mean("yeild_force", ["yield_force", "rho"]) == "did you mean yield_force?"
    assert did_you_mean("zzz", ["yield_force", "rho"]) == "expected one of: yield_force, rho"
    assert did_you_mean("zzz", []) == "expected none"
