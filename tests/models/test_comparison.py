"""The comparison of two model cards agrees with formulas in the range that both cards cover."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import pytest

from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.comparison import Comparison, compare_cards
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Linear

ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.2, 0.2))
WARM = replace(ENVELOPE, temperature=(293.15, 393.15))
ERRORS = {"yield_force.c0": 3.0, "yield_force.c1": 4.0, "viscosity.value": 30.0}


def a_damper(strength: float = 1.0, **changed: ParameterLaw) -> Damper:
    """Return a Bingham damper because its characteristics are closed forms."""
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(900.0),
        "yield_force": Polynomial((60.0 * strength, 600.0 * strength)),
        "yield_velocity": Constant(1e-6),
        "offset": Constant(35.0),
        **changed,
    }
    return Damper(LAWS["bingham"], forms, actuation=Actuation(0.01, 0.02))


def warm_damper(slope: float = 1e-3, *, assumed: bool = False) -> Damper:
    return a_damper(yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(slope), assumed))


def run(split: str, rmse: float) -> dict[str, Any]:
    return {"name": "run", "split": split, "rmse_N": rmse, "nrmse_percent": 3.0}


def a_card(
    damper: Damper, envelope: OperatingEnvelope = ENVELOPE, *, rmse: float = 6.0, title: str = "a"
) -> ModelCard:
    return ModelCard(
        title=title,
        damper=damper,
        envelope=envelope,
        evidence=Evidence(runs=(run("training", rmse),), method="varpro", cost=3.0, dataset_fingerprint="0"),
        standard_errors={name: error for name, error in ERRORS.items() if name in damper.parameters},
    )


def compared(first: ModelCard, second: ModelCard, names: tuple[str, str] = ("first", "second")) -> Comparison:
    return compare_cards(first, second, names=names)


def test_card_equals_itself_in_comparison():
    same = compared(a_card(a_damper()), a_card(a_damper()))
    assert (same.found[0].extension == same.found[1].extension).all()
    assert all(pair.z == 0.0 for pair in same.parameters if pair.z is not None)
    assert same.verdict == "second and first give the same force everywhere."


def test_yield_force_difference_matches_formula():
    """The Bingham force is F_y(I) + c v. With 10 % less F_y, the difference is -0.1 F_y(I) at every speed."""
    found = compared(a_card(a_damper()), a_card(a_damper(0.9)), ("before", "after"))
    difference = found.found[1].damping - found.found[0].damping
    for i, command in enumerate(found.scope.commands):
        assert difference[0, i] == pytest.approx(-0.1 * (60.0 + 600.0 * command), rel=1e-9)
    assert found.verdict.startswith("after is weaker than before everywhere (")
    assert re.search(r"most at 2 A and \d+ mm/s: -126 N", found.verdict)
    assert found.parameters[0].name == "viscosity.value"


def test_swapped_cards_have_opposite_difference():
    first, second = a_card(a_damper()), a_card(a_damper(1.2, viscosity=Constant(700.0)))
    there, back = compared(first, second), compared(second, first)
    assert (there.found[1].damping == back.found[0].damping).all()
    z = {pair.name: pair.z for pair in there.parameters}
    assert {pair.name: None if pair.z is None else -pair.z for pair in back.parameters} == z


def test_comparison_divides_parameter_difference_by_standard_error():
    found = compared(a_card(a_damper()), a_card(a_damper(viscosity=Constant(1020.0))))
    (viscosity,) = (pair for pair in found.parameters if pair.name == "viscosity.value")
    assert viscosity.z == pytest.approx(120.0 / math.hypot(30.0, 30.0), rel=1e-12)
    assert (viscosity.first, viscosity.second) == (900.0, 1020.0)


def test_force_difference_below_model_errors_is_called_unclear():
    """A force difference of 0.5 % is smaller than 100 N, the root sum of squares of two RMS errors."""
    verdict = compared(a_card(a_damper(), rmse=60.0), a_card(a_damper(1.005), rmse=80.0)).verdict
    assert verdict.startswith("No clear difference: ")
    assert "(100 N)" in verdict


@pytest.mark.parametrize(
    ("runs", "own"),
    [
        ((run("held_out", 3.0), run("held_out", 5.0), run("training", 99.0)), math.sqrt(17.0 + 36.0)),
        ((run("training", 1.0), run("training", 7.0)), math.sqrt(25.0 + 36.0)),
        ((), None),
    ],
)
def test_comparison_prefers_errors_of_held_out_runs(runs, own):
    card = a_card(a_damper())
    other = replace(card, evidence=replace(card.evidence, runs=runs), damper=a_damper(1.5))
    assert compared(card, other).own_error_N == (None if own is None else pytest.approx(own))


# Common range of validity of two cards


def test_forces_are_compared_in_common_envelope():
    small = OperatingEnvelope((0.5, 3.0), (-0.005, 0.03), (-0.1, 0.3))
    scope = compared(a_card(a_damper()), a_card(a_damper(), small)).scope
    assert (scope.commands[0], scope.commands[-1]) == (0.5, 2.0)
    assert max(scope.speeds) <= 0.2
    assert scope.amplitude <= 0.02


def test_dampers_are_compared_at_common_temperatures():
    hot = replace(WARM, temperature=(333.15, 413.15))
    scope = compared(a_card(warm_damper(), WARM), a_card(warm_damper(), hot)).scope
    assert (scope.temperatures[0], scope.temperatures[-1]) == pytest.approx((333.15, 393.15))
    unknown = compared(a_card(warm_damper()), a_card(warm_damper(), hot)).scope
    assert unknown.temperatures[0] == pytest.approx(333.15)


def test_temperature_independent_damper_is_compared_at_tested_temperature():
    """The second damper was tested only at 60 degC, where the first damper has the same yield force."""
    tested = replace(ENVELOPE, temperature=(332.0, 334.3))
    found = compared(a_card(warm_damper(), WARM), a_card(a_damper(0.96), tested))
    assert found.scope.temperatures == pytest.approx((333.15,))
    assert found.found[0].damping == pytest.approx(found.found[1].damping, rel=1e-9)
    assert found.notes == ("second has no temperature model: both are compared at 60 degC",)


@pytest.mark.parametrize(
    ("first", "second", "said"),
    [
        (a_damper(), replace(ENVELOPE, command=(2.5, 3.0)), "command is 0 to 2 in the first card"),
        (a_damper(), replace(ENVELOPE, displacement=(0.02, 0.05)), "displacement is -0.02 to 0.02"),
        (a_damper(), replace(ENVELOPE, velocity=(0.2, 0.5)), "velocity is -0.2 to 0.2"),
        (warm_damper(), replace(ENVELOPE, temperature=(413.0, 420.0)), "temperature is 293.1 to 393.1"),
    ],
)
def test_cards_without_common_envelope_are_rejected(first, second, said):
    with pytest.raises(InputError, match=re.escape(said)):
        compared(a_card(first, WARM), a_card(a_damper(), second))


def test_cards_in_different_units_are_rejected():
    with pytest.raises(InputError, match="the command of first is in A and that of second in V"):
        compared(a_card(a_damper()), a_card(replace(a_damper(), command_unit="V")))
