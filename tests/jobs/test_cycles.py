"""The command ``cycles`` writes the table, the page and the summary of a record."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from mrdamper.cli import cli
from mrdamper.registry import JOBS
from mrdamper.schema import Json
from tests.data.test_cycles import ENERGY_J, sine


def write(path: Path, samples: int = 20_001, sign: float = 1.0) -> Path:
    time, x, force = sine(samples)
    columns = {"time_s": time, "displacement_mm": 1e3 * x, "force_N": sign * force}
    pl.DataFrame({**columns, "current_A": np.full(samples, 1.5)}).write_parquet(path)
    return path


def answer_of(record: Path, out: Path | None = None) -> Json:
    return JOBS["cycles"].perform({"record": record}, JOBS["cycles"].options_type(), out=out)[1]


@pytest.mark.system
def test_cycles_writes_table_page_and_summary(tmp_path: Path) -> None:
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


def test_grouped_cycles_keep_mean_of_all_cycles(tmp_path: Path) -> None:
    """The mean of all cycles stays exact if a record has more cycles than the curve has points."""
    answer = answer_of(write(tmp_path / "record.parquet", samples=500_001))
    assert (answer["cycles"], answer["group_cycles"]) == (2_499, 2)
    energy = answer["figures"]["energy_J"]
    for value in (energy["mean"], energy["min"], energy["max"], energy["first"], energy["last"]):
        assert value == pytest.approx(ENERGY_J, rel=1e-9)
    assert energy["trend_per_1000_cycles"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("sign", "samples", "kind"), [(-1.0, 2_001, "force_sign"), (1.0, 201, "no_cycles")])
def test_record_without_valid_cycles_is_reported(
    tmp_path: Path, sign: float, samples: int, kind: str
) -> None:
    answer = answer_of(write(tmp_path / "record.parquet", samples, sign), tmp_path / "out")
    assert [finding["kind"] for finding in answer["findings"]] == [kind]
