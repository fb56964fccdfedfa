"""Drawings: millimetres and degC at the door, SI inside, and what no damper can be."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mrdamper.errors import InputError
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.schema import fields_of
from mrdamper.thermal.drawing import DamperDrawing, Filling, filling_of
from mrdamper.thermal.drawing_file import DrawingTables, drawing_of, read_drawing, read_sink, text_of
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.limits import limits_of
from mrdamper.thermal.materials import INSULATION_DEGC, MATERIALS, SEALS_DEGC, Material, find_material
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


def test_the_example_is_read_into_metres_and_kelvin():
    drawing = read_drawing(EXAMPLE)
    assert drawing.body.outer_diameter == pytest.approx(0.046)
    assert drawing.body.bore == pytest.approx(0.036)
    assert drawing.gap == pytest.approx(0.001)
    assert drawing.surroundings.ambient == pytest.approx(293.15)
    assert drawing.filling.valid_K[1] == pytest.approx(403.15)
    assert drawing.coil.resistance_at(293.15) == pytest.approx(4.2)
    # the parts fill the body's length: two caps, two chambers, the piston
    inside = 2.0 * (drawing.body.cap + drawing.chamber_length) + drawing.piston.length
    assert inside == pytest.approx(drawing.body.length)


def test_the_preset_and_the_example_are_the_same_text():
    assert text_of("paper") == TEXT


def test_the_example_s_sink_is_the_paper_s():
    sink = read_sink(EXAMPLE)
    assert (sink.fins, sink.width, sink.pitch) == pytest.approx((5, 0.023, 0.020))
    assert sink.gap == pytest.approx(0.017)
    assert sink.span == pytest.approx(0.083)
    assert sink.mass(0.046) == pytest.approx(0.202, abs=0.001)  # five discs of 92 mm less 46 mm, 3 mm thick
    centres = sink.centres(0.2)
    assert centres.mean() == pytest.approx(0.1)
    assert centres[1] - centres[0] == pytest.approx(0.020)


def test_the_corrected_radius_gives_two_faces_the_area_of_faces_and_tip():
    sink = HeatSink(fins=5, width=0.023, thickness=1e-3, pitch=0.02)
    tip = sink.tip_radius(0.046)
    exact = 2.0 * math.pi * (tip**2 - 0.023**2) + 2.0 * math.pi * tip * sink.thickness
    assert sink.fin_area(0.046) == pytest.approx(exact, rel=1e-3)


def test_a_drawing_without_fins_has_no_sink():
    assert drawing_of(changed(("fins = 5", "fins = 0"))).sink is None
    assert drawing_of(TEXT[: TEXT.index("[sink]")]).sink is None
    assert read_drawing(EXAMPLE).with_sink(None).sink is None


def test_a_fluid_s_properties_may_be_given_beside_its_preset():
    drawing = drawing_of(changed(('preset = "paper"', 'preset = "paper"\nconductivity_W_m_K = 1')))
    assert drawing.filling.conductivity == 1.0
    assert drawing.filling.density == find_fluid("paper").density_kg_m3


def test_a_fluid_without_conductivity_is_maxwell_s_mixture():
    fluid = replace(find_fluid("paper"))
    assert fluid.conductivity_W_m_K is None
    share = fluid.particle_fraction
    assert filling_of(fluid).conductivity == pytest.approx(0.14 * (1 + 2 * share) / (1 - share))


def test_every_material_has_a_source():
    assert all(material.source for material in MATERIALS.values())
    with pytest.raises(InputError, match=r"no material is called 'steal'.*steel"):
        find_material("steal")


@pytest.mark.parametrize(
    ("pairs", "said"),
    [
        (
            [("outer_diameter_mm = 46", "outer_diameter_mm = 23")],
            r"piston.diameter_mm is 34, the bore 13 .* Is 23 mm the body's radius\? .* is 46",
        ),
        (
            [("wall_mm = 5", "wall_mm = 23")],
            r"body.wall_mm is 23, the outer radius 23; .* is it the diameter",
        ),
        ([("diameter_mm = 34", "diameter_mm = 36")], r"piston.diameter_mm is 36, the bore 36"),
        ([("diameter_mm = 14", "diameter_mm = 34")], r"rod.diameter_mm is 34, the piston's 34"),
        ([("length_mm = 70", "length_mm = 190")], r"piston.length_mm is 190, between the caps there are 190"),
        ([("length_mm = 20\n", "length_mm = 80\n")], r"coil.length_mm is 80, the piston's 70"),
        (
            [("length_mm = 20\n", "length_mm = 20\ndepth_mm = 12\n")],
            r"coil.depth_mm is 12; expected less than 10",
        ),
        ([("fins = 5", "fins = 12")], r"12 fins at pitch_mm 20 span 223 mm, the body's length_mm is 200"),
        ([("thickness_mm = 3", "thickness_mm = 20")], r"fins overlap: thickness_mm is 20 and pitch_mm 20"),
        (
            [("ambient_degC = 20", "ambient_degC = 293")],
            r"ambient_degC is 293; expected a number in degC, -50",
        ),
        (
            [
                ("length_mm = 20\n", 'length_mm = 20\ninsulation_class = "Y"\n'),
                ("ambient_degC = 20", "ambient_degC = 90"),
            ],
            r"the coil's limit is 90 degC, ambient 90 degC; expected a limit above ambient.*Check coil",
        ),
        ([("air_m_s = 0", "air_km_h = 30")], r"no key 'air_km_h'; did you mean air_m_s\?.*km/h"),
        ([("air_m_s = 0", 'air_m_s = "30 km/h"')], r"air_m_s is '30 km/h'; expected a number in m/s.*km/h"),
        ([("wall_mm", "wal_mm")], r"body has no key 'wal_mm'; did you mean wall_mm"),
        ([("[coil]", "[coyl]")], r"unknown key 'coyl'; did you mean coil"),
        ([('"steel"', '"stele"')], r"body.material: no material is called 'stele'"),
        (
            [('"horizontal"', '"vertical"')],
            r"sink.correlation is 'annular' on a vertical body; expected .disc.",
        ),
        (
            [('"horizontal"', '"vertical"'), ('"annular"', '"disc"'), ("pitch_mm = 20", "pitch_mm = 8")],
            "5 mm apart; expected at least 10",
        ),
        ([('preset = "paper"', 'preset = "papier"')], r"fluid: fluid 'papier': no file that can be read"),
    ],
)
def test_what_no_damper_can_be_is_one_message_with_place_and_remedy(pairs, said):
    with pytest.raises(InputError, match=said) as caught:
        drawing_of(changed(*pairs), "drawing.toml")
    lines = str(caught.value).splitlines()
    assert all(line.startswith("drawing.toml: ") for line in lines)
    misspelt = any(new in {"wal_mm", "[coyl]"} for _, new in pairs)
    assert len(lines) == (2 if misspelt else 1)  # the unknown name, and the one that is missing


def test_every_key_of_a_drawing_is_described_in_the_docs():
    keys = [each.key for table in fields_of(DrawingTables) for each in fields_of(table.type)]
    assert len(keys) > 40
    assert [key for key in keys if f"`{key}`" not in PAGE] == []


def test_what_may_be_left_out_is_what_the_docs_say_then():
    """The number or the name in brackets behind a key in italics, in the row of its table."""
    seen = 0
    for table in fields_of(DrawingTables):
        (row,) = re.findall(rf"^\| `\[{table.key}\]` \| (.*)\|$", PAGE, re.MULTILINE)
        for key, said in re.findall(r"\*`(\w+)`\* \((-?[\w.-]+)[),:]", row):
            (given,) = (each for each in fields_of(table.type) if each.key == key)
            found = given.option.from_si(given.default) if isinstance(given.default, float) else given.default
            assert (
                str(found).lower() == said.lower() if not said[0].isdigit() else float(found) == float(said)
            ), key
            seen += 1
    assert seen >= 15


ZERO_OR_MORE = (0.0, math.inf)
RANGES = {
    "ambient_degC": (-50.0, 100.0), "air_m_s": (0.0, 50.0), "altitude_m": (-500.0, 9000.0),
    "emissivity": (0.0, 1.0), "fins": (1.0, 10_000.0), "temperature_degC": (-100.0, 500.0),
    **dict.fromkeys(
        ("mount_W_K", "resistance_ohm", "contact_m2K_W", "exchange_W_K", "tolerance_mm", "fouling_mm"),
        ZERO_OR_MORE,
    ),
}  # fmt: skip


def test_every_number_of_a_drawing_has_both_ends_of_its_range():
    """Lengths up to 10 m and what multiplies or conducts are above zero; the others from end to end."""
    numbers = [
        each
        for table in fields_of(DrawingTables)
        if table.key != "heat_capacity"
        for each in fields_of(table.type)
        if each.option.above is not None or each.option.least is not None
    ]
    assert len(numbers) > 35
    for each in numbers:
        low, high = RANGES.get(each.key, (0.0, 10_000.0 if each.option.unit == "mm" else math.inf))
        assert each.option.holds(low) == (each.key in RANGES), each.key
        assert each.option.holds(math.nextafter(low, math.inf)), each.key
        assert not each.option.holds(math.nextafter(low, -math.inf)), each.key
        assert each.option.holds(min(high, 1e9)), each.key
        assert not each.option.holds(math.nextafter(high, math.inf)), each.key


def test_classes_and_seals_bear_what_the_docs_say():
    for row, table in (("coil", INSULATION_DEGC), ("seals", SEALS_DEGC)):
        (said,) = re.findall(rf"^\| {row} \| hottest point .* \| (.*)\|$", PAGE, re.MULTILINE)
        told = {
            name: float(degrees)
            for names, degrees in re.findall(r"((?:[A-Z]+(?: and )?)+) (\d+)", said)
            for name in names.split(" and ")
        }
        assert told == table
    by_part = {each.part: each for each in limits_of(drawing_of(TEXT))}
    assert [by_part[part].celsius for part in ("gap", "coil", "seal")] == pytest.approx([130.0, 155.0, 150.0])


@pytest.mark.parametrize(
    ("name", "conductivity", "density", "heat"),
    [
        ("steel", 48.0, 7.85, 470.0),  # C45
        ("stainless-steel", 15.0, 7.9, 500.0),  # 1.4301 of EN 10088-1
        ("aluminium-alloy", 160.0, 2.70, 900.0),  # EN AW-6082
        ("copper", 390.0, 8.93, 385.0),
    ],
)
def test_metals_are_those_of_their_data_sheets(name: str, conductivity: float, density: float, heat: float):
    """To the printed digits: W/(m K), g/cm^3, J/(kg K)."""
    metal = find_material(name)
    assert (metal.conductivity, metal.density, metal.heat_capacity) == (conductivity, 1e3 * density, heat)
    assert metal.volumetric_heat == pytest.approx(1e3 * density * heat)


def test_a_winding_is_three_fifths_copper_and_the_rest_enamel_and_potting():
    """By volume, of 1.255 g/cm^3 and 1.38 J/(g K), rounded; it conducts as well as the docs say."""
    winding, copper = find_material("winding"), find_material("copper")
    assert winding.density == round(0.6 * copper.density + 0.4 * 1255.0, -1)
    heat = 0.6 * copper.volumetric_heat + 0.4 * 1255.0 * 1380.0
    assert winding.heat_capacity == round(heat / winding.density)
    assert "across the wires, by enamel and potting; 0.6)" in PAGE
    assert winding.conductivity == 0.6


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("which", range(3))
def test_a_material_and_a_fluid_have_positive_numbers(value, which):
    numbers = [1.0, 1.0, 1.0]
    numbers[which] = value
    with pytest.raises(InputError, match=r"material 'oak': \w+ is .*; expected a positive, finite number"):
        Material("oak", numbers[0], numbers[1], numbers[2])
    with pytest.raises(InputError, match=r"fluid 'oil': \w+ is .*; expected a positive number"):
        Filling("oil", numbers[0], numbers[1], numbers[2], (200.0, 400.0))


def test_stirring_and_exchange_may_be_given_and_are_checked():
    drawing = drawing_of(TEXT)
    still = replace(drawing.filling, stirring=3.0, exchange=0.0)
    conducts = replace(drawing, filling=still).fluid_heat
    own = drawing.filling.conductivity
    assert (conducts.gap, conducts.chamber, conducts.exchange) == pytest.approx((3.0 * own, 3.0 * own, 0.0))
    with pytest.raises(InputError, match="stirring is 0"):
        replace(drawing.filling, stirring=0.0)
    with pytest.raises(InputError, match=r"exchange_W_K is -0\.1"):
        replace(drawing.filling, exchange=-0.1)
    with pytest.raises(InputError, match="exchange_W_K is inf; expected zero or more"):
        replace(drawing.filling, exchange=math.inf)


@pytest.mark.parametrize("through", [True, False])
def test_heat_capacity_of_the_damper_holds_for_all_parts(through: bool):
    """800 + 5 T J/K from 20 to 140 degC is 1200 J/K on average, times the calibration's multiplier."""
    rows = "\n[heat_capacity]\nrange_degC = [20, 140]\ndamper_J_K = [800, 5]\n"
    ends = ("[rod]\n", f"[rod]\nthrough = {str(through).lower()}\n")
    text = changed(ends, ("length_mm = 20\n", "length_mm = 35\n"))
    drawing = drawing_of(text + rows).with_sink(None)
    assert drawing.rod.through == through
    own = replace(drawing, calibration=replace(drawing.calibration, heat_capacity=1.1))
    assert section_of(own).heat_capacity == pytest.approx(1.1 * 1200.0, rel=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda it: replace(it, piston=replace(it.piston, diameter=0.0819)),
            "Is 46 mm the body's radius.*92",
        ),
        (
            lambda it: replace(it, piston=replace(it.piston, diameter=0.082)),
            "a piston narrower than the bore$",
        ),
        (lambda it: replace(it, body=replace(it.body, cap=0.1)), "cap_mm is 100, length_mm 200"),
        (lambda it: replace(it, seals=replace(it.seals, limit=290.0)), "the seals's limit is 16.85 degC"),
        (lambda it: replace(it, coil=replace(it.coil, limit=293.15)), "the coil's limit is 20 degC"),
        (
            lambda it: replace(it, filling=replace(it.filling, valid_K=(250.0, 293.0))),
            "the fluid's limit is 19.85 degC",
        ),
    ],
)
def test_what_does_not_fit_is_told_with_its_numbers(
    change: Callable[[DamperDrawing], DamperDrawing], said: str
):
    with pytest.raises(InputError, match=said):
        change(drawing_of(TEXT).with_sink(None))


