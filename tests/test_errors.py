"""Errors as data: the parts make the message."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError, MrdamperError

TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\n"), max_size=60)
PARTS = ("place", "found", "expected", "remedy")


def test_the_parts_make_the_message() -> None:
    fault = InputError(
        place=Path("runs/a.csv"), found="time goes back in row 7", expected="rising times", remedy="Sort it"
    )
    assert str(fault) == "runs/a.csv: time goes back in row 7; expected rising times. Sort it"
    assert fault.place == "runs/a.csv"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"found": "no rows"}, "no rows"),
        ({"place": "a.csv", "found": "no rows"}, "a.csv: no rows"),
        ({"found": "no rows", "expected": "some"}, "no rows; expected some"),
        ({"place": "a.csv", "found": "no rows", "remedy": "Record again"}, "a.csv: no rows. Record again"),
        ({"found": "no rows", "remedy": "record again"}, "no rows; record again"),
    ],
)
def test_a_part_that_is_not_given_leaves_no_mark(given: dict[str, Any], said: str) -> None:
    assert str(InputError(**given)) == said
    assert InputError(**given).parts() == given


def test_a_sentence_is_what_was_found() -> None:
    assert InputError("no rows").to_json() == {"kind": "InputError", "message": "no rows", "found": "no rows"}


def test_a_moved_error_keeps_its_other_parts() -> None:
    fault = InputError(place="curve", found="no rows", expected="some", remedy="Record again")
    fault.move_to("curve.csv")
    assert str(fault) == "curve.csv: no rows; expected some. Record again"
    assert fault.parts()["place"] == "curve.csv"


def test_many_faults_are_one_error_that_still_holds_the_parts_of_each() -> None:
    faults = [InputError("no rows", place=f"{k}.csv", remedy="record again") for k in range(14)]
    many = InputError(faults=faults).within("campaign")
    lines = str(many).split("\n")
    assert lines[0] == "campaign: 0.csv: no rows; record again"
    assert lines[-1] == "... and 6 more like these"
    second = {"place": "campaign: 1.csv", "found": "no rows", "remedy": "record again"}
    assert many.to_json()["faults"][1] == second
    assert pickle.loads(pickle.dumps(many)).to_json() == many.to_json()


def test_a_file_is_called_by_its_other_name_wherever_it_stands() -> None:
    fault = InputError("/tmp/a.csv has no rows", place="/tmp/a.csv").renamed("/tmp/a.csv", "a.csv")
    assert str(fault) == "a.csv: a.csv has no rows"


def test_a_part_of_any_size_is_cut() -> None:
    fault = InputError(place="a.csv", found="x" * 100_000 + "\n" * 5000)
    assert all(len(text) < 10_000 for text in fault.to_json().values())


@given(st.fixed_dictionaries(dict.fromkeys(PARTS, TEXTS)))
def test_any_parts_make_a_message_and_come_back(parts: dict[str, Any]) -> None:
    fault = MrdamperError(**parts)
    mark = "; " if parts["remedy"][:1].islower() else ". "
    said = (f"{parts['place']}: " if parts["place"] else "") + parts["found"]
    said += (f"; expected {parts['expected']}" if parts["expected"] else "") + (
        f"{mark}{parts['remedy']}" if parts["remedy"] else ""
    )
    told = {name: text for name, text in parts.items() if text}
    assert fault.to_json() == {"kind": "MrdamperError", "message": said, **told}
    assert pickle.loads(pickle.dumps(fault)).to_json() == fault.to_json()
