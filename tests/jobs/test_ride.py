"""``mrdamper ride``: a card's damper in a quarter car, with its controller and without current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrdamper
from mrdamper.control.vehicle.car import QuarterCar
from mrdamper.control.vehicle.quarter_car import QuarterCarOptions, drive_quarter_car
from mrdamper.errors import InputError, UsageError
from mrdamper.jobs.export import export
from mrdamper.jobs.options import ExportOptions, RideOptions
from mrdamper.jobs.ride import ride
from mrdamper.models.card_schema import write_card
from mrdamper.registry import JOBS
from mrdamper.report.ride import REPORT
from tests.control.dampers import DOUBLE
from tests.control.test_vehicle import car_card
from tests.export.exports import card_of

SHORT = RideOptions(demand="skyhook", duration_s=4.0, warm_up_s=0.0)
HOUSING, OHM = 300.0, 4.0
FLUID = 150.0  # J/K, of the fluid's body


@pytest.fixture(scope="module")
def ridden():
    """Return a ride whose damper warms for five minutes and loses nothing to the air."""
    return ride(
        car_card(),
        replace(
            SHORT,
            temperature_degC=100.0,
            warm_up_s=300.0,
            cooling_W_K=0.0,
            housing_J_K=HOUSING,
            coil_resistance_ohm=OHM,
            ambient_degC=30.0,
        ),
    )


def test_it_drives_as_the_function_behind_does():
    """Bit for bit, by all that both can be told."""
    options = replace(
        SHORT,
        controller="paper",
        damping_N_s_m=3000.0,
        road_class="D",
        speed_m_s=15.0,
        body_kg=400.0,
        wheel_kg=50.0,
        spring_N_m=25e3,
        tyre_N_m=250e3,
        temperature_degC=60.0,
        seed=9,
    )
    behind = QuarterCarOptions(
        car=QuarterCar(body_kg=400.0, wheel_kg=50.0, spring_N_m=25e3, tyre_N_m=250e3),
        demand="skyhook",
        damping_N_s_m=3000.0,
        controller="paper",
        road_class="D",
        speed_m_s=15.0,
        duration_s=4.0,
        temperature_degC=60.0,
        seed=9,
    )
    found, expected = ride(car_card(), options).rides, drive_quarter_car(car_card(), behind)
    for name in ("controlled", "ideal", "passive"):
        np.testing.assert_array_equal(getattr(found, name).states, getattr(expected, name).states)


def test_without_losses_all_that_a_damper_takes_up_is_in_its_temperatures(ridden):
    """The heat of road and coil is that of fluid and housing, in either car."""
    for journey in (ridden.rides.journey, ridden.rides.passive_journey):
        assert journey.fluid_degC[0] == journey.housing_degC[0] == 30.0
        taken = 60.0 * np.cumsum(journey.heat_W + journey.coil_W)[:-1]
        stored = FLUID * (journey.fluid_degC - 30.0) + HOUSING * (journey.housing_degC - 30.0)
        np.testing.assert_allclose(stored[1:], taken, rtol=1e-9)
    assert not ridden.rides.passive_journey.coil_W.any()
    assert ridden.rides.journey.coil_W.all()


def test_the_ideal_car_rides_more_comfortably_than_either(ridden):
    by_name = {name: each.body_acceleration_m_s2 for name, each in ridden.cars}
    assert by_name["ideal"] < min(by_name["passive"], by_name["controlled"])


def test_a_smoother_road_is_felt_less(ridden):
    smoother = ride(car_card(), replace(SHORT, road_class="A"))
    assert smoother.rides.passive.body_acceleration_m_s2 < ridden.rides.passive.body_acceleration_m_s2
    assert smoother.rides.journey is None


def test_files_and_figures(ridden, tmp_path):
    path = tmp_path / "card.json"
    write_card(car_card(), path)
    out = tmp_path / "out"
    answer = JOBS["ride"].perform({"card": path}, SHORT, out=out)[1]
    assert sorted(each.name for each in out.iterdir()) == ["ride.csv", "ride.html", "ride.json", "ride.svg"]
    cars = [car["car"] for car in answer["cars"]]
    assert cars == ["passive", "passive, 1 A", "passive, 2 A", "controlled", "ideal"]
    assert answer["temperatures"] == []
    mrdamper.ride  # noqa: B018 - binds what follows
    ridden.save(tmp_path / "warm")
    lines = (tmp_path / "warm" / "temperatures.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("time_s,passive_fluid_degC")
    assert len(lines) == 1 + 5
    assert len(ridden.summary().splitlines()) == 4
    assert len(ridden.plot().axes) == 3


def test_a_controller_that_knows_of_the_heat_gives_a_hot_damper_more_current(ridden):
    assert ridden.rides.controlled.current_rms_A > 1.5 * ridden.rides.unaware.current_rms_A
    assert ride(car_card(), SHORT).rides.unaware is None


def test_a_recorded_road_takes_the_place_of_the_class(tmp_path):
    card, road = tmp_path / "card.json", tmp_path / "road.csv"
    write_card(car_card(), card)
    heights = "\n".join(f"{0.1 * k:.1f},{0.01 * (k // 50 % 2):g}" for k in range(500))
    road.write_text(f"distance_m,height_m\n{heights}\n", encoding="utf-8")
    rough, answer = JOBS["ride"].perform({"card": card, "profile": road}, SHORT)
    assert answer["profile"] == "road.csv"
    level = replace(SHORT, road_class="A")
    assert rough.rides.passive.tyre_load_N > 1.5 * ride(car_card(), level).rides.passive.tyre_load_N


def test_an_obstacle_is_driven_over_once():
    found = ride(
        car_card(), replace(SHORT, road_class="pothole", obstacle_height_m=0.05, obstacle_length_m=1.0)
    )
    road = found.rides.passive.road * found.rides.passive.step_s
    assert road.sum() == pytest.approx(0.0, abs=1e-9)
    assert np.cumsum(road).min() == pytest.approx(-0.05, rel=1e-3)


def test_what_leaves_the_card_s_envelope_is_noted(ridden):
    rig_card = card_of(DOUBLE)
    rig_card = replace(rig_card, envelope=replace(rig_card.envelope, displacement=(-1e-3, 1e-3)))
    said = ride(rig_card, SHORT).notes
    assert any("displacement" in note and "identified on -1 to 1 mm" in note for note in said)
    assert not any("displacement" in note for note in ridden.notes)


def test_what_cannot_ride_is_refused():
    volts = replace(car_card(), damper=replace(car_card().damper, command_unit="V"))
    with pytest.raises(InputError, match="the card's command is a voltage"):
        ride(volts, SHORT)
    with pytest.raises(InputError, match="there is no controller 'papr'"):
        ride(car_card(), replace(SHORT, controller="papr"))


def test_what_estimated_states_cost_is_told():
    """The same car on its true states rides beside it, bit for bit the one without sensors."""
    quick = replace(SHORT, duration_s=2.5)
    found = ride(car_card(), replace(quick, states="estimated", wheel_accelerometer=True))
    assert [name for name, _ in found.cars][-3:] == ["true states", "controlled", "ideal"]
    true = found.rides.true_states
    assert true is not None
    np.testing.assert_array_equal(true.states, ride(car_card(), quick).rides.controlled.states)
    assert found.rides.controlled.state_errors is not None
    assert REPORT.summary is not None
    said = "\n".join(REPORT.summary(found))
    assert "estimated states: weighted acceleration" in said
    assert "mm/s rms" in said


@pytest.mark.nightly
def test_a_top_mount_takes_its_share_of_the_stroke():
    quick = replace(SHORT, duration_s=2.5)
    soft = ride(car_card(), replace(quick, mount_N_m=1e5, mount_damping_N_s_m=200.0)).rides.passive
    assert np.abs(soft.states[:, 0] - soft.stroke).max() > 1e-3
    assert 0.0 < soft.mount_heat_W < soft.heat_W
    stiff, none = ride(car_card(), replace(quick, mount_N_m=1e9)), ride(car_card(), quick)
    assert stiff.rides.controlled.tyre_load_N == pytest.approx(none.rides.controlled.tyre_load_N, rel=1e-3)


@pytest.mark.parametrize(
    ("job", "options", "told"),
    [
        (ride, RideOptions(body_noise_m_s2=0.1), ("--body-noise", "--states estimated")),
        (ride, RideOptions(mount_damping_N_s_m=100.0), ("--mount-damping", "--mount-N-m")),
        (export, ExportOptions(body_kg=400.0), ("--body-kg", "--demand")),
    ],
    ids=["sensors that nothing reads", "damping of no mount", "a car without a demand"],
)
def test_what_would_change_nothing_is_refused_with_what_it_needs(job, options, told):
    with pytest.raises(UsageError) as fault:
        job(car_card(), options)
    assert all(name in str(fault.value) for name in told)
