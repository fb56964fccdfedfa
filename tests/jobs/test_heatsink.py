"""The command ``heatsink`` computes a Pareto front of heat sinks, or prints one message."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import pytest

from mrdamper.jobs.options import HeatOptions, HeatsinkOptions
from mrdamper.jobs.thermal.heatsink import heatsink
from mrdamper.registry import JOBS
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import DEFAULT_DUTY, read_duty
from tests.jobs.test_heat import changed
from tests.support.campaigns import paper_card
from tests.support.cards import PAPER_DRAWING, write_heated_card
from tests.support.rigs import mrdamper

pytestmark = pytest.mark.system

SMALL = HeatsinkOptions(span_mm=30.0, by_field=False, members=4)
TWO_MM = ("[body]", "[manufacture]\nleast_thickness_mm = 2\n\n[body]")


def search(card, drawing, *, options=SMALL, duty=None, out=None) -> Any:
    given = {"card": card, "drawing": drawing, "duty": duty}
    return JOBS["heatsink"].perform(given, options, out=out)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("sink")
    write_heated_card(place)
    return place


@pytest.fixture(scope="module")
def answer(folder) -> Any:
    """Run the job once. The best four designs are simulated with finite elements."""
    options = HeatsinkOptions(span_mm=30.0, members=4)
    return search(folder / "card.json", PAPER_DRAWING, options=options, out=folder / "out")


def test_heat_sink_pareto_front_is_ordered_by_mass(answer):
    front = answer["front"]
    masses, degrees = ([each[key] for each in front] for key in ("mass_kg", "temperature_degC"))
    assert masses == sorted(masses)
    assert degrees == sorted(degrees, reverse=True)
    assert front[-1] == answer["best"]


@pytest.mark.nightly
def test_best_heat_sink_is_cooler_and_lighter():
    """The coolest heat sink is 8 K cooler. The lightest equally cool heat sink has about half the mass."""
    options = HeatsinkOptions(span_mm=84.0, by_field=False)
    run = heatsink(paper_card(), read_drawing(PAPER_DRAWING), read_duty(DEFAULT_DUTY), options)
    assert run.reference.fluid - 273.15 == pytest.approx(75.5, abs=0.5)
    assert run.reference.fluid - run.best.fluid >= 8.0
    assert run.lightest is not None
    assert run.lightest.mass < 0.55 * run.reference.mass
    assert run.lightest.fluid <= run.reference.fluid


def test_heat_sink_result_contains_study_of_paper(answer):
    study = answer["study"]
    assert [round(1e3 * row["width_m"]) for row in study["width"]] == [18, 23, 28, 33]
    assert [row["fins"] for row in study["fins"]] == [3, 4, 5]
    assert study["follows_paper"] == {"width": True, "fins": True}


def test_heat_sink_page_shows_pareto_front_and_sweeps(answer, folder):
    page = (folder / "out" / "heatsink.html").read_text(encoding="utf-8")
    pictures = re.findall(r"<svg.*?</svg>", page, flags=re.DOTALL)
    labels = [re.search(r'aria-label="([^"]*)"', picture) for picture in pictures]
    assert [label[1] for label in labels if label] == [
        "Front of temperature against mass",
        "Best sink and reference, to scale",
        "Parameter studies of the paper",
    ]  # fmt: skip
    for picture in pictures:
        ET.fromstring(picture)
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == ["best.toml", "front.csv", "heatsink.html", "heatsink.json"]


def test_best_sink_file_gives_same_temperature(answer, folder):
    found: Any = JOBS["heat"].perform(
        {"card": folder / "card.json", "drawing": PAPER_DRAWING, "sink": folder / "out" / "best.toml"},
        HeatOptions(),
    )[1]
    assert found["curve"]["fluid_degC"][-1] == pytest.approx(answer["best"]["temperature_degC"], abs=1e-3)


def test_terminal_lists_reference_and_coolest_heat_sink(folder):
    thick = changed(folder, *TWO_MM, name="thick.toml")
    run = mrdamper("heatsink", folder / "card.json", "--damper", thick, "--span-mm", 30, "--network-only")
    assert run.returncode == 0, run.stderr
    for word in ("reference", "coolest", "Best heat sink", "warmer than the reference"):
        assert word in run.stdout
    assert all(len(line) <= 110 for line in run.stdout.splitlines())


@pytest.mark.nightly
def test_sink_search_compares_with_bare_damper(folder):
    bare = changed(folder, "fins = 5", "fins = 0")
    options = HeatsinkOptions(span_mm=20.0, width_mm=10.0, by_field=False)
    found: Any = search(folder / "card.json", bare, options=options, out=folder / "bare")
    assert found["reference"] == found["bare"]
    assert found["reference"]["fins"] == 0
    assert found["limits"]["mass_kg"] is None
    assert found["best"]["temperature_degC"] < found["reference"]["temperature_degC"]


@pytest.mark.nightly
def test_sweeps_of_paper_are_omitted_for_short_damper(folder):
    short = changed(folder, "length_mm = 200", "length_mm = 82")
    short.write_text(short.read_text(encoding="utf-8").replace("pitch_mm = 20", "pitch_mm = 10", 1), "utf-8")
    options = HeatsinkOptions(span_mm=40.0, by_field=False)
    found: Any = search(folder / "card.json", short, options=options)
    assert found["study"] is None
    assert any("the paper's sweeps are omitted" in note for note in found["notes"])


@pytest.mark.nightly
def test_note_reports_load_too_large_for_heat_sinks(folder):
    found: Any = search(folder / "card.json", PAPER_DRAWING, duty="sine:15mm:2Hz:2A:4500s")
    assert any("no sink keeps the fluid below its limit" in note for note in found["notes"])
