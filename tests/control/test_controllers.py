"""Controllers: their current gives the target force, and their command stays within its limits."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import NAMES, Safety, controllers_for
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.stepper import FAULTS, Flag
from mrdamper.control.tuning import horizon_end
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.quantities import REFERENCE_K
from tests.control.rows import ROOM, command_at_speed, motion_rows, state_at_speed
from tests.support.cards import CHAIN, DOUBLE, LAGS, SERIES, at_once
from tests.support.examples import examples

PERIOD = 1e-3
ALL = controllers_for(DOUBLE)
OF = {"double-bouc-wen": ALL, "series-valve": controllers_for(SERIES)}
RECOMMENDED = ALL["recommended"]
every_controller = pytest.mark.parametrize(("law", "name"), [(law, name) for law in OF for name in OF[law]])
every_law = pytest.mark.parametrize("law", OF)

anything = st.floats(allow_nan=True, allow_infinity=True)
readings = st.floats(-0.02, 0.02) | anything
temperatures = st.floats(280.0, 400.0) | anything
forces = st.floats(-2000.0, 2000.0) | anything


# --- Inverse of the damper model ----------------------------------------------------------------------------


@pytest.mark.parametrize("damper", [DOUBLE, SERIES, CHAIN], ids=lambda damper: damper.law.name)
def test_temperature_dependence_leaves_current_unchanged_at_20_degC(damper):
    """At the reference temperature of 20 degC, temperature dependence does not change the current."""
    forms = {
        name: form.form if isinstance(form, TemperatureDependent) else form
        for name, form in damper.coefficients.items()
    }
    cold = replace(damper, coefficients=forms, temperature_range=None)
    currents = []
    for each in (damper, cold):
        made = controllers_for(each)["recommended"]
        rows = motion_rows(made, 1.0, kelvin=REFERENCE_K, noise=0.0)
        currents.append(made.run(made.start(), rows)[1])
    assert np.mean(np.abs(currents[0] - currents[1])) < 0.02 * currents[0].mean()


@pytest.mark.parametrize(
    ("law", "name"),
    [("double-bouc-wen", "recommended"), ("double-bouc-wen", "paper"), ("series-valve", "recommended")],
)
@pytest.mark.parametrize("speed", [0.03, -0.03])
def test_controller_current_rises_with_target_force(law, name, speed):
    made = OF[law][name]
    state = state_at_speed(made, speed)
    wanted = math.copysign(1.0, speed) * np.linspace(-500.0, 3500.0, 81)
    current = [command_at_speed(made, state, f, speed) for f in wanted]
    assert (np.diff(current) >= -1e-9).all()
    assert current[0] == 0.0
    assert current[-1] == 2.0


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("pi", "clipped-on-off")])
@pytest.mark.parametrize("speed", [0.03, -0.03])
def test_target_along_motion_gives_zero_current(name, speed):
    """A semi-active damper cannot push in the direction of the motion."""
    made = ALL[name]
    assert command_at_speed(made, state_at_speed(made, speed), -math.copysign(400.0, speed), speed) == 0.0


# --- Controller states --------------------------------------------------------------------------------------


@every_controller
def test_single_steps_equal_one_controller_run(law, name):
    """A step returns a new state and does not change the state that is passed in."""
    made = OF[law][name]
    rows = motion_rows(made, 0.2)
    rows[:, 4] = 50.0
    state, currents = made.start(), []
    for row in rows:
        before = bytes(state)
        reading, wanted = Measurement(row[2], row[3], row[4]), Reference(row[0], row[1])
        after, current = made.step(state, wanted, reading)
        assert (after, current) == made.step(state, wanted, reading)
        assert state == before
        state = after
        currents.append(current)
    last, together, _ = made.run(made.start(), rows)
    assert last == state
    np.testing.assert_array_equal(together, currents)


@pytest.mark.parametrize("single", [False, True])
def test_pickled_controller_gives_identical_states(single):
    made = replace(RECOMMENDED, single=single)
    rows = motion_rows(made, 0.5)
    again = pickle.loads(pickle.dumps(made))
    assert again.run(again.start(), rows)[0] == made.run(made.start(), rows)[0]


@pytest.mark.parametrize("name", NAMES)
def test_single_precision_gives_same_controller_command(name):
    """Commands in single and double precision differ by less than 2 mA in 99 % of the samples."""
    made = ALL[name]
    rows = motion_rows(made, 5.0)
    rows[:, 4] = 0.8 * rows[:, 0]
    double, single = (each.run(each.start(), rows)[1] for each in (made, replace(made, single=True)))
    quantile = 0.99 if made.config.prediction.steps > 0 else 0.999
    assert np.quantile(np.abs(double - single), quantile) < 2e-3
    assert (single == single.astype(np.float32)).all()


def test_instruction_sets_give_identical_controller_states():
    rows, before = motion_rows(RECOMMENDED, 1.0), core.level()
    found = set()
    try:
        for level in core.levels():
            core.use_level(level)
            found.add(RECOMMENDED.run(RECOMMENDED.start(), rows)[0])
    finally:
        core.use_level(before)
    assert len(found) == 1


def test_invalid_controller_state_bytes_are_rejected():
    with pytest.raises(ValueError, match="not a controller's state"):
        RECOMMENDED.step(b"no state", Reference(0.0), Measurement(0.0, ROOM))


# --- Invalid readings -------------------------------------------------------------------------------------


@examples(60)
@given(
    which=st.sampled_from([(law, name) for law in OF for name in OF[law]]),
    rows=st.lists(st.tuples(forces, forces, readings, temperatures, forces), min_size=1, max_size=40),
    repeats=st.integers(1, 60),
    single=st.booleans(),
)
def test_any_reading_gives_valid_command(which, rows, repeats, single):
    """The command is within its limits, and a flag marks a reading outside the limits of its sensor."""
    law, name = which
    made = replace(OF[law][name], single=single)
    inputs = np.repeat(np.array(rows), repeats, axis=0)
    state, current, flags = made.run(made.start(), inputs)
    assert ((current >= 0.0) & (current <= 2.0)).all()
    limits = made.config.thermometer
    number = {
        "far": made.config.faults.displacement_limit,
        "cold": limits.cold_limit,
        "hot": limits.hot_limit,
    }
    if single:  # Single precision rounds readings and their limits.
        with np.errstate(over="ignore"):
            inputs = inputs.astype(np.float32).astype(np.float64)
            number = {key: float(np.float32(value)) for key, value in number.items()}
    now, x, kelvin = inputs[:, 0], inputs[:, 2], inputs[:, 3]
    wrong = {
        Flag.NO_TARGET: ~(np.abs(now) <= 1e7),
        Flag.NO_DISPLACEMENT: ~(np.abs(x) <= number["far"]),
    }
    if name != "paper-unaware":  # This controller does not read the temperature.
        wrong[Flag.NO_TEMPERATURE] = ~((kelvin >= number["cold"]) & (kelvin <= number["hot"]))
    for flag, expected in wrong.items():
        np.testing.assert_array_equal((flags & flag) != 0, expected)
    estimate = made.estimate(state)
    values = (estimate.displacement, estimate.velocity, estimate.temperature, estimate.force)
    assert np.isfinite(values).all()


@every_law
@examples(25)
@given(rows=st.lists(st.tuples(forces, forces, readings, temperatures), min_size=1, max_size=40))
def test_command_recovers_from_invalid_readings(law, rows):
    """22 s after invalid readings, the command equals the command of a run with valid readings.

    A displacement jump of a metre disturbs the estimated frequency, which recovers with a time constant of 1
    s. The valid temperatures have noise because a constant reading after a jump counts as a stuck sensor.
    """
    bad = np.column_stack([np.array(rows), np.full(len(rows), np.nan)])
    made = OF[law]["recommended"]
    good = motion_rows(made, 22.5, noise=0.0)
    good[:, 3] += 0.05 * np.random.default_rng(2).standard_normal(len(good))
    # The valid run has as many samples as the invalid run because a predictive controller may distribute a
    # computation over several samples.
    before = np.tile(good[:1], (len(bad), 1))
    clean, after = (made.run(made.run(made.start(), each)[0], good)[1] for each in (before, bad))
    assert np.abs(after - clean)[22_000:].max() < 0.02


def test_controller_resets_state_that_contains_nan():
    """The commands equal the commands from a new state, and a flag marks the reset."""
    rows = motion_rows(RECOMMENDED, 0.2)
    state = RECOMMENDED.run(RECOMMENDED.start(), rows)[0]
    damaged = np.frombuffer(state, dtype=np.float64).copy()
    damaged[0] = math.nan  # The estimated displacement is the first number of the state.
    _, current, flags = RECOMMENDED.run(damaged.tobytes(), rows)
    assert flags[0] & Flag.INTERNAL_FAULT
    assert not (flags[1:] & Flag.INTERNAL_FAULT).any()
    np.testing.assert_array_equal(current, RECOMMENDED.run(RECOMMENDED.start(), rows)[1])


def faulted(
    column: int, value: float, *, seconds: float = 1.0, at: float = 0.5
) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Return commands and flags for a reading that is constant after ``at``, and fault-free commands."""
    good = motion_rows(RECOMMENDED, seconds)
    bad = good.copy()
    bad[round(at / PERIOD) :, column] = value
    clean, wrong = (RECOMMENDED.run(RECOMMENDED.start(), rows) for rows in (good, bad))
    return wrong[1], wrong[2], clean[1]


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e3, 100.0])
def test_invalid_temperature_is_replaced_by_estimate(value):
    current, flags, clean = faulted(3, value)
    assert (flags[500:] & Flag.NO_TEMPERATURE).all()
    assert not (flags[:500] & Flag.NO_TEMPERATURE).any()
    np.testing.assert_allclose(current, clean, atol=1e-3)


