"""The damper's model on a target: the law's force, in both precisions, whatever it is told."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import controllers_for
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.realtime import RealtimeDamper, realtime_model
from mrdamper.control.stepper import Flag
from mrdamper.control.tables.heating import NO_HEATING
from mrdamper.core import _kernel
from mrdamper.errors import InputError
from mrdamper.excitation import MOTIONS, Motion, Road, Sine, drive
from mrdamper.models.dependence import Constant
from mrdamper.models.simulate import simulate
from tests.control.dampers import DAMPERS, DOUBLE, LAGS, at_once, changed
from tests.support.examples import examples

PERIOD, ROOM = 1e-3, 293.15
MODEL = realtime_model(DOUBLE)
SINGLE = realtime_model(DOUBLE, single=True)
MOVED = MOTIONS["nonperiodic"]

anything = st.floats(allow_nan=True, allow_infinity=True, allow_subnormal=True)
rows_of_anything = st.lists(
    st.tuples(
        st.floats(-0.02, 0.02) | anything,
        st.floats(-0.5, 0.5) | st.just(math.nan) | anything,
        st.floats(0.0, 2.0) | anything,
        st.floats(280.0, 400.0) | anything,
    ),
    min_size=1,
    max_size=40,
)


def rows_for(
    motion: Motion, seconds: float, *, current: Any = 1.0, kelvin: Any = ROOM, told: bool = True
) -> FloatArray:
    t = PERIOD * np.arange(round(seconds / PERIOD))
    rows = np.empty((len(t), 4))
    rows[:, 0] = motion.displacement(t)
    rows[:, 1] = motion.velocity(t) if told else np.nan
    rows[:, 2], rows[:, 3] = current, kelvin
    return rows


def wandering(seconds: float, low: float, high: float, every: float, seed: int = 1) -> FloatArray:
    """Return a random level, straight between knots, from ``low`` on."""
    t = PERIOD * np.arange(round(seconds / PERIOD))
    knots = np.random.default_rng(seed).uniform(low, high, int(seconds / every) + 2)
    knots[0] = low
    return np.asarray(np.interp(t, every * np.arange(len(knots)), knots))


def error_percent(model: RealtimeDamper, law: FloatArray, rows: FloatArray) -> float:
    """Return the largest force error after 0.2 s, over the peak force."""
    force = model.run(model.start(), rows)[1]
    return 100.0 * float(np.abs(force - law)[200:].max() / np.abs(law).max())


# ------------------------------------------------------------------------------------- the force


@pytest.mark.nightly
@pytest.mark.parametrize("law", DAMPERS)
@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("single", [False, True])
def test_the_force_is_the_law_s_through_random_motion_current_and_temperature(law, told, single):
    """Dead time, lags, play, 293 to 390 K at 16 K/s, reversals: 0.25 % of the peak force.

    0.2 % of it is the command, held here and straight between samples there. The temperature is believed at
    once, since the look at it is a filter on purpose.
    """
    damper, seconds = DAMPERS[law], 6.0
    current = wandering(seconds, 0.0, 2.0, 0.25)
    kelvin = np.linspace(293.0, 390.0, len(current))
    path = drive(MOVED, duration=seconds - PERIOD, rate_Hz=1e3, command=current, temperature=kelvin)
    model = realtime_model(damper, single=single)
    model = changed(model, thermometer__keep=0.0, thermometer__slew=1e3)
    rows = rows_for(MOVED, seconds, current=current, kelvin=kelvin, told=told)
    assert error_percent(model, simulate(damper, path, form="causal"), rows) < 0.25


MOTIONS_TRIED: dict[str, Motion] = {
    "15 mm 1 Hz": Sine(15e-3, 1.0),
    "5 mm 4 Hz": Sine(5e-3, 4.0),
    "2 mm 10 Hz": Sine(2e-3, 10.0),
    "0.5 mm 20 Hz": Sine(0.5e-3, 20.0),
    "road": Road("C", 20.0, 3),
    "steps": MOTIONS["steps"],
}


@pytest.mark.system
@pytest.mark.parametrize("law", ["double-bouc-wen", "bingham"])
@pytest.mark.parametrize("motion", MOTIONS_TRIED)
def test_a_velocity_estimated_from_a_clean_displacement_costs_little(law, motion):
    """Up to 20 Hz 0.15 % of the peak force at most, beside the 0.3 % of the tables between their sheets.

    A road has 56 Hz in it: 1 % rms. ``steps`` turns at once, which a displacement tells a sample later: some
    samples about the turn are off, 99 % of all are not.
    """
    damper, path_of = at_once(DAMPERS[law]), MOTIONS_TRIED[motion]
    path = drive(path_of, duration=3.0 - PERIOD, rate_Hz=1e3, command=1.0, temperature=ROOM)
    force = simulate(damper, path, form="causal")
    model = realtime_model(damper)
    off = []
    for told in (True, False):
        answered = model.run(model.start(), rows_for(path_of, 3.0, told=told))[1]
        off.append(100.0 * np.abs(answered - force)[200:] / np.abs(force).max())
    if motion == "steps":
        assert np.quantile(off[1], 0.99) < 0.5
    elif motion == "road":
        assert np.sqrt(np.mean(off[1] ** 2)) < 1.0
        assert off[0].max() < 0.6
    else:
        assert off[0].max() < 0.31
        assert off[1].max() < off[0].max() + 0.15


@pytest.mark.system
@pytest.mark.parametrize(("dead_time", "bound"), [(0.003, 0.1), (0.0035, 0.25)])
def test_a_held_current_is_followed_through_dead_time_lags_and_play(dead_time, bound):
    """Steps of the current against the law on a fifty times finer grid, where they are steps too.

    Within a tenth per cent of the peak force; 0.25 % where the dead time is half a period and the step is
    shared out between two.
    """
    fine, seconds = 50, 1.2
    n = round(seconds / PERIOD)
    levels = np.repeat([0.0, 1.5, 0.3, 2.0, 0.0, 1.0], n // 6)
    rows = rows_for(MOVED, seconds, current=np.append(0.0, levels[:-1]))
    command = np.repeat(levels, fine)[: (n - 1) * fine + 1]
    lags = replace(LAGS, delay_s=dead_time)
    damper = replace(DOUBLE, temperature_range=(ROOM, ROOM + 1.0), actuation=lags)
    path = drive(MOVED, duration=seconds - PERIOD, rate_Hz=1e3 * fine, command=command, temperature=ROOM)
    law = simulate(damper, path, form="causal")[::fine]
    assert error_percent(realtime_model(damper), law, rows) < bound


def test_the_model_and_the_controller_s_observer_are_one():
    """Told the commands that a controller gave, the model feels what the controller felt, bit for bit."""
    made = controllers_for(DOUBLE)["recommended"]
    model = RealtimeDamper(made.config, made.tables)  # the controller's motion filter and all
    state, observed, command = made.start(), model.start(), 0.0
    for k in range(600):
        x = float(MOVED.displacement(np.array(k * PERIOD)))
        state, given = made.step(state, Reference(500.0, 500.0), Measurement(x, ROOM))
        observed, force = model.step(observed, x, None, command, ROOM)
        command = given
        mine, theirs = model.estimate(observed), made.estimate(state)
        assert (mine.applied, mine.velocity, mine.force) == (theirs.applied, theirs.velocity, theirs.force)
        assert force == pytest.approx(mine.force, rel=1e-12, abs=1e-9)


@given(seed=st.integers(0, 10_000), current=st.floats(0.0, 2.0))
def test_the_model_only_takes_energy_out_but_for_its_spring(seed, current):
    """Over whole periods of a motion the work is not negative, in either precision."""
    motion = Sine(np.random.default_rng(seed).uniform(1e-4, 2e-2), 2.0)
    rows = rows_for(motion, 2.0, current=current)
    for model in (MODEL, SINGLE):
        force = model.run(model.start(), rows)[1]
        assert (force * rows[:, 1])[1000:].sum() > 0.0


def test_in_single_precision_the_force_is_the_same():
    """1e-5 of the peak force where the velocity is told, 2e-4 where it is estimated, over 20 s."""
    current, kelvin = wandering(20.0, 0.0, 2.0, 0.25), np.linspace(293.0, 340.0, 20_000)
    for told, bound in ((True, 1e-5), (False, 2e-4)):
        rows = rows_for(MOVED, 20.0, current=current, kelvin=kelvin, told=told)
        double, single = (model.run(model.start(), rows)[1] for model in (MODEL, SINGLE))
        assert np.abs(double - single).max() < bound * np.abs(double).max()
        assert (single == single.astype(np.float32)).all()


# ------------------------------------------------------------------------------------- states


@pytest.mark.parametrize("model", [MODEL, SINGLE], ids=["double", "single"])
def test_the_state_is_handed_back_and_a_kept_one_carries_the_run_on(model):
    rows = rows_for(MOVED, 0.6, current=wandering(0.6, 0.0, 2.0, 0.1))
    state, forces, kept = model.start(), [], b""
    for k, row in enumerate(rows):
        if k == 250:
            kept = pickle.loads(pickle.dumps(state))
        before = bytes(state)
        after, force = model.step(state, *row)
        assert (after, force) == model.step(state, *row)
        assert state == before
        state = after
        forces.append(force)
    last, at_once_, _ = model.run(model.start(), rows)
    assert last == state
    np.testing.assert_array_equal(at_once_, forces)
    again, rest, _ = pickle.loads(pickle.dumps(model)).run(kept, rows[250:])
    assert again == state
    np.testing.assert_array_equal(rest, forces[250:])


def test_two_dampers_stepped_in_turn_do_not_touch_each_other():
    other = realtime_model(DAMPERS["bingham"], single=True)
    mine, theirs = rows_for(MOVED, 0.4), rows_for(Sine(5e-3, 3.0), 0.4, current=0.4)
    alone = [model.run(model.start(), rows)[1] for model, rows in ((MODEL, mine), (other, theirs))]
    states, together = [MODEL.start(), other.start()], ([], [])  # type: ignore[var-annotated]
    for pair in zip(mine, theirs, strict=True):
        for k, (model, row) in enumerate(zip((MODEL, other), pair, strict=True)):
            states[k], force = model.step(states[k], *row)
            together[k].append(force)
    np.testing.assert_array_equal(together[0], alone[0])
    np.testing.assert_array_equal(together[1], alone[1])


def test_a_state_of_the_other_precision_is_refused():
    for model, other in ((MODEL, SINGLE), (SINGLE, MODEL)):
        with pytest.raises(ValueError, match="not a controller's state"):
            model.step(other.start(), 0.0, 0.0, 0.0, ROOM)


@pytest.mark.parametrize("model", [MODEL, SINGLE], ids=["double", "single"])
def test_every_instruction_set_gives_the_same_bits(model):
    rows, before = rows_for(MOVED, 0.5), _kernel.level()
    found = set()
    try:
        for level in _kernel.levels():
            _kernel.use_level(level)
            found.add(model.run(model.start(), rows)[0])
    finally:
        _kernel.use_level(before)
    assert len(found) == 1


# ------------------------------------------------------------------------------------- safety


def said(model: RealtimeDamper, row: tuple[float, ...]) -> Flag:
    """Return the flags that a row must raise by what it holds alone."""

    def rounded(value: float) -> float:
        with np.errstate(over="ignore"):
            return float(np.float32(value)) if model.single else value

    x, v, i, kelvin = (rounded(value) for value in row)
    config = model.config
    far_x, far_v = rounded(config.faults.far_x), rounded(config.faults.far_v)
    cold, hot = rounded(config.thermometer.cold_limit), rounded(config.thermometer.hot_limit)
    largest = rounded(config.axes.largest)
    flags = Flag(0)
    if not abs(x) <= far_x:
        flags |= Flag.NO_DISPLACEMENT
    if abs(v) > far_v:
        flags |= Flag.NO_VELOCITY
    if not abs(i) <= 2 * largest:
        flags |= Flag.NO_CURRENT
    elif not 0.0 <= i <= largest:
        flags |= Flag.SATURATED
    if not cold <= kelvin <= hot:
        flags |= Flag.NO_TEMPERATURE
    return flags


@pytest.mark.system
@examples(50)
@given(rows=rows_of_anything, repeats=st.integers(1, 60), single=st.booleans())
def test_whatever_it_is_told_the_force_is_finite_and_the_flags_say_what_was_wrong(rows, repeats, single):
    model = SINGLE if single else MODEL
    told = np.repeat(np.array(rows), repeats, axis=0)
    state, force, flags = model.run(model.start(), told)
    assert np.isfinite(force).all()
    assert (np.abs(force) < 1e6).all()
    asked = Flag.NO_DISPLACEMENT | Flag.NO_VELOCITY | Flag.NO_CURRENT | Flag.SATURATED | Flag.NO_TEMPERATURE
    for k, row in enumerate(rows):
        assert {Flag(f) & asked for f in flags[k * repeats : (k + 1) * repeats].tolist()} == {
            said(model, row)
        }
    believed = model.estimate(state)
    assert 0.0 <= believed.applied <= model.largest * (1.0 + 1e-6)
    numbers = (believed.displacement, believed.velocity, believed.acceleration, believed.temperature)
    assert np.isfinite(numbers).all()


@examples(40)
@example(
    [(0.0, 0.0, 0.0, 280.0)] * 17 + [(1.0, 0.0, 0.0, 293.15), (0.0, math.nan, 0.0, 0.0)]
)  # 2 km/s heat nothing
@given(rows=rows_of_anything)
def test_after_any_rubbish_the_force_is_that_of_a_model_that_never_heard_any(rows):
    """A temperature up to 10 K off may be believed after 2 s; it is smoothed away over 0.2 s then.

    A play of the current remembers the last extreme for good: half a second without one sets both alike.
    """
    good = rows_for(MOVED, 3.8)
    good[:500, 2] = 0.0
    clean = MODEL.run(MODEL.start(), good)[1]
    after = MODEL.run(MODEL.run(MODEL.start(), np.array(rows))[0], good)[1]
    assert np.abs(after - clean)[3500:].max() < 1e-3 * np.abs(clean).max()


def test_without_a_current_the_last_good_one_is_held_for_30_ms_and_then_there_is_none():
    rows = rows_for(MOVED, 1.0, current=1.2)
    rows[500:, 2] = math.nan
    state, _, flags = MODEL.run(MODEL.start(), rows[:530])
    assert (flags[500:] & Flag.NO_CURRENT).all()
    assert not (flags[:500] & Flag.NO_CURRENT).any()
    assert MODEL.estimate(state).command == 1.2
    state, _, _ = MODEL.run(state, rows[530:])
    assert MODEL.estimate(state).command == 0.0
    assert MODEL.estimate(state).applied == pytest.approx(0.0, abs=0.03)


def test_a_current_beyond_the_tables_is_held_at_their_end_and_said():
    rows = rows_for(MOVED, 0.3, current=2.0)
    over = rows.copy()
    over[:, 2] = 3.0
    one, other = (MODEL.run(MODEL.start(), each) for each in (rows, over))
    np.testing.assert_array_equal(one[1], other[1])
    assert (other[2] & Flag.SATURATED).all()
    assert not (one[2] & Flag.SATURATED).any()


def test_without_displacement_a_told_velocity_carries_it_on():
    """The spring's part of the force alone depends on it; after 120 ms the motion counts as unknown."""
    rows = rows_for(Sine(5e-3, 1.0), 1.0)
    clean = MODEL.run(MODEL.start(), rows)[1]
    for value in (math.nan, math.inf, 7.0, float(rows[499, 0])):  # the last: it freezes
        bad = rows.copy()
        bad[500:, 0] = value
        _, force, flags = MODEL.run(MODEL.start(), bad)
        np.testing.assert_allclose(force, clean, atol=1.0)
        fault = Flag.FROZEN if math.isfinite(value) and value < 1.0 else Flag.NO_DISPLACEMENT
        assert (flags[520:700] & fault).all()
        assert (flags[650:700] & Flag.MOTION_UNKNOWN).all()


