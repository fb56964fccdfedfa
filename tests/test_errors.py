"""Errors store the parts of their message (location, value, expectation, remedy) separately."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError, MrdamperError

TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\n"), max_size=60)
PARTS = ("place", "found", "expected", "remedy")


def test_error_message_joins_its_parts() -> None:
    fault = InputError(
        place=Path("runs/a.csv"), found="time goes back in row 7", expected="rising times", remedy="Sort it"
    )
    assert str(fault) == "runs/a.csv: time goes back in row 7; expected rising times. Sort it"
    assert fault.place == "runs/a.csv"


def test_combined_error_keeps_all_faults() -> None:
    faults = [InputError("no rows", place=f"{k}.csv", remedy="record again") for k in range(14)]
    many = InputError(faults=faults).prepend_place("campaign")
    lines = str(many).split("\n")
    assert lines[0] == "campaign: 0.csv: no rows; record again"
    assert lines[-1] == "... and 6 more like these"
    second = {"place": "campaign: 1.csv", "found": "no rows", "remedy": "record again"}
    assert many.faults[1].parts() == second
    assert str(pickle.loads(pickle.dumps(many))) == str(many)


def test_error_location_is_added_once() -> None:
    fault = InputError("is missing", place="force").prepend_place("a.csv").prepend_place("a.csv")
    assert str(fault) == "a.csv: force: is missing"


@given(st.fixed_dictionaries(dict.fromkeys(PARTS, TEXTS)))
def test_pickled_error_keeps_its_parts(parts: dict[str, Any]) -> None:
    fault = MrdamperError(**parts)
    mark = "; " if parts["remedy"][:1].islower() else ". "
    said = (f"{parts['place']}: " if parts["place"] else "") + parts["found"]
    said += (f"; expected {parts['expected']}" if parts["expected"] else "") + (
        f"{mark}{parts['remedy']}" if parts["remedy"] else ""
    )
    told = {name: text for name, text in parts.items() if text}
    assert (str(fault), fault.parts()) == (said, told)
    assert pickle.loads(pickle.dumps(fault)).parts() == told
