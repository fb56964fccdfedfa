"""The command ``check`` reports faults of runs in files, JSON and exit codes."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from mrdamper.jobs.check import check
from mrdamper.jobs.inputs import read_files
from tests.support.campaigns import columns_of, short_runs, write_csv, write_runs
from tests.support.rigs import answer_of, mrdamper

FINDING = {
    "run", "kind", "severity", "channel", "size", "size_low", "size_high", "unit", "from_s", "to_s", "found",
    "effect", "remedy",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with correct runs, a clipped run, a run with a force offset, and a damaged file."""
    place = tmp_path_factory.mktemp("rig")
    runs = short_runs()
    write_runs(place / "runs", runs)
    (place / "spoilt").mkdir()
    clipped, shifted = (columns_of(run) for run in runs[:2])
    clipped["force_N"] = np.minimum(clipped["force_N"], 0.5 * clipped["force_N"].max())
    shifted["force_N"] = shifted["force_N"] + 0.5 * np.std(shifted["force_N"])
    write_csv(place / "spoilt" / "clipped.csv", clipped)
    write_csv(place / "spoilt" / "shifted.csv", shifted)
    (place / "mixed").mkdir()
    write_csv(place / "mixed" / "shifted.csv", shifted)
    (place / "mixed" / "broken.csv").write_text("time_s;displacement_mm;force_N;current_A\n")
    return place


@pytest.fixture(scope="module")
def spoilt(folder):
    return mrdamper("check", folder / "spoilt", "--out", folder / "out", "--json")


def test_check_of_correct_runs_gives_exit_code_0(folder):
    answer = answer_of(mrdamper("check", folder / "runs", "--json"))
    assert answer["usable"] is True
    assert answer["counts"]["fault"] == 0
    assert answer["unreadable"] == []
    assert len(answer["runs"]) == len(short_runs())
    assert all(file["layout"]["delimiter"] == "," for file in answer["files"])
    assert [column["role"] for column in answer["files"][0]["columns"]] == [
        "time", "displacement", "force", "voltage",
    ]  # fmt: skip


def test_file_given_by_two_paths_is_one_run(folder):
    """A relative path, a path through another folder and a link to one file give a single run."""
    file = folder / "spoilt" / "shifted.csv"
    link = folder / "link.csv"
    link.symlink_to(file)
    answer = answer_of(
        mrdamper("check", file, folder / "runs" / ".." / "spoilt" / "shifted.csv", link, "--json")
    )
    assert [run["name"] for run in answer["runs"]] == ["shifted"]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda time: 0.0 * time,
        lambda time: 0.0 * time + 7.0,
        lambda time: np.where(time < time.mean(), 0.0, 0.5),
        lambda time: time[::-1],
        lambda time: np.where(time > time.mean(), np.nan, time),
        lambda time: 1e300 * time,
        lambda time: 1e-300 * time,
    ],
    ids=["zero", "constant", "two values", "backward", "missing", "huge", "tiny"],
)
def test_time_fault_suppresses_other_findings(tmp_path, spoil):
    """With wrong times, runs are not compared with each other nor with the frequencies in their names."""
    columns = columns_of(short_runs()[0])
    columns["time_s"] = spoil(columns["time_s"])
    for name in ("sine 1 Hz.csv", "sine 2 Hz.csv"):
        write_csv(tmp_path / name, columns)
    checked = check(read_files([tmp_path]))
    assert not checked.usable
    assert {len(run.findings) for run in checked.runs} == {1}
    assert checked.groups == ()


def test_faulty_run_gives_exit_code_5(spoilt):
    assert spoilt.returncode == 5
    assert spoilt.stderr == ""
    answer = json.loads(spoilt.stdout)
    assert answer["usable"] is False
    by_run: dict[str, dict[str, dict[str, object]]] = {}
    for finding in answer["findings"]:
        assert finding.keys() == FINDING
        by_run.setdefault(finding["run"], {})[finding["kind"]] = finding
    assert by_run["clipped"]["clipped"]["severity"] == "fault"
    assert by_run["clipped"]["clipped"]["channel"] == "force"
    assert by_run["shifted"]["force_offset"]["severity"] == "warning"
    (row,) = (row for row in answer["runs"] if row["name"] == "clipped")
    assert row["worst"] == "fault"
    assert "clipped" in row["findings"]


def test_check_output_files_agree_with_json(spoilt, folder):
    answer = json.loads(spoilt.stdout)
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "check.html", "check.json", "findings.csv",
    ]  # fmt: skip
    assert json.loads((folder / "out" / "check.json").read_text()) == answer
    with (folder / "out" / "findings.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == [finding["kind"] for finding in answer["findings"]]
    page = (folder / "out" / "check.html").read_text()
    assert "have faults and cannot be fitted" in page
    assert "clipped" in page


def test_check_reports_unreadable_file_and_other_runs(folder):
    run = mrdamper("check", folder / "mixed", "--json")
    assert run.returncode == 3
    answer = json.loads(run.stdout)
    assert [row["name"] for row in answer["runs"]] == ["shifted"]
    assert answer["unreadable"][0]["path"].endswith("broken.csv")
    assert run.stderr.startswith("mrdamper: ")
    assert "broken.csv: no rows of numbers" in run.stderr


def test_check_uses_channel_map(folder, tmp_path):
    text = (folder / "spoilt" / "shifted.csv").read_text().replace("force_N", "CH1", 1)
    (tmp_path / "raw.csv").write_text(text)
    assert mrdamper("check", tmp_path / "raw.csv").returncode == 3
    (tmp_path / "map.toml").write_text("[channel.force]\nname = 'CH1'\nunit = 'N'\nsign = -1\n")
    run = mrdamper("check", tmp_path / "raw.csv", "--channels", tmp_path / "map.toml", "--json")
    assert run.returncode == 5
    assert [finding["kind"] for finding in json.loads(run.stdout)["findings"]] == ["force_sign"]
