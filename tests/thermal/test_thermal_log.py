"""A logger's record: which columns are which, what is no reading, and what a record must have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from mrdamper.errors import InputError
from mrdamper.thermal.estimation.thermal_log import ThermalLog, read_thermal_log

TIME = np.arange(10.0)


def written(folder: Path, **columns: ArrayLike) -> Path:
    path = folder / "log.csv"
    rows = [",".join(str(np.broadcast_to(each, 10)[k]) for each in columns.values()) for k in range(10)]
    path.write_text("\n".join([",".join(columns), *rows]), encoding="utf-8")
    return path


def test_columns_come_in_si_by_their_names(tmp_path: Path):
    path = written(
        tmp_path, time_ms=1e3 * TIME, current_mA=2e3, power_W=70.0, voltage_V=9.0, resistance_ohm=4.5,
        body_left_degC=26.85, remark_mm=1.0, displacement_mm=3.0,
    )  # fmt: skip
    log = read_thermal_log(path)
    assert log.time == pytest.approx(TIME)
    assert log.power is not None
    assert log.voltage is not None
    assert log.resistance is not None
    assert log.body is not None
    assert [
        each[4] for each in (log.current, log.power, log.voltage, log.resistance, log.body)
    ] == pytest.approx([2.0, 70.0, 9.0, 4.5, 300.0])
    assert (log.name, log.notes) == ("log.csv", ())
    assert not log.time.flags.writeable
    wall = read_thermal_log(written(tmp_path, time_s=TIME, current_A=1.0, wall_K=310.0)).body
    assert wall is not None
    assert wall[0] == 310.0


@pytest.mark.parametrize(("bad", "kept"), [(1, True), (2, True), (3, False)])
def test_a_fifth_of_the_body_s_readings_may_be_none(tmp_path: Path, bad: int, kept: bool):
    """A reading that was not taken is none of them."""
    body = np.full(10, 300.0)
    body[:bad], body[9] = 5.0, np.nan
    path = written(tmp_path, time_s=TIME, current_A=1.0, body_K=body)
    if kept:
        log = read_thermal_log(path)
        assert log.body is not None
        assert np.isnan(log.body).tolist() == [*[True] * bad, *[False] * (9 - bad), True]
        assert log.notes == (f"{bad} of 10 readings of the body are no plausible temperature: left out",)
    else:
        with pytest.raises(InputError, match=r"3 of 10 readings of the body .*; expected 223 to 453 K"):
            read_thermal_log(path)


@pytest.mark.parametrize("kelvin", [223.0, 453.0])
def test_the_ends_of_what_is_plausible_are(tmp_path: Path, kelvin: float):
    log = read_thermal_log(written(tmp_path, time_s=TIME, current_A=1.0, body_K=kelvin))
    assert log.body is not None
    assert np.isfinite(log.body).all()


def test_a_table_without_time_or_current_says_what_it_has(tmp_path: Path):
    path = written(tmp_path, clock_mm=TIME, body_K=300.0)
    with pytest.raises(InputError, match="has columns clock_mm, body_K; expected time_s and current_A among"):
        read_thermal_log(path)
    with pytest.raises(InputError, match="expected current_A among them"):
        read_thermal_log(written(tmp_path, time_s=TIME, body_K=300.0))


def test_two_rows_with_a_reading_are_a_record():
    two = np.array([0.0, 1.0])
    for name in ("voltage", "resistance", "body"):
        readings = dict.fromkeys(("voltage", "resistance", "body")) | {name: two}
        assert len(ThermalLog(two, two, None, *readings.values()).time) == 2
    for time, said in (
        (two[:1], "time does not rise"),
        (two[::-1], "time does not rise"),
        (0.0 * two, "rise"),
    ):
        with pytest.raises(InputError, match=said):
            ThermalLog(time, time, body=time)
    with pytest.raises(InputError, match="it has no reading of a temperature"):
        ThermalLog(two, two, power=two)
    with pytest.raises(InputError, match=r"power has shape \(3,\), time \(2,\); expected the same"):
        ThermalLog(two, two, power=np.zeros(3), body=two)
    with pytest.raises(InputError, match="time does not rise"):
        ThermalLog(np.zeros((2, 2)), np.zeros((2, 2)), body=np.zeros((2, 2)))
