"""Heat capacities over temperature: what calorimeter rows lead to, and that heat is neither made nor lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.drawing import Calibration, DamperDrawing
from mrdamper.thermal.drawing_file import drawing_of, text_of
from mrdamper.thermal.heat_capacity import CapacityCurve, MeasuredHeatCapacity, read_heat_capacity
from mrdamper.thermal.model.finite_element import FieldModel, build_field, discretise
from mrdamper.thermal.model.heat_equation import FieldSystem, simulate_field
from mrdamper.thermal.model.mesh import mesh_section
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from tests.support.tiers import one_by_day

ROWS = (20.0, 60.0, 100.0, 140.0)
STEEP = MeasuredHeatCapacity(
    temperature_degC=ROWS,
    fluid_J_kg_K=(800.0, 900.0, 1010.0, 1130.0),
    body_J_kg_K=(460.0, 490.0, 520.0, 550.0),
    fins_J_kg_K=(880.0, 920.0, 960.0, 1000.0),
)
WHOLE = MeasuredHeatCapacity(temperature_degC=(20.0, 140.0), damper_J_K=(900.0, 1500.0))
LOAD = Load(1800.0, lambda kelvin: np.full(np.shape(kelvin), 95.0), 12.0)


def paper(heat_capacity: MeasuredHeatCapacity, *, fins: bool = True) -> DamperDrawing:
    drawing = replace(drawing_of(text_of("paper")), calibration=Calibration())
    return replace(drawing if fins else drawing.with_sink(None), heat_capacity=heat_capacity)


def coarse(drawing: DamperDrawing, *, insulated: bool = False) -> FieldModel:
    section = section_of(drawing)
    if insulated:
        surfaces = tuple(replace(each, emissivity=0.0, mount=0.0) for each in section.surfaces)
        section = replace(section, surfaces=surfaces, films=0.0 * section.films)
    return discretise(section, mesh_section(section, 0.03, levels=1))


@given(st.lists(st.floats(300.0, 2000.0), min_size=3, max_size=3), st.floats(200.0, 500.0))
def test_the_integral_s_slope_is_the_curve(values: list[float], kelvin: float):
    curve = CapacityCurve(280.0, 400.0, (values[0], 0.2 * (values[1] - values[0]) / 120.0, 1e-3))
    slope = (curve.integral(np.array(kelvin + 1e-3)) - curve.integral(np.array(kelvin - 1e-3))) / 2e-3
    assert float(slope) == pytest.approx(curve.at(kelvin), rel=1e-6)


def test_noisy_rows_of_a_parabola_lead_back_to_it():
    """Within three standard errors of the mean; the residual is the noise."""
    degrees = np.linspace(20.0, 140.0, 61)
    true = 800.0 + 2.0 * (degrees - 20.0) + 4e-3 * (degrees - 20.0) ** 2
    rows = true * (1.0 + 0.01 * np.random.default_rng(3).standard_normal(61))
    found = MeasuredHeatCapacity(temperature_degC=tuple(degrees), fluid_J_kg_K=tuple(rows)).parts["fluid"]
    at = [found.curve.at(each + ZERO_CELSIUS_K) for each in degrees]
    assert np.abs(at / true - 1.0).max() < 3.0 * 0.01 * np.sqrt(9.0 / 61)
    assert found.residual == pytest.approx(0.01, rel=0.25)


def test_without_losses_the_heat_that_went_in_says_the_temperature():
    """A whole damper whose heat capacity rises from 900 J/K at 20 degC by 5 J/K a kelvin: a quadratic."""
    model = coarse(paper(WHOLE, fins=False), insulated=True)
    load = replace(LOAD, duration=1200.0, coil_W=0.0)
    course = simulate_field(model.equation, [load])
    mean = float(model.equation.uniform @ (model.equation.mass @ course.state[-1]))
    mean /= float(model.equation.uniform @ (model.equation.mass @ model.equation.uniform))
    expected = (np.sqrt(900.0**2 + 2.0 * 5.0 * 95.0 * 1200.0) - 900.0) / 5.0
    assert mean == pytest.approx(expected, rel=2e-3)  # each part by its own mean, not by the whole's
    assert course.closure < 1e-12


@pytest.mark.parametrize("fins", one_by_day([True, False]), ids=["fins", "bare"])
def test_reduced_as_elements_and_the_account_closes(fins: bool):
    model = coarse(paper(STEEP, fins=fins))
    full, small = (simulate_field(each.equation, [LOAD]) for each in (model, reduce_field(model, order=22)))
    assert np.abs(full.fluid - small.fluid).max() < 10e-3
    assert np.abs(full.hottest("coil") - small.hottest("coil")).max() < 50e-3
    assert max(full.closure, small.closure) < 1e-9
    constant = simulate_field(replace(model.equation, storage=()), [LOAD])
    assert np.abs(constant.fluid - full.fluid).max() > 0.5  # it makes a difference


@pytest.mark.nightly
def test_it_is_the_same_equation_that_another_integrator_solves_to_second_order():
    """The reduced equation by an implicit method of SciPy's, tight; our error falls by four with the step."""
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


