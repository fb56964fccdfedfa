"""``mrdamper cite``: what a card rests on, and nothing that it does not."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import mrdamper
from mrdamper.cli import cli
from mrdamper.errors import InputError
from mrdamper.jobs.cite import LAW_SOURCES, METHOD_SOURCES
from mrdamper.jobs.cite import cite as cite_card
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.dependence import TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.notes import Note
from mrdamper.registry import JOBS
from mrdamper.schema import Json
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset
from tests.support.tracked import a_damper


def cite(card: Path) -> Json:
    """Return the answer of the job."""
    return JOBS["cite"].perform({"card": card})[1]


DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def card() -> ModelCard:
    tests = Campaign(motions=("sine5mm1Hz",), currents_A=(0.0, 2.0), temperatures_degC=(20.0,), steps=None)
    runs = [run for run, _ in measure(find_preset("nominal"), tests)]
    found: ModelCard = mrdamper.fit(runs, "bouc-wen", temperature="none").card(sources=["my_run.csv"])
    return found


def cited(card: ModelCard, folder: Path) -> dict[str, dict[str, object]]:
    write_card(card, folder / "card.json")
    return {each["key"]: each for each in cite(folder / "card.json")["citations"]}


def test_law_method_and_program_are_cited(card, tmp_path):
    found = cited(card, tmp_path)
    assert list(found) == ["mrdamper", "bouc1967", "wen1976", "golub1973", "kaufman1975"]
    assert found["wen1976"]["for"] == "law bouc-wen"
    assert found["golub1973"]["for"] == "method varpro"


def test_public_data_are_cited_with_commit_and_doi(card, tmp_path):
    found = cited(replace(card, sources=("ensaio.A.1.mat",)), tmp_path)
    assert found["utfpr"]["for"] == "data"
    assert "doi = {10.5281/zenodo.4445334}" in str(found["utfpr"]["bibtex"])
    assert "e42439f08b22" in str(found["utfpr"]["text"])


def test_own_data_are_named_and_not_given_an_author(card, tmp_path):
    write_card(card, tmp_path / "card.json")
    assert cite(tmp_path / "card.json")["notes"] == ["data, as the card names it: my_run.csv"]


def test_what_no_list_of_works_can_say_is_said(card, tmp_path):
    own = replace(card, sources=tuple(f"{k}.csv" for k in "abcd"))
    ours = replace(own, damper=a_damper(), standard_errors={}, excerpt=None)
    search = replace(card.evidence, method="genetic")
    found = cited(replace(card, evidence=search), tmp_path)
    assert found["pymoo"]["for"] == "method genetic"
    write_card(own, tmp_path / "card.json")
    notes = cite(tmp_path / "card.json")["notes"]
    assert notes[-1] == "data, as the card names it: a.csv, b.csv, c.csv, ..."
    write_card(ours, tmp_path / "card.json")
    notes = cite(tmp_path / "card.json")["notes"]
    assert notes[0].startswith("double-bouc-wen: two elements on one curve")


def test_every_law_and_method_has_an_entry_and_every_work_is_in_the_docs():
    assert LAW_SOURCES.keys() == LAWS.keys()
    laws = (DOCS / "laws.md").read_text(encoding="utf-8")
    decisions = "".join(path.read_text(encoding="utf-8") for path in (DOCS / "decisions").glob("*.md"))
    for sources in (*LAW_SOURCES.values(), *METHOD_SOURCES.values()):
        for source in sources:
            family = source.authors[0].partition(",")[0]
            assert family in laws + decisions


@pytest.mark.parametrize("key", ["bouc-wen", "spencer", "lugre", "tanh", "bingham", "dahl"])
def test_bibtex_is_one_balanced_entry_with_author_and_title(key):
    for source in LAW_SOURCES[key]:
        entry = source.bibtex()
        assert re.match(r"@(article|misc)\{\w+,\n", entry)
        assert entry.count("{") == entry.count("}")
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = ", entry, re.MULTILINE))


def test_the_command_prints_both_and_json_holds_the_same(card, tmp_path):
    write_card(card, tmp_path / "card.json")
    printed = CliRunner().invoke(cli, ["cite", str(tmp_path / "card.json")]).output
    answer = json.loads(CliRunner().invoke(cli, ["cite", str(tmp_path / "card.json"), "--json"]).output)
    for each in answer["citations"]:
        assert each["text"] in printed
        assert each["bibtex"] in printed


def test_what_is_no_card_is_refused(tmp_path):
    (tmp_path / "card.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"card\.json"):
        cite(tmp_path / "card.json")


def test_assumed_temperature_laws_and_a_law_of_ones_own_are_told(card):
    damper = a_damper()
    name = next(name for name, law in damper.coefficients.items() if isinstance(law, TemperatureDependent))
    law = damper.coefficients[name]
    assert isinstance(law, TemperatureDependent)
    assumed = replace(damper, coefficients={**damper.coefficients, name: replace(law, assumed=True)})
    found = cite_card(replace(card, damper=assumed, standard_errors={}, excerpt=None, sources=()))
    said = {note.kind: str(note) for note in found.notes if isinstance(note, Note)}
    assert said["assumed"].startswith(f"temperature laws of {name} are assumed from a fluid")
    assert "data" not in said
