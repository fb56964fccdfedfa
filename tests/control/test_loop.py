"""The control loop samples sensors, delays and limits commands, and keeps them constant for a period."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop, run_loops, steps_per_sample
from mrdamper.control.protocol import Controller
from mrdamper.control.scenario import SCENARIOS, Disturbance, Dropout, Scenario, Sensing, SineTarget
from mrdamper.control.score import attainable_range, score_run
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS
from mrdamper.virtual_rig.plant import PRESETS, Plant
from tests.control.loops import LAST, Constant, Ideal, Inverse, Lagging, OnOff, Recording, quiet
from tests.support.cards import DOUBLE

SHORT = quiet(Scenario(duration_s=1.0, unscored_s=0.25))


# --- Hold and delays --------------------------------------------------------------------------------------


def test_exact_inverse_controller_has_only_sampling_error():
    """A command that is constant for a period causes an error of at most this period times target slope."""
    run = run_loop(Ideal(), Inverse(), SHORT)
    feasible = attainable_range(Ideal(), run.course, 20.0, 2.0).feasible(run.course.target)
    most = 2 * np.pi * 900.0 * 1e-3
    assert 0.9 * most < np.abs(run.error[feasible]).max() <= 1.001 * most


def test_tracking_error_is_proportional_to_sampling_period():
    errors = []
    for period in (4e-3, 2e-3, 1e-3, 5e-4):
        run = run_loop(Ideal(), Inverse(period_s=period), SHORT)
        score = score_run(run, attainable_range(Ideal(), run.course, 20.0, 2.0))
        errors.append(score.rmse_feasible_N)
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx(2.0, rel=0.1)


def test_preview_of_half_sampling_period_halves_error():
    late = run_loop(Ideal(), Inverse(), SHORT)
    centred = run_loop(Ideal(), Inverse(preview_s=5e-4), SHORT)
    inside = attainable_range(Ideal(), late.course, 20.0, 2.0).feasible(late.course.target)
    expected = 0.5 * np.abs(late.error[inside]).max()
    assert np.abs(centred.error[inside]).max() == pytest.approx(expected, rel=0.02)


@pytest.mark.system
@given(late=st.integers(0, 137))
def test_command_delay_shifts_applied_current(late):
    """The delay is any number of simulation steps. The current is zero until the first command arrives."""
    scenario = replace(SHORT, duration_s=0.3, unscored_s=0.0)
    at_once = run_loop(Ideal(), Recording(), scenario).current
    delay = Disturbance(command_delay_s=late * 1e-4)
    delayed = run_loop(Ideal(), Recording(), replace(scenario, disturbance=delay)).current
    assert np.array_equal(delayed[late:], at_once[: len(at_once) - late])
    assert not delayed[:late].any()


def test_command_is_constant_between_samples():
    run = run_loop(Ideal(), Recording(slope=0.5), SHORT)
    held = run.current.reshape(-1, 10)
    assert np.array_equal(held, held[:, :1].repeat(10, axis=1))
    assert held[:, 0] == pytest.approx(0.5 * 1e-3 * np.arange(1000))


@given(current=st.floats(-5.0, 5.0), step=st.sampled_from([0.0, 0.01, 0.1]))
def test_current_driver_saturates_and_rounds_command(current, step):
    scenario = replace(SHORT, duration_s=0.02, unscored_s=0.0, disturbance=Disturbance(command_step_A=step))
    given_A = run_loop(Ideal(), Constant(current), scenario).current
    assert np.ptp(given_A) == 0.0
    assert 0.0 <= given_A[0] <= 2.0
    assert abs(given_A[0] - np.clip(current, 0.0, 2.0)) <= 0.5 * step + 1e-12
    if step:
        assert given_A[0] / step == pytest.approx(round(given_A[0] / step), abs=1e-9)


def test_plant_lag_delays_rising_force():
    """A first-order lag T delays a slow current ramp by T. The tolerance is half of the sampling period."""
    run = run_loop(Lagging(0.01), Recording(slope=0.5), SHORT)
    size = np.abs(run.force) - 50.0
    late = run.course.time[2000:2400] - size[2000:2400] / (800.0 * 0.5)
    assert late == pytest.approx(0.01, abs=1.01e-3)


# --- Sensor readings ----------------------------------------------------------------------------------------


def test_controller_receives_present_and_future_target():
    run_loop(Ideal(), Recording(preview_s=0.016), SHORT)
    time = 1e-3 * np.arange(1000)
    wanted = np.array([(w.now, w.ahead) for w, _ in LAST])
    assert wanted[:, 0] == pytest.approx(900.0 * np.cos(2 * np.pi * time), abs=1e-9)
    assert wanted[:, 1] == pytest.approx(900.0 * np.cos(2 * np.pi * (time + 0.016)), abs=1e-9)
    run_loop(Ideal(), Recording(needs_force=False), SHORT)
    assert all(w.ahead is None and s.force is None for w, s in LAST)


def test_noise_free_sensors_return_true_values():
    """The measured force is the force one simulation step earlier. Other readings have no delay."""
    run = run_loop(Ideal(), Recording(), SHORT)
    seen = [s for _, s in LAST]
    expected = MOTIONS["sine5mm1Hz"].displacement(1e-3 * np.arange(1000))
    assert [s.displacement for s in seen] == pytest.approx(expected, abs=1e-15)
    assert {s.temperature for s in seen} == {293.15}
    assert [s.force for s in seen] == [0.0, *run.force[9:-1:10]]


def test_sensor_noise_has_specified_standard_deviation():
    """Tolerances are four standard errors: s / sqrt(2 n) of a standard deviation s, s / sqrt(n) of a mean."""
    scenario = replace(SHORT, sensors=Sensing(temperature_offset_K=5.0, lost_share=0.0), duration_s=4.0)
    run_loop(Ideal(), Recording(), scenario)
    seen = [s for _, s in LAST]
    true = MOTIONS["sine5mm1Hz"].displacement(1e-3 * np.arange(4000))
    kelvin = np.array([s.temperature for s in seen])
    assert np.std([s.displacement for s in seen] - true) == pytest.approx(10e-6, rel=4 / np.sqrt(8000))
    assert np.std(kelvin) == pytest.approx(0.3, rel=4 / np.sqrt(8000))
    assert np.mean(kelvin) == pytest.approx(298.15, abs=4 * 0.3 / np.sqrt(4000))


def test_sensor_dropout_leaves_other_sensors_unchanged():
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=Sensing()))
    whole = list(LAST)
    lost = Sensing(dropouts=(Dropout("temperature", 0.2, 0.3),))
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=lost))
    assert [s.displacement for _, s in LAST] == [s.displacement for _, s in whole]
    assert [s.force for _, s in LAST] == [s.force for _, s in whole]
    gone = np.isnan([s.temperature for _, s in LAST])
    assert np.array_equal(np.flatnonzero(gone), np.arange(200, 300))


@pytest.mark.parametrize("sensor", ["displacement", "temperature", "force"])
def test_frozen_sensor_repeats_its_last_reading(sensor):
    frozen = Sensing(dropouts=(Dropout(sensor, 0.2, 0.3, "frozen"),))
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=frozen))
    read = [getattr(s, sensor) for _, s in LAST]
    assert set(read[199:300]) == {read[199]}
    assert read[300] != read[299]


@pytest.mark.parametrize(("sensor", "by"), [("displacement", 1e-3), ("temperature", -7.5), ("force", 80.0)])
def test_sensor_offset_lasts_for_specified_time(sensor, by):
    read = []
    for faults in ((), (Dropout(sensor, 0.2, 0.3, "shifted", by),)):
        run_loop(Ideal(), Recording(), replace(SHORT, sensors=Sensing(dropouts=faults)))
        read.append(np.array([getattr(s, sensor) for _, s in LAST]))
    off = np.where((np.arange(1000) >= 200) & (np.arange(1000) < 300), by, 0.0)
    assert read[1] - read[0] == pytest.approx(off, abs=1e-9)


@pytest.mark.parametrize("sensor", ["displacement", "temperature", "force"])
def test_lost_samples_occur_at_specified_rate(sensor):
    run_loop(Ideal(), Recording(), replace(SHORT, duration_s=4.0, sensors=Sensing(lost_share=0.1)))
    lost = np.isnan([getattr(s, sensor) for _, s in LAST]).mean()
    assert lost == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 4000))


def test_measured_displacement_is_delayed_and_quantised():
    sensing = replace(SHORT.sensors, displacement_delay_s=0.004, displacement_step_m=1e-5)
    run_loop(Ideal(), Recording(), replace(SHORT, sensors=sensing))
    read = np.array([s.displacement for _, s in LAST])
    true = MOTIONS["sine5mm1Hz"].displacement(1e-3 * np.arange(1000) - 0.004)
    assert np.abs(read - true).max() <= 0.5e-5 + 1e-12
    assert read / 1e-5 == pytest.approx(np.round(read / 1e-5), abs=1e-6)


def test_force_gain_scales_force_and_reading():
    plain = run_loop(Ideal(), Recording(), SHORT)
    strong = run_loop(Ideal(), Recording(), replace(SHORT, disturbance=Disturbance(force_gain=1.1)))
    assert strong.force == pytest.approx(1.1 * plain.force)
    assert LAST[500][1].force == pytest.approx(1.1 * plain.force[4999])


# --- Plants, and the control loop in C ----------------------------------------------------------------------


def test_same_seed_repeats_controlled_run():
    """Equal seeds give identical runs, different seeds different runs. The plant object is unchanged."""
    plant = Plant(PRESETS["nominal"])
    before, noisy = plant.state, replace(SHORT, sensors=Sensing())
    first, again, other = (run_loop(plant, OnOff(), replace(noisy, seed=seed)).force for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert plant.state == before


def test_control_loop_with_constant_current_equals_plant_simulation():
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
_NAMES = ("recommended", "recommended-causal", "recommended-observer", "predictive", "paper", "pi")


class _AnyPlant:
    """A virtual damper without the interface that the loop in C requires."""

    def __init__(self, plant: Plant) -> None:
        self.step_s, self.advance_many = plant.step_s, plant.advance_many
        self.copy = lambda: _AnyPlant(plant.copy())


@pytest.mark.parametrize("preset", ["nominal", "hydraulic-bench"])
@pytest.mark.parametrize("disturbed", [False, True])
def test_control_loop_in_c_equals_python(preset, disturbed):
    """Both loops give identical bits, also with delays, quantised currents, sensor faults and force gains."""
    scenario = Scenario(duration_s=0.4, unscored_s=0.1, temperature_degC=60.0)
    if disturbed:
        disturbance = Disturbance(force_gain=1.1, command_delay_s=3.7e-3, command_step_A=0.01)
        scenario = replace(scenario, sensors=_FAULTS, disturbance=disturbance, duration_s=0.4003)
    plant, made = Plant(PRESETS[preset]), controllers_for(DOUBLE)
    for name in _NAMES:
        one = run_loop(plant, made[name], scenario)
        other = run_loop(_AnyPlant(plant), made[name], scenario)
        assert np.ptp(one.current) > 0.5
        assert np.array_equal(one.force, other.force)
        assert np.array_equal(one.current, other.current)


@pytest.mark.parametrize("preset", ["nominal", "hydraulic-bench"])
def test_batched_control_loops_match_single_loops(preset):
    """Seven controllers, one of them in Python, are compared with and without delays."""
    scenario = Scenario(duration_s=0.3, unscored_s=0.1, temperature_degC=60.0)
    late = replace(scenario, seed=7, sensors=_FAULTS, disturbance=Disturbance(command_delay_s=3.7e-3))
    plant, made = Plant(PRESETS[preset]), controllers_for(DOUBLE)
    chosen: list[Controller] = [OnOff(), *(made[name] for name in _NAMES)]
    for controller, runs in zip(chosen, run_loops(plant, chosen, [scenario, late]), strict=True):
        for each, run in zip((scenario, late), runs, strict=True):
            alone = run_loop(plant, controller, each)
            assert run.scenario is each
            assert np.array_equal(run.force, alone.force)
            assert np.array_equal(run.current, alone.current)


# --- Rejected inputs --------------------------------------------------------------------------------------


FAR = replace(SHORT, motion="sine:2500mm:1Hz")


def test_batched_control_loops_require_same_motion():
    with pytest.raises(InputError, match="only seed, sensors and disturbance may differ"):
        run_loops(Ideal(), [OnOff()], [SHORT, replace(SHORT, temperature_degC=60.0)])


@pytest.mark.parametrize(
    ("plant", "controller", "scenario", "message"),
    [
        (Plant(PRESETS["nominal"]), controllers_for(DOUBLE)["paper"], FAR, "displacement within 2 m"),
        (Ideal(), Constant(float("nan")), SHORT, "controller 'constant': its current is nan at sample 0"),
    ],
)
def test_control_loop_rejects_invalid_values(plant, controller, scenario, message):
    with pytest.raises(InputError, match=message):
        run_loop(plant, controller, scenario)


@pytest.mark.parametrize(
    ("period", "message"),
    [
        (2e-2, r"period is 20 ms; expected 0\.2 to 10 ms \(100 Hz to 5000 Hz\)"),
        (float("nan"), r"period is nan ms"),
        (3.3e-4, r"expected a whole number of the plant's steps of 0\.1 ms, such as 0\.3 ms"),
    ],
)
def test_unsuitable_control_period_is_rejected(period, message):
    with pytest.raises(InputError, match=message):
        steps_per_sample(period, 1e-4)


# --- Scenarios --------------------------------------------------------------------------------------------


@pytest.mark.system
@pytest.mark.parametrize(
    ("name", "amplitude", "motion"),
    [("sine-900N-1Hz", 900.0, "sine5mm1Hz"), ("sine-1100N-2Hz", 1100.0, "sine3mm2Hz")],
)
def test_sine_target_is_in_phase_with_velocity(name, amplitude, motion):
    course = reference_trajectory(SCENARIOS[name], 1e-4)
    ratio = course.velocity / np.abs(MOTIONS[motion].velocity(0.0))
    assert course.target == pytest.approx(amplitude * ratio, abs=1e-6)


TOML = """
like = "sine-1100N-2Hz"
temperature_degC = 60
[target]
kind = "sine"
amplitude_N = 700
frequency_Hz = 2
phase_deg = -10
[[sensors.dropouts]]
sensor = "displacement"
start_s = 1.5
end_s = 1.6
[disturbance]
command_delay_s = 0.005
"""


def test_scenario_is_read_from_toml():
    scenario = Scenario.from_mapping(tomllib.loads(TOML))
    assert scenario.motion == "sine3mm2Hz"  # The scenario that ``like`` names supplies the motion.
    assert scenario.target == SineTarget(700, 2, -10)
    assert scenario.sensors.dropouts == (Dropout("displacement", 1.5, 1.6),)
    assert scenario.disturbance.command_delay_s == 0.005


@pytest.mark.parametrize(
    ("given_toml", "message"),
    [
        ({"motoin": "x"}, r"unknown key 'motoin'; did you mean motion\?"),
        ({"like": "sine-900N"}, r"there is no target 'sine-900N'"),
        ({"motion": "walk"}, r"motion 'walk' is not known"),
        ({"target": {"kind": "square"}}, r"target\.kind is 'square'; expected one of: sine, velocity"),
        ({"target": {"kind": "sine", "amplitude_N": 5}}, r"target: frequency_Hz is missing"),
        ({"duration_s": 0.5}, r"lasts 0\.5 s, of which 1 s are not scored"),
        ({"sensors": {"force_noise_N": -1}}, r"force_noise_N is -1; expected a number in N, at least 0"),
    ],
)
def test_invalid_scenario_is_rejected(given_toml, message):
    with pytest.raises(InputError, match=message):
        Scenario.from_mapping(given_toml)
