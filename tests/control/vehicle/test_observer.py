"""A car's states from accelerometers and the damper's stroke; the demand of them in C and by the book."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, linalg

from mrdamper.control.vehicle.car import DEMANDS, Demand, demand_named, skyhook
from mrdamper.control.vehicle.drive import RoadSegment, Vehicle, drive_car
from mrdamper.control.vehicle.mount import TopMount
from mrdamper.control.vehicle.observer import DemandStep, VehicleFlag, VehicleSensors, observer_matrices
from mrdamper.errors import InputError
from mrdamper.excitation import ROAD_ROUGHNESS, Road, Sine
from mrdamper.rig.plant import PRESETS, Plant
from tests.control.loops import Constant
from tests.control.test_vehicle import CAR, NOTHING

BOTH = pytest.mark.parametrize("wheel", [False, True], ids=["body", "body and wheel"])
PERIOD = 1e-3
DRIVE = RoadSegment(road=Road("B", 20.0, 3), duration_s=12.0, unscored_s=2.0)


def by_the_rig_s_damper(segment=DRIVE, **changed):
    """Return a ride on the rig's damper at half its current, of which the observer knows nothing."""
    return drive_car(Vehicle(CAR, NOTHING, Plant(PRESETS["vehicle"]), Constant(1.0), **changed), segment)


@pytest.fixture(scope="module")
def ride():
    return by_the_rig_s_damper()


def estimated(ride, sensors, *, mount=None, skip=2000):
    """Return the rms errors of the states by sensors along a ride, from a sample on."""
    series = np.column_stack([ride.states, ride.body, ride.stroke])
    sampled = np.concatenate([np.zeros((1, 6)), series[:-1]])[:: round(PERIOD / ride.step_s)]
    states, body, stroke = sampled[:, :4], sampled[:, 4], sampled[:, 5]
    wheel = -(CAR.body_kg * body + CAR.tyre_N_m * states[:, 2]) / CAR.wheel_kg
    noise = np.random.default_rng(7).standard_normal((len(body), 3))
    noise *= sensors.body_noise_m_s2, sensors.wheel_noise_m_s2, sensors.stroke_noise_m
    noise += sensors.body_bias_m_s2, sensors.wheel_bias_m_s2, sensors.stroke_bias_m
    asked = DemandStep(CAR, NOTHING, sensors=sensors, mount=mount)
    state, found = asked.stand(), []
    for row in (np.column_stack([body, wheel, stroke]) + noise).tolist():
        state, _, _ = asked.step(state, *row)
        found.append(asked.believes(state)[:4])
    return np.sqrt(np.mean((np.array(found) - states)[skip:] ** 2, axis=0))


# --------------------------------------------------------------------------------------------- the observer


@BOTH
def test_a_period_is_that_of_the_differential_equations(wheel):
    """With the body's acceleration straight between its readings, against an independent integrator."""
    made = observer_matrices(CAR, VehicleSensors(wheel_accelerometer=wheel), 5e-3)
    z, first, last = np.array([0.01, 0.2, -0.003, 0.5, 0.1, 0.2])[: 5 + wheel], 1.5, -2.0

    def rates(t, z):
        a = first + (last - first) * t / 5e-3 - z[4]
        wheel_acceleration = (-CAR.body_kg * a - CAR.tyre_N_m * z[2]) / CAR.wheel_kg
        return [z[1] - z[3], a, z[3], wheel_acceleration, *(-z[4:] / 600.0)]

    solved = integrate.solve_ivp(rates, (0.0, 5e-3), z, rtol=1e-12, atol=1e-15).y[:, -1]
    step = made.predict @ z + made.before * first + made.present * last
    assert step == pytest.approx(solved, rel=1e-8)


