"""Tables: the functions that they stand for, and what the step relies on."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from mrdamper.control.tables import lookup
from mrdamper.control.tables.card_tables import (
    CURRENTS,
    ROWS,
    TABULATED,
    TEMPERATURE_SHARE,
    _along,
    _enough_currents,
    _scales,
    _terms,
    tabulate,
)
from mrdamper.control.tables.lookup import fit_lookup, functions_of_speed, tabulate_lookup, universal_curve
from mrdamper.errors import InputError
from mrdamper.models.dependence import Hill, ParameterLaw, TemperatureDependent
from mrdamper.models.temperature import Linear
from tests.control.dampers import CHAIN, DAMPERS, DOUBLE, SERIES
from tests.support.examples import examples

SHAPES = {
    "viscous_exponent": 0.9, "stribeck_velocity": 0.014, "transition_velocity": 8e-4,
    "saturation_velocity": 0.01, "yield_velocity": 2e-3,
}  # fmt: skip
SPEEDS = np.concatenate([[0.0], np.geomspace(1e-7, 0.999, 20_000)])


def law_s_force(damper, current, kelvin, x, v, w):
    """Return the force [N] from the law's own formula, over currents, and what it is made of at the most."""
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


def table_s_force(tables, kelvin, x, v, w):
    """Return the same at the currents of the tables, as the kernel adds it up."""
    speed, side = abs(v), 1.0 if v >= 0.0 else -1.0
    saturation = float(tables.speed.saturation.at(speed))
    yields = w[0] if tables.elements else side * saturation
    second = w[0] * saturation if tables.saturating else w[1]
    functions = (
        float(table.at(speed))
        for table in (tables.speed.viscous, tables.speed.sliding, tables.speed.breakaway)
    )
    by = (1.0, x, 0.0, *(side * f for f in functions), yields, second, 0.0, 0.0)
    assert len(by) == len(ROWS)
    return np.array(by) @ tables.at(kelvin)


@pytest.mark.system
@pytest.mark.parametrize("law", TABULATED)
def test_the_force_of_the_table_is_the_law_s(law):
    """Rows times what they multiply, at every current and temperature, full hysteresis: 0.01 N."""
    damper = DAMPERS[law]
    tables = tabulate(damper, 2.0)
    x, v = 3e-3, -0.02
    for kelvin in tables.temperatures:
        expected = law_s_force(damper, tables.currents, kelvin, x, v, (-1.0, -1.0))[0]
        found = table_s_force(tables, kelvin, x, v, (-1.0, -1.0))
        np.testing.assert_allclose(found, expected, atol=2e-2 if law == "bouc-wen-saturating" else 1e-2)


@pytest.mark.nightly
@pytest.mark.parametrize("rises", ["as it is", "like a root", "in an S"])
@pytest.mark.parametrize("law", TABULATED)
def test_between_the_table_s_points_too_the_force_is_within_a_thousandth_of_the_peak(law, rises):
    """Any current and temperature of the range, any motion up to 0.3 m/s, any hysteretic state."""
    damper = DAMPERS[law]
    if rises != "as it is":
        hill = Hill(50.0, 900.0, 1.3, 0.6 if rises == "like a root" else 1.9, 2.0)
        forms: dict[str, ParameterLaw] = {
            **damper.coefficients,
            "yield_force": TemperatureDependent(hill, Linear(2e-3)),
        }
        damper = replace(damper, coefficients=forms)
    tables = tabulate(damper, 2.0)
    assert len(tables.currents) <= CURRENTS
    current, rng = np.linspace(0.0, 2.0, 201), np.random.default_rng(1)
    low, high = damper.temperature_range or (0.0, 0.0)
    for _ in range(200):
        kelvin, x = rng.uniform(low, high), rng.uniform(-0.02, 0.02)
        v, w = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-5.0, np.log10(0.3)), rng.uniform(-1.0, 1.0, 2)
        expected, viscous = law_s_force(damper, current, kelvin, x, v, w)
        found = np.interp(current, tables.currents, table_s_force(tables, kelvin, x, v, w))
        peak = tables.peak_yield + np.abs(viscous).max()
        assert np.abs(found - expected).max() < 1e-3 * peak


@pytest.mark.system
@pytest.mark.parametrize("law", TABULATED)
def test_the_tables_of_a_card_s_range_take_8_kilobytes_in_single_precision(law):
    tables = tabulate(DAMPERS[law], 2.0, temperatures=(293.15, 396.15))
    numbers = tables.factor.size + tables.column.size + sum(o.cell.size for o in tables.lookups)
    assert 4 * numbers < 8192


@pytest.mark.parametrize("law", TABULATED)
def test_the_functions_of_speed_are_themselves_within_1e_5(law):
    """Each law's own: a power, two sides of friction, and what its yield force follows."""
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
        assert np.abs(getattr(tables.speed, name).at(SPEEDS) - values).max() < 1e-5


