"""Geometry files are written in mm and degC and read in SI units. Impossible dampers are rejected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mrdamper.errors import InputError
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.schema import fields_of
from mrdamper.thermal.drawing import filling_of
from mrdamper.thermal.drawing_file import DrawingTables, drawing_of, read_drawing, read_sink, text_of
from mrdamper.thermal.model.section import section_of

EXAMPLE = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
TEXT = EXAMPLE.read_text(encoding="utf-8")
PAGE = (EXAMPLE.parents[1] / "docs" / "thermal.md").read_text(encoding="utf-8")


def changed(*pairs: tuple[str, str]) -> str:
    text = TEXT
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def test_values_of_geometry_file_are_in_si():
    drawing = read_drawing(EXAMPLE)
    assert drawing.body.outer_diameter == pytest.approx(0.046)
    assert drawing.body.bore == pytest.approx(0.036)
    assert drawing.gap == pytest.approx(0.001)
    assert drawing.surroundings.ambient == pytest.approx(293.15)
    assert drawing.filling.valid_K[1] == pytest.approx(403.15)
    assert drawing.coil.resistance == pytest.approx(4.2)
    # The parts (two caps, two chambers, the piston) fill the length of the body.
    inside = 2.0 * (drawing.body.cap + drawing.chamber_length) + drawing.piston.length
    assert inside == pytest.approx(drawing.body.length)


def test_paper_geometry_preset_equals_example():
    assert text_of("paper") == TEXT


def test_example_geometry_has_sink_of_reference_paper():
    sink = read_sink(EXAMPLE)
    assert (sink.fins, sink.width, sink.pitch) == pytest.approx((5, 0.023, 0.020))
    assert sink.gap == pytest.approx(0.017)
    assert sink.span == pytest.approx(0.083)
    # Five discs, 92 mm outside and 46 mm inside, 3 mm thick
    assert sink.mass(0.046) == pytest.approx(0.202, abs=0.001)
    centres = sink.centres(0.2)
    assert centres.mean() == pytest.approx(0.1)
    assert centres[1] - centres[0] == pytest.approx(0.020)


def test_missing_fluid_conductivity_follows_maxwell():
    fluid = replace(find_fluid("paper"))
    assert fluid.conductivity_W_m_K is None
    share = fluid.particle_fraction
    assert filling_of(fluid).conductivity == pytest.approx(0.14 * (1 + 2 * share) / (1 - share))


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        (
            [("outer_diameter_mm = 46", "outer_diameter_mm = 23")],
            r"piston.diameter_mm is 34, the bore 13 .* Is 23 mm the body's radius\? .* is 46",
        ),
        ([("length_mm = 70", "length_mm = 190")], r"piston.length_mm is 190, between the caps there are 190"),
        (
            [("length_mm = 20\n", "length_mm = 20\ndepth_mm = 12\n")],
            r"coil.depth_mm is 12; expected less than 10",
        ),
        ([("fins = 5", "fins = 12")], r"12 fins at pitch_mm 20 span 223 mm, the body's length_mm is 200"),
        ([("air_m_s = 0", "air_km_h = 30")], r"no key 'air_km_h'; did you mean air_m_s\?.*km/h"),
        ([("wall_mm", "wal_mm")], r"body has no key 'wal_mm'; did you mean wall_mm"),
        ([('"steel"', '"stele"')], r"body.material: there is no material 'stele'"),
        (
            [('"horizontal"', '"vertical"'), ("pitch_mm = 20", "pitch_mm = 8")],
            "5 mm apart; expected at least 10",
        ),
    ],
)
def test_impossible_geometry_gives_one_message(pairs, said):
    with pytest.raises(InputError, match=said) as caught:
        drawing_of(changed(*pairs), "drawing.toml")
    lines = str(caught.value).splitlines()
    assert all(line.startswith("drawing.toml: ") for line in lines)
    misspelt = any(new in {"wal_mm", "[coyl]"} for _, new in pairs)
    # A misspelt key gives two messages: an unknown and a missing name.
    assert len(lines) == (2 if misspelt else 1)


def test_every_geometry_key_is_documented():
    keys = [each.key for table in fields_of(DrawingTables) for each in fields_of(table.type)]
    assert len(keys) > 40
    assert [key for key in keys if f"`{key}`" not in PAGE] == []


@pytest.mark.parametrize("through", [True, False])
def test_damper_heat_capacity_covers_all_parts(through: bool):
    """The stated capacity 800 + 5 T J/K has the mean 1200 J/K. Calibration multiplies the mean by 1.1."""
    rows = "\n[heat_capacity]\nrange_degC = [20, 140]\ndamper_J_K = [800, 5]\n"
    ends = ("[rod]\n", f"[rod]\nthrough = {str(through).lower()}\n")
    text = changed(ends, ("length_mm = 20\n", "length_mm = 35\n"))
    drawing = drawing_of(text + rows).with_sink(None)
    assert drawing.rod.through == through
    own = replace(drawing, calibration=replace(drawing.calibration, heat_capacity=1.1))
    assert section_of(own).heat_capacity == pytest.approx(1.1 * 1200.0, rel=1e-9)
