"""Previews that web pages show before a job starts: columns of files, plotted runs, quick heating curves."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.errors import InputError
from mrdamper.files import parse_toml
from mrdamper.jobs.channel_map import channels_toml, write_map
from mrdamper.jobs.inputs import read_files
from mrdamper.jobs.options import HeatOptions
from mrdamper.jobs.previews.card import card_line
from mrdamper.jobs.previews.compare import compare_rows
from mrdamper.jobs.previews.heat import QuickHeat, damper_facts, draw_damper
from mrdamper.jobs.previews.runs import findings_in, look
from mrdamper.jobs.previews.series import keep_model, keep_runs, keep_window, read_series
from mrdamper.jobs.thermal.heat import heat
from mrdamper.models.card_schema import read_card
from mrdamper.models.simulate import simulate as forces_of
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from tests.data.rig_files import RUN, titled, write_csv
from tests.support.campaigns import make_run
from tests.support.cards import write_card_of, write_heated_card


@pytest.fixture
def file(tmp_path):
    write_csv(tmp_path / "run.csv")
    return tmp_path / "run.csv"


@pytest.fixture
def bare(tmp_path):
    """Return a data file whose column names have no meaning."""
    write_csv(tmp_path / "bare.csv")
    text = (tmp_path / "bare.csv").read_text().split("\n", 1)[1]
    (tmp_path / "bare.csv").write_text(f"a,b,c,d\n{text}")
    return tmp_path / "bare.csv"


# ------------------------------------------------------------------------------------------ previews of files


def test_file_preview_shows_columns_and_findings(file):
    answer = look(file)
    assert (answer["error"], answer["rows"], answer["checked"], answer["map"]) == (None, len(RUN), True, None)
    assert [column["role"] for column in answer["columns"]] == ["time", "displacement", "force", "current"]
    for column, (name, values) in zip(answer["columns"], titled().items(), strict=True):
        assert column["name"] == name
        assert column["first"] == values[:12].tolist()
        assert (column["least"], column["most"]) == (values.min(), values.max())
    (row,) = answer["runs"]
    stroke = 1e3 * float(np.ptp(RUN.displacement))
    assert row["stroke_mm"] == pytest.approx(stroke)
    assert (row["usable"], row["command"], row["current_A"]) == (True, 0.5, 0.5)
    assert row["rate_Hz"] == pytest.approx(200.0)
    assert row["force_range_N"] == pytest.approx([RUN.force.min(), RUN.force.max()])
    assert answer["findings"] == findings_in(file)["findings"][0]


def test_card_list_shows_card_or_error(tmp_path):
    card = read_card(write_card_of(tmp_path / "card.json"))
    line = card_line(tmp_path / "card.json")
    assert (line["title"], line["law"], line["error"]) == (card.title, card.damper.law.name, None)
    low, high = card.envelope.displacement
    assert line["envelope"]["displacement_mm"] == [1e3 * low, 1e3 * high]  # type: ignore[index]
    document = json.loads((tmp_path / "card.json").read_text())
    for broken in ("{", "[]", json.dumps(document | {"envelope": {"command": ["a", 1]}})):
        (tmp_path / "card.json").write_text(broken)
        assert str(card_line(tmp_path / "card.json")["error"]).startswith("not a readable card")


# -------------------------------------------------------------------------------------- runs stored for plots


def test_stored_run_is_rounded_to_single_precision(file, tmp_path):
    answer = keep_runs(file, tmp_path / "kept")
    assert [row["name"] for row in answer["runs"]] == ["run"]
    header, columns = read_series(tmp_path / "kept/0.series")
    assert (header["samples"], header["n"], header["t0_s"]) == (len(RUN), len(RUN), 0.0)
    assert header["step_s"] == pytest.approx(0.005)
    expected = {
        "time_s": RUN.time, "displacement_mm": 1e3 * RUN.displacement,
        "velocity_mm_s": 1e3 * prepare_run(RUN).trajectory.velocity,
        "force_N": RUN.force, "command_A": RUN.command,
    }  # fmt: skip
    assert list(columns) == list(expected)
    for name, values in expected.items():
        assert np.allclose(columns[name], values.astype(np.float32), rtol=1e-6, atol=1e-5), name


def test_reduced_samples_keep_extremes_of_intervals(tmp_path):
    run = make_run(duration=20.0, rate_Hz=500.0)
    force = run.force.copy()
    force[4321] = 9e4  # A spike of a single sample
    lines = [f"{t!r},{1e3 * x!r},{f!r},0.5" for t, x, f in zip(*(
        each.tolist() for each in (run.time, run.displacement, force)), strict=True)]  # fmt: skip
    (tmp_path / "run.csv").write_text("time_s,displacement_mm,force_N,current_A\n" + "\n".join(lines) + "\n")
    keep_runs(tmp_path / "run.csv", tmp_path)
    whole = read_series(tmp_path / "0.series")[1]
    keep_window(tmp_path / "0.series", tmp_path / "few", most=200)
    header, few = read_series(tmp_path / "few")
    assert header["n"] == len(few["time_s"]) <= 200
    assert np.all(np.diff(few["time_s"]) > 0)
    for name in ("force_N", "displacement_mm"):
        assert (few[name].min(), few[name].max()) == (whole[name].min(), whole[name].max())
    assert (few["time_s"][0], few["time_s"][-1]) == (whole["time_s"][0], whole["time_s"][-1])
    assert set(few["time_s"].tolist()) <= set(whole["time_s"].tolist())
    keep_window(tmp_path / "0.series", tmp_path / "part", from_s=2.0, to_s=3.0)
    part = read_series(tmp_path / "part")[1]
    inside = (whole["time_s"] >= 2.0) & (whole["time_s"] <= 3.0)
    assert np.array_equal(part["force_N"], whole["force_N"][inside])
    keep_window(tmp_path / "0.series", tmp_path / "like", most=10, samples_of=tmp_path / "0.series")
    # A limit below 64 samples is raised to 64.
    assert 10 < len(read_series(tmp_path / "like")[1]["time_s"]) <= 64
    with pytest.raises(InputError, match=r"no sample from 30 to None s.*a part of 0 to 20 s"):
        keep_window(tmp_path / "0.series", tmp_path / "none", from_s=30)


def test_model_force_of_stored_run_is_simulated(file, tmp_path):
    card = write_card_of(tmp_path / "card.json")
    warm = replace(RUN, temperature=np.full(len(RUN), 310.0))
    table = np.column_stack([warm.time, 1e3 * warm.displacement, warm.force, warm.command])
    lines = [",".join(map(repr, row)) for row in table.tolist()]
    head = "time_s,displacement_mm,force_N,current_A,temperature_degC\n"
    file.write_text(head + "\n".join(f"{line},36.85" for line in lines) + "\n")
    keep_model(card, file, 0, tmp_path / "model", "mine")
    header, columns = read_series(tmp_path / "model")
    model = read_card(card)
    prepared = prepare_run(warm, Preparation.from_dict(model.preparation))
    force = forces_of(model.damper.on_limits(), prepared.trajectory)
    assert np.allclose(columns["force_N"], force, rtol=1e-4, atol=0.1)
    assert np.allclose(columns["measured_N"], RUN.force, rtol=1e-6)
    rmse = float(np.sqrt(np.mean((force - prepared.force)[prepared.scored_from :] ** 2)))
    assert (header["card"], header["rmse_N"]) == ("mine", pytest.approx(rmse, rel=1e-3))
    with pytest.raises(InputError, match=r"run\.csv.*holds 1 runs.*number 0 to 0"):
        keep_model(card, file, 1, tmp_path / "model", "mine")


# ----------------------------------------------------------------------------------- channel maps


def written(folder, *headers):
    """Write a file for each header and return the channel map that fits these files."""
    for k, header in enumerate(headers):
        write_csv(folder / f"{k}.csv")
        body = (folder / f"{k}.csv").read_text().split("\n", 1)[1]
        (folder / f"{k}.csv").write_text(f"{header}\n{body}")
    return write_map(read_files([folder]))


def test_written_channel_map_contains_entries_common_to_files(tmp_path):
    same = "time_s,displacement_mm,force_kN,current_A"
    found = written(tmp_path, same, "time_s,stroke_mm,force_kN,current_A")
    assert set(found.document["channel"]) == {"time", "force", "current"}
    (comment,) = found.comments
    assert comment == "displacement: 'displacement_mm', 'stroke_mm', as the header of each file says"
    assert found.document["channel"]["force"] == {"name": "force_kN", "unit": "kN"}
    assert parse_toml(found.text) == found.document
    assert f"# {comment}" in found.text


def test_written_channel_map_can_be_read(tmp_path):
    odd = {"segments": {"split": 'a "b"\t\x7f', "current_A": [0.5, 1.0]}, "channel": {"force": {
        "name": "Kraft [N] = 1", "unit": "N", "sign": -1}}}  # fmt: skip
    text = channels_toml(odd, ["two\nlines"])
    assert parse_toml(text) == odd
    assert "# two lines" in text
    with pytest.raises(InputError, match="channel map"):
        channels_toml({"nothing": {}})


# ------------------------------------------------------------------------------------------- heating


def test_heating_preview_agrees_with_heat_command(tmp_path):
    """The page updates this preview while a user changes values."""
    card = write_card_of(tmp_path / "card.json")
    quick = QuickHeat()
    fast = quick.curve(card, "paper", amplitude_mm=10.0, command=1.0, duration_s=600.0)
    whole = heat(read_card(card), read_drawing("paper"), read_duty("sine:10mm:1Hz:1A:600s"), HeatOptions())
    assert fast["power_W"]["mechanical"] == pytest.approx(whole.rise.mechanical_W[0], rel=1e-6)
    assert fast["curve"]["fluid_degC"][-1] == pytest.approx(float(whole.rise.fluid_degC[-1]), abs=0.2)
    half = quick.curve(card, "paper", amplitude_mm=10.0, command=1.0, duration_s=600.0, duty_share=0.5)
    assert half["power_W"]["mechanical"] == pytest.approx(0.5 * fast["power_W"]["mechanical"])
    assert max(half["curve"]["hottest_degC"]) < max(fast["curve"]["hottest_degC"])


def test_heating_preview_marks_assumptions_and_extrapolation(tmp_path):
    card = write_heated_card(tmp_path, "assumed.json", assumed=True)
    found = QuickHeat().curve(card, "paper", amplitude_mm=300.0, duration_s=60.0)
    (mark,) = (tile["mark"] for tile in found["tiles"] if tile["label"] == "force lost by heating")
    assert "assumed" in mark
    assert "extrapolated" in mark


def test_copies_and_unusual_runs_are_marked(file):
    (row,) = look(file)["runs"]
    low, high = row["force_range_N"]
    others = [{**row, "name": f"run{k}", "force_range_N": [low - k, high + k]} for k in range(4)]
    strong = {**row, "name": "strong", "force_range_N": [3.0 * low, 3.0 * high]}
    volts = {**row, "name": "volts", "command_unit": "V"}
    rows = compare_rows([*others, {**others[1], "name": "copy"}, strong, volts])
    assert {one["name"]: one["copy_of"] for one in rows if one["copy_of"]} == {"copy": "run1"}
    reasons = {one["name"]: one["foreign"] for one in rows if one["foreign"]}
    assert set(reasons) == {"strong", "volts"}
    assert reasons["volts"] == "commanded in V, most runs are in A"


def test_edited_geometry_is_written_or_rejected():
    """A geometry with an unknown key is rejected."""
    facts = damper_facts("paper", "paper")
    drawn = draw_damper("paper", "mine", facts["tables"])
    assert parse_toml(drawn["text"]) == facts["tables"]
    fins = {"fins": 12, "width_mm": 30.0, "thickness_mm": 2.0, "pitch_mm": 8.0}
    finned = parse_toml(draw_damper("paper", "mine", fins=fins)["text"])["sink"]
    assert finned["fins"] == 12
    with pytest.raises(InputError, match="mine"):
        draw_damper("paper", "mine", facts["tables"] | {"nothing": {"a": 1}})
