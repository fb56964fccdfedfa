"""A car's states from accelerometers and the damper's stroke; the demand of them in C and by the book."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

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


def estimated(sensors, *, segment=DRIVE, mount=None):
    """Return the errors of the states on the rig's damper at half its current."""
    vehicle = Vehicle(CAR, NOTHING, Plant(PRESETS["vehicle"]), Constant(1.0), sensors=sensors, mount=mount)
    return np.array(drive_car(vehicle, segment).state_errors)


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


def propagated(sensors, mount=None):
    """Return gain and variances of the filter by its recursion from a poor start, the noise by quadrature."""
    made = observer_matrices(CAR, sensors, PERIOD, mount)
    fine = 40
    spectrum = (2 * np.pi * 0.1) ** 2 * ROAD_ROUGHNESS["B"] * 20.0
    n = len(made.predict)
    by_road, by_body = np.eye(n)[2], np.eye(n)[1] - CAR.body_kg / CAR.wheel_kg * np.eye(n)[3]
    biases = (sensors.body_bias_m_s2, sensors.wheel_bias_m_s2)
    part = observer_matrices(CAR, sensors, PERIOD / fine).predict
    added, moved = np.zeros((n, n)), np.eye(n)
    for k in range(fine + 1):
        weight = (0.5 if k in (0, fine) else 1.0) * PERIOD / fine
        for where, intensity in (
            (by_road, spectrum / 2.0),
            (by_body, PERIOD * sensors.body_noise_m_s2**2),
            *((np.eye(n)[k], 2.0 * biases[k - 4] ** 2 / 600.0) for k in range(4, n)),
        ):
            added += weight * intensity * np.outer(moved @ where, moved @ where)
        moved = part @ moved
    through = 0.0 if mount is None else CAR.body_kg / mount.stiffness_N_m
    noise = [sensors.stroke_noise_m**2 + (through * sensors.body_noise_m_s2) ** 2]
    seen = [made.stroke[:n]]
    if sensors.wheel_accelerometer:
        seen.append(made.wheel[:n])
        noise.append(
            sensors.wheel_noise_m_s2**2 + (CAR.body_kg / CAR.wheel_kg * sensors.body_noise_m_s2) ** 2
        )
    c, r = np.array(seen), np.diag(noise)
    p = np.diag([1e-4, 1e-2, 1e-6, 1e-1, 1e-1, 1e-1][:n])
    for _ in range(60_000):
        p = made.predict @ p @ made.predict.T + added
        gain = p @ c.T @ np.linalg.inv(c @ p @ c.T + r)
        p = (np.eye(n) - gain @ c) @ p
        p = 0.5 * (p + p.T)
    return made, gain, np.diag(p)


@pytest.mark.system
@BOTH
@pytest.mark.parametrize("mount", [None, TopMount(stiffness_N_m=3e5)], ids=["bolted", "mounted"])
def test_its_gains_are_those_the_filter_s_recursion_settles_at(wheel, mount):
    sensors = VehicleSensors(wheel_accelerometer=wheel, stroke_noise_m=1e-4)
    made, gain, _ = propagated(sensors, mount)
    scale = np.abs(gain).max(axis=0)
    assert made.gain[:, : gain.shape[1]] / scale == pytest.approx(gain / scale, abs=2e-3)


@pytest.mark.system
@BOTH
def test_on_the_road_that_it_is_made_for_its_errors_are_those_it_expects(wheel):
    """Class B at 20 m/s, by the rig's damper, of which the observer knows nothing.

    The tyre deflection's, which are fast, are met; of a bias that does not change the speeds have less.
    """
    sensors = VehicleSensors(
        wheel_accelerometer=wheel, body_bias_m_s2=0.02, wheel_bias_m_s2=0.0, stroke_noise_m=1e-4
    )
    expected = np.sqrt(propagated(sensors)[2][:4])
    found = estimated(sensors, segment=replace(DRIVE, duration_s=22.0))
    assert found[2] == pytest.approx(expected[2], rel=0.25)
    assert (found < 1.3 * expected).all()


@pytest.mark.system
@BOTH
def test_a_bias_does_not_drift(wheel):
    """0.2 m/s^2 would be 2.4 m/s in the ride; the errors are as good as those without."""
    sensors = VehicleSensors(wheel_accelerometer=wheel)
    biased = estimated(sensors)
    none = estimated(replace(sensors, body_bias_m_s2=0.0, wheel_bias_m_s2=0.0))
    assert none[1] < 0.02
    assert biased[1] < 0.02
    assert biased[3] < 0.02


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


@pytest.mark.system
def test_a_bias_of_the_stroke_is_in_the_rattle_space_and_nowhere_else():
    sensors = VehicleSensors()
    off, none = estimated(replace(sensors, stroke_bias_m=2e-3)), estimated(sensors)
    assert off[0] == pytest.approx(2e-3, rel=0.02)
    assert off[1:] == pytest.approx(none[1:], rel=0.02)


@pytest.mark.system
def test_the_top_mount_is_known():
    """What the mount's spring takes of the stroke is in the observer: without it the speeds are worse."""
    mount, sensors = TopMount(stiffness_N_m=2e5), VehicleSensors()
    found = estimated(sensors, mount=mount)
    asked = DemandStep(CAR, NOTHING, sensors=sensors)  # without the mount
    unaware = np.zeros(2)
    vehicle = Vehicle(CAR, NOTHING, Plant(PRESETS["vehicle"]), Constant(1.0), mount=mount)
    ride = drive_car(vehicle, DRIVE)
    every = round(PERIOD / ride.step_s)
    body, stroke, true = (
        ride.body[every - 1 :: every],
        ride.stroke[every - 1 :: every],
        ride.states[every - 1 :: every],
    )
    state = asked.start()
    off = []
    for a, d, z in zip(body.tolist(), stroke.tolist(), true, strict=True):
        state, _, _ = asked.step(state, a, 0.0, d)
        off.append(np.array(asked.believes(state))[[0, 3]] - z[[0, 3]])
    unaware = np.sqrt(np.mean(np.array(off)[2000:] ** 2, axis=0))
    assert found[0] < 0.3 * unaware[0]
    assert found[3] < 0.5 * unaware[1]


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


def test_sensors_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="vehicle sensors: stroke_noise_m is 0"):
        VehicleSensors(stroke_noise_m=0.0)


def test_a_car_at_rest_stays_asked_for_nothing():
    """A standing car with a bias: once it is known, skyhook wants nothing."""
    vehicle = Vehicle(CAR, skyhook(), sensors=VehicleSensors(body_noise_m_s2=1e-9, body_bias_m_s2=0.3))
    ride = drive_car(vehicle, RoadSegment(road=Sine(1e-12, 1.0), duration_s=0.5, unscored_s=0.1))
    assert np.abs(ride.force).max() < 10.0
