"""The reduced model agrees with its finite elements and conserves energy."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from tests.support.tiers import one_by_day
from tests.thermal.designs import DRAWING, draw_designs

BARE = DRAWING.with_sink(None)


def fading(kelvin):
    """Return a power that decreases with temperature, like the power of an MR damper."""
    return 95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - 293.15)


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


DUTY = Load(1800.0, fading, 16.8)


def miss(full, reduced, name: str) -> float:
    return float(np.abs(getattr(full, name) - getattr(reduced, name)).max())


@pytest.mark.system
@pytest.mark.parametrize("number", one_by_day(range(4)))
def test_reduced_thermal_model_agrees_with_finite_elements(number: int):
    """The load lasts half an hour. The random designs were not used to choose constants of the model."""
    model = build_field(draw_designs(4, seed=2)[number])
    small = reduce_field(model)
    full, reduced = (simulate_field(each.equation, [DUTY]) for each in (model, small))
    assert miss(full, reduced, "fluid") < 10e-3
    assert miss(full, reduced, "coil") < 50e-3


@pytest.mark.nightly
def test_reduced_thermal_model_fits_forty_designs():
    for design in draw_designs(40, seed=3):
        model = build_field(design)
        full, reduced = (
            simulate_field(each.equation, [DUTY], longest_step=10.0) for each in (model, reduce_field(model))
        )
        assert miss(full, reduced, "fluid") < 10e-3
        assert miss(full, reduced, "coil") < 50e-3


@pytest.mark.nightly
def test_reduced_thermal_model_agrees_for_other_load():
    """The load has other powers, a pause and a start at 60 degC. The reduced basis includes none of them.

    The error of the fluid temperature is proportional to a step of the power and largest just after the step.
    """
    model = build_field(DRAWING)
    loads = [Load(400.0, constant(200.0), 0.0), Load(300.0, constant(0.0)), Load(400.0, fading, 50.0)]
    full, reduced = (
        simulate_field(each.equation, loads, start=333.15) for each in (model, reduce_field(model))
    )
    assert miss(full, reduced, "fluid") < 10e-3 * 200.0 / 95.0
    assert miss(full, reduced, "coil") < 50e-3


def test_reduced_thermal_model_conserves_energy():
    model = build_field(DRAWING, size=0.016)
    small = reduce_field(model)
    course = simulate_field(small.equation, [DUTY])
    assert course.closure <= 1e-9
    equation = small.equation
    capacity = equation.uniform @ (equation.mass @ equation.uniform)
    assert capacity == pytest.approx(model.section.heat_capacity, rel=1e-9)
