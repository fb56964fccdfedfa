"""``mrdamper heatsink``: from a card and a drawing to a front of heat sinks, or one message."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import pytest

from mrdamper.errors import InputError
from mrdamper.jobs.options import HeatOptions, HeatsinkOptions
from mrdamper.jobs.thermal import heatsink as sink_job
from mrdamper.registry import JOBS
from mrdamper.thermal.drawing_file import read_drawing, read_sink
from mrdamper.thermal.duty import DEFAULT_DUTY, read_duty
from tests.jobs.test_heat import changed
from tests.support.heated import DRAWING, paper_card, plain_card
from tests.support.rigs import answer_of, mrdamper

pytestmark = pytest.mark.system

DESIGN = {"fins", "width_m", "thickness_m", "pitch_m", "mass_kg", "temperature_degC", "model"}
SMALL = HeatsinkOptions(span_mm=30.0, least_thickness_mm=2.0, by_field=False, members=4)


def sink(card, drawing, *, options=SMALL, duty=None, out=None) -> Any:
    """Run the job in this process; return its answer."""
    given = {"card": card, "drawing": drawing, "duty": duty}
    return JOBS["heatsink"].perform(given, options, out=out)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("sink")
    plain_card(place)
    return place


@pytest.fixture(scope="module")
def answer(folder) -> Any:
    """Run the command once: 84 mm of span, three members of the front by finite elements."""
    pytest.importorskip("skfem")
    return answer_of(
        mrdamper(
            "heatsink", folder / "card.json", "--damper", DRAWING, "--span-mm", 84, "--front", 3,
            "--out", folder / "out", "--json",
        )
    )  # fmt: skip


@pytest.mark.nightly
def test_the_keys_that_scripts_rely_on(answer):
    assert {"reference", "front", "study"} <= answer.keys()
    for design in (answer["reference"], answer["bare"], *answer["front"], answer["best"]):
        assert design.keys() >= DESIGN
        assert design["model"] == "finite_element"


def test_the_reference_is_the_drawing_s_own_sink(answer):
    reference, own = answer["reference"], read_sink(DRAWING)
    found = (reference["fins"], reference["width_m"], reference["thickness_m"], reference["pitch_m"])
    assert found == (own.fins, own.width, own.thickness, own.pitch)
    assert reference["mass_kg"] == pytest.approx(own.mass(0.046))


def test_the_front_is_one_by_mass_and_temperature(answer):
    front = answer["front"]
    masses, degrees = ([each[key] for each in front] for key in ("mass_kg", "temperature_degC"))
    assert masses == sorted(masses)
    assert degrees == sorted(degrees, reverse=True)
    assert front[-1] == answer["best"]
    assert len(front) <= 3


def test_eight_kelvin_cooler_in_the_same_envelope_and_with_no_more_mass(answer):
    """By the network."""
    best, reference = answer["best"], answer["reference"]
    assert best["mass_kg"] <= reference["mass_kg"]
    assert (best["fins"] - 1) * best["pitch_m"] + best["thickness_m"] <= 0.084 * (1.0 + 1e-9)
    assert best["width_m"] <= 0.023 * (1.0 + 1e-9)
    assert reference["temperature_degC"] - best["temperature_degC"] >= 8.0
    assert answer["cooler_K"] == pytest.approx(reference["temperature_degC"] - best["temperature_degC"])


@pytest.mark.nightly
def test_eight_kelvin_cooler_with_the_card_that_the_rig_leads_to():
    """By the network; the finite elements confirm it in tests/thermal/test_design.py."""
    options = HeatsinkOptions(span_mm=84.0, by_field=False)
    run = sink_job.heatsink(paper_card(), read_drawing(DRAWING), read_duty(DEFAULT_DUTY), options)
    assert run.reference.fluid - 273.15 == pytest.approx(75.5, abs=0.5)
    assert run.reference.fluid - run.best.fluid >= 8.0
    assert run.lightest is not None
    assert run.lightest.mass < 0.55 * run.reference.mass
    assert run.lightest.fluid <= run.reference.fluid


def test_the_study_holds_the_paper_s_sweeps_by_every_reading(answer):
    study = answer["study"]
    assert [round(1e3 * row["width_m"]) for row in study["width"]] == [18, 23, 28, 33]
    assert [row["fins"] for row in study["fins"]] == [3, 4, 5]
    names = {each["name"] for each in study["definitions"]}
    assert study["default"] in names
    for row in (*study["width"], *study["fins"]):
        assert row["efficiency"].keys() == names
    both = {each["name"] for each in study["definitions"] if all(each["follows_paper"].values())}
    assert study["default"] in both


def test_what_hangs_on_the_fin_law_is_told(answer):
    assert [(row["correlation"], row["film_multiplier"]) for row in answer["spread"]] == [
        *((law, factor) for factor in (2.859, 1.0) for law in ("annular", "channel", "vdi")),
        ("annular", 1.0),
    ]  # fmt: skip
    assert 0.5 < answer["spread"][-1]["air_m_s"] < 1.3  # the draught that would do what the multiplier does
    assert answer["spread"][-1]["reference_degC"] == pytest.approx(
        answer["spread"][0]["reference_degC"], abs=0.1
    )
    low, high = answer["cooler_interval_K"]
    assert answer["better"] == (low > 0.0)
    assert low < answer["cooler_K"] < high
    assert any("at narrower gaps is an assumption" in note for note in answer["notes"])


def test_the_page_holds_front_dampers_and_sweeps(answer, folder):
    page = (folder / "out" / "heatsink.html").read_text(encoding="utf-8")
    assert "fingerprint of its training runs" in page  # what it was made from, at the end
    assert "mrdamper 0." in page
    pictures = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    labels = [re.search(r'aria-label="([^"]*)"', picture) for picture in pictures]
    assert [label[1] for label in labels if label] == [
        "Front of temperature against mass", "Best sink and reference, to scale", "The paper_s sweeps",
    ]  # fmt: skip
    for picture in pictures:
        ET.fromstring(picture)
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == ["best.toml", "front.csv", "heatsink.html", "heatsink.json"]


def test_the_best_sink_s_file_heats_to_what_was_promised(answer, folder):
    found: Any = JOBS["heat"].perform(
        {"card": folder / "card.json", "drawing": DRAWING, "sink": folder / "out" / "best.toml"},
        HeatOptions(model="network"),
    )[1]
    assert found["curve"]["fluid_degC"][-1] == pytest.approx(answer["best"]["network_degC"], abs=0.02)


def test_the_table_on_the_terminal_has_the_reference_and_the_coolest(folder):
    run = mrdamper(
        "heatsink", folder / "card.json", "--damper", DRAWING, "--span-mm", 30, "--least-thickness-mm", 2,
        "--network-only",
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    for word in ("reference", "coolest", "zone network", "cooler than the reference", "E4a*"):
        assert word in run.stdout
    assert all(len(line) <= 110 for line in run.stdout.splitlines())


@pytest.mark.nightly
def test_a_drawing_without_sink_is_its_own_reference(folder):
    bare = changed(folder, "fins = 5", "fins = 0")
    options = HeatsinkOptions(span_mm=20.0, width_mm=10.0, least_thickness_mm=2.0, by_field=False)
    found: Any = sink(folder / "card.json", bare, options=options, out=folder / "bare")
    assert found["reference"] == found["bare"]
    assert found["reference"]["fins"] == 0
    assert found["limits"]["mass_kg"] is None
    assert found["best"]["temperature_degC"] < found["reference"]["temperature_degC"]


@pytest.mark.nightly
def test_a_damper_on_which_the_paper_s_fins_do_not_fit_has_no_study(folder):
    short = changed(folder, "length_mm = 200", "length_mm = 82")
    options = HeatsinkOptions(span_mm=40.0, least_thickness_mm=2.0, by_field=False)
    with pytest.raises(InputError, match="expected fins that fit on the body"):
        sink(folder / "card.json", short, options=options)
    text = short.read_text(encoding="utf-8").replace("pitch_mm = 20", "pitch_mm = 10", 1)
    short.write_text(text, encoding="utf-8")
    found: Any = sink(folder / "card.json", short, options=options)
    assert found["study"] is None
    assert any("the paper's sweeps are left out" in note for note in found["notes"])


@pytest.mark.nightly
def test_the_law_of_the_fins_can_be_changed(folder):
    options = HeatsinkOptions(
        span_mm=30.0, least_thickness_mm=2.0, by_field=False, correlation="vdi", film_multiplier=1.0
    )
    found: Any = sink(folder / "card.json", DRAWING, options=options)
    plain: Any = sink(folder / "card.json", DRAWING, options=SMALL)
    assert found["reference"]["temperature_degC"] > plain["reference"]["temperature_degC"] + 5.0
    assert [row["correlation"] for row in found["spread"]] == ["vdi", "annular", "channel"]


@pytest.mark.nightly
def test_a_duty_that_no_sink_can_carry_is_told(folder):
    found: Any = sink(folder / "card.json", DRAWING, options=SMALL, duty="sine:15mm:2Hz:2A:4500s")
    assert any("no sink keeps the fluid below its limit" in note for note in found["notes"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (HeatsinkOptions(mass_g=1.0), "no sink keeps to them"),
        (HeatsinkOptions(correlation="disc"), "sink.correlation is 'disc' on a horizontal body"),
    ],
)
def test_limits_that_cannot_be_are_refused(folder, options, message):
    with pytest.raises(InputError, match=re.escape(message)):
        sink(folder / "card.json", DRAWING, options=options)
