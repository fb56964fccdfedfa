"""In a browser, measured files of a damper become a controller, and folders may contain many runs."""

from __future__ import annotations

import os
import re
import time
from typing import Literal

import pytest
from playwright.sync_api import Page, ViewportSize, expect

from mrdamper.thermal.drawing_file import read_drawing
from tests.support.campaigns import write_csv
from tests.support.cards import write_card_of
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import VIEWS, a_logger_file, counted_actions, go, sine_columns

pytestmark = pytest.mark.nightly

ACTIONS_MAX, RIG_ACTIONS_MAX, TABS_MAX = 30, 20, 25
JOB_MAX_ms = 900_000  # Other programs can slow the machine down.
HEIGHT_MAX_px, RESULT_TOP_MAX_px, PHONE = 1500, 500, ViewportSize(width=390, height=844)
RUNS, COPIES = 91, 7
GEOMETRY = {
    "body-outer-diameter-mm": "54",
    "body-length-mm": "220",
    "body-wall-mm": "4",
    "piston-diameter-mm": "44",
    "piston-length-mm": "40",
    "rod-diameter-mm": "16",
    "coil-resistance-ohm": "5",
}
"""Numbers of an own damper, by field."""
FIELDS = (
    ("model", "fit-hold-out"), ("thermal?heat.tab=Geometry", "geometry-body-length-mm"),
    ("thermal?heat.tab=Heating", "heat-duty-amplitude_mm"),
    ("thermal?heat.tab=Heat sink", "heatsink-span-mm"),
)  # fmt: skip
"""Pages with a field."""


def press(page: Page, name: str, role: Literal["button", "link", "tab"] = "button") -> None:
    page.get_by_role(role, name=name, exact=True).first.click()


def map_logger_channels(page: Page) -> None:
    """Assign the channels of a logger file in volts on the page, and save the channel map."""
    for column, role, unit, gain in (
        ("CHANNEL0", "displacement", "mm/V", "10"),
        ("CHANNEL1", "force", "N/V", "980.665"),
    ):
        page.get_by_label(f"{column} is").select_option(role)
        page.get_by_label(f"{column} in").select_option(unit)
        page.get_by_label(f"{column} gain", exact=True).fill(gain)
    page.get_by_label("A new test begins at").fill("Resume")
    page.get_by_label("Currents of the tests, A").fill("0, 1")
    page.wait_for_selector("#preview .notice.good")
    press(page, "Save this map")


def test_logger_file_becomes_verified_fmu(browser, tmp_path):
    """From a raw file and the dimensions of a damper, the workbench makes a verified FMU of a controller.

    The user writes no TOML file and uploads no downloaded file. The page marks the export as outdated after a
    change of the geometry file.
    """
    folder = tmp_path / "damper"
    raw = a_logger_file(tmp_path / "Dämpfer_Prüfstand_20°C_1A.txt")
    with served(folder) as client, opened(browser, client.address) as page, counted_actions() as actions:
        page.goto("/")
        page.wait_for_selector("#drop")
        actions.part = "data"
        page.locator("#picker").set_input_files(raw)
        map_logger_channels(page)
        actions.part = "model"
        press(page, "Model", "link")
        actions.part = ""
        page.select_option("#fit-law", "bouc-wen")  # The default compares all laws, which takes longer.
        actions.part = "model"
        press(page, "Identify")
        page.wait_for_selector("#fit-tiles", timeout=JOB_MAX_ms)
        actions.part = "geometry"
        press(page, "How hot does it get?")
        press(page, "Geometry", "tab")
        for name, value in GEOMETRY.items():
            page.fill(f"#geometry-{name}", value)
        page.select_option("#geometry-fluid-preset", "lord-mrf-132dg")
        press(page, "Save and use it")
        page.wait_for_selector("[data-asked]")
        assert page.locator("#heat-damper").input_value() == "damper.toml"
        # The default load cycle stays within the range of the fitted runs.
        assert "extrapolated" not in page.inner_text("#quick-tiles")
        actions.part = "heat sink"
        press(page, "Search a heat sink")
        actions.part = ""
        page.get_by_label("Length, mm").fill("30")  # A short length gives fewer designs.
        actions.part = "heat sink"
        press(page, "Search")
        page.wait_for_selector("#use-sink", timeout=JOB_MAX_ms)
        shoot(page, "workbench-sink", whole=True)
        press(page, "Use this sink")
        page.wait_for_selector("[data-asked]")
        chosen = page.locator("#heat-damper").input_value()
        states = page.locator("[data-page]").evaluate_all("all => all.map((one) => one.dataset.step)")
        # The heat sink search has not been repeated with the new geometry.
        assert states == ["done", "done", "old", "open", "open"]
        actions.part = "controller"
        press(page, "Controller", "link")
        press(page, "Track")
        page.locator("button.main", has_text=re.compile("^Export ")).first.click(timeout=JOB_MAX_ms)
        assert page.locator("#export-damper").input_value() == chosen
        assert page.locator("#export-controller").input_value() == "paper"
        press(page, "Make and verify")
        page.get_by_text("The compiled code is identical to the model").first.wait_for(timeout=JOB_MAX_ms)
        page.get_by_role("link", name=re.compile(r"damper\.fmu")).wait_for()
        expect(page.locator("[data-page=controller]")).to_have_attribute("data-step", "done")
        print(f"from a raw file to a verified unit: {actions.total()} actions, {dict(actions)}")
        file = folder / "inputs" / chosen
        file.write_text(f"{file.read_text()}# changed outside\n")
        os.utime(file, (time.time() + 5, time.time() + 5))
        expect(page.locator("[data-page=controller]")).to_have_attribute("data-step", "old")
        shoot(page, "workbench-export")
    drawing, sink = read_drawing(folder / "inputs" / chosen), re.search(r"(\d+)-fins", chosen)
    assert sink is not None
    assert drawing.sink is not None
    assert drawing.sink.fins == int(sink[1])
    assert drawing.body.length == pytest.approx(0.22)
    assert actions.total() <= ACTIONS_MAX


