"""What a page shows before a job: files as they were understood, runs as they are drawn, quick heating."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.channels import ChannelMap
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.files import MAP_SUFFIX, parse_toml
from mrdamper.jobs.channel_map import channels_toml, write_map
from mrdamper.jobs.inputs import read_dataset, read_files
from mrdamper.jobs.options.heating import DerateOptions, HeatOptions
from mrdamper.jobs.previews.card import card_line
from mrdamper.jobs.previews.heat import QuickHeat, damper_facts, draw_damper
from mrdamper.jobs.previews.runs import findings_in, glance, look
from mrdamper.jobs.previews.series import keep_model, keep_runs, keep_window, read_series
from mrdamper.jobs.simulate import simulate
from mrdamper.jobs.thermal.derate import derate
from mrdamper.jobs.thermal.heat import changed_drawing, heat, start_of
from mrdamper.models.card_schema import read_card
from mrdamper.models.simulate import simulate as forces_of
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from tests.data.example_runs import make_run
from tests.data.rig_files import RUN, titled, write_csv
from tests.support.tracked import write_a_card

MAP = {"channel": {role: {"index": k, "unit": unit} for k, (role, unit) in enumerate(
    (("time", "s"), ("displacement", "mm"), ("force", "kN"), ("current", "A")), 1)}}  # fmt: skip


@pytest.fixture
def file(tmp_path):
    write_csv(tmp_path / "run.csv")
    return tmp_path / "run.csv"


@pytest.fixture
def bare(tmp_path):
    """Return a file whose names say nothing."""
    write_csv(tmp_path / "bare.csv")
    text = (tmp_path / "bare.csv").read_text().split("\n", 1)[1]
    (tmp_path / "bare.csv").write_text(f"a,b,c,d\n{text}")
    return tmp_path / "bare.csv"


# ------------------------------------------------------------------------------------------- looks


def test_a_look_shows_the_columns_the_run_and_what_is_wrong_with_it(file):
    answer = look(file)
    assert (answer["error"], answer["rows"], answer["checked"], answer["map"]) == (None, len(RUN), True, None)
    assert [column["role"] for column in answer["columns"]] == ["time", "displacement", "force", "current"]
    for column, (name, values) in zip(answer["columns"], titled().items(), strict=True):
        assert column["name"] == name
        assert column["first"] == values[:12].tolist()
        assert (column["least"], column["most"]) == (values.min(), values.max())
        assert (min(column["thumbnail"]), max(column["thumbnail"])) == (values.min(), values.max())
    (row,) = answer["runs"]
    stroke = 1e3 * float(np.ptp(RUN.displacement))
    assert row["stroke_mm"] == pytest.approx(stroke)
    assert (row["usable"], row["command"], row["current_A"]) == (True, 0.5, 0.5)
    assert row["rate_Hz"] == pytest.approx(200.0)
    assert row["force_range_N"] == pytest.approx([RUN.force.min(), RUN.force.max()])
    assert answer["findings"] == findings_in(file)["findings"][0]


def test_a_file_that_no_words_explain_is_shown_with_questions_and_maps_that_read_it(bare):
    answer = look(bare)
    assert answer["runs"] == []
    assert answer["error"]
    assert answer["questions"]
    assert [column["role"] for column in answer["columns"]] == [None] * 4
    assert findings_in(bare) == {"findings": []}
    toml = channels_toml(MAP)
    for name in ("other.csv", "same.csv"):  # one map beside two files
        bare.with_name(name + MAP_SUFFIX).write_text(toml)
    bare.with_name("broken" + MAP_SUFFIX).write_text("[")
    (offer,) = (each for each in look(bare)["offers"] if each["map"] == MAP)
    assert offer["runs"] == 1
    assert look(bare, offer["map"])["runs"][0]["command"] == 0.5
    bare.with_name(bare.name + MAP_SUFFIX).write_text(toml)
    assert look(bare)["map"] == MAP
    assert look(bare)["runs"][0]["current_A"] == 0.5


def test_what_is_no_table_has_its_reason_without_the_way_to_it(tmp_path):
    (tmp_path / "run.csv").write_text("no numbers\n")
    answer = look(tmp_path / "run.csv")
    assert str(tmp_path) not in answer["error"]
    assert "run.csv" in answer["error"]
    assert (answer["columns"], answer["runs"]) == ([], [])
    with pytest.raises(InputError):
        look(tmp_path / "run.csv", {"channel": {"nothing": {}}})


def test_the_beginning_of_a_large_text_is_told_as_the_whole_is(tmp_path):
    rows = "".join(
        f"{k / 200},{5 * np.sin(k / 30):.6f},{np.cos(k / 30):.6f},0.5,note\n" for k in range(80_000)
    )
    path = tmp_path / "run.csv"
    path.write_text("time_s,displacement_mm,force_kN,current_A,remark\n" + rows)
    seen, whole = glance(path), look(path)
    assert seen is not None
    assert (seen["rows"], seen["bytes"], seen["error"]) == (None, path.stat().st_size, None)
    assert 0.0 < seen["head_share"] < 0.2
    for a, b in zip(seen["columns"], whole["columns"], strict=True):
        assert (a["name"], a["role"], a["first"], a["kind"]) == (b["name"], b["role"], b["first"], b["kind"])
    assert seen["columns"][4]["first"] == ["note"] * 12
    for name, content in (
        ("small.csv", b"t,x\n"), ("run.xyz", path.read_bytes()), ("zeros.csv", bytes(3 << 20)),
        ("words.csv", b"words and words\n" * 200_000),
    ):  # fmt: skip
        (tmp_path / name).write_bytes(content)
        assert glance(tmp_path / name) is None


def test_a_card_s_line_says_what_it_is_or_that_it_is_none(tmp_path):
    card = read_card(write_a_card(tmp_path / "card.json"))
    line = card_line(tmp_path / "card.json")
    assert (line["title"], line["law"], line["error"]) == (card.title, card.damper.law.name, None)
    low, high = card.envelope.displacement
    assert line["envelope"]["displacement_mm"] == [1e3 * low, 1e3 * high]  # type: ignore[index]
    document = json.loads((tmp_path / "card.json").read_text())
    for broken in ("{", "[]", json.dumps(document | {"envelope": {"command": ["a", 1]}})):
        (tmp_path / "card.json").write_text(broken)
        assert str(card_line(tmp_path / "card.json")["error"]).startswith("not a readable card")


# ------------------------------------------------------------------------------------------- series


def test_a_kept_run_is_its_samples_in_single_precision(file, tmp_path):
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


def test_runs_that_cannot_be_prepared_are_kept_and_others_are_told(bare, tmp_path):
    assert keep_runs(bare, tmp_path / "a")["error"]
    assert not list((tmp_path / "a").iterdir())
    bare.with_name(bare.name + MAP_SUFFIX).write_text("[channel.nothing]\n")
    told = keep_runs(bare, tmp_path / "a")
    assert told["runs"] == []
    assert "nothing" in told["error"]
    assert str(tmp_path) not in told["error"]
    lines = ["time_s,displacement_mm,force_N,current_A,temperature_degC"]
    times = [0.0, 0.1, 0.25, 0.2]  # it goes back
    lines += [f"{t},{k * k},{k},1.0,{30 + k}" for k, t in enumerate(times)]
    (tmp_path / "back.csv").write_text("\n".join([*lines, ""]))
    (row,) = keep_runs(tmp_path / "back.csv", tmp_path / "b")["runs"]
    assert not row["usable"]
    header, columns = read_series(tmp_path / "b/0.series")
    assert header["step_s"] is None
    with np.errstate(all="ignore"):
        slope = np.gradient([0.0, 1.0, 4.0, 9.0], times).astype(np.float32)
    assert np.allclose(columns["velocity_mm_s"], slope, rtol=1e-5)
    assert columns["temperature_degC"].tolist() == [30.0, 31.0, 32.0, 33.0]


def test_a_window_keeps_the_ends_of_every_stretch_and_its_part_of_the_time(tmp_path):
    run = make_run(duration=20.0, rate_Hz=500.0)
    force = run.force.copy()
    force[4321] = 9e4  # one sample
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
    assert 10 < len(read_series(tmp_path / "like")[1]["time_s"]) <= 64  # never fewer than that many
    with pytest.raises(InputError, match=r"no sample from 30 to None s.*a part of 0 to 20 s"):
        keep_window(tmp_path / "0.series", tmp_path / "none", from_s=30)


def test_the_model_of_a_kept_run_is_the_card_s_simulation(file, tmp_path):
    card = write_a_card(tmp_path / "card.json")
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


# ------------------------------------------------------------------------------------------- maps


def written(folder, *headers):
    """Return what is written of files, each with a header of its own."""
    for k, header in enumerate(headers):
        write_csv(folder / f"{k}.csv")
        body = (folder / f"{k}.csv").read_text().split("\n", 1)[1]
        (folder / f"{k}.csv").write_text(f"{header}\n{body}")
    return write_map(read_files([folder]))


def test_a_written_map_holds_what_files_share_and_comments_on_the_rest(tmp_path):
    same = "time_s,displacement_mm,force_kN,current_A"
    found = written(tmp_path, same, "time_s,stroke_mm,force_kN,current_A")
    assert set(found.document["channel"]) == {"time", "force", "current"}
    (comment,) = found.comments
    assert comment == "displacement: 'displacement_mm', 'stroke_mm', as the header of each file says"
    assert found.document["channel"]["force"] == {"name": "force_kN", "unit": "kN"}
    assert parse_toml(found.text) == found.document
    assert f"# {comment}" in found.text


def test_a_written_map_has_the_commands_of_names_and_the_rate_of_the_samples(tmp_path):
    body = "\n".join(f"{5 * np.sin(k / 9):.6f},{np.cos(k / 9):.6f}" for k in range(400))
    for name in ("a 1 A.csv", "b 2 A.csv"):
        (tmp_path / name).write_text(f"sampling rate: 200 Hz\ndisplacement_mm,force_kN\n{body}\n")
    found = write_map(read_files([tmp_path]))
    assert found.document["constant"] == {"rate_Hz": 200.0}
    assert len(found.comments) == 2
    assert "current_A = 2, from the" in found.comments[1]
    (tmp_path / "b 2 A.csv").unlink()
    found = write_map(read_files([tmp_path]))
    assert (found.document["constant"], found.comments) == ({"current_A": 1.0, "rate_Hz": 200.0}, ())
    again = read_dataset([tmp_path], ChannelMap.from_dict(parse_toml(found.text)))
    assert [run.constant_command for run in again] == [1.0]


def test_a_map_by_which_files_were_read_is_written_with_all_that_it_says(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text(
        "t;x;F;note\n" + "".join(f"{k};{k % 9 - 4};{k % 7};{'Resume' * (k == 60)}\n" for k in range(120))
    )
    force = {"name": "F", "unit": "V", "gain": -250.0, "offset": 3.0, "sign": -1}
    given = {
        "channel": {
            "time": {"name": "t", "unit": "ms"}, "displacement": {"name": "x", "unit": "mm"}, "force": force,
        },
        "constant": {"temperature_degC": 40.0}, "segments": {"split": "Resume", "current_A": [0.0, 1.0]},
        "session": {"name": "may"}, "file": {"delimiter": ";"},
    }  # fmt: skip
    assert write_map(read_files([file], ChannelMap.from_dict(given))).document == given


def test_tables_in_which_the_maps_beside_files_differ_are_comments(tmp_path):
    for name, session in (("a", "may"), ("b", "june"), ("c", "")):
        write_csv(tmp_path / f"{name}.csv")
        beside = f'[session]\nname = "{session}"\n' if session else ""
        (tmp_path / f"{name}.csv.channels.toml").write_text(f'{beside}[file]\ndelimiter = ","\n')
    found = write_map(read_files([tmp_path]))
    assert found.document["file"] == {"delimiter": ","}
    assert "session" not in found.document
    assert found.comments == (
        "a.csv: [session] name = may", "b.csv: [session] name = june", "c.csv: [session] none",
    )  # fmt: skip


def test_any_map_is_written_so_that_it_reads_back(tmp_path):
    odd = {"segments": {"split": 'a "b"\t\x7f', "current_A": [0.5, 1.0]}, "channel": {"force": {
        "name": "Kraft [N] = 1", "unit": "N", "sign": -1}}}  # fmt: skip
    text = channels_toml(odd, ["two\nlines"])
    assert parse_toml(text) == odd
    assert "# two lines" in text
    with pytest.raises(InputError, match="channel map"):
        channels_toml({"nothing": {}})


# ------------------------------------------------------------------------------------------- simulate


def test_a_simulation_takes_a_motion_in_words_a_path_a_run_a_file_or_a_frame(file, tmp_path):
    card = read_card(write_a_card(tmp_path / "card.json"))
    words = simulate(card, "sine:10mm:1Hz:1A:2s")
    path = drive(Sine(10e-3, 1.0), duration=2.0, rate_Hz=1000.0, command=1.0)
    assert np.array_equal(simulate(card, path).force, words.force)
    assert words.measured is None
    run, of_file, of_frame = (simulate(card, given) for given in (RUN, str(file), titled()))
    for found in (run, of_file, of_frame):
        assert found.measured is not None
        assert np.allclose(found.measured, RUN.force, rtol=1e-9)
    columns = {name: values for name, values in titled().items() if "force" not in name}
    alone = simulate(card, columns)
    assert alone.measured is None
    assert np.allclose(alone.force, run.force, rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match=r"the command is in V.*expected A, as the card has it"):
        simulate(card, "sine:10mm:1Hz:1V:2s")


# ------------------------------------------------------------------------------------------- heating


def test_a_quick_heating_is_the_job_s_at_the_same_sine(tmp_path):
    card = write_a_card(tmp_path / "card.json")
    quick = QuickHeat()
    fast = quick.curve(card, "paper", amplitude_mm=10.0, command=1.0, duration_s=600.0)
    whole = heat(read_card(card), read_drawing("paper"), read_duty("sine:10mm:1Hz:1A:600s"), HeatOptions())
    assert fast["power_W"]["mechanical"] == pytest.approx(whole.rise.mechanical_W[0], rel=1e-6)
    assert fast["curve"]["fluid_degC"][-1] == pytest.approx(float(whole.rise.fluid_degC[-1]), abs=0.2)
    half = quick.curve(card, "paper", amplitude_mm=10.0, command=1.0, duration_s=600.0, duty_share=0.5)
    assert half["power_W"]["mechanical"] == pytest.approx(0.5 * fast["power_W"]["mechanical"])
    assert max(half["curve"]["hottest_degC"]) < max(fast["curve"]["hottest_degC"])
    fins = {"fins": 12, "width_mm": 30.0, "thickness_mm": 2.0, "pitch_mm": 8.0}
    cooled = quick.curve(card, "paper", amplitude_mm=10.0, command=1.0, duration_s=600.0, fins=fins)
    assert cooled["curve"]["wall_degC"][-1] < fast["curve"]["wall_degC"][-1]


def test_a_changed_drawing_is_written_as_it_is_read_and_what_is_wrong_has_its_key():
    facts = damper_facts("paper", "paper")
    drawn = draw_damper("paper", "mine", facts["tables"])
    assert parse_toml(drawn["text"]) == facts["tables"]
    fins = {"fins": 12, "width_mm": 30.0, "thickness_mm": 2.0, "pitch_mm": 8.0}
    finned = parse_toml(draw_damper("paper", "mine", fins=fins)["text"])["sink"]
    assert finned["fins"] == 12
    with pytest.raises(InputError, match="mine"):
        draw_damper("paper", "mine", facts["tables"] | {"nothing": {"a": 1}})


def test_a_damper_at_rest_is_heated_by_its_coil_alone(tmp_path):
    card = write_a_card(tmp_path / "card.json")
    found = QuickHeat().curve(card, "paper", amplitude_mm=0.0, command=1.0, duration_s=600.0)
    assert found["power_W"]["mechanical"] == pytest.approx(0.0, abs=1e-9)
    assert found["power_W"]["coil"] > 0.0


def test_a_kept_run_of_uneven_times_has_its_own_samples_and_a_measured_velocity_stays(tmp_path):
    """Where a run cannot be prepared the velocity is the file's; a run of one sample has none."""
    rows = [f"{t},{x},{v},{x},1.0" for t, x, v in ((0.0, 0.0, 7.0), (0.1, 1.0, 8.0), (0.05, 2.0, 9.0))]
    head = "time_s,displacement_mm,velocity_mm_s,force_N,current_A"
    (tmp_path / "back.csv").write_text("\n".join([head, *rows, ""]))
    keep_runs(tmp_path / "back.csv", tmp_path / "a")
    assert read_series(tmp_path / "a/0.series")[1]["velocity_mm_s"].tolist() == [7.0, 8.0, 9.0]
    run = make_run(duration=4.0, rate_Hz=500.0)
    time = run.time + 4e-4 * np.sin(np.arange(len(run)))
    x = 10.0 * np.sin(4.0 * np.pi * time)
    columns = (time.tolist(), x.tolist(), run.force.tolist())
    lines = [f"{t!r},{mm!r},{f!r},0.5" for t, mm, f in zip(*columns, strict=True)]
    (tmp_path / "run.csv").write_text("time_s,displacement_mm,force_N,current_A\n" + "\n".join(lines) + "\n")
    keep_runs(tmp_path / "run.csv", tmp_path / "b")
    kept = read_series(tmp_path / "b/0.series")[1]
    rate = 40.0 * np.pi * np.cos(4.0 * np.pi * kept["time_s"])
    assert np.abs(kept["velocity_mm_s"] - rate)[20:-20].max() < 0.02 * 40.0 * np.pi


