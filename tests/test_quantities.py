"""Units at the door, against the constants that SciPy prints (CODATA and the definitions of the units)."""

import subprocess
import sys

import numpy as np
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import constants

from mrdamper import quantities
from mrdamper.arrays import read_only
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, find_quantity, is_unit, spell_unit, to_si


@pytest.mark.parametrize(
    ("unit", "role", "size"),
    [
        ("kgf", "force", constants.g),
        ("lbf", "force", constants.pound_force),
        ("kN", "force", constants.kilo),
        ("in", "displacement", constants.inch),
        ("mm", "displacement", constants.milli),
        ("um", "displacement", constants.micro),
        ("in/s", "velocity", constants.inch),
        ("mm/s", "velocity", constants.milli),
        ("ms", "time", constants.milli),
        ("min", "time", constants.minute),
        ("mA", "current", constants.milli),
        ("mV", "voltage", constants.milli),
    ],
)
def test_a_unit_is_as_large_as_it_is_defined(unit, role, size):
    assert to_si([0.0, 1.0, -2.5], unit, role) == pytest.approx([0.0, size, -2.5 * size], rel=1e-12)


@pytest.mark.parametrize(("role", "unit"), quantities._USUAL)
def test_the_units_that_are_converted_without_pint_are_pint_s(role, unit):
    asked = pint.application_registry.Quantity
    si = QUANTITIES[role].unit
    line = [float(asked(x, unit).to(si).magnitude) for x in (0.0, 1.0)]
    assert quantities._USUAL[role, unit] == (line[1] - line[0], line[0])


@given(celsius=st.floats(-200.0, 1000.0))
def test_temperatures_agree_on_the_scale(celsius):
    kelvin = constants.convert_temperature(celsius, "Celsius", "Kelvin")
    fahrenheit = constants.convert_temperature(celsius, "Celsius", "Fahrenheit")
    for unit in ("degC", "deg_C", "°C", "C", "Celsius"):
        assert to_si(celsius, unit, "temperature") == pytest.approx(kelvin, rel=1e-12)
    assert to_si(fahrenheit, "degF", "temperature") == pytest.approx(kelvin, rel=1e-12)
    assert to_si(kelvin, "K", "temperature") == kelvin


@pytest.mark.parametrize(
    ("spelling", "role", "unit"),
    [
        ("Sec", "time", "s"),
        ("msec", "time", "ms"),
        ("[mm]", "displacement", "mm"),
        ("Inches", "displacement", "in"),
        ("Newtons", "force", "N"),
        ("kp", "force", "kgf"),
        ("Amps", "current", "A"),
        ("Volts", "voltage", "V"),
        ("m_s", "velocity", "m/s"),
        ("mm/sec", "velocity", "mm/s"),
        ("KN", "force", "kN"),
        ("MM", "displacement", "mm"),
        ("SEC", "time", "s"),
        ("LBF", "force", "lbf"),
        ("ips", "velocity", "in/s"),
        ("ma", "current", "mA"),
    ],
)
def test_rigs_spell_units_in_their_own_way(spelling, role, unit):
    assert spell_unit(spelling, role) == unit
    assert np.array_equal(to_si([1.0, 2.0], spelling, role), to_si([1.0, 2.0], unit, role))


@pytest.mark.parametrize(
    ("unit", "role"),
    [
        ("mm", "temperature"),
        ("C", "force"),
        ("lb", "force"),
        ("A", "voltage"),
        ("g", "force"),
        ("kg", "force"),
    ],
)
def test_a_unit_of_something_else_is_refused_with_the_choices(unit, role):
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
        "5",
        "3 mm",
        "__import__('os')",
        "((N",
        "N/",
        "N**999999999",
        "1e999*N",
        "-N",
        "N" * 40,
        "N**9**9**9",
        "N^9^9",
        "(((9**9)**9)**9)**9*N",
    ],
)
def test_a_garbled_unit_is_a_message_not_a_traceback(garbled):
    with pytest.raises(InputError, match="is not a unit of force"):
        to_si([1.0], garbled, "force")


@given(garbled=st.text(max_size=12))
def test_no_text_in_place_of_a_unit_is_our_fault(garbled):
    try:
        values = to_si([1.0], garbled, "displacement")
    except InputError:
        return
    assert values[0] > 0.0


def test_a_missing_unit_is_asked_for():
    with pytest.raises(InputError, match="force has no unit; expected one of: N, kN"):
        to_si([1.0], " ", "force")


def test_an_unknown_role_names_the_known_ones():
    with pytest.raises(
        InputError, match="'pressure' is not a role of a channel; expected one of: time, displ"
    ):
        to_si([1.0], "Pa", "pressure")


def test_every_unit_that_a_message_offers_is_one():
    for role, quantity in QUANTITIES.items():
        assert to_si(1.0, quantity.unit, role) == 1.0
        for unit in quantity.units:
            assert is_unit(unit)
            assert np.isfinite(to_si(1.0, unit, role))
    assert not is_unit("CHANNEL1")


@pytest.mark.system
@pytest.mark.parametrize(
    "asked",
    [
        "to_si([1.0], 'N', 'force') == to_si([1.0], 'Sec', 'time') == 1.0",
        "not is_unit('mm', ['current'])",  # as a duty such as sine:15mm:1Hz:2A asks of each of its parts
    ],
)
def test_si_and_a_unit_of_another_role_need_no_unit_library(asked):
    """Most files are SI already: reading them must not wait for Pint's registry."""
    code = f"import sys; from mrdamper.quantities import *; assert {asked}; sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("role", QUANTITIES)
@pytest.mark.parametrize("of", QUANTITIES)
def test_a_unit_belongs_to_one_role(role, of):
    for unit in (QUANTITIES[of].unit, *QUANTITIES[of].units):
        assert is_unit(unit, [role]) == (role == of)


def test_a_read_only_array_is_nobody_elses():
    given_array = np.arange(4.0)
    kept = read_only(given_array)
    given_array[0] = 99.0
    assert kept[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 1.0
    assert read_only(kept) is kept
    assert read_only(np.arange(6)[::2]).flags.c_contiguous
