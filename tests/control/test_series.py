"""The series valve law on a target: its model against the kernel's law, its inverse against a plant.

Figures in the docstrings are what was measured when the test was written; the bound beside them is promised.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.control.card_plant import CardPlant
from mrdamper.control.controllers import NAMES, Safety, check_name, controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.realtime import realtime_model
from mrdamper.control.scenario import SCENARIOS, Sensing
from mrdamper.control.score import attainable_range, score_run
from mrdamper.control.stepper import Flag
from mrdamper.control.tables.heating import NO_HEATING
from mrdamper.control.tables.series import tabulate_power, tabulate_series
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS, Trajectory
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import (
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Linear
from tests.control.dampers import DOUBLE, LAGS, SERIES, changed
from tests.control.rows import answer, at_speed, told

KELVIN = 333.15
AT_ONCE = Actuation(0.0, 0.0, largest_command=2.0)
# A spring so stiff that it settles within 0.1 ms, and a valve that is all but dry friction.
STIFF: dict[str, ParameterLaw] = {
    "gap_stiffness": Constant(1.6e8), "gap": Constant(1.3e-5), "gap_corner": Constant(7.5e-6),
    "leak_damping": Constant(1.9e4), "leak_exponent": Constant(1.01), "yield_velocity": Constant(1.5e-5),
}  # fmt: skip


def damper(lag: Actuation | None = LAGS, /, **changed: ParameterLaw) -> Damper:
    return replace(SERIES, coefficients={**SERIES.coefficients, **changed}, actuation=lag)


ALL = controllers_for(damper())
RECOMMENDED = ALL["recommended"]


# ------------------------------------------------------------------------------------------- tables


@pytest.mark.parametrize("exponent", [0.2, 0.43, 0.95, 1.0, 1.5])
def test_a_power_is_one_octave_and_a_factor(exponent: float) -> None:
    """Within 1e-5 over all octaves; a straight line below the first; what is doubled grows by 2^m."""
    power = tabulate_power(exponent)
    u = np.geomspace(power.least, 7.9, 20_001)
    assert np.abs(power.at(u) / u**exponent - 1.0).max() < 1e-5
    assert power.at(0.25 * power.least) == pytest.approx(0.25 * power.least**exponent)
    assert power.at(2.0 * u[:15_000]) / power.at(u[:15_000]) == pytest.approx(2.0**exponent, rel=1e-12)


def test_what_is_tabulated_of_a_speed_is_near() -> None:
    tables, _ = tabulate_series(damper(), 2.0, (293.15, 293.15))
    u = np.linspace(0.0, 200.0, 40_001)
    assert np.abs(tables.side.at(u) - np.tanh(u)).max() < 1e-5
    assert np.abs(tables.fade.at(u) - np.exp(-u * u)).max() < 2e-5


def test_in_float_the_tables_take_at_most_sixteen_kilobytes() -> None:
    """10.7 kB, the unused tables of the other laws included."""
    made = RECOMMENDED.tables
    assert made.series is not None
    arrays = [
        made.series.yield_force,
        made.series.chain,
        made.factor,
        made.column,
        *(o.cell for o in made.lookups),
    ]
    arrays += [
        each
        for p in ("thinning", "leak", "viscous")
        for each in (getattr(made.series, p).scale, getattr(made.series, p).cell)
    ]
    arrays += [getattr(made.series, name).cell for name in ("side", "fade")]
    assert sum(4 * each.size for each in arrays) < 16_384


# ------------------------------------------------------------------------------------------- the model


def forces(
    model: Damper, rate: int, *columns: FloatArray, single: bool = False, **values: float
) -> FloatArray:
    """Return the real-time model's force [N] along displacement, velocity, current and temperature."""
    at_once = Safety(smooth_s=1e-6, slew_K_s=1e6, jump_K=1e3)
    made = realtime_model(model, period_s=1.0 / rate, largest=2.0, safety=at_once, heating=NO_HEATING)
    made = replace(changed(made, **values), single=single)
    return made.run(made.start(), np.column_stack(np.broadcast_arrays(*columns)))[1]