@pytest.mark.parametrize("law", TABULATED)
def test_what_cubics_are_given_as_slopes_are_the_functions_own(law, monkeypatch):
    """A wrong slope would still be near enough with more cells: each is held against differences."""
    asked = []

    def looked(value, slope, end, error, **given):
        at = np.geomspace(2e-4, 0.98, 40) * end
        step = 1e-6 * at
        asked.append(np.abs((value(at + step) - value(at - step)) / (2.0 * step) - slope(at)) * at)
        return fit_lookup(value, slope, end, error, **given)

    monkeypatch.setattr(lookup, "fit_lookup", looked)
    functions_of_speed(
        {"viscous", "sliding", "breakaway"}, SHAPES, 1.0, saturating=law == "bouc-wen-saturating",
        memoryless=law == "bingham",
    )  # fmt: skip
    assert len(asked) == (4 if law in ("bouc-wen-saturating", "bingham") else 3)
    assert np.max(asked) < 1e-5
    if law == "double-bouc-wen":
        asked.clear()
        universal_curve.__wrapped__(-0.42, 0.57)
        # maps between branches are told from a fine table of the curve
        assert [float(np.median(each)) for each in asked] == pytest.approx([0.0] * 5, abs=5e-3)


@pytest.mark.system
@examples(6)
@given(kappa=st.floats(-1.0, 0.9), n=st.floats(0.3, 6.0))
def test_the_curve_s_tables_are_the_kernel_s_curve_and_a_turn_sets_out_at_the_other_size(kappa, n):
    """3e-4 on w; after a turn at any w the place is one of -w, and after a second one again of w: 3e-4."""
    tables = universal_curve(kappa, n)
    tau = np.linspace(0.0, 8.0, 4001)
    up, down = (core.curve(kappa, n, side * tau)[0] for side in (1.0, -1.0))
    assert np.abs(tables.loading.at(tau) - up).max() < 3e-4
    inside = -down < 1.0 - 1e-5
    assert np.abs(tables.unloading.at(tau)[inside] + down[inside]).max() < 3e-4
    turned = np.maximum(tables.unload_map.at(tau), 0.0)
    assert np.abs(tables.unloading.at(turned) - tables.loading.at(tau)).max() < 3e-4
    left = tables.unloaded - turned
    again = np.where(
        left > turned, tables.reload_map.at(turned), -tables.reload_map_rest.at(np.maximum(left, 0.0))
    )
    assert np.abs(tables.loading.at(np.maximum(again, 0.0)) - tables.loading.at(tau)).max() < 3e-4


def test_the_cells_are_no_more_than_the_error_asks_for():
    """Cubics are of fourth order: a sixteenth of the error for twice the cells."""
    cells = [len(fit_lookup(np.sin, np.cos, 3.0, error).cell) for error in (1e-3, 1e-5, 1e-7)]
    assert cells[0] < cells[1] < cells[2] < 150
    made = fit_lookup(np.sin, np.cos, 3.0, 1e-5)
    u = np.linspace(0.0, 3.0, 10_001)
    assert np.abs(made.at(u) - np.sin(u)).max() < 1.2e-5


def test_what_adds_up_to_a_force_is_held_against_all_yield_force():
    """A stiffness at a stroke of 50 mm, a mass at 50 m/s^2; what adds up to none is held against itself."""
    rows = np.zeros((len(ROWS), 2, 3))
    rows[6], rows[7], rows[3], rows[8], rows[9] = 300.0, 200.0, 70.0, 4e3, 5e3
    expected = dict.fromkeys(ROWS, 500.0)
    expected |= {"stiffness": 1e4, "mass": 10.0, "viscous": 70.0, "rho": 4e3, "second_rho": 5e3}
    assert dict(zip(ROWS, _scales(rows), strict=True)) == expected


def test_rising_cells_nowhere_fall():
    """Through a corner that a plain cubic would overshoot."""
    made = tabulate_lookup(
        lambda u: np.minimum(u, 0.3), lambda u: np.where(u < 0.3, 1.0, 0.0), 1e-3, 1.0, rising=True
    )
    values = made.at(np.linspace(0.0, 1.0, 50_001))
    assert (np.diff(values) >= -1e-15).all()
    assert values.max() <= 0.3 + 1e-12


def test_beyond_its_end_a_table_holds_its_last_value():
    made = tabulate_lookup(np.sqrt, lambda u: 0.5 / np.sqrt(np.maximum(u, 1e-4)), 1e-3, 1.0)
    assert made.at(1e9) == pytest.approx(made.at(made.top - made.offset))


def test_gains_multiply_their_parts_only():
    tables = tabulate(DOUBLE, 2.0)
    expected = {"yield": 0.9, "second": 0.9, "viscous": 1.3, "sliding": 1.4, "breakaway": 1.4}
    found = tables.scaled(0.9, 1.3, 1.4)
    for k, row in enumerate(ROWS):
        np.testing.assert_allclose(found.at(350.0)[k], expected.get(row, 1.0) * tables.at(350.0)[k])


