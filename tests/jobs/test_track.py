"""The command ``track`` compares controllers in a table and a page, and rejects unsuitable inputs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.control.controllers import NAMES
from mrdamper.errors import InputError
from mrdamper.jobs.options import TrackOptions
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import LAWS
from mrdamper.registry import JOBS
from tests.support.cards import CHAIN, rig_damper, write_card_of
from tests.support.rigs import answer_of, mrdamper
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

SIZED = ["sized-sine-1Hz", "sized-sine-2Hz", "sized-non-periodic"]
PAPER = TrackOptions(controllers=("paper",), temperatures_degC=(20.0,))
SHORT = """
like = "sine-900N-1Hz"
duration_s = 2.0
temperature_degC = 60
"""


def track(card, options, *, out=None, **inputs):
    return JOBS["track"].perform({"card": card, **inputs}, options, out=out)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("track")
    write_card_of(place / "card.json")
    write_card_of(place / "cold.json", rig_damper(temperature_dependent=False))
    (place / "short.toml").write_text(SHORT, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def run(folder):
    options = TrackOptions(
        temperatures_degC=(20.0, 123.0),
        controllers=("recommended", "recommended-causal", "paper", "recommended-unaware", "paper-unaware"),
    )
    return track(folder / "card.json", options, targets=["sine-900N-1Hz"], unaware=folder / "cold.json")


def score(run, name, degrees):
    (found,) = (r.score for r in run.rows if r.controller == name and r.temperature_degC == degrees)
    return found


# --- Errors of controllers ----------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [20.0, 123.0])
def test_recommended_controller_beats_paper_controller(run, degrees):
    best, paper = score(run, "recommended", degrees), score(run, "paper", degrees)
    assert best.rmse_feasible_N < 0.5 * paper.rmse_feasible_N
    assert score(run, "recommended-causal", degrees).rmse_feasible_N < 1.3 * best.rmse_feasible_N


@pytest.mark.parametrize("name", ["recommended", "paper"])
def test_temperature_unaware_controller_is_worse_when_hot(run, name):
    """A controller that ignores temperature is equally accurate at 20 degC but not at 123 degC."""
    hot, hot_unaware = score(run, name, 123.0), score(run, f"{name}-unaware", 123.0)
    assert hot_unaware.rmse_feasible_N > 2.0 * hot.rmse_feasible_N
    cold, cold_unaware = score(run, name, 20.0), score(run, f"{name}-unaware", 20.0)
    assert cold_unaware.rmse_feasible_N == pytest.approx(cold.rmse_feasible_N, rel=0.1)


def test_tracking_summary_lists_largest_errors(run):
    for row in run.max_error_rows:
        each = [r.score for r in run.rows if r.controller == row.controller]
        assert row.score.max_N == max(s.max_N for s in each)
        assert row.score.rmse_feasible_N == max(s.rmse_feasible_N for s in each)


def test_controller_tracks_own_model_accurately(folder):
    """Only lag and noise cause errors if the damper is the model of the controller itself."""
    options = TrackOptions(controllers=("recommended",))
    itself = track(folder / "card.json", options, targets=[folder / "short.toml"], plant=folder / "card.json")
    real = track(folder / "card.json", options, targets=[folder / "short.toml"], plant="hard")
    assert itself.rows[0].temperature_degC == 60.0  # The scenario file sets the temperature.
    assert itself.rows[0].score.rmse_feasible_N < 0.5 * real.rows[0].score.rmse_feasible_N


def test_same_seed_gives_same_tracking_errors(folder):
    options = TrackOptions(controllers=("recommended",))
    rows = [
        track(folder / "card.json", replace(options, seed=seed), targets=[folder / "short.toml"]).rows
        for seed in (1, 1, 5)
    ]
    assert rows[0] == rows[1]
    assert rows[0] != rows[2]


@pytest.mark.nightly
def test_process_count_does_not_change_tracking(folder):
    found = [
        track(
            folder / "card.json",
            TrackOptions(temperatures_degC=(20.0, 123.0), controllers=("recommended", "paper"), jobs=jobs),
            targets=["sine-900N-1Hz"],
        )
        for jobs in (1, 2)
    ]
    assert found[0].rows == found[1].rows
    assert all(
        np.array_equal(one.force, other.force)
        for one, other in zip(found[0].traced[0].runs, found[1].traced[0].runs, strict=True)
    )


@pytest.mark.parametrize("times", one_by_day([0.05, 1.0, 20.0]))
def test_controller_tracks_damper_of_any_size(folder, times):
    """The relative error is limited because targets are proportional to the force of the damper."""
    path = write_card_of(folder / "other.json", rig_damper(force=times))
    found = track(path, PAPER, plant=path)
    assert found.targets == (["sine-900N-1Hz", "sine-1100N-2Hz", "non-periodic"] if times == 1.0 else SIZED)
    for each, row in zip(found.traced, found.rows, strict=True):
        assert row.score.rmse_feasible_N < 0.25 * np.sqrt(np.mean(each.course.target**2))


# --- Output of the command ----------------------------------------------------------------------------------


def test_track_writes_page_table_and_json(folder):
    answer = answer_of(
        mrdamper(
            "track", folder / "card.json", "--target", folder / "short.toml", "--temperature", 123,
            "--temperature", 20, "--out", folder / "out", "--json",
        )
    )  # fmt: skip
    assert {row["controller"] for row in answer["rows"]} == set(NAMES)
    assert {row["temperature_degC"] for row in answer["rows"]} == {20.0, 123.0}
    assert (answer["plant"], answer["seeds"]) == ("nominal", [1, 2])
    assert json.loads((folder / "out" / "track.json").read_text(encoding="utf-8")) == answer
    page = (folder / "out" / "track.html").read_text(encoding="utf-8")
    assert "simulation, not a measurement" in page
    assert page.count("<svg") == 2  # The figures show the errors at each temperature, and the target force.
    table = (folder / "out" / "track.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) == 1 + len(answer["rows"])


def test_terminal_shows_table_of_controllers(folder):
    done = mrdamper(
        "track", folder / "card.json", "--target", folder / "short.toml", "--controller", "paper",
        "--controller", "clipped-on-off",
    )  # fmt: skip
    assert done.returncode == 0
    assert "short on nominal, worst of 60 degC" in done.stdout
    assert "clipped-on-off" in done.stdout


def test_tracking_notes_list_missing_parts_of_card(folder):
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.02, 0.02), (293.15, 313.15))
    narrow = write_card_of(folder / "narrow.json", envelope=envelope)
    options = TrackOptions(controllers=("paper",))
    run = track(narrow, options, targets=[folder / "short.toml"], plant=folder / "card.json")
    notes = " ".join(run.notes)
    assert all(
        text in notes for text in ("degC; the card was", "mm/s; the card was", "the damper is the card")
    )
    cold = track(folder / "cold.json", options, targets=[folder / "short.toml"])
    assert any("does not know temperature" in note for note in cold.notes)


@pytest.mark.parametrize(("force", "noted"), [(1.0, False), (4.0, True)])
def test_note_reports_card_of_another_damper(folder, force, noted):
    path = write_card_of(folder / "strong.json", rig_damper(force=force))
    notes = track(path, TrackOptions(controllers=("paper",)), targets=[folder / "short.toml"]).notes
    assert any("the card is of another damper" in note for note in notes) == noted


def test_unattainable_default_targets_are_omitted(folder):
    """For two of three targets, the force without current exceeds the target most of the time."""
    strong = rig_damper(force=20.0)
    thick = replace(strong, coefficients={**strong.coefficients, "viscosity": Constant(1e6)})
    path = write_card_of(folder / "thick.json", thick)
    found = track(path, PAPER, plant=path)
    assert 0 < len(found.targets) < 3
    assert any(note.startswith("left out") for note in found.notes)


# --- Rejected inputs --------------------------------------------------------------------------------------


def refused(folder, *arguments, card="card.json"):
    done = mrdamper("track", folder / card, *arguments)
    assert done.returncode == 3
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    return done.stderr


def test_mostly_unattainable_target_is_rejected(folder):
    target = 'kind = "sine"\namplitude_N = 900\nfrequency_Hz = 1\nphase_deg = 180\n'
    (folder / "against.toml").write_text(f"[target]\n{target}", encoding="utf-8")
    message = refused(folder, "--target", folder / "against.toml")
    assert "target 'against': feasible only 4 % of the time on the damper 'nominal' at 20 degC" in message


def test_card_without_lag_model_is_rejected(folder):
    """The paper's controllers accept such a card because they use no lag model."""
    write_card_of(folder / "unlagged.json", rig_damper(lag=None))
    message = refused(folder, card="unlagged.json")
    assert "unlagged.json: has no actuation, so recommended, recommended-causal" in message
    write_card_of(folder / "implicit.json", replace(CHAIN, actuation=None))
    assert "such as --controller clipped-on-off" in refused(folder, card="implicit.json")
    options = TrackOptions(controllers=("paper",))
    assert track(folder / "unlagged.json", options, targets=[folder / "short.toml"]).rows


