"""The quarter car against closed forms and independent programs, and its energy."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy import integrate, linalg

from mrdamper.control.realtime import realtime_model
from mrdamper.control.vehicle.car import (
    Demand,
    QuarterCar,
    acceleration_driven,
    groundhook,
    hybrid,
    linear_quadratic,
    skyhook,
)
from mrdamper.control.vehicle.comfort import weighted
from mrdamper.control.vehicle.drive import RoadSegment, Vehicle, drive_car
from mrdamper.control.vehicle.long_drive import LongDrive, TwoBodies, drive_long
from mrdamper.control.vehicle.observer import VehicleSensors
from mrdamper.control.vehicle.quarter_car import QuarterCarOptions, RealtimeCarDamper, drive_quarter_car
from mrdamper.control.vehicle.roads import Obstacle, Profile, ProfileAtSpeed, read_profile
from mrdamper.errors import InputError
from mrdamper.excitation import ROAD_ROUGHNESS, Road, Sine
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.rig.plant import PRESETS, Plant
from mrdamper.runtime.progress import ProgressUpdate
from tests.control.dampers import DOUBLE
from tests.control.loops import LAST, Constant, Ideal, Inverse, Recording
from tests.export.exports import card_of

CAR = QuarterCar()
NOTHING = Demand("nothing", (0.0, 0.0, 0.0, 0.0))
QUIET = RoadSegment(
    displacement_noise_m=0.0, velocity_noise_m_s=0.0, temperature_noise_K=0.0, duration_s=4.0, unscored_s=2.0
)


def linear(damping):
    """Return a car with a viscous damper [N s/m] that knows no current."""
    return Vehicle(CAR, NOTHING, Ideal(low=0.0, gain=0.0, viscosity=damping))


def test_what_nobody_describes_is_what_the_docs_say():
    """docs/tracking.md: masses, springs, the errors of sensors, the road, and the two bodies that warm."""
    assert astuple(QuarterCar()) == (320.0, 40.0, 20e3, 200e3, 0.08, 300e3)
    assert astuple(VehicleSensors()) == (0.05, 0.2, False, 0.5, 0.5, 10e-6, 0.0)
    assert astuple(TwoBodies()) == (150.0, 950.0, 6.0, 2.0)
    assert QuarterCarOptions().segment() == RoadSegment(road=Road("C", 20.0, 5), duration_s=20.0)
    usual = RoadSegment()
    assert (usual.duration_s, usual.unscored_s, usual.seed) == (60.0, 2.0, 5)
    noise = (usual.displacement_noise_m, usual.velocity_noise_m_s, usual.temperature_noise_K)
    assert noise == (10e-6, 3e-3, 0.3)
    assert Obstacle(kind="bump", height_m=1.0, length_m=1.0, speed_m_s=1.0).start_s == 2.5
    plan = LongDrive()
    assert (plan.duration_s, plan.every_s, plan.segment_s) == (1800.0, 60.0, 6.0)
    assert (plan.hottest_degC, plan.back_degC, plan.coil_ohm, plan.copper_per_K) == (
        150.0,
        110.0,
        5.0,
        0.00393,
    )


def test_the_exact_step_is_newton_s_law_of_body_and_wheel_over_a_rising_road():
    """In heights above the ground: two masses, two springs, a force held, a road of constant speed."""
    car = QuarterCar(body_kg=410.0, wheel_kg=47.0, spring_N_m=17e3, tyre_N_m=230e3)
    force, rise, time = 700.0, 0.3, 0.013

    def motion(t: float, y: np.ndarray) -> list[float]:
        body, body_speed, wheel, wheel_speed = y
        spring, tyre = 17e3 * (body - wheel), 230e3 * (wheel - rise * t)
        return [body_speed, (-spring - force) / 410.0, wheel_speed, (spring + force - tyre) / 47.0]

    wheel, body = -0.003, 0.007
    solved = integrate.solve_ivp(motion, (0.0, time), [body, 0.2, wheel, 0.5], rtol=1e-11, atol=1e-14)
    body, body_speed, wheel, wheel_speed = solved.y[:, -1]
    a, b, c = car.advance(time)
    step = a @ np.array([0.01, 0.2, -0.003, 0.5]) + force * b + rise * c
    assert step == pytest.approx([body - wheel, body_speed, wheel - rise * time, wheel_speed], rel=1e-8)
    held = 0.5 * (410.0 * 0.2**2 + 47.0 * 0.5**2 + 17e3 * 0.01**2 + 230e3 * 0.003**2)
    assert float(car.energy(np.array([0.01, 0.2, -0.003, 0.5]))) == pytest.approx(held)


def test_energy_is_what_the_road_put_in_less_what_the_damper_took():
    """With the real hysteretic damper: change of stored energy = work of the road - work on the damper."""
    damper = Plant(PRESETS["vehicle"])
    ride = drive_car(Vehicle(CAR, NOTHING, damper), replace(QUIET, duration_s=3.0, unscored_s=0.0))
    states, step = ride.states, ride.step_s
    start = np.zeros((1, 4))
    lengths = np.diff(states[:, 0], prepend=0.0)
    taken = float(ride.force @ lengths)
    # the tyre's force on the road, its mean over a step from the trapezium
    tyre = -CAR.tyre_N_m * np.concatenate([start, states])[:, 2]
    given = float(0.5 * (tyre[1:] + tyre[:-1]) @ ride.road) * step
    stored = CAR.energy(states[-1:])[0] - CAR.energy(start)[0]
    assert stored == pytest.approx(given - taken, rel=2e-3)
    assert taken > 0.0
    assert ride.heat_W == pytest.approx(taken / 3.0, rel=1e-9)


@pytest.mark.nightly
@pytest.mark.parametrize("damping", [800.0, 3000.0])
def test_a_road_of_white_speed_gives_every_damper_the_same_power(damping):
    """P = k_t S / 4 with S = (2 pi n0)^2 Gd(n0) v the one-sided spectrum of the road's speed [m^2/s].

    The power goes through the tyre alone; body, spring, damper do not enter. A minute of road has a few
    per cent of scatter.
    """
    ride = drive_car(linear(damping), replace(QUIET, duration_s=42.0))
    spectrum = (2 * np.pi * 0.1) ** 2 * ROAD_ROUGHNESS["C"] * 20.0
    assert ride.heat_W == pytest.approx(CAR.tyre_N_m * spectrum / 4.0, rel=0.08)


def test_the_regulator_is_that_of_the_discrete_riccati_equation_in_the_limit():
    """The solver for sampled systems at a fine step: an independent way to the same gains."""
    step, rattle, tyre = 2e-5, 5e2, 1e4
    a, b, _ = CAR.advance(step)
    row, entry = CAR.system[1], CAR.by_force[1]
    cost = step * (np.outer(row, row) + np.diag([rattle, 0.0, tyre, 0.0]))
    cross, effort = step * (row * entry)[:, None], step * np.array([[entry**2]])
    p = linalg.solve_discrete_are(a, b[:, None], cost, effort, s=cross)
    gain = linalg.solve(effort + b[None] @ p @ b[:, None], b[None] @ p @ a + cross.T)[0]
    assert linear_quadratic(CAR).gains == pytest.approx(tuple(-gain), rel=0.02)


def test_demands_are_the_books():
    states = np.array([0.01, 0.4, -0.002, 0.1])
    assert np.dot(skyhook(2000.0).gains, states) == pytest.approx(2000.0 * 0.4)
    assert np.dot(groundhook(2000.0).gains, states) == pytest.approx(-2000.0 * 0.1)
    for demand in (skyhook, groundhook, hybrid, acceleration_driven):
        assert demand() == demand(2500.0)
    half = np.dot(hybrid(2000.0).gains, states)
    assert half == pytest.approx(0.5 * (2000.0 * 0.4 - 2000.0 * 0.1))


def test_the_demands_go_by_velocities_alone_and_are_sums_of_skyhook_and_groundhook():
    """The damper that is switched by the acceleration is one between body and wheel."""
    sky, ground = (np.array(demand(2000.0).gains) for demand in (skyhook, groundhook))
    assert list(sky) == [0.0, 2000.0, 0.0, 0.0]
    assert list(ground) == [0.0, 0.0, 0.0, -2000.0]
    assert hybrid(2000.0, 0.3).gains == pytest.approx(0.3 * sky + 0.7 * ground)
    assert acceleration_driven(2000.0).gains == pytest.approx(sky + ground)
    assert [demand().by_acceleration for demand in (skyhook, acceleration_driven)] == [False, True]


@pytest.mark.system
def test_a_perfect_inverse_of_a_damper_without_lag_rides_as_the_ideal_one():
    """Where the demand lies between what the damper gives at zero and at the highest current."""
    car = Vehicle(CAR, skyhook(1500.0), Ideal(low=0.0, gain=3000.0), Inverse(low=0.0, gain=3000.0))
    stretch = replace(QUIET, duration_s=6.0)
    followed, ideal = drive_car(car, stretch), drive_car(Vehicle(CAR, skyhook(1500.0)), stretch)
    assert followed.body_acceleration_m_s2 == pytest.approx(ideal.body_acceleration_m_s2, rel=0.03)
    assert followed.tyre_load_N == pytest.approx(ideal.tyre_load_N, rel=0.03)


@pytest.mark.system
def test_a_ride_goes_on_where_the_last_one_ended():
    """Two stretches are one, but for the noise, which there is none of here."""
    vehicle = Vehicle(CAR, skyhook(), Plant(PRESETS["vehicle"]), Constant(0.7))
    whole = drive_car(vehicle, replace(QUIET, duration_s=2.0, unscored_s=0.0))
    half = replace(QUIET, duration_s=1.0, unscored_s=0.0)
    first = drive_car(vehicle, half)
    second = drive_car(vehicle, half, after=first)
    assert np.concatenate([first.states, second.states]) == pytest.approx(whole.states, abs=1e-12)
    assert second.memory.time == pytest.approx(2.0)


def test_the_same_seed_gives_the_same_ride():
    vehicle = Vehicle(CAR, skyhook(), Plant(PRESETS["vehicle"]), Constant(0.7))
    noisy = RoadSegment(duration_s=0.5, unscored_s=0.0)
    one, two, other = (drive_car(vehicle, replace(noisy, seed=seed)).states for seed in (3, 3, 4))
    assert np.array_equal(one, two)
    ideal = Vehicle(CAR, skyhook())
    assert not np.array_equal(
        drive_car(ideal, replace(noisy, seed=3)).states, drive_car(ideal, replace(noisy, seed=4)).states
    )
    assert np.array_equal(one, other)  # a constant current does not see the noise


def test_a_controller_without_a_preview_is_told_of_nothing_ahead():
    short = replace(QUIET, duration_s=0.02, unscored_s=0.0)
    drive_car(Vehicle(CAR, skyhook(), Ideal(), Recording()), short)
    assert {wanted.ahead for wanted, _ in LAST} == {None}


def test_what_a_controller_is_told_of_the_demand_ahead_is_what_a_free_car_will_demand():
    """A car without a damper on a flat road: the demand comes true, sample by sample."""
    gains = Demand("stiff", (0.0, 1000.0, 0.0, -1000.0))  # never clipped: it is in phase with the speed
    vehicle = Vehicle(CAR, gains, Ideal(low=0.0, gain=0.0), Recording(preview_s=0.012, needs_force=False))
    kicked = drive_car(vehicle, replace(QUIET, road=Sine(5e-3, 1.5), duration_s=0.3, unscored_s=0.0))
    flat = replace(QUIET, road=Sine(1e-12, 1.0), duration_s=0.3, unscored_s=0.0)
    drive_car(vehicle, flat, after=kicked)
    now, ahead = (np.array([getattr(w, name) for w, _ in LAST]) for name in ("now", "ahead"))
    assert np.abs(now).max() > 10.0
    assert len(now) == 600
    assert ahead[300:-12] == pytest.approx(now[312:], abs=1e-6)


# ---------------------------------------------------------------------------------- comfort, roads, end stops

# Factors of W_k at third octaves, as two public programs reprint ISO 2631-1's table.
FELT = {
    0.5: 0.418,
    1.0: 0.482,
    2.0: 0.531,
    4.0: 0.967,
    6.3: 1.054,
    8.0: 1.036,
    16.0: 0.768,
    31.5: 0.405,
    63.0: 0.186,
}


@pytest.mark.parametrize(("frequency", "factor"), FELT.items())
def test_the_weighting_is_the_table_s(frequency, factor):
    step = 2e-4
    t = step * np.arange(round(40.0 / step))
    felt = weighted(np.sin(2.0 * np.pi * frequency * t), step)
    assert np.sqrt(2.0) * felt[len(t) // 2 :].std() == pytest.approx(factor, rel=0.02)


def test_obstacles_have_their_height_and_length():
    bump = Obstacle(kind="bump", height_m=0.1, length_m=2.0, speed_m_s=10.0, start_s=1.0)
    assert bump.displacement([0.0, 1.0, 1.1, 1.2, 5.0]) == pytest.approx([0.0, 0.0, 0.1, 0.0, 0.0])
    assert replace(bump, kind="pothole").displacement([1.1]) == pytest.approx([-0.1])
    assert replace(bump, kind="step").displacement([1.0, 1.1, 1.2, 9.0]) == pytest.approx(
        [0.0, 0.05, 0.1, 0.1]
    )
    with pytest.raises(InputError, match="height_m is 0"):
        replace(bump, height_m=0.0)


def test_after_a_step_the_car_comes_to_rest_on_it():
    step = Obstacle(kind="step", height_m=0.05, length_m=0.2, speed_m_s=10.0, start_s=0.1)
    ride = drive_car(linear(1500.0), replace(QUIET, road=step, duration_s=5.0, unscored_s=0.0))
    assert np.abs(ride.states[-1]).max() < 1e-4
    assert ride.step_s * ride.road.sum() == pytest.approx(0.05)


def test_a_recorded_road_is_driven_to_its_end_and_back(tmp_path):
    file = tmp_path / "road.csv"
    file.write_text("distance_m,height_m\n5,0.02\n15,0.03\n25,0.0\n", encoding="utf-8")
    road = ProfileAtSpeed(read_profile(file), 10.0)
    assert road.displacement([0.0, 0.5, 1.0, 2.0, 2.5, 4.0]) == pytest.approx(
        [0.0, 0.005, 0.01, -0.02, -0.005, 0.0]
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("distance_m,h\n1,2\n2,3\n", "no column height_m"),
        ("distance_m,height_m\n1,0\n3,0\n2,0\n", "distance does not rise after 3 m"),
        ("distance_m,height_m\n1,0\n3,0\n3,0\n", "distance does not rise after 3 m"),
        ("distance_m,height_m\n1,0\n2,nan\n3,0\n", "a value that is no number"),
    ],
)
def test_a_road_that_is_none_is_refused(tmp_path, text, said):
    file = tmp_path / "road.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_profile(file)
    with pytest.raises(InputError, match="two or more"):
        Profile(np.zeros(1), np.zeros(1))


def test_an_end_stop_gives_back_what_it_has_taken():
    """A car that hits its stops: energy in springs and stops = work of the road - work on the damper."""
    car = QuarterCar(stroke_m=0.01)
    bump = Obstacle(kind="bump", height_m=0.04, length_m=1.0, speed_m_s=10.0, start_s=0.05)
    ride = drive_car(
        replace(linear(800.0), car=car), replace(QUIET, road=bump, duration_s=0.3, unscored_s=0.0)
    )
    free = drive_car(linear(800.0), replace(QUIET, road=bump, duration_s=0.3, unscored_s=0.0))
    assert ride.end_stop_N > 1000.0
    assert free.end_stop_N == 0.0
    assert ride.most_rattle_m < free.most_rattle_m
    states = np.concatenate([np.zeros((1, 4)), ride.states])
    tyre = -car.tyre_N_m * states[:, 2]
    given = float(0.5 * (tyre[1:] + tyre[:-1]) @ ride.road) * ride.step_s
    taken = float(ride.force @ np.diff(states[:, 0]))
    beyond = float(car.stop_force(states[-1, :1])[0]) / car.stop_N_m
    stored = car.energy(ride.states[-1:])[0] + 0.5 * car.stop_N_m * beyond**2
    assert stored == pytest.approx(given - taken, rel=0.05)  # the stop is held over a step, too


ROUGH = Profile(np.arange(30.0), np.random.default_rng(3).normal(0.0, 0.012, 30))


@pytest.mark.parametrize("by", ["skyhook", "groundhook", "hybrid", "linear-quadratic", "acceleration-driven"])
def test_a_drive_is_the_slow_one_step_by_step(by):
    """The ideal damper on a rough road, with stops that are hit: states, force, and every figure of it."""
    car = QuarterCar(stroke_m=0.02, stop_N_m=2e5)
    options = QuarterCarOptions(car=car, demand=by, damping_N_s_m=1900.0)
    demand, road = options.demanded(), ProfileAtSpeed(ROUGH, 15.0)
    segment = replace(QUIET, road=road, duration_s=1.2, unscored_s=0.2)
    ride = drive_car(Vehicle(car, demand), segment)
    k_s, k_t, m_b, step = car.spring_N_m, car.tyre_N_m, car.body_kg, 1e-4
    heights = road.displacement(step * np.arange(12_001))
    rises, (a, b, c) = np.diff(heights) / step, car.advance(step)
    z, force, pushed, rows = np.zeros(4), 0.0, 0.0, []
    for k in range(12_000):
        if k % 10 == 0:
            asked, speed = float(np.dot(demand.gains, z)), z[1] - z[3]
            against = -(k_s * z[0] + pushed) / m_b * speed > 0.0  # the body's acceleration helps, or it is 0
            force = asked if asked * speed > 0.0 and (against or by != "acceleration-driven") else 0.0
        pushed = force + 2e5 * float(np.sign(z[0])) * max(abs(z[0]) - 0.02, 0.0)
        z = a @ z + b * pushed + c * rises[k]
        rows.append((*z, force, -(k_s * z[0] + pushed) / m_b))
    slow = np.array(rows)
    assert ride.states == pytest.approx(slow[:, :4], abs=1e-9)
    assert ride.force == pytest.approx(slow[:, 4], abs=1e-5)
    assert ride.body == pytest.approx(slow[:, 5], abs=1e-6)
    scored = slow[2000:]
    size = np.sqrt(np.mean(scored**2, axis=0))
    felt = np.sqrt(np.mean(weighted(slow[:, 5], step)[2000:] ** 2))
    work = scored[:, 4] @ np.diff(slow[1999:, 0])
    stop = 2e5 * (np.abs(scored[:, 0]).max() - 0.02)
    expected = (size[5], felt, k_t * size[2], size[0], np.abs(scored[:, 0]).max(), stop, work / 1.0)
    found = (
        ride.body_acceleration_m_s2, ride.weighted_acceleration_m_s2, ride.tyre_load_N, ride.rattle_m,
        ride.most_rattle_m, ride.end_stop_N, ride.heat_W,
    )  # fmt: skip
    assert found == pytest.approx(expected, rel=1e-6)
    assert ride.end_stop_N > 100.0


# ---------------------------------------------------------------------------------------------- warming up


def test_two_bodies_warm_as_their_heat_balances_are_integrated():
    """Any conductances; left alone for long, all the power leaves by the housing."""
    bodies = TwoBodies(fluid_J_K=170.0, housing_J_K=800.0, between_W_K=5.0, ambient_W_K=1.7)

    def balance(_: float, y: np.ndarray) -> list[float]:
        over = 5.0 * (y[0] - y[1])
        return [(90.0 - over) / 170.0, (over - 1.7 * (y[1] - 11.0)) / 800.0]

    solved = integrate.solve_ivp(balance, (0.0, 240.0), [35.0, 28.0], rtol=1e-10, atol=1e-10).y[:, -1]
    assert bodies.warm((35.0, 28.0), 90.0, 240.0, 11.0) == pytest.approx(solved, rel=1e-7)
    fluid, housing = TwoBodies().warm((20.0, 20.0), 100.0, 1e6)
    assert housing == pytest.approx(20.0 + 100.0 / 2.0)
    assert fluid == pytest.approx(housing + 100.0 / 6.0)


PLAN = LongDrive(duration_s=600.0, every_s=120.0, segment_s=0.5)
WARMED = Vehicle(CAR, skyhook(), Plant(PRESETS["vehicle"]), Constant(0.5))


def test_a_long_drive_warms_the_damper_by_what_it_took_up():
    """Row by row: what damper and coil take up warms fluid and housing; copper is as warm as the fluid."""
    journey = drive_long(WARMED, PLAN, QUIET)
    assert journey.time.tolist() == [0.0, 120.0, 240.0, 360.0, 480.0]
    assert (journey.fluid_degC[0], journey.housing_degC[0]) == (20.0, 20.0)
    assert journey.coil_W == pytest.approx(0.25 * 5.0 * (1.0 + 0.00393 * (journey.fluid_degC - 20.0)))
    at = np.column_stack([journey.fluid_degC, journey.housing_degC])
    power = journey.heat_W + journey.coil_W
    for now, watt, later in zip(at, power, at[1:], strict=False):
        assert later == pytest.approx(TwoBodies().warm(tuple(now), watt, 120.0))
    assert at[-1, 0] > 40.0
    assert not journey.is_cut_off.any()
    first = drive_car(WARMED, replace(QUIET, duration_s=0.5, unscored_s=0.1))
    assert (journey.heat_W[0], journey.tyre_load_N[0]) == (first.heat_W, first.tyre_load_N)
    assert journey.body_acceleration_m_s2[0] == first.body_acceleration_m_s2
    assert journey.force_error_N[0] == first.force_error_N


@pytest.mark.system
def test_the_cut_off_takes_the_current_away_until_it_is_cool_again():
    vehicle = replace(WARMED, controller=Constant(2.0))
    plan = replace(PLAN, duration_s=1080.0, cut_off_degC=60.0, back_degC=50.0)
    journey = drive_long(vehicle, plan, QUIET)
    cut = journey.is_cut_off > 0.0
    assert cut.any()
    assert np.all(journey.coil_W[cut] == 0.0)
    assert np.all(journey.thermometer_degC[cut] > 50.0)
    assert np.all(journey.thermometer_degC[~cut] <= 60.0)
    assert journey.thermometer_degC[cut].min() < 60.0  # it stays away while it cools
    hot = drive_long(vehicle, replace(plan, cut_off_degC=None), QUIET)
    assert hot.fluid_degC.max() > journey.fluid_degC.max()


@pytest.mark.system
def test_a_thermometer_on_the_housing_reads_low_while_the_damper_warms():
    journey = drive_long(WARMED, replace(PLAN, thermometer=lambda _fluid, housing, _power: housing), QUIET)
    assert np.array_equal(journey.thermometer_degC, journey.housing_degC)
    known = drive_long(
        WARMED, replace(PLAN, thermometer=lambda _fluid, housing, power: housing + power / 6.0), QUIET
    )
    # With the true conductance it is high by the power that warms the fluid itself: in a steady rise that is
    # the fluid's share of the heat capacity.
    high = known.thermometer_degC[1:] - known.fluid_degC[1:]
    gradient = known.thermometer_degC[1:] - known.housing_degC[1:]
    assert np.all(np.abs(high) < 150.0 / (150.0 + 950.0) * gradient)


@pytest.mark.system
def test_a_drive_that_would_boil_stays_at_its_limit():
    plan = replace(PLAN, bodies=TwoBodies(ambient_W_K=0.0), ambient_degC=100.0, hottest_degC=120.0)
    journey = drive_long(replace(WARMED, controller=Constant(2.0)), plan, QUIET)
    assert journey.fluid_degC.max() == 120.0


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: QuarterCar(body_kg=-1.0), r"quarter car: body_kg is -1\.0; expected a positive number"),
        (lambda: QuarterCar(tyre_N_m=float("nan")), "tyre_N_m is nan"),
        (lambda: Vehicle(CAR, NOTHING, None, Constant()), "a controller without a damper"),
        (lambda: RoadSegment(duration_s=1.0), "lasts 1 s, of which 2 s are not scored"),
        (lambda: LongDrive(segment_s=100.0), "segments of 100 s every 60 s"),
        (lambda: LongDrive(cut_off_degC=100.0), "cut off at 100 degC and comes back at 110 degC"),
        (lambda: Demand("x", (float("inf"), 0.0, 0.0, 0.0)), "expected four finite numbers"),
        (
            lambda: drive_car(linear(-3000.0), replace(QUIET, duration_s=3.0)),
            r"the damper's travel is -?\d\.\d+ m after \d\.\d+ s; the car is not held",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


# ----------------------------------------------------------------------- a card's damper in the car


def car_card():
    """Return the card of a damper of a car's size: the tests' damper, its envelope a car's."""
    made = card_of(DOUBLE)
    envelope = OperatingEnvelope((0.0, 2.0), (-0.08, 0.08), (-1.5, 1.5), made.envelope.temperature)
    return replace(made, envelope=envelope)


