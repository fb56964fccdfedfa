"""The lumped virtual damper agrees with closed forms, conservation laws, and an independent integrator."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS, CurrentSteps, Sine
from mrdamper.virtual_rig import _plant
from mrdamper.virtual_rig.hydraulic import HydraulicDamper
from mrdamper.virtual_rig.lumped import LUMPED, LumpedDamper
from mrdamper.virtual_rig.plant import STEP_S, Plant, simulate
from tests.support.examples import examples

NOMINAL = LUMPED["nominal"]
NATIVE = Path(__file__).parents[2] / "src" / "mrdamper" / "virtual_rig" / "native"

# The coil driver applies the voltage R0 I without feedback, and the inductance is constant.
BARE_COIL = replace(NOMINAL, driver_V_A=0.0, driver_V_A_s=0.0, inductance_fall=0.0)
# ``QUICK_COIL`` has no lag. ``RIGID`` has a single bristle, but no compliance, magnetic hysteresis or viscous
# force.
QUICK_COIL = replace(BARE_COIL, coil_henry=1e-9, supply_V=1e9, copper_per_K=0.0)
RIGID = replace(NOMINAL, leak_N_s_m=1e30, play_share=0.0, viscous_N=0.0, spread=0.0, offset_N=0.0)


def grid(duration, step=STEP_S):
    return np.arange(round(duration / step) + 1) * step


def at_rest(damper, current, temperature_degC, duration=0.2):
    """Return the time at the end of each step and the response of a damper at rest."""
    still = np.zeros(round(duration / STEP_S))
    response = simulate(damper, still, still, current, temperature_degC)
    return (np.arange(len(still)) + 1) * STEP_S, response


def driven(damper, motion, current, temperature_degC, duration, step=STEP_S):
    time = grid(duration, step)
    x, v = motion.displacement(time), motion.velocity(time)
    return time, x, simulate(damper, x, v, current, temperature_degC, step_s=step).force


# ------------------------------------------------------------------------------------------- coil and field


@pytest.mark.parametrize("degrees", [20.0, 100.0])
def test_coil_current_follows_first_order_lag(degrees):
    """The voltage R0 I gives a coil of resistance R the current I R0 / R (1 - exp(-t R / L))."""
    time, response = at_rest(BARE_COIL, 1.5, degrees, duration=0.05)
    ohm = 5.0 * (1.0 + 0.00393 * (degrees - 20.0))
    expected = 1.5 * 5.0 / ohm * (1.0 - np.exp(-time * ohm / 0.04))
    assert response.coil_current == pytest.approx(expected, rel=1e-11)


def test_integral_control_keeps_current_in_warm_coil():
    """Without integral control, a warm coil of resistance R would get the current I R0 / R."""
    assert at_rest(NOMINAL, 1.7, 123.0)[1].coil_current[-1] == pytest.approx(1.7, rel=1e-6)


def test_supply_voltage_limits_current_and_its_rise():
    damper = replace(NOMINAL, supply_V=6.0, inductance_fall=0.0)
    _, response = at_rest(damper, 2.0, 20.0)
    assert response.coil_current[-1] == pytest.approx(6.0 / 5.0, rel=1e-9)
    assert np.diff(response.coil_current).max() <= 6.0 / 0.04 * STEP_S


def test_magnetic_flux_rises_and_falls_exponentially():
    """Without coil lag, the flux is 1 - exp(-t / rise), then exp(-t / fall). Warm iron reacts faster."""
    damper = replace(QUICK_COIL, fluid_lag_s=1e-9, play_share=0.0)
    n = 1000
    command = np.concatenate([np.ones(n), np.zeros(n)])
    still = np.zeros(2 * n)
    for degrees, quicker in ((20.0, 1.0), (120.0, 1.2)):
        field = simulate(damper, still, still, command, degrees).field
        time = (np.arange(n) + 1) * STEP_S
        assert field[:n] == pytest.approx(1.0 - np.exp(-time * quicker / 0.0045), rel=1e-9)
        assert field[n:] == pytest.approx(field[n - 1] * np.exp(-time * quicker / 0.006), rel=1e-9)


def test_magnetic_hysteresis_shifts_field_by_half_width():
    """The field is half the loop width below a rising current and half the loop width above a falling one."""
    levels = (0.0, 1.0, 2.0, 1.0)
    command = np.repeat(levels, 2000)
    still = np.zeros(len(command))
    field = simulate(BARE_COIL, still, still, command, 20.0).field[1999::2000]
    gap = NOMINAL.play_share * NOMINAL.play_A
    assert field == pytest.approx([0.0, 1.0 - gap, 2.0 - gap, 1.0 + gap], abs=1e-5)


# ----------------------------------------------------------------------------------------- parts of the force


@pytest.mark.parametrize("current", [0.0, 1.0, 2.0])
@pytest.mark.parametrize("spread", [0.0, 0.27])
def test_preyield_force_is_exponential_in_displacement(current, spread):
    """After a travel x, a bristle of stiffness s and maximum force F has the force F (1 - exp(-s x / F))."""
    damper = replace(RIGID, spread=spread, friction_static=1.0, spring_N_m=0.0)
    plant = Plant(damper)
    plant.advance_many(np.zeros(5000), np.zeros(5000), current, 20.0)
    speed, n = 1e-3, 4000
    way = speed * STEP_S * (np.arange(n) + 1)
    force = plant.advance_many(np.zeros(n), np.full(n, speed), current, 20.0)
    g = (np.tanh(current / 1.5) / np.tanh(2.0 / 1.5)) ** 1.2
    level, stiffness = (12.0 + 1300.0 * g) * 1.015, 1.2e6 + 5e6 * g
    stiffness *= 1.015  # Asymmetry increases force and stiffness by the same factor.

    def bristle(ratio):
        return level * (1.0 - np.exp(-ratio * stiffness * way / level))

    expected = (1.0 - 2.0 * spread) * bristle(1.0) + spread * (bristle(0.25) + bristle(4.0))
    expected += 40.0 * (1.0 - np.exp(-4e5 * way / 40.0))
    assert force == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("degrees", [20.0, 123.0])
@pytest.mark.parametrize("speed", [0.004, -0.1])
def test_steady_force_is_sum_of_parts(degrees, speed):
    """The parts are the yield force, a power law of the slip, Stribeck friction, and an offset."""
    n = 40_000
    damper = replace(NOMINAL, play_share=0.0)
    force = simulate(damper, np.zeros(n), np.full(n, speed), 2.0, degrees).force[-1]
    warmer, sign = degrees - 20.0, np.sign(speed)
    level = (12.0 + 1300.0 * (1.0 - 0.0014 * warmer)) * (1.0 + 0.015 * sign)
    eta = np.exp(404.0 * (1.0 / (degrees + 120.0) - 1.0 / 140.0))
    w = abs(speed)
    for _ in range(50):
        viscous = 250.0 * eta * (w / 0.0314) ** 0.88 * 1.15
        w = abs(speed) - (level + viscous) / 1.5e6
    friction = 40.0 * (1.0 - 0.002 * warmer) * (1.0 + 0.5 * np.exp(-((w / 0.003) ** 2)))
    assert force == pytest.approx(sign * (level + viscous + friction) + 6.0, rel=1e-6)


def rates(damper, motion, command, degrees):
    """Return the derivatives of the damper's states, and the force, as functions of time and states."""
    p, warmer = damper, degrees - 20.0
    ohm = p.coil_ohm * (1.0 + p.copper_per_K * warmer)
    kelvin = degrees + 273.15
    eta = np.exp(p.viscosity_K * (1.0 / (kelvin - p.viscosity_pole_K) - 1.0 / (293.15 - p.viscosity_pole_K)))

    def chain(t, y):
        g = (np.tanh(max(y[3], 0.0) / p.field_current_A) / np.tanh(2.0 / p.field_current_A)) ** 1.2
        weights = np.array([1.0 - 2.0 * p.spread, p.spread, p.spread])
        v = float(motion.velocity(t))
        w = v - weights @ y[4:7] / p.leak_N_s_m
        for _ in range(4):
            viscous = np.sign(w) * p.viscous_N * eta * (abs(w) / p.viscous_m_s) ** p.viscous_exponent
            viscous *= 1.0 + p.viscous_field * g
            w = v - (weights @ y[4:7] + viscous) / p.leak_N_s_m
        return g, w, weights @ y[4:7], viscous

    def slope(t, y):
        i, q, flux, fluid, *bristles, friction = y
        wanted = float(command(t))
        error = wanted - i
        asked = p.coil_ohm * wanted + p.driver_V_A * error + q
        volt = min(max(asked, -p.supply_V), p.supply_V)
        henry = p.coil_henry / (1.0 + p.inductance_fall * i * i)
        lag = (p.eddy_rise_s if i > flux else p.eddy_fall_s) / (1.0 + p.eddy_per_K * warmer)
        g, w, _, _ = chain(t, y)
        warm = g * (1.0 - p.yield_loss_per_K * (1.0 + p.low_field_loss * (1.0 - g)) * warmer)
        level, stiffness = p.yield_N + p.yield_field_N * warm, p.stiffness_N_m + p.stiffness_field_N_m * warm
        sign = np.sign(w)
        target = sign * level * (1.0 + p.asymmetry * sign)
        target *= 1.0 + p.position * (float(motion.displacement(t)) / 5e-3) ** 2
        slides = p.friction_N * (1.0 - p.friction_loss_per_K * warmer)
        slides *= 1.0 + (p.friction_static - 1.0) * np.exp(-((w / p.stribeck_m_s) ** 2))
        return [
            (volt - ohm * i) / henry,
            p.driver_V_A_s * error if volt == asked else 0.0,
            (i - flux) / lag,
            (flux - fluid) / p.fluid_lag_s,
            *(
                ratio * stiffness * abs(w) / level * (target - z)
                for ratio, z in zip((1.0, 0.25, 4.0), bristles, strict=True)
            ),
            p.friction_N_m * abs(w) / slides * (sign * slides - friction),
        ]

    def force(t, y):
        _, _, held, viscous = chain(t, y)
        return held + viscous + y[7] + p.spring_N_m * float(motion.displacement(t)) + p.offset_N

    return slope, force


