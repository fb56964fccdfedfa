"""One damper from its files to its controller in a browser."""

from __future__ import annotations

import os
import re
import time

import pytest
from playwright.sync_api import Locator, Page, expect

from mrdamper.thermal.drawing_file import read_drawing
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import PAGES, a_logger_file, a_sine_run

pytestmark = pytest.mark.nightly

MOST_ACTIONS, MOST_HEIGHT_px, MOST_TABS, PHONE = 25, 2000, 25, (390, 844)
MOST_PAINT_ms, MOST_MEMORY_MB, MOST_LOADS = 200.0, 90.0, 15
RUNS, COPIES = 91, 7
FIELDS = (
    ("fit", "fit"), ("drawing", "drawing-body"), ("heating", "heat"), ("heating", "s-duty"),
    ("heating", "s-amplitude"), ("heatsink", "heatsink"),
)  # fmt: skip
"""Pages with the prefix of their field ids."""


class Hand:
    """User whose clicks, entries and choices are counted as actions."""

    def __init__(self, page: Page) -> None:
        self.page, self.actions = page, 0

    def press(self, name: str) -> None:
        self.on(self.page.get_by_role("button", name=name, exact=True)).click()

    def fill(self, place: str, value: str) -> None:
        self.on(self.page.locator(place)).fill(value)

    def choose(self, label: str, value: str) -> None:
        self.on(self.page.get_by_label(label)).select_option(value)

    def on(self, control: Locator) -> Locator:
        self.actions += 1
        return control.first


