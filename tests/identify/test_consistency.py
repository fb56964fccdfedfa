"""Campaign consistency: one wrong run is found among sound ones, by cause and size; sound ones are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrdamper
from mrdamper.data.diagnosis.declared import find_against_names, find_odd_siblings
from mrdamper.data.diagnosis.plausible import find_implausible_damper
from mrdamper.data.readers import ReadFiles
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.identify.consistency.joint import joint_test
from mrdamper.identify.consistency.runs import consistency
from mrdamper.jobs.check import check
from mrdamper.jobs.options import CheckOptions
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import find_preset

PLAN = Campaign(
    motions=("sine5mm1Hz", "sine3mm2Hz", "sine15mm1Hz"),
    currents_A=(0.0, 0.5, 1.0, 1.5, 2.0),
    temperatures_degC=(20.0,),
    held_out_motions=(),
    held_out_temperatures_degC=(),
    steps=None,
)
WRONG = "nominal_020C_1.50A_sine3mm2Hz"


@pytest.fixture(scope="module")
def runs():
    return [run for run, _ in measure(find_preset("nominal"), PLAN, seed=3)]


def with_one(runs, change):
    return [change(run) if run.name == WRONG else run for run in runs]


def late(run):
    return replace(run, force=np.interp(run.time - 3e-3, run.time, run.force))


def told(runs):
    """Return the findings of the whole of ``check --deep`` above notes."""
    found = check(ReadFiles((), (), tuple(runs)), CheckOptions(deep=True)).findings
    return {each.run: each for each in found if each.severity != "note"}


def test_a_sound_campaign_is_not_blamed(runs):
    assert told(runs) == {}


def test_one_run_that_is_off_is_named_with_cause_and_size(runs):
    finding = told(with_one(runs, late))[WRONG]
    assert finding.kind == "force_delay"
    assert finding.size == pytest.approx(3e-3, rel=0.25)
    assert finding.low < finding.size < finding.high


@pytest.fixture(scope="module")
def series():
    """Return four series, one for each current, in which each run has a motion of its own."""
    found = []
    for k, current in enumerate((0.0, 0.7, 1.4, 2.0)):
        motions = ((20, 0.5 + 0.03 * k), (17, 0.7 + 0.02 * k), (13, 0.9 - 0.02 * k), (9 + k, 1.1 + 0.05 * k))
        plan = replace(
            PLAN, motions=tuple(f"sine:{a}mm:{f:.2f}Hz" for a, f in motions), currents_A=(current,)
        )
        measured = [run for run, _ in measure(find_preset("nominal"), plan, seed=k)]
        found += [replace(run, name=f"{current:g}A {j}", source="") for j, run in enumerate(measured)]
    return found


def test_a_wrong_run_at_the_end_of_a_series_is_named_and_not_its_neighbours(series):
    """The fit follows it there and leaves sound runs: the fits without each of the doubted ones tell."""
    wrong = "1.4A 3"
    assert joint_test(series) == []
    broken = [replace(run, force=0.7 * run.force) if run.name == wrong else run for run in series]
    (finding,) = joint_test(broken)
    assert (finding.run, finding.kind) == (wrong, "force_gain")
    assert finding.size == pytest.approx(0.7, abs=0.01)


def test_what_half_of_the_runs_have_is_told_of_the_campaign(runs):
    def shifted(run, by):
        return replace(run, force=np.interp(run.time - by, run.time, run.force))

    finding = told([shifted(run, 15e-3 * (k < 5)) for k, run in enumerate(runs)])[""]
    assert finding.kind == "group_delay"
    assert finding.size == pytest.approx(13e-3, abs=3e-3)


def test_a_time_that_is_scaled_is_told_by_the_other_runs_of_the_motion(runs):
    slow = with_one(runs, lambda run: replace(run, time=1.04 * run.time))
    (finding,) = find_odd_siblings(slow)
    assert (finding.run, finding.kind) == (WRONG, "time_scale")
    assert finding.size == pytest.approx(1.04, abs=2e-3)


def test_names_are_compared_with_signals(runs):
    assert list(find_against_names(runs)) == []
    tenth = [replace(run, command=0.1 * run.command) for run in runs]
    assert {each.kind for each in find_against_names(tenth)} == {"declared_command"}
    inches = [replace(run, displacement=run.displacement / 25.4) for run in runs]
    assert {each.kind for each in find_against_names(inches)} == {"declared_stroke"}


def test_a_plan_beside_the_runs_is_compared_with_their_signals(runs, tmp_path):
    """A plan goes before names; what it does not say, and runs that keep to it, are no finding."""
    (tmp_path / "plan.toml").write_text(
        '[run."*_1.50A_*"]\ncommand = 1.5\n[run.third]\nstroke_mm = 12.0\nfrequency_Hz = 2\n'
    )
    placed = [replace(run, source=str(tmp_path / f"{run.name}.csv")) for run in runs]
    assert list(find_against_names(placed)) == []
    (finding,) = find_against_names([replace(with_one_name(placed), name="third")])
    assert (finding.kind, finding.channel) == ("declared_stroke", "displacement")
    assert finding.found.startswith("the plan declares 12 mm")
    (tmp_path / "plan.toml").write_text("[run.third]\nstrokes = 12\n")
    with pytest.raises(InputError, match="strokes"):
        list(find_against_names(placed))


def with_one_name(runs):
    return next(run for run in runs if run.name == WRONG)


def test_units_that_no_damper_has_are_asked_about_and_left_alone(runs):
    assert list(find_implausible_damper(runs)) == []
    (finding,) = find_implausible_damper([replace(run, force=run.force / 9.80665) for run in runs])
    assert (finding.kind, finding.channel) == ("implausible_damper", "force")
    assert "confirm" in finding.remedy


def test_what_a_law_lacks_at_one_command_and_motion_is_no_run_s_fault():
    """At several temperatures, runs of the same command and motion say what is usual there."""
    plan = replace(
        PLAN,
        motions=("sine5mm1Hz", "sine3mm2Hz", "nonperiodic"),
        currents_A=(0.0, 1.0, 2.0),
        temperatures_degC=(20.0, 60.0, 100.0),
    )
    sound = [run for run, _ in measure(find_preset("nominal"), plan, seed=3)]
    fitted = mrdamper.fit(Dataset(tuple(sound)), "dahl")
    free = [each.name for each in fitted.estimates if not each.at_bound]

    def blamed(runs):
        return [each for each in consistency(fitted.damper, runs, free=free) if each.run]

    assert blamed(fitted.training) == []
    (wrong,) = (run for run in fitted.training if run.name == "nominal_060C_1.00A_sine3mm2Hz")
    stronger = replace(wrong, force=1.1 * wrong.force)
    runs = [stronger if run is wrong else run for run in fitted.training]
    (found,) = blamed(runs)
    assert (found.run, found.kind) == (wrong.name, "force_gain")
    assert found.size == pytest.approx(1.1, rel=0.03)
