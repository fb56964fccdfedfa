"""Temperature logs with clock times supply the temperature of runs that state when they began."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.readers import ReadFiles, read_each, read_runs
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.data.test_laboratories import RUNS, assert_read
from tests.data.test_unseen_layouts import FULL, columns, table, write

FIRST = datetime(2024, 3, 14, 9, 12, 44, 250000)
STARTS = tuple(FIRST + timedelta(minutes=5 * k) for k in range(len(RUNS)))
LOG_BEGIN = datetime(2024, 3, 14, 9, 0, 0)
CET = timezone(timedelta(hours=1))
Writer = Callable[[Path], None]


def warmth(time: datetime) -> float:
    """Return the temperature [degC] in the log at a local time; it rises linearly."""
    return 25.0 + 0.01 * (time - LOG_BEGIN).total_seconds()


def logged(begin: datetime = LOG_BEGIN, minutes: float = 40.0) -> list[tuple[datetime, float]]:
    """Return the rows (time, temperature) of a log with a step of ten seconds."""
    times = [begin + timedelta(seconds=10 * k) for k in range(int(6 * minutes))]
    return [(time, warmth(time)) for time in times]


def texts(head: Callable[[datetime], str], form: str = "", name: str = "run_{}.csv") -> Writer:
    """Return a function that writes the runs with time in seconds or with time stamps of format ``form``."""

    def writer(folder: Path) -> None:
        for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
            time, *rest = columns(run)
            stamps = [(start + timedelta(seconds=t)).strftime(form) if form else f"{t:.6f}" for t in time]
            rows = table(*rest, sign=";").splitlines()
            body = "".join(f"{stamp};{row}\n" for stamp, row in zip(stamps, rows, strict=True))
            write(folder, name.format(k), head(start) + body)

    return writer


NAMES = "displacement_mm;force_N;current_A\n"
SECONDS = f"time_s;{NAMES}"


def tdms(folder: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    units = {"displacement": "mm", "force": "N", "current": "A"}
    for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
        clock = {"wf_start_time": np.datetime64(start), "wf_increment": float(run.time[1] - run.time[0])}
        values = dict(zip(units, columns(run)[1:], strict=True))
        with TdmsWriter(str(folder / f"run_{k}.tdms")) as file:
            file.write_segment(
                [ChannelObject("run", n, values[n], {**clock, "unit_string": units[n]}) for n in units]
            )


def mdf(folder: Path) -> None:
    from asammdf import MDF, Signal

    units = {"displacement": "mm", "force": "N", "current": "A"}
    for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
        with MDF(version="4.10") as file:
            file.start_time = start.replace(tzinfo=CET)
            file.append(
                [Signal(v, run.time, units[n], n) for n, v in zip(units, columns(run)[1:], strict=True)]
            )
            file.save(folder / f"run_{k}.mf4")


def hdf5(folder: Path) -> None:
    import h5py

    for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
        with h5py.File(folder / f"run_{k}.h5", "w") as file:
            file.attrs["start_time"] = start.isoformat()
            for name, values in zip(SECONDS.strip().split(";"), columns(run), strict=True):
                file[name] = values


def lvm(folder: Path) -> None:
    for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
        clock = f"Date\t{start:%Y/%m/%d}\nTime\t{start:%H:%M:%S.%f}0000\n"
        end = "***End_of_Header***\n"
        head = f"LabVIEW Measurement\nSeparator\tTab\nX_Columns\tOne\n{clock}{end}Channels\t3\n{clock}"
        head += f"Y_Unit_Label\tmm\tN\tA\nX0\t0\t0\t0\nDelta_X\t0.005\t0.005\t0.005\n{end}"
        write(
            folder,
            f"run_{k}.lvm",
            head + "X_Value\tStroke\tForce\tCurrent\n" + table(*columns(run), sign="\t"),
        )


def epoch(folder: Path) -> None:
    for k, (run, start) in enumerate(zip(RUNS, STARTS, strict=True)):
        time, *rest = columns(run)
        rows = table(time + start.replace(tzinfo=CET).timestamp(), *rest, sign=";")
        write(folder, f"run_{k}.csv", SECONDS + rows)


EXPORTED = "Exported: 3/15/2024 8:00:00 AM\n"
HEADERS = texts(lambda start: f"Start time: {start:%m/%d/%Y %I:%M:%S.%f %p}\n{EXPORTED}{SECONDS}")
RUN_WRITERS: dict[str, Writer] = {
    "stamps": texts(lambda _: f"stamp;{NAMES}", "%Y-%m-%dT%H:%M:%S.%f"),
    "date and time": texts(lambda _: f"Datum;Uhrzeit;{NAMES}", "%d.%m.%Y;%H:%M:%S.%f"),
    "header": HEADERS,
    "two lines": texts(lambda start: f"Datum: {start:%d.%m.%Y}\nUhrzeit: {start:%H:%M:%S}\n{SECONDS}"),
    "month name": texts(lambda start: f"Recorded {start:%d-%b-%Y %H:%M:%S}\n{SECONDS}"),
    "hdf5": hdf5,
    "lvm": lvm,
}
UTC_WRITERS: dict[str, Writer] = {
    "stamps in Z": texts(lambda _: f"stamp;{NAMES}", "%Y-%m-%dT%H:%M:%S.%f+01:00"),
    "mdf": mdf,
    "epoch": epoch,
}


def iso_log(folder: Path, rows: list[tuple[datetime, float]] | None = None, zone: str = "") -> None:
    lines = [f"{time.isoformat()}{zone},{value:.3f}\n" for time, value in rows or logged()]
    write(folder, "logger.csv", "Timestamp,Damper body (degC)\n" + "".join(lines))


def german_log(folder: Path) -> None:
    lines = [f"{t:%d.%m.%Y;%H:%M:%S};{f'{v:.3f}'.replace('.', ',')};21,0\n" for t, v in logged()]
    write(folder, "Logger.csv", "Datum;Uhrzeit;Öltemperatur [°C];Raum [°C]\n" + "".join(lines))


def american_log(folder: Path) -> None:
    lines = [f"{t:%m/%d/%Y},{t:%I:%M:%S %p},{1.8 * v + 32.0:.3f}\n" for t, v in logged()]
    write(folder, "log.txt", "Instrument,TC-08\nDate,Time,T1 (degF)\n" + "".join(lines))


def elapsed_log(folder: Path) -> None:
    lines = [f"{(t - LOG_BEGIN).total_seconds():.1f}\t{v:.3f}\n" for t, v in logged()]
    write(
        folder,
        "tc.dat",
        f"Start: {LOG_BEGIN:%Y-%m-%d %H:%M:%S}\nElapsed (s)\tOil temp (°C)\n" + "".join(lines),
    )


def workbook_log(folder: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    assert sheet is not None
    for row in (["Time", "Temperature [°C]"], *logged()):
        sheet.append(list(row))
    book.save(folder / "log.xlsx")


def dated_name_log(folder: Path) -> None:
    lines = [f"{t:%H:%M:%S},{v:.3f}\n" for t, v in logged()]
    write(folder, "oil_2024-03-14.csv", "Time,Oil (degC)\n" + "".join(lines))


LOG_WRITERS: tuple[Writer, ...] = (
    iso_log,
    german_log,
    american_log,
    elapsed_log,
    workbook_log,
    dated_name_log,
)


def log_finding(read: ReadFiles) -> str:
    (found,) = (each.found for each in read.findings if each.kind == "temperature_log")
    return found


def assert_warm(read: ReadFiles) -> None:
    """Check that each run has the temperature that the log states for its time."""
    assert read.fault() is None
    assert len(read.runs) == len(RUNS)
    for true, start in zip(RUNS, STARTS, strict=True):
        (run,) = (each for each in read.runs if abs(float(np.median(each.command)) - true.command[0]) < 1e-3)
        assert run.temperature is not None
        expected = warmth(start) + 0.01 * true.time
        assert np.allclose(run.temperature - ZERO_CELSIUS_K, expected, atol=0.02)
    assert "3 of 3 runs" in log_finding(read)


@pytest.mark.parametrize("log", LOG_WRITERS, ids=lambda log: log.__name__)
def test_every_log_layout_supplies_temperature(tmp_path, log):
    HEADERS(tmp_path)
    log(tmp_path)
    assert_warm(read_each(tmp_path))


@pytest.mark.parametrize("runs", RUN_WRITERS.values(), ids=RUN_WRITERS)
def test_every_run_layout_gets_log_temperature(tmp_path, runs):
    runs(tmp_path)
    german_log(tmp_path)
    assert_warm(read_each(tmp_path))


@pytest.mark.parametrize("runs", UTC_WRITERS.values(), ids=UTC_WRITERS)
def test_log_and_runs_match_across_time_zones(tmp_path, runs):
    runs(tmp_path)
    iso_log(tmp_path, [(time - timedelta(hours=1), value) for time, value in logged()], "Z")
    assert_warm(read_each(tmp_path))


def test_log_without_time_zone_is_unused(tmp_path):
    """A TDMS run starts at a time in UTC. A log in local time can be used only if its zone is known."""
    tdms(tmp_path)
    iso_log(tmp_path, logged(LOG_BEGIN - timedelta(hours=3), 400.0))
    read = read_each(tmp_path)
    assert all(run.temperature is None for run in read.runs)
    assert "local time of an unknown zone" in log_finding(read)
    iso_log(tmp_path, logged(), "Z")
    assert_warm(read_each(tmp_path))


def test_temperature_log_of_other_day_is_reported(tmp_path):
    HEADERS(tmp_path)
    iso_log(tmp_path, [(time + timedelta(days=1), value) for time, value in logged()])
    read = read_each(tmp_path)
    assert "do not cover" in log_finding(read)
    assert read.fault() is None
    assert all(run.temperature is None for run in read.runs)


def test_temperature_log_without_date_is_reported(tmp_path):
    HEADERS(tmp_path)
    write(tmp_path, "oil.csv", "Time,Oil (degC)\n" + "".join(f"{t:%H:%M:%S},{v:.3f}\n" for t, v in logged()))
    read = read_each(tmp_path)
    assert "states no date" in log_finding(read)
    assert all(run.temperature is None for run in read.runs)


def test_run_without_start_time_ignores_temperature_log(tmp_path):
    texts(lambda _: SECONDS)(tmp_path)
    iso_log(tmp_path)
    read = read_each(tmp_path)
    assert "no start time" in log_finding(read)
    assert all(run.temperature is None for run in read.runs)


@pytest.mark.parametrize(("minutes", "count"), [(13.5, 1), (18.0, 2), (12.75, 0)])
def test_short_temperature_log_supplies_covered_runs(tmp_path, minutes, count):
    HEADERS(tmp_path)
    iso_log(tmp_path, logged(minutes=minutes))
    read = read_each(tmp_path)
    assert [run.temperature is not None for run in read.runs] == [True] * count + [False] * (3 - count)
    assert (f"{count} of 3" if count else "do not cover") in log_finding(read)


def test_temperature_log_gap_is_not_interpolated(tmp_path):
    HEADERS(tmp_path)
    iso_log(tmp_path, [(t, v) for t, v in logged() if abs((t - STARTS[1]).total_seconds()) > 60.0])
    assert [run.temperature is not None for run in read_each(tmp_path).runs] == [True, False, True]


def test_run_temperature_overrides_temperature_log(tmp_path):
    texts(lambda start: f"Start: {start:%Y-%m-%d %H:%M:%S}\nOil temperature: 60 degC\n{SECONDS}")(tmp_path)
    iso_log(tmp_path)
    read = read_each(tmp_path)
    assert "state their own temperature" in log_finding(read)
    assert all(run.temperature is not None and np.allclose(run.temperature, 333.15) for run in read.runs)


def test_ambiguous_log_dates_follow_runs(tmp_path):
    """Day and month of an ambiguous date are read in the order that matches the date of the runs."""
    moved = datetime(2024, 6, 5) - datetime(2024, 3, 14)
    texts(lambda start: f"Start: {start + moved:%Y-%m-%d %H:%M:%S.%f}\n{SECONDS}")(tmp_path)
    lines = [f"{t + moved:%d/%m/%Y %H:%M:%S},{v:.3f}\n" for t, v in logged()]
    write(tmp_path, "log.csv", "Timestamp,T body (degC)\n" + "".join(lines))
    assert_warm(read_each(tmp_path))


def test_folder_with_temperature_log_is_read(tmp_path):
    for k, run in enumerate(RUNS):
        write(tmp_path, f"run_{k}.csv", FULL + table(*columns(run)))
    iso_log(tmp_path)
    assert_read(read_runs(tmp_path))
