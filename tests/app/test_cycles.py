"""``mrdamper cycles``: table, page and summary of a record, and what an interrupt leaves of them."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from mrdamper.app.cli import cli
from mrdamper.app.cycles_job import cycles
from tests.data.test_cycle_stream import ENERGY_J, sine


def write(place: Path, samples: int = 20_001) -> Path:
    time, x, force = sine(samples)
    frame = {"time_s": time, "displacement_mm": 1e3 * x, "force_N": force, "current_A": np.full(samples, 1.5)}
    pl.DataFrame(frame).write_parquet(place, row_group_size=3_000)
    return place


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


def test_the_table_does_not_depend_on_the_batches(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")
    for rows in (500, 20_001):
        cycles(record, batch_rows=rows, out=tmp_path / str(rows))
    tables = [(tmp_path / str(rows) / "cycles.csv").read_bytes() for rows in (500, 20_001)]
    assert tables[0] == tables[1]


def test_an_interrupt_keeps_what_was_counted(tmp_path: Path) -> None:
    record = write(tmp_path / "record.parquet")

    def stop(rows: int, _of: int | None, _cycles: int) -> None:
        if rows == 6_000:
            signal.raise_signal(signal.SIGINT)

    answer = cycles(record, batch_rows=2_000, out=tmp_path / "out", report=stop)
    assert answer["cancelled"]
    assert answer["rows"] == 6_000
    assert answer["cycles"] == 30 - 1  # lower turning points at 150, 350, ... 5950
    assert len(pl.read_csv(tmp_path / "out" / "cycles.csv")) == answer["cycles"]
    assert "Interrupted" in (tmp_path / "out" / "cycles.html").read_text()
