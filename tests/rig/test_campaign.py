"""Campaigns and measuring: what is run, what depends on what, and the heat balance of a run."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import CurrentSteps, RandomCurrent
from mrdamper.virtual_rig.campaign import Body, Campaign, usual_campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import PRESETS
from mrdamper.virtual_rig.sensors import Sensors

NOMINAL = PRESETS["nominal"]
SMALL = Campaign(
    motions=("sine5mm1Hz", "chirp3mm"), currents_A=(0.5, 2.0), temperatures_degC=(20, 60), duration_s=2.0
)
FAULTLESS = Sensors(rate_Hz=500.0, displacement_noise_m=0.0, force_noise_N=0.0, thermocouple_noise_K=0.0)
ONE = Campaign(motions=("sine:8mm:2Hz",), currents_A=(2.0,), temperatures_degC=(30.0,), steps=None)


@pytest.fixture(scope="module")
def small():
    return list(measure(NOMINAL, SMALL, seed=3))


# ------------------------------------------------------------------------------------------- what is run


def test_the_default_campaign_is_five_currents_seven_temperatures_four_motions_and_steps():
    runs = Campaign().runs("nominal")
    assert len(runs) == 5 * 7 * 4 + 7
    assert all(run.duration_s >= 4.0 for run in runs)
    assert Campaign().rate_Hz == 500.0
    names = {run.name for run in runs}
    assert {"nominal_060C_1.00A_sine5mm1Hz", "nominal_123C_0-2A_steps", "nominal_020C_0.00A_chirp3mm"} < names


def test_the_patterns_hold_out_the_runs_that_are_marked():
    campaign = Campaign()
    runs = campaign.runs("hard")
    marked = {run.name for run in runs if run.held_out}
    matched = {run.name for run in runs for pattern in campaign.hold_out if fnmatchcase(run.name, pattern)}
    assert marked == matched
    assert {run.temperature_degC for run in runs if not run.held_out} == {20.0, 40.0, 80.0, 120.0}
    assert "chirp3mm" not in {run.label for run in runs if not run.held_out}


@pytest.mark.parametrize("damper", PRESETS.values(), ids=list(PRESETS))
def test_every_preset_s_campaign_has_random_current_over_random_motion_at_each_temperature(damper):
    campaign = usual_campaign(damper)
    random = [run for run in campaign.runs(damper.name) if run.label == "random"]
    assert [run.temperature_degC for run in random] == list(campaign.temperatures_degC)
    assert [run.held_out for run in random] == [
        each in campaign.held_out_temperatures_degC for each in campaign.temperatures_degC
    ]
    t = np.arange(0.0, 8.0, 1e-3)
    commands = [run.current.current(t) for run in random if isinstance(run.current, RandomCurrent)]
    # none of them is known from another temperature
    assert len({each.tobytes() for each in commands}) == len(random)
    assert len({run.motion.displacement(t).tobytes() for run in random}) == len(random)
    assert max(each.max() for each in commands) == max(campaign.currents_A)
    assert Campaign.from_mapping(tomllib.loads(campaign.to_toml())) == campaign


def test_a_campaign_names_the_preset_whose_campaign_says_the_rest():
    own = Campaign.from_mapping(
        {"preset": "hydraulic-monotube", "temperatures_degC": [20, 45], "sensors": {"force_noise_N": 0}}
    )
    usual = usual_campaign(PRESETS["hydraulic-monotube"])
    assert own == replace(
        usual, temperatures_degC=(20.0, 45.0), sensors=replace(usual.sensors, force_noise_N=0.0)
    )
    with pytest.raises(InputError, match=r"mine\.toml: 'hydraulic' is not a preset"):
        Campaign.from_mapping({"preset": "hydraulic"}, "mine.toml")


def test_the_cell_feels_its_mass_and_its_offset():
    campaign = replace(
        usual_campaign(PRESETS["hydraulic-monotube"]), motions=("sine:15mm:2Hz",), temperatures_degC=(20.0,),
        currents_A=(0.0,), steps=None, random=None, duration_s=0.5,
    )  # fmt: skip
    (run, truth) = next(measure(PRESETS["hydraulic-monotube"], campaign))
    cell = run.force - truth.force
    inertia = np.polyfit(-((4 * np.pi) ** 2) * truth.displacement, cell, 1)
    assert inertia == pytest.approx([1.0, -5.0], abs=4.0 * 10.0 / np.sqrt(len(run)))


def test_periodic_motions_are_logged_for_whole_periods_and_chirps_to_their_end():
    durations = {
        run.label: run.duration_s
        for run in Campaign(
            motions=("sine:4mm:0.3Hz", "triangle:12mm:30mm/s", "chirp3mm", "nonperiodic"), currents_A=(1,)
        ).runs()
    }
    assert durations == pytest.approx(
        {"sine4mm0.3Hz": 20 / 3, "triangle12mm30mmps": 4.8, "chirp3mm": 8.0, "nonperiodic": 4.0, "steps": 7.2}
    )


def test_a_campaign_written_as_toml_is_read_back():
    own = Campaign(
        motions=("sine:4mm:0.3Hz", "nonperiodic"), currents_A=(0, 1.25), temperatures_degC=(-10, 22.5),
        steps=CurrentSteps((0.0, 1.5), 1.6), procedure="self-heating", body=Body(ambient_degC=25.0),
        sensors=Sensors(rate_Hz=200.0, thermocouple_offset_K=-5.0), held_out_motions=("nonperiodic",),
        held_out_temperatures_degC=(),
    )  # fmt: skip
    for campaign in (own, Campaign(), replace(own, steps=None), replace(own, steps_motion="sine15mm1Hz")):
        assert Campaign.from_mapping(tomllib.loads(campaign.to_toml())) == campaign
    rest = (
        "0.00A_sine4mm0.3Hz",
        "1.25A_sine4mm0.3Hz",
        "0.00A_nonperiodic",
        "1.25A_nonperiodic",
        "0-1.5A_steps",
    )
    assert {run.name for run in own.runs("x")} == {
        f"x_{degrees}C_{each}" for degrees in ("-10", "022.5") for each in rest
    }


def test_of_the_default_hold_out_what_is_not_run_is_left_out():
    campaign = Campaign.from_mapping({"temperatures_degC": [20, 60], "motions": ["sine3mm2Hz"]})
    assert campaign.hold_out == ("*_060C_*",)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"motion": ["chirp3mm"]}, "unknown key 'motion'; did you mean motions"),
        ({"motions": ["sine5mm2Hz"]}, "motion 'sine5mm2Hz' is not known"),
        ({"currents_A": [1.0, 1.001]}, "two runs would be named '020C_1.00A_sine5mm1Hz'"),
        ({"temperatures_degC": []}, "nothing to run"),
        ({"duration_s": 0}, "duration_s is 0; expected a number in s, above 0"),
        ({"held_out_temperatures_degC": [65]}, "held_out_temperatures_degC holds 65, which is not in temp"),
        ({"steps_motion": "triangle:12mm"}, "motion 'triangle:12mm' is not known"),
        ({"steps": 3}, "steps is 3; expected true, false or a table with levels_A and hold_s"),
    ],
)
def test_a_campaign_that_cannot_be_run_is_refused(given, message):
    with pytest.raises(InputError) as error:
        Campaign.from_mapping(given, "mine.toml")
    assert str(error.value).startswith("mine.toml: ")
    assert message in str(error.value)


# ------------------------------------------------------------------------------------------- what comes of it


def test_a_run_says_what_it_is(small):
    run = next(run for run, _ in small if run.name == "nominal_060C_2.00A_sine5mm1Hz")
    assert (run.command_unit, run.constant_command, run.motion) == ("A", 2.0, "sine5mm1Hz")
    assert run.temperature is not None
    assert np.mean(run.temperature) == pytest.approx(333.15, abs=0.05)
    assert "simulated" in run.source


def test_part_of_a_campaign_gives_the_same_bytes(small):
    part = replace(SMALL, motions=("chirp3mm",), temperatures_degC=(60.0,), steps=None)
    whole = {run.name: run for run, _ in small}
    for run, _ in measure(NOMINAL, part, seed=3):
        for channel in ("displacement", "force", "temperature", "command"):
            assert getattr(run, channel).tobytes() == getattr(whole[run.name], channel).tobytes()


def test_another_seed_or_run_has_other_noise_of_the_same_truth(small):
    run, truth = small[0]
    other, again = next(measure(NOMINAL, SMALL, seed=4))
    assert np.array_equal(truth.force, again.force)
    assert not np.array_equal(run.force, other.force)
    residues = [run.force - truth.force for run, truth in small[:2]]
    assert abs(np.corrcoef(*residues)[0, 1]) < 4.0 / np.sqrt(len(run))


def test_what_the_sensors_add_is_all_that_stands_between_run_and_truth(small):
    for run, truth in small:
        n = len(run)
        for channel, size in (("force", 5.0), ("displacement", 10e-6)):
            added = getattr(run, channel) - getattr(truth, channel)
            assert np.std(added) == pytest.approx(size, rel=4.5 / np.sqrt(2 * n))
    run, truth = next(measure(NOMINAL, SMALL, FAULTLESS))
    assert np.array_equal(run.force, truth.force)


def test_a_periodic_run_begins_run_in():
    """Its first period is its second: to a thousandth of the force."""
    _, truth = next(measure(NOMINAL, replace(SMALL, motions=("sine5mm1Hz",)), FAULTLESS))
    first, second = np.split(truth.force, 2)
    assert first == pytest.approx(second, abs=1e-3 * np.abs(first).max())


def test_current_steps_come_at_mid_stroke_and_at_full_speed(small):
    run, truth = next(pair for pair in small if pair[0].name.endswith("0-2A_steps"))
    switches = np.flatnonzero(np.diff(run.command)) + 1
    assert run.time[switches] == pytest.approx(0.8 * np.arange(1, 9))
    assert run.command[switches].tolist() == [1, 2, 1, 0, 1, 2, 1, 0]
    assert truth.displacement[switches] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(truth.velocity) == pytest.approx(0.030)


def test_current_steps_may_come_on_another_motion():
    """Half a period of its own is held: mid-stroke and full speed again."""
    fast = replace(SMALL, steps=CurrentSteps((0.0, 1.0, 0.0), 0.32), steps_motion="triangle:80mm:500mm/s")
    run, truth = next(pair for pair in measure(NOMINAL, fast) if np.ptp(pair[0].command))
    switches = np.flatnonzero(np.diff(run.command)) + 1
    assert run.name == "nominal_020C_0-1A_triangle80mm500mmps"
    assert run.time[switches] == pytest.approx([0.32, 0.64])
    assert truth.displacement[switches] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(truth.velocity) == pytest.approx(0.500)


def test_runs_are_prepared_without_complaint_and_recognised(small):
    """The label that is read from the displacement says what the rig was told to do."""
    labels = {run.motion: prepare_run(replace(run, motion="")).motion for run, _ in small}
    assert labels == {
        "sine5mm1Hz": "sine 5 mm 1 Hz", "chirp3mm": "chirp 3 mm 1-8 Hz", "steps": "triangle 12 mm 0.62 Hz"
    }  # fmt: skip


# ------------------------------------------------------------------------------------------- heat


def test_soaked_the_temperature_is_held(small):
    assert all(np.ptp(truth.temperature_degC) == 0.0 for _, truth in small)


def test_self_heating_stores_what_is_lost_and_not_conducted():
    """Heat capacity times rise = work + coil heat - conduction, from the truth alone; no conduction here."""
    body = Body(heat_capacity_J_K=40.0, conductance_W_K=0.0)
    heated = replace(ONE, procedure="self-heating", body=body, sensors=replace(FAULTLESS, rate_Hz=10_000.0))
    _, truth = next(measure(NOMINAL, heated))
    ohm = 5.0 * (1.0 + 0.00393 * (truth.temperature_degC - 20.0))
    power = truth.force * truth.velocity + ohm * truth.coil_current**2
    rise = truth.temperature_degC[-1] - 30.0
    last_block = 500  # its heat comes after it
    assert rise > 10.0
    assert 40.0 * rise == pytest.approx(power[:-last_block].sum() * 1e-4, rel=1e-9)
    soaked = next(measure(NOMINAL, ONE))[1]
    assert np.abs(truth.force[-500:]).max() < np.abs(soaked.force[-25:]).max()


def test_a_thermocouple_lags_the_heating():
    body = Body(heat_capacity_J_K=40.0, conductance_W_K=0.0)
    heated = replace(ONE, procedure="self-heating", body=body, sensors=FAULTLESS)
    run, truth = next(measure(NOMINAL, heated))
    assert run.temperature is not None
    read = run.temperature[-1] - 273.15
    rate = (truth.temperature_degC[-1] - 30.0) / 4.0
    lag = 10.0 * (1.0 - np.exp(-0.4))  # of a ramp that began 4 s ago
    assert truth.temperature_degC[-1] - read == pytest.approx(rate * lag, rel=0.05)


def test_a_body_warms_towards_the_balance_of_power_and_conduction():
    body = Body(heat_capacity_J_K=500.0, conductance_W_K=2.0, ambient_degC=20.0)
    assert body.warm(20.0, 100.0, 1e6) == pytest.approx(70.0)
    twice = body.warm(body.warm(35.0, 80.0, 30.0), 80.0, 45.0)
    assert body.warm(35.0, 80.0, 75.0) == pytest.approx(twice, rel=1e-12)
    insulated = replace(body, conductance_W_K=0.0)
    assert insulated.warm(20.0, 100.0, 50.0) == pytest.approx(30.0)
    assert replace(body, conductance_W_K=1e-9).warm(20.0, 100.0, 50.0) == pytest.approx(30.0)