def test_what_takes_constants_takes_the_mean_over_the_rows():
    drawing = paper(WHOLE, fins=False)
    assert zone_network(drawing).total_capacity == pytest.approx(1200.0, rel=1e-9)
    assert section_of(drawing).heat_capacity == pytest.approx(1200.0, rel=1e-9)
    assert paper(STEEP).filling.heat_capacity == pytest.approx(958.0, rel=0.01)
    one = build_field(paper(STEEP), size=0.05)
    assert len(one.equation.storage) == 3


def test_rows_are_read_from_the_drawing_and_from_a_table(tmp_path: Path):
    text = text_of("paper") + "\n[heat_capacity]\ntemperature_degC = [20, 140]\ndamper_J_K = [900, 1500]\n"
    assert drawing_of(text).heat_capacity == WHOLE
    path = tmp_path / "rows.csv"
    path.write_text("temperature_degC,damper_J_K\n20,900\n140,1500\n", encoding="utf-8")
    assert read_heat_capacity(path) == WHOLE


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("20,900", r"rows\.csv: .*expected a header and two rows.*Check the rows"),
        ("20,900\n140,-3", r"damper_J_K is -3 at 140 degC; expected heat capacities above zero.*Check"),
        ("20,900\n40,10\n140,900", r"the curve through its rows falls to -?\d.*above zero.*Check the rows"),
        ("20,900\n20,900", r"temperature_degC does not rise from row to row; expected rising.*Check"),
    ],
)
def test_rows_that_cannot_be_are_refused_with_the_remedy(tmp_path: Path, rows: str, message: str):
    path = tmp_path / "rows.csv"
    path.write_text(f"temperature_degC,damper_J_K\n{rows}\n", encoding="utf-8")
    with pytest.raises(InputError, match=f"(?s){message}"):
        read_heat_capacity(path)


def test_more_rows_than_a_parabola_has_numbers_are_fitted_and_two_are_a_line():
    """Rows of a cubic leave its part beyond the parabola; the residual is that over the mean."""
    degrees = np.linspace(20.0, 140.0, 9)
    rows = 1000.0 + 100.0 * ((degrees - 80.0) / 60.0) ** 3
    found = MeasuredHeatCapacity(temperature_degC=tuple(degrees), rod_J_kg_K=tuple(rows)).parts["rod"]
    left = rows - np.polynomial.Polynomial.fit(degrees, rows, 2)(degrees)
    assert found.residual == pytest.approx(float(np.sqrt(np.mean(left**2))) / 1000.0, rel=1e-6)
    assert [found.curve.at(t + ZERO_CELSIUS_K) for t in degrees] == pytest.approx(list(rows - left))
    line = MeasuredHeatCapacity(temperature_degC=(20.0, 140.0), rod_J_kg_K=(500.0, 620.0)).parts["rod"]
    assert [line.curve.at(t + ZERO_CELSIUS_K) for t in (-50.0, 20.0, 80.0, 140.0, 300.0)] == pytest.approx(
        [500.0, 500.0, 560.0, 620.0, 620.0]
    )
    assert (line.curve.mean, line.residual) == pytest.approx((560.0, 0.0))
    assert line.curve.over_mean().mean == pytest.approx(1.0)
    # held below the rows and beyond them
    kelvin = np.array([283.15, 293.15, 413.15, 423.15])
    assert line.curve.integral(kelvin) == pytest.approx([-5000.0, 0.0, 67200.0, 73400.0])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"rod_J_kg_K": (1.0,)}, "rod_J_kg_K has 1 values for 2 temperatures; expected one a row"),
        ({"rod_J_kg_K": (1.0, 0.0)}, "rod_J_kg_K is 0 at 140 degC; expected heat capacities above zero"),
        ({"rod_J_kg_K": (1.0, np.inf)}, "rod_J_kg_K is inf at 140 degC"),
        ({}, "no part has values; expected one or more of: fluid_J_kg_K, body"),
        ({"rod_J_kg_K": (1.0, 1.0), "damper_J_K": (1.0, 1.0)}, "damper_J_K stands beside rod_J_kg_K"),
        ({"temperature_degC": (20.0,)}, "it has 1 row; expected two rows or more"),
    ],
)
def test_rows_that_do_not_belong_together_are_refused(given: dict[str, tuple[float, ...]], said: str):
    with pytest.raises(InputError, match=said):
        MeasuredHeatCapacity(**{"temperature_degC": (20.0, 140.0), **given})


def test_fins_may_be_measured_beside_the_whole_damper():
    found = MeasuredHeatCapacity(
        temperature_degC=(20.0, 140.0), damper_J_K=(900.0, 1500.0), fins_J_kg_K=(880.0, 1000.0)
    )
    drawing = paper(found)
    assert drawing.sink is not None
    assert drawing.sink.material.heat_capacity == pytest.approx(940.0)
    assert drawing.capacity_growth("fins") == found.parts["fins"].curve.over_mean()
    assert drawing.capacity_growth("rod") == found.parts["damper"].curve.over_mean()
    assert paper(WHOLE).capacity_growth("fins") is None
    assert paper(STEEP).capacity_growth("rod") is None
