"""Rarer actions of users: dropped files, channel maps, keyboard, several dampers, and a killed server."""

from __future__ import annotations

import shutil
import socket
import time

import pytest
from playwright.sync_api import expect

from mrdamper.data.readers import read_file
from mrdamper.models.card_schema import read_card
from tests.support.campaigns import short_runs, write_csv, write_runs
from tests.support.cards import rig_damper, write_card_of
from tests.support.pace import within_reach
from tests.web.browser import log_in, opened, shoot
from tests.web.served import python_processes_of, served, wait_until
from tests.web.walking import drop_files, sine_columns

pytestmark = pytest.mark.nightly

TABS = 12  # A browser opens at most six connections to a server.
REQUEST_MAX_S = 0.5
SECOND = "Dämpfer 2 (RD-8040)"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return a folder with short runs and two cards, and a client of its server."""
    root = tmp_path_factory.mktemp("walks") / "damper"
    (root / "runs").mkdir(parents=True)
    write_runs(root / "runs", short_runs())
    for name, damper in (("strong", rig_damper()), ("cold", rig_damper(temperature_dependent=False))):
        write_card_of(root / "cards" / name / "card.json", damper)
    with served(root) as client:
        yield root, client


# -------------------------------------------------------------------------------------------- files and maps


def test_file_dropped_on_page_is_removed_and_restored(page, site, tmp_path):
    root, _ = site
    path = tmp_path / "dropped run, 2.csv"
    shutil.copy(next((root / "runs").glob("*.csv")), path)
    page.goto("/#/data?view.tab=Files")
    page.wait_for_selector("#drop")
    drop_files(page, "#drop", [path])
    shown = page.get_by_role("button", name=path.name, exact=True)
    shown.wait_for()
    assert "over" not in (page.get_attribute("#drop", "class") or "").split()
    assert (root / "runs" / path.name).read_bytes() == path.read_bytes()
    page.get_by_label(f"Remove {path.name}").click()
    expect(shown).to_have_count(0)
    assert not (root / "runs" / path.name).exists()
    page.locator("#toasts").get_by_role("button", name="Put back").click()
    shown.wait_for()
    assert (root / "runs" / path.name).read_bytes() == path.read_bytes()
    (root / "runs" / path.name).unlink()


@pytest.mark.parametrize(
    ("file", "offer"), [("ME5mm3Hz.txt", "utfsm logger"), ("ensaio.A.1.mat", "utfpr mat")]
)
def test_raw_file_channels_are_assigned_in_three_actions(browser, tmp_path, real_data, file, offer):
    """Three clicks (Look, Use, Save) apply a channel map of the package to a raw file.

    The page shows the force-displacement loop before the map is saved.
    """
    with served(tmp_path / "damper") as client, opened(browser, client.address) as page:
        path = tmp_path / "damper" / "runs" / file
        shutil.copy(real_data / "raw" / file, path)
        page.goto("/#/data")
        page.get_by_text("not understood").wait_for()
        page.get_by_label(f"Look into {file}").click()
        page.get_by_role("button", name=f"Use {offer}").click()
        page.wait_for_selector("#preview .notice.good")
        assert page.locator("figure.plot", has_text="Loop of these columns").is_visible()
        shoot(page, f"mapping-{offer.split()[0]}", whole=True)
        page.click("#save-map")
        page.get_by_text("is saved").wait_for()
        names = {run["name"] for run in client.read_all() if run["file"] == file}
        assert names == {run.name for run in read_file(path).recordings}


# ------------------------------------------------------------------------------------------- fits and dampers


def test_uploaded_card_is_compared_and_removed(page, site, tmp_path):
    root, _ = site
    path = write_card_of(tmp_path / "brought one.json", rig_damper(lag=None))
    page.goto("/#/model")
    page.get_by_label("Bring a card").set_input_files(path)
    page.get_by_role("button", name="Remove brought one").wait_for()
    assert read_card(root / "cards" / "brought one" / "card.json") == read_card(path)
    page.goto("/#/jobs?show.kind=compare&compare.first=strong&compare.second=brought one")
    page.click("#start-compare")
    link = page.locator("#job-result").get_by_role("link", name="Open the report")
    link.wait_for(timeout=240_000)
    with page.context.expect_page() as waiting:
        link.click()
    waiting.value.wait_for_load_state()
    assert "brought one" in waiting.value.inner_text("body")
    waiting.value.close()
    page.goto("/#/model")
    page.get_by_role("button", name="Remove brought one").click()
    page.get_by_role("button", name="Remove brought one").wait_for(state="detached")
    assert not (root / "cards" / "brought one").exists()


def test_fit_can_be_started_by_keyboard(page, site):
    """Tab moves the visible focus in page order, Space selects a box, and Enter starts the fit."""
    page.goto("/#/model")
    page.select_option("#fit-law", "bouc-wen")
    page.focus("#fit-card")
    page.keyboard.press("Control+A")
    page.keyboard.type("by keyboard")
    steps = []
    for _ in range(60):
        page.keyboard.press("Tab")
        at = page.evaluate(
            """() => { const e = document.activeElement, s = getComputedStyle(e);
              return {id: e.id, type: e.type ?? "", inside: Boolean(e.closest("form")),
                      seen: s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 1}; }"""
        )
        steps.append(at)
        if at["type"] == "checkbox" and sum(step["type"] == "checkbox" for step in steps) == 1:
            page.keyboard.press("Space")  # A selected run is held out from the fit.
        if at["id"] == "start-fit":
            break
    assert steps[-1]["id"] == "start-fit"
    assert all(step["seen"] and step["inside"] for step in steps)
    page.keyboard.press("Enter")
    page.wait_for_selector("#fit-tiles", timeout=240_000)
    newest = site[1].get("/api/state")["jobs"][0]["id"]
    answer = site[1].get(f"/api/jobs/{newest}")
    assert answer["card"] == "by keyboard"
    assert [run["split"] for run in answer["answer"]["runs"]].count("held_out") == 1
    page.select_option("#fit-law", "dahl")
    page.get_by_label("Again with the options of by keyboard").click()
    expect(page.locator("#fit-law")).not_to_have_value("dahl")
    expect(page.get_by_role("group", name="Hold out").get_by_role("checkbox", checked=True)).to_have_count(1)


def test_dampers_have_separate_files(browser, tmp_path):
    """A second damper has its own runs. The user can remove and restore the damper."""
    root = tmp_path / "first"
    (root / "runs").mkdir(parents=True)
    write_csv(root / "runs" / "one.csv", sine_columns(force_N=300.0))
    with served(root) as client, opened(browser, client.address) as page:
        page.goto("/")
        page.locator("#folder", has_text="first").click()
        page.locator("#new-damper").fill(SECOND)
        shoot(page, "dampers")
        page.get_by_role("button", name="Create").click()
        expect(page.locator("#folder")).to_have_text(SECOND)
        expect(page.get_by_text("No runs yet")).to_be_visible()
        write_csv(tmp_path / "second.csv", sine_columns(force_N=500.0))
        page.locator("#picker").set_input_files(tmp_path / "second.csv")
        expect(page.get_by_label("second", exact=True)).to_be_checked()
        own = root / "dampers" / SECOND
        assert (own / "runs" / "second.csv").is_file()
        # The page must notice a card that another program writes.
        write_card_of(own / "cards" / "soft" / "card.json")
        expect(page.get_by_label("soft", exact=True)).to_be_visible()
        page.locator("#folder").click()
        page.get_by_role("link", name="first", exact=True).click()
        expect(page.locator("#folder")).to_have_text("first")
        expect(page.get_by_label("one", exact=True)).to_be_visible()
        expect(page.get_by_label("second", exact=True)).to_have_count(0)
        page.locator("#folder").click()
        page.get_by_label(f"Remove {SECOND}").click()
        back = page.locator("#toasts").get_by_role("button", name="Put back")
        back.wait_for()
        assert not own.exists()
        back.click()
        page.locator("#folder").click()
        expect(page.get_by_role("link", name=SECOND)).to_be_visible()
        assert (own / "runs" / "second.csv").is_file()


def test_open_page_recovers_after_power_failure(browser, tmp_path):
    """After a power failure during a fit, the page reports the lost fit and still shows earlier results."""
    root = tmp_path / "damper"
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = str(one.getsockname()[1])
    (root / "runs").mkdir(parents=True)
    write_runs(root / "runs", short_runs())
    write_card_of(root / "cards" / "strong" / "card.json")
    with browser.new_context() as context:
        page = context.new_page()
        with served(root, "--port", port) as client:
            log_in(context, client.address)
            page.goto(f"{client.address}#/thermal?card=strong&heat.tab=Heat sink")
            page.get_by_label("Length, mm").fill("30")
            page.click("#start-heatsink")
            page.wait_for_selector("#use-sink", timeout=120_000)
            page.goto(f"{client.address}#/model")
            page.fill("#fit-card", "long")
            page.click("#start-fit")
            page.wait_for_selector("[data-job=fit] progress")
            page.wait_for_timeout(1500)
            client.kill()
            expect(page.locator("#lost")).to_be_visible()
        with served(root, "--port", port) as client:
            # The page reconnects without being reloaded.
            page.get_by_text("the server was stopped before the job was done").first.wait_for()
            shoot(page, "fit-interrupted")
            expect(page.locator("#lost")).to_be_hidden()
            expect(page.locator("#busy")).to_be_hidden()
            page.goto(f"{client.address}#/thermal?card=strong&heat.tab=Heat sink")
            page.wait_for_selector("#use-sink")  # The page shows the result of the search before the failure.
    wait_until(lambda: not python_processes_of(root), 8.0)


def test_server_answers_many_tabs_quickly(browser, site):
    """All tabs show the progress of the same fit. Cancel and the slowest request take less than 0.5 s."""
    client = site[1]
    job = client.job("fit", card="long", law="chain")
    client.until(job, {"running"})
    with browser.new_context(base_url=client.address) as context:
        log_in(context, client.address)
        tabs = [context.new_page() for _ in range(TABS)]
        for tab in tabs:
            tab.goto("/#/model")
            tab.wait_for_selector("[data-job=fit] progress")
        waits = [
            tab.evaluate(
                """async (address) => {
                  const began = performance.now();
                  await (await fetch(address)).text();
                  return performance.now() - began;
                }""",
                address,
            )
            / 1e3
            for tab in tabs
            for address in ("/api/state", "/api/runs", "/api/changes", "/api/forms")
        ]
        begin = time.monotonic()
        with tabs[-1].expect_response("**/cancel") as answered:
            tabs[-1].get_by_role("button", name="Cancel").click()
        assert answered.value.ok
        cancelled_s = time.monotonic() - begin
        for tab in tabs:
            expect(tab.locator("[data-job=fit] progress")).to_have_count(0, timeout=30_000)
    print(f"{TABS} tabs: worst request {max(waits):.2f} s, Cancel answered in {cancelled_s:.2f} s")
    assert max(waits) < within_reach(REQUEST_MAX_S)
    assert cancelled_s < within_reach(REQUEST_MAX_S)
    assert client.ended(job)["state"] == "cancelled"