def settled(sensors, mount=None):
    """Return the observer, the best gain for the errors that it has itself, and the variances of these.

    The errors of a filter of any constant gain obey Lyapunov's equation; the noise is summed by Simpson.
    """
    made = observer_matrices(CAR, sensors, PERIOD, mount)
    n, fine, heavier = len(made.predict), 40, CAR.body_kg / CAR.wheel_kg
    spectrum = (2 * np.pi * 0.1) ** 2 * ROAD_ROUGHNESS["B"] * 20.0
    biases = [max(sensors.body_bias_m_s2, 1e-3), max(sensors.wheel_bias_m_s2, 1e-3)]
    by_body = np.eye(n)[1] - heavier * np.eye(n)[3]
    intensity = np.diag([0.0, 0.0, spectrum / 2.0, 0.0, *(2.0 * b**2 / 600.0 for b in biases)][:n])
    intensity += PERIOD * sensors.body_noise_m_s2**2 * np.outer(by_body, by_body)
    part = observer_matrices(CAR, sensors, PERIOD / fine).predict
    moved = [np.linalg.matrix_power(part, k) for k in range(fine + 1)]
    added = integrate.simpson([each @ intensity @ each.T for each in moved], dx=PERIOD / fine, axis=0)
    through = 0.0 if mount is None else CAR.body_kg / mount.stiffness_N_m
    carried = np.array([through, heavier]) * sensors.body_noise_m_s2
    noise = np.array([sensors.stroke_noise_m, sensors.wheel_noise_m_s2]) ** 2 + carried**2
    m = n - 4  # readings
    # of the states: the stroke, longer by what the mount's spring gives to -m_b (a - b), and the wheel's a
    more = 0.0 if mount is None else CAR.spring_N_m / mount.stiffness_N_m
    seen = np.array([[1.0 + more, 0, 0, 0, -through, 0], [0, 0, -CAR.tyre_N_m / CAR.wheel_kg, 0, heavier, 1]])
    c, r, gain = seen[:m, :n], np.diag(noise[:m]), made.gain[:, :m]
    assert made.stroke == pytest.approx([*seen[0, :n], through])
    assert made.wheel == pytest.approx([*seen[1, :n], -heavier])
    keeps = np.eye(n) - gain @ c
    before = linalg.solve_discrete_lyapunov(
        made.predict @ keeps, made.predict @ gain @ r @ gain.T @ made.predict.T + added
    )
    best = before @ c.T @ np.linalg.inv(c @ before @ c.T + r)
    return made, best, np.diag(keeps @ before)


@BOTH
@pytest.mark.parametrize("mount", [None, TopMount(stiffness_N_m=3e5)], ids=["bolted", "mounted"])
@pytest.mark.parametrize("bias", [0.3, 0.0])
def test_its_gains_are_the_best_for_the_errors_that_it_has(wheel, mount, bias):
    """No bias is taken for none at all: one of 1 mm/s^2 is looked for."""
    sensors = VehicleSensors(
        wheel_accelerometer=wheel,
        stroke_noise_m=1e-4,
        body_noise_m_s2=0.04,
        body_bias_m_s2=bias,
        wheel_noise_m_s2=0.4,
        wheel_bias_m_s2=2.0 * bias,
    )
    made, best, _ = settled(sensors, mount)
    assert made.gain[:, : best.shape[1]] == pytest.approx(best, rel=1e-4)
    assert not made.gain[:, best.shape[1] :].any()


@BOTH
def test_on_the_road_that_it_is_made_for_its_errors_are_those_it_expects(ride, wheel):
    """Class B at 20 m/s: the tyre deflection's are met; of a bias that stays the speeds have less."""
    sensors = VehicleSensors(
        wheel_accelerometer=wheel, body_bias_m_s2=0.02, wheel_bias_m_s2=0.0, stroke_noise_m=1e-4
    )
    expected = np.sqrt(settled(sensors)[2][:4])
    found = estimated(ride, sensors)
    assert found[2] == pytest.approx(expected[2], rel=0.25)
    assert (found < 1.3 * expected).all()


@BOTH
def test_a_bias_does_not_drift(ride, wheel):
    """0.2 m/s^2 would be 2.4 m/s in the ride; the errors are as good as those without."""
    sensors = VehicleSensors(wheel_accelerometer=wheel)
    biased = estimated(ride, sensors)
    none = estimated(ride, replace(sensors, body_bias_m_s2=0.0, wheel_bias_m_s2=0.0))
    assert none[1] < 0.02
    assert biased[1] < 0.02
    assert biased[3] < 0.02