@pytest.mark.parametrize(("at", "accepted"), [(0.5, 2.5), (3.0, 6.0)])
def test_temperature_after_jump_is_used_after_delay(at, accepted):
    """A jump by 60 K is accepted after 2 s, or after 3 s if 3 s of valid readings preceded the jump."""
    current, flags, clean = faulted(3, ROOM + 60.0, seconds=accepted + 1.0, at=at)
    begin, end = round(at / PERIOD), round(accepted / PERIOD)
    assert (flags[begin : end - 10] & Flag.TEMPERATURE_JUMP).all()
    np.testing.assert_allclose(current[: end - 10], clean[: end - 10], atol=1e-3)
    assert not (flags[end + 10 :] & Flag.TEMPERATURE_JUMP).any()


def test_nominal_temperature_replaces_missing_temperature():
    made = controllers_for(DOUBLE, safety=Safety(hold_s=0.5, nominal_K=363.15))["recommended"]
    rows = motion_rows(made, 6.0)
    rows[500:, 3] = np.nan
    state, _, flags = made.run(made.start(), rows)
    assert not (flags[:990] & Flag.NOMINAL_TEMPERATURE).any()
    assert (flags[1010:] & Flag.NOMINAL_TEMPERATURE).all()
    assert made.estimate(state).temperature == pytest.approx(363.15)


