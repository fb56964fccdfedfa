"""The workbench uses the numbers and choices of the user, and marks only checked results as good."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from playwright.sync_api import Route, expect

from mrdamper.models.card_schema import write_card
from tests.support.campaigns import write_csv
from tests.support.cards import CHAIN, RIG_ENVELOPE, RUN, card_of, rig_damper
from tests.web.browser import opened, shoot
from tests.web.served import TOKENS, served
from tests.web.walking import VIEWS, a_logger_file, go, sine_columns

pytestmark = pytest.mark.system

SPELLINGS = ("2.5", "2,5", " 2.5 ", "+2,5", "2.50", "25e-1", "2,5E0", "0.25e1", "002,5", "2.5e+0")
INVALID = ("5e", "1e", "two", "2,5,1", "1.2.3", "1,234", "1,234.5", "2 5", "0x10", "Infinity")
READ = """async ([texts, many]) => {
  const { readNumber } = await import("/static/forms.js");
  const read = (text) => {
    try { return readNumber("Frequency", text, { many }); } catch (fault) { return fault.message; }
  };
  return texts.map(read);
}"""
UNMARKED = """() => {
  const type = (input, text) => {
    input.value = text;
    input.dispatchEvent(new Event("input", { bubbles: true }));
    return input.getAttribute("aria-invalid");
  };
  return [...document.querySelectorAll("main input.number")].filter((input) => {
    const before = input.value;
    return type(input, "5e") !== "true" || type(input, before) !== "false";
  }).map((input) => input.id);
}"""
RESIDUAL_RANGE = """async () => {
  const { rangesOf } = await import("/static/plot.js");
  const x = Float32Array.from({ length: 200 }, (_, k) => k / 100);
  const y = x.map((time) => (time < 0.05 ? -1300 : 40 * Math.sin(50 * time)));
  return rangesOf({ series: [{ x, y, since: 0.1 }] }).y;
}"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with three runs and six cards, and a client of its server."""
    root = tmp_path_factory.mktemp("values") / "damper"
    (root / "runs").mkdir(parents=True)
    write_csv(root / "runs" / "steady.csv", sine_columns())
    write_csv(root / "runs" / "stepped.csv", sine_columns(currents_A=(0.5, 1.5)))
    rig = write_csv(root / "runs" / "rig.csv", sine_columns(force_N=500.0, currents_A=(0.5, 1.5)))
    rig.write_text(f"# simulated: virtual damper hard, seed 0; not measured\n{rig.read_text()}")
    runs = ({**RUN, "name": "steady"}, {**RUN, "name": "stepped", "split": "held_out"})
    own = card_of(rig_damper(), envelope=RIG_ENVELOPE)
    own = replace(own, evidence=replace(own.evidence, runs=runs), sources=("steady.csv", "stepped.csv"))
    stopped = replace(own, notes={"cancelled": True}, evidence=replace(own.evidence, converged=False))
    for name, card in {
        "own": own,
        "simulated": replace(own, sources=("rig.csv",)),
        "stopped": stopped,
        "late": card_of(rig_damper(lag=None), envelope=RIG_ENVELOPE),
        "chain": card_of(CHAIN, envelope=RIG_ENVELOPE),
        "real": card_of(replace(CHAIN, actuation=None), envelope=RIG_ENVELOPE),
    }.items():
        (root / "cards" / name).mkdir(parents=True)
        write_card(card, root / "cards" / name / "card.json")
    with served(root) as client:
        yield root, client