def driven(seconds: float, rate: int) -> tuple[FloatArray, ...]:
    """Random motion with reversals, a current that swings between its ends, a temperature ramp."""
    t = np.arange(round(seconds * rate) + 1) / rate
    rng = np.random.default_rng(3)
    hertz, size, phase = rng.uniform(0.3, 6.0, 12), rng.standard_normal(12), rng.uniform(0.0, 6.28, 12)
    size *= 1e-2 / (hertz * np.abs(size / hertz).sum())
    angle, turn = np.outer(t, 2.0 * np.pi * hertz) + phase, 2.0 * np.pi * hertz
    x, v = np.sin(angle) @ size, np.cos(angle) @ (turn * size)
    current = np.clip(1.0 + 1.3 * np.sin(19.0 * t + 1.0) + 0.4 * np.sin(69.0 * t), 0.0, 2.0)
    return x, v, -np.sin(angle) @ (turn * turn * size), current, 293.15 + 100.0 * t / seconds


@pytest.mark.system
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize(
    ("rate", "usual", "stiff"), [(100, 2.0, 2.0), (500, 0.3, 0.5), (1000, 0.15, 0.4), (5000, 0.1, 0.15)]
)
def test_the_model_is_the_law(rate: int, usual: float, stiff: float, single: bool) -> None:
    """Against the kernel's law at 20 kHz: RMSE in % of the force's RMS."""
    seconds, fine = 4.0, 20_000
    x, v, a, current, kelvin = driven(seconds, fine)
    step = fine // rate
    for model, bound in ((damper(None), usual), (damper(None, **STIFF), stiff)):
        truth = simulate(model, Trajectory(1.0 / fine, x, v, a, current, temperature=kelvin))[::step]
        force = forces(model, rate, *(each[::step] for each in (x, v, current, kelvin)), single=single)
        error = force - truth
        # the first force is without inertia, whose acceleration is differenced
        assert abs(error[0]) < 0.4 * abs(a[0]) + 1.0
        assert 100.0 * np.sqrt(np.mean(error[1:] ** 2) / np.mean(truth**2)) < bound


