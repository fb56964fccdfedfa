"""A tempered campaign through the command line: rig, identify, predict; what is refused, and how."""

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
temperatures_degC = [20, 60, 90, 120]
held_out_temperatures_degC = [90]
held_out_motions = []
duration_s = 2.0
"""
HOTTER = """
motions = ["sine5mm1Hz"]
currents_A = [1, 2]
temperatures_degC = [60, 140]
held_out_temperatures_degC = []
held_out_motions = []
duration_s = 2.0
steps = false
"""
TEMPERED = ("viscosity", "yield_force")
"""What follows temperature in any law that is fitted to such runs."""
LAW = ("--law", "double-bouc-wen")  # how one is chosen is told elsewhere, and takes ten times as long


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
    """Identify what the rig wrote, held out as the rig says."""
    hold_out = [word for pattern in measured["hold_out"] for word in ("--hold-out", pattern)]
    return answer_of(mrdamper("fit", folder / "runs", *hold_out, *LAW, "--out", folder / "out", "--json"))


def changed(folder: Path, into: Path, change: Callable[[dict[str, str]], None], glob: str = "*.csv") -> Path:
    """Write the runs again, the rows of those that match changed; columns may go or be renamed."""
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


def degrees(row: dict[str, str], to: Callable[[float], float], unit: str = "degC") -> None:
    value = to(float(row.pop("temperature_degC")))
    row[f"temperature_{unit}"] = f"{value:.2f}"


# -------------------------------------------------------------------------------- the way through


@pytest.mark.nightly
def test_what_the_rig_holds_out_is_what_identify_holds_out(measured, identified):
    held = {run["name"] for run in measured["runs"] if run["held_out"]}
    assert {run["name"] for run in identified["runs"] if run["split"] == "held_out"} == held
    assert held
    assert all("_090C_" in name for name in held)


def test_every_run_has_its_error_and_the_temperature_it_was_soaked_at(measured, identified):
    soaked = {run["name"]: run["temperature_degC"] for run in measured["runs"]}
    assert len(identified["runs"]) == len(soaked) == 28
    for run in identified["runs"]:
        assert run["temperature_degC"] == pytest.approx(soaked[run["name"]], abs=0.1)
        assert 0.0 < run["rmse_N"] < 100.0


def test_a_temperature_between_the_trained_ones_is_predicted_as_well_as_they_are(identified):
    def rmse(split: str) -> float:
        rows = [run for run in identified["runs"] if run["split"] == split and run["current_A"] is not None]
        return float(np.sqrt(np.mean([run["rmse_N"] ** 2 for run in rows])))

    assert rmse("held_out") <= 1.15 * rmse("training")


def test_the_card_says_at_which_temperatures_it_holds_and_how_coefficients_follow_them(identified):
    card = json.loads(Path(identified["card"]).read_text(encoding="utf-8"))
    low, high = card["envelope"]["temperature_K"]
    assert (low - 273.15, high - 273.15) == pytest.approx((20.0, 120.0), abs=0.1)
    assert card["coefficients"]["viscosity"]["temperature"] == {"kind": "arrhenius", "assumed": False}
    activation = card["coefficients"]["viscosity"]["numbers"]["activation_K"]
    assert activation["unit"] == "K"
    assert activation["standard_error"] > 0.0
    assert "assumed" not in card["notes"]


def test_the_card_carries_the_actuation_that_the_steps_told(identified):
    """The rig's driver, eddy currents and fluid take 13.5 ms to 63 %; a lag can only be late."""
    card = read_card(Path(identified["card"]))
    actuation = card.damper.actuation
    assert actuation is not None
    assert actuation.largest_command == 2.0
    assert 0.010 < actuation.response_time(0.63) < 0.020


def test_runs_outside_the_card_s_temperatures_are_told_once_with_numbers(identified, tmp_path):
    (tmp_path / "hotter.toml").write_text(HOTTER, encoding="utf-8")
    campaign, runs = tmp_path / "hotter.toml", tmp_path / "hotter"
    assert mrdamper("rig", "--campaign", campaign, "--out", runs).returncode == 0
    ended = mrdamper("evaluate", identified["card"], runs, "--json")
    answer = json.loads(ended.stdout)
    assert ended.returncode == 0
    assert len(answer["runs"]) == 4
    (note,) = answer["notes"]
    for part in ("140", "2 of 4 runs", "identified on", "120 degC", "edge"):
        assert part in note


# -------------------------------------------------------------------------------- without temperature


@pytest.mark.nightly
def test_temperature_none_leaves_it_out_of_every_coefficient(folder, identified, tmp_path):
    """The price is the spread of the force over the temperatures."""
    law = identified["law"]
    ended = mrdamper(
        *("fit", folder / "runs", "--hold-out", "*_090C_*", "--law", law),
        *("--temperature", "none", "--out", tmp_path / "out", "--json"),
    )
    assert ended.returncode == 0, ended.stderr
    card = json.loads((tmp_path / "out" / "card.json").read_text(encoding="utf-8"))
    assert not any("temperature" in form for form in card["coefficients"].values())
    assert json.loads(ended.stdout)["cost_percent"] > 2.0 * identified["cost_percent"]


def test_one_temperature_is_enough_when_temperature_is_left_out(folder, identified, tmp_path):
    place = some(folder, tmp_path / "cold", "*_020C_*")
    ended = mrdamper("fit", place, "--temperature", "none", "--law", "bouc-wen", "--out", tmp_path / "out")
    assert ended.returncode == 0, ended.stderr


