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

from mrdamper.arrays import FloatArray
from mrdamper.cli import cli
from mrdamper.data.prepare import prepare_run
from mrdamper.data.readers import read_run
from mrdamper.errors import InputError
from mrdamper.jobs.options import CyclesOptions
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.models.simulate import simulate
from mrdamper.registry import JOBS
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import Json
from tests.data.test_cycles import ENERGY_J, sine
from tests.identify.test_replay import WARM
from tests.identify.test_replay import record as replayed_record
from tests.support.tracked import write_a_card


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
def test_a_load_cell_that_counts_the_other_way_is_turned(tmp_path: Path, card: Path) -> None:
    """The table of a record whose force has the other sign is the same, the model's columns too."""
    force = replayed_record(3_000).force
    right = write_warm(tmp_path / "right.parquet")
    wrong = write_warm(tmp_path / "wrong.parquet", force_N=-force)
    cycles(right, model=card, out=tmp_path / "a")
    answer = cycles(wrong, model=card, out=tmp_path / "b", flip_force=True)
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


def write_warm(place: Path, samples: int = 3_000, **columns: FloatArray) -> Path:
    """Write a record of a damper that warms up, its displacement and temperature with noise."""
    batch = replayed_record(samples)
    frame = {
        "time_s": batch.time,
        "displacement_mm": 1e3 * batch.displacement,
        "force_N": batch.force,
        "current_A": np.where(batch.time % 4.0 < 2.0, 1.0, 0.2),
        "temperature_K": batch.temperature,
    }
    pl.DataFrame({**frame, **columns}).write_parquet(place, row_group_size=1_000)
    return place


@pytest.fixture
def card(tmp_path: Path) -> Path:
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.1, 0.1), (285.0, 295.0))
    return write_a_card(tmp_path / "card.json", WARM, envelope=envelope)


@pytest.mark.system
def test_the_model_of_a_card_is_that_of_predict_over_the_same_samples(tmp_path: Path, card: Path) -> None:
    record = write_warm(tmp_path / "record.parquet")
    found = cycles(record, model=card, out=tmp_path / "out")["model"]
    assert isinstance(found, dict)
    (run,) = read_run(record)
    force = simulate(WARM, prepare_run(run).trajectory)
    table = pl.read_csv(tmp_path / "out" / "cycles.csv")
    worst = []
    for row in table.iter_rows(named=True):
        k = slice(row["row"], row["row"] + row["samples"])
        closed = slice(k.start, k.stop + 1)
        error = force[k] - run.force[k]
        assert row["error_N"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-9)
        assert row["mean_error_N"] == pytest.approx(np.mean(error), rel=1e-9, abs=1e-9)
        assert row["error_percent"] == pytest.approx(100 * row["error_N"] / np.std(run.force[k]), rel=1e-9)
        assert row["model_highest_force_N"] == force[closed].max()
        assert row["model_lowest_force_N"] == force[closed].min()
        worst.append(error)
    every = np.concatenate(worst)
    measured = run.force[table["row"][0] : table["row"][0] + len(every)]
    assert found["cycles"] == len(table) > 10
    assert found["rmse_N"] == pytest.approx(np.sqrt(np.mean(every**2)), rel=1e-9)
    assert found["nrmse_percent"] == pytest.approx(100 * found["rmse_N"] / np.std(measured), rel=1e-9)
    assert found["percent_of_peak"] == pytest.approx(
        100 * found["rmse_N"] / np.abs(table["highest_force_N", "lowest_force_N"].to_numpy()).max(), rel=1e-9
    )
    parts = found["by_temperature"]
    assert sum(part["cycles"] for part in parts) == found["cycles"]
    assert all(part["from_degC"] < part["to_degC"] for part in parts)


