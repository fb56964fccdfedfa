"""``mrdamper rig``: runs as any rig's, the truth beside them, all files or none."""

from __future__ import annotations

import tomllib
from pathlib import Path

import click
import numpy as np
import pytest

from mrdamper.cli import cli
from mrdamper.data.channels import read_channel_map
from mrdamper.data.readers import read_runs
from mrdamper.errors import InputError
from mrdamper.jobs.options import RigOptions
from mrdamper.registry import JOBS
from mrdamper.report.rig import truth_folder
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.damper import PRESETS, draw_variant, read_damper
from mrdamper.virtual_rig.measurement import measure
from tests.support.rigs import answer_of, mrdamper

CAMPAIGN = """
motions = ["sine5mm1Hz"]
currents_A = [0, 2]
temperatures_degC = [20, 60]
duration_s = 2.0
"""


def rig(out, *, preset=None, damper_file=None, campaign_file=None, report=None):
    """Run the job in this process; return its answer."""
    given = {"damper": damper_file, "campaign": campaign_file}
    return JOBS["rig"].perform(given, RigOptions(preset=preset), out=out, on_progress=report)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("rig")
    (place / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def answer(folder):
    return answer_of(
        mrdamper(
            "rig", "--preset", "hard", "--campaign", folder / "campaign.toml", "--seed", 7,
            "--out", folder / "runs", "--json",
        )
    )  # fmt: skip


def test_the_answer_names_every_run_and_what_is_held_out(answer, folder):
    assert [run["name"] for run in answer["runs"]] == [
        "hard_020C_0.00A_sine5mm1Hz", "hard_020C_2.00A_sine5mm1Hz", "hard_020C_0-2A_steps",
        "hard_060C_0.00A_sine5mm1Hz", "hard_060C_2.00A_sine5mm1Hz", "hard_060C_0-2A_steps",
    ]  # fmt: skip
    assert [run["held_out"] for run in answer["runs"]] == [False] * 3 + [True] * 3
    assert [run["current_A"] for run in answer["runs"]] == [0.0, 2.0, None] * 2
    assert answer["hold_out"] == ["*_060C_*"]
    assert answer["simulated"] is True
    assert answer["notes"] == []


def test_the_runs_are_read_as_any_rig_s_and_are_those_that_were_measured(answer, folder):
    """The file rounds to a tenth of a micrometre, a hundredth of a newton and of a kelvin."""
    read = {run.name: run for run in read_runs(folder / "runs")}
    campaign = Campaign.from_mapping(tomllib.loads(CAMPAIGN))
    measured = {run.name: run for run, _ in measure(PRESETS["hard"], campaign, seed=7)}
    assert read.keys() == measured.keys()
    for name, run in measured.items():
        assert read[name].time == pytest.approx(run.time, abs=1e-9)
        assert np.array_equal(read[name].command, run.command)
        assert read[name].command_unit == "A"
        for channel, unit in (("displacement", 1e-7), ("force", 0.01), ("temperature", 0.01)):
            assert getattr(read[name], channel) == pytest.approx(getattr(run, channel), abs=0.51 * unit)


def test_the_first_line_says_that_nobody_measured_it(answer, folder):
    for path in (folder / "runs").glob("*.csv"):
        first, header = path.read_text(encoding="utf-8").splitlines()[:2]
        assert first == "# simulated: virtual damper hard, seed 7; not measured"
        assert header == "time_s,displacement_m,force_N,current_A,temperature_degC"


def test_the_channel_map_changes_nothing_but_the_session(answer, folder):
    place = folder / "runs"
    plain, mapped = read_runs(place), read_runs(place, read_channel_map(place / "channels.toml"))
    assert plain.fingerprint == mapped.fingerprint
    assert {run.session for run in mapped} == {"virtual rig hard"}
    assert len({run.session for run in plain}) == len(plain)


def test_the_truth_lies_beside_the_runs_with_the_damper_that_made_them(answer, folder):
    beside = folder / "runs.truth"
    assert answer["truth"] == str(beside)
    assert {path.name for path in (folder / "runs").iterdir()} == {
        *(f"{run['name']}.csv" for run in answer["runs"]),
        "channels.toml",
    }
    assert read_damper(beside / "hard.damper.toml") == PRESETS["hard"]
    assert Campaign.from_toml(beside / "hard.campaign.toml") == Campaign.from_toml(folder / "campaign.toml")
    for run in read_runs(folder / "runs"):
        true = np.loadtxt(beside / f"{run.name}.csv", delimiter=",", skiprows=2).T
        assert len(true) == 6
        assert np.std(run.force - true[3]) == pytest.approx(5.0, rel=0.15)
        assert np.ptp(true[5]) == 0.0


def test_own_parameters_name_the_runs(folder, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "stiff"\nname = "mine"\nfriction_N = 0.0\n', encoding="utf-8")
    done = rig(tmp_path / "out", damper_file=file, campaign_file=folder / "campaign.toml")
    assert done["damper"] == "mine"
    assert (tmp_path / "out" / "mine_020C_2.00A_sine5mm1Hz.csv").is_file()
    assert read_damper(tmp_path / "out.truth" / "mine.damper.toml").friction_N == 0.0


def test_a_drawn_damper_names_the_runs_and_lies_in_the_truth(folder, tmp_path):
    options = RigOptions(preset="stiff", draw=6)
    given = {"damper": None, "campaign": folder / "campaign.toml"}
    done = JOBS["rig"].perform(given, options, out=tmp_path / "out", on_progress=None)[1]
    assert done["damper"] == "stiff-6"
    drawn = read_damper(tmp_path / "out.truth" / "stiff-6.damper.toml")
    assert drawn == draw_variant(PRESETS["stiff"], 6)
    assert drawn != draw_variant(PRESETS["stiff"], 8)


def test_runs_of_another_campaign_in_the_folder_are_told(folder, tmp_path):
    for preset in ("nominal", "stiff"):
        done = rig(tmp_path / "out", preset=preset, campaign_file=folder / "campaign.toml")
    assert done["notes"] == [
        f"{tmp_path / 'out'} holds other runs, 6 of them, such as nominal_020C_0-2A_steps: identify takes "
        "every run in the folder"
    ]


def test_an_interrupted_campaign_leaves_nothing(folder, tmp_path):
    def stop(update):
        if update.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rig(tmp_path / "out", campaign_file=folder / "campaign.toml", report=stop)
    assert list(tmp_path.iterdir()) == []


def test_every_run_is_reported(folder, tmp_path):
    told = []
    rig(
        tmp_path / "out",
        campaign_file=folder / "campaign.toml",
        report=lambda update: told.append((update.done, update.total)),
    )
    assert told == [(k, 6) for k in range(6)]


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--preset", "soft"), 2, "Invalid value for '--preset'"),
        (("--preset", "hard", "--damper", "x.toml"), 2, "--preset and --damper exclude each other"),
        (("--damper", "x.toml"), 3, "x.toml: cannot read the virtual damper"),
        (("--campaign", "x.toml"), 3, "x.toml: cannot read the campaign"),
        (("--seed", "-1"), 2, "-1 is not in the range"),
    ],
)
def test_bad_options_end_in_one_message_and_leave_nothing(options, code, message, tmp_path):
    run = mrdamper("rig", "--out", tmp_path / "out", *options, cwd=tmp_path)
    assert run.returncode == code
    assert message in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_the_way_of_the_truth_is_refused_before_anything_is_run(folder, tmp_path):
    (tmp_path / "out.truth").write_text("in the way", encoding="utf-8")
    with pytest.raises(InputError, match=r"out\.truth is a file"):
        rig(tmp_path / "out", campaign_file=folder / "campaign.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["out.truth"]


def test_the_truth_of_the_folder_one_stands_in_lies_beside_it(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert truth_folder(Path()) == tmp_path / "here.truth"
    assert truth_folder(Path("runs/")) == Path("runs.truth")


def test_the_command_line_knows_every_preset():
    """Written out there, so that help need not load the rig."""
    rig_command = cli.commands["rig"]
    option = next(
        each for each in rig_command.get_params(click.Context(rig_command)) if each.name == "preset"
    )
    assert isinstance(option.type, click.Choice)
    assert set(option.type.choices) == set(PRESETS)


def test_a_person_is_told_what_to_do_next(folder, tmp_path):
    run = mrdamper("rig", "--campaign", folder / "campaign.toml", "--out", tmp_path / "out")
    assert run.returncode == 0, run.stderr
    assert f"wrote 6 runs to {tmp_path / 'out'}" in run.stdout
    assert "--hold-out '*_060C_*'" in run.stdout
