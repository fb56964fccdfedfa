"""The command ``rig`` writes runs at several temperatures, and ``fit`` identifies a card from them."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any

import numpy as np
import pytest

from mrdamper.models.card_schema import read_card
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system

CAMPAIGN = """
motions = ["sine5mm1Hz", "sine3mm2Hz"]
currents_A = [0, 1, 2]
temperatures_degC = [20, 90, 120]
held_out_temperatures_degC = [90]
held_out_motions = []
duration_s = 2.0
"""
TEMPERED = ("viscosity", "yield_force")
"""Coefficients that depend on temperature in each law that is fitted to runs at several temperatures."""
# Selecting the law takes ten times as long and has separate tests.
LAW = ("--law", "bouc-wen", "--term", "none")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place: Path = tmp_path_factory.mktemp("tempered")
    (place / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def measured(folder) -> dict[str, Any]:
    return answer_of(
        mrdamper("rig", "--campaign", folder / "campaign.toml", "--out", folder / "runs", "--json")
    )


@pytest.fixture(scope="module")
def identified(folder, measured) -> dict[str, Any]:
    """Fit the runs of the rig, except the runs that the rig proposes to hold out."""
    hold_out = [word for pattern in measured["hold_out"] for word in ("--hold-out", pattern)]
    return answer_of(mrdamper("fit", folder / "runs", *hold_out, *LAW, "--out", folder / "out", "--json"))


def changed(folder: Path, into: Path, change: Callable[[dict[str, str]], None], glob: str = "*.csv") -> Path:
    """Copy runs to another folder and change their rows. ``change`` may also remove or rename columns."""
    into.mkdir()
    for path in sorted((folder / "runs").glob("*.csv")):
        if not path.match(glob):
            shutil.copy(path, into)
            continue
        with path.open(encoding="utf-8") as stream:
            label = stream.readline()
            rows = list(csv.DictReader(stream))
        for row in rows:
            change(row)
        with (into / path.name).open("w", encoding="utf-8", newline="") as stream:
            stream.write(label)
            writer = csv.DictWriter(stream, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    return into


def some(folder: Path, into: Path, *globs: str) -> Path:
    into.mkdir()
    for glob in globs:
        for path in (folder / "runs").glob(glob):
            shutil.copy(path, into)
    return into


def without_temperature(row: dict[str, str]) -> None:
    del row["temperature_degC"]


# -------------------------------------------------------------------------------- fit of the rig's runs


@pytest.mark.nightly
def test_fit_holds_out_proposed_runs(measured, identified):
    held = {run["name"] for run in measured["runs"] if run["held_out"]}
    assert {run["name"] for run in identified["runs"] if run["split"] == "held_out"} == held
    assert held
    assert all("_090C_" in name for name in held)


def test_fit_reports_errors_and_temperatures(measured, identified):
    soaked = {run["name"]: run["temperature_degC"] for run in measured["runs"]}
    assert len(identified["runs"]) == len(soaked) == 21
    for run in identified["runs"]:
        assert run["temperature_degC"] == pytest.approx(soaked[run["name"]], abs=0.1)
        assert 0.0 < run["rmse_N"] < 100.0


def test_fit_is_accurate_at_held_out_temperature(identified):
    def rmse(split: str) -> float:
        rows = [run for run in identified["runs"] if run["split"] == split and run["current_A"] is not None]
        return float(np.sqrt(np.mean([run["rmse_N"] ** 2 for run in rows])))

    assert rmse("held_out") <= 1.15 * rmse("training")


def test_card_has_temperature_range_and_dependence(identified):
    card = json.loads(Path(identified["card"]).read_text(encoding="utf-8"))
    low, high = card["envelope"]["temperature_K"]
    assert (low - 273.15, high - 273.15) == pytest.approx((20.0, 120.0), abs=0.1)
    assert card["coefficients"]["viscosity"]["temperature"] == {"kind": "arrhenius", "assumed": False}
    activation = card["coefficients"]["viscosity"]["numbers"]["activation_K"]
    assert activation["unit"] == "K"
    assert activation["standard_error"] > 0.0
    assert "assumed" not in card["notes"]


def test_card_has_response_time_of_current(identified):
    """The virtual damper needs 13.5 ms for 63 % of a force change. The fit finds 10 to 20 ms."""
    card = read_card(Path(identified["card"]))
    actuation = card.damper.actuation
    assert actuation is not None
    assert actuation.largest_command == 2.0
    assert 0.010 < actuation.response_time(0.63) < 0.020


# --------------------------------------------------------------------- assumed temperature dependence


def test_card_marks_temperature_dependence_as_assumed(folder, identified, tmp_path):
    place = changed(folder, tmp_path / "plain", without_temperature)
    for path in place.iterdir():
        if "_020C_" not in path.name:
            path.unlink()
    ended = mrdamper(
        *("fit", place, *LAW, "--fluid", "paper", "--out", tmp_path / "out", "--json"),
    )
    assert ended.returncode == 0, ended.stderr
    card = json.loads((tmp_path / "out" / "card.json").read_text(encoding="utf-8"))
    for name in TEMPERED:
        assert card["coefficients"][name]["temperature"]["assumed"] is True
        assert name in card["notes"]["assumed"]
    assert card["coefficients"]["viscosity"]["numbers"]["activation_K"]["value"] == pytest.approx(1435.5)
    assert card["coefficients"]["viscosity"]["numbers"]["activation_K"]["standard_error"] is None
    assert "assumed" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8").lower()
    assert card["envelope"]["temperature_K"] is None or np.ptp(card["envelope"]["temperature_K"]) == 0.0


# -------------------------------------------------------------------------------- rejected inputs


def refused(ended: CompletedProcess[str], *parts: str) -> None:
    """Check that a command ended with exit code 3, no output, and a message that contains ``parts``."""
    assert ended.returncode == 3, ended.stdout + ended.stderr
    assert ended.stdout == ""
    assert ended.stderr.startswith("mrdamper: ")
    for part in parts:
        assert part in ended.stderr


def test_message_about_single_temperature_names_missing_tests(folder, measured, tmp_path):
    place = some(folder, tmp_path / "cold", "*_020C_*")
    refused(
        mrdamper("fit", place, "--temperature", "arrhenius", "--out", tmp_path / "out", "--json"),
        *("1 temperature (20 degC)", *TEMPERED, "cannot be identified", "2 or more temperatures", "--fluid"),
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.nightly
def test_fit_reports_missing_temperature_dependence(folder, measured, tmp_path):
    place = changed(folder, tmp_path / "stuck", lambda row: row.update(temperature_degC="23.0"))
    for path in place.iterdir():
        if "_020C_" not in path.name:
            path.unlink()
    ended = mrdamper("fit", place, *LAW, "--out", tmp_path / "out", "--json")
    assert ended.returncode == 0, ended.stderr
    (said,) = (note for note in json.loads(ended.stdout)["notes"] if "one temperature" in note)
    assert said == "one temperature in the runs (23 degC): fitted without temperature laws"
