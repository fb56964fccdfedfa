"""``mrdamper heat``: from a card and a drawing to temperatures, or one message."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.app.heat_job import heat, heat_damper, sink_in_words
from mrdamper.errors import InputError
from mrdamper.models.card_reading import read_card
from mrdamper.thermal.drawing import read_drawing, read_sink
from mrdamper.thermal.duty import read_duty
from tests.app.heated import DRAWING, paper_card, plain_card
from tests.app.rigs import answer_of, mrdamper

HALF_HOUR = "sine:15mm:1Hz:2A:1800s"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("heat")
    plain_card(place)
    return place


@pytest.fixture(scope="module")
def shown(folder):
    """Run the command once, for all tests that look at the outcome."""
    return mrdamper("heat", folder / "card.json", "--damper", DRAWING, "--out", folder / "out", "--json")


@pytest.fixture(scope="module")
def answer(shown) -> Any:
    return answer_of(shown)


def changed(folder: Path, old: str, new: str, name: str = "changed.toml") -> Path:
    text = DRAWING.read_text(encoding="utf-8")
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder / name


# ------------------------------------------------------------------------------------- the paper's figures


def test_a_card_identified_on_the_rig_heats_as_the_paper_says():
    """Power and fade come from the card; the bar for the loss at the paper's temperatures is one point."""
    card, drawing = paper_card(), read_drawing(DRAWING)
    run = heat_damper(card, drawing, read_duty("sine:15mm:1Hz:2A:2100s"), past_limit=True)
    assert run.bare is not None
    assert run.bare.fluid_at(1800.0) - 273.15 == pytest.approx(129.9, abs=0.5)
    assert run.bare.fluid_at(2100.0) - 273.15 == pytest.approx(140.0, abs=0.5)
    assert run.rise.fluid_at(1800.0) - 273.15 == pytest.approx(76.9, abs=0.5)
    for rise, loss in ((run.rise, 15.7), (run.bare, 25.9)):
        at_half_an_hour = np.interp(1800.0, rise.time, rise.peak_force_N)
        cold = np.interp(293.15, rise.fluid, rise.peak_force_N)
        assert 100.0 * (1.0 - at_half_an_hour / cold) == pytest.approx(loss, abs=1.0)
        assert rise.energy_closure <= 1e-9


# --------------------------------------------------------------------------------------------- the answer


def test_the_keys_that_scripts_rely_on(answer):
    assert {"curve", "energy_closure", "time_to_limit_s", "force_loss_percent"} <= answer.keys()
    assert answer["curve"].keys() == {"time_s", "fluid_degC", "coil_degC", "wall_degC"}
    lengths = {len(values) for values in answer["curve"].values()}
    assert len(lengths) == 1
    assert answer["curve"]["time_s"][0] == 0.0
    assert answer["curve"]["time_s"][-1] == pytest.approx(1800.0)
    assert answer["time_to_limit_s"] is None
    assert answer["energy_closure"] <= 1e-9


def test_the_damper_is_also_run_without_its_sink(answer):
    bare = answer["without_sink"]
    assert bare["curve"]["fluid_degC"][-1] > answer["curve"]["fluid_degC"][-1] + 30.0
    assert "fin convection" in answer["paths_W"]
    assert "fin convection" not in bare["paths_W"]


def test_what_goes_in_is_given_off_or_stored(answer):
    for course in (answer, answer["without_sink"]):
        energy = course["energy_J"]
        paths = sum(energy[path] for path in course["paths_W"])
        assert energy["mechanical"] + energy["coil"] == pytest.approx(energy["stored"] + paths, rel=1e-9)


def test_film_coefficients_are_named(answer):
    assert "Churchill" in answer["correlations"]["body"]
    assert "Elenbaas, times 1.989" in answer["correlations"]["fins"]


def test_finite_elements_judge_the_end(answer):
    pytest.importorskip("skfem")
    field = answer["finite_element"]
    for part, most in (("fluid", 3.0), ("coil", 3.0), ("wall", 3.0)):
        assert abs(field[f"{part}_degC"] - answer["curve"][f"{part}_degC"][-1]) < most
    assert field["time_s"] == pytest.approx(1800.0)
    assert field["energy_closure"] <= 1e-9


def test_the_page_holds_every_picture_and_nothing_from_elsewhere(answer, folder):
    page = (folder / "out" / "heat.html").read_text(encoding="utf-8")
    assert re.findall(r'(?:src|href)="https?://', page) == []
    pictures = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    labels = [re.search(r'aria-label="([^"]*)"', picture) for picture in pictures]
    assert [label[1] for label in labels if label] == [
        "Temperatures over time", "Where the heat goes", "Fade of the force", "The damper to scale",
        "Temperature field",
    ]  # fmt: skip
    for picture in pictures:
        ET.fromstring(picture)
    assert "not reached" in page


def test_the_table_is_the_curve(answer, folder):
    table = np.genfromtxt(folder / "out" / "heat.csv", delimiter=",", names=True)
    assert table["fluid_degC"] == pytest.approx(answer["curve"]["fluid_degC"], abs=1e-6)
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["heat.csv", "heat.html", "heat.json"]


