"""The command ``rig`` writes simulated measurements and their exact values, either all files or none."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from mrdamper.data.channels import read_channel_map
from mrdamper.data.readers import read_runs
from mrdamper.jobs.options import RigOptions
from mrdamper.registry import JOBS
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


@pytest.fixture
def run_rig(folder):
    def run(out, preset="nominal", *, draw=None, on_progress=None):
        inputs = {"preset": preset, "campaign": folder / "campaign.toml"}
        return JOBS["rig"].perform(inputs, RigOptions(draw=draw), out=out, on_progress=on_progress)[1]

    return run


def test_json_output_of_rig_marks_held_out_runs(answer):
    assert [run["name"] for run in answer["runs"]] == [
        "hard_020C_0.00A_sine5mm1Hz", "hard_020C_2.00A_sine5mm1Hz", "hard_020C_0-2A_steps",
        "hard_060C_0.00A_sine5mm1Hz", "hard_060C_2.00A_sine5mm1Hz", "hard_060C_0-2A_steps",
    ]  # fmt: skip
    assert [run["held_out"] for run in answer["runs"]] == [False] * 3 + [True] * 3
    assert answer["hold_out"] == ["*_060C_*"]
    assert answer["simulated"] is True


def test_rig_files_contain_measured_runs(answer, folder):
    """Values are rounded to 0.1 um, 0.01 N and 0.01 K. The first line states that the run is simulated."""
    read = {run.name: run for run in read_runs(folder / "runs")}
    campaign = Campaign.from_mapping(tomllib.loads(CAMPAIGN))
    measured = {run.name: run for run, _ in measure(PRESETS["hard"], campaign, seed=7)}
    assert read.keys() == measured.keys()
    for name, run in measured.items():
        first = (folder / "runs" / f"{name}.csv").read_text(encoding="utf-8").splitlines()[0]
        assert first == "# simulated: virtual damper hard, seed 7; not measured"
        assert read[name].time == pytest.approx(run.time, abs=1e-9)
        assert np.array_equal(read[name].command, run.command)
        for channel, unit in (("displacement", 1e-7), ("force", 0.01), ("temperature", 0.01)):
            assert getattr(read[name], channel) == pytest.approx(getattr(run, channel), abs=0.51 * unit)


def test_channel_map_of_rig_changes_only_session(answer, folder):
    place = folder / "runs"
    plain, mapped = read_runs(place), read_runs(place, read_channel_map(place / "channels.toml"))
    assert plain.fingerprint == mapped.fingerprint
    assert {run.session for run in mapped} == {"virtual rig hard"}


def test_truth_folder_contains_exact_values(answer, folder):
    truth = folder / "runs.truth"
    assert answer["truth"] == str(truth)
    assert read_damper(truth / "hard.damper.toml") == PRESETS["hard"]
    assert Campaign.from_toml(truth / "hard.campaign.toml") == Campaign.from_toml(folder / "campaign.toml")
    for run in read_runs(folder / "runs"):
        true = np.loadtxt(truth / f"{run.name}.csv", delimiter=",", skiprows=2).T
        assert np.std(run.force - true[3]) == pytest.approx(5.0, rel=0.15)


def test_rig_preset_may_be_file(run_rig, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "stiff"\nname = "mine"\nfriction_N = 0.0\n', encoding="utf-8")
    assert run_rig(tmp_path / "out", file)["damper"] == "mine"
    assert read_damper(tmp_path / "out.truth" / "mine.damper.toml").friction_N == 0.0


def test_rig_option_draw_randomises_preset(run_rig, tmp_path):
    """A second campaign in the same folder causes a note."""
    assert run_rig(tmp_path / "out", "stiff", draw=6)["damper"] == "stiff-6"
    assert read_damper(tmp_path / "out.truth" / "stiff-6.damper.toml") == draw_variant(PRESETS["stiff"], 6)
    (note,) = run_rig(tmp_path / "out", "stiff", draw=8)["notes"]
    assert "has 6 other runs, such as stiff-6_020C_0-2A_steps" in note


def test_interrupted_rig_campaign_writes_nothing(run_rig, tmp_path):
    def stop(update):
        if update.done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_rig(tmp_path / "out", on_progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--preset", "soft"), 3, "'soft' is not a preset of the virtual rig"),
        (("--campaign", "x.toml"), 3, "x.toml: cannot read the campaign"),
    ],
)
def test_invalid_rig_options_give_one_message(options, code, message, tmp_path):
    run = mrdamper("rig", "--out", tmp_path / "out", *options, cwd=tmp_path)
    assert run.returncode == code
    assert message in run.stderr
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []
