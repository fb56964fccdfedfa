"""Controllers: the solved current gives the wanted force, whatever they are told the command is one."""

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

from mrdamper.arrays import FloatArray
from mrdamper.control.card_plant import CardPlant
from mrdamper.control.controllers import NAMES, Safety, controllers_for
from mrdamper.control.loop import run_loop
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.control.scenario import SCENARIOS, Disturbance
from mrdamper.control.score import AttainableRange, attainable_range, score_run
from mrdamper.control.stepper import Flag
from mrdamper.control.tuning import PREVIEW_SHARE
from mrdamper.core import _kernel
from mrdamper.errors import InputError
from mrdamper.excitation import drive
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import simulate
from tests.control.dampers import DAMPERS, DOUBLE, LAGS, SERIES, at_once, changed
from tests.control.rows import MOTION, ROOM, answer, at_speed, told
from tests.control.slow_step import SlowController
from tests.support.examples import examples

PERIOD = 1e-3
ALL = controllers_for(DOUBLE)
OF = {"double-bouc-wen": ALL, "series-valve": controllers_for(SERIES)}
RECOMMENDED = ALL["recommended"]
SINGLE = {name: replace(made, single=True) for name, made in ALL.items()}
every_controller = pytest.mark.parametrize(("law", "name"), [(law, name) for law in OF for name in OF[law]])
every_law = pytest.mark.parametrize("law", OF)

anything = st.floats(allow_nan=True, allow_infinity=True)
readings = st.floats(-0.02, 0.02) | anything
temperatures = st.floats(280.0, 400.0) | anything
forces = st.floats(-2000.0, 2000.0) | anything


# ------------------------------------------------------------------------------------- the inverse


@pytest.mark.parametrize("law", DAMPERS)
def test_without_lags_the_solved_current_gives_the_wanted_force(law):
    """Fed back into the law by its own simulation: 1 N rms, 5 N at 99 %, wherever a current gives it.

    What is left is the motion filter's lag and the straight line between 33 currents.
    """
    damper = at_once(DAMPERS[law])
    made = controllers_for(damper, displacement_noise_m=1e-8, jerk_density=30.0)["exact"]
    rows = told(made, 3.0, noise=0.0)
    _, current, flags = made.run(made.start(), rows)
    path = drive(MOTION, duration=(len(rows) - 1) * PERIOD, rate_Hz=1e3, command=current, temperature=ROOM)
    error = simulate(damper, path, form="causal") - rows[:, 0]
    told_so = (flags & int(Flag.INFEASIBLE)) == 0
    # a sample after a turn of the motion the filter is still turning
    free = told_so & (np.abs(path.velocity) > 2e-3) & (np.arange(len(rows)) > 1000)
    assert free.sum() > 0.35 * len(rows)
    assert np.sqrt(np.mean(error[free] ** 2)) < 1.0
    assert np.quantile(np.abs(error[free]), 0.99) < 5.0


@pytest.mark.nightly
@pytest.mark.parametrize("kelvin", [293.15, 396.15])
def test_the_step_in_c_is_the_slow_one_in_python(kelvin):
    """Same estimators, law and root without tables, 250 steps with noise and a reversal: 5 mA, 1 mA rms."""
    quick = changed(RECOMMENDED, inverse__compensation=0.0)
    rows = told(quick, 0.25, kelvin=kelvin)
    slow = SlowController(DOUBLE, PERIOD, quick.preview_s, quick.config.inverse.margin)
    _, current, flags = quick.run(quick.start(), rows)
    expected = np.array([slow.step(row[1], row[2], row[3]) for row in rows])
    off = np.abs(current - expected)
    feasible = (flags & int(Flag.INFEASIBLE)) == 0
    assert off[feasible].max() < 5e-3
    assert np.sqrt(np.mean(off[feasible] ** 2)) < 1e-3
    assert off.max() < 2.0 / 32.0  # where no current gives the force, the nearest of the table's
    assert current.max() > 0.3


@every_law
@pytest.mark.parametrize("name", ["recommended", "exact", "paper", "static-preview", "inverse"])
@pytest.mark.parametrize("speed", [0.03, -0.03])
def test_more_wanted_force_is_never_less_current(law, name, speed):
    inverse = "inverse-bouc-wen" if law == "double-bouc-wen" else "series-inverse"
    made = OF[law][inverse if name == "inverse" else name]
    state = at_speed(made, speed)
    wanted = math.copysign(1.0, speed) * np.linspace(-500.0, 3500.0, 81)
    current = [answer(made, state, f, speed) for f in wanted]
    assert (np.diff(current) >= -1e-9).all()
    assert current[0] == 0.0
    assert current[-1] == 2.0


@pytest.mark.parametrize("name", [n for n in NAMES if n not in ("pi", "feed-forward-pi", "clipped-on-off")])
def test_a_force_along_the_motion_gets_no_current(name):
    """A semi-active damper cannot push."""
    made = ALL[name]
    for speed in (0.03, -0.03):
        assert answer(made, at_speed(made, speed), -math.copysign(400.0, speed), speed) == 0.0


@every_law
def test_the_banks_agree_on_the_currents_of_their_models(law):
    """At a force that the 1 A model has, 3, 5 and 9 models all say 1 A; 2 models say something else."""
    state = {name: at_speed(OF[law][name]) for name in ("paper-2", "paper-3", "paper", "paper-9")}
    wanted = np.linspace(200.0, 1800.0, 400)
    row = {name: np.array([answer(OF[law][name], s, f) for f in wanted]) for name, s in state.items()}
    at_one = int(np.argmin(np.abs(row["paper-9"] - 1.0)))
    for name in ("paper-3", "paper"):
        assert row[name][at_one] == pytest.approx(row["paper-9"][at_one], abs=5e-3)
    assert abs(row["paper-2"][at_one] - 1.0) > 0.02


def test_the_reversal_clamp_holds_the_command_while_the_hysteresis_builds_up():
    """Just after a reversal the exact solve asks for far more than the static answer; clamped, 5 % more."""
    free = changed(RECOMMENDED, inverse__margin=-1.0, inverse__compensation=0.0)
    held = changed(RECOMMENDED, inverse__compensation=0.0)
    static = ALL["static-preview"]
    rows = told(free, 3.0, amplitude=1100.0)
    asked = [c.run(c.start(), rows)[1] for c in (free, held, static)]
    over = [current - asked[2] for current in asked[:2]]
    assert (over[0] > 0.3).mean() > 0.05
    # the play's inverse comes after the clamp: within its width the command moves twice as fast
    assert over[1].max() <= 2.0 * 0.05 * 2.0 + 0.05


# ------------------------------------------------------------------------------------- states


@every_controller
def test_the_state_is_handed_back_and_one_by_one_is_all_at_once(law, name):
    made = OF[law][name]
    rows = told(made, 0.2)
    rows[:, 4] = 50.0
    state, currents = made.start(), []
    for row in rows:
        kept = bytes(state)
        seen = Measurement(row[2], row[3], row[4])
        wanted = Reference(row[0], row[1])
        after, current = made.step(state, wanted, seen)
        assert (after, current) == made.step(state, wanted, seen)
        assert state == kept
        state = after
        currents.append(current)
    last, at_once_, _ = made.run(made.start(), rows)
    assert last == state
    np.testing.assert_array_equal(at_once_, currents)


def test_a_controller_survives_pickling_and_gives_the_same_bits():
    rows = told(RECOMMENDED, 0.5)
    for made in (RECOMMENDED, SINGLE["recommended"]):
        again = pickle.loads(pickle.dumps(made))
        assert again.run(again.start(), rows)[0] == made.run(made.start(), rows)[0]


@pytest.mark.parametrize("name", NAMES)
def test_in_single_precision_every_controller_gives_the_same_command(name):
    """Within 2 mA over 5 s, with the lead's gain of 5 within 10; a switch may come a sample later.

    A prediction looks at the kinks of six steps and comes to the same command again: 1 % of the samples.
    """
    rows = told(ALL[name], 5.0)
    rows[:, 4] = 0.8 * rows[:, 0]
    one, other = (made.run(made.start(), rows)[1] for made in (ALL[name], SINGLE[name]))
    off = np.abs(one - other)
    share = 0.99 if name.startswith("predictive") else 0.999
    assert np.quantile(off, share) < (10e-3 if name == "lead" else 2e-3)
    assert (other == other.astype(np.float32)).all()


def test_every_instruction_set_gives_the_same_bits():
    rows, before = told(RECOMMENDED, 1.0), _kernel.level()
    found = set()
    try:
        for level in _kernel.levels():
            _kernel.use_level(level)
            found.add(RECOMMENDED.run(RECOMMENDED.start(), rows)[0])
    finally:
        _kernel.use_level(before)
    assert len(found) == 1


def test_bytes_that_are_no_state_are_refused():
    with pytest.raises(ValueError, match="not a controller's state"):
        RECOMMENDED.step(b"no state", Reference(0.0), Measurement(0.0, ROOM))


# ------------------------------------------------------------------------------------- safety


@examples(60)
@given(
    which=st.sampled_from([(law, name) for law in OF for name in OF[law]]),
    rows=st.lists(st.tuples(forces, forces, readings, temperatures, forces), min_size=1, max_size=40),
    repeats=st.integers(1, 60),
    single=st.booleans(),
)
def test_whatever_it_is_told_the_command_is_within_its_ends(which, rows, repeats, single):
    """And what can be told from a reading alone is said, in both precisions."""
    law, name = which
    made = replace(OF[law][name], single=single)
    told_rows = np.repeat(np.array(rows), repeats, axis=0)
    state, current, flags = made.run(made.start(), told_rows)
    assert ((current >= 0.0) & (current <= 2.0)).all()
    limits = made.config.thermometer
    number = {"far": made.config.faults.far_x, "cold": limits.cold_limit, "hot": limits.hot_limit}
    if single:  # a target's readings are rounded, and its limits
        with np.errstate(over="ignore"):
            told_rows = told_rows.astype(np.float32).astype(np.float64)
            number = {key: float(np.float32(value)) for key, value in number.items()}
    now, x, kelvin = told_rows[:, 0], told_rows[:, 2], told_rows[:, 3]
    wrong = {
        Flag.NO_TARGET: ~(np.abs(now) <= 1e7),
        Flag.NO_DISPLACEMENT: ~(np.abs(x) <= number["far"]),
        Flag.NO_TEMPERATURE: ~((kelvin >= number["cold"]) & (kelvin <= number["hot"])),
    }
    for flag, expected in wrong.items():
        if flag is Flag.NO_TEMPERATURE and name == "paper-unaware":
            continue  # it has one temperature whatever is read
        np.testing.assert_array_equal((flags & flag) != 0, expected)
    believed = made.estimate(state)
    numbers = (believed.displacement, believed.velocity, believed.temperature, believed.force)
    assert np.isfinite(numbers).all()


def test_a_bank_of_controllers_stepped_in_turn_is_each_of_them_alone():
    """Two precisions, two names: what one does the other does not feel."""
    made = [ALL["recommended"], SINGLE["recommended"], ALL["paper"], SINGLE["pi"]]
    rows = [told(c, 0.3, amplitude=300.0 * (k + 1)) for k, c in enumerate(made)]
    alone = [c.run(c.start(), r)[1] for c, r in zip(made, rows, strict=True)]
    states = [c.start() for c in made]
    for i in range(len(rows[0])):
        for k, c in enumerate(made):
            now, ahead, x, kelvin, force = rows[k][i]
            states[k], current = c.step(states[k], Reference(now, ahead), Measurement(x, kelvin, force))
            assert current == alone[k][i]


@every_law
@examples(25)
@given(rows=st.lists(st.tuples(forces, forces, readings, temperatures), min_size=1, max_size=40))
def test_after_any_rubbish_it_tracks_again(law, rows):
    """2.5 s of good readings later the command is that of a controller which never heard any rubbish.

    Good readings of temperature move by some noise: one that jumped and then stands still is called frozen.
    """
    bad = np.column_stack([np.array(rows), np.full(len(rows), np.nan)])
    made = OF[law]["recommended"]
    good = told(made, 2.8, noise=0.0)
    good[:, 3] += 0.05 * np.random.default_rng(2).standard_normal(len(good))
    good[:, 4] = np.nan
    clean = made.run(made.start(), good)[1]
    after = made.run(made.run(made.start(), bad)[0], good)[1]
    assert np.abs(after - clean)[2500:].max() < 0.02


def faulted(
    row: int, values: FloatArray | float, *, seconds: float = 1.0, at: float = 0.5
) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
    """Return commands and flags of a run in which one reading goes wrong from ``at`` on, and without that."""
    good = told(RECOMMENDED, seconds)
    bad = good.copy()
    bad[round(at / PERIOD) :, row] = values
    clean, wrong = (RECOMMENDED.run(RECOMMENDED.start(), rows) for rows in (good, bad))
    return wrong[1], wrong[2], clean[1]


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e3, 100.0, 500.0])
def test_a_temperature_that_cannot_be_is_replaced_by_the_last_good_one(value):
    current, flags, clean = faulted(3, value)
    assert (flags[500:] & Flag.NO_TEMPERATURE).all()
    assert not (flags[:500] & Flag.NO_TEMPERATURE).any()
    np.testing.assert_allclose(current, clean, atol=1e-3)


def test_a_temperature_that_jumps_is_not_believed_and_one_that_stays_there_is_in_the_end():
    """60 K at once: the last good one for 2 s, then the reading."""
    current, flags, clean = faulted(3, ROOM + 60.0, seconds=4.0)
    assert (flags[500:2490] & Flag.TEMPERATURE_JUMP).all()
    np.testing.assert_allclose(current[:2490], clean[:2490], atol=1e-3)
    assert not (flags[2510:] & Flag.TEMPERATURE_JUMP).any()
    assert np.abs(current[2600:] - clean[2600:]).max() > 0.1


def test_a_temperature_that_jumps_later_is_believed_when_it_has_stood_as_long_as_the_one_before():
    """3 s of good readings, then 60 K more: 3 s of the belief before, then the reading."""
    current, flags, clean = faulted(3, ROOM + 60.0, seconds=7.0, at=3.0)
    assert (flags[3000:5990] & Flag.TEMPERATURE_JUMP).all()
    np.testing.assert_allclose(current[:5990], clean[:5990], atol=1e-3)
    assert not (flags[6010:] & Flag.TEMPERATURE_JUMP).any()


@pytest.mark.parametrize("known_from", [0, 300])
@pytest.mark.parametrize("stuck", [ROOM, math.nan, 1e9])
def test_a_thermometer_that_is_wrong_from_the_start_is_seen_by_the_coil(stuck, known_from):
    """The coil is at 370 K, and read once current flows: within 0.3 s it is believed, and said so."""
    rows = np.column_stack([told(RECOMMENDED, 1.0, kelvin=stuck), np.full(1000, np.nan)])
    rows[known_from:, 5] = 370.0
    state, _, flags = RECOMMENDED.run(RECOMMENDED.start(), rows)
    assert RECOMMENDED.estimate(state).temperature == pytest.approx(370.0, abs=0.1)
    said = Flag.WRONG_TEMPERATURE if stuck == ROOM else Flag.NO_TEMPERATURE
    assert (flags[known_from:] & said).all()


def test_a_coil_that_agrees_with_the_thermometer_changes_nothing():
    """A current warms it more than the fluid: no command differs by a bit, nothing is flagged."""
    plain = told(RECOMMENDED, 1.0, kelvin=340.0)
    warm = np.column_stack([plain, 340.0 + np.linspace(-10.0, 20.0, 1000)])
    one, other = (RECOMMENDED.run(RECOMMENDED.start(), rows) for rows in (plain, warm))
    assert np.array_equal(one[1], other[1])
    assert np.array_equal(one[2], other[2])


@pytest.mark.system
def test_a_constant_force_that_the_card_does_not_know_is_learnt_where_it_is_seen_both_ways():
    """60 N cost 50 N and more; learnt, 3 N. A gain that is a tenth too high is not taken for one."""
    base = replace(SCENARIOS["sine-900N-1Hz"], duration_s=2.0)

    def error(name: str, **disturbance: float) -> float:
        run = run_loop(CardPlant(DOUBLE), ALL[name], replace(base, disturbance=Disturbance(**disturbance)))
        reach = attainable_range(CardPlant(DOUBLE), run.course, base.temperature_degC, base.highest_A)
        offset = disturbance.get("force_offset_N", 0.0)
        reach = AttainableRange(reach.low + offset, reach.high + offset)
        return score_run(run, reach).rmse_feasible_N or math.inf

    sound = error("recommended")
    assert error("recommended", force_offset_N=60.0) > sound + 30.0
    for offset in (60.0, -60.0):
        assert error("recommended-offset", force_offset_N=offset) < sound + 3.0
    assert error("recommended-offset") < sound + 1.0
    assert error("recommended-offset", force_gain=1.1) < error("recommended", force_gain=1.1) + 1.0


@pytest.mark.parametrize("seen", ["one way", "within what the sensor may be off"])
def test_a_constant_force_that_cannot_be_seen_changes_nothing(seen):
    """Moving out alone a gain would look like it; and an accelerometer's bias times its mass is no force."""
    made = controllers_for(DOUBLE, force_error_N=400.0 if seen.startswith("within") else 0.0)
    plain, learns = made["recommended"], made["recommended-offset"]
    rows = told(plain, 1.0, amplitude=300.0)
    if seen == "one way":
        rows[:, 2] = np.linspace(-8e-3, 8e-3, 1000)
    rows[:, 4] = 60.0 + plain.estimate(plain.run(plain.start(), rows)[0]).force
    one, other = (each.run(each.start(), rows)[1] for each in (plain, learns))
    assert np.array_equal(one, other)


def test_without_a_temperature_for_long_the_nominal_one_is_used():
    made = controllers_for(DOUBLE, safety=Safety(hold_s=0.5, nominal_K=363.15))["recommended"]
    rows = told(made, 6.0)
    rows[500:, 3] = np.nan
    state, _, flags = made.run(made.start(), rows)
    assert not (flags[:990] & Flag.NOMINAL_TEMPERATURE).any()
    assert (flags[1010:] & Flag.NOMINAL_TEMPERATURE).all()
    assert made.estimate(state).temperature == pytest.approx(363.15)


def test_a_temperature_that_rises_at_19_K_a_second_is_followed_and_at_40_K_is_not():
    for rate, followed in ((19.0, True), (60.0, False)):
        rows = told(RECOMMENDED, 3.0)
        rows[:, 3] = ROOM + rate * PERIOD * np.arange(len(rows))
        _, _, flags = RECOMMENDED.run(RECOMMENDED.start(), rows)
        assert bool((flags & Flag.TEMPERATURE_JUMP).any()) != followed


def test_beyond_the_model_s_temperatures_its_edge_is_held_and_said():
    edge, beyond = (told(RECOMMENDED, 0.5, kelvin=k) for k in (398.15, 420.0))
    state, current, flags = RECOMMENDED.run(RECOMMENDED.start(), beyond)
    np.testing.assert_allclose(current, RECOMMENDED.run(RECOMMENDED.start(), edge)[1], atol=1e-12)
    assert (flags & Flag.OUTSIDE_TEMPERATURE).all()
    assert Flag.OUTSIDE_TEMPERATURE in RECOMMENDED.flags(state)


@pytest.mark.parametrize("value", [math.nan, -math.inf, 5.0])
def test_without_displacement_it_coasts_and_then_falls_back(value):
    """The motion is carried on for 120 ms; then the command is the fall-back, until it is known again."""
    current, flags, clean = faulted(2, value, seconds=1.0)
    assert (flags[500:] & Flag.NO_DISPLACEMENT).all()
    assert np.abs(current - clean)[500:510].max() < 0.1
    assert (current[625:] == 0.0).all()
    assert (flags[625:] & Flag.MOTION_UNKNOWN).all()
    made = controllers_for(DOUBLE, safety=Safety(fall_back=0.4))["recommended"]
    rows = told(made, 1.0)
    rows[500:700, 2] = value
    _, current, flags = made.run(made.start(), rows)
    assert (current[625:700] == 0.4).all()
    assert not (flags[750:] & Flag.MOTION_UNKNOWN).any()