def test_typed_numbers_are_used_or_marked(page):
    """Number fields accept both decimal separators. An invalid entry is marked and starts no job."""
    go(page, "thermal?card=own&heat.tab=Heat sink")
    assert page.evaluate(READ, [SPELLINGS, False]) == [2.5] * len(SPELLINGS)
    assert all("Frequency: " in str(text) for text in page.evaluate(READ, [INVALID, False]))
    lists = page.evaluate(READ, [["0; 0,25; 0,5", "0, 0.25, 0.5", "0 0,25 0,5", ""], True])
    assert lists == [[0, 0.25, 0.5]] * 3 + [[]]
    assert "Frequency: " in page.evaluate(READ, [["20,60"], True])[0]
    for _, address in VIEWS:
        go(page, address)
        assert page.locator("input[type=number]").count() == 0
        assert page.evaluate(UNMARKED) == [], address
    go(page, "thermal?card=own&heat.tab=Heat sink")
    field = page.get_by_label("Width, mm")
    started: list[str] = []
    page.on("request", lambda sent: started.append(sent.url) if sent.url.endswith("/api/jobs") else None)
    field.fill("5e")
    page.get_by_role("button", name="Search", exact=True).click()
    expect(field).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_text("Width: “5e” is not a number")).to_be_visible()
    shoot(page, "values-invalid")
    assert started == []
    field.fill("2,5")
    page.route("**/api/jobs", lambda route: route.abort())
    with page.expect_request("**/api/jobs") as sent:
        page.get_by_role("button", name="Search", exact=True).click()
    assert sent.value.post_data_json["options"]["width_mm"] == 2.5


def test_new_geometry_removes_old_calibration(page, site):
    """Calibration factors are valid only for the damper on which they were measured."""
    go(page, "thermal?card=own")
    expect(page.locator("#calibration")).to_contain_text("heat capacity × 0.9663")
    page.get_by_role("tab", name="Geometry").click()
    page.get_by_text("All fields").click()
    expect(page.locator("#geometry-calibration-film")).to_have_value("0.823")
    page.fill("#geometry-body-outer-diameter-mm", "50")
    expect(page.get_by_text("The calibration factors of paper were removed")).to_be_visible()
    expect(page.locator("#geometry-calibration-film")).to_have_value("")
    shoot(page, "values-geometry")
    page.fill("#geometry-name", "wide")
    page.click("#save-geometry")
    page.wait_for_selector("[data-asked]")
    expect(page.locator("#heat-damper")).to_have_value("wide.toml")
    expect(page.locator("#calibration")).to_be_empty()
    text = (site[0] / "inputs" / "wide.toml").read_text()
    assert "outer_diameter_mm = 50" in text
    assert "calibration" not in text
    assert "film_multiplier" not in text


@pytest.mark.nightly
def test_choices_are_kept_on_next_pages(browser, site, page):
    """Load cycle, geometry, design and controller stay selected when the user opens the next page."""
    go(page, "thermal?card=own&heat.tab=Geometry&heat.all=true&geometry=paper")
    page.fill("#geometry-sink-fins", "0")
    page.fill("#geometry-name", "bare")
    page.click("#save-geometry")
    page.wait_for_selector("[data-asked]")
    page.get_by_label("Amplitude, mm").fill("7")
    page.get_by_role("button", name="Search a heat sink").click()
    expect(page.locator("#heat-damper")).to_have_value("bare.toml")
    expect(page.get_by_label("Amplitude, mm")).to_have_value("7")
    mass = page.get_by_label("Mass, g")
    # A heat sink search from a bare damper requires this entry.
    expect(mass).to_have_attribute("aria-invalid", "true")
    page.get_by_role("button", name="Search", exact=True).click()
    expect(page.get_by_text("enter the largest mass of the fins")).to_be_visible()
    mass.fill("300")
    page.get_by_label("Length, mm").fill("30")
    with page.expect_request("**/api/jobs") as sent:
        page.get_by_role("button", name="Search", exact=True).click()
    assert sent.value.post_data_json["options"]["duty"].startswith("sine:7mm")
    page.wait_for_selector("#use-sink", timeout=300_000)
    page.locator("table .quiet", has_text=re.compile(r"^\d+ fins?$")).first.click()
    design = page.locator(".tile", has_text="chosen").inner_text()
    page.click("#use-sink")
    page.wait_for_selector("[data-asked]")
    chosen = page.locator("#heat-damper").input_value()
    assert re.fullmatch(r"bare-\d+-fins\.toml", chosen)
    page.get_by_role("tab", name="Heat sink").click()
    assert page.locator(".tile", has_text="chosen").inner_text() == design
    page.get_by_role("link", name="Controller").click()
    page.get_by_role("tab", name="Export").click()
    expect(page.locator("#export-damper")).to_have_value(chosen)
    with opened(browser, site[1].address) as later:
        go(later, "thermal?card=own")
        expect(later.locator("#heat-damper")).to_have_value(chosen)


