"""Tables: the functions that they stand for, and what the step relies on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.control.tables import ROWS, TABULATED, tabulate, tabulate_octaves
from mrdamper.errors import InputError
from tests.control.dampers import DAMPERS, DOUBLE

SPEEDS = np.concatenate([[0.0], np.geomspace(1e-7, 0.999, 20_000)])


@pytest.mark.parametrize("law", TABULATED)
def test_the_force_of_the_table_is_the_law_s(law):
    """Rows times what they multiply, at every current and temperature, full hysteresis: 0.01 N."""
    damper = DAMPERS[law]
    tables = tabulate(damper, 2.0)
    x, v = 3e-3, -0.02
    for k, kelvin in enumerate(tables.temperatures):
        c = dict(zip(damper.law.names, damper.coefficients_at(tables.currents, kelvin), strict=True))
        fade = np.exp(-((v / c["stribeck_velocity"]) ** 2))
        expected = (
            c["offset"]
            + c["stiffness"] * x
            + c["viscosity"] * v * (abs(v) / 0.1) ** (c["viscous_exponent"] - 1.0)
            + (c["coulomb_friction"] + c["breakaway_friction"] * fade) * np.tanh(v / c["transition_velocity"])
        )
        rate = c["rate_force"] * abs(v) / (abs(v) + c["saturation_velocity"]) if "rate_force" in c else 0.0
        full = c["yield_force"] + c.get("second_force", 0.0) + rate
        expected = expected - (full * np.tanh(-v / c["yield_velocity"]) if law == "bingham" else full)
        speed, built_up = abs(v), float(tables.built_up.at(abs(v)))
        yields = built_up if law == "bingham" else 1.0
        second = built_up if tables.saturating else 1.0
        friction = float(tables.sliding.at(speed)), float(tables.breakaway.at(speed))
        by = (1.0, x, 0.0, -float(tables.viscous.at(speed)), -friction[0], -friction[1], -yields, -second)
        assert len(by) == len(ROWS)
        np.testing.assert_allclose(np.array(by) @ tables.force[k], expected, atol=1e-2)


def test_the_functions_of_speed_are_themselves_within_1e_5():
    tables = tabulate(DOUBLE, 2.0)
    power = SPEEDS * (np.maximum(SPEEDS, 1e-300) / 0.1) ** (0.9 - 1.0)
    side = np.tanh(SPEEDS / 8e-4)
    assert np.abs(tables.viscous.at(SPEEDS) - power).max() < 1e-5
    assert np.abs(tables.sliding.at(SPEEDS) - side).max() < 1e-5
    assert np.abs(tables.breakaway.at(SPEEDS) - side * np.exp(-((SPEEDS / 0.014) ** 2))).max() < 1e-5


@settings(max_examples=12, deadline=None)
@given(kappa=st.floats(-1.0, 0.9), n=st.floats(0.3, 6.0))
def test_the_curve_s_tables_are_the_kernel_s_curve_and_each_other_s_inverse(kappa, n):
    """3e-4 on w, and there and back 3e-4 again up to w = 0.999."""
    forms = {**DOUBLE.coefficients}
    forms["kappa"], forms["n"] = (type(forms["kappa"])(value) for value in (kappa, n))  # type: ignore[call-arg]
    tables = tabulate(type(DOUBLE)(DOUBLE.law, forms), 2.0)
    tau = np.linspace(0.0, 8.0, 4001)
    up, down = (core.curve(kappa, n, side * tau)[0] for side in (1.0, -1.0))
    assert np.abs(tables.loading.at(tau) - up).max() < 3e-4
    inside = -down < 1.0 - 1e-5
    assert np.abs(tables.unloading.at(tau)[inside] + down[inside]).max() < 3e-4
    w = np.linspace(0.0, 0.999, 2000)
    assert np.abs(tables.loading.at(np.maximum(tables.to_load.at(1.0 - w), 0.0)) - w).max() < 3e-4
    assert np.abs(tables.unloading.at(np.maximum(tables.to_unload.at(w), 0.0)) - w).max() < 3e-4


def test_rising_cells_nowhere_fall():
    """Through a corner that a plain cubic would overshoot."""
    made = tabulate_octaves(
        lambda u: np.minimum(u, 0.3), lambda u: np.where(u < 0.3, 1.0, 0.0), 1e-3, 1.0, rising=True
    )
    values = made.at(np.linspace(0.0, 1.0, 50_001))
    assert (np.diff(values) >= -1e-15).all()
    assert values.max() <= 0.3 + 1e-12


def test_beyond_its_end_a_table_holds_its_last_value():
    made = tabulate_octaves(np.sqrt, lambda u: 0.5 / np.sqrt(np.maximum(u, 1e-4)), 1e-3, 1.0)
    assert made.at(1e9) == pytest.approx(made.at(made.top - made.offset))


def test_gains_multiply_their_parts_only():
    tables = tabulate(DOUBLE, 2.0)
    expected = {"yield": 0.9, "second": 0.9, "viscous": 1.3, "sliding": 1.4, "breakaway": 1.4}
    found = tables.scaled(0.9, 1.3, 1.4)
    for k, row in enumerate(ROWS):
        np.testing.assert_allclose(found[:, k], expected.get(row, 1.0) * tables.force[:, k])


@pytest.mark.parametrize("largest", [0.0, -1.0, float("nan")])
def test_a_largest_command_that_is_no_current_is_refused(largest):
    with pytest.raises(InputError, match="largest command is"):
        tabulate(DOUBLE, largest)