def test_logger_file_becomes_verified_fmu(browser, tmp_path):  # noqa: PLR0915 - one way
    """The user writes no TOML file and uploads no downloaded file."""
    folder = tmp_path / "damper"
    raw = a_logger_file(tmp_path / "Dämpfer_Prüfstand_20°C_1A.txt")
    with served(folder) as client, opened(browser, client.address) as page:
        hand = Hand(page)
        page.goto("/#/runs")
        page.wait_for_selector("#drop")
        hand.on(page.locator("#picker")).set_input_files(raw)
        page.get_by_text("not understood").first.wait_for()
        hand.on(page.get_by_label(f"Look into {raw.name}")).click()
        for column, role, unit, gain in (
            ("CHANNEL0", "displacement", "mm/V", "10"),
            ("CHANNEL1", "force", "N/V", "980.665"),
        ):
            hand.choose(f"{column} is", role)
            hand.choose(f"{column} in", unit)
            hand.on(page.get_by_label(f"{column} gain", exact=True)).fill(gain)
        hand.on(page.get_by_label("A new test begins at")).fill("Resume")
        hand.on(page.get_by_label("Currents of the tests, A")).fill("0, 1")
        page.wait_for_selector("#preview .notice.good")
        hand.on(page.locator("#save-map")).click()
        hand.press("Fit a model")
        hand.on(page.locator("#fit-law")).select_option("bouc-wen")  # The default compares all laws.
        hand.press("Identify")
        page.wait_for_selector("#fit-tiles", timeout=120_000)
        hand.press("Draw the damper")
        page.wait_for_selector("#section svg")
        hand.fill("#drawing-body-length-mm", "220")
        hand.fill("#drawing-coil-resistance-ohm", "5")
        hand.press("Save and use it")
        page.wait_for_selector("figure[data-asked]")
        assert page.locator("#heat-damper").input_value() == "damper.toml"
        assert "extrapolated" not in page.inner_text(
            "#heat-tiles"
        )  # The first sine is inside the card's runs.
        hand.press("Search a heat sink")
        hand.on(page.get_by_label("Length for the fins, mm")).fill(
            "30"
        )  # A short length gives fewer designs.
        hand.press("Search")
        page.wait_for_selector("#use-sink", timeout=300_000)
        shoot(page, "workbench-sink")
        hand.on(page.locator("table .quiet", has_text=re.compile(r"^\d+ fins?$"))).click()
        hand.press("Use this sink")
        page.wait_for_selector("[data-shown=heating] figure[data-asked]")
        chosen = page.locator("#heat-damper").input_value()
        steps = page.locator(
            "[data-page=heating], [data-page=heatsink], [data-page=drawing], [data-page=fit]"
        )
        states = steps.evaluate_all("all => all.map((one) => [one.dataset.page, one.dataset.step])")
        assert dict(states) == {"fit": "done", "drawing": "done", "heatsink": "done", "heating": "open"}
        hand.press("Export it")
        page.wait_for_selector("[data-shown=export] #start-export")
        assert page.locator("#export-damper").input_value() == chosen
        hand.on(page.locator("#start-export")).click()
        page.get_by_text("The compiled code gives the model's own bits").wait_for(timeout=300_000)
        page.get_by_role("link", name=re.compile(r"damper\.fmu")).wait_for()
        expect(page.locator("[data-page=export]")).to_have_attribute("data-step", "done")
        file = folder / "inputs" / chosen
        file.write_text(f"{file.read_text()}# changed outside\n")
        os.utime(file, (time.time() + 5, time.time() + 5))
        page.reload()
        expect(page.locator("[data-page=export]")).to_have_attribute("data-step", "old")
        shoot(page, "workbench-export")
    drawing, sink = read_drawing(folder / "inputs" / chosen), re.search(r"(\d+)-fins", chosen)
    assert sink is not None
    assert drawing.sink is not None
    assert drawing.sink.fins == int(sink[1])
    assert drawing.body.length == pytest.approx(0.22)
    print(f"from a raw file to a verified unit: {hand.actions} actions")
    assert hand.actions <= MOST_ACTIONS


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Return a client of a folder of 91 runs, seven of them copies."""
    root = tmp_path_factory.mktemp("many") / "damper"
    (root / "runs").mkdir(parents=True)
    for k in range(RUNS):
        k_of = min(k, RUNS - 1 - COPIES)
        mm = 4.0 + 2.0 * (k % 2 if k < RUNS - COPIES else (RUNS - 1 - COPIES) % 2)
        a_sine_run(root / "runs" / f"run{k:03d}.csv", 200.0 + k_of, mm=mm, current_A=float(k_of % 3))
    with served(root) as client:
        client.read_all()
        yield root, client


def test_pages_with_many_runs_stay_short(browser, many):
    with opened(browser, many[1].address) as page:
        desk = page.viewport_size
        assert desk is not None
        heights, wide = {}, []
        for name in PAGES:
            page.goto(f"/#/{name}")
            page.wait_for_selector(f"[data-shown={name}] h1")
            page.wait_for_timeout(600)
            heights[name] = page.evaluate("document.documentElement.scrollHeight")
            page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
            page.wait_for_timeout(300)
            if page.evaluate("document.documentElement.scrollWidth") > PHONE[0]:
                wide.append(name)
            page.set_viewport_size(desk)
        page.goto("/#/fit")
        page.wait_for_selector("#start-fit")
        page.evaluate("document.activeElement.blur()")
        page.reload()
        page.wait_for_selector("#start-fit")
        tabs = 0
        while page.evaluate("document.activeElement.id") != "start-fit" and tabs < 200:
            page.keyboard.press("Tab")
            tabs += 1
        shoot(page, "workbench-identify-91")
    print(f"{RUNS} runs: {tabs} presses of Tab to Identify; heights {heights}")
    assert max(heights.values()) <= MOST_HEIGHT_px
    assert wide == []
    assert tabs <= MOST_TABS


def test_run_filters_exclude_copies(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/#/fit")
        page.wait_for_selector("#start-fit")
        expect(page.locator("#chosen-runs summary")).to_have_text(
            f"{RUNS - COPIES} of {RUNS} runs; {COPIES} are copies"
        )
        page.get_by_label("Command", exact=True).select_option("1.00 A")
        page.route(
            "**/api/jobs",
            lambda route: route.abort() if route.request.method == "POST" else route.continue_(),
        )
        with page.expect_request(
            lambda asked: asked.method == "POST" and asked.url.endswith("/api/jobs")
        ) as sent:
            page.click("#start-fit")
        asked = sent.value.post_data_json
        assert asked is not None
        options = asked["options"]
        assert len(options["files"]) == (RUNS - COPIES) // 3
        assert options["only"] == []
        assert all(int(name[3:6]) % 3 == 1 for name in options["files"])


def test_removed_file_is_restored(browser, many):
    root, client = many
    file = root / "runs" / "run000.csv"
    before = file.read_bytes()
    with opened(browser, client.address) as page:
        page.goto("/#/runs")
        remove = page.get_by_label("Remove run000.csv")
        remove.click()
        back = page.locator("#toasts").get_by_role("button", name="Put back")
        back.wait_for()
        assert not file.exists()
        expect(remove).to_have_count(0)
        back.click()
        remove.wait_for()
    assert file.read_bytes() == before


def test_shortcuts_open_help_and_pages(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/#/runs")
        page.wait_for_selector("#drop")
        page.keyboard.press("?")
        expect(page.locator("#shortcuts")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.locator("#shortcuts")).to_be_hidden()
        page.keyboard.press("g")
        page.keyboard.press("d")
        page.wait_for_selector("[data-shown=drawing]")


def test_form_values_return_with_address(browser, site):
    """Back and another browser restore the entered numbers from the address."""
    address = site[1].address
    with opened(browser, address) as page, opened(browser, address) as other:
        for name, kind in FIELDS:
            page.goto(f"/#/{name}")
            page.wait_for_selector(f"[data-shown={name}] form, [data-shown={name}] aside")
            field = page.locator(f"main input[id^={kind}]:not([type=checkbox]):visible").first
            expect(field).to_be_visible()
            marked = f"#{field.get_attribute('id')}"
            page.fill(marked, "20")
            expect(page).to_have_url(re.compile(r"\?.*\w\.\w"))
            copied = page.url
            page.goto("/#/runs")
            page.wait_for_selector("[data-shown=runs] h1")
            page.go_back()
            expect(page.locator(marked)).to_have_value("20")
            other.goto(copied)
            expect(other.locator(marked)).to_have_value("20")
