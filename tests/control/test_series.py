"""The real-time model and the controllers of the hysteresis law ``series-valve`` are accurate."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import Safety, controllers_for
from mrdamper.control.realtime import realtime_model
from mrdamper.control.stepper import Flag
from mrdamper.control.tables.heating import NO_HEATING
from mrdamper.control.tables.series import tabulate_power, tabulate_series
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS, Trajectory
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Exponential, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.simulate import simulate
from mrdamper.models.temperature import Linear
from tests.control.rows import constant_speed_rows, motion_rows, state_at_speed
from tests.support.cards import LAGS, SERIES, changed

KELVIN = 333.15
AT_ONCE = Actuation(0.0, 0.0, largest_command=2.0)
# With these values, the series spring settles in 0.1 ms, and the valve force is almost Coulomb friction.
STIFF: dict[str, ParameterLaw] = {
    "gap_stiffness": Constant(1.6e8), "gap": Constant(1.3e-5), "gap_corner": Constant(7.5e-6),
    "leak_damping": Constant(1.9e4), "leak_exponent": Constant(1.01), "yield_velocity": Constant(1.5e-5),
}  # fmt: skip


def damper(lag: Actuation | None = LAGS, /, **changed: ParameterLaw) -> Damper:
    return replace(SERIES, coefficients={**SERIES.coefficients, **changed}, actuation=lag)


ALL = controllers_for(damper())
RECOMMENDED = ALL["recommended"]


# --- Tables of functions ------------------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", [0.2, 0.95, 1.0, 1.5])
def test_tabulated_power_function_is_accurate(exponent: float) -> None:
    """The relative error is 1e-5 in all octaves. Below the first octave, the table is linear."""
    power = tabulate_power(exponent)
    u = np.geomspace(power.least, 7.9, 20_001)
    assert np.abs(power.evaluate(u) / u**exponent - 1.0).max() < 1e-5
    assert power.evaluate(0.25 * power.least) == pytest.approx(0.25 * power.least**exponent)
    assert power.evaluate(2.0 * u[:15_000]) / power.evaluate(u[:15_000]) == pytest.approx(
        2.0**exponent, rel=1e-12
    )


def test_tabulated_functions_match_tanh_and_gaussian() -> None:
    tables, _ = tabulate_series(damper(), 2.0, (293.15, 293.15))
    u = np.linspace(0.0, 200.0, 40_001)
    assert np.abs(tables.side.evaluate(u) - np.tanh(u)).max() < 1e-5
    assert np.abs(tables.fade.evaluate(u) - np.exp(-u * u)).max() < 2e-5


# --- Real-time model ----------------------------------------------------------------------------------------


def forces(
    model: Damper, rate: int, *columns: FloatArray, single: bool = False, **values: float
) -> FloatArray:
    """Return the force [N] of the real-time model for displacement, velocity, current and temperature."""
    at_once = Safety(smooth_s=1e-6, slew_K_s=1e6, jump_K=1e3)
    made = realtime_model(model, period_s=1.0 / rate, largest=2.0, safety=at_once, heating=NO_HEATING)
    made = replace(changed(made, **values), single=single)
    return made.run(made.start(), np.column_stack(np.broadcast_arrays(*columns)))[1]


def driven(seconds: float, rate: int) -> tuple[FloatArray, ...]:
    """Return a random motion with reversals, currents between minimum and maximum, and a temperature ramp."""
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
@pytest.mark.parametrize(("rate", "soft", "stiff"), [(100, 2.0, 2.0), (1000, 0.15, 0.4), (5000, 0.1, 0.15)])
def test_realtime_series_valve_follows_law(rate: int, soft: float, stiff: float, single: bool) -> None:
    """The reference is the law of the kernel at 20 kHz. The limits are RMS errors in % of the RMS force."""
    seconds, fine = 4.0, 20_000
    x, v, a, current, kelvin = driven(seconds, fine)
    step = fine // rate
    for model, bound in ((damper(None), soft), (damper(None, **STIFF), stiff)):
        truth = simulate(model, Trajectory(1.0 / fine, x, v, a, current, temperature=kelvin))[::step]
        force = forces(model, rate, *(each[::step] for each in (x, v, current, kelvin)), single=single)
        # The first force has no inertia because the acceleration is a difference of velocities.
        error = (force - truth)[1:]
        assert 100.0 * np.sqrt(np.mean(error**2) / np.mean(truth**2)) < bound


def test_series_valve_converges_with_step_size() -> None:
    """The two-stage method converges with order two until the error of the tables dominates."""
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
def test_any_spring_keeps_series_valve_stable(stiffness: float) -> None:
    """At 1 kHz, without a dashpot and at constant speed, the force reaches the steady force of the valve."""
    model = damper(None, gap_stiffness=Constant(stiffness), leak_damping=Constant(0.0), mass=Constant(0.0))
    t = 1e-3 * np.arange(1200)
    x: FloatArray = np.asarray(0.03 * (t - 0.6), dtype=np.float64)
    force = forces(model, 1000, x, np.array(0.03), np.array(1.0), np.array(293.15), single=True)
    c = dict(zip(model.law.names, model.coefficients_at(1.0, 293.15)[:, 0].tolist(), strict=True))
    valve = c["yield_force"] * (1.0 + c["position_gain"] * x)
    valve = valve * (1.0 + c["thinning"] * 0.03 ** c["thinning_exponent"])
    beside = c["viscosity"] * 0.1 * 0.3 ** c["viscous_exponent"] + c["coulomb_friction"]
    settled = c["offset"] + c["stiffness"] * x + valve + beside
    late = t > 0.9  # The softest spring is fully loaded at 0.9 s.
    assert force[late] == pytest.approx(settled[late], rel=5e-3)
    assert np.abs(force).max() < 1.05 * settled.max()


@pytest.mark.parametrize("amperes", [0.0, 0.7, 2.0])
def test_realtime_series_valve_dissipates_work(amperes: float) -> None:
    t = 1e-3 * np.arange(2001)
    motion = MOTIONS["sine5mm1Hz"]
    x, v = motion.displacement(t), motion.velocity(t)
    force = forces(damper(None, **STIFF), 1000, x, v, np.array(amperes), np.array(KELVIN), single=True)
    assert np.sum(force[1000:] * v[1000:]) * 1e-3 > 4.0 * 5e-3 * 60.0


# --- Controllers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["recommended", "recommended-causal", "pi"])
def test_single_precision_changes_command_by_less_than_milliampere(name: str) -> None:
    made = ALL[name]
    rows = motion_rows(made, 3.0, amplitude=700.0, kelvin=KELVIN)
    rows[:, 4] = 0.8 * rows[:, 0]
    single, double = (each.run(each.start(), rows)[1] for each in (replace(made, single=True), made))
    assert np.quantile(np.abs(single - double), 0.99) < 1e-3
    assert double.max() > 0.5


def test_force_gains_scale_parts_of_force() -> None:
    rows = motion_rows(RECOMMENDED, 0.4, kelvin=KELVIN)
    aged = RECOMMENDED.scaled(1.2, 0.7, 2.0)
    state = RECOMMENDED.run(RECOMMENDED.start(), rows)[0]
    before, after = (made.estimate(state) for made in (RECOMMENDED, aged))
    assert after.yield_force == pytest.approx(1.2 * before.yield_force, rel=1e-9)
    assert after.viscous_force == pytest.approx(0.7 * before.viscous_force, rel=1e-9)
    assert after.friction_force == pytest.approx(2.0 * before.friction_force, rel=1e-9)
    assert after.other_force == pytest.approx(before.other_force, rel=1e-9)


@pytest.mark.parametrize(("wanted", "infeasible"), [(-300.0, True), (9000.0, True), (900.0, False)])
def test_infeasible_target_is_flagged(wanted: float, infeasible: bool) -> None:
    state = state_at_speed(RECOMMENDED, kelvin=KELVIN)
    after = RECOMMENDED.run(state, constant_speed_rows(RECOMMENDED, wanted, kelvin=KELVIN))[0]
    assert bool(RECOMMENDED.flags(after) & Flag.INFEASIBLE) == infeasible


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"thinning": Exponential(2.5, 0.1)}, "thinning of this series-valve card depends on the command"),
        ({"leak_exponent": TemperatureDependent(Constant(0.95), Linear(1e-3))}, "leak_exponent changes from"),
        ({"yield_force": Constant(500.0)}, "does not depend on the command"),
        ({"yield_force": Polynomial((60.0, 900.0, -300.0))}, "falls with the command above 1.5"),
    ],
)
def test_law_without_inverse_has_no_controllers(changed: dict[str, ParameterLaw], message: str) -> None:
    with pytest.raises(InputError, match=message):
        controllers_for(damper(**changed))
