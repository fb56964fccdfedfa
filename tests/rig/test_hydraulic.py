"""The hydraulic damper conserves energy and agrees with an integrator and another implementation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.excitation import CurrentSteps, Motion, Sine
from mrdamper.virtual_rig import _plant
from mrdamper.virtual_rig.damper import draw_variant
from mrdamper.virtual_rig.hydraulic import HYDRAULIC
from mrdamper.virtual_rig.plant import Plant, PlantResponse, simulate
from tests.oracles.hydraulic_damper import Hydraulics, reference_force

BENCH = HYDRAULIC["hydraulic-bench"]
SINES = {"hydraulic-bench": Sine(5e-3, 1.0), "hydraulic-monotube": Sine(25e-3, 1.0)}
HIGHEST_A = {"hydraulic-bench": 2.0, "hydraulic-monotube": 5.0}

# Values of a separate implementation with steps of 10 us. Each preset has its starting position [m] and
# speeds [m/s], followed by the force at x = 0 [N] for each temperature and current.
AT_CONSTANT_SPEED = {
    "hydraulic-bench": (-0.02, (0.01, 0.03, 0.1), {
        (20, 0): (98.17, 181.2, 472.2), (20, 1): (971, 1116, 1483), (20, 2): (1488, 1675, 2076),
        (70, 0): (71.71, 111.2, 255.5), (70, 1): (862.4, 951.8, 1151), (70, 2): (961.7, 1457, 1680),
        (120, 0): (60.94, 84.53, 175.1), (120, 1): (606.7, 792.3, 923.4), (120, 2): (606.7, 1219, 1369),
    }),
    "hydraulic-monotube": (-0.05, (0.05, 0.15, 0.4), {
        (20, 0): (-140.2, 59.00, 603.4), (20, 2): (1477, 1817, 2492), (20, 5): (2825, 3300, 4061),
        (70, 0): (-301.4, -210.4, 65.54), (70, 2): (1167, 1353, 1716), (70, 5): (1602, 2680, 3096),
        (120, 0): (-450.7, -389, -188.1), (120, 2): (696.4, 923.7, 1184), (120, 5): (696.4, 2040, 2338),
    }),
}  # fmt: skip
# Preset, temperature, current before and after a step, then times to 63 % and 90 % of the force change [ms]
STEPS = (
    ("hydraulic-bench", 20, 0, 1, 9.2, 14.0), ("hydraulic-bench", 20, 2, 0, 6.4, 11.6),
    ("hydraulic-bench", 120, 0, 2, 6.0, 8.6), ("hydraulic-bench", 120, 2, 1, 5.2, 9.0),
    ("hydraulic-monotube", 20, 0, 2, 9.4, 13.4), ("hydraulic-monotube", 20, 5, 0, 22.4, 51.2),
    ("hydraulic-monotube", 120, 5, 2, 6.0, 9.4), ("hydraulic-monotube", 120, 5, 0, 15.4, 34.0),
)  # fmt: skip
# Preset and temperature, then half the height of the force loop [N] and the area of the loop [J]. The four
# currents are 0, 1/4, 1/2 and 1 times the largest current.
LOOPS = (
    ("hydraulic-bench", 20, (187.1, 529.9, 1124.4, 1684.5), (3.121, 9.769, 21.232, 31.844)),
    ("hydraulic-monotube", 120, (179.3, 824.3, 1869.1, 2600.4), (14.725, 77.836, 175.715, 238.65)),
)


def driven(
    preset: str, motion: Motion, current: float, degrees: float, duration: float, step=1e-3
) -> PlantResponse:
    time = np.arange(round(duration / step) + 1) * step
    x, v = motion.displacement(time), motion.velocity(time)
    return simulate(HYDRAULIC[preset], x, v, current, degrees, step_s=step)


@pytest.mark.parametrize("preset", HYDRAULIC)
def test_steady_forces_match_separate_implementation(preset):
    start, speeds, forces = AT_CONSTANT_SPEED[preset]
    for (degrees, current), expected in forces.items():
        for speed, force in zip(speeds, expected, strict=True):
            moving = start + speed * np.arange(round(-start / speed * 1e3) + 1) * 1e-3
            x = np.concatenate([np.full(1000, start), moving])
            v = np.where(np.arange(len(x)) < 1000, 0.0, speed)
            found = simulate(
                HYDRAULIC[preset], x, v, float(current), float(degrees), step_s=1e-3, solver_step_s=1e-4
            ).force[-1]
            assert found == pytest.approx(force, rel=1e-3), (degrees, current, speed)


@pytest.mark.parametrize(("preset", "degrees", "before", "after", "t63_ms", "t90_ms"), STEPS)
def test_step_responses_match_separate_implementation(preset, degrees, before, after, t63_ms, t90_ms):
    """The damper moves at constant speed. The driver of ``hydraulic-monotube`` reduces its current slowly."""
    step, speed = 2e-4, 0.03 if preset == "hydraulic-bench" else 0.15
    time = np.arange(-6250, 1251) * step
    x = speed * np.maximum(time, -0.25)
    v = np.where(time < -0.25 - 1e-9, 0.0, speed)
    command = np.where(time < 1e-9, float(before), float(after))
    force = simulate(HYDRAULIC[preset], x, v, command, float(degrees), step_s=step).force[6250:]
    share = (force - force[0]) / (force[-1] - force[0])
    for level, expected in ((0.63, t63_ms), (0.9, t90_ms)):
        found = 1e3 * step * int(np.argmax(share >= level))
        assert found == pytest.approx(expected, abs=0.2 + 1e-9)


@pytest.mark.parametrize(("preset", "degrees", "heights", "areas"), LOOPS)
def test_force_loops_match_separate_implementation(preset, degrees, heights, areas):
    motion, found = SINES[preset], []
    for share in (0.0, 0.25, 0.5, 1.0):
        force = driven(preset, motion, share * HIGHEST_A[preset], degrees, 3.0).force[2000:]
        v = motion.velocity(np.arange(2000, 3001) * 1e-3)
        found.append((0.5 * float(np.ptp(force)), float(np.trapezoid(force * v, dx=1e-3))))
    assert pytest.approx(np.array([heights, areas]), rel=1e-3) == np.array(found).T
    assert all(low < high for low, high in pairwise(found))


@pytest.mark.parametrize(("preset", "current", "degrees"), [
    ("hydraulic-bench", 0.0, 120.0), ("hydraulic-bench", 2.0, 20.0),
    ("hydraulic-monotube", 0.0, 20.0), ("hydraulic-monotube", 5.0, 120.0),
])  # fmt: skip
def test_hydraulic_work_is_stored_or_dissipated(preset, current, degrees):
    """The energy balance covers a cycle at 2 Hz, with steps of 10 us."""
    damper, step, (half, whole) = HYDRAULIC[preset], 1e-5, (25_000, 75_001)
    motion = Sine(SINES[preset].amplitude, 2.0)
    plant = Plant(damper, step_s=step, solver_step_s=step)
    time = np.arange(whole) * step
    x, v = motion.displacement(time), motion.velocity(time)
    plant.advance_many(x[:half], v[:half], current, degrees)
    states, force = [], []
    for k in range(half, whole):
        force.append(plant.advance(x[k], v[k], current, degrees))
        states.append(plant.state)
    s = dict(zip(_plant.STATE["hydraulic"], np.array(states).T, strict=True))
    stored, lost = _energies(Hydraulics(damper, degrees), s, x[half:], v[half:], step)
    work = float(np.trapezoid(np.array(force) * v[half:], dx=step))
    assert work == pytest.approx(stored[-1] - stored[0] + lost, abs=2e-6 * work)


def _energies(of: Hydraulics, s, x, v, step) -> tuple[np.ndarray, float]:
    """Return the stored energy [J] at each step, and the loss between the first and the last step."""
    p = of.p
    one, two = s["pressure_1_Pa"], s["pressure_2_Pa"]
    seal = np.array([s["piston_m"] - s[f"seal_{k}_m"] for k in (1, 2, 3, 4)]).T
    stiff = p.friction_N_m * np.array([0.1, 0.2, 0.3, 0.4])
    e, rate = x - s["piston_m"], v - s["piston_m_s"]
    beyond = np.maximum(np.abs(e) - p.joint_gap_m, 0.0)

    def free(pressure):  # Free energy of oil with gas, per content of oil [J/m^3]
        return 0.5 * of.a * pressure**2 + of.b * np.log(pressure)

    def enthalpy(pressure):
        return free(pressure) + pressure * (of.c0 - of.a * pressure + of.b / pressure)

    content = s["content_m3"]
    inertance = p.density_kg_m3 * (p.active_m + p.passive_m) / (of.width * p.gap_m)
    stored = content * free(one) + (of.content - content) * free(two)
    stored += 0.5 * p.piston_kg * s["piston_m_s"] ** 2 + 0.5 * inertance * s["flow_m3_s"] ** 2
    stored += 0.5 * p.joint_N_m * e**2 + 0.25 * p.joint_N_m3 * e**4 + 0.4 * p.pin_N * beyond**2.5
    stored += 0.5 * seal**2 @ stiff
    # Atmospheric pressure acts on the rod. The loss of a flow is the drop of its enthalpy minus the work that
    # accelerates the oil.
    stored += 101325.0 * (of.A2 - of.A1) * s["piston_m"]
    flow = s["flow_m3_s"] + _bypass(of, one - two)
    power = (enthalpy(one) - enthalpy(two)) * flow
    power -= 0.5 * inertance * np.gradient(s["flow_m3_s"] ** 2, step)
    power += p.joint_N_s_m * rate**2 + p.pin_N * beyond**1.5 * p.pin_s_m * rate**2
    force = seal * stiff
    level = np.gradient(np.array([s[f"seal_{k}_m"] for k in (1, 2, 3, 4)]), step, axis=1).T
    power += np.sum(force * level, axis=1)
    lost = float(np.trapezoid(power, dx=step))
    if p.gas_m3 > 0.0:
        volume = (s["gas"] / two) ** (1.0 / p.gas_exponent)
        stored = stored + two * volume / (p.gas_exponent - 1.0)
        heat = volume ** (1.0 - p.gas_exponent) / (p.gas_exponent - 1.0)
        lost -= float(np.trapezoid(heat, s["gas"]))
    return stored, lost


def _bypass(of: Hydraulics, drop):
    return of.p.bypass_m2 * np.sqrt(2.0 / of.p.density_kg_m3) * drop / (drop**2 + of.p.bypass_Pa**2) ** 0.25


@pytest.mark.nightly
@pytest.mark.parametrize("degrees", [20.0, 120.0])
@pytest.mark.parametrize("preset", HYDRAULIC)
def test_hydraulic_force_matches_adaptive_integrator(preset, degrees):
    """The current falls to 0.3 A and to zero during the motion, which begins with a velocity jump."""
    motion, command = Sine(SINES[preset].amplitude, 2.0), CurrentSteps((HIGHEST_A[preset], 0.3, 0.0), 0.15)
    time = np.arange(451) * 1e-3
    expected = reference_force(HYDRAULIC[preset], motion, command, degrees, np.asarray(time, np.float64))
    x, v = motion.displacement(time), motion.velocity(time)
    held = command.current(time - 0.5e-3)  # The current is constant between two samples.
    errors = [
        np.abs(
            simulate(HYDRAULIC[preset], x, v, held, degrees, step_s=1e-3, solver_step_s=step).force - expected
        ).max()
        for step in (2e-5, 1e-5)
    ]
    assert errors[1] < 1e-4 * np.abs(expected).max()
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)  # The method has order two.


@pytest.mark.parametrize(
    "damper", [draw_variant(each, 2 * k) for each in HYDRAULIC.values() for k in range(4)]
)
def test_randomised_dampers_dissipate_energy(damper):
    preset = damper.name.rpartition("-")[0]
    drawn = {
        name: getattr(damper, name) / getattr(HYDRAULIC[preset], name)
        for name in ("bore_m", "gap_m", "turns")
    }
    assert all(1 / 1.3 <= factor <= 1.3 for factor in drawn.values())
    assert len(set(drawn.values())) == 3
    assert damper.driver_V_A == HYDRAULIC[preset].driver_V_A
    assert draw_variant(HYDRAULIC[preset], int(damper.name.rpartition("-")[2])) == damper
    motion, time = SINES[preset], np.arange(2001) * 1e-3
    for degrees in (20.0, 120.0):
        force = simulate(
            damper, motion.displacement(time), motion.velocity(time), HIGHEST_A[preset], degrees, step_s=1e-3,
            solver_step_s=1e-4,
        ).force[1000:]  # fmt: skip
        work = float(np.trapezoid(force * motion.velocity(time[1000:]), dx=1e-3))
        assert 0.5 < work / (4.0 * motion.amplitude * 0.5 * np.ptp(force)) < 1.0


@pytest.mark.parametrize(("x", "degrees"), [(0.0406, 20.0), (0.0, np.nan)])
def test_displacement_beyond_hydraulic_chambers_is_rejected(x, degrees):
    with pytest.raises(InputError, match="displacement within 90 % of the chambers"):
        Plant(BENCH).advance(x, 0.0, 0.0, degrees)