def test_temperature_outside_tables_is_limited():
    edge, beyond = (motion_rows(RECOMMENDED, 0.5, kelvin=k) for k in (398.15, 420.0))
    _, current, flags = RECOMMENDED.run(RECOMMENDED.start(), beyond)
    np.testing.assert_allclose(current, RECOMMENDED.run(RECOMMENDED.start(), edge)[1], atol=1e-12)
    assert (flags & Flag.OUTSIDE_TEMPERATURE).all()


@pytest.mark.parametrize("value", [math.nan, -math.inf, 5.0])
def test_missing_displacement_gives_fall_back_command(value):
    """The motion is extrapolated for 120 ms. Then the fall-back is used until the motion is known again."""
    current, flags, clean = faulted(2, value)
    assert (flags[500:] & Flag.NO_DISPLACEMENT).all()
    assert np.abs(current - clean)[500:510].max() < 0.1
    assert (current[625:] == 0.0).all()
    made = controllers_for(DOUBLE, safety=Safety(fall_back=0.4))["recommended"]
    rows = motion_rows(made, 1.0)
    rows[500:700, 2] = value
    _, current, flags = made.run(made.start(), rows)
    assert (current[625:700] == 0.4).all()
    assert not (flags[750:] & Flag.MOTION_UNKNOWN).any()


def test_stuck_displacement_is_flagged_in_motion():
    """A constant displacement reading is valid if the damper is at rest."""
    frozen = motion_rows(RECOMMENDED, 1.0)[500, 2]
    _, flags, _ = faulted(2, float(frozen))
    assert (flags[525:] & Flag.FROZEN).all()
    rest = np.full((3000, 5), np.nan)
    rest[:, :2], rest[:, 2], rest[:, 3] = 100.0, 1.25e-3, ROOM
    flags = RECOMMENDED.run(RECOMMENDED.start(), rest)[2]
    assert not (flags & (Flag.FROZEN | Flag.MOTION_UNKNOWN)).any()


