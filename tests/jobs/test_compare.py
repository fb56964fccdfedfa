"""The command ``compare`` writes a page and JSON. It rejects cards whose commands have different units."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest

import mrdamper as mrdamper_package
from mrdamper.models.card_schema import write_card
from mrdamper.models.comparison import compare_cards
from mrdamper.report.compare import REPORT
from tests.models.test_comparison import WARM, a_card, a_damper, warm_damper
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system

NASTY = "<script>alert('x')</script>"


def test_comparison_page_escapes_card_names():
    cards = a_card(warm_damper(), WARM), a_card(warm_damper(assumed=True), WARM)
    assert REPORT.page is not None
    page = REPORT.page.render(compare_cards(*cards, names=(NASTY, "b")))
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert re.findall(r'(?:src|href)="(?!#)', page) == []
    assert "the temperature factor of yield_force is assumed" in page.lower()


def test_compare_prints_and_writes_same_result(tmp_path):
    write_card(a_card(a_damper()), tmp_path / "new.json")
    write_card(a_card(a_damper(0.9)), tmp_path / "worn.json")
    cards = (tmp_path / "new.json", tmp_path / "worn.json")
    answer = answer_of(mrdamper("compare", *cards, "--out", tmp_path / "out", "--json"))
    assert json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8")) == answer
    assert (tmp_path / "out" / "compare.html").is_file()
    assert answer["verdict"].startswith("worn is weaker than new everywhere")
    assert answer["largest"]["difference_N"] == pytest.approx(-126.0, rel=1e-9)
    up, down, *_ = answer["response"]
    assert up["card"] == "new"
    assert up["command_t63"] == pytest.approx(-0.01 * math.log(0.37), rel=2e-3)
    assert down["force_t90"] == pytest.approx(0.02 * math.log(10.0), rel=5e-3)
    assert answer["energy"][0]["second_gas_N"] == pytest.approx(35.0, abs=1e-6)


def test_compare_rejects_cards_with_different_units(tmp_path):
    write_card(a_card(a_damper()), tmp_path / "amperes.json")
    write_card(a_card(replace(a_damper(), command_unit="V")), tmp_path / "volts.json")
    run = mrdamper("compare", tmp_path / "amperes.json", tmp_path / "volts.json", "--out", tmp_path / "out")
    assert run.returncode == 3
    assert run.stderr.startswith("mrdamper: the command of amperes is in A and that of volts in V")
    assert not (tmp_path / "out").exists()


def test_cards_with_equal_names_are_distinguished_by_folder(tmp_path):
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
        write_card(a_card(a_damper()), tmp_path / folder / "card.json")
    paths = [tmp_path / folder / "card.json" for folder in ("before", "after")]
    found = mrdamper_package.compare(*paths)
    assert [card.file for card in found.cards] == [*map(str, paths)]
    assert found.verdict == "after and before give the same force everywhere."
