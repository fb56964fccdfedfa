"""One damper from its files to its controller, in a browser: what each step hands to the next."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path

import numpy as np
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
"""Pages, and how the names of their fields begin."""


class Hand:
    """Somebody who presses, fills and chooses; each is one action."""

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


def test_from_a_loggers_file_to_a_verified_unit_with_a_chosen_sink(browser, tmp_path):  # noqa: PLR0915 - one way
    """No TOML is written by hand, nothing is downloaded to be uploaded, no step ends the way."""
    folder = tmp_path / "damper"
    raw = a_logger_file(tmp_path / "Dämpfer_Prüfstand_20°C_1A.txt")
    with served(folder) as client, opened(browser, client.address) as page:
        hand = Hand(page)
        page.goto("/#/runs")
        page.wait_for_selector("#drop")
        hand.on(page.locator("#picker")).set_input_files(raw)
        page.get_by_text("not understood").first.wait_for()
        hand.on(page.get_by_label(f"Look into {raw.name}")).click()
        for column, role, gain in (("CHANNEL0", "displacement", "0.01"), ("CHANNEL1", "force", "980.665")):
            hand.choose(f"{column} is", role)
            hand.choose(f"{column} in", "signal")
            hand.on(page.get_by_label(f"{column} gain")).fill(gain)
        hand.on(page.get_by_label("A new test begins at")).fill("Resume")
        hand.on(page.get_by_label("Currents of the tests, A")).fill("0, 1")
        page.wait_for_selector("#preview .notice.good")
        hand.on(page.locator("#save-map")).click()
        hand.press("Fit a model")
        hand.on(page.locator("#fit-law")).select_option("bouc-wen")  # the usual way tries all laws
        hand.press("Identify")
        page.wait_for_selector("#fit-tiles", timeout=120_000)
        hand.press("Draw the damper")
        page.wait_for_selector("#section svg")
        hand.fill("#drawing-body-length-mm", "220")
        hand.fill("#drawing-coil-resistance-ohm", "5")
        hand.press("Save and use it")
        page.wait_for_selector("figure[data-asked]")
        assert page.locator("#heat-damper").input_value() == "damper.toml"
        assert "extrapolated" in page.inner_text("#heat-tiles")  # 15 mm on a card that knows 5
        hand.press("Search a heat sink")
        hand.on(page.get_by_label("Thinnest fin, mm")).fill("3")  # fewer designs
        hand.press("Search")
        page.wait_for_selector("#use-sink", timeout=300_000)
        assert "extrapolated" in page.locator(".tile", has_text="coolest").inner_text()
        shoot(page, "workbench-sink")
        hand.on(page.locator("table .quiet", has_text=re.compile(r"^\d+ fins?$"))).click()
        hand.press("Use this sink")
        page.wait_for_selector("[data-shown=heating] figure[data-asked]")
        chosen = page.locator("#heat-damper").input_value()
        steps = page.locator(
            "[data-page=heating], [data-page=sink], [data-page=drawing], [data-page=identify]"
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


def test_pages_of_many_runs_are_short_fit_a_phone_and_identify_is_near(browser, many):
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


@pytest.mark.nightly
def test_the_first_paint_comes_soon_and_the_server_stays_small(browser, many):
    """The quickest of several new browsers is compared: other programs only delay a paint."""
    paints: list[float] = []
    while len(paints) < MOST_LOADS and min(paints, default=np.inf) > MOST_PAINT_ms:
        with opened(browser, many[1].address) as page:
            page.goto("/")
            page.wait_for_selector("[data-shown=runs] h1")
            page.wait_for_function("performance.getEntriesByName('first-paint').length")
            paints.append(page.evaluate("performance.getEntriesByName('first-paint')[0].startTime"))
    with opened(browser, many[1].address) as page:
        for name in PAGES:
            page.goto(f"/#/{name}")
            page.wait_for_selector(f"[data-shown={name}] h1")
    status = Path(f"/proc/{many[1].process.pid}/status").read_text()
    memory = 1024.0 * int(re.findall(r"VmRSS:\s*(\d+) kB", status)[0]) / 1e6
    print(f"first paint {min(paints):.0f} ms of {[round(each) for each in paints]}; server {memory:.0f} MB")
    assert min(paints) <= MOST_PAINT_ms
    assert memory <= MOST_MEMORY_MB


def test_runs_are_chosen_by_what_they_are_and_copies_stay_aside(browser, many):
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


def test_runs_are_filtered_by_what_they_are_and_the_address_keeps_it(browser, many):
    address = many[1].address
    with opened(browser, address) as page, opened(browser, address, scheme="dark") as other:
        page.goto("/#/runs")
        page.get_by_label("Command", exact=True).select_option("1.00 A")
        rows = page.get_by_label(re.compile(r"^\d+ of 91 runs$")).locator("tbody tr")
        expect(rows).to_have_count((RUNS - COPIES) // 3)
        expect(rows.locator(".tag", has_text="copy")).to_have_count(0)
        page.get_by_label("Command", exact=True).select_option("2.00 A")
        expect(rows.locator(".tag", has_text="copy")).to_have_count(COPIES)
        shoot(page, "workbench-runs-filtered", whole=True)
        other.goto(page.url)
        expect(other.get_by_label("Command", exact=True)).to_have_value("2.00 A")
        expect(other.get_by_label(re.compile(r"^\d+ of 91 runs$")).locator("tbody tr")).to_have_count(
            rows.count()
        )
        shoot(other, "workbench-runs-filtered-dark", whole=True)


def test_a_run_of_another_damper_is_marked_and_findings_lead_to_their_place(browser, tmp_path):
    """One of six like runs has three times the force of the others; a spike is pressed, and drawn."""
    runs = tmp_path / "damper" / "runs"
    runs.mkdir(parents=True)
    for k in range(5):
        a_sine_run(runs / f"like{k}.csv", 200.0 + k)
    a_sine_run(runs / "other.csv", 600.0)
    lines = (runs / "like3.csv").read_text().splitlines()
    lines[301] = re.sub(r"^([^,]+,[^,]+),[^,]+", r"\1,9000", lines[301])  # at 1.5 s
    (runs / "spiked.csv").write_text("\n".join(lines))
    with served(runs.parent) as client, opened(browser, client.address, size=PHONE) as page:
        client.read_all()
        page.goto("/#/runs")
        marked = page.locator("tr", has=page.locator(".tag", has_text="stranger"))
        expect(marked).to_have_count(2)
        expect(marked).to_contain_text(["other", "spiked"])
        findings = page.get_by_label("Findings")
        expect(findings).to_contain_text("times that of runs like it")
        shoot(page, "workbench-stranger-phone", whole=True)
        page.goto("/#/fit")
        expect(page.locator("#chosen-runs summary")).to_contain_text("are strangers")
        page.goto("/#/runs")
        findings.get_by_role("link", name=re.compile(r"^force at 1\.\d")).first.click()
        page.wait_for_selector("[data-shown=loops] #loops-said[data-ms]")
        expect(page).to_have_url(re.compile(r"run=spiked&file=spiked\.csv&t=[01](\.\d*)?_[12](\.\d*)?$"))
        expect(page.get_by_role("group", name="Runs drawn").get_by_label("spiked")).to_be_checked()
        shoot(page, "workbench-finding-drawn")


def test_the_skip_link_leads_into_the_page_that_is_shown(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/#/drawing")
        page.wait_for_selector("#section svg")
        page.locator("a.skip").press("Enter")
        expect(page.locator("main")).to_be_focused()
        expect(page.locator("[data-shown=drawing]")).to_be_visible()


def test_what_is_removed_is_put_back(browser, many):
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


def test_a_drawing_that_cannot_be_built_is_told_where_it_is_filled_in(browser, many):
    with opened(browser, many[1].address) as page:
        page.goto("/#/drawing")
        page.wait_for_selector("#section svg")
        page.fill("#drawing-piston-diameter-mm", "50")
        expect(page.locator("main .notice.fault")).to_contain_text("piston.diameter_mm is 50, the bore 36")
        assert page.locator("#save-drawing").is_disabled()
        page.fill("#drawing-piston-diameter-mm", "34")
        expect(page.locator("#save-drawing")).to_be_enabled()
        page.keyboard.press("Escape")


def test_the_sheet_of_keys_opens_and_keys_go_to_pages(browser, many):
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


def test_a_page_that_is_left_does_not_take_the_address_back(browser, site):
    """What it notes in the address when the next page was asked for and is not shown yet is dropped."""
    with opened(browser, site[1].address) as page:
        page.goto("/#/heating")
        field = page.locator("[data-shown=heating] input[id^=heat]:not([type=checkbox]):visible").first
        field.evaluate(
            """(field) => {
              window.location.hash = "#/drawing";
              field.value = "20";
              for (const kind of ["input", "change"]) field.dispatchEvent(new Event(kind, { bubbles: true }));
            }"""
        )
        page.wait_for_selector("[data-shown=drawing]")
        assert page.evaluate("window.location.hash") == "#/drawing"


def test_what_stands_in_a_form_comes_back_with_its_address(browser, site):
    """Back, and another browser with the copied address, show the numbers that were filled in."""
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
