"""Times of day and dates in many spellings are converted to seconds from the first time."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.formats.timestamps import seconds_of
from mrdamper.data.tables import read_table
from tests.data.rig_files import RUN, read_run

START = datetime(2026, 2, 28, 23, 59, 59)
SPELLINGS = (
    "%Y-%m-%dT%H:%M:%S.%f",
    "%Y-%m-%d %H:%M:%S,%fZ",
    "%Y/%m/%d %H:%M:%S.%f +01:00",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %I:%M:%S.%f %p",
    "%H:%M:%S.%f",
)
"""A run over midnight at the end of a month, as six programs write it."""


def spelled(seconds, form, start=START):
    return [(start + timedelta(seconds=float(each))).strftime(form) for each in seconds]


def seconds(*cells):
    return seconds_of(list(cells))[0]


@given(st.lists(st.integers(0, 40_000_000), min_size=1, max_size=30), st.integers(0, 86_399))
def test_timestamps_keep_microseconds(steps_us, start):
    time = np.concatenate([[0.0], np.cumsum(steps_us) * 1e-6])
    for form in SPELLINGS:
        assert np.allclose(
            seconds(*spelled(time, form, datetime(2024, 2, 28) + timedelta(seconds=start))), time, atol=1.1e-6
        )


@given(st.lists(st.integers(-12, 14), min_size=2, max_size=20), st.sampled_from(["%z", " %z", " UTC%z"]))
def test_time_zone_offset_is_subtracted(hours, form):
    """Local times of several zones, such as before and after the end of summer time, can be in one record."""
    time = np.arange(len(hours)) * 0.5
    cells = [
        (START.replace(tzinfo=UTC) + timedelta(seconds=float(t))).astimezone(timezone(timedelta(hours=h)))
        for t, h in zip(time, hours, strict=True)
    ]
    stamps: list[str | None] = [each.strftime(f"%Y-%m-%dT%H:%M:%S.%f{form}") for each in cells]
    assert np.allclose(seconds(*stamps), time, atol=1e-6)


@pytest.mark.parametrize(
    "cell", ["", "12", "10:15", "25:00:00", "10:61:00", "10:15:02 o'clock", "2026-02-30 1:00:00"]
)
def test_invalid_timestamp_becomes_nan(cell):
    assert np.isnan(seconds(cell)).all()


def test_ambiguous_date_that_changes_is_invalid():
    same = seconds("11/12/2026 10:00:00", "11/12/2026 10:00:01")
    assert np.array_equal(same, [0.0, 1.0])
    assert np.isnan(seconds("11/12/2026 23:59:59", "12/12/2026 00:00:00")).tolist() == [False, True]


def test_12_hour_clock_distinguishes_noon_from_midnight():
    assert np.array_equal(seconds("12:00:00 AM", "12:00:00 PM", "1:00:00 pm"), [0.0, 43200.0, 46800.0])


def a_file(path, form="%Y-%m-%dT%H:%M:%S.%f", header="Timestamp"):
    stamps = spelled(RUN.time - RUN.time[0], form)
    rows = zip(stamps, RUN.displacement * 1e3, RUN.force, RUN.command, strict=True)
    lines = [f"{at};{x:.9f};{force:.9f};{current}" for at, x, force, current in rows]
    path.write_text("\n".join([f"{header};displacement_mm;force_N;current_A", *lines, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize("header", ["Timestamp", "Time", "Time [hh:mm:ss]", "Date and time"])
def test_timestamp_column_gives_run_time(tmp_path, header):
    (run,) = read_run(a_file(tmp_path / "run.csv", header=header))
    assert np.allclose(run.time, RUN.time - RUN.time[0], atol=2e-6)
    assert np.allclose(run.force, RUN.force, atol=1e-6)


def test_sample_rate_in_map_overrides_timestamps(tmp_path):
    """Many programs write time stamps in whole seconds although they sample every few milliseconds."""
    file = a_file(tmp_path / "run.csv", "%H:%M:%S")
    (tmp_path / "map.toml").write_text("[constant]\nrate_Hz = 200\n", encoding="utf-8")
    (run,) = read_run(file, tmp_path / "map.toml")
    assert np.allclose(run.time, np.arange(len(RUN)) / 200.0)


@pytest.mark.system
@pytest.mark.parametrize("kind", ["moments", "times of day", "durations", "texts"])
def test_workbook_timestamps_become_seconds(tmp_path, kind):
    from openpyxl import Workbook

    book, start = Workbook(), datetime(2026, 11, 21, 10, 0, 0)
    sheet = book.active
    sheet.append(["Logged", "displacement_mm", "force_N", "current_A"])
    for k in range(40):
        moment = start + timedelta(seconds=0.25 * k)
        spelled_so = {
            "moments": moment,
            "times of day": moment.time(),
            "durations": timedelta(seconds=0.25 * k),
            "texts": f"{moment:%H:%M:%S.%f}",
        }[kind]
        sheet.append([spelled_so, np.sin(0.3 * k), 100.0 * np.cos(0.3 * k), 1.0])
    book.save(tmp_path / "run.xlsx")
    table = read_table(tmp_path / "run.xlsx")
    assert {*table.stamps} == {"Logged"}
    # Workbooks store times with a resolution of 1 ms.
    assert np.allclose(table.columns["Logged"], 0.25 * np.arange(40), atol=1.1e-3)
    (run,) = read_run(tmp_path / "run.xlsx")
    assert run.time[-1] == pytest.approx(9.75, abs=2e-3)
