"""Two cards compared by the command: the page, the JSON, and what is refused."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

import mrdamper as mrdamper_package
from mrdamper.models.card_schema import write_card
from mrdamper.models.comparison import compare_cards
from mrdamper.models.dependence import Polynomial, TemperatureDependent
from mrdamper.models.temperature import Linear
from mrdamper.report.cards.comparison_page import PAGE
from tests.models.two_cards import WARM, a_card, a_damper, warm_damper
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system

NASTY = "<script>alert('x')</script>"


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