def test_a_displacement_that_freezes_while_the_damper_moves_is_noticed():
    frozen = told(RECOMMENDED, 1.0)[500, 2]
    _, flags, _ = faulted(2, float(frozen), seconds=1.0)
    assert (flags[525:] & Flag.FROZEN).all()
    assert (flags[650:] & Flag.MOTION_UNKNOWN).all()


def test_a_damper_at_rest_is_no_frozen_sensor():
    rows = np.full((3000, 5), np.nan)
    rows[:, :2], rows[:, 2], rows[:, 3] = 100.0, 1.25e-3, ROOM
    flags = RECOMMENDED.run(RECOMMENDED.start(), rows)[2]
    assert not (flags & (Flag.FROZEN | Flag.MOTION_UNKNOWN)).any()


def test_a_target_that_is_no_number_is_zero_and_said():
    current, flags, _ = faulted(0, math.nan)
    assert (flags[500:] & Flag.NO_TARGET).all()
    state = at_speed(RECOMMENDED)
    assert answer(RECOMMENDED, state, math.nan) == 0.0
    assert ((current >= 0.0) & (current <= 2.0)).all()


@pytest.mark.parametrize("name", ["clipped-on-off", "pi", "feed-forward-pi"])
def test_without_a_force_the_feedback_is_left_out(name):
    made = ALL[name]
    _, current, flags = made.run(made.start(), told(made, 1.0))
    assert (flags & Flag.NO_FORCE).all()
    if name != "feed-forward-pi":
        assert (current == 0.0).all()
    else:
        np.testing.assert_array_equal(current, RECOMMENDED.run(RECOMMENDED.start(), told(made, 1.0))[1])


# ------------------------------------------------------------------------------------- rules


def test_the_preview_is_the_time_to_a_share_of_a_step_and_half_a_period():
    """And a delay more is so much more preview; a target that is not known ahead is not asked for."""
    for period in (2e-4, 1e-3, 5e-3):
        made = controllers_for(DOUBLE, period_s=period)
        expected = LAGS.response_time(PREVIEW_SHARE) + 0.5 * period
        assert made["recommended"].preview_s == pytest.approx(expected)
        assert made["recommended-causal"].preview_s == 0.0
        assert made["recommended-causal"].config.inverse.preview == pytest.approx(expected)
        assert made["paper"].preview_s == made["exact"].preview_s == 0.0
    later = controllers_for(DOUBLE, extra_delay_s=0.01)["recommended"]
    assert later.preview_s == pytest.approx(RECOMMENDED.preview_s + 0.01, abs=2e-5)


def test_a_target_that_bends_evenly_is_extrapolated_without_error():
    """A parabola in time: the causal controller and the one that knows it ahead give one command, settled."""
    t = PERIOD * np.arange(1500)

    def target(at: Any) -> Any:
        return 300.0 + 200.0 * at + 80.0 * at**2

    rows = np.full((len(t), 5), np.nan)
    rows[:, 0], rows[:, 1] = target(t), target(t + RECOMMENDED.preview_s)
    rows[:, 2], rows[:, 3] = 0.02 * t, ROOM
    known, causal = (c.run(c.start(), rows)[1] for c in (RECOMMENDED, ALL["recommended-causal"]))
    np.testing.assert_allclose(causal[800:], known[800:], atol=1e-6)