@BOTH
@pytest.mark.parametrize("mount", [None, TopMount(stiffness_N_m=3e5)], ids=["bolted", "mounted"])
def test_a_drive_gives_its_observer_what_its_sensors_read(wheel, mount):
    """Without noise: the accelerations and the stroke of the ride, each with its bias."""
    sensors = VehicleSensors(
        wheel_accelerometer=wheel,
        body_noise_m_s2=1e-9,
        wheel_noise_m_s2=1e-9,
        stroke_noise_m=1e-9,
        stroke_bias_m=1e-3,
    )
    short = replace(DRIVE, duration_s=0.4, unscored_s=0.1)
    found = by_the_rig_s_damper(short, sensors=sensors, mount=mount)
    assert found.state_errors == pytest.approx(estimated(found, sensors, mount=mount, skip=100), rel=1e-3)


def test_a_bias_that_appears_on_the_way_is_learnt():
    """The step of a bias moves the speed for some seconds, and no longer."""
    asked = DemandStep(CAR, NOTHING)
    state = asked.start()
    speeds = []
    for _ in range(40):
        state, _, _ = asked.run(state, np.tile((0.3, 0.0, 0.0), (1000, 1)))
        speeds.append(asked.believes(state)[1])
    assert max(map(abs, speeds)) > 0.05
    assert abs(speeds[-1]) < 1e-3  # a bias is taken to fade within ten minutes
    assert asked.believes(state)[4] == pytest.approx(0.3, rel=0.02)


def test_a_bias_of_the_stroke_is_in_the_rattle_space_and_nowhere_else(ride):
    sensors = VehicleSensors()
    off, none = estimated(ride, replace(sensors, stroke_bias_m=2e-3)), estimated(ride, sensors)
    assert off[0] == pytest.approx(2e-3, rel=0.02)
    assert off[1:] == pytest.approx(none[1:], rel=0.02)


def test_the_top_mount_is_known():
    """What the mount's spring takes of the stroke is in the observer: without it the speeds are worse."""
    mount, sensors = TopMount(stiffness_N_m=2e5), VehicleSensors()
    ride = by_the_rig_s_damper(replace(DRIVE, duration_s=3.0), mount=mount)
    found, unaware = (estimated(ride, sensors, mount=each, skip=1000) for each in (mount, None))
    assert found[0] < 0.3 * unaware[0]
    assert found[3] < 0.5 * unaware[3]


@pytest.mark.system
@pytest.mark.parametrize("name", DEMANDS)
def test_a_ride_by_estimated_states_is_close_to_that_by_the_true_ones(name):
    """The ideal damper, on a road that the observer is not made for; tyre load and body acceleration."""
    segment = RoadSegment(road=Road("D", 20.0, 3), duration_s=8.0)
    vehicle = Vehicle(CAR, demand_named(name, CAR, 2500.0))
    true, found = drive_car(vehicle, segment), drive_car(replace(vehicle, sensors=VehicleSensors()), segment)
    assert true.state_errors is None
    assert found.state_errors is not None
    assert found.body_acceleration_m_s2 == pytest.approx(true.body_acceleration_m_s2, rel=0.05)
    assert found.tyre_load_N == pytest.approx(true.tyre_load_N, rel=0.05)


# ----------------------------------------------------------------------------------------------- the demand

reading = st.floats(-1.0, 1.0)


@given(z=st.tuples(reading, reading, reading, reading), off=reading, pushed=st.floats(-1e4, 1e4))
@pytest.mark.parametrize("name", DEMANDS)
def test_the_demand_is_the_book_s_to_the_bit(name, z, off, pushed):
    """F* = gains . z where F* v > 0, and while it opposes the body's acceleration; else nothing."""
    demand = demand_named(name, CAR, 2500.0)
    g1, g2, g3, g4 = demand.gains
    wanted = g1 * z[0] + g2 * z[1] + g3 * z[2] + g4 * z[3]
    speed = z[1] - z[3] + off
    if not wanted * speed > 0.0 or (
        demand.by_acceleration and (CAR.spring_N_m * z[0] + pushed) * speed > 0.0
    ):
        wanted = 0.0
    assert DemandStep(CAR, demand).of_states(z, off, pushed)[0] == wanted


