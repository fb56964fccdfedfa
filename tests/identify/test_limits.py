"""A fitted damper inside its law's range: by as little as it takes, and one that is inside is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.identify.limits import limit_coefficients
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from tests.identify.reference_dampers import REFERENCE_DAMPERS
from tests.identify.small_problems import fitted

TRUTH = REFERENCE_DAMPERS["bouc-wen"]
ENVELOPE = OperatingEnvelope(command=(0.0, 2.0), displacement=(-0.02, 0.01), velocity=(-0.1, 0.1))
AT, KELVIN = np.linspace(0.0, 2.0, 401), np.full(401, 293.15)


def damper(**forms: ParameterLaw) -> Damper:
    return replace(TRUTH, coefficients={**TRUTH.coefficients, **forms})


def test_a_damper_inside_its_range_is_the_same_one():
    inside, notes = limit_coefficients(TRUTH, ENVELOPE)
    assert (inside, notes) == (TRUTH, ())
    assert all(inside.coefficients[name] is form for name, form in TRUTH.coefficients.items())


def test_a_damper_is_inside_over_the_temperatures_of_its_fit_or_else_of_the_runs():
    """Five degrees apart there is a dip in the middle that its ends do not show."""
    falling = damper(viscosity=Polynomial((100.0, -60.0)))
    assert limit_coefficients(falling, replace(ENVELOPE, command=(0.0, 1.6)))[1] == ()
    inside, _ = limit_coefficients(falling, ENVELOPE)
    assert inside.coefficients["viscosity"].value(np.linspace(0.0, 2.0, 7)).min() >= 0.0
    assert inside.coefficients["viscosity"].value(0.0) == pytest.approx(120.0, abs=1e-2)


@pytest.mark.parametrize(
    ("gain", "held"), [(10.0, 10.0), (-10.0, -10.0), (80.0, 49.5), (-80.0, -49.5), (49.5, 49.5)]
)
def test_a_valve_keeps_a_hundredth_of_its_force_at_the_end_of_the_stroke(gain, held):
    """The longer way of the two, 20 mm, counts; a gain that leaves the valve open is left alone."""
    valve = REFERENCE_DAMPERS["series-valve"]
    valve = replace(valve, coefficients={**valve.coefficients, "position_gain": Constant(gain)})
    inside, _ = limit_coefficients(valve, ENVELOPE)
    assert inside.coefficients["position_gain"].parameters == pytest.approx((held,))
    assert 1.0 - abs(held) * 0.02 >= 0.01 - 1e-12


def test_fixed_terms_count_in_model_conditions():
    """800 - 390 I is positive up to 2 A. With 800 fixed, the fit returns -390 and is not limited to zero."""
    viscosity = Polynomial((800.0, -390.0))
    truth = replace(
        REFERENCE_DAMPERS["bingham"],
        coefficients={**REFERENCE_DAMPERS["bingham"].coefficients, "viscosity": viscosity},
    )
    _, result = fitted(truth, [FreeParameter("viscosity.c1", -1e4, 1e4, linear=True)])
    estimate = result.estimates[0]
    assert abs(estimate.value + 390.0) < 4.0 * estimate.standard_error
    pushed, _ = fitted(truth, [FreeParameter("viscosity.c1", -1e4, 1e4, linear=True)])
    less = tuple(
        replace(r, force=np.asarray(r.force) - 300.0 * r.run.command[0] * r.trajectory.velocity)
        for r in pushed.runs
    )
    edge = fit_variable_projection(replace(pushed, runs=less), dampers=[truth])
    assert edge.damper.parameters["viscosity.c1"] == pytest.approx(-400.0, rel=1e-6)
