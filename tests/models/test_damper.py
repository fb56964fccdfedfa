"""A damper: its flat numbers, its coefficients over the command, and what it refuses."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS

MILLIAMPERE: Any = "mA"  # what a caller without a type checker may write
ONE_END: Any = (0.0,)
ENVELOPE = OperatingEnvelope((0.0, 1.0), (-0.025, 0.025), (-0.2, 0.2))


def bouc_wen(**changed):
    given_coefficients: dict[str, ParameterLaw] = {
        "viscosity": Polynomial((600.0, 400.0)),
        "yield_force": Hill(90.0, 629.0, 1.14, 1.466),
        "rho": Exponential(1500.0, -0.3),
        "kappa": Constant(-0.9),
        "n": Constant(1.2),
    }
    return Damper(LAWS["bouc-wen"], {**given_coefficients, **changed})


def series_valve(**changed):
    values = {
        "yield_force": 400.0,
        "thinning": 3.2,
        "thinning_exponent": 0.43,
        "yield_velocity": 2.5e-3,
        "position_gain": -2.3,
        "gap_stiffness": 1.2e7,
        "gap": 1.7e-4,
        "gap_corner": 4.6e-5,
        "leak_damping": 3e4,
    }
    forms = {name: Constant(value) for name, value in values.items()}
    return Damper(LAWS["series-valve"], {**forms, **changed})


def test_coefficients_that_are_not_given_take_their_default_in_the_laws_order():
    damper = bouc_wen()
    assert tuple(damper.coefficients) == LAWS["bouc-wen"].names
    assert damper.coefficients["mass"] == Constant(0.0)
    assert damper.coefficients["stribeck_velocity"] == Constant(3e-3)


def test_numbers_have_flat_names_and_units_in_the_laws_order():
    damper = bouc_wen()
    assert list(damper.numbers)[:3] == ["viscosity.c0", "viscosity.c1", "stiffness.value"]
    assert damper.numbers["yield_force.gain"] == 629.0
    assert damper.units["yield_force.half_command"] == "A"
    assert damper.units["viscosity.c1"] == "N s/m/A"
    assert damper.units.keys() == damper.numbers.keys()


@given(st.data())
def test_numbers_put_back_give_the_same_damper_and_changed_ones_are_read_back(data):
    damper = bouc_wen()
    assert damper.with_numbers(damper.numbers) == damper
    name = data.draw(st.sampled_from(sorted(damper.numbers)))
    changed = damper.with_numbers({name: 0.75})
    assert changed.numbers == {**damper.numbers, name: 0.75}
    assert damper == bouc_wen()  # a value: the first one stays as it was


def test_coefficients_at_a_command_are_rows_in_the_laws_order():
    damper = bouc_wen()
    commands = np.array([0.0, 0.5, 1.0])
    table = damper.coefficients_at(commands)
    assert table.shape == (len(LAWS["bouc-wen"].names), 3)
    row = LAWS["bouc-wen"].names.index("rho")
    np.testing.assert_allclose(table[row], 1500.0 * np.exp(-0.3 * commands))
    assert damper.coefficients_at(0.5).shape == (table.shape[0], 1)


def test_a_damper_cannot_be_changed_but_can_be_sent_to_another_process():
    damper = bouc_wen()
    with pytest.raises(TypeError):
        damper.coefficients["rho"] = Constant(1.0)
    assert pickle.loads(pickle.dumps(damper)) == damper


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: bouc_wen(yeild_force=Constant(1.0)),
            "no coefficient 'yeild_force'; did you mean yield_force",
        ),
        (lambda: Damper(LAWS["dahl"], {}), "dahl: yield_force, rho not given, and there is no default"),
        (
            lambda: bouc_wen().with_numbers({"rho.at_zer": 1.0}),
            "no number 'rho.at_zer'; did you mean rho.at_zero",
        ),
        (lambda: Damper(LAWS["dahl"], series_valve().coefficients), "dahl: no coefficient 'thinning'"),
        (lambda: Damper(LAWS["bouc-wen"], bouc_wen().coefficients, MILLIAMPERE), "command_unit is 'mA'"),
        (lambda: Damper(LAWS["bouc-wen"], bouc_wen().coefficients, "A", -1.0), "command_lag_s is -1.0"),
        (lambda: OperatingEnvelope((1.0, 0.0), (0.0, 1.0), (0.0, 1.0)), r"envelope: command is \(1.0, 0.0\)"),
        (lambda: OperatingEnvelope((0.0, 1.0), (0.0, math.nan), (0.0, 1.0)), "envelope: displacement"),
        (lambda: OperatingEnvelope((0.0, 1.0), ONE_END, (0.0, 1.0)), "two finite numbers"),
    ],
)
def test_what_no_damper_can_be_is_refused_by_name(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_a_sound_damper_passes():
    bouc_wen().check(ENVELOPE)
    series_valve().check(ENVELOPE)
    assert bouc_wen().violations(np.linspace(0.0, 1.0, 11)) == ()


def test_a_coefficient_that_leaves_its_range_is_named_with_the_command():
    sinking = bouc_wen(yield_force=Polynomial((100.0, -150.0)))
    (said,) = sinking.violations([0.0, 0.5, 0.8, 1.0])
    assert said.startswith("bouc-wen: yield_force is -20 N; ")
    assert said.endswith("(at 0.8 A)")
    with pytest.raises(InputError, match="yield_force"):
        sinking.check(ENVELOPE)


def test_all_that_is_wrong_is_said_at_once():
    wrong = bouc_wen(yield_force=Constant(-1.0), kappa=Constant(1.5), n=Constant(0.1))
    with pytest.raises(InputError) as caught:
        wrong.check(ENVELOPE)
    assert [name in str(caught.value) for name in ("yield_force", "kappa", "n is 0.1")] == [True] * 3


def test_a_coefficient_that_overflows_is_refused():
    (said,) = bouc_wen(yield_force=Exponential(1.0, 1000.0)).violations([0.0, 1.0])
    assert said == "bouc-wen: yield_force is inf; it must be finite (at 1 A)"


@pytest.mark.parametrize(
    ("gain", "fine"), [(-2.3, True), (-39.9, True), (39.9, True), (-40.0, False), (41.0, False)]
)
def test_the_valve_must_not_turn_round_inside_the_stroke(gain, fine):
    """With a stroke of 25 mm either way, 1 + gain x stays positive for |gain| < 40 per metre."""
    damper = series_valve(position_gain=Constant(gain))
    assert (damper.problems(ENVELOPE) == ()) == fine
    if not fine:
        with pytest.raises(InputError, match=r"1 \+ position_gain x is .* at x = -?0\.025 m and 0 A"):
            damper.check(ENVELOPE)
