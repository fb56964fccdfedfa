"""The sampled loop: holding, delays, limits, sensors; what a controller is told and what the damper gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop, run_loops, steps_per_sample
from mrdamper.control.protocol import Controller
from mrdamper.control.scenario import (
    SCENARIOS,
    Disturbance,
    Dropout,
    Scenario,
    Sensing,
    SineTarget,
    VelocityTarget,
)
from mrdamper.control.score import attainable_range, score_run
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS
from mrdamper.virtual_rig.plant import PRESETS, Plant
from tests.control.dampers import DOUBLE
from tests.control.loops import LAST, Constant, Ideal, Inverse, Lagging, OnOff, Recording, quiet

SHORT = quiet(Scenario(duration_s=1.0, unscored_s=0.25))


def test_the_exact_inverse_of_a_plant_without_lag_tracks_it_up_to_the_hold():
    """Held for a period P, a target of greatest slope 2 pi f A is missed by no more than that times P."""
    run = run_loop(Ideal(), Inverse(), SHORT)
    feasible = attainable_range(Ideal(), run.course, 20.0, 2.0).feasible(run.course.target)
    most = 2 * np.pi * 900.0 * 1e-3
    assert 0.9 * most < np.abs(run.error[feasible]).max() <= 1.001 * most


def test_a_course_that_is_known_already_changes_nothing_and_another_one_is_refused():
    plant = Ideal()
    course = reference_trajectory(SHORT, plant.step_s)
    known, found = run_loop(plant, Inverse(), SHORT, course), run_loop(plant, Inverse(), SHORT)
    assert np.array_equal(known.force, found.force)
    assert np.array_equal(known.current, found.current)
    for other in (
        reference_trajectory(SHORT, 2.0 * plant.step_s),
        reference_trajectory(replace(SHORT, duration_s=2.0), 1e-4),
    ):
        with pytest.raises(InputError, match="expected the scenario's, of"):
            run_loop(plant, Inverse(), SHORT, other)


def test_faster_sampling_shrinks_that_error_in_proportion():
    errors = []
    for period in (4e-3, 2e-3, 1e-3, 5e-4):
        run = run_loop(Ideal(), Inverse(period_s=period), SHORT)
        score = score_run(run, attainable_range(Ideal(), run.course, 20.0, 2.0))
        errors.append(score.rmse_feasible_N)
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(2.0, rel=0.1)


def test_a_target_known_ahead_by_half_the_hold_halves_the_error():
    late = run_loop(Ideal(), Inverse(), SHORT)
    centred = run_loop(Ideal(), Inverse(preview_s=5e-4), SHORT)
    inside = attainable_range(Ideal(), late.course, 20.0, 2.0).feasible(late.course.target)
    assert np.abs(centred.error[inside]).max() == pytest.approx(
        0.5 * np.abs(late.error[inside]).max(), rel=0.02
    )


@pytest.mark.system
@given(late=st.integers(0, 137))
def test_a_delay_of_the_command_shifts_it_by_as_many_steps_of_the_plant(late):
    """Also by parts of a sample; before the first command arrives there is none."""
    scenario = replace(SHORT, duration_s=0.3, unscored_s=0.0)
    at_once = run_loop(Ideal(), Recording(), scenario).current
    delayed = run_loop(
        Ideal(), Recording(), replace(scenario, disturbance=Disturbance(command_delay_s=late * 1e-4))
    ).current
    assert np.array_equal(delayed[late:], at_once[: len(at_once) - late])
    assert not delayed[:late].any()


def test_the_command_is_held_between_samples_and_changes_only_there():
    run = run_loop(Ideal(), Recording(slope=0.5), SHORT)
    held = run.current.reshape(-1, 10)
    assert np.array_equal(held, held[:, :1].repeat(10, axis=1))
    assert held[:, 0] == pytest.approx(0.5 * 1e-3 * np.arange(1000))


@given(current=st.floats(-5.0, 5.0), step=st.sampled_from([0.0, 0.01, 0.1]))
def test_the_driver_saturates_and_rounds_to_its_step(current, step):
    scenario = replace(SHORT, duration_s=0.02, unscored_s=0.0, disturbance=Disturbance(command_step_A=step))
    given_A = run_loop(Ideal(), Constant(current), scenario).current
    assert np.ptp(given_A) == 0.0
    assert 0.0 <= given_A[0] <= 2.0
    assert abs(given_A[0] - np.clip(current, 0.0, 2.0)) <= 0.5 * step + 1e-12
    if step:
        assert given_A[0] / step == pytest.approx(round(given_A[0] / step), abs=1e-9)


def test_a_controller_is_told_the_target_at_its_sample_and_at_its_preview():
    run_loop(Ideal(), Recording(preview_s=0.016), SHORT)
    time = 1e-3 * np.arange(1000)
    wanted = np.array([(w.now, w.ahead) for w, _ in LAST])
    assert wanted[:, 0] == pytest.approx(900.0 * np.cos(2 * np.pi * time), abs=1e-9)
    assert wanted[:, 1] == pytest.approx(900.0 * np.cos(2 * np.pi * (time + 0.016)), abs=1e-9)
    run_loop(Ideal(), Recording(), SHORT)
    assert all(w.ahead is None for w, _ in LAST)


def test_sensors_without_noise_say_what_is_there():
    """The force is that of the step which has just ended; displacement and temperature are of the instant."""
    run = run_loop(Ideal(), Recording(), SHORT)
    seen = [s for _, s in LAST]
    time = 1e-3 * np.arange(1000)
    assert [s.displacement for s in seen] == pytest.approx(
        MOTIONS["sine5mm1Hz"].displacement(time), abs=1e-15
    )
    assert {s.temperature for s in seen} == {293.15}
    assert [s.force for s in seen] == [0.0, *run.force[9:-1:10]]


def test_a_controller_without_a_force_sensor_gets_no_force():
    run_loop(Ideal(), Recording(needs_force=False), SHORT)
    assert all(s.force is None for _, s in LAST)


def test_noise_has_the_stated_spread_and_the_thermocouple_its_offset():
    scenario = replace(SHORT, sensors=Sensing(temperature_offset_K=5.0), duration_s=4.0)
    run_loop(Ideal(), Recording(), scenario)
    time, seen = 1e-3 * np.arange(4000), [s for _, s in LAST]
    x = np.array([s.displacement for s in seen]) - MOTIONS["sine5mm1Hz"].displacement(time)
    kelvin = np.array([s.temperature for s in seen])
    # the standard error of a spread from n values is spread / sqrt(2 n), of a mean spread / sqrt(n)
    assert np.std(x) == pytest.approx(10e-6, rel=4 / np.sqrt(8000))
    assert np.std(kelvin) == pytest.approx(0.3, rel=4 / np.sqrt(8000))
    assert np.mean(kelvin) == pytest.approx(298.15, abs=4 * 0.3 / np.sqrt(4000))


def test_each_sensor_has_its_own_noise_so_that_losing_one_leaves_the_others_as_they_were():
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=Sensing()))
    whole = list(LAST)
    lost = Sensing(dropouts=(Dropout("temperature", 0.2, 0.3),), lost_share=0.0)
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=lost))
    assert [s.displacement for _, s in LAST] == [s.displacement for _, s in whole]
    assert [s.force for _, s in LAST] == [s.force for _, s in whole]
    gone = np.isnan([s.temperature for _, s in LAST])
    assert np.array_equal(np.flatnonzero(gone), np.arange(200, 300))


@pytest.mark.parametrize("sensor", ["displacement", "temperature", "force"])
def test_a_frozen_sensor_says_its_last_good_value_again(sensor):
    frozen = Sensing(dropouts=(Dropout(sensor, 0.2, 0.3, "frozen"),))
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=frozen))
    said = [getattr(s, sensor) for _, s in LAST]
    assert set(said[199:300]) == {said[199]}
    assert said[300] != said[299]


@pytest.mark.parametrize(("sensor", "by"), [("displacement", 1e-3), ("temperature", -7.5), ("force", 80.0)])
def test_a_sensor_that_is_off_for_a_while_is_off_by_its_shift_and_right_before_and_after(sensor, by):
    said = []
    for faults in ((), (Dropout(sensor, 0.2, 0.3, "shifted", by),)):
        run_loop(Ideal(), Recording(), replace(SHORT, sensors=Sensing(dropouts=faults)))
        said.append(np.array([getattr(s, sensor) for _, s in LAST]))
    off = np.where((np.arange(1000) >= 200) & (np.arange(1000) < 300), by, 0.0)
    assert said[1] - said[0] == pytest.approx(off, abs=1e-9)


def test_lost_samples_are_the_stated_share():
    run_loop(Ideal(), Recording(), replace(SHORT, duration_s=4.0, sensors=Sensing(lost_share=0.1)))
    for sensor in ("displacement", "temperature", "force"):
        share = np.isnan([getattr(s, sensor) for _, s in LAST]).mean()
        assert share == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 4000))


def test_sensor_delay_and_converter_step_of_the_displacement():
    sensing = replace(SHORT.sensors, displacement_delay_s=0.004, displacement_step_m=1e-5)
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=sensing))
    said = np.array([s.displacement for _, s in LAST])
    true = MOTIONS["sine5mm1Hz"].displacement(1e-3 * np.arange(1000) - 0.004)
    assert np.abs(said - true).max() <= 0.5e-5 + 1e-12
    assert said / 1e-5 == pytest.approx(np.round(said / 1e-5), abs=1e-6)


def test_the_damper_s_gain_scales_the_force_that_is_there_and_that_is_felt():
    plain = run_loop(Ideal(), Recording(), SHORT)
    strong = run_loop(Ideal(), Recording(), replace(SHORT, disturbance=Disturbance(force_gain=1.1)))
    assert strong.force == pytest.approx(1.1 * plain.force)
    assert LAST[500][1].force == pytest.approx(1.1 * plain.force[4999])


def test_the_same_seed_gives_the_same_run_bit_for_bit_and_another_does_not():
    noisy = replace(SHORT, sensors=Sensing())
    plant = Plant(PRESETS["nominal"])
    first, again, other = (run_loop(plant, OnOff(), replace(noisy, seed=seed)).force for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_plant_that_is_given_stays_as_it_was():
    plant = Plant(PRESETS["nominal"])
    before = plant.state
    run_loop(plant, OnOff(), SHORT)
    assert plant.state == before


def test_blocks_of_the_loop_are_the_whole_run_of_the_plant():
    """A constant current: the loop is nothing but the plant."""
    run = run_loop(Plant(PRESETS["hard"]), Constant(1.3), SHORT)
    course = reference_trajectory(SHORT, 1e-4)
    whole = Plant(PRESETS["hard"]).advance_many(course.displacement, course.velocity, 1.3, 20.0)
    assert np.array_equal(run.force, whole)


_FAULTS = Sensing(
    displacement_step_m=2e-6,
    force_step_N=3.0,
    lost_share=0.05,
    dropouts=(Dropout("force", 0.1, 0.15, "frozen"), Dropout("displacement", 0.2, 0.25, "missing")),
)


class _AnyPlant:
    """A virtual damper that does not say that it is in C."""

    def __init__(self, plant: Plant) -> None:
        self.step_s, self.advance_many = plant.step_s, plant.advance_many
        self.copy = lambda: _AnyPlant(plant.copy())


@pytest.mark.parametrize("preset", ["nominal", "hydraulic-bench"])
@pytest.mark.parametrize("disturbed", [False, True])
def test_the_loop_in_c_and_the_loop_in_python_give_the_same_bits(preset, disturbed):
    """Whatever delays, converters, faults and gains, and for controllers with and without a force sensor."""
    scenario = Scenario(duration_s=0.4, unscored_s=0.1, temperature_degC=60.0)
    if disturbed:
        disturbance = Disturbance(force_gain=1.1, command_delay_s=3.7e-3, command_step_A=0.01)
        scenario = replace(scenario, sensors=_FAULTS, disturbance=disturbance, duration_s=0.4003)
    plant, made = Plant(PRESETS[preset]), controllers_for(DOUBLE)
    for name in ("recommended", "recommended-causal", "recommended-observer", "predictive", "paper", "pi"):
        one = run_loop(plant, made[name], scenario)
        other = run_loop(_AnyPlant(plant), made[name], scenario)
        assert np.ptp(one.current) > 0.5
        assert np.array_equal(one.force, other.force)
        assert np.array_equal(one.current, other.current)


@pytest.mark.parametrize("preset", ["nominal", "hydraulic-bench"])
def test_loops_abreast_are_what_each_is_alone(preset):
    """Seven controllers, one of them in Python, with and without delays: more than a pack, and a rest."""
    scenario = Scenario(duration_s=0.3, unscored_s=0.1, temperature_degC=60.0)
    late = replace(scenario, seed=7, sensors=_FAULTS, disturbance=Disturbance(command_delay_s=3.7e-3))
    plant, made = Plant(PRESETS[preset]), controllers_for(DOUBLE)
    names = ("recommended", "recommended-causal", "recommended-observer", "predictive", "paper", "pi")
    chosen: list[Controller] = [OnOff(), *(made[name] for name in names)]
    for controller, runs in zip(chosen, run_loops(plant, chosen, [scenario, late]), strict=True):
        for each, run in zip((scenario, late), runs, strict=True):
            alone = run_loop(plant, controller, each)
            assert run.scenario is each
            assert np.array_equal(run.force, alone.force)
            assert np.array_equal(run.current, alone.current)


def test_loops_abreast_share_a_motion():
    with pytest.raises(InputError, match="only seed, sensors and disturbance may differ"):
        run_loops(Ideal(), [OnOff()], [SHORT, replace(SHORT, temperature_degC=60.0)])


def test_a_damper_in_c_that_refuses_a_sample_says_why():
    far = replace(SHORT, motion="sine:2500mm:1Hz")
    with pytest.raises(InputError, match=r"plant: sample .* displacement within 2 m"):
        run_loop(Plant(PRESETS["nominal"]), controllers_for(DOUBLE)["paper"], far)


def test_a_lag_delays_the_force_by_itself():
    """Behind one lag T a slowly rising current is late by T."""
    run = run_loop(Lagging(0.01), Recording(slope=0.5), SHORT)
    size = np.abs(run.force) - 50.0
    late = run.course.time[2000:2400] - size[2000:2400] / (800.0 * 0.5)
    # and the hold makes it half a period earlier or later
    assert late == pytest.approx(0.01, abs=1.01e-3)


@pytest.mark.system
def test_the_targets_have_the_phase_and_the_size_that_they_say():
    for name, amplitude, motion in (
        ("sine-900N-1Hz", 900.0, "sine5mm1Hz"),
        ("sine-1100N-2Hz", 1100.0, "sine3mm2Hz"),
    ):
        course = reference_trajectory(SCENARIOS[name], 1e-4)
        assert SCENARIOS[name].motion == motion
        share = course.velocity / np.abs(MOTIONS[motion].velocity(0.0))
        assert course.target == pytest.approx(amplitude * share, abs=1e-6)
    course = reference_trajectory(SCENARIOS["non-periodic"], 1e-4)
    gain = 1.0 + 0.35 * np.sin(2 * np.pi * 0.31 * course.time + 1.0)
    assert course.target == pytest.approx(1000.0 * np.tanh(course.velocity / 0.022 * gain))
    even = VelocityTarget(1000.0, 0.022, modulation_Hz=0.31)  # by no share, unless one is stated
    plain = 1000.0 * np.tanh(course.velocity / 0.022)
    assert even.force(course.time, course.velocity) == pytest.approx(plain)
    assert [SCENARIOS[name].duration_s for name in SCENARIOS] == [4.0, 3.0, 10.0]


@pytest.mark.parametrize(
    ("period", "said"),
    [
        (2e-2, r"period is 20 ms; expected 0\.2 to 10 ms \(100 Hz to 5000 Hz\)"),
        (1e-4, r"expected 0\.2 to 10 ms"),
        (float("nan"), r"period is nan ms"),
        (3.3e-4, r"expected a whole number of the plant's steps of 0\.1 ms, such as 0\.3 ms"),
    ],
)
def test_a_period_that_does_not_fit_is_refused(period, said):
    with pytest.raises(InputError, match=said):
        steps_per_sample(period, 1e-4)


def test_a_scenario_lasts_an_hour_at_the_most():
    assert Scenario(duration_s=3600.0).duration_s == 3600.0
    with pytest.raises(InputError, match=r"duration_s.*3600"):
        Scenario(duration_s=3600.5)


def test_a_sampling_rate_that_cannot_be_is_told_the_ends_of_those_that_can():
    with pytest.raises(InputError, match=r"0\.2 to 10 ms \(100 Hz to 5000 Hz\)"):
        steps_per_sample(0.1, 1e-4)


def test_a_controller_that_gives_no_number_is_named():
    with pytest.raises(InputError, match=r"controller 'constant': its current is nan at sample 0"):
        run_loop(Ideal(), Constant(float("nan")), SHORT)


TOML = """
like = "sine-1100N-2Hz"
temperature_degC = 60
seed = 4
[target]
kind = "sine"
amplitude_N = 700
frequency_Hz = 2
phase_deg = -10
[sensors]
temperature_offset_K = 5
[[sensors.dropouts]]
sensor = "displacement"
start_s = 1.5
end_s = 1.6
[disturbance]
command_delay_s = 0.005
"""


def test_a_scenario_is_read_from_toml():
    import tomllib

    scenario = Scenario.from_mapping(tomllib.loads(TOML))
    assert scenario.motion == "sine3mm2Hz"  # of the one that it is like
    assert scenario.target == SineTarget(700, 2, -10)
    assert scenario.sensors.displacement_noise_m == 10e-6
    assert scenario.sensors.dropouts == (Dropout("displacement", 1.5, 1.6),)
    assert scenario.disturbance.command_delay_s == 0.005


@pytest.mark.parametrize(
    ("given_toml", "said"),
    [
        ({"motoin": "x"}, r"scenario: unknown key 'motoin'; did you mean motion\?"),
        ({"like": "sine-900N"}, r"there is no target 'sine-900N'; did you mean sine-900N-1Hz"),
        ({"motion": "walk"}, r"motion 'walk' is not known"),
        ({"target": {"kind": "square"}}, r"target\.kind is 'square'; expected one of: sine, velocity"),
        (
            {"target": {"kind": "sine", "amplitude_N": 5}},
            r"target: frequency_Hz is missing; expected a number in Hz",
        ),
        ({"target": {"kind": "sine", "amplitude_N": -5, "frequency_Hz": 1}}, r"amplitude_N is -5"),
        ({"duration_s": 0.5}, r"lasts 0\.5 s, of which 1 s are not scored"),
        ({"temperature_degC": 293.15}, r"temperature_degC is 293\.15; expected a number in degC, -40 to 200"),
        ({"seed": 1.5}, r"seed is 1\.5; expected a whole number"),
        ({"sensors": {"force_noise_N": -1}}, r"force_noise_N is -1; expected a number in N, at least 0"),
        ({"sensors": {"dropouts": [{"sensor": "smell", "start_s": 0, "end_s": 1}]}}, r"sensor is 'smell'"),
        ({"sensors": {"lost_share": 1.0}}, r"lost_share is 1\.0; expected a number, at least 0 and below 1"),
        ({"duration_s": float("nan")}, r"duration_s is nan"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused_with_its_place(given_toml, said):
    with pytest.raises(InputError, match=said):
        Scenario.from_mapping(given_toml)
