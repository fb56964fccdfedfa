"""A damper behind an elastic top mount: its limits, its energy, and the linear system."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from mrdamper.control.vehicle.drive import drive_car
from mrdamper.control.vehicle.mount import MountedDamper, TopMount
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.rig.plant import PRESETS, Plant
from tests.control.loops import Constant, Ideal
from tests.control.test_vehicle import CAR, QUIET, linear


def mounted(stiffness, damping=0.0, **changed):
    """Return a viscous damper of 1500 N s/m behind a mount."""
    return replace(linear(1500.0), mount=TopMount(stiffness_N_m=stiffness, damping_N_s_m=damping), **changed)


@pytest.mark.system
@pytest.mark.parametrize(("stiffness", "damping"), [(1e12, 0.0), (4e5, 1e9), (1e12, 1e3)])
def test_behind_a_mount_that_does_not_give_the_ride_is_that_without(stiffness, damping):
    """A mount that is stiff, or damped without bounds, with a linear and a hysteretic damper."""
    road = replace(QUIET, duration_s=0.8, unscored_s=0.0)
    for damper in (Ideal(low=0.0, gain=0.0, viscosity=1500.0), Plant(PRESETS["vehicle"])):
        bare = drive_car(replace(linear(0.0), damper=damper), road)
        stiff = drive_car(replace(mounted(stiffness, damping), damper=damper), road)
        assert stiff.states == pytest.approx(bare.states, abs=1e-6)
        assert stiff.stroke == pytest.approx(bare.stroke, abs=1e-5)
        assert abs(stiff.mount_heat_W) < 1e-2
        assert np.array_equal(bare.stroke, bare.states[:, 0])
        assert bare.mount_heat_W == 0.0


@pytest.mark.system
@pytest.mark.parametrize(
    ("stiffness", "damping", "frequency"),
    [(4e5, 0.0, 1.5), (2e5, 1000.0, 11.0), (2e4, 300.0, 1.5), (2e4, 300.0, 11.0)],
)
def test_a_mounted_linear_damper_gives_the_transmissibility_of_the_linear_system(
    stiffness, damping, frequency
):
    """Its dynamic stiffness is that of mount and damper in series: 1 / (1/(c s) + 1/(k + c_m s))."""
    ride = drive_car(
        mounted(stiffness, damping),
        replace(QUIET, road=Sine(5e-3, frequency), duration_s=5.0, unscored_s=3.0),
    )
    s = 2j * np.pi * frequency
    series = 1.0 / (1.0 / (1500.0 * s) + 1.0 / (stiffness + damping * s))
    closed = CAR.system + np.outer(CAR.by_force, [series, 0.0, 0.0, 0.0])
    z = np.linalg.solve(s * np.eye(4) - closed, CAR.by_road)
    speed = 5e-3 * abs(s)
    body = speed * abs(closed[1] @ z)
    assert ride.body_acceleration_m_s2 == pytest.approx(body / np.sqrt(2.0), rel=1e-2)
    stroke = speed * abs(z[0] * (1.0 - series / (stiffness + damping * s)))
    assert np.sqrt(2.0) * ride.stroke[-20000:].std() == pytest.approx(stroke, rel=1e-2)


@pytest.mark.system
@pytest.mark.parametrize("damping", [0.0, 800.0])
def test_energy_with_a_mount_is_what_the_road_put_in_less_what_damper_and_mount_took(damping):
    """The real hysteretic damper behind an elastic mount; what the mount holds is half k m^2."""
    stiffness = 3e5
    vehicle = replace(mounted(stiffness, damping), damper=Plant(PRESETS["vehicle"]))
    ride = drive_car(vehicle, replace(QUIET, duration_s=3.0, unscored_s=0.0))
    states = np.concatenate([np.zeros((1, 4)), ride.states])
    tyre = -CAR.tyre_N_m * states[:, 2]
    given = float(0.5 * (tyre[1:] + tyre[:-1]) @ ride.road) * ride.step_s
    held = 0.5 * stiffness * (ride.states[-1, 0] - ride.stroke[-1]) ** 2
    stored = CAR.energy(ride.states[-1:])[0] + held
    taken, lost = 3.0 * ride.heat_W, 3.0 * ride.mount_heat_W - held
    assert stored == pytest.approx(given - taken - lost, rel=5e-3)
    assert taken > 0.0
    if damping == 0.0:
        assert abs(lost) < 2e-3 * taken  # a spring alone takes nothing
    else:
        assert lost > 1e-3 * taken


def test_damper_and_mount_carry_one_force():
    """At every step, though the damper is far stiffer than the mount: F = k m of a mount without damping."""
    vehicle = replace(mounted(2e5), damper=Plant(PRESETS["vehicle"]))
    ride = drive_car(vehicle, replace(QUIET, duration_s=1.0, unscored_s=0.0))
    deflection = ride.states[:, 0] - ride.stroke
    assert 2e5 * deflection[:-1] == pytest.approx(ride.force[1:], abs=1e-6)
    assert np.abs(np.diff(ride.force)).max() < 200.0  # it does not swing


class Counting(Ideal):
    """A damper with a spring beside it, which counts how often it is tried."""

    def __init__(self, spring=0.0, **changed):
        super().__init__(gain=0.0, **changed)
        self.spring, self.tried = spring, 0

    def advance(self, displacement, *given):
        self.tried += 1
        return super().advance(displacement, *given) + self.spring * displacement


@pytest.mark.parametrize("damping", [0.0, 300.0])
def test_of_a_linear_damper_a_straight_line_leads_to_the_force(damping):
    """F = c (v - m') + k (x - m) in closed form; after the first step of two trials the second is it."""
    stiffness, viscosity, spring, h = 2e5, 1500.0, 4e4, 1e-4
    damper = Counting(spring, low=0.0, viscosity=viscosity)
    mounted = MountedDamper(damper, TopMount(stiffness_N_m=stiffness, damping_N_s_m=damping))
    gone, at = 1.0 - (math.exp(-h * stiffness / damping) if damping else 0.0), 0.0
    for k in range(600):
        x, speed = 0.01 * math.sin(0.02 * k), math.sin(0.03 * k) + 0.2
        without = viscosity * (speed + at * gone / h) + spring * (x - at * (1.0 - gone))
        force = without / (1.0 + (viscosity / h + spring) * gone / stiffness)
        at += gone * (force / stiffness - at)
        assert mounted.advance(x, speed, 0.0, 20.0) == pytest.approx(force, abs=2e-6)
        assert mounted.deflection == pytest.approx(at, abs=1e-10)
    assert damper.tried == 2 * 600 + 1


def test_damper_and_mount_agree_where_the_force_jumps():
    """Dry friction beside a viscous force: the root that scipy finds; halving alone would take 30 trials."""
    stiffness, h = 3e5, 1e-4
    damper = Counting(low=300.0, viscosity=400.0)
    mounted, at = MountedDamper(damper, TopMount(stiffness_N_m=stiffness)), 0.0
    for k in range(600):
        speed = 0.3 * math.sin(0.05 * k)

        def off(force, speed=speed, at=at):
            slip = speed - (force / stiffness - at) / h
            return 300.0 * np.sign(slip) + 400.0 * slip - force

        force = brentq(off, -1e4, 1e4, xtol=1e-9)
        at = force / stiffness
        assert mounted.advance(0.0, speed, 0.0, 20.0) == pytest.approx(force, abs=1e-5)
        at = mounted.deflection
    assert damper.tried < 28 * 600


@pytest.mark.system
def test_a_mounted_ride_goes_on_where_the_last_one_ended():
    vehicle = replace(mounted(3e5, 500.0), damper=Plant(PRESETS["vehicle"]), controller=Constant(0.7))
    whole = drive_car(vehicle, replace(QUIET, duration_s=1.0, unscored_s=0.0))
    half = replace(QUIET, duration_s=0.5, unscored_s=0.0)
    first = drive_car(vehicle, half)
    second = drive_car(vehicle, half, after=first)
    for name in ("states", "stroke"):
        both = np.concatenate([getattr(first, name), getattr(second, name)])
        assert both == pytest.approx(getattr(whole, name), abs=1e-9)
    for power in ("heat_W", "mount_heat_W"):
        mean = 0.5 * (getattr(first, power) + getattr(second, power))
        assert mean == pytest.approx(getattr(whole, power), rel=1e-6)


def test_a_mount_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="top mount: stiffness_N_m is 0"):
        TopMount(stiffness_N_m=0.0)
    with pytest.raises(InputError, match="top mount: damping_N_s_m is -1"):
        TopMount(stiffness_N_m=1e5, damping_N_s_m=-1.0)