def test_a_fluid_s_laws_are_marked_as_assumed_wherever_they_are(folder, identified, tmp_path):
    place = changed(folder, tmp_path / "plain", without_temperature)
    for path in place.iterdir():
        if "_020C_" not in path.name:
            path.unlink()
    ended = mrdamper(
        *("fit", place, "--law", "bouc-wen", "--fluid", "paper", "--out", tmp_path / "out", "--json"),
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


# -------------------------------------------------------------------------------- what is refused


def refused(ended: CompletedProcess[str], *parts: str) -> None:
    """One message, exit code 3, nothing on standard output, and each part of it said."""
    assert ended.returncode == 3, ended.stdout + ended.stderr
    assert ended.stdout == ""
    assert ended.stderr.startswith("mrdamper: ")
    for part in parts:
        assert part in ended.stderr


def test_one_temperature_names_the_coefficients_and_the_missing_tests(folder, measured, tmp_path):
    place = some(folder, tmp_path / "cold", "*_020C_*")
    refused(
        mrdamper("fit", place, "--temperature", "arrhenius", "--out", tmp_path / "out", "--json"),
        *("1 temperature (20 degC)", *TEMPERED, "cannot be identified", "2 or more temperatures", "--fluid"),
    )
    assert not (tmp_path / "out").exists()


def test_two_temperatures_are_too_few_for_a_law_with_a_pole(folder, measured, tmp_path):
    place = some(folder, tmp_path / "two", "*_020C_*", "*_060C_*")
    refused(
        mrdamper("fit", place, "--temperature", "vft", "--out", tmp_path / "out"),
        *("2 temperatures (20, 60 degC)", "viscosity", "vft", "3 or more temperatures"),
    )


def test_runs_at_one_temperature_are_fitted_without_temperature_laws_and_it_is_said(
    folder, measured, tmp_path
):
    place = changed(folder, tmp_path / "stuck", lambda row: row.update(temperature_degC="23.0"))
    ended = mrdamper("fit", place, *LAW, "--out", tmp_path / "out", "--json")
    assert ended.returncode == 0, ended.stderr
    (said,) = (note for note in json.loads(ended.stdout)["notes"] if "one temperature" in note)
    assert said == "one temperature in the runs (23 degC): fitted without temperature laws"


def test_one_current_names_the_coefficients_and_the_missing_tests(folder, measured, tmp_path):
    place = some(folder, tmp_path / "one", "*_1.00A_*")
    refused(
        mrdamper("fit", place, "--out", tmp_path / "out"),
        *("one command (1 A)", "yield_force", "viscosity", "cannot be identified", "two or more"),
    )


@pytest.mark.parametrize(
    ("to", "unit", "first", "looks"),
    [
        (lambda value: value + 273.15, "degC", "020", "K given as degC"),
        (lambda value: value, "K", "020", "degC given as K"),
        (lambda value: 1.8 * value + 32.0, "degC", "090", "degF given as degC"),
    ],
    ids=["kelvin as degC", "degC as kelvin", "degF as degC"],
)
def test_a_wrong_unit_of_temperature_is_found_where_no_damper_is_so_warm(
    folder, measured, tmp_path, to, unit, first, looks
):
    """Fahrenheit is found by the runs at 90 and 120 degC, 194 and 248 on its scale; colder could be."""
    place = changed(folder, tmp_path / "wrong", lambda row: degrees(row, to, unit))
    refused(
        mrdamper("fit", place, "--out", tmp_path / "out"),
        *(f"nominal_{first}C_0-2A_steps: temperature is", looks, "check the column's unit"),
    )


@pytest.mark.parametrize(
    ("displacement_m", "found"),
    [(lambda _: 1e-3, "never changes"), (lambda k: 1e-5 * np.sin(k * k), "keeps still")],
    ids=["constant", "noise"],
)
def test_a_run_without_motion_is_named_with_what_it_cannot_tell(
    folder, measured, tmp_path, displacement_m, found
):
    counted = iter(range(10_000))

    def hold(row: dict[str, str]) -> None:
        row["displacement_m"] = f"{displacement_m(next(counted)):.7f}"

    place = changed(folder, tmp_path / "still", hold, "*_060C_1.00A_sine5mm1Hz.csv")
    refused(
        mrdamper("fit", place, "--out", tmp_path / "out"),
        *("nominal_060C_1.00A_sine5mm1Hz", found, "neither viscosity nor yield force", "a sine of 5 mm"),
    )


@pytest.mark.nightly
def test_runs_without_a_temperature_beside_ones_that_have_it_are_left_out_and_it_is_said(
    folder, measured, tmp_path
):
    place = changed(folder, tmp_path / "some", without_temperature, "*_060C_*.csv")
    for path in tuple(place.glob("*_060C_*.csv")):  # nor may its name tell the temperature
        path.rename(path.with_name(path.name.replace("_060C_", "_warm_")))
    refused(
        mrdamper("fit", place, "--temperature", "arrhenius", "--out", tmp_path / "out"),
        *("runs have no temperature channel", "nominal_warm_", "--temperature none"),
    )
    ended = mrdamper("fit", place, *LAW, "--out", tmp_path / "out", "--json")
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert any("have no temperature: they are left out" in note for note in found["notes"])
    assert not any("_warm_" in row["name"] for row in found["runs"])


def test_a_temperature_without_a_unit_is_asked_for_it(folder, measured, tmp_path):
    place = changed(
        folder, tmp_path / "unit", lambda row: row.update(temperature=row.pop("temperature_degC"))
    )
    refused(mrdamper("fit", place, "--out", tmp_path / "out"), "temperature has no unit", "K, degC, degF")