def test_card_without_current_dependence_is_rejected(folder):
    forms = {"viscosity": Constant(2000.0), "yield_force": Constant(500.0), "rho": Constant(3000.0)}
    write_card_of(folder / "still.json", Damper(LAWS["dahl"], forms))
    message = "still.json: its force does not depend on the current"
    assert message in refused(folder, card="still.json")
    assert message in refused(folder, "--plant", folder / "still.json")


def test_target_beyond_stroke_of_card_is_rejected(folder):
    """A named target with a longer stroke is rejected. Default targets stay within the stroke of the card."""
    envelope = OperatingEnvelope((0.0, 2.0), (-0.003, 0.003), (-0.04, 0.04), (293.15, 393.15))
    small = write_card_of(folder / "small.json", envelope=envelope)
    assert "its data cover -3 to 3 mm" in refused(folder, card="small.json")
    assert "its data cover -3 to 3 mm" in refused(folder, "--plant", small, "--target", "sine-900N-1Hz")
    itself = track(small, PAPER, plant=small)
    assert itself.targets == SIZED
    for each in itself.traced:
        assert np.abs(each.course.displacement).max() <= 0.003
        assert np.abs(each.course.velocity).max() <= 0.04


def test_rejected_tracking_job_writes_nothing(folder):
    with pytest.raises(InputError):
        track(folder / "card.json", TrackOptions(), plant="none", out=folder / "never")
    assert not (folder / "never").exists()
