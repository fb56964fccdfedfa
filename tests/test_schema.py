"""Records: what is written is read again, and what is wrong is said with place, found, expected."""

from __future__ import annotations

import math
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.schema import (
    Option,
    check_ranges,
    did_you_mean,
    fields_of,
    json_schema,
    read_record,
    toml_text,
    write_record,
)


@dataclass(frozen=True, kw_only=True)
class Part:
    length: Annotated[float, Option("its length", key="length_mm", unit="mm", above=0.0, most=1e4)]
    ambient: Annotated[
        float, Option("air around it", key="ambient_degC", unit="degC", least=-60, most=150)
    ] = 293.15
    share: Annotated[float | None, Option("of the whole", least=0.0, most=1.0)] = None
    way: Literal["horizontal", "vertical"] = "horizontal"
    names: Annotated[tuple[str, ...], Option("its names", most_items=3)] = ()


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
def test_what_is_written_is_read_again(whole):
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


def test_a_file_speaks_in_its_unit_and_the_record_in_si():
    whole = read_record(Whole, {"part": {"length_mm": 60, "ambient_degC": 25}}, "a file")
    assert (whole.part.length, whole.part.ambient) == (0.06, 298.15)
    assert write_record(whole) == {"part": {"length_mm": 60.0, "ambient_degC": 25.0}}


def test_a_default_is_in_si_already():
    assert read_record(Part, {"length_mm": 1.0}, "a file").ambient == 293.15


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({}, ["x: part is missing; expected a table"]),
        ({"part": 3}, ["x: part is 3; expected a table"]),
        ({"part": {"length_mm": "6"}}, ["x: part.length_mm is '6'; expected a number in mm, above 0"]),
        ({"part": {"length_mm": True}}, ["x: part.length_mm is True; expected a number in mm"]),
        ({"part": {"length_mm": math.nan}}, ["x: part.length_mm is nan; expected a number in mm"]),
        ({"part": {"length_mm": math.inf}}, ["x: part.length_mm is inf; expected a number in mm"]),
        ({"part": {"length_mm": 1, "lenght_mm": 2}}, ["x: part has no key 'lenght_mm'; did you"]),
        ({"part": {"length_mm": 1}, "count": 2.5}, ["x: count is 2.5; expected a whole number, at least 1"]),
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
        ({"part": {"length_mm": 1}, "more": [{"length_mm": -1}]}, ["x: more.0.length_mm is -1; expected"]),
        (
            {"part": {"length_mm": 1}, "count": 1, "more": [{"length_mm": 1}, {"length_mm": 2}]},
            ["x: more has 2 parts; expected at most count, 1"],
        ),
    ],
)  # fmt: skip
def test_every_fault_is_told_with_place_found_and_expected(document, said):
    with pytest.raises(InputError) as caught:
        read_record(Whole, document, "x")
    lines = str(caught.value).splitlines()
    assert len(lines) == len(said)
    for line, start in zip(lines, said, strict=True):
        assert line.startswith(start)


def test_the_json_schema_has_units_ranges_and_defaults_as_the_file_has_them():
    schema = json_schema(Whole)
    part = schema["$defs"]["Part"]["properties"]
    assert part["length_mm"]["description"] == "its length [mm]"
    assert part["length_mm"]["exclusiveMinimum"] == 0.0
    assert part["ambient_degC"]["default"] == 20.0
    assert schema["required"] == ["part"]
    assert schema["additionalProperties"] is False


@pytest.mark.system
def test_fields_are_known_without_loading_what_checks_them():
    """A command's help is made from its options' fields: it must answer at once."""
    program = (
        "import sys\nfrom dataclasses import dataclass\nfrom typing import Annotated\n"
        "from mrdamper.schema import Option, check_ranges, fields_of\n"
        "@dataclass\nclass Heat:\n    degrees: Annotated[float, Option('warm', unit='degC')] = 20.0\n"
        "assert fields_of(Heat)[0].words == 'a number in degC'\n"
        "print(sorted({'numpy', 'pydantic', 'annotated_types'} & sys.modules.keys()))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
    assert {field.name for field in fields_of(Part)} == {"length", "ambient", "share", "way", "names"}


def test_a_record_made_in_python_is_checked_as_one_of_a_file():
    check_ranges(Part(length=0.06), "a part")
    with pytest.raises(InputError) as caught:
        check_ranges(Part(length=math.nan, ambient=20.0, share=2.0, way="upward"), "a part")  # type: ignore[arg-type]
    assert str(caught.value).splitlines() == [
        "a part.length_mm is nan; expected a number in mm, above 0 and at most 10000",
        "a part.ambient_degC is -253.15; expected a number in degC, -60 to 150",
        "a part.share is 2.0; expected a number, 0 to 1",
        "a part.way is 'upward'; expected one of: horizontal, vertical",
    ]


def test_an_unknown_name_is_told_by_its_nearest_in_any_case_or_by_the_first_of_many():
    assert did_you_mean("FORCE_n", ["time_s", "force_N"]) == "did you mean force_N?"
    many = did_you_mean("zzz", [f"run_{k}" for k in range(100)])
    assert many.startswith("expected one of: run_0, run_1, ")
    assert many.endswith(" and 60 more")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    value: Annotated[float, Option(above=0.0)]
    source: str = "no source given"


def _bare(value: object) -> object:
    return {"value": value} if isinstance(value, int | float) and not isinstance(value, bool) else value


@dataclass(frozen=True, kw_only=True)
class Sourced:
    mass: Annotated[Quantity | None, Option(short=_bare, expected="a number or a table")]
    parts: tuple[Part, ...] = ()


def test_a_bare_number_stands_for_the_table_that_holds_it():
    assert read_record(Sourced, {"mass": 3}, "x").mass == Quantity(value=3.0)
    assert read_record(Sourced, {"mass": {"value": 3, "source": "a scale"}}, "x").mass == Quantity(
        value=3.0, source="a scale"
    )
    for given_mass, said in (
        ("3", "x: mass is '3'; expected a number or a table"),
        (0, "x: mass.value is 0; expected a number, above 0"),
        ({"source": "a scale"}, "x: mass.value is missing; expected a number, above 0"),
    ):
        with pytest.raises(InputError, match=f"^{said}$"):
            read_record(Sourced, {"mass": given_mass}, "x")


@given(st.floats(allow_nan=False, allow_infinity=False), st.text())
def test_numbers_and_texts_are_read_from_toml_as_they_were_written(number, text):
    assert tomllib.loads(toml_text({"number": number, "text": text})) == {"number": number, "text": text}
