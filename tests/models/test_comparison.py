"""Two cards compared: closed forms of the differences, antisymmetry, and what cannot be compared."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.models.comparison import common_envelope, compare_cards
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Linear
from tests.models.two_cards import ENVELOPE, WARM, a_card, a_damper, warm_damper

# ------------------------------------------------------------------------------------------- differences


def test_a_card_does_not_differ_from_itself():
    same = compare_cards(a_card(a_damper()), a_card(a_damper()))
    assert (same.found[0].extension == same.found[1].extension).all()
    assert all(pair.z == 0.0 for pair in same.parameters if pair.z is not None)
    assert same.verdict == "second and first give the same force everywhere."


def test_a_damper_with_a_tenth_less_yield_force_loses_a_tenth_of_that_part():
    """Bingham: the damping force is F_y(I) + c v, so that the difference is -0.1 F_y(I) at every speed."""
    found = compare_cards(a_card(a_damper()), a_card(a_damper(0.9)), names=("before", "after"))
    difference = found.found[1].damping - found.found[0].damping
    for i, command in enumerate(found.scope.commands):
        assert difference[0, i] == pytest.approx(-0.1 * (60.0 + 600.0 * command), rel=1e-9)
    assert found.verdict.startswith("after is weaker than before everywhere (")
    assert "most at 2 A and " in found.verdict
    assert ": -126 N (" in found.verdict


def test_swapping_the_cards_turns_every_difference_round():
    first, second = a_card(a_damper()), a_card(a_damper(1.2, viscosity=Constant(700.0)))
    there, back = compare_cards(first, second), compare_cards(second, first)
    assert (there.found[1].damping == back.found[0].damping).all()
    z = {pair.name: pair.z for pair in there.parameters}
    assert {pair.name: None if pair.z is None else -pair.z for pair in back.parameters} == z


def test_a_z_score_is_the_difference_over_both_standard_errors():
    found = compare_cards(a_card(a_damper()), a_card(a_damper(viscosity=Constant(1020.0))))
    (viscosity,) = (pair for pair in found.parameters if pair.name == "viscosity.value")
    assert viscosity.z == pytest.approx(120.0 / math.hypot(30.0, 30.0), rel=1e-12)
    assert viscosity.values == (900.0, 1020.0)


def test_a_difference_below_the_cards_own_errors_is_not_called_one():
    """60 and 80 N of RMS error make 100 N together; half a percent of the force is less."""
    cards = a_card(a_damper(), rmse=60.0), a_card(a_damper(1.005), rmse=80.0)
    verdict = compare_cards(*cards).verdict
    assert verdict.startswith("No clear difference: ")
    assert "(100 N)" in verdict


def test_numbers_of_different_laws_are_not_compared():
    dahl = Damper(LAWS["dahl"], {"yield_force": Constant(300.0), "rho": Constant(1e3)})
    found = compare_cards(a_card(a_damper()), a_card(dahl))
    assert found.parameters == ()
    assert any("the laws differ (bingham, dahl)" in note for note in found.notes)


def test_numbers_of_different_forms_get_no_z_score():
    quadratic = a_damper(yield_force=Polynomial((60.0, 600.0, 0.0)))
    found = compare_cards(a_card(a_damper()), a_card(replace(quadratic)))
    both = {pair.name: pair for pair in found.parameters}
    assert both["yield_force.c2"].values == (None, 0.0)
    assert both["viscosity.value"].z == 0.0
    constant = a_damper(yield_force=Constant(60.0))
    found = compare_cards(a_card(a_damper()), a_card(constant))
    assert {pair.z for pair in found.parameters if pair.name.startswith("yield_force.")} == {None}
    assert any(note.startswith("yield_force: of another form") for note in found.notes)


def test_the_verdict_says_mean_largest_difference_its_place_its_share_and_both_errors():
    """F_y(I) + c v by hand; a tenth less yield force is most at 2 A, at every speed the same."""
    found = compare_cards(a_card(a_damper()), a_card(a_damper(0.9), rmse=8.0), names=("new", "worn"))
    yielding = 60.0 + 600.0 * np.linspace(0.0, 2.0, 5)[:, None]
    before = yielding + 900.0 * np.array(found.scope.speeds)
    mean = -10.0 * np.sum(yielding + 0.0 * before) / np.sum(before)
    said = re.fullmatch(
        r"worn is weaker than new everywhere \((.*) % over all\), most at 2 A and (.*) mm/s: -126 N "
        r"\((.*) %\); the RMS errors of both cards together are 10 N\.",
        found.verdict,
    )
    assert said is not None
    assert said[1] == f"{mean:+.1f}"
    assert 1e-3 * float(said[2]) in found.scope.speeds
    assert said[3] == f"{-12600.0 / (1260.0 + 0.9 * float(said[2])):+.1f}"
    assert found.own_error_N == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("form", "viscosity", "said", "turned"),
    [
        (
            (290.0, 450.0),
            1900.0,
            "stronger than first nearly everywhere",
            "weaker than first nearly everywhere",
        ),
        (
            (240.0, 450.0),
            1900.0,
            "weaker than first in some places and stronger in others",
            "weaker than first",
        ),
        ((61.0, 600.0), 900.0, "stronger than first everywhere", "weaker than first everywhere"),
    ],
)
def test_nearly_everywhere_is_nine_places_of_ten(form, viscosity, said, turned):
    """Of five commands at four speeds two, three and none have the other sign."""
    other = a_damper(yield_force=Polynomial(form), viscosity=Constant(viscosity))
    cards = [replace(a_card(each, rmse=0.1)) for each in (a_damper(), other)]
    found = compare_cards(*cards)
    assert found.scope.speeds == (0.02, 0.05, 0.1, 0.2)
    assert found.verdict.startswith(f"second is {said} (")
    assert compare_cards(*cards[::-1]).verdict.startswith(f"second is {turned} ")


def test_the_verdict_of_a_warm_damper_names_the_temperature_and_none_without_force():
    """The yield force that a steeper fall takes away is most where it is hottest."""
    found = compare_cards(a_card(warm_damper(), WARM), a_card(warm_damper(2e-3), WARM))
    assert ", most at 2 A, 120 degC and " in found.verdict
    rigid = a_damper(0.0, viscosity=Constant(0.0))
    said = compare_cards(a_card(rigid), a_card(a_damper())).verdict
    assert said.startswith("second is stronger than first everywhere, most at 2 A and 200 mm/s: +1440 N; the")


def run(split: str, rmse: float) -> dict[str, Any]:
    return {"name": "run", "split": split, "rmse_N": rmse, "nrmse_percent": 3.0}


@pytest.mark.parametrize(
    ("runs", "own"),
    [
        ((run("held_out", 3.0), run("held_out", 5.0), run("training", 99.0)), math.sqrt(17.0 + 36.0)),
        ((run("training", 1.0), run("training", 7.0)), math.sqrt(25.0 + 36.0)),
        ((), None),
    ],
)
def test_a_card_s_own_error_is_that_of_its_held_out_runs_or_of_training_where_there_are_none(runs, own):
    card = a_card(a_damper())
    other = replace(card, evidence=replace(card.evidence, runs=runs), damper=a_damper(1.5))
    for cards in ((card, other), (other, card)):
        found = compare_cards(*cards)
        assert found.own_error_N == (None if own is None else pytest.approx(own))
        assert found.verdict.endswith("%)." if own is None else f"together are {own:.0f} N.")


def test_the_parameters_listed_are_those_identified_in_either_or_that_differ():
    first = replace(a_card(a_damper()), standard_errors={"yield_force.c0": 3.0, "yield_force.c1": 0.0})
    other = replace(first, damper=a_damper(offset=Constant(40.0)), standard_errors={"yield_force.c1": 0.0})
    both = replace(other, standard_errors={"yield_force.c0": 4.0, "viscosity.value": 1.0})
    for cards in ((first, other), (other, first)):
        found = {pair.name: pair for pair in compare_cards(*cards).parameters}
        assert found.keys() == {"yield_force.c0", "yield_force.c1", "offset.value"}
        assert [pair.z for pair in found.values()] == [None] * 3  # one error, no scatter, no error
    found = {pair.name: pair for pair in compare_cards(first, both).parameters}
    assert found["yield_force.c0"].z == 0.0
    assert found["yield_force.c0"].unit == "N"
    assert found["offset.value"].values == (35.0, 40.0)
    assert found["viscosity.value"].standard_errors == (None, 1.0)


def test_a_z_score_counts_the_second_less_the_first():
    cards = a_card(a_damper()), a_card(a_damper(1.1))
    found = {pair.name: pair.z for pair in compare_cards(*cards).parameters}
    assert found["yield_force.c0"] == pytest.approx(6.0 / math.hypot(3.0, 3.0))
    assert found["yield_force.c1"] == pytest.approx(60.0 / math.hypot(4.0, 4.0))


def test_an_assumed_temperature_factor_is_noted_of_the_card_that_has_it():
    assumed = a_damper(
        yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(1e-3), assumed=True)
    )
    notes = compare_cards(a_card(warm_damper(), WARM), a_card(assumed, WARM), names=("x", "y")).notes
    assert [str(note).partition(" (")[0] for note in notes if "assumed" in note] == [
        "y: the temperature factor of yield_force is assumed"
    ]


# ------------------------------------------------------------------------------------------- envelope


def test_forces_are_compared_only_where_both_hold():
    small = OperatingEnvelope((0.5, 3.0), (-0.005, 0.03), (-0.1, 0.3))
    scope = compare_cards(a_card(a_damper()), a_card(a_damper(), small)).scope
    assert (scope.commands[0], scope.commands[-1]) == (0.5, 2.0)
    assert max(scope.speeds) <= 0.2
    assert scope.amplitude <= 0.02


def test_two_tempered_dampers_are_compared_at_common_temperatures():
    hot = replace(WARM, temperature=(333.15, 413.15))
    scope = compare_cards(a_card(warm_damper(), WARM), a_card(warm_damper(), hot)).scope
    assert (scope.temperatures[0], scope.temperatures[-1]) == pytest.approx((333.15, 393.15))


def test_a_damper_that_knows_no_temperature_is_compared_where_it_was_tested():
    """At 60 degC the tempered one has lost 4 % of its yield force; the other was tested there."""
    tested = replace(ENVELOPE, temperature=(332.0, 334.3))
    found = compare_cards(a_card(warm_damper(), WARM), a_card(a_damper(0.96), tested))
    assert found.scope.temperatures == pytest.approx((333.15,))
    assert found.found[0].damping == pytest.approx(found.found[1].damping, rel=1e-9)
    assert any("knows no other temperature: both are compared at 60 degC" in note for note in found.notes)


def test_dampers_tested_at_other_temperatures_that_know_none_are_compared_with_a_warning():
    cold, hot = (replace(ENVELOPE, temperature=(t, t + 1.0)) for t in (293.0, 353.0))
    found = compare_cards(a_card(a_damper(), cold), a_card(a_damper(), hot))
    assert found.scope.temperatures == (None,)
    assert any("neither model knows temperature" in note for note in found.notes)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (
            a_card(a_damper(), replace(ENVELOPE, command=(2.5, 3.0))),
            "command is 0 to 2 A in x and 2.5 to 3 A",
        ),
        (a_card(a_damper(), replace(ENVELOPE, displacement=(0.02, 0.05))), "displacement is -20 to 20 mm"),
        (a_card(replace(a_damper(), command_unit="V")), "x is commanded in A and y in V"),
    ],
)
def test_dampers_without_common_ground_are_refused_with_numbers(other, said):
    with pytest.raises(InputError, match=re.escape(said)):
        common_envelope((a_card(a_damper()), other), ("x", "y"))


def test_temperatures_that_do_not_meet_are_refused():
    cold, hot = (replace(WARM, temperature=(t, t + 20.0)) for t in (263.15, 333.15))
    with pytest.raises(
        InputError, match=r"temperature is -10 to 10 degC in first and 60 to 80 degC in second"
    ):
        compare_cards(a_card(warm_damper(), cold), a_card(warm_damper(), hot))


def places(low: float, high: float) -> tuple[float, float]:
    return low + 273.15, high + 273.15


@pytest.mark.parametrize(
    ("first", "second", "shared"),
    [
        (places(10.0, 30.0), places(30.0, 60.0), places(30.0, 30.0)),  # they touch
        (None, places(30.0, 60.0), places(30.0, 60.0)),
        (None, None, None),
        # at one temperature, what was assumed beyond it
        (places(20.0, 24.9), places(10.0, 60.0), places(10.0, 60.0)),
        (places(20.0, 25.1), places(10.0, 60.0), places(20.0, 25.1)),
    ],
)
def test_two_warm_dampers_share_where_both_hold(first, second, shared):
    held = replace(warm_damper(), temperature_range=places(0.0, 80.0))
    one = held if first is not None and first[0] > 290.0 else warm_damper()
    cards = [
        a_card(damper, replace(ENVELOPE, temperature=at))
        for damper, at in ((one, first), (warm_damper(), second))
    ]
    for pair in (cards, cards[::-1]):
        found, notes = common_envelope((pair[0], pair[1]), ("x", "y"))
        assert found.temperature == (None if shared is None else pytest.approx(shared))
        assert notes == []


@pytest.mark.parametrize(
    ("warm", "tested", "said"),
    [
        (places(20.0, 120.0), places(59.0, 61.0), "tested near 60 degC and knows no other: 60"),
        (places(20.0, 120.0), places(12.0, 18.5), "tested near 15 degC and knows no other: 20"),
        (places(20.0, 120.0), places(123.0, 126.0), "tested near 124 degC and knows no other: 120"),
        (places(40.0, 120.0), None, "not tested: 40"),
        (places(-20.0, 120.0), None, "not tested: 20"),
        (None, None, "not tested: 20"),
    ],
)
def test_one_that_knows_no_temperature_is_compared_near_where_it_was_tested(warm, tested, said):
    """At the nearest place where the other one holds, if that is not more than 5 K away."""
    cards = (
        a_card(warm_damper(), replace(ENVELOPE, temperature=warm)),
        a_card(a_damper(), replace(ENVELOPE, temperature=tested)),
    )
    for pair, names in ((cards, ("x", "y")), (cards[::-1], ("y", "x"))):
        found, notes = common_envelope((pair[0], pair[1]), (names[0], names[1]))
        (note,) = notes
        long = said.replace("knows no other:", "knows no other temperature:").replace(
            "not tested", "does not say at which temperature it was tested"
        )
        head, _, degrees = long.partition(": ")
        assert note == f"y {head if 'does' in head else 'was ' + head}: both are compared at {degrees} degC"
        assert found.temperature is not None
        assert found.temperature[0] == found.temperature[1]
        assert found.temperature[0] - 273.15 == pytest.approx(float(degrees))


@pytest.mark.parametrize("turned", [False, True])
def test_one_that_knows_no_temperature_and_was_tested_elsewhere_is_refused(turned):
    cards = (
        a_card(warm_damper(), replace(ENVELOPE, temperature=places(40.0, 80.0))),
        a_card(a_damper(), replace(ENVELOPE, temperature=places(30.0, 32.0))),
    )
    said = "temperature is 40 to 80 degC in x and 30 to 32 degC in y"
    if turned:
        cards, said = (cards[1], cards[0]), "temperature is 30 to 32 degC in x and 40 to 80 degC in y"
    with pytest.raises(InputError, match=said):
        common_envelope(cards, ("x", "y"))


@pytest.mark.parametrize(("apart", "noted"), [(4.9, False), (5.1, True)])
@pytest.mark.parametrize("end", [0, 1])
def test_temperatures_that_nobody_knows_are_noted_from_5_K_apart(apart, noted, end):
    other = [293.15, 300.15]
    other[end] += apart if end else -apart
    cards = (
        a_card(a_damper(), replace(ENVELOPE, temperature=(293.15, 300.15))),
        a_card(a_damper(), replace(ENVELOPE, temperature=(other[0], other[1]))),
    )
    envelope, notes = common_envelope(cards, ("x", "y"))
    assert envelope.temperature is None
    assert bool(notes) == noted
    if noted:
        said = f"{other[0] - 273.15:.0f} to {other[1] - 273.15:.0f} degC"
        assert notes[0].startswith(f"x was tested at 20 to 27 degC, y at {said}; neither model")
    assert common_envelope((cards[0], a_card(a_damper())), ("x", "y"))[1] == []


def test_ranges_that_touch_share_a_command_but_no_motion():
    card, beyond = a_card(a_damper()), a_card(a_damper(), replace(ENVELOPE, command=(2.0, 3.0)))
    assert common_envelope((card, beyond), ("x", "y"))[0].command == (2.0, 2.0)
    for what, said in (("displacement", "-20 to 20 mm"), ("velocity", "-200 to 200 mm/s")):
        other = a_card(a_damper(), replace(ENVELOPE, **{what: (getattr(ENVELOPE, what)[1], 0.5)}))
        with pytest.raises(InputError, match=f"{what} is {said} in x and {said.split()[2]} to 500 mm"):
            common_envelope((card, other), ("x", "y"))