@pytest.mark.system
def test_the_command_tells_of_the_model_in_table_page_and_summary(tmp_path: Path, card: Path) -> None:
    record = write_warm(tmp_path / "record.parquet")
    asked = ["cycles", str(record), "--model", str(card), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(cli, asked)
    assert done.exit_code == 0, done.output
    assert "RMS error" in done.stdout
    answer = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert answer["model"]["law"] == "bouc-wen"
    (note,) = answer["model"]["notes"]
    assert note.startswith("temperature is ")
    assert "in record.parquet; the card was identified on 11.85 to 21.85 degC" in note
    assert {"model_energy_J", "error_N", "error_percent"} < set(answer["figures"])
    page = (tmp_path / "out" / "cycles.html").read_text()
    assert "The model: Strong as the rig" in page
    assert "the model's dashed" in page.replace("&#39;", "'")


@pytest.mark.system
def test_the_table_with_a_model_does_not_depend_on_the_batches(tmp_path: Path, card: Path) -> None:
    force = replayed_record(3_000).force
    force[1_700] = np.nan
    record = write_warm(tmp_path / "record.parquet", force_N=force)
    answers = [cycles(record, model=card, batch_rows=rows, out=tmp_path / str(rows)) for rows in (7, 3_000)]
    tables = [(tmp_path / str(rows) / "cycles.csv").read_bytes() for rows in (7, 3_000)]
    assert tables[0] == tables[1]
    models = [answer["model"] for answer in answers]
    assert models[0] == models[1]
    assert "the record breaks into 2 segments" in str(models[0])


@pytest.mark.system
def test_an_interrupt_keeps_the_model_of_what_was_counted(tmp_path: Path, card: Path) -> None:
    record = write_warm(tmp_path / "record.parquet")

    def stop(update: ProgressUpdate) -> None:
        if update.done == 2_000:
            signal.raise_signal(signal.SIGINT)

    answer = cycles(record, model=card, batch_rows=500, out=tmp_path / "out", on_progress=stop)
    assert answer["cancelled"]
    assert answer["rows"] == 2_000
    assert isinstance(answer["model"], dict)
    assert answer["model"]["cycles"] == answer["cycles"]
    assert len(pl.read_csv(tmp_path / "out" / "cycles.csv")) == answer["cycles"] == 51


@pytest.mark.system
def test_an_interrupt_before_the_model_could_begin_is_no_fault(tmp_path: Path, card: Path) -> None:
    record = write_warm(tmp_path / "record.parquet")

    asked: list[int] = []

    def stop(update: ProgressUpdate) -> None:
        if not asked:  # a second time, it would be the end
            asked.append(update.done)
            signal.raise_signal(signal.SIGINT)

    answer = cycles(record, model=card, batch_rows=40, on_progress=stop)
    assert answer["cancelled"]
    assert answer["rows"] == 40
    assert isinstance(answer["model"], dict)
    assert answer["model"]["cycles"] == 0


@pytest.mark.system
def test_a_card_of_another_command_is_refused_before_anything_is_read(tmp_path: Path, card: Path) -> None:
    record = write_warm(tmp_path / "record.parquet")
    volts = tmp_path / "volts.parquet"
    pl.read_parquet(record).rename({"current_A": "voltage_V"}).write_parquet(volts)
    with pytest.raises(InputError, match="the command is in V, the model's in A"):
        cycles(volts, model=card, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.system
def test_without_a_model_nothing_is_said_of_one(tmp_path: Path) -> None:
    answer = cycles(write(tmp_path / "record.parquet", 4_001), out=tmp_path / "out")
    assert answer["model"] is None
    assert "model" not in (tmp_path / "out" / "cycles.csv").read_text()
    assert "The model" not in (tmp_path / "out" / "cycles.html").read_text()


LIMITED = """
import resource, sys
import mrdamper
resource.setrlimit(resource.RLIMIT_DATA, (1_500_000_000, 1_500_000_000))
found = mrdamper.cycles(sys.argv[1], sys.argv[2])
print(found.cycles, found.model.errors.cycles)
"""


@pytest.mark.nightly
def test_a_record_of_2e7_rows_takes_no_more_memory_than_it_may(tmp_path: Path, card: Path) -> None:
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
        [sys.executable, "-c", LIMITED, str(record), str(card)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["99999", "99999"]
