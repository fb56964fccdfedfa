"""Records are written and read again, and error messages state location, value and expectation."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.files import toml_text
from mrdamper.schema import (
    Option,
    read_record,
    write_record,
)


@dataclass(frozen=True, kw_only=True)
class Part:
    length: Annotated[float, Option(key="length_mm", unit="mm", above=0.0, most=1e4)]
    """Length of the part."""
    ambient: Annotated[float, Option(key="ambient_degC", unit="degC", least=-60, most=150)] = 293.15
    share: Annotated[float | None, Option(least=0.0, most=1.0)] = None
    way: Literal["horizontal", "vertical"] = "horizontal"
    names: Annotated[tuple[str, ...], Option(most_items=3)] = ()


@dataclass(frozen=True, kw_only=True)
class Whole:
    part: Part
    count: Annotated[int, Option(least=1)] = 3
    more: tuple[Part, ...] = ()

    def __post_init__(self) -> None:
        if len(self.more) > self.count:
            raise InputError(f"more has {len(self.more)} parts; expected at most count, {self.count}")


parts = st.builds(
    Part,
    length=st.floats(1e-6, 10.0),
    ambient=st.floats(213.2, 423.1),
    share=st.none() | st.floats(0.0, 1.0),
    way=st.sampled_from(["horizontal", "vertical"]),
    names=st.lists(st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"])), max_size=3).map(
        tuple
    ),
)


@given(st.builds(Whole, part=parts, count=st.integers(2, 99), more=st.lists(parts, max_size=2).map(tuple)))
def test_written_record_is_read_unchanged(whole):
    again = read_record(Whole, tomllib.loads(toml_text(write_record(whole))), "a file")
    assert (again.count, again.part.names, len(again.more)) == (
        whole.count,
        whole.part.names,
        len(whole.more),
    )
    for one, other in zip((again.part, *again.more), (whole.part, *whole.more), strict=True):
        assert one.length == pytest.approx(other.length, rel=1e-11)
        assert one.ambient == pytest.approx(other.ambient, abs=1e-8)
        assert (one.share is None) == (other.share is None)


def test_values_of_record_are_in_si():
    whole = read_record(Whole, {"part": {"length_mm": 60, "ambient_degC": 25}}, "a file")
    assert (whole.part.length, whole.part.ambient) == (0.06, 298.15)
    assert write_record(whole) == {"part": {"length_mm": 60.0, "ambient_degC": 25.0}}


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"part": {"length_mm": "6"}}, ["x: part.length_mm is '6'; expected a number in mm, above 0"]),
        ({"part": {"length_mm": math.nan}}, ["x: part.length_mm is nan; expected a number in mm"]),
        ({"part": {"length_mm": 1, "lenght_mm": 2}}, ["x: part has no key 'lenght_mm'; did you"]),
        (
            {"part": {"length_mm": 0, "ambient_degC": 400, "way": "up"}, "zzz": 1},
            [
                "x: part.length_mm is 0; expected a number in mm",
                "x: part.ambient_degC is 400; expected a number in degC, -60 to 150",
                "x: part.way is 'up'; expected one of: horizontal, vertical",
                "x: unknown key 'zzz'; expected one of: part, count, more",
            ],
        ),
        ({"part": {"length_mm": 1, "names": ["a"] * 4}}, ["x: part.names is"]),
        (
            {"part": {"length_mm": 1}, "count": 1, "more": [{"length_mm": 1}, {"length_mm": 2}]},
            ["x: more has 2 parts; expected at most count, 1"],
        ),
    ],
)  # fmt: skip
def test_record_error_states_location_and_expectation(document, said):
    with pytest.raises(InputError) as caught:
        read_record(Whole, document, "x")
    lines = str(caught.value).splitlines()
    assert len(lines) == len(said)
    for line, start in zip(lines, said, strict=True):
        assert line.startswith(start)


@given(st.floats(allow_nan=False, allow_infinity=False), st.text())
def test_toml_values_are_read_unchanged(number, text):
    assert tomllib.loads(toml_text({"number": number, "text": text})) == {"number": number, "text": text}
