"""``mrdamper track``: rows, their order of merit, the page, and one message for whatever cannot be."""

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
from tests.support.rigs import answer_of, mrdamper
from tests.support.tracked import a_damper, write_a_card

pytestmark = pytest.mark.system

KEYS = {
    "controller", "target", "plant", "temperature_degC", "max_N", "rmse_N", "max_feasible_N",
    "rmse_feasible_N", "feasible_share", "coil_power_W", "chatter_A_per_s",
}  # fmt: skip
SIZED = ["sized-sine-1Hz", "sized-sine-2Hz", "sized-non-periodic"]
SHORT = """
like = "sine-900N-1Hz"
duration_s = 2.0
temperature_degC = 60
"""


def track(card, options, *, out=None, **inputs):
    """Return what the job finds."""
    return JOBS["track"].perform({"card": card, **inputs}, options, out=out)[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("track")
    write_a_card(place / "card.json")
    write_a_card(place / "cold.json", a_damper(temperature_dependent=False))
    (place / "short.toml").write_text(SHORT, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def run(folder):
    options = TrackOptions(
        temperatures_degC=(20.0, 123.0),
        controllers=("recommended", "recommended-causal", "paper", "recommended-unaware", "paper-unaware"),
    )
    return track(folder / "card.json", options, targets=["sine-900N-1Hz"], unaware=folder / "cold.json")


def figures(run, name, degrees):
    found = [r.score for r in run.rows if r.controller == name and r.temperature_degC == degrees]
    assert len(found) == 1
    return found[0]


def feasible(run):
    return run.rows[0].score.rmse_feasible_N


def test_looking_ahead_beats_the_paper_and_the_causal_form_comes_near(run):
    for degrees in (20.0, 123.0):
        best, paper = figures(run, "recommended", degrees), figures(run, "paper", degrees)
        causal = figures(run, "recommended-causal", degrees)
        assert best.rmse_feasible_N < 0.5 * paper.rmse_feasible_N
        assert causal.rmse_feasible_N < 1.3 * best.rmse_feasible_N


def test_not_knowing_temperature_costs_most_where_it_is_far_from_what_was_identified(run):
    for name in ("recommended", "paper"):
        hot, hot_blind = figures(run, name, 123.0), figures(run, f"{name}-unaware", 123.0)
        assert hot_blind.rmse_feasible_N > 2.0 * hot.rmse_feasible_N
    cold_blind, cold_aware = (figures(run, n, 20.0) for n in ("recommended-unaware", "recommended"))
    assert cold_blind.rmse_feasible_N == pytest.approx(cold_aware.rmse_feasible_N, rel=0.1)


def test_the_feasible_share_is_the_damper_s_and_not_the_controller_s(run):
    for degrees in (20.0, 123.0):
        assert len({r.score.feasible_share for r in run.rows if r.temperature_degC == degrees}) == 1


def test_the_summary_is_the_worst_of_the_temperatures(run):
    for row in run.worst:
        each = [r.score for r in run.rows if r.controller == row.controller]
        assert row.score.max_N == max(s.max_N for s in each)
        assert row.score.rmse_feasible_N == max(s.rmse_feasible_N for s in each)


def test_a_card_tracked_on_itself_leaves_lag_and_noise_alone(folder):
    """Model error is the rest: on the virtual damper the same controllers do worse."""
    options = TrackOptions(controllers=("recommended",))
    itself = track(folder / "card.json", options, targets=[folder / "short.toml"], plant=folder / "card.json")
    real = track(folder / "card.json", options, targets=[folder / "short.toml"], plant="hard")
    assert itself.rows[0].temperature_degC == 60.0  # the file's own
    assert feasible(itself) < 0.5 * feasible(real)
    assert any("what a law leaves out" in note for note in itself.notes)


def test_the_same_seed_gives_the_same_rows_and_another_pair_does_not(folder):
    options = TrackOptions(controllers=("recommended",))
    rows = [
        track(folder / "card.json", replace(options, seed=seed), targets=[folder / "short.toml"]).rows
        for seed in (1, 1, 5)
    ]
    assert rows[0] == rows[1]
    assert rows[0] != rows[2]


def test_the_rows_do_not_depend_on_the_number_of_jobs(folder):
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


def test_the_command_writes_its_page_and_prints_the_rows(folder):
    answer = answer_of(
        mrdamper(
            "track", folder / "card.json", "--target", folder / "short.toml", "--temperature", 123,
            "--temperature", 20, "--out", folder / "out", "--json",
        )
    )  # fmt: skip
    assert {row["controller"] for row in answer["rows"]} == set(NAMES)
    assert all(row.keys() >= KEYS for row in answer["rows"])
    assert {row["temperature_degC"] for row in answer["rows"]} == {20.0, 123.0}
    assert answer["plant"] == "nominal"
    assert answer["seeds"] == [1, 2]
    hot = next(r for r in answer["rows"] if r["controller"] == "paper" and r["temperature_degC"] == 123.0)
    assert hot["coil_power_W"] > 0.0
    assert json.loads((folder / "out" / "track.json").read_text(encoding="utf-8")) == answer
    page = (folder / "out" / "track.html").read_text(encoding="utf-8")
    assert "fingerprint of its training runs" in page  # what it was made from, at the end
    assert "mrdamper 0." in page
    assert "simulations, not measurements" in page
    assert page.count("<svg") == 2  # over temperature, and the target
    assert "http" not in page.replace("http://www.w3.org", "")
    table = (folder / "out" / "track.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) == 1 + len(answer["rows"])


def test_a_terminal_gets_a_table_per_target(folder):
    done = mrdamper(
        "track", folder / "card.json", "--target", folder / "short.toml", "--controller", "paper",
        "--controller", "clipped-on-off",
    )  # fmt: skip
    assert done.returncode == 0
    assert "short on nominal: worst of 60 degC" in done.stdout
    assert "clipped-on-off" in done.stdout
    assert "within" in done.stdout
    assert "noise seeds 1 and 2, the worse of the two" in done.stdout


# ------------------------------------------------------------------------------------- what cannot be


def refused(folder, *arguments, card="card.json"):
    done = mrdamper("track", folder / card, *arguments)
    assert done.returncode == 3
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    return done.stderr


def test_a_target_out_of_reach_says_how_much_of_it(folder):
    target = 'kind = "sine"\namplitude_N = 900\nfrequency_Hz = 1\nphase_deg = 180\n'
    (folder / "against.toml").write_text(f"[target]\n{target}", encoding="utf-8")
    said = refused(folder, "--target", folder / "against.toml")
    assert "target 'against': feasible only 4 % of the time on the damper 'nominal' at 20 degC" in said
    assert "0 to 2 A give up to about" in said
    assert "expected at least 50 %" in said


def test_a_card_without_actuation_names_the_test_that_is_missing(folder):
    write_a_card(folder / "unlagged.json", a_damper(lag=None))
    said = refused(folder, card="unlagged.json")
    assert "unlagged.json: has no actuation, so recommended, recommended-causal" in said
    assert "`steps`" in said
    options = TrackOptions(controllers=("paper",))  # it needs none
    assert track(folder / "unlagged.json", options, targets=[folder / "short.toml"]).rows


def test_a_card_that_does_not_depend_on_the_current_is_refused(folder):
    forms = {"viscosity": Constant(2000.0), "yield_force": Constant(500.0), "rho": Constant(3000.0)}
    write_a_card(folder / "still.json", Damper(LAWS["dahl"], forms))
    assert "still.json: its force does not depend on the current (data from 0 to 2 A)" in refused(
        folder, card="still.json"
    )
    # and so for a card that is the damper
    said = refused(folder, "--plant", folder / "still.json")
    assert said.count("the plant ") == 1
    assert "still.json: its force does not depend on the current" in said


def test_a_stroke_beyond_the_card_is_refused(folder):
    envelope = OperatingEnvelope((0.0, 2.0), (-0.003, 0.003), (-0.04, 0.04), (293.15, 393.15))
    write_a_card(folder / "small.json", envelope=envelope)
    said = refused(folder, card="small.json")
    assert (
        "small.json: its data cover -3 to 3 mm, and the target 'sine-900N-1Hz' moves over -5 to 5 mm" in said
    )
    # and so for a card that is the damper
    said = refused(folder, "--plant", folder / "small.json", "--target", "sine-900N-1Hz")
    assert "its data cover -3 to 3 mm" in said
    # which without a target is asked for what it can do
    options = TrackOptions(controllers=("paper",), temperatures_degC=(20.0,))
    itself = track(folder / "small.json", options, plant=folder / "small.json")
    assert itself.targets == SIZED
    for each in itself.traced:
        assert np.abs(each.course.displacement).max() <= 0.003
        assert np.abs(each.course.velocity).max() <= 0.04


@pytest.mark.parametrize(
    ("times", "targets"),
    [(0.05, SIZED), (1.0, ["sine-900N-1Hz", "sine-1100N-2Hz", "non-periodic"]), (20.0, SIZED)],
)
def test_a_card_of_any_size_is_tracked_on_itself(folder, times, targets):
    """Targets are shares of its own force, so it is followed as well as a damper of another size."""
    options = TrackOptions(controllers=("paper",), temperatures_degC=(20.0,))
    path = write_a_card(folder / "other.json", a_damper(force=times))
    found = track(path, options, plant=path)
    assert found.targets == targets
    for each, row in zip(found.traced, found.rows, strict=True):
        assert row.score.rmse_feasible_N < 0.25 * np.sqrt(np.mean(each.course.target**2))
    assert not found.notes[:-1]  # but that the plant is a card


def test_a_card_of_another_damper_is_told(folder):
    options = TrackOptions(controllers=("paper",))
    for name, force, told in (("card.json", 1.0, False), ("strong.json", 4.0, True)):
        path = write_a_card(folder / name, a_damper(force=force))
        notes = track(path, options, targets=[folder / "short.toml"]).notes
        assert any("the card is of another damper" in note for note in notes) == told


def test_of_targets_of_its_own_size_those_out_of_reach_are_left_out_and_told(folder):
    """Its least force, of the viscosity, is above most of what two of the three want."""
    strong = a_damper(force=20.0)
    thick = replace(strong, coefficients={**strong.coefficients, "viscosity": Constant(1e6)})
    path = write_a_card(folder / "thick.json", thick)
    options = TrackOptions(controllers=("paper",), temperatures_degC=(20.0,))
    found = track(path, options, plant=path)
    assert 0 < len(found.targets) < 3
    assert "feasible only" in " ".join(note for note in found.notes if note.startswith("left out"))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--plant", "nominl"), "there is no plant 'nominl'; did you mean nominal?"),
        (("--target", "sine-900N"), "there is no target 'sine-900N'; did you mean sine-900N-1Hz"),
        (("--controller", "recomended"), "there is no controller 'recomended'; did you mean recommended"),
        (("--controller", "recommended-pooled"), "It is made from another card: --pooled CARD"),
        (
            ("--controller", "series-inverse"),
            "is made from cards of the series-valve law, and",
        ),
        (("--temperature", "293.15"), "temperature_degC is 293.15; expected a number in degC, -40 to 200"),
        (("--target", "nowhere.toml"), "nowhere.toml: cannot read the scenario"),
        (("--plant", "nowhere.toml"), "nowhere.toml"),
        (("--plant", "{folder}/card.json", "--draw", 3), "is a card; --draw 3 draws around a virtual damper"),
        (("--target", "{folder}/short.toml", "--target", "{folder}/a/short.toml"), "have the same name"),
    ],
)
def test_what_is_not_known_is_refused(folder, arguments, said):
    (folder / "a").mkdir(exist_ok=True)
    (folder / "a/short.toml").write_text(SHORT.replace("2.0", "3.0"), encoding="utf-8")
    assert said in refused(folder, *(str(each).format(folder=folder) for each in arguments))


def test_what_lies_beyond_the_card_is_said(folder):
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.02, 0.02), (293.15, 313.15))
    write_a_card(folder / "narrow.json", envelope=envelope)
    options = TrackOptions(controllers=("paper",))
    run = track(folder / "narrow.json", options, targets=[folder / "short.toml"], plant=folder / "card.json")
    notes = " ".join(map(str, run.notes))
    assert "60 degC: beyond the card's data (20 to 40 degC), the edge is held" in notes
    assert "the card's data end at 20 mm/s" in notes
    assert "what a law leaves out of a damper is left out here, too" in notes
    cold = track(folder / "cold.json", options, targets=[folder / "short.toml"])
    assert "the card does not know temperature: all of its controllers are unaware of it" in " ".join(
        map(str, cold.notes)
    )


def test_a_card_in_volts_is_refused(folder):
    write_a_card(folder / "volts.json", replace(a_damper(), command_unit="V"))
    assert "volts.json: its command is in V; expected amperes" in refused(folder, card="volts.json")


def test_nothing_is_left_behind_by_a_refusal(folder):
    with pytest.raises(InputError):
        track(folder / "card.json", TrackOptions(), plant="none", out=folder / "never")
    assert not (folder / "never").exists()