@pytest.mark.parametrize("name", ["clipped-on-off", "pi"])
def test_missing_force_reading_disables_force_feedback(name):
    made = ALL[name]
    _, current, flags = made.run(made.start(), motion_rows(made, 1.0))
    assert (flags & FAULTS == Flag.NO_FORCE).all()
    assert (current == 0.0).all()


# --- Design rules -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [1e-3, 5e-3])
def test_preview_time_equals_prediction_horizon(period):
    """An additional command delay lengthens the preview by this delay."""
    made, later = (controllers_for(DOUBLE, period_s=period, extra_delay_s=delay) for delay in (0.0, 0.01))
    expected = horizon_end(made["recommended"].config.prediction)
    assert expected > LAGS.response_time(0.5)
    assert made["recommended"].preview_s == pytest.approx(expected)
    assert made["recommended-causal"].preview_s == made["paper"].preview_s == 0.0
    assert later["recommended"].preview_s == pytest.approx(expected + 0.01, abs=2e-5)


def test_causal_controller_extrapolates_target_as_parabola():
    """A target that is a parabola in time gives the same command with and without a preview of the target."""
    t = PERIOD * np.arange(1500)

    def target(at: Any) -> Any:
        return 300.0 + 200.0 * at + 80.0 * at**2

    rows = np.full((len(t), 5), np.nan)
    rows[:, 0], rows[:, 1] = target(t), target(t + RECOMMENDED.preview_s)
    rows[:, 2], rows[:, 3] = 0.02 * t, ROOM
    known, causal = (c.run(c.start(), rows)[1] for c in (RECOMMENDED, ALL["recommended-causal"]))
    np.testing.assert_allclose(causal[800:], known[800:], atol=1e-6)


def test_scaled_controller_gives_scaled_force():
    """A controller that is scaled to twice the force gives the same command for twice the target."""
    bare = at_once(DOUBLE).with_parameters({"stiffness.value": 0.0, "offset.c0": 0.0, "offset.c1": 0.0})
    made = controllers_for(bare)["recommended"]
    twice = made.scaled(2.0, 2.0, 2.0)
    for wanted in (200.0, 500.0, 900.0):
        assert command_at_speed(twice, state_at_speed(twice), 2.0 * wanted) == pytest.approx(
            command_at_speed(made, state_at_speed(made), wanted)
        )


@pytest.mark.parametrize(
    ("wanted", "force", "expected"),
    [(800.0, 500.0, 2.0), (800.0, 900.0, 0.0), (-800.0, 900.0, 0.0), (-800.0, -500.0, 2.0)],
)
def test_clipped_on_off_controller_returns_zero_or_maximum(wanted, force, expected):
    made = ALL["clipped-on-off"]
    assert made.step(state_at_speed(made), Reference(wanted), Measurement(0.0, ROOM, force))[1] == expected


# --- Unsupported dampers ------------------------------------------------------------------------------------


UNMOVED = {"yield_force": Constant(300.0), "second_force": Constant(200.0)}
TANH: dict[str, ParameterLaw] = {
    "yield_force": Polynomial((100.0, 500.0)),
    "slope": Constant(100.0),
    "shift": Constant(0.5),
}


def other(**coefficients: ParameterLaw) -> Damper:
    return replace(DOUBLE, coefficients={**DOUBLE.coefficients, **coefficients})


@pytest.mark.parametrize(
    ("damper", "period", "message"),
    [
        (other(**UNMOVED), PERIOD, "does not depend on the command"),
        (replace(DOUBLE, law=LAWS["tanh"], coefficients=TANH), PERIOD, "the law is 'tanh'; expected one of"),
        (other(n=Polynomial((0.6, 0.1))), PERIOD, "n changes from 0.6 to 0.8 over current and temperature"),
        (DOUBLE, 0.1, r"the period is 100 ms, and the force follows"),
        (
            replace(DOUBLE, actuation=Actuation(0.01, 0.01, delay_s=0.2, largest_command=2.0)),
            PERIOD,
            "the dead time of 200 ms is 200 periods",
        ),
        (replace(DOUBLE, actuation=Actuation(0.01, 0.01)), PERIOD, "largest command is unknown"),
    ],
)
def test_controllers_reject_unsuitable_damper(damper, period, message):
    with pytest.raises(InputError, match=message):
        controllers_for(damper, period_s=period)
