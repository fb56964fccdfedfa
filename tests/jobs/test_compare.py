"""Two cards compared: closed forms of the differences, antisymmetry, and what cannot be compared."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

import mrdamper as mrdamper_package
from mrdamper.errors import InputError
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.comparison import common_envelope, compare_cards
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Linear
from mrdamper.report.cards.comparison_page import PAGE
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system

NASTY = "<script>alert('x')</script>"
ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.2, 0.2))
WARM = replace(ENVELOPE, temperature=(293.15, 393.15))
ERRORS = {"yield_force.c0": 3.0, "yield_force.c1": 4.0, "viscosity.value": 30.0}


def a_damper(strength: float = 1.0, **changed: ParameterLaw) -> Damper:
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(900.0),
        "yield_force": Polynomial((60.0 * strength, 600.0 * strength)),
        "yield_velocity": Constant(1e-6),
        "offset": Constant(35.0),
        **changed,
    }
    return Damper(LAWS["bingham"], forms, actuation=Actuation(0.01, 0.02))


def a_card(
    damper: Damper, envelope: OperatingEnvelope = ENVELOPE, *, rmse: float = 6.0, title: str = "a"
) -> ModelCard:
    run = {"name": "run", "split": "training", "rmse_N": rmse, "nrmse_percent": 3.0}
    return ModelCard(
        title=title,
        damper=damper,
        envelope=envelope,
        evidence=Evidence(runs=(run,), method="varpro", cost=3.0, dataset_fingerprint="0"),
        standard_errors={name: error for name, error in ERRORS.items() if name in damper.parameters},
    )


def warm_damper(slope: float = 1e-3) -> Damper:
    return a_damper(yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(slope)))


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


# ------------------------------------------------------------------------------------------- page, command


@pytest.fixture(scope="module")
def page():
    assumed = a_damper(
        yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(1e-3), assumed=True)
    )
    cards = a_card(warm_damper(), WARM, title=NASTY), a_card(assumed, WARM)
    return PAGE.render(compare_cards(*cards, names=(NASTY, "b")))


def test_the_page_loads_nothing_and_no_name_becomes_markup(page):
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert re.findall(r"url\((?!#)", page) == []
    assert re.findall(r'(?:src|href)="(?!#)', page) == []


def test_assumed_factors_are_marked_on_the_page(page):
    assert "the temperature factor of yield_force is assumed" in page
    assert page.count('<span class="assumed">assumed</span>') >= 3


def test_the_command_prints_one_json_object_and_writes_both_files(tmp_path):
    write_card(a_card(a_damper()), tmp_path / "new.json")
    write_card(a_card(a_damper(0.9)), tmp_path / "worn.json")
    cards = (tmp_path / "new.json", tmp_path / "worn.json")
    answer = answer_of(mrdamper("compare", *cards, "--out", tmp_path / "out", "--json"))
    assert json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8")) == answer
    assert (tmp_path / "out" / "compare.html").is_file()
    assert answer["verdict"].startswith("worn is weaker than new everywhere")
    assert answer["largest"]["difference_N"] == pytest.approx(-126.0, rel=1e-9)
    row = answer["forces"][0]
    expected = {"velocity_m_s", "command", "command_unit", "temperature_degC", "first_N", "second_N"}
    assert expected | {"difference_N", "difference_percent"} <= row.keys()
    up, down = answer["response"]["first"]
    assert up["command_t63_s"] == pytest.approx(-0.01 * math.log(0.37), rel=2e-3)
    assert down["force_t90_s"] == pytest.approx(0.02 * math.log(10.0), rel=5e-3)
    assert answer["gas"]["second"][0]["offset_N"] == pytest.approx(35.0, abs=1e-6)


def test_the_command_says_what_cannot_be_compared_and_leaves_nothing(tmp_path):
    write_card(a_card(a_damper()), tmp_path / "amperes.json")
    write_card(a_card(replace(a_damper(), command_unit="V")), tmp_path / "volts.json")
    run = mrdamper("compare", tmp_path / "amperes.json", tmp_path / "volts.json", "--out", tmp_path / "out")
    assert run.returncode == 3
    assert run.stderr.startswith("mrdamper: amperes is commanded in A and volts in V; expected the same unit")
    assert not (tmp_path / "out").exists()


def test_cards_called_card_go_by_their_folder(tmp_path):
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
        write_card(a_card(a_damper()), tmp_path / folder / "card.json")
    paths = [tmp_path / folder / "card.json" for folder in ("before", "after")]
    found = mrdamper_package.compare(*paths)
    assert [card.file for card in found.cards] == [*map(str, paths)]
    assert found.verdict == "after and before give the same force everywhere."
