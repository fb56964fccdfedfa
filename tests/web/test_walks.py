"""Less frequent actions: dropped files, uploaded cards, comparison, Cancel, and a lost server."""

from __future__ import annotations

import shutil
import socket
import time

import pytest
from playwright.sync_api import expect

from mrdamper.models.card_schema import read_card
from tests.support.campaigns import short_runs, write_runs
from tests.support.cards import rig_damper, write_card_of
from tests.support.pace import within_reach
from tests.web.browser import log_in, opened, shoot
from tests.web.served import is_alive, python_processes_of, served
from tests.web.walking import drop_files

pytestmark = pytest.mark.nightly

CAMPAIGN = (
    'motions = ["sine5mm1Hz"]\ncurrents_A = [0, 1]\ntemperatures_degC = [20]\nsteps = false\n'
    "held_out_temperatures_degC = []\nheld_out_motions = []\nduration_s = 2.0\n"
)
LONG_FIT: dict[str, object] = {"card": "long", "law": "chain"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Return a folder with short runs and two cards, and a client of its server."""
    root = tmp_path_factory.mktemp("walks") / "damper"
    write_runs(tmp_path_factory.mktemp("made") / "runs", short_runs())
    (root / "runs").mkdir(parents=True)
    write_runs(root / "runs", short_runs())
    for name, damper in (("strong", rig_damper()), ("cold", rig_damper(temperature_dependent=False))):
        (root / "cards" / name).mkdir(parents=True)
        write_card_of(root / "cards" / name / "card.json", damper)
    with served(root) as client:
        client.read_all()
        yield root, client


@pytest.fixture
def page(browser, rig):
    with opened(browser, rig[1].address) as window:
        yield window


def choose(page, button, path):
    """Press a button that opens a file dialog, and choose a file."""
    with page.expect_file_chooser() as asked:
        page.get_by_role("button", name=button, exact=True).first.click()
    asked.value.set_files(path)


def newest(client, kind):
    return next(job for job in client.get("/api/jobs")["jobs"] if job["kind"] == kind)


# --------------------------------------------------------------------------------------- dropping, bringing


def test_dropped_file_is_stored_and_removed(page, rig, tmp_path):
    root, _ = rig
    path = tmp_path / "dropped run, 2.csv"
    shutil.copy(next((root / "runs").glob("*.csv")), path)
    page.goto("/#/runs")
    page.wait_for_selector("#drop")
    drop_files(page, "#drop", [path])
    shown = page.get_by_role("link", name="dropped run, 2", exact=True)
    shown.first.wait_for()
    assert "over" not in (page.get_attribute("#drop", "class") or "").split()
    assert (root / "runs" / path.name).read_bytes() == path.read_bytes()
    page.on("dialog", lambda box: box.accept())
    page.get_by_label(f"Remove {path.name}").click()
    expect(shown).to_have_count(0)
    assert not (root / "runs" / path.name).exists()


def test_uploaded_card_is_compared_and_removed(page, rig, tmp_path):
    root, client = rig
    path = write_card_of(tmp_path / "brought one.json", rig_damper(lag=None))
    page.goto("/#/fit")
    choose(page, "Bring a card", path)
    page.get_by_role("button", name="Remove brought one").wait_for()
    assert read_card(root / "cards" / "brought one" / "card.json") == read_card(path)
    page.get_by_label("Overlay strong").check()
    page.get_by_label("Overlay brought one").check()
    page.get_by_role("button", name="Report of the difference").click()
    link = page.get_by_role("link", name="Open strong against brought one")
    link.wait_for()
    shoot(page, "compare")
    with page.context.expect_page() as waiting:
        link.click()
    report = waiting.value
    report.wait_for_load_state()
    assert "brought one" in report.inner_text("body")
    shoot(report, "compare-report")
    report.close()
    page.on("dialog", lambda box: box.accept())
    page.get_by_role("button", name="Remove brought one").click()
    page.get_by_role("button", name="Remove brought one").wait_for(state="detached")
    assert not (root / "cards" / "brought one").exists()
    assert newest(client, "compare")["state"] == "done"


# ------------------------------------------------------------------------------------------------ heating


# --------------------------------------------------------------------------------------------- keyboard


def test_keyboard_starts_a_fit(page, rig):
    """Tab follows the order of the page with visible focus; Space ticks a box and Enter starts the fit."""
    page.goto("/#/fit")
    page.wait_for_selector("#start-fit")
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
            page.keyboard.press("Space")  # Hold out the first run.
        if at["id"] == "start-fit":
            break
    assert steps[-1]["id"] == "start-fit"
    assert all(step["seen"] for step in steps)
    assert all(step["inside"] for step in steps)
    page.keyboard.press("Enter")
    page.wait_for_selector("#fit-tiles", timeout=120_000)
    answer = rig[1].get(f"/api/jobs/{newest(rig[1], 'fit')['id']}")
    assert answer["card"] == "by keyboard"
    assert [run["split"] for run in answer["answer"]["runs"]].count("held_out") == 1


# ---------------------------------------------------------------------------------------------- printing


# --------------------------------------------------------------------------- stopping, reloading, restarting


STOPPED: dict[str, dict[str, object]] = {
    "fit": {**LONG_FIT, "card": "stopped"},
    "heatsink": {"card": "strong", "by_field": True, "members": 200},
    "track": {"card": "strong"},
    "export": {"card": "strong"},
    "rig": {},
    "demo": {"quick": True},
}


@pytest.mark.parametrize("kind", list(STOPPED))
def test_cancelled_job_leaves_no_partial_files(page, rig, kind):
    root, client = rig
    before = {path.name for path in (root / "runs").iterdir()}
    job_id = client.job(kind, **STOPPED[kind])
    pid = int(client.until(job_id, {"running"})["pid"])
    page.goto("/#/jobs")
    page.wait_for_timeout(1500)  # The job computes.
    begin = time.monotonic()
    page.get_by_label(f"Cancel {job_id}").click()
    job = client.ended(job_id, 5.0)
    assert job["state"] == "cancelled"
    while is_alive(pid):
        assert time.monotonic() < begin + within_reach(6.0)
        time.sleep(0.02)
    print(f"{kind}: gone {time.monotonic() - begin:.2f} s after the press")
    page.locator("tr", has_text=job_id).get_by_text("cancelled", exact=True).first.wait_for()
    assert not [path for path in root.rglob(".mrdamper-*") if ".cache" not in path.parts]
    if kind == "rig":
        assert {path.name for path in (root / "runs").iterdir()} == before


def a_free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return str(one.getsockname()[1])


def test_open_page_recovers_after_power_cut(browser, tmp_path):
    """After a power cut during a fit the open page reports it, and earlier results are still available."""
    root, port = tmp_path / "damper", a_free_port()
    write_runs(root.parent / "made", short_runs())
    shutil.copytree(root.parent / "made", root / "runs")
    (root / "cards" / "strong").mkdir(parents=True)
    write_card_of(root / "cards" / "strong" / "card.json")
    with browser.new_context() as context:
        page = context.new_page()
        with served(root, "--port", port) as client:
            client.read_all()
            log_in(context, client.address)
            page.goto(f"{client.address}/#/heatsink?card=strong".replace("//#", "/#"))
            page.get_by_label("Length for the fins, mm").fill("30")
            page.click("#start-heatsink")
            page.wait_for_selector("#section svg")
            page.goto(f"{client.address}/#/fit".replace("//#", "/#"))
            page.fill("#fit-card", "long")
            page.get_by_role("form", name="What to fit").get_by_text("More", exact=True).click()
            page.click("#start-fit")
            page.wait_for_selector("figure:has-text('Cost while fitting') >> visible=true")
            client.kill()
        with served(root, "--port", port) as client:
            page.get_by_role("status").get_by_text(
                "was interrupted: the server"
            ).wait_for()  # The page is not reloaded.
            shoot(page, "fit-interrupted")
            expect(page.locator("#busy")).to_be_hidden()
            page.goto(f"{client.address}/#/heatsink?card=strong".replace("//#", "/#"))
            page.wait_for_selector("#section svg")  # The finished search is displayed.
    deadline = time.monotonic() + within_reach(8.0)
    while python_processes_of(root):
        assert time.monotonic() < deadline
        time.sleep(0.1)


# ------------------------------------------------------------------------------------------------ two at once
