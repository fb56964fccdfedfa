"""Heat capacities may be polynomials of temperature, and heat is conserved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.drawing import Calibration, DamperDrawing
from mrdamper.thermal.drawing_file import drawing_of, text_of
from mrdamper.thermal.heat_capacity import CapacityCurve, PolynomialHeatCapacity
from mrdamper.thermal.model.finite_element import FieldModel, build_field, discretise
from mrdamper.thermal.model.heat_equation import FieldSystem, simulate_field
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load

STEEP = PolynomialHeatCapacity(
    range_degC=(20.0, 140.0),
    fluid_J_kg_K=(756.0, 2.2, 0.004),
    body_J_kg_K=(445.0, 0.75),
    fins_J_kg_K=(860.0, 1.0),
)
WHOLE = PolynomialHeatCapacity(range_degC=(20.0, 140.0), damper_J_K=(800.0, 5.0))
LOAD = Load(1800.0, lambda kelvin: np.full(np.shape(kelvin), 95.0), 12.0)


def paper(heat_capacity: PolynomialHeatCapacity, *, fins: bool = True) -> DamperDrawing:
    drawing = replace(drawing_of(text_of("paper")), calibration=Calibration())
    return replace(drawing if fins else drawing.with_sink(None), heat_capacity=heat_capacity)


def coarse(drawing: DamperDrawing, *, insulated: bool = False) -> FieldModel:
    section = section_of(drawing)
    if insulated:
        surfaces = tuple(replace(each, emissivity=0.0, mount=0.0) for each in section.surfaces)
        section = replace(section, surfaces=surfaces, films=0.0 * section.films)
    return discretise(section, mesh_section(section, 0.03, levels=1))


@given(st.lists(st.floats(300.0, 2000.0), min_size=3, max_size=3), st.floats(200.0, 500.0))
def test_heat_capacity_is_derivative_of_stored_heat(values: list[float], kelvin: float):
    curve = CapacityCurve(280.0, 400.0, (values[0], 0.2 * (values[1] - values[0]) / 120.0, 1e-3))
    slope = (curve.integral(np.array(kelvin + 1e-3)) - curve.integral(np.array(kelvin - 1e-3))) / 2e-3
    assert float(slope) == pytest.approx(curve.evaluate(kelvin), rel=1e-6)


def test_capacity_polynomial_in_celsius_is_evaluated():
    """The capacity is 800 + 2 T + 0.01 T^2 with T in degC, and constant outside the stated range."""
    stated = PolynomialHeatCapacity(range_degC=(20.0, 140.0), fluid_J_kg_K=(800.0, 2.0, 0.01))
    curve = stated.parts["fluid"]
    at = [curve.evaluate(degrees + ZERO_CELSIUS_K) for degrees in (-10.0, 20.0, 100.0, 140.0, 200.0)]
    assert at == pytest.approx([844.0, 844.0, 1100.0, 1276.0, 1276.0])
    assert curve.over_mean().mean == pytest.approx(1.0)


def test_temperature_follows_variable_heat_capacity():
    """The capacity is 900 J/K at 20 degC and rises by 5 J/K per kelvin, so the heat is quadratic."""
    model = coarse(paper(WHOLE, fins=False), insulated=True)
    load = replace(LOAD, duration=1200.0, coil_W=0.0)
    course = simulate_field(model.equation, [load])
    mean = float(model.equation.uniform @ (model.equation.mass @ course.state[-1]))
    mean /= float(model.equation.uniform @ (model.equation.mass @ model.equation.uniform))
    expected = (np.sqrt(900.0**2 + 2.0 * 5.0 * 95.0 * 1200.0) - 900.0) / 5.0
    # The capacity of each part depends on its own temperature, but ``expected`` uses the mean temperature.
    assert mean == pytest.approx(expected, rel=2e-3)
    assert course.closure < 1e-12


@pytest.mark.nightly
@pytest.mark.parametrize("fins", [True, False], ids=["fins", "bare"])
def test_reduced_model_includes_variable_capacity(fins: bool):
    model = coarse(paper(STEEP, fins=fins))
    full, small = (simulate_field(each.equation, [LOAD]) for each in (model, reduce_field(model, order=22)))
    assert np.abs(full.fluid - small.fluid).max() < 10e-3
    assert np.abs(full.hottest("coil") - small.hottest("coil")).max() < 50e-3
    assert max(full.closure, small.closure) < 1e-9
    constant = simulate_field(replace(model.equation, storage=()), [LOAD])
    # A constant heat capacity gives other temperatures.
    assert np.abs(constant.fluid - full.fluid).max() > 0.5


@pytest.mark.nightly
def test_variable_capacity_agrees_with_scipy():
    """The reference is an implicit SciPy method. Halving the step divides the error by four."""
    equation = reduce_field(coarse(paper(STEEP))).equation
    system = FieldSystem(equation)
    system.take(LOAD)

    def rate(_time: float, state: np.ndarray) -> np.ndarray:
        return np.linalg.solve(equation.mass_at(state), system.evaluate(state).rate)

    start = 0.0 * equation.uniform
    true = solve_ivp(rate, (0.0, 900.0), start, method="Radau", rtol=1e-9, atol=1e-9).y[:, -1]
    load = replace(LOAD, duration=900.0)
    misses = [
        abs(float(equation.fluid @ (simulate_field(
            equation, [load], first_step=step, longest_step=step).state[-1] - true)))
        for step in (30.0, 15.0)
    ]  # fmt: skip
    assert misses[1] < 5e-3
    assert np.log2(misses[0] / misses[1]) == pytest.approx(2.0, abs=0.4)


def test_network_uses_mean_heat_capacity():
    """Network and finite elements with constant values use the mean over the stated temperature range."""
    drawing = paper(WHOLE, fins=False)
    assert zone_network(drawing).total_capacity == pytest.approx(1200.0, rel=1e-9)
    assert section_of(drawing).heat_capacity == pytest.approx(1200.0, rel=1e-9)
    assert paper(STEEP).filling.heat_capacity == pytest.approx(960.0, rel=0.01)
    one = build_field(paper(STEEP), size=0.05)
    assert len(one.equation.storage) == 3