def test_the_demand_ahead_is_that_of_the_free_car():
    asked = DemandStep(CAR, Demand("stiff", (0.0, 1000.0, 0.0, -1000.0)), preview_s=0.012)
    z = np.array([0.01, 0.3, -0.001, -0.4])
    later = CAR.advance(0.012)[0] @ z
    now, ahead = asked.of_states((0.01, 0.3, -0.001, -0.4), 0.0, 0.0)
    assert now == pytest.approx(700.0)
    assert ahead == pytest.approx(1000.0 * (later[1] - later[3]))


# ------------------------------------------------------------------------------------------ failing sensors


@BOTH
def test_readings_that_are_none_are_coasted_through_and_flagged(wheel):
    asked = DemandStep(CAR, skyhook(), sensors=VehicleSensors(wheel_accelerometer=wheel))
    rows = np.tile((0.0, 0.0, 0.01), (400, 1))
    rows[:, 0] = np.sin(0.02 * np.arange(400))
    broken = rows.copy()
    broken[100:130, 0], broken[200:230, 2] = np.nan, 1e6
    broken[300:, 0] = math.inf
    if wheel:
        broken[50:60, 1] = -math.inf
    _, wanted, flags = asked.run(asked.start(), broken)
    assert np.isfinite(wanted).all()
    assert set(flags[100:130]) == {VehicleFlag.NO_BODY_ACCELERATION}
    assert set(flags[200:230]) == {VehicleFlag.NO_STROKE}
    assert set(flags[50:60]) == {VehicleFlag.NO_WHEEL_ACCELERATION if wheel else 0}
    assert set(flags[300:399]) == {VehicleFlag.NO_BODY_ACCELERATION}  # coasting, for 0.1 s
    state, wanted, flags = asked.run(asked.start(), np.full((300, 3), np.nan))
    assert VehicleFlag.UNKNOWN in VehicleFlag(int(flags[-1]))
    assert not wanted.any()
    again, _, flags = asked.run(state, rows)
    assert not flags.any()
    assert asked.believes(again)[0] == pytest.approx(0.01, rel=0.5)


def test_a_state_that_cannot_be_begins_anew():
    asked = DemandStep(CAR, skyhook())
    for spoilt in (b"\xff" * len(asked.start()), b"\x7f" * len(asked.start())):
        state, wanted, _ = asked.step(spoilt, 0.1, 0.0, 0.01)
        assert math.isfinite(wanted)
        assert asked.believes(state)[0] == 0.01
    with pytest.raises(ValueError, match="not a vehicle's state"):
        asked.step(b"short", 0.0, 0.0, 0.0)


@pytest.mark.parametrize("wheel", [False, True])
def test_single_precision_is_the_same_within_its_digits(wheel):
    sensors = VehicleSensors(wheel_accelerometer=wheel)
    rng = np.random.default_rng(4)
    t = PERIOD * np.arange(3000)
    body = np.sin(7.0 * t) + 0.05 * rng.standard_normal(len(t))
    rows = (
        np.column_stack([body, 5.0 * np.sin(60.0 * t), 0.02 * np.sin(7.0 * t)])
        .astype(np.float32)
        .astype(float)
    )
    both = [DemandStep(CAR, skyhook(), sensors=sensors, single=single) for single in (False, True)]
    double, single = (np.array(each.believes(each.run(each.start(), rows)[0])) for each in both)
    assert single == pytest.approx(double, rel=2e-3, abs=2e-5)


def test_it_is_shown_by_what_it_is_made_of_and_without_its_tables():
    shown = repr(DemandStep(CAR, skyhook()))
    assert "QuarterCar" in shown
    assert "array" not in shown
    assert "_native" not in shown


def test_sensors_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="vehicle sensors: stroke_noise_m is 0"):
        VehicleSensors(stroke_noise_m=0.0)


def test_a_car_at_rest_stays_asked_for_nothing():
    """A standing car with a bias: once it is known, skyhook wants nothing."""
    vehicle = Vehicle(CAR, skyhook(), sensors=VehicleSensors(body_noise_m_s2=1e-9, body_bias_m_s2=0.3))
    ride = drive_car(vehicle, RoadSegment(road=Sine(1e-12, 1.0), duration_s=0.5, unscored_s=0.1))
    assert np.abs(ride.force).max() < 10.0
