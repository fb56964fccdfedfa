"""A fitted damper inside its law's range: by as little as it takes, and one that is inside is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.identify.limits import _keeps, _raised, brought_inside
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial
from mrdamper.models.laws import Coefficient, find_law
from tests.identify.truths import TRUTHS

TRUTH = TRUTHS["bouc-wen"]
ENVELOPE = OperatingEnvelope(command=(0.0, 2.0), displacement=(-0.02, 0.01), velocity=(-0.1, 0.1))
AT, KELVIN = np.linspace(0.0, 2.0, 401), np.full(401, 293.15)


def damper(**forms: ParameterLaw) -> Damper:
    return replace(TRUTH, coefficients={**TRUTH.coefficients, **forms})


def between(lower: float, upper: float) -> Coefficient:
    return replace(find_law("bouc-wen")["yield_force"], lower=lower, upper=upper)


def test_a_damper_inside_its_range_is_the_same_one():
    inside, notes = brought_inside(TRUTH, ENVELOPE)
    assert (inside, notes) == (TRUTH, ())
    assert all(inside.coefficients[name] is form for name, form in TRUTH.coefficients.items())


@given(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-200.0, 200.0))
def test_a_dip_below_the_floor_is_lifted_as_a_whole_and_by_no_more_than_it_takes(a, b, c):
    form = Polynomial((a, b, c))
    values = form.value(AT, KELVIN)
    found = _raised(form, between(0.0, np.inf), AT, KELVIN)
    after, margin = found.value(AT, KELVIN), 2e-6 * np.ptp(values)
    lift = after - values
    assert np.ptp(lift) <= 1e-9 * (1.0 + np.abs(values).max()), "as a whole"
    expected = max(margin - values.min(), 0.0)
    assert lift[0] == pytest.approx(expected, rel=1e-6, abs=1e-9 * (1.0 + np.abs(values).max()))
    assert (found is form) == (values.min() >= margin) or expected <= 1e-9 * np.abs(values).max()
    floored = _raised(form, between(100.0, np.inf), AT, KELVIN).value(AT, KELVIN)
    assert floored.min() >= 100.0


@pytest.mark.parametrize(
    ("form", "lower", "upper"),
    [
        (Polynomial((300.0, 400.0)), 0.0, 700.0),
        (Polynomial((900.0, -300.0)), 0.0, 700.0),
        (Exponential(900.0, -0.8), 500.0, 1e4),
        (Exponential(900.0, 0.8), 0.0, 2000.0),
        (Hill(100.0, 900.0, 1.0, 2.0), 0.0, 500.0),
    ],
    ids=["line", "level above", "falling", "rising", "curve"],
)
def test_what_leaves_its_range_otherwise_depends_less_on_the_command_and_touches_the_limit(
    form, lower, upper
):
    admissible = between(lower, upper)
    found = _raised(form, admissible, AT, KELVIN)
    values = found.value(AT, KELVIN)
    assert values.min() >= lower
    assert values.max() <= upper
    assert min(values.min() - lower, upper - values.max()) == pytest.approx(0.0, abs=1e-6 * upper)
    shares = {
        name: after / before
        for name, before, after in zip(form.parameter_names, form.parameters, found.parameters, strict=True)
    }
    assert shares.pop(form.parameter_names[0]) == pytest.approx(min(upper / form.parameters[0], 1.0))
    where = {shares.pop(name) for name in ("half_command", "exponent") if name in shares}
    assert where <= {1.0}, "where it rises stays"
    (share,) = shares.values()
    assert 0.0 <= share < 1.0
    assert _raised(found, admissible, AT, KELVIN) is found


def test_limits_belong_to_the_range():
    line = Polynomial((0.0, 100.0))
    assert _keeps(line, between(0.0, 200.0), AT, KELVIN)
    assert not _keeps(line, between(1e-9, 200.0), AT, KELVIN)
    assert not _keeps(line, between(0.0, 199.9), AT, KELVIN)
    assert _raised(Constant(200.0), between(0.0, 200.0), AT[:1], KELVIN[:1]) == Constant(200.0)
    for beyond, end in ((-5.0, 0.0), (250.0, 200.0)):
        (value,) = _raised(Constant(beyond), between(0.0, 200.0), AT[:1], KELVIN[:1]).parameters
        assert value == pytest.approx(end, abs=1e-6)


@pytest.mark.parametrize(("dip", "told"), [(0.4, False), (3.0, True)])
def test_a_change_is_noted_from_a_thousandth_of_the_coefficient_s_largest_value_on(dip, told):
    inside, notes = brought_inside(damper(viscosity=Polynomial((-dip, 500.5))), ENVELOPE)
    assert inside.coefficients["viscosity"].value(0.0) >= 0.0
    assert bool(notes) == told
    if told:
        assert notes[0].startswith("viscosity is held inside the law's range over the runs")


def test_a_damper_is_inside_over_the_temperatures_of_its_fit_or_else_of_the_runs():
    """Five degrees apart there is a dip in the middle that its ends do not show."""
    falling = damper(viscosity=Polynomial((100.0, -60.0)))
    assert brought_inside(falling, replace(ENVELOPE, command=(0.0, 1.6)))[1] == ()
    inside, _ = brought_inside(falling, ENVELOPE)
    assert inside.coefficients["viscosity"].value(np.linspace(0.0, 2.0, 7)).min() >= 0.0
    assert inside.coefficients["viscosity"].value(0.0) == pytest.approx(120.0, abs=1e-2)


@pytest.mark.parametrize(
    ("gain", "held"), [(10.0, 10.0), (-10.0, -10.0), (80.0, 49.5), (-80.0, -49.5), (49.5, 49.5)]
)
def test_a_valve_keeps_a_hundredth_of_its_force_at_the_end_of_the_stroke(gain, held):
    """The longer way of the two, 20 mm, counts; a gain that leaves the valve open is left alone."""
    valve = TRUTHS["series-valve"]
    valve = replace(valve, coefficients={**valve.coefficients, "position_gain": Constant(gain)})
    inside, _ = brought_inside(valve, ENVELOPE)
    assert inside.coefficients["position_gain"].parameters == pytest.approx((held,))
    assert 1.0 - abs(held) * 0.02 >= 0.01 - 1e-12