@pytest.mark.parametrize("largest", [0.0, -1.0, float("nan")])
def test_a_largest_command_that_is_no_current_is_refused(largest):
    with pytest.raises(InputError, match="largest command is"):
        tabulate(DOUBLE, largest)


@given(power=st.floats(0.4, 3.0), viscous=st.floats(0.0, 3.0), share=st.floats(2e-3, 0.03))
def test_each_straight_line_over_the_current_goes_as_far_as_it_may(power, viscous, share):
    """What adds up to a force is off together, a viscosity by itself; eighths are ends of lines."""
    at, rows = np.linspace(0.0, 1.0, 65), np.zeros((len(ROWS), 2, 65))
    rows[0], rows[6], rows[3, 1] = 0.3 * at**2, at**power, 2.0 + viscous * at**2
    off_of = [rows[0, 1], rows[6, 1], rows[3, 1] / (2.0 + viscous)]

    def is_near(a: int, b: int) -> bool:
        off = [np.abs(row - np.interp(at, at[[a, b]], row[[a, b]]))[a : b + 1] for row in off_of]
        return bool((off[0] + off[1]).max() <= share and off[2].max() <= share)

    ends = np.rint(64 * _enough_currents(rows, _scales(rows), share)).astype(int).tolist()
    assert {*range(0, 65, 8)} <= {*ends}
    for a, b in pairwise(ends):
        assert a < b
        assert b == a + 1 or is_near(a, b)
        assert b % 8 == 0 or not is_near(a, b + 1)


def test_terms_are_products_of_temperature_and_current_that_add_up_to_the_rows():
    """A row that current does not move is a level, or a column of ones; parabolas are as few as will do."""
    warm, at = np.linspace(0.0, 1.0, 193), np.linspace(0.0, 1.0, 9)
    rows = np.zeros((len(ROWS), 193, 9))
    rows[0], rows[8] = (2.0 - warm)[:, None], 5.0
    rows[3] = np.outer(np.exp(-2.0 * warm), 1.0 + at)
    rows[6] = np.outer(1.0 - 0.2 * warm, at) + np.outer(warm**2, at**2)
    rows_of, factor, column, pieces = _terms(rows, _scales(rows))
    assert rows_of == (0, 3, 6, 6, 8)
    assert column.shape == (9, 4)
    assert (column[:, 3] == 1.0).all()
    terms = _along(factor.transpose(1, 0, 2), 193)[:, :, None] * np.vstack([np.ones(9), column.T])[:, None]
    allowed = TEMPERATURE_SHARE * _scales(rows)
    for row, size in zip((0, 3, 6, 8), allowed[[0, 3, 6, 8]], strict=True):
        off = terms[[each == row for each in rows_of]].sum(axis=0) - rows[row]
        assert np.abs(off).max() <= size
    h = 1.0 / pieces  # a parabola is off by h^3 |d3f| / (72 sqrt 3) at the most, f = 2 exp(-2 t)
    assert 16.0 * h**3 / 124.7 <= allowed[3] < 16.0 * (2.0 * h) ** 3 / 124.7


def test_what_no_current_moves_is_a_level_up_to_the_yield_force_and_a_column_of_ones_from_there_on():
    """A yield force and an inverse yield displacement are read over the current whatever they do."""
    rows_of, factor, column, _ = _terms(np.full((len(ROWS), 193, 9), 5.0), np.ones(len(ROWS)))
    assert rows_of == tuple(range(len(ROWS)))
    assert ROWS[len(rows_of) - column.shape[1]] == "yield"
    assert (column == 1.0).all()
    assert (factor[:, :, 0] == 5.0).all()


def test_the_eighths_of_the_largest_current_are_currents_of_the_table():
    tables = tabulate(DOUBLE, 3.3)
    np.testing.assert_allclose(tables.currents[list(tables.eighths)], 3.3 * np.arange(9) / 8, rtol=1e-15)


@pytest.mark.parametrize("end", [0, -1])
def test_beyond_its_temperatures_a_table_holds_what_is_at_the_end(end):
    tables = tabulate(DOUBLE, 2.0, temperatures=(280.0, 390.0))
    at = float(tables.temperatures[end])
    np.testing.assert_array_equal(tables.at(at + (70.0 if end else -70.0)), tables.at(at))
    assert (tables.at(at) != tables.at(335.0)).any()


@pytest.mark.parametrize(("damper", "apart"), [(SERIES, 5.0), (CHAIN, 10.0)])
def test_sheets_of_a_law_that_is_stepped_lie_evenly_over_the_temperatures_that_are_asked_for(damper, apart):
    sheets = tabulate(damper, 2.0, temperatures=(280.0, 390.0)).temperatures
    assert sheets == pytest.approx(np.arange(280.0, 391.0, apart))
    assert tabulate(damper, 2.0, temperatures=(300.0, 300.0)).temperatures == pytest.approx([300.0, 300.0])


def test_what_is_not_there_takes_the_least_a_table_can():
    assert len(lookup.no_curve().loading.cell) == len(lookup.no_functions_of_speed().viscous.cell) == 1