@pytest.fixture(scope="module")
def card():
    return car_card()


def test_a_card_s_controlled_car_rides_between_the_ideal_and_the_passive_one(card):
    """The same road, skyhook: the ideal damper is more comfortable; progress is told by the ride."""
    told: list[ProgressUpdate] = []
    options = QuarterCarOptions(demand="skyhook", duration_s=4.0, unscored_s=1.0)
    rides = drive_quarter_car(card, options, on_progress=told.append)
    assert [(each.done, each.total) for each in told] == [(k, 5) for k in range(5)]
    assert rides.ideal.body_acceleration_m_s2 < rides.controlled.body_acceleration_m_s2
    assert rides.passive.current_rms_A == 0.0 < rides.controlled.current_rms_A
    assert rides.passive.body_acceleration_m_s2 != rides.controlled.body_acceleration_m_s2
    assert rides.controlled.force_error_N is not None
    assert rides.passive.force_error_N is None
    assert [(current, ride.current_rms_A) for current, ride in rides.settings] == [(1.0, 1.0), (2.0, 2.0)]


def test_the_thermometer_is_the_controller_s_alone(card):
    """What it shows changes the controlled ride; all else is bit for bit as before."""
    hot = QuarterCarOptions(duration_s=1.0, unscored_s=0.0, temperature_degC=100.0)
    misled = replace(hot, thermometer_degC=20.0, sensors=VehicleSensors())
    right, wrong = (drive_quarter_car(card, each) for each in (hot, misled))
    assert right.unaware is not None
    assert wrong.true_states is not None
    assert not np.array_equal(right.controlled.states, wrong.true_states.states)
    assert not np.array_equal(wrong.controlled.states, wrong.true_states.states)
    np.testing.assert_array_equal(right.unaware.states, wrong.true_states.states)
    np.testing.assert_array_equal(right.ideal.states, wrong.ideal.states)
    np.testing.assert_array_equal(right.passive.states, wrong.passive.states)