def test_the_fins_are_drawn_to_scale(folder):
    """The picture's fins stand as far apart, over the body's length, as the drawing says."""
    page = (folder / "out" / "heat.html").read_text(encoding="utf-8")
    picture = re.search(r'<svg[^>]*aria-label="The damper to scale".*?</svg>', page, flags=re.DOTALL)
    assert picture is not None
    boxes = []
    for path in re.finditer(
        r'<path[^>]*?\bd="([^"]*)"[^>]*?style="fill: (#\w+)', picture[0], flags=re.DOTALL
    ):
        numbers = np.array(re.findall(r"[ML] (-?[\d.]+) (-?[\d.]+)", path[1].replace("\n", " ")), dtype=float)
        boxes.append((path[2], numbers))
    fins = sorted(
        {tuple(box.min(axis=0)) + tuple(box.max(axis=0)) for colour, box in boxes if colour == "#c3cad1"}
    )
    body = np.concatenate([box for colour, box in boxes if colour == "#5c646c"])
    length = np.ptp(body[:, 0])
    left = sorted({fin[0] for fin in fins if fin[3] - fin[1] > 20.0})
    assert len(left) == 5
    assert np.diff(left) / length == pytest.approx(np.full(4, 20.0 / 200.0), abs=1e-3)
    long = [fin for fin in fins if fin[3] - fin[1] > 20.0]
    tall = max(fin[3] for fin in long) - min(fin[1] for fin in long)
    assert tall / length == pytest.approx(92.0 / 200.0, abs=2e-3)


def test_another_sink_takes_the_drawing_s_place(folder):
    sink = folder / "sink.toml"
    sink.write_text("[sink]\nfins = 2\nwidth_mm = 10\nthickness_mm = 2\npitch_mm = 30\n", encoding="utf-8")
    found = heat(folder / "card.json", DRAWING, sink=sink)
    assert found["sink"] == "2 fins, 10 mm wide, 2 mm thick at 30 mm pitch, aluminium-alloy"
    assert found["correlations"]["fins"] == "channel law of Elenbaas"  # type: ignore[index]


def test_a_drawing_without_sink_is_run_once(folder):
    bare = changed(folder, "fins = 5", "fins = 0")
    found: Any = heat(folder / "card.json", bare)
    assert found["sink"] is None
    assert found["without_sink"] is None


