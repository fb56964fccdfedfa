"""``mrdamper check`` as scripts rely on it, and its findings in the report of a fit."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from tests.support.rigs import answer_of, columns_of, mrdamper, short_runs, write_csv, write_runs

FINDING = {
    "run", "kind", "severity", "channel", "size", "size_low", "size_high", "unit", "from_s", "to_s", "found",
    "effect", "remedy",
}  # fmt: skip
EVIL = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder of sound runs, one with a clipped and a shifted run, and one with a broken file."""
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
    (place / "mixed" / "broken.csv").write_text("no numbers here\n")
    return place


@pytest.fixture(scope="module")
def spoilt(folder):
    return mrdamper("check", folder / "spoilt", "--out", folder / "out", "--json")


def test_sound_runs_are_usable_and_exit_with_zero(folder):
    answer = answer_of(mrdamper("check", folder / "runs", "--json"))
    assert answer["usable"] is True
    assert answer["counts"]["fault"] == 0
    assert answer["unreadable"] == []
    assert len(answer["runs"]) == len(short_runs())
    assert all(file["layout"]["delimiter"] == "," for file in answer["files"])
    assert [column["role"] for column in answer["files"][0]["columns"]] == [
        "time", "displacement", "force", "voltage",
    ]  # fmt: skip


def test_file_named_by_two_paths_is_one_run(folder):
    """A relative path, a path through its folder and a link name one file."""
    file = folder / "spoilt" / "shifted.csv"
    link = folder / "link.csv"
    link.symlink_to(file)
    answer = answer_of(
        mrdamper("check", file, folder / "runs" / ".." / "spoilt" / "shifted.csv", link, "--json")
    )
    assert [run["name"] for run in answer["runs"]] == ["shifted"]


def test_a_fault_exits_with_five_and_one_json_object(spoilt):
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


def test_files_hold_what_json_says(spoilt, folder):
    answer = json.loads(spoilt.stdout)
    assert sorted(path.name for path in (folder / "out").iterdir()) == [
        "check.html", "check.json", "findings.csv",
    ]  # fmt: skip
    assert json.loads((folder / "out" / "check.json").read_text()) == answer
    with (folder / "out" / "findings.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == [finding["kind"] for finding in answer["findings"]]
    page = (folder / "out" / "check.html").read_text()
    assert "not to be fitted as they are" in page
    assert "clipped" in page


def test_a_file_that_cannot_be_read_is_told_beside_the_others(folder):
    run = mrdamper("check", folder / "mixed", "--json")
    assert run.returncode == 3
    answer = json.loads(run.stdout)
    assert [row["name"] for row in answer["runs"]] == ["shifted"]
    assert answer["unreadable"][0]["path"].endswith("broken.csv")
    assert run.stderr.startswith("mrdamper: ")
    assert "broken.csv: no rows of numbers" in run.stderr


def test_files_that_leave_all_open_are_asked_about_without_an_empty_table(tmp_path):
    """Two columns of one name are refused, not the first taken."""
    lines = [
        "time [s],displacement [mm],force [N],force [N]",
        *(f"{k / 100},{k % 9},{k % 7},{k}" for k in range(64)),
    ]
    (tmp_path / "twice.csv").write_text("\n".join(lines) + "\n")
    run = mrdamper("check", tmp_path / "twice.csv")
    assert run.returncode == 3
    assert "--answer force.column=VALUE" in run.stdout
    assert "no run could be read" in run.stdout
    assert "samples" not in run.stdout


def test_a_name_is_text_on_the_page(folder, tmp_path):
    columns = columns_of(short_runs()[1])
    columns["force_N"] = -columns["force_N"]
    name = EVIL.replace("/", "")
    write_csv(tmp_path / f"{name}.csv", columns)
    run = mrdamper("check", tmp_path / f"{name}.csv", "--out", tmp_path / "out", "--json")
    assert run.returncode == 5
    page = (tmp_path / "out" / "check.html").read_text()
    assert name not in page
    assert "&lt;script&gt;" in page


def test_a_person_sees_how_files_were_understood_and_what_to_do(folder):
    run = mrdamper("check", folder / "spoilt")
    assert run.returncode == 5
    said = " ".join(run.stdout.split())
    assert "delimited text, separated by comma, decimal point, 1 header line" in said
    assert "force 'force_N' in N" in said
    assert "Set the amplifier's range larger" in said
    assert "not to be fitted as they are" in said


def test_a_channel_map_is_heeded(folder, tmp_path):
    text = (folder / "spoilt" / "shifted.csv").read_text().replace("force_N", "CH1", 1)
    (tmp_path / "raw.csv").write_text(text)
    assert mrdamper("check", tmp_path / "raw.csv").returncode == 3
    (tmp_path / "map.toml").write_text("[channel.force]\nname = 'CH1'\nunit = 'N'\nsign = -1\n")
    run = mrdamper("check", tmp_path / "raw.csv", "--channels", tmp_path / "map.toml", "--json")
    assert run.returncode == 5
    assert [finding["kind"] for finding in json.loads(run.stdout)["findings"]] == ["force_sign"]


@pytest.mark.system
def test_the_report_of_a_fit_says_what_its_runs_show(folder, tmp_path):
    """A shifted load cell is in the JSON and the report of ``fit``, with its size."""
    write_runs(tmp_path / "runs", short_runs())
    columns = columns_of(short_runs()[3])
    offset = 0.5 * float(np.std(columns["force_N"]))
    columns["force_N"] = columns["force_N"] + offset
    write_csv(tmp_path / "runs" / f"{short_runs()[3].name}.csv", columns)
    answer = answer_of(
        mrdamper(
            *("fit", tmp_path / "runs", "--out", tmp_path / "out", "--law", "tanh"),
            *("--starts", 1, "--json"),
        )
    )
    (found,) = (
        finding
        for finding in answer["findings"]
        if finding["run"] == short_runs()[3].name and finding["kind"] == "force_offset"
    )
    sound = answer_of(mrdamper("check", folder / "runs", "--json"))["findings"]
    before = {f["run"]: f["size"] for f in sound if f["kind"] == "force_offset"}
    assert found["size"] == pytest.approx(offset + before.get(found["run"], 0.0), rel=0.05)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Findings in the runs" in page
