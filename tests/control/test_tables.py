"""Tables of functions in controllers are accurate and small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.control.settings import SETTINGS
from mrdamper.control.tables.card_tables import TABULATED, DamperTables, tabulate
from mrdamper.control.tables.lookup import fit_lookup, tabulate_lookup, universal_curve
from mrdamper.errors import InputError
from mrdamper.models.dependence import Hill, ParameterLaw, TemperatureDependent
from mrdamper.models.temperature import Linear
from tests.support.cards import DAMPERS, DOUBLE
from tests.support.examples import examples

SPEEDS = np.concatenate([[0.0], np.geomspace(1e-7, 0.999, 20_000)])
every_law = pytest.mark.parametrize("law", TABULATED)


def force_of_law(damper, current, kelvin, x, v, w):
    """Return the force and the viscous part [N] at several currents, from the formula of the law."""
    c = dict(zip(damper.law.names, damper.coefficients_at(current, kelvin), strict=True))
    fade = np.exp(-((v / c["stribeck_velocity"]) ** 2))
    viscous = c["viscosity"] * v * (max(abs(v), 1e-300) / 0.1) ** (c["viscous_exponent"] - 1.0)
    rest = (
        c["offset"]
        + c["stiffness"] * x
        + (c["coulomb_friction"] + c["breakaway_friction"] * fade) * np.tanh(v / c["transition_velocity"])
    )
    if "yield_velocity" in c:
        return rest + viscous + c["yield_force"] * np.tanh(v / c["yield_velocity"]), viscous
    rate = c["rate_force"] * abs(v) / (abs(v) + c["saturation_velocity"]) if "rate_force" in c else 0.0
    first = (c["yield_force"] + rate) * w[0]
    return rest + viscous + first + c.get("second_force", 0.0) * w[1], viscous


def force_of_tables(tables: DamperTables, kelvin, x, v, w):
    """Return the force [N] at each current of the tables. The terms are summed as in the C kernel."""
    speed, side = abs(v), 1.0 if v >= 0.0 else -1.0
    saturation = float(tables.speed.saturation.evaluate(speed))
    yields = w[0] if tables.elements else side * saturation
    second = w[0] * saturation if tables.saturating else w[1]
    functions = (
        float(table.evaluate(speed))
        for table in (tables.speed.viscous, tables.speed.sliding, tables.speed.breakaway)
    )
    by = (1.0, x, 0.0, *(side * f for f in functions), yields, second, 0.0, 0.0)
    return np.array(by) @ tables.evaluate(kelvin)


@pytest.mark.system
@every_law
def test_table_force_equals_force_of_law(law):
    """The force error is below 0.02 N at the currents and temperatures of the table."""
    damper = DAMPERS[law]
    tables = tabulate(damper, 2.0)
    x, v = 3e-3, -0.02
    for kelvin in tables.temperatures:
        expected = force_of_law(damper, tables.currents, kelvin, x, v, (-1.0, -1.0))[0]
        np.testing.assert_allclose(force_of_tables(tables, kelvin, x, v, (-1.0, -1.0)), expected, atol=2e-2)


@pytest.mark.nightly
@pytest.mark.parametrize("exponent", [None, 0.6, 1.9])
@every_law
def test_interpolated_table_force_is_accurate(law, exponent):
    """The force error is below 0.1 % of the peak force.

    The test uses all currents, and random temperatures, hysteresis states and speeds up to 0.3 m/s.
    """
    damper = DAMPERS[law]
    if exponent is not None:
        forms: dict[str, ParameterLaw] = {
            **damper.coefficients,
            "yield_force": TemperatureDependent(Hill(50.0, 900.0, 1.3, exponent, 2.0), Linear(2e-3)),
        }
        damper = replace(damper, coefficients=forms)
    tables = tabulate(damper, 2.0)
    assert len(tables.currents) <= SETTINGS.current_count_max
    peak_yield = max(float(tables.evaluate(kelvin)[6:8].sum(axis=0).max()) for kelvin in tables.temperatures)
    current, rng = np.linspace(0.0, 2.0, 201), np.random.default_rng(1)
    low, high = damper.temperature_range or (0.0, 0.0)
    for _ in range(200):
        kelvin, x = rng.uniform(low, high), rng.uniform(-0.02, 0.02)
        v, w = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, np.log10(0.3)), rng.uniform(-1.0, 1.0, 2)
        expected, viscous = force_of_law(damper, current, kelvin, x, v, w)
        found = np.interp(current, tables.currents, force_of_tables(tables, kelvin, x, v, w))
        assert np.abs(found - expected).max() < 1e-3 * (peak_yield + np.abs(viscous).max())


@pytest.mark.system
@every_law
def test_controller_tables_need_under_8_kilobytes(law):
    tables = tabulate(DAMPERS[law], 2.0, temperatures=(293.15, 396.15))
    numbers = tables.factor.size + tables.column.size + sum(o.cell.size for o in tables.lookups)
    assert 4 * numbers < 8192


@every_law
def test_tabulated_functions_of_speed_are_accurate(law):
    """The viscous power law, both friction terms and the yield-force function have errors below 1e-5."""
    tables = tabulate(DAMPERS[law], 2.0)
    side = np.tanh(SPEEDS / 8e-4)
    expected = {
        "viscous": SPEEDS * (np.maximum(SPEEDS, 1e-300) / 0.1) ** (0.9 - 1.0),
        "sliding": side,
        "breakaway": side * np.exp(-((SPEEDS / 0.014) ** 2)),
        "saturation": np.zeros_like(SPEEDS),
    }
    if law == "bouc-wen-saturating":
        expected["saturation"] = SPEEDS / (SPEEDS + 0.01)
    elif law == "bingham":
        expected["saturation"] = np.tanh(SPEEDS / 2e-3)
    for name, values in expected.items():
        assert np.abs(getattr(tables.speed, name).evaluate(SPEEDS) - values).max() < 1e-5


@pytest.mark.system
@examples(6)
@given(kappa=st.floats(-1.0, 0.9), n=st.floats(0.3, 6.0))
def test_tabulated_hysteresis_curve_equals_kernel(kappa, n):
    """The error of the hysteresis variable w is below 3e-4, also after one and after two reversals."""
    tables = universal_curve(kappa, n)
    tau = np.linspace(0.0, 8.0, 4001)
    up, down = (core.curve(kappa, n, side * tau)[0] for side in (1.0, -1.0))
    assert np.abs(tables.loading.evaluate(tau) - up).max() < 3e-4
    inside = -down < 1.0 - 1e-5
    assert np.abs(tables.unloading.evaluate(tau)[inside] + down[inside]).max() < 3e-4
    turned = np.maximum(tables.unload_map.evaluate(tau), 0.0)
    assert np.abs(tables.unloading.evaluate(turned) - tables.loading.evaluate(tau)).max() < 3e-4
    left = tables.unloaded - turned
    again = np.where(
        left > turned,
        tables.reload_map.evaluate(turned),
        -tables.reload_map_rest.evaluate(np.maximum(left, 0.0)),
    )
    assert np.abs(tables.loading.evaluate(np.maximum(again, 0.0)) - tables.loading.evaluate(tau)).max() < 3e-4


def test_lookup_cubics_have_fourth_order():
    """An error that is 100 times smaller requires about three times as many cells."""
    cells = [len(fit_lookup(np.sin, np.cos, 3.0, error).cell) for error in (1e-3, 1e-5, 1e-7)]
    assert cells[0] < cells[1] < cells[2] < 150
    made = fit_lookup(np.sin, np.cos, 3.0, 1e-5)
    u = np.linspace(0.0, 3.0, 10_001)
    assert np.abs(made.evaluate(u) - np.sin(u)).max() < 1.2e-5


def test_table_of_rising_function_never_falls():
    """A cubic without limiter would overshoot at the corner. Beyond its end, the function is constant."""
    made = tabulate_lookup(
        lambda u: np.minimum(u, 0.3), lambda u: np.where(u < 0.3, 1.0, 0.0), 1e-3, 1.0, rising=True
    )
    values = made.evaluate(np.linspace(0.0, 1.0, 50_001))
    assert (np.diff(values) >= -1e-15).all()
    assert values.max() <= 0.3 + 1e-12
    assert made.evaluate(1e9) == pytest.approx(made.evaluate(made.top - made.offset))


@pytest.mark.parametrize("largest", [0.0, float("nan")])
def test_tables_require_positive_largest_command(largest):
    with pytest.raises(InputError, match="largest command is"):
        tabulate(DOUBLE, largest)


def test_tables_contain_quarters_of_largest_current():
    tables = tabulate(DOUBLE, 3.3)
    np.testing.assert_allclose(tables.currents[list(tables.quarters)], 3.3 * np.arange(5) / 4, rtol=1e-15)


@pytest.mark.parametrize("end", [0, -1])
def test_tables_are_constant_outside_their_temperatures(end):
    tables = tabulate(DOUBLE, 2.0, temperatures=(280.0, 390.0))
    at = float(tables.temperatures[end])
    np.testing.assert_array_equal(tables.evaluate(at + (70.0 if end else -70.0)), tables.evaluate(at))
    assert (tables.evaluate(at) != tables.evaluate(335.0)).any()