def test_discs_one_centimetre_apart_are_far_enough_and_a_single_one_always_is():
    upright = replace(
        drawing_of(TEXT).with_sink(None), body=replace(drawing_of(TEXT).body, orientation="vertical")
    )
    disc = HeatSink(fins=2, width=0.02, thickness=2e-3, pitch=0.012, correlation="disc")
    assert upright.with_sink(disc).sink == disc
    assert upright.with_sink(replace(disc, fins=1, pitch=3e-3)).sink is not None
    with pytest.raises(InputError, match=r"are 9\.99 mm apart; expected at least 10"):
        upright.with_sink(replace(disc, pitch=0.01199))


def test_two_fins_overlap_where_their_pitch_is_their_thickness():
    plain = HeatSink(fins=1, width=0.02, thickness=2e-3, pitch=2e-3)  # a single one has no neighbour
    with pytest.raises(InputError, match="the fins overlap: thickness_mm is 2 and pitch_mm 2"):
        replace(plain, fins=2)


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(InputError, match=r"'nowhere.toml': the file cannot be read"):
        read_drawing("nowhere.toml")


def test_what_just_fits_is_a_damper():
    """A coil as long as the piston, fins from end to end, a depth of the coil that stands for its share."""
    long = drawing_of(changed(("length_mm = 20\n", "length_mm = 70\n"), ("fins = 5", "fins = 0")))
    assert long.coil.length == long.piston.length
    assert long.coil.depth == pytest.approx(0.4 * 0.5 * (0.034 - 0.014))
    full = drawing_of(changed(("fins = 5", "fins = 11"), ("pitch_mm = 20", "pitch_mm = 19.7")))
    assert full.sink is not None
    assert full.sink.span == pytest.approx(full.body.length)