@pytest.mark.parametrize("preset", ["nominal", "hard"])
def test_plant_force_matches_stiff_solver(preset):
    """The reference is LSODA. Magnetic hysteresis is disabled because it is not a differential equation."""
    damper = replace(LUMPED[preset], play_share=0.0)
    motion, degrees = Sine(4e-3, 3.0), 70.0
    command = CurrentSteps((1.3, 0.2, 0.9), 0.08).current
    slope, force_of = rates(damper, motion, command, degrees)
    time = grid(0.25)[1:]
    solved = solve_ivp(
        slope, (0.0, time[-1]), np.zeros(8), method="LSODA", t_eval=time, rtol=1e-7, atol=1e-6, max_step=1e-3
    )
    expected = np.array([force_of(t, y) for t, y in zip(time, solved.y.T, strict=True)])
    x, v = motion.displacement(time), motion.velocity(time)
    response = simulate(damper, x, v, command(time - STEP_S / 2), degrees)
    size = np.abs(expected).max()
    assert np.sqrt(np.mean((response.force - expected) ** 2)) < 0.003 * size
    assert response.coil_current == pytest.approx(solved.y[0], abs=0.02)
    assert response.field == pytest.approx(solved.y[3], abs=0.02)


def test_plant_integration_has_first_order():
    """Errors are proportional to 1 - 1/10 and 1/2 - 1/10 because the reference has a tenth of the step."""
    forces = {
        k: driven(NOMINAL, Sine(5e-3, 1.0), 1.0, 40.0, 1.2, step=STEP_S / k)[2][::k] for k in (1, 2, 10)
    }
    coarse, half = (np.sqrt(np.mean((forces[k] - forces[10]) ** 2)) for k in (1, 2))
    assert coarse / half == pytest.approx(0.9 / 0.4, rel=0.15)