def test_workbench_makes_verified_fmu_from_virtual_runs(browser, tmp_path):
    with (
        served(tmp_path / "damper") as client,
        opened(browser, client.address) as page,
        counted_actions() as actions,
    ):
        page.goto("/")
        actions.part = "data"
        press(page, "Make runs on the virtual rig")
        actions.part = "model"
        page.get_by_role("button", name="Fit a model").click(timeout=JOB_MAX_ms)
        actions.part = ""
        page.select_option("#fit-law", "bouc-wen")
        actions.part = "model"
        press(page, "Identify")
        page.wait_for_selector("#fit-tiles", timeout=JOB_MAX_ms)
        shoot(page, "rig-fit", whole=True)
        actions.part = "controller"
        press(page, "Control it")
        press(page, "Track")
        page.locator("button.main", has_text=re.compile("^Export ")).first.click(timeout=JOB_MAX_ms)
        press(page, "Make and verify")
        page.get_by_role("link", name=re.compile(r"damper\.fmu")).wait_for(timeout=JOB_MAX_ms)
    print(f"from the virtual rig to a verified unit: {actions.total()} actions, {dict(actions)}")
    assert actions.total() <= RIG_ACTIONS_MAX


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Serve a folder with a card and 91 runs. Yield the folder and a client of the server.

    Seven of the runs are copies.
    """
    root = tmp_path_factory.mktemp("many") / "damper"
    (root / "runs").mkdir(parents=True)
    for k in range(RUNS):
        k_of = min(k, RUNS - 1 - COPIES)
        columns = sine_columns(force_N=200.0 + k_of, mm=4.0 + 2.0 * (k_of % 2), currents_A=(k_of % 3,))
        write_csv(root / "runs" / f"run{k:03d}.csv", columns)
    write_card_of(root / "cards" / "strong" / "card.json")
    with served(root) as client:
        yield root, client


def test_pages_with_many_runs_stay_short(browser, many):
    """With 91 runs, no page is longer than two screens. On a phone, the result begins near the top."""
    with opened(browser, many[1].address) as page:
        desk = page.viewport_size
        assert desk is not None
        heights, tops, wide = {}, {}, []
        for _, address in VIEWS:
            go(page, address)
            heights[address] = page.evaluate("document.documentElement.scrollHeight")
            page.set_viewport_size(PHONE)
            page.wait_for_timeout(300)
            if page.evaluate("document.documentElement.scrollWidth") > PHONE["width"]:
                wide.append(address)
            if page.locator(".split > :last-child").count():
                box = page.locator(".split > :last-child").first.bounding_box()
                tops[address] = box["y"] if box else 0.0
            page.set_viewport_size(desk)
        page.goto("/#/model")
        page.reload()
        page.wait_for_selector("#start-fit")
        page.evaluate("document.activeElement.blur()")
        tabs = 0
        while page.evaluate("document.activeElement.id") != "start-fit" and tabs < 200:
            page.keyboard.press("Tab")
            tabs += 1
    print(f"{RUNS} runs: {tabs} presses of Tab to Identify; heights {heights}; tops {tops}")
    assert max(heights.values()) <= HEIGHT_MAX_px
    assert max(tops.values()) <= RESULT_TOP_MAX_px
    assert wide == []
    assert tabs <= TABS_MAX


def test_run_filters_exclude_copies(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/#/model")
        words = f"{RUNS - COPIES} of {RUNS} runs; {COPIES} are copies"
        expect(page.locator("#chosen-runs summary")).to_have_text(words)
        page.get_by_label("Command", exact=True).select_option("1.00 A")
        page.route("**/api/jobs", lambda route: route.abort())
        with page.expect_request("**/api/jobs") as sent:
            page.click("#start-fit")
        asked = sent.value.post_data_json
        assert asked is not None
        options = asked["options"]
        assert len(options["files"]) == (RUNS - COPIES) // 3
        assert options["only"] == []
        assert all(int(name[3:6]) % 3 == 1 for name in options["files"])


def test_keyboard_shortcuts_open_help_and_pages(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/")
        page.wait_for_selector("#drop")
        page.keyboard.press("?")
        expect(page.locator("#shortcuts")).to_be_visible()
        page.keyboard.press("Escape")
        page.keyboard.press("g")
        page.keyboard.press("t")
        page.wait_for_selector("[data-shown=thermal]")
        page.reload()
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "Skip to the page"


def test_url_restores_form_values(browser, site):
    """The Back button and another browser restore the entered values from the URL of the page."""
    address = site[1].address
    with opened(browser, address) as page, opened(browser, address) as other:
        for place, field in FIELDS:
            page.goto(f"/#/{place}")
            page.fill(f"[id='{field}']", "20")
            page.wait_for_timeout(300)  # The browser updates the address with a delay.
            copied = page.url
            go(page, "jobs")
            page.go_back()
            expect(page.locator(f"[id='{field}']")).to_have_value("20")
            other.goto(copied)
            expect(other.locator(f"[id='{field}']")).to_have_value("20")