def test_smaller_steps_bring_the_model_to_the_law() -> None:
    """The second order of the two stages, until the tables' own error (0.05 %) is left."""
    fine = 40_000
    x, v, a, _, _ = driven(2.0, fine)
    model = damper(None, mass=Constant(0.0))
    current, kelvin = np.full_like(x, 1.25), np.full_like(x, 293.15)
    truth = simulate(model, Trajectory(1.0 / fine, x, v, a, current, temperature=kelvin))
    errors = []
    for rate in (125, 250, 500, 1000):
        step = fine // rate
        force = forces(model, rate, *(each[::step] for each in (x, v, current, kelvin)), law__substeps=1)
        errors.append(float(np.sqrt(np.mean((force - truth[::step])[rate // 20 :] ** 2))))
    assert all(after < 0.5 * before for before, after in pairwise(errors))


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e12])
def test_no_spring_makes_it_unstable(stiffness: float) -> None:
    """At 1 kHz and without a dashpot: at a steady speed the force is the settled valve's."""
    model = damper(None, gap_stiffness=Constant(stiffness), leak_damping=Constant(0.0), mass=Constant(0.0))
    t = 1e-3 * np.arange(1200)
    x: FloatArray = np.asarray(0.03 * (t - 0.6), dtype=np.float64)
    force = forces(model, 1000, x, np.array(0.03), np.array(1.0), np.array(293.15), single=True)
    c = dict(zip(model.law.names, model.coefficients_at(1.0, 293.15)[:, 0].tolist(), strict=True))
    valve = c["yield_force"] * (1.0 + c["position_gain"] * x)
    valve = valve * (1.0 + c["thinning"] * 0.03 ** c["thinning_exponent"])
    beside = c["viscosity"] * 0.1 * 0.3 ** c["viscous_exponent"] + c["coulomb_friction"]
    settled = c["offset"] + c["stiffness"] * x + valve + beside
    late = t > 0.9  # the softest spring takes that long to be loaded
    assert force[late] == pytest.approx(settled[late], rel=5e-3)
    assert np.abs(force).max() < 1.05 * settled.max()


def test_a_closed_cycle_takes_work_at_every_current() -> None:
    t = 1e-3 * np.arange(2001)
    motion = MOTIONS["sine5mm1Hz"]
    x, v = motion.displacement(t), motion.velocity(t)
    for amperes in (0.0, 0.7, 2.0):
        force = forces(damper(None, **STIFF), 1000, x, v, np.array(amperes), np.array(KELVIN), single=True)
        assert np.sum(force[1000:] * v[1000:]) * 1e-3 > 4.0 * 5e-3 * 60.0


# ------------------------------------------------------------------------------------------- the inverse


def test_the_static_inverse_is_the_closed_form() -> None:
    """At a steady speed the force less what is beside the valve, over its shape, is the yield force."""
    model, speed = damper(), 0.03
    made = ALL["static-preview"]
    state = at_speed(made, speed, kelvin=KELVIN)
    ahead = made.preview_s * speed
    for amperes in (0.3, 0.8, 1.7):
        row = model.coefficients_at(amperes, KELVIN)[:, 0].tolist()
        c = dict(zip(model.law.names, row, strict=True))
        valve = c["yield_force"] * (1.0 + c["position_gain"] * ahead)
        valve *= math.tanh(speed / c["yield_velocity"]) + c["thinning"] * speed ** c["thinning_exponent"]
        fade = math.exp(-((speed / c["stribeck_velocity"]) ** 2))
        beside = c["viscosity"] * 0.1 * (speed / 0.1) ** c["viscous_exponent"]
        beside += c["coulomb_friction"] + c["breakaway_friction"] * fade
        force = c["offset"] + c["stiffness"] * ahead + valve + beside
        given = answer(made, state, force, speed, kelvin=KELVIN)
        assert given == pytest.approx(amperes, abs=6e-3)


def feasible_rms(model: Damper, name: str, **values: float) -> float:
    """Return the RMS error [N] on the feasible set at 900 N, the damper being the model, without noise."""
    made = changed(controllers_for(model, largest=2.0)[name], **values)
    scenario = replace(SCENARIOS["sine-900N-1Hz"], duration_s=2.0, temperature_degC=60.0)
    scenario = replace(
        scenario, sensors=Sensing(displacement_noise_m=1e-9, force_noise_N=0.0, temperature_noise_K=0.0)
    )
    plant = CardPlant(model)
    reach = attainable_range(plant, reference_trajectory(scenario, plant.step_s), 60.0, 2.0)
    found = score_run(run_loop(plant, made, scenario), reach).rmse_feasible_N
    assert found is not None
    return found


@pytest.mark.system
def test_without_lags_the_inverse_gives_the_wanted_force() -> None:
    """On the law as the kernel carries it, without the controller's tables: 5 N of 900."""
    assert feasible_rms(damper(AT_ONCE), "exact", inverse__margin=-1.0) < 8.0


@pytest.mark.nightly
def test_behind_lags_the_preview_and_the_clamp_are_worth_it() -> None:
    recommended, inverse = (feasible_rms(damper(), name) for name in ("recommended", "series-inverse"))
    exact, bank = (feasible_rms(damper(), name) for name in ("exact", "paper"))
    assert recommended < 15.0
    assert recommended < 1.05 * inverse < 0.5 * exact
    assert recommended < 0.3 * bank


@pytest.mark.nightly
def test_how_the_inverse_is_stepped_hardly_matters() -> None:
    """Horizon from 1 to 15 ms, strides from 2 to 8: the rules of ``tuning`` tune nothing."""
    usual = feasible_rms(damper(), "recommended")
    for values in ({"law__horizon": 1e-3}, {"law__horizon": 15e-3}, {"law__strides": 8}):
        assert feasible_rms(damper(), "recommended", **values) == pytest.approx(usual, abs=2.0)


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("recommended", 1.0),
        ("recommended-causal", 1.0),
        ("paper", 1.0),
        ("pi", 1.0),
        ("series-inverse", 0.99),
    ],
)
def test_in_single_precision_the_command_is_the_same_within_a_milliampere(name: str, share: float) -> None:
    """Without the clamp not at every sample: where the valve is about to rest, force over speed is 0 over 0.

    Clamped 0.06 mA; ``series-inverse`` 5 mA in the worst of 3000 samples, three of them above 1 mA.
    """
    made = ALL[name]
    rows = told(made, 3.0, amplitude=700.0, kelvin=KELVIN)
    rows[:, 4] = 0.8 * rows[:, 0]
    float_made = replace(made, single=True)
    single, double = (each.run(each.start(), rows)[1] for each in (float_made, made))
    assert np.quantile(np.abs(single - double), share) < 1e-3
    assert double.max() > 0.5


# ------------------------------------------------------------------------------------------- gains


def test_the_gains_are_those_of_the_parts() -> None:
    """Yield 20 % up, viscous 30 % down, friction doubled: each part of the believed force by as much."""
    rows = told(RECOMMENDED, 0.4, kelvin=KELVIN)
    aged = RECOMMENDED.scaled(1.2, 0.7, 2.0)
    state = RECOMMENDED.run(RECOMMENDED.start(), rows)[0]
    before, after = (made.estimate(state) for made in (RECOMMENDED, aged))
    assert after.yield_force == pytest.approx(1.2 * before.yield_force, rel=1e-9)
    assert after.viscous_force == pytest.approx(0.7 * before.viscous_force, rel=1e-9)
    assert after.friction_force == pytest.approx(2.0 * before.friction_force, rel=1e-9)
    assert after.other_force == pytest.approx(before.other_force, rel=1e-9)


@pytest.mark.system
def test_a_measured_force_teaches_the_gain_of_the_yield_force() -> None:
    """A damper whose yield force has fallen by 15 %, told its force for 4 s."""
    aged = damper(AT_ONCE, yield_force=TemperatureDependent(Hill(51.0, 765.0, 1.3, 1.5, 2.0), Linear(1.4e-3)))
    made = controllers_for(damper(AT_ONCE))["recommended-adaptive"]
    rows, plant = told(made, 4.0, amplitude=700.0, kelvin=KELVIN), CardPlant(aged, step_s=made.period_s)
    motion = MOTIONS["nonperiodic"]
    state, current = made.start(), 0.0
    for k, row in enumerate(rows):
        t = np.array([k * made.period_s])
        force = plant.advance_many(motion.displacement(t), motion.velocity(t), current, 60.0)
        state, current = made.step(
            state, Reference(row[0], row[1]), Measurement(row[2], row[3], float(force[0]))
        )
    # the thinning part carries the yield force: both gains have to come down
    assert made.estimate(state).gains[0] == pytest.approx(0.85, abs=0.06)


# ------------------------------------------------------------------------------------------- safety


def test_a_target_that_no_current_gives_is_flagged() -> None:
    state = at_speed(RECOMMENDED, kelvin=KELVIN)
    for wanted in (-300.0, 9000.0):
        after, _ = RECOMMENDED.step(state, Reference(wanted, wanted), Measurement(3e-5, KELVIN))
        assert RECOMMENDED.flags(after) & Flag.INFEASIBLE
    after, _ = RECOMMENDED.step(state, Reference(900.0, 900.0), Measurement(3e-5, KELVIN))
    assert not RECOMMENDED.flags(after) & Flag.INFEASIBLE


# ------------------------------------------------------------------------------------------- what is refused


def test_each_law_has_its_controllers() -> None:
    assert set(ALL) == (set(NAMES) - {"inverse-bouc-wen"}) | {"series-inverse"}
    assert set(controllers_for(DOUBLE)) == set(NAMES)
    for name, law in (("inverse-bouc-wen", "series-valve"), ("series-inverse", "double-bouc-wen")):
        with pytest.raises(InputError, match=f"'{name}' is made from cards of .* this card's law is '{law}'"):
            check_name(name, law)
    check_name("series-inverse", "series-valve")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"thinning": Exponential(2.5, 0.1)}, "thinning of this series-valve card depends on the command"),
        ({"coulomb_friction": Polynomial((10.0, 3.0))}, "coulomb_friction .* depends on the command"),
        ({"leak_exponent": TemperatureDependent(Constant(0.95), Linear(1e-3))}, "leak_exponent goes from"),
        ({"yield_force": Constant(500.0)}, "does not depend on the command"),
        ({"yield_force": Polynomial((60.0, 900.0, -300.0))}, "falls with the command above 1.5"),
    ],
)
def test_a_law_without_an_explicit_inverse_is_refused_in_one_message(
    changed: dict[str, ParameterLaw], said: str
) -> None:
    with pytest.raises(InputError, match=said) as caught:
        controllers_for(damper(**changed))
    assert "\n" not in str(caught.value)
