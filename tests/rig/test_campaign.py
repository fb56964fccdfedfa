"""Campaigns of the virtual rig: planned runs, held-out runs, sensors and reproducibility."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import CurrentSteps, RandomCurrent
from mrdamper.virtual_rig.campaign import Campaign, default_campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import PRESETS
from mrdamper.virtual_rig.sensors import Sensors

NOMINAL = PRESETS["nominal"]
SMALL = Campaign(
    motions=("sine5mm1Hz", "chirp3mm"), currents_A=(0.5, 2.0), temperatures_degC=(20, 60), duration_s=2.0
)
FAULTLESS = Sensors(rate_Hz=500.0, displacement_noise_m=0.0, force_noise_N=0.0, thermocouple_noise_K=0.0)


@pytest.fixture(scope="module")
def small():
    return list(measure(NOMINAL, SMALL, seed=3))


# ------------------------------------------------------------------------------------------ planned runs


def test_proposed_hold_out_patterns_match_held_out_runs():
    campaign = Campaign()
    runs = campaign.runs("hard")
    held_out = {run.name for run in runs if run.held_out}
    assert held_out == {
        run.name for run in runs for pattern in campaign.hold_out if fnmatchcase(run.name, pattern)
    }
    assert {run.temperature_degC for run in runs if not run.held_out} == {20.0, 40.0, 80.0, 120.0}
    assert "chirp3mm" not in {run.label for run in runs if not run.held_out}


@pytest.mark.parametrize("damper", PRESETS.values(), ids=list(PRESETS))
def test_random_runs_differ_between_temperatures(damper):
    campaign = default_campaign(damper)
    random = [run for run in campaign.runs(damper.name) if run.label == "random"]
    assert [run.temperature_degC for run in random] == list(campaign.temperatures_degC)
    t = np.arange(0.0, 8.0, 1e-3)
    commands = [run.current.current(t) for run in random if isinstance(run.current, RandomCurrent)]
    assert len({each.tobytes() for each in commands}) == len(random)
    assert len({run.motion.displacement(t).tobytes() for run in random}) == len(random)
    assert max(each.max() for each in commands) == max(campaign.currents_A)


def test_campaign_file_may_start_from_preset():
    own = Campaign.from_mapping(
        {"preset": "hydraulic-monotube", "temperatures_degC": [20, 45], "sensors": {"force_noise_N": 0}}
    )
    usual = default_campaign(PRESETS["hydraulic-monotube"])
    sensors = replace(usual.sensors, force_noise_N=0.0)
    assert own == replace(usual, temperatures_degC=(20.0, 45.0), sensors=sensors)


def test_force_sensor_adds_inertia_and_offset():
    campaign = replace(
        default_campaign(PRESETS["hydraulic-monotube"]), motions=("sine:15mm:2Hz",),
        temperatures_degC=(20.0,),
        currents_A=(0.0,), steps=None, random=None, duration_s=0.5,
    )  # fmt: skip
    (run, truth) = next(measure(PRESETS["hydraulic-monotube"], campaign))
    cell = run.force - truth.force
    inertia = np.polyfit(-((4 * np.pi) ** 2) * truth.displacement, cell, 1)
    assert inertia == pytest.approx([1.0, -5.0], abs=4.0 * 10.0 / np.sqrt(len(run)))


def test_periodic_motions_are_recorded_for_whole_periods():
    durations = {
        run.label: run.duration_s
        for run in Campaign(
            motions=("sine:4mm:0.3Hz", "triangle:12mm:30mm/s", "chirp3mm", "nonperiodic"), currents_A=(1,)
        ).runs()
    }
    assert durations == pytest.approx(
        {"sine4mm0.3Hz": 20 / 3, "triangle12mm30mmps": 4.8, "chirp3mm": 8.0, "nonperiodic": 4.0, "steps": 7.2}
    )


def test_campaign_is_read_back_from_toml():
    own = Campaign(
        motions=("sine:4mm:0.3Hz", "nonperiodic"), currents_A=(0, 1.25), temperatures_degC=(-10, 22.5),
        steps=CurrentSteps((0.0, 1.5), 1.6), sensors=Sensors(rate_Hz=200.0, thermocouple_offset_K=-5.0),
        held_out_motions=("nonperiodic",), held_out_temperatures_degC=(),
    )  # fmt: skip
    usual = [default_campaign(damper) for damper in PRESETS.values()]
    for campaign in (own, Campaign(), replace(own, steps=None), *usual):
        assert Campaign.from_mapping(tomllib.loads(campaign.to_toml())) == campaign


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"motion": ["chirp3mm"]}, "unknown key 'motion'"),
        ({"currents_A": [1.0, 1.001]}, "two runs have the name '020C_1.00A_sine5mm1Hz'"),
        ({"temperatures_degC": []}, "nothing to run"),
    ],
)
def test_invalid_campaign_file_raises(document, message):
    with pytest.raises(InputError) as error:
        Campaign.from_mapping(document, "mine.toml")
    assert str(error.value).startswith("mine.toml: ")
    assert message in str(error.value)


# ---------------------------------------------------------------------------------------------- measured runs


def test_measured_run_has_labels_and_temperature(small):
    run = next(run for run, _ in small if run.name == "nominal_060C_2.00A_sine5mm1Hz")
    assert (run.command_unit, run.constant_command, run.motion) == ("A", 2.0, "sine5mm1Hz")
    assert np.mean(run.temperature) == pytest.approx(333.15, abs=0.05)


def test_subset_of_campaign_has_identical_runs(small):
    """A run, including its noise, does not depend on the other runs of the campaign."""
    part = replace(SMALL, motions=("chirp3mm",), temperatures_degC=(60.0,), steps=None)
    whole = {run.name: run for run, _ in small}
    for run, _ in measure(NOMINAL, part, seed=3):
        for channel in ("displacement", "force", "temperature", "command"):
            assert getattr(run, channel).tobytes() == getattr(whole[run.name], channel).tobytes()


def test_seed_changes_only_sensor_noise(small):
    run, truth = small[0]
    other, again = next(measure(NOMINAL, SMALL, seed=4))
    assert np.array_equal(truth.force, again.force)
    assert not np.array_equal(run.force, other.force)
    residues = [run.force - truth.force for run, truth in small[:2]]
    assert abs(np.corrcoef(*residues)[0, 1]) < 4.0 / np.sqrt(len(run))


def test_measured_and_true_runs_differ_by_sensors(small):
    for run, truth in small:
        n = len(run)
        for channel, size in (("force", 5.0), ("displacement", 10e-6)):
            added = getattr(run, channel) - getattr(truth, channel)
            assert np.std(added) == pytest.approx(size, rel=4.5 / np.sqrt(2 * n))
    run, truth = next(measure(NOMINAL, SMALL, FAULTLESS))
    assert np.array_equal(run.force, truth.force)


def test_periodic_run_starts_in_steady_state():
    """The first period equals the second within a thousandth of the force."""
    _, truth = next(measure(NOMINAL, replace(SMALL, motions=("sine5mm1Hz",)), FAULTLESS))
    first, second = np.split(truth.force, 2)
    assert first == pytest.approx(second, abs=1e-3 * np.abs(first).max())


def test_current_steps_occur_at_mid_stroke(small):
    run, truth = next(pair for pair in small if pair[0].name.endswith("0-2A_steps"))
    switches = np.flatnonzero(np.diff(run.command)) + 1
    assert run.time[switches] == pytest.approx(0.8 * np.arange(1, 9))
    assert run.command[switches].tolist() == [1, 2, 1, 0, 1, 2, 1, 0]
    assert truth.displacement[switches] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(truth.velocity) == pytest.approx(0.030)


def test_measured_runs_have_planned_motion(small):
    """The motion of a run without a motion label is recognised from its displacement."""
    labels = {run.motion: prepare_run(replace(run, motion="")).motion for run, _ in small}
    assert labels == {
        "sine5mm1Hz": "sine 5 mm 1 Hz", "chirp3mm": "chirp 3 mm 1-8 Hz", "steps": "triangle 12 mm 0.62 Hz"
    }  # fmt: skip
