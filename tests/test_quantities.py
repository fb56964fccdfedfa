"""Conversions of units agree with the constants of SciPy (CODATA and definitions of the units)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import constants

from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, find_quantity, is_unit, spell_unit, to_si


@pytest.mark.parametrize(
    ("unit", "role", "size"),
    [
        ("kgf", "force", constants.g),
        ("lbf", "force", constants.pound_force),
        ("kN", "force", constants.kilo),
        ("in", "displacement", constants.inch),
        ("min", "time", constants.minute),
        ("mA", "current", constants.milli),
    ],
)
def test_unit_is_converted_by_its_defined_factor(unit, role, size):
    assert to_si([0.0, 1.0, -2.5], unit, role) == pytest.approx([0.0, size, -2.5 * size], rel=1e-12)


@given(celsius=st.floats(-200.0, 1000.0))
def test_temperature_scales_convert_to_equal_kelvin_values(celsius):
    kelvin = constants.convert_temperature(celsius, "Celsius", "Kelvin")
    fahrenheit = constants.convert_temperature(celsius, "Celsius", "Fahrenheit")
    for unit in ("degC", "deg_C", "°C", "C", "Celsius"):
        assert to_si(celsius, unit, "temperature") == pytest.approx(kelvin, rel=1e-12)
    assert to_si(fahrenheit, "degF", "temperature") == pytest.approx(kelvin, rel=1e-12)
    assert to_si(kelvin, "K", "temperature") == kelvin


@pytest.mark.parametrize(
    ("spelling", "role", "unit"),
    [
        ("msec", "time", "ms"),
        ("[mm]", "displacement", "mm"),
        ("Newtons", "force", "N"),
        ("Amps", "current", "A"),
        ("m_s", "velocity", "m/s"),
        ("mm/sec", "velocity", "mm/s"),
        ("KN", "force", "kN"),
        ("ma", "current", "mA"),
    ],
)
def test_unit_spellings_of_laboratories_are_read(spelling, role, unit):
    assert spell_unit(spelling, role) == unit
    assert np.array_equal(to_si([1.0, 2.0], spelling, role), to_si([1.0, 2.0], unit, role))


@pytest.mark.parametrize(
    ("unit", "role"),
    [
        ("mm", "temperature"),
        ("C", "force"),
        ("lb", "force"),
    ],
)
def test_unit_of_other_quantity_is_rejected(unit, role):
    quantity = find_quantity(role)
    expected = f"unit '{unit}' is not a unit of {role} (stored in {quantity.unit}); expected one of: "
    with pytest.raises(InputError) as error:
        to_si([1.0], unit, role)
    assert str(error.value) == expected + ", ".join(quantity.units)


@pytest.mark.parametrize(
    "garbled",
    [
        "N m**",
        "'",
        "__import__('os')",
        "((N",
        "N**999999999",
        "(((9**9)**9)**9)**9*N",
    ],
)
def test_misspelt_unit_is_rejected(garbled):
    with pytest.raises(InputError, match="is not a unit of force"):
        to_si([1.0], garbled, "force")


def test_all_documented_units_exist():
    for role, quantity in QUANTITIES.items():
        assert to_si(1.0, quantity.unit, role) == 1.0
        for unit in quantity.units:
            assert is_unit(unit)
            assert np.isfinite(to_si(1.0, unit, role))
    assert not any(map(is_unit, ("CHANNEL1", "fd", "dc")))


@pytest.mark.parametrize("role", QUANTITIES)
@pytest.mark.parametrize("of", QUANTITIES)
def test_unit_belongs_to_one_quantity(role, of):
    for unit in (QUANTITIES[of].unit, *QUANTITIES[of].units):
        assert is_unit(unit, [role]) == (role == of)
