"""``mrdamper cycles``: table, page and summary of a record, and what an interrupt leaves of them."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from mrdamper.cli import cli
from mrdamper.jobs.options import CyclesOptions
from mrdamper.registry import JOBS
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import Json
from tests.data.test_cycles import ENERGY_J, sine


def cycles(
    record: Path,
    *,
    batch_rows: int | None = None,
    out: Path | None = None,
    on_progress: Progress = silent,
    **given: Path | bool,
) -> Json:
    """Return the answer of the job."""
    options = CyclesOptions(batch_rows=batch_rows)
    return JOBS["cycles"].perform({"record": record, **given}, options, out=out, on_progress=on_progress)[1]


def write(place: Path, samples: int = 20_001) -> Path:
    time, x, force = sine(samples)
    frame = {"time_s": time, "displacement_mm": 1e3 * x, "force_N": force, "current_A": np.full(samples, 1.5)}
    pl.DataFrame(frame).write_parquet(place, row_group_size=3_000)
    return place


@pytest.fixture(autouse=True)
def every_interrupt_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that comes a moment after that of the test before is another."""
    monkeypatch.setattr("mrdamper.runtime.signals._ONE_S", 0.0)


@pytest.mark.system
def test_the_command_writes_table_page_and_summary(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    done = CliRunner().invoke(cli, ["cycles", str(record), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["cycles"] == 99
    assert answer["energy_J"] == pytest.approx(99 * ENERGY_J, rel=1e-9)
    assert answer == json.loads((tmp_path / "out" / "summary.json").read_text())
    table = pl.read_csv(tmp_path / "out" / "cycles.csv")
    np.testing.assert_allclose(table["energy_J"].to_numpy(), ENERGY_J, rtol=1e-9)
    assert table["cycle"].to_list() == list(range(1, 100))
    page = (tmp_path / "out" / "cycles.html").read_text()
    assert "energy per cycle" in page
    assert "<svg" in page


@pytest.mark.system
def test_the_table_does_not_depend_on_the_batches(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    for rows in (500, 20_001):
        cycles(record, batch_rows=rows, out=tmp_path / str(rows))
    tables = [(tmp_path / str(rows) / "cycles.csv").read_bytes() for rows in (500, 20_001)]
    assert tables[0] == tables[1]


@pytest.mark.system
def test_flip_force_reverses_the_load_cell(tmp_path: Path) -> None:
    """A record whose force has the other sign has the same table if the sign is reversed."""
    right, wrong = write(tmp_path / "right.parquet"), tmp_path / "wrong.parquet"
    pl.read_parquet(right).with_columns(-pl.col("force_N")).write_parquet(wrong)
    cycles(right, out=tmp_path / "a")
    answer = cycles(wrong, out=tmp_path / "b", flip_force=True)
    assert not answer["findings"]
    assert (tmp_path / "a" / "cycles.csv").read_bytes() == (tmp_path / "b" / "cycles.csv").read_bytes()


@pytest.mark.system
def test_an_interrupt_keeps_what_was_counted(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")

    def stop(update: ProgressUpdate) -> None:
        if update.done == 6_000:
            signal.raise_signal(signal.SIGINT)

    answer = cycles(record, batch_rows=2_000, out=tmp_path / "out", on_progress=stop)
    assert answer["cancelled"]
    assert answer["rows"] == 6_000
    assert answer["cycles"] == 30 - 1  # lower turning points at 150, 350, ... 5950
    assert len(pl.read_csv(tmp_path / "out" / "cycles.csv")) == answer["cycles"]
    assert "Interrupted" in (tmp_path / "out" / "cycles.html").read_text()


@pytest.mark.system
def test_a_second_interrupt_leaves_what_was_there_before_and_nothing_beside_it(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    out = tmp_path / "out"
    out.mkdir()
    (out / "cycles.csv").write_text("of an earlier run\n", encoding="utf-8")

    def stop(update: ProgressUpdate) -> None:
        if update.done == 6_000:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        cycles(record, batch_rows=2_000, out=out, on_progress=stop)
    assert [file.name for file in out.iterdir()] == ["cycles.csv"]
    assert (out / "cycles.csv").read_text(encoding="utf-8") == "of an earlier run\n"
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out", "record.parquet"]


LIMITED = """
import resource, sys
import mrdamper
resource.setrlimit(resource.RLIMIT_DATA, (1_500_000_000, 1_500_000_000))
found = mrdamper.cycles(sys.argv[1])
print(found.cycles)
"""


@pytest.mark.nightly
def test_cycles_of_large_record_fit_in_memory(tmp_path: Path) -> None:
    rows, number = 20_000_000, pl.col("number").cast(pl.Float64)
    phase = (pl.col("number") % 200).cast(pl.Float64) * (np.pi / 100)
    record = tmp_path / "record.parquet"
    pl.LazyFrame().select(number=pl.int_range(rows)).select(
        time_s=number * 2e-3,
        displacement_mm=10.0 * phase.sin(),
        force_N=900.0 * phase.cos() + 500.0 * phase.sin(),
        current_A=pl.when(pl.col("number") % 100_000 < 50_000).then(1.0).otherwise(0.5),
        temperature_degC=20.0 + number * 1e-6,
    ).sink_parquet(record)
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(record)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["99999"]
