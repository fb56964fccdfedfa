"""Rheometer tables are read with the headers of laboratories; missing columns give a message."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.data.rheometer import read_rheometer
from mrdamper.errors import InputError


@pytest.fixture
def table(tmp_path):
    """Return a function that writes a table to a file and reads it."""

    def read(text):
        path = tmp_path / "table.csv"
        path.write_text(text, encoding="utf-8")
        return read_rheometer(path)

    return read


@pytest.mark.parametrize(
    ("header", "temperature", "viscosity"),
    [
        ("temperature_degC,viscosity_mPas", "20,40", "150,110"),
        ("temperature_K,viscosity_Pas", "293.15,313.15", "0.15,0.11"),
        ("Temperature (°C),Viscosity [mPa·s]", "20,40", "150,110"),
        ("T_degC,eta_Pa_s", "20,40", "0.15,0.11"),
        ("temp / °C,dynamic viscosity / Pa s", "20,40", "0.15,0.11"),
        ("Temperature [degF],viscosity_cP", "68,104", "150,110"),
    ],
)
def test_rheometer_header_variants_give_same_table(table, header, temperature, viscosity):
    rows = zip(temperature.split(","), viscosity.split(","), strict=True)
    found = table(f"{header}\n" + "\n".join(",".join(row) for row in rows) + "\n")
    np.testing.assert_allclose(found.viscosity[0], [293.15, 313.15])
    np.testing.assert_allclose(found.viscosity[1], [0.15, 0.11])
    assert found.yield_stress is None


@pytest.mark.parametrize(
    "header",
    [
        "Temperature,Viscosity\n°C,Pa·s",
        "Temperature,Viscosity\n[°C],[Pa s]",
        "°C,Pa s\nTemperature,Viscosity",
        "[step]\nRamp - 1\nTemperature,Shear rate,Viscosity\n°C,1/s,Pa.s",
        "Interval data:,Temperature,Shear Rate,Viscosity\n,[°C],[1/s],[Pa·s]\n,,,",
    ],
)
def test_rheometer_units_in_separate_row_are_read(table, header):
    """Exports of rheometers have units below or above the names, and empty cells before the numbers."""
    first, *names = header.split("\n")[-2 if header.endswith(",,,") else -1].split(",")
    middle = "100," if len(names) > 1 else ""
    begin = "," if not first else ""
    rows = [f"{begin}{warm},{middle}{eta}" for warm, eta in ((20, 0.15), (40, 0.11), (60, 0.09))]
    found = table("\n".join([header, *rows, ""]))
    np.testing.assert_allclose(found.viscosity[0], [293.15, 313.15, 333.15])
    np.testing.assert_allclose(found.viscosity[1], [0.15, 0.11, 0.09])


@pytest.mark.parametrize(
    ("header", "raw", "unit", "field"),
    [
        ("field_mT", 400.0, "T", 0.4),
        ("field_T", 0.4, "T", 0.4),
        ("B [mT]", 400.0, "T", 0.4),
        ("flux_density_mT", 400.0, "T", 0.4),
        ("field_kA_m", 67.0, "A/m", 67e3),
        ("H (kA/m)", 67.0, "A/m", 67e3),
        ("field strength / kA m^-1", 67.0, "A/m", 67e3),
    ],
)
def test_magnetic_field_is_read_in_si(table, header, raw, unit, field):
    text = f"{header},temperature_degC,yield_stress_kPa\n{raw},20,19\n{raw},60,18\n"
    found = table(text)
    assert found.field_unit == unit
    np.testing.assert_allclose(found.yield_stress[0], [field, field])
    np.testing.assert_allclose(found.yield_stress[1], [293.15, 333.15])
    np.testing.assert_allclose(found.yield_stress[2], [19e3, 18e3])
    assert found.viscosity is None


def test_rheometer_table_may_contain_viscosity_and_yield_stress(table):
    found = table(
        "temperature_degC,viscosity_Pas,field_mT,yield_stress_kPa\n20,0.15,,\n40,0.11,,\n20,,100,4\n40,,100,3.9\n"
    )
    np.testing.assert_allclose(found.viscosity[1], [0.15, 0.11])
    np.testing.assert_allclose(found.yield_stress[2], [4e3, 3.9e3])
    assert found.notes == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n3,4\n", "neither viscosity nor yield stress among 'a', 'b'; expected a header such as"),
        (
            "temperature_degC,yield_stress_kPa\n20,2\n40,4\n",
            "yield stress but no field among .*; expected a header such as field_mT, field_T or field_kA_m",
        ),
        ("temperature_degC,viscosity\n20,2\n40,4\n", "'viscosity' has no unit; expected a header such as"),
        (
            "temperature_K,viscosity_Pas\n20,2\n40,1\n",
            "'temperature_K' holds 20 K .*Check the unit",
        ),
    ],
)
def test_incomplete_rheometer_table_is_rejected(table, text, said):
    with pytest.raises(InputError, match=f"^table.csv: {said}"):
        table(text)