def test_selected_runs_stay_selected_on_page(page):
    go(page, "model")
    page.locator("#chosen-runs summary").click()
    page.get_by_role("group", name="Fitted runs").get_by_label(re.compile("^rig")).uncheck()
    words = page.locator("#chosen-runs summary").inner_text()
    assert "2 of 3" in words
    go(page, "data")
    go(page, "model")
    expect(page.locator("#chosen-runs summary")).to_have_text(words)


@pytest.mark.nightly
def test_tracked_controller_is_preselected_for_export(page):
    """Tracking offers the controllers that the card supports. Export preselects the tracked controller."""
    plants = {}
    for card in ("own", "simulated", "chain", "real", "late"):
        go(page, f"controller?card={card}")
        plants[card] = page.locator("#track-plant").input_value()
        offered = page.get_by_role("group", name="Controllers").get_by_role("checkbox")
        names = page.get_by_role("group", name="Controllers").locator("label").all_inner_texts()
        assert ("paper" in names) == (card not in {"chain", "real"})
        assert ("recommended" in names) == (card not in {"late", "real"})
        assert any(offered.nth(k).is_checked() for k in range(offered.count()))
        assert page.locator("#missing-controllers").count() == (card in {"chain", "late", "real"})
    assert plants == {**{card: card for card in plants}, "simulated": "hard"}
    page.fill("#track-temperatures-degC", "20")
    page.get_by_role("button", name="Track", exact=True).click()
    page.get_by_role("button", name="Export paper").click(timeout=300_000)
    expect(page.locator("#export-controller")).to_have_value("paper")
    expect(page.locator("#export-content")).to_have_value("both")
    page.get_by_role("button", name="Make and verify").click()
    expect(page.locator("#platforms")).to_contain_text("The FMU runs on", timeout=300_000)
    assert "paper" in page.locator("#export-result").inner_text()
    shoot(page, "values-export")


def test_model_curves_differ_from_measured_curves(page):
    """Runs with current steps have another colour, and held-out runs a mark.

    The vertical axis of residuals ignores the transient at the beginning of a run.
    """
    go(page, "jobs")
    low, high = page.evaluate(RESIDUAL_RANGE)
    assert -60.0 < low < high < 60.0
    go(page, 'data?view.cards=["own"]')
    drawn = page.get_by_role("group", name="Runs drawn")
    expect(drawn.get_by_label("steady", exact=True)).to_be_checked()
    expect(drawn.get_by_label("rig", exact=True)).not_to_be_checked()
    go(page, 'data?view.cards=["own"]&view.runs=["stepped"]')
    page.wait_for_selector("#view-status[data-ms]")
    swatches = page.locator(".linked > .legend .swatch")
    expect(swatches).to_have_count(2)
    colours = swatches.evaluate_all("all => all.map((one) => one.style.getPropertyValue('--swatch'))")
    assert len(set(colours)) == 2
    # One row for the measured curve and one for the model
    expect(page.locator(".readout-table tr.held")).to_have_count(2)
    expect(page.locator(".readout-table tr.held").last).to_contain_text("held out")
    shoot(page, "values-loops", whole=True)