@pytest.mark.parametrize("told", [True, False])
def test_a_displacement_that_freezes_in_motion_is_noticed_within_50_ms(told):
    rows = rows_for(MOVED, 1.0, told=told)
    rows[500:, 0] = rows[500, 0]
    flags = MODEL.run(MODEL.start(), rows)[2]
    assert not (flags[:500] & Flag.FROZEN).any()
    assert (flags[550:600] & Flag.FROZEN).all()


def test_a_damper_that_stops_is_no_frozen_sensor_where_the_velocity_says_so():
    rows = rows_for(MOVED, 2.0)
    rows[700:, 0], rows[700:, 1] = rows[700, 0], 0.0
    assert not (MODEL.run(MODEL.start(), rows)[2] & (Flag.FROZEN | Flag.MOTION_UNKNOWN)).any()


def test_the_fall_back_of_the_velocity_is_its_estimate():
    """Infinite, or faster than anything: the flag, and the force of the estimate."""
    rows = rows_for(MOVED, 1.0)
    estimated = MODEL.run(MODEL.start(), rows_for(MOVED, 1.0, told=False))[1]
    for value in (math.inf, -math.inf, 1e4):
        rows[:, 1] = value
        _, force, flags = MODEL.run(MODEL.start(), rows)
        assert (flags & Flag.NO_VELOCITY).all()
        np.testing.assert_array_equal(force, estimated)


# ------------------------------------------------------------------------------------- what is refused


def test_a_card_without_dependence_on_current_is_refused():
    forms = {**DOUBLE.coefficients, "yield_force": Constant(300.0), "second_force": Constant(200.0)}
    with pytest.raises(InputError, match="does not depend on the command"):
        realtime_model(replace(DOUBLE, coefficients=forms))


def test_rows_of_another_shape_are_refused():
    with pytest.raises(InputError, match=r"rows have shape \(3, 5\); expected \(n, 4\)"):
        MODEL.run(MODEL.start(), np.zeros((3, 5)))


def test_nothing_is_said_of_a_constant_temperature_where_nobody_looks():
    rows = rows_for(Sine(15e-3, 4.0), 60.0, current=2.0)
    quiet = realtime_model(DOUBLE, heating=NO_HEATING)
    assert not (quiet.run(quiet.start(), rows)[2] & Flag.FROZEN_TEMPERATURE).any()
    assert (MODEL.run(MODEL.start(), rows)[2] & Flag.FROZEN_TEMPERATURE).any()