@pytest.mark.parametrize(
    ("start_degC", "said"), [(20.0, ""), (900.0, "start temperature is 900.0 degC"), (None, "")]
)
def test_the_surroundings_and_the_start_are_those_that_were_asked_for(start_degC, said):
    drawing = read_drawing("paper")
    asked = HeatOptions(ambient_degC=35.0, air_m_s=3.0, with_sink=False)
    changed = changed_drawing(drawing, asked, None)
    assert (changed.surroundings.ambient, changed.surroundings.air_speed) == (35.0 + 273.15, 3.0)
    assert changed.sink is None
    same = changed_drawing(drawing, HeatOptions(), None)
    assert (same.surroundings, same.sink) == (drawing.surroundings, drawing.sink)
    if said:
        with pytest.raises(InputError, match=said):
            start_of(drawing, start_degC)
    else:
        assert start_of(drawing, start_degC) == (None if start_degC is None else start_degC + 273.15)


@pytest.mark.parametrize(("quantity", "whole"), [("stroke", (15.0, "mm")), ("duty", (100.0, "%")),
                                                 ("current", (2.0, "A"))])  # fmt: skip
def test_the_whole_duty_has_its_amplitude_its_time_and_its_current(quantity, whole, tmp_path):
    options = DerateOptions(quantity=quantity, ambient_degC=(20.0,), air_m_s=(0.0,), duration_min=())
    card = read_card(write_a_card(tmp_path / "card.json"))
    found = derate(card, read_drawing("paper"), read_duty("sine:15mm:1Hz:2A:1800s"), options)
    assert found.whole == pytest.approx(whole[0], rel=1e-3)
    assert found.unit == whole[1]