# ------------------------------------------------------------------------------------------- physical laws


@given(
    preset=st.sampled_from(sorted(LUMPED)),
    amplitude=st.floats(0.5e-3, 15e-3),
    frequency=st.sampled_from([0.5, 1.0, 2.0, 4.0]),
    current=st.floats(0.0, 2.0),
    degrees=st.floats(-20.0, 140.0),
)
def test_virtual_damper_dissipates_energy_per_cycle(preset, amplitude, frequency, current, degrees):
    time, x, force = driven(
        LUMPED[preset], Sine(amplitude, frequency), current, degrees, 1.0 + 1.0 / frequency
    )
    cycle = time >= 1.0 - 1e-9
    assert np.trapezoid(force[cycle], x[cycle]) > 0.0


@examples(15)
@given(
    preset=st.sampled_from(sorted(LUMPED)),
    current=st.floats(-2.0, 2.0),
    degrees=st.floats(0.0, 130.0),
    amplitude=st.floats(1e-3, 1e-2),
)
def test_plant_force_is_odd_in_motion(preset, current, degrees, amplitude):
    """Without asymmetry and offset, a reversed motion exactly reverses the force."""
    damper = replace(LUMPED[preset], asymmetry=0.0, offset_N=0.0)
    time = grid(0.6)
    motion = Sine(amplitude, 2.0)
    x, v = motion.displacement(time), motion.velocity(time)
    force = simulate(damper, x, v, current, degrees).force
    assert np.array_equal(simulate(damper, -x, -v, current, degrees).force, -force)


