"""A record in batches is its columns, whatever the format, where it is begun and how much is asked for."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from mrdamper.arrays import FloatArray
from mrdamper.cli import cli
from mrdamper.data.batches import open_record
from mrdamper.data.channels import ChannelMap
from mrdamper.data.readers import read_run
from mrdamper.data.tables import open_rows, read_table
from mrdamper.errors import InputError
from tests.support.tracked import write_a_card

SAMPLES = 2_003
TIME: FloatArray = np.arange(SAMPLES, dtype=np.float64) * 1e-3
COLUMNS: dict[str, FloatArray] = {
    "time_s": TIME,
    "displacement_mm": 10.0 * np.sin(6.0 * TIME),
    "force_N": 900.0 * np.cos(6.0 * TIME),
    "current_A": np.full(SAMPLES, 1.5),
}


def as_parquet(path: Path) -> None:
    pl.DataFrame(COLUMNS).write_parquet(path, row_group_size=300)


def as_stamped_parquet(path: Path) -> None:
    begin = datetime.datetime(2026, 1, 1)
    stamps = [begin + datetime.timedelta(milliseconds=k) for k in range(SAMPLES)]
    columns = {"time": stamps, **{name: values for name, values in COLUMNS.items() if name != "time_s"}}
    pl.DataFrame(columns).write_parquet(path, row_group_size=300)


def as_csv(path: Path) -> None:
    pl.DataFrame(COLUMNS).write_csv(path)


def as_hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file[name] = values


def as_tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject("run", name, values) for name, values in COLUMNS.items()])


def as_mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    signals = [asammdf.Signal(v, TIME, name=name) for name, v in COLUMNS.items() if name != "time_s"]
    file.append(signals)
    file.save(path, overwrite=True)
    file.close()


FORMATS: dict[str, Callable[[Path], None]] = {
    "run.parquet": as_parquet,
    "stamped.parquet": as_stamped_parquet,
    "run.csv": as_csv,
    "run.h5": as_hdf5,
    "run.tdms": as_tdms,
    "run.mf4": as_mdf,
}


@pytest.mark.system
@pytest.mark.parametrize("name", FORMATS)
def test_rows_in_parts_are_the_columns(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    FORMATS[name](path)
    table, rows = read_table(path), open_rows(path)
    names = list(table.columns)
    whole = {column: np.asarray(table.columns[column]) for column in names}
    for start in (0, 1, SAMPLES - 4):
        for count in (97, SAMPLES):
            parts = list(rows.read(names, start, count))
            for k, column in enumerate(names):
                np.testing.assert_array_equal(np.concatenate([p[k] for p in parts]), whole[column][start:])
    record = open_record(path)
    for size in (64, 9_999):
        batches = list(record.batches(start=11, rows=size))
        assert [len(batch) for batch in batches[:-1]] == [size] * (len(batches) - 1)
        assert [batch.row for batch in batches] == list(range(11, SAMPLES, size))
        force = np.concatenate([batch.force for batch in batches])
        np.testing.assert_array_equal(force, COLUMNS["force_N"][11:])
    turned = next(replace(record, flip_force=True).batches())
    np.testing.assert_array_equal(turned.force, -COLUMNS["force_N"][: len(turned)])


@pytest.fixture
def small_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mrdamper.data.tables.memory_bytes", lambda: 16 << 30)


def write_constants(path: Path, rows: int) -> None:
    """Write rows of ones: a file of less than a megabyte, whatever it says of its rows."""
    ones = [pl.repeat(1, rows, dtype=pl.Int8).alias(name) for name in ("displacement_mm", "force_N")]
    pl.LazyFrame({"row": [0]}).select(ones).sink_parquet(path)
    Path(f"{path}.channels.toml").write_text(
        "[constant]\nrate_Hz = 1000\ncurrent_A = 1.0\n", encoding="utf-8"
    )


@pytest.mark.system
@pytest.mark.usefixtures("small_machine")
def test_a_record_of_1e8_rows_in_place_of_a_run_ends_in_one_message(tmp_path: Path) -> None:
    record = tmp_path / "weeks.parquet"
    write_constants(record, 100_000_000)
    assert record.stat().st_size < 1e6
    card = write_a_card(tmp_path / "card.json")
    commands = (
        ["fit", str(record), "--out", str(tmp_path / "out")],
        ["evaluate", str(card), str(record)],
        ["check", str(record)],
    )
    for command in commands:
        fault = CliRunner().invoke(cli, command).exception
        assert isinstance(fault, InputError)
        assert str(fault).count("\n") == 0
        assert "weeks.parquet: has 100,000,000 rows, too many for memory at once; expected at" in str(fault)
        assert "mrdamper cycles (with --model CARD" in str(fault)
    assert not (tmp_path / "out").exists()
    assert open_record(record).rows == 100_000_000  # but cycles takes it


@pytest.mark.usefixtures("small_machine")
def test_the_rows_of_a_text_are_judged_by_its_length(tmp_path: Path) -> None:
    record = tmp_path / "weeks.csv"
    with record.open("wb") as stream:
        stream.write(b"time_s,displacement_mm,force_N,current_A\n" + b"0.001,1.0,2.0,1.5\n" * 10_000)
        stream.truncate(2_000_000_000)  # nothing more is written
    with pytest.raises(InputError, match=r"has about 1\d\d,\d+,\d+ rows, too many"):
        read_table(record)


def test_columns_and_constants_are_taken_for_roles_as_those_of_a_run_are(tmp_path: Path) -> None:
    """A temperature of the file goes before a constant one; a command must not be stated twice."""
    path = tmp_path / "run.csv"
    pl.DataFrame(COLUMNS | {"temperature_degC": np.full(SAMPLES, 40.0)}).write_csv(path)
    channels = ChannelMap.from_dict({"constant": {"temperature_degC": 20.0}})
    (run,) = read_run(path, channels)
    batch = next(open_record(path, channels).batches())
    assert run.temperature is not None
    np.testing.assert_array_equal(batch.temperature, run.temperature)
    twice = ChannelMap.from_dict({"constant": {"current_A": 1.0}})
    for read in (read_run, open_record):
        with pytest.raises(InputError, match="current is a column and a constant of the channel map"):
            read(path, twice)