def test_unchecked_run_is_not_marked_good(page):
    """A run is marked as good only after its check, and a fit that has stopped is marked."""

    def partly_checked(route: Route) -> None:
        answer = route.fetch().json()
        runs = [{**run, "checked": run["name"] == "steady", "worst": None} for run in answer["runs"]]
        route.fulfill(json={**answer, "runs": runs})

    page.route("**/api/runs", partly_checked)
    go(page, "data?view.tab=Runs")
    expect(page.locator("tr", has_text="stepped").get_by_text("being checked")).to_be_visible()
    expect(page.locator("tr", has_text="steady").get_by_text("no findings")).to_be_visible()
    page.unroute("**/api/runs")
    go(page, "model?card=stopped")
    expect(page.locator("#fits tr", has_text="stopped").get_by_text("cancelled")).to_be_visible()
    expect(page.locator("[data-page=model]")).to_have_attribute("data-step", "old")
    page.unroute_all(behavior="ignoreErrors")


def test_common_gains_are_offered_for_channels_in_volts(site, page):
    """The user answers questions for columns and units with buttons, and enters gains in mm/V and kN/V."""
    root, client = site
    a_logger_file(root / "runs" / "raw.txt")
    page.goto("/#/data?file=raw.txt")
    page.get_by_label("Which column is the displacement? CHANNEL0").click()
    page.get_by_label("Which column is the force? CHANNEL1").click()
    page.get_by_label("In which unit is the displacement? V").click()
    gain = page.get_by_label("CHANNEL0 gain", exact=True)
    expect(gain).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_text("CHANNEL0 gain: enter how many mm are one volt")).to_be_visible()
    shoot(page, "values-volts", whole=True)
    gain.fill("10")
    page.get_by_label("CHANNEL1 in").select_option("kN/V")
    page.get_by_label("CHANNEL1 gain", exact=True).fill("0,980665")
    page.get_by_label("Sampling rate, Hz").fill("500")
    page.get_by_label("A new test begins at").fill("Resume")
    page.get_by_label("Currents of the tests, A").fill("0; 0,9")
    page.wait_for_selector("#preview .notice.good")
    page.click("#save-map")
    page.get_by_text("The map of raw.txt is saved").wait_for()
    runs = [run for run in client.read_all() if run["name"].startswith("raw")]
    assert [run["command"] for run in runs] == [0.0, 0.9]
    assert runs[0]["stroke_mm"] == pytest.approx(10.0, rel=0.02)


def test_address_hides_token_and_printed_page_names_files(browser, site):
    """The token is removed from the address, and a printed page names its folder and files.

    The navigation has no scroll bar.
    """
    _, client = site
    with opened(browser, client.address) as page:
        page.goto(f"{client.address}?token={TOKENS[client.address]}#/data")
        page.wait_for_selector("[data-shown=data] h1")
        assert "token" not in page.url
        for size in ((1400, 900), (1280, 800)):
            page.set_viewport_size({"width": size[0], "height": size[1]})
            rail = page.locator(".rail")
            assert rail.evaluate(
                "(e) => [e.scrollWidth - e.clientWidth, e.scrollHeight - e.clientHeight]"
            ) == [0, 0]
        shoot(page, "values-runs")
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        printed = page.locator("#printed").text_content() or ""
        assert "Damper: damper" in printed
        assert "steady.csv" in printed
        assert re.search(r"Printed: .*\d", printed)
        page.emulate_media(media="print")
        expect(page.locator("#printed")).to_be_visible()
        page.emulate_media(media="screen")
        page.locator("#folder").click()
        page.locator("#new-damper").fill("a/b")
        page.get_by_role("button", name="Create").click()
        expect(page.locator("#dampers .notice.fault")).to_be_visible()
        expect(page.locator("#new-damper")).to_have_value("a/b")
    with browser.new_context() as context:
        stranger = context.new_page()
        assert stranger.goto(client.address).status == 401
        expect(stranger.get_by_role("heading")).to_have_text("This address needs a token")