def test_the_curve_ends_at_the_fluid_s_limit_and_says_when(folder):
    bare = changed(folder, "fins = 5", "fins = 0")
    ended: Any = heat(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:3000s")
    gone_on: Any = heat(folder / "card.json", bare, duty="sine:15mm:1Hz:2A:3000s", past_limit=True)
    assert ended["curve"]["fluid_degC"][-1] == pytest.approx(130.0, abs=1e-6)
    assert ended["curve"]["time_s"][-1] == ended["time_to_limit_s"] == gone_on["time_to_limit_s"]
    assert gone_on["curve"]["time_s"][-1] == pytest.approx(3000.0)
    assert gone_on["curve"]["fluid_degC"][-1] > 135.0
    assert any("reaches its limit, 130 degC" in note for note in ended["notes"])
    page = mrdamper("heat", folder / "card.json", "--damper", bare, "--duty", "sine:15mm:1Hz:2A:3000s")
    assert f"reached after {ended['time_to_limit_s'] / 60:.1f} min" in page.stdout


def test_a_card_without_temperature_holds_its_power_and_says_so(folder):
    card = plain_card(folder, "cold.json", tempered=False)
    found: Any = heat(card, DRAWING, out=folder / "cold")
    assert np.ptp(found["power_W"]["mechanical"]) == 0.0
    assert found["force_loss_percent"] == 0.0
    assert any("held constant" in note for note in found["notes"])
    assert "held constant" in (folder / "cold" / "heat.html").read_text(encoding="utf-8")


def test_assumed_temperature_laws_are_marked(folder):
    card = plain_card(folder, "assumed.json", assumed=True)
    found: Any = heat(card, DRAWING, out=folder / "assumed")
    assert found["assumed"] == ["viscosity", "yield_force"]
    assert "Assumed, not identified" in (folder / "assumed" / "heat.html").read_text(encoding="utf-8")


def test_temperatures_beyond_the_card_s_are_said(folder):
    card = read_card(folder / "card.json")
    run = heat_damper(card, read_drawing(DRAWING), read_duty(HALF_HOUR), start_degC=-10.0)
    assert any("the card was identified from 20.0 to 130.0 degC" in note for note in run.notes)
    assert heat_damper(card, read_drawing(DRAWING), read_duty(HALF_HOUR)).notes == ()


def test_a_damper_at_rest_has_no_force_to_fade(folder):
    (folder / "rest.csv").write_text(
        "time_s,amplitude_mm,frequency_Hz,current_A\n0,0,0,2\n600,0,0,2\n", encoding="utf-8"
    )
    found: Any = heat(folder / "card.json", DRAWING, duty=str(folder / "rest.csv"), out=folder / "rest")
    assert found["force_loss_percent"] is None
    assert set(found["peak_force_N"]) == {None}
    assert found["energy_J"]["mechanical"] == 0.0
    assert found["curve"]["coil_degC"][-1] > found["curve"]["fluid_degC"][-1] > 20.0


def test_one_node_is_blind_to_the_coil(folder):
    found: Any = heat(folder / "card.json", DRAWING, model="lumped")
    assert found["curve"]["coil_degC"] == found["curve"]["fluid_degC"]


def test_the_same_run_gives_the_same_bytes(folder):
    for name in ("one", "two"):
        heat(folder / "card.json", DRAWING, out=folder / name)
    one, two = ((folder / name / "heat.html").read_bytes() for name in ("one", "two"))
    assert one == two


def test_a_single_fin_has_no_pitch():
    sink = read_sink(DRAWING)
    assert "pitch" not in sink_in_words(type(sink)(fins=1, width=0.01, thickness=0.002, pitch=0.01))
    assert "pitch" in sink_in_words(sink)


def test_what_is_not_given_off_is_the_rate_of_the_stored_heat(folder):
    """The picture's share "stored" is what goes in less the paths; the stored heat's slope says the same."""
    run = heat_damper(read_card(folder / "card.json"), read_drawing(DRAWING), read_duty(HALF_HOUR))
    rise = run.rise
    stored = rise.mechanical_W + rise.coil_W - sum(rise.paths_W.values())
    rate = np.gradient(rise.heating.stored, rise.time)
    assert stored[10:-1] == pytest.approx(rate[10:-1], rel=0.03)


# ------------------------------------------------------------------------------------------------ bad input


def test_bad_input_ends_in_one_message_and_leaves_nothing(folder):
    drawing = changed(folder, "pitch_mm = 20", "pitch_mm = 2", "overlap.toml")
    run = mrdamper("heat", folder / "card.json", "--damper", drawing, "--out", folder / "bad", "--json")
    assert (run.returncode, run.stdout) == (3, "")
    assert len(run.stderr.strip().splitlines()) == 1
    assert "fins overlap: thickness_mm is 3 and pitch_mm 2" in run.stderr
    assert not (folder / "bad").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("wall_mm = 5", "wall_mm = 25", "body.wall_mm is 25, the outer radius 23"),
        ("outer_diameter_mm = 46", "outer_diameter_mm = 23", "Is 23 mm the body's radius?"),
        ("length_mm = 200", "length = 200", "body has no key 'length'"),
        ("resistance_ohm = 4.2", 'resistance_ohm = "4.2"', "expected a number"),
        ("air_m_s = 0", "air_m_s = 1e-9", "the correlation holds for"),
    ],
)
def test_a_drawing_that_cannot_be_is_refused(folder, old, new, message):
    with pytest.raises(InputError, match=re.escape(message)):
        heat(folder / "card.json", changed(folder, old, new, "bad.toml"))


@pytest.mark.parametrize(
    ("duty", "message"),
    [
        ("sine:15mm:1Hz:2V:1800s", "its command is in V, the card's in A; expected the same unit"),
        ("sine:15:1Hz:2A:1800s", "sine"),
        ("nowhere.csv", "nowhere.csv"),
        ("sine:15mm:1Hz:2A", "motion 'sine:15mm' is not known"),
        ("sine:150mm:4Hz:2A:1800s", "a node is at"),
    ],
)
def test_a_duty_that_cannot_be_is_refused(folder, duty, message):
    with pytest.raises(InputError, match=re.escape(message)):
        heat(folder / "card.json", DRAWING, duty=duty, past_limit=True)


def test_a_card_in_volts_needs_the_driver_s_amperes_per_volt(folder):
    card = plain_card(folder, "volts.json", unit="V")
    with pytest.raises(InputError, match=r"expected the same unit, as in sine:15mm:1Hz:2V:1800s"):
        heat(card, DRAWING)
    with pytest.raises(InputError, match=r"expected coil\.A_per_V"):
        heat(card, DRAWING, duty="sine:15mm:1Hz:2V:1800s")
    told = changed(folder, "resistance_ohm = 4.2", "resistance_ohm = 4.2\nA_per_V = 1.0")
    found: Any = heat(card, told, duty="sine:15mm:1Hz:2V:1800s")
    in_amperes: Any = heat(folder / "card.json", DRAWING)
    assert found["curve"]["fluid_degC"] == pytest.approx(in_amperes["curve"]["fluid_degC"])


def test_a_start_at_the_limit_ends_at_once(folder):
    found: Any = heat(folder / "card.json", DRAWING, start_degC=131.0, out=folder / "hot")
    assert found["time_to_limit_s"] == 0.0
    assert found["curve"]["time_s"] == [0.0]
    assert found["finite_element"] is None
    assert (folder / "hot" / "heat.html").exists()