@pytest.mark.parametrize("preset", sorted(LUMPED))
def test_plant_force_depends_on_temperature_and_current(preset):
    def peak(current, degrees):
        time, _, force = driven(LUMPED[preset], Sine(5e-3, 1.0), current, degrees, 2.0)
        return np.abs(force[time >= 1.0]).max()

    by_warmth = [[peak(current, degrees) for degrees in (0, 20, 60, 123)] for current in (0.0, 0.7, 2.0)]
    assert (np.diff(by_warmth, axis=1) < 0.0).all()
    assert (np.diff(by_warmth, axis=0) > 0.0).all()


# ------------------------------------------------------------- blocks of steps, saved states, invalid samples


def rough_run(n=3000, seed=2):
    noise = np.random.default_rng(seed)
    time = np.arange(n) * STEP_S
    motion = MOTIONS["nonperiodic"]
    return (
        motion.displacement(time),
        motion.velocity(time),
        np.repeat(noise.uniform(0.0, 2.0, n // 10), 10),
        50.0 + np.cumsum(noise.normal(0.0, 0.01, n)),
    )


def test_batch_of_plant_steps_equals_single_steps():
    run = rough_run()
    steps, blocks = Plant(NOMINAL), Plant(NOMINAL)
    stepwise = [steps.advance(*map(float, sample)) for sample in zip(*run, strict=True)]
    blockwise = [
        blocks.advance_many(*(channel[k : k + 10] for channel in run)) for k in range(0, len(run[0]), 10)
    ]
    assert np.array_equal(stepwise, np.concatenate(blockwise))
    assert np.array_equal(stepwise, simulate(NOMINAL, *run).force)
    assert steps.state == blocks.state


def test_restored_plant_state_repeats_force():
    x, v, command, degrees = rough_run()
    plant = Plant(NOMINAL)
    plant.advance_many(x[:1500], v[:1500], command[:1500], degrees[:1500])
    kept, branch = plant.state, plant.copy()
    rest = x[1500:], v[1500:], command[1500:], degrees[1500:]
    tried = branch.advance_many(rest[0], rest[1], 0.0, 20.0)
    assert plant.state == kept
    force = plant.advance_many(*rest)
    assert not np.array_equal(force, tried)
    plant.state = kept
    assert np.array_equal(plant.advance_many(*rest), force)
    assert plant.coil_current == dict(zip(_plant.STATE["lumped"], plant.state, strict=True))["coil_A"]


@pytest.mark.parametrize(
    ("sample", "value"), [("displacement", np.nan), ("velocity", np.inf), ("temperature", 293.15)]
)
def test_invalid_sample_leaves_plant_state_unchanged(sample, value):
    run = dict(zip(("displacement", "velocity", "current", "temperature"), rough_run(100), strict=True))
    run[sample] = run[sample].copy()
    run[sample][60] = value
    plant = Plant(NOMINAL)
    before = plant.state
    with pytest.raises(InputError, match="sample 60: expected finite numbers"):
        plant.advance_many(*run.values())
    assert plant.state == before


# ------------------------------------------------------------------------ independence of the kernel


def test_plant_parameters_are_equal_in_c_and_python():
    for damper in (LumpedDamper, HydraulicDamper):
        assert set(_plant.PARAMETERS[damper.kind]) == {field.name for field in fields(damper)} - {"name"}


def test_plant_includes_no_kernel_code():
    included = {
        name
        for path in NATIVE.iterdir()
        for name in re.findall(r'#include\s+[<"](.+?)[>"]', path.read_text(encoding="utf-8"))
    }
    standard = {"Python.h", "math.h", "stdint.h", "stdlib.h", "string.h"}
    interface = {"loop_plant.h"}  # The header declares a function for the control loop in C.
    assert included == {*standard, *interface, "plant.h", "hydraulic.h"}