def test_a_thermometer_that_shows_20_degC_is_ridden_where_that_is_more_than_a_kelvin_off(card):
    for degrees, ridden in ((21.0, False), (18.75, True)):
        asked = QuarterCarOptions(duration_s=0.05, unscored_s=0.0, temperature_degC=degrees)
        assert (drive_quarter_car(card, asked).unaware is not None) == ridden


@pytest.mark.parametrize("degrees", [20.0, 90.0])
def test_in_the_car_a_card_s_damper_has_the_temperature_of_the_drive(card, degrees):
    """To the bit the real-time model's force, in kelvin; a copy goes its own way."""
    model = realtime_model(card, period_s=1e-4, speed_m_s=2.0)
    damper, state = RealtimeCarDamper(model, model.start()), model.start()
    for k in range(50):
        expected = model.step(state, 1e-4 * k, 0.1, 1.0, degrees + 273.15)
        damper.copy().advance(0.0, -1.0, 2.0, degrees)
        assert damper.advance(1e-4 * k, 0.1, 1.0, degrees) == expected[1]
        state = expected[0]


def test_a_card_s_damper_warms_on_a_long_drive(card):
    plan = LongDrive(duration_s=180.0, every_s=60.0, segment_s=1.0)
    rides = drive_quarter_car(card, QuarterCarOptions(duration_s=0.5, unscored_s=0.0, long_drive=plan))
    for journey in (rides.journey, rides.passive_journey):
        assert journey is not None
        assert (np.diff(journey.housing_degC) > 0.0).all()


def test_what_a_quarter_car_cannot_have_is_refused(card):
    with pytest.raises(InputError, match="demand is 'sky'; expected one of: skyhook"):
        QuarterCarOptions(demand="sky")
    with pytest.raises(InputError, match="there is no controller 'recomended'"):
        drive_quarter_car(card, QuarterCarOptions(controller="recomended"))