def test_what_is_measured_teaches_the_gains():
    """A damper with 12 % less yield and 30 % more viscous force: 4 s of force data find both.

    The law is the damper's own here, so that what it leaves unexplained is small (10 N, one sample).
    """
    damper = at_once(DOUBLE)
    yields = {name: damper.coefficients[name] for name in ("yield_force", "second_force")}
    aged = damper.with_parameters(
        {
            f"{name}.{number}": 0.88 * value
            for name, form in yields.items()
            for number, value in zip(form.parameter_names, form.parameters, strict=True)
        }
        | {"viscosity.c0": 1.3 * 7000.0, "viscosity.c1": 1.3 * 700.0}
    )
    made = controllers_for(damper, displacement_noise_m=1e-6)["recommended-adaptive"]
    made = changed(made, learning__error_variance=100.0)
    rows, plant = told(made, 4.0, noise=1e-6), CardPlant(aged, step_s=PERIOD)
    t = PERIOD * np.arange(1, len(rows) + 1)
    x, v = MOTION.displacement(t), MOTION.velocity(t)
    state, force = made.start(), 0.0
    for k, row in enumerate(rows):
        state, current = made.step(state, Reference(row[0], row[1]), Measurement(row[2], row[3], force))
        force = float(plant.advance_many(x[k : k + 1], v[k : k + 1], current, ROOM - 273.15)[0])
    gains = made.estimate(state).gains
    assert gains[0] == pytest.approx(0.88, abs=0.05)
    assert gains[1] == pytest.approx(1.3, abs=0.1)


def test_a_scaled_controller_gives_the_current_of_the_scaled_force():
    """All parts times k, spring and offset aside: the command for k F is that of one for F."""
    bare = at_once(DOUBLE).with_parameters({"stiffness.value": 0.0, "offset.c0": 0.0, "offset.c1": 0.0})
    made = controllers_for(bare)["exact"]
    twice = made.scaled(2.0, 2.0, 2.0)
    for wanted in (200.0, 500.0, 900.0):
        assert answer(twice, at_speed(twice), 2.0 * wanted) == pytest.approx(
            answer(made, at_speed(made), wanted)
        )


def test_the_clipped_on_off_gives_all_or_nothing():
    made = ALL["clipped-on-off"]
    state = at_speed(made)
    for wanted, force, expected in (
        (800.0, 500.0, 2.0),
        (800.0, 900.0, 0.0),
        (-800.0, 900.0, 0.0),
        (-800.0, -500.0, 2.0),
    ):
        assert made.step(state, Reference(wanted), Measurement(0.0, ROOM, force))[1] == expected


# ------------------------------------------------------------------------------------- what is refused


UNMOVED = {"yield_force": Constant(300.0), "second_force": Constant(200.0)}
TANH: dict[str, ParameterLaw] = {
    "yield_force": Polynomial((100.0, 500.0)),
    "slope": Constant(100.0),
    "shift": Constant(0.5),
}


def other(**coefficients: ParameterLaw) -> Damper:
    return replace(DOUBLE, coefficients={**DOUBLE.coefficients, **coefficients})


@pytest.mark.parametrize(
    ("damper", "period", "said"),
    [
        (other(**UNMOVED), PERIOD, "does not depend on the command"),
        (
            replace(DOUBLE, law=LAWS["tanh"], coefficients=TANH),
            PERIOD,
            "the law is 'tanh'; expected one of bouc-wen, dahl",
        ),
        (other(n=Polynomial((0.6, 0.1))), PERIOD, "n goes from 0.6 to 0.8 over current and temperature"),
        (DOUBLE, 0.1, r"the period is 100 ms, and the force follows .* Sample at \d+ Hz or faster"),
        (
            replace(DOUBLE, actuation=Actuation(0.01, 0.01, delay_s=0.2, largest_command=2.0)),
            PERIOD,
            "the dead time of 200 ms is 200 periods",
        ),
        (replace(DOUBLE, actuation=Actuation(0.01, 0.01)), PERIOD, "largest command is not known"),
    ],
)
def test_what_no_controller_can_be_made_for_is_refused_with_its_reason(damper, period, said):
    with pytest.raises(InputError, match=said):
        controllers_for(damper, period_s=period)


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
@pytest.mark.parametrize("name", ["frozen_s", "jump_K", "coil_s", "hold_s"])
def test_a_safety_that_is_no_positive_number_is_refused_by_its_name(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"{name} is {value}"):
        Safety(**{name: value})
