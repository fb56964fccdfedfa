"""Walks beside the main way: drop, bring, compare, stop, print, lose the server, two windows at once."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time

import numpy as np
import pytest
from playwright.sync_api import expect

from mrdamper.jobs.options import HeatsinkOptions
from mrdamper.models.card_schema import read_card
from mrdamper.registry import JOBS
from tests.support.heated import DRAWING
from tests.support.pace import within_reach
from tests.support.rigs import short_runs, write_runs
from tests.support.tracked import a_damper, write_a_card
from tests.web.browser import SHOTS, log_in, opened, shoot
from tests.web.served import is_alive, python_processes_of, served
from tests.web.walking import PAGES, drop_files, move, plot, saved_table

pytestmark = pytest.mark.nightly

CAMPAIGN = (
    'motions = ["sine5mm1Hz"]\ncurrents_A = [0, 1]\ntemperatures_degC = [20]\nsteps = false\n'
    "held_out_temperatures_degC = []\nheld_out_motions = []\nduration_s = 2.0\n"
)
LONG_FIT: dict[str, object] = {"card": "long", "method": "genetic", "law": "bouc-wen"}


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Return a folder with short runs and two cards, and a client of its server."""
    root = tmp_path_factory.mktemp("walks") / "damper"
    write_runs(tmp_path_factory.mktemp("made") / "runs", short_runs())
    (root / "runs").mkdir(parents=True)
    write_runs(root / "runs", short_runs())
    for name, damper in (("strong", a_damper()), ("cold", a_damper(temperature_dependent=False))):
        (root / "cards" / name).mkdir(parents=True)
        write_a_card(root / "cards" / name / "card.json", damper)
    with served(root) as client:
        client.read_all()
        yield root, client


@pytest.fixture
def page(browser, rig):
    with opened(browser, rig[1].address) as window:
        yield window


def choose(page, button, path):
    """Press a button that asks for a file, and give it one."""
    with page.expect_file_chooser() as asked:
        page.get_by_role("button", name=button, exact=True).first.click()
    asked.value.set_files(path)


def newest(client, kind):
    return next(job for job in client.get("/api/jobs")["jobs"] if job["kind"] == kind)


# --------------------------------------------------------------------------------------- dropping, bringing


def test_a_file_dropped_beside_the_place_for_it_does_not_lose_the_page(page, tmp_path):
    """A browser opens what is dropped where nobody takes it: the page and what was typed would be gone."""
    path = tmp_path / "beside.csv"
    path.write_text("x", encoding="utf-8")
    page.goto("/#/fit")
    page.wait_for_selector("#start-fit")
    taken = page.evaluate(
        """() => ["dragover", "drop"].map((name) => {
          const dragged = {bubbles: true, cancelable: true, dataTransfer: new DataTransfer()};
          const event = new DragEvent(name, dragged);
          document.querySelector("h1").dispatchEvent(event);
          return event.defaultPrevented;
        })"""
    )
    assert taken == [True, True]


def test_a_file_is_dropped_shown_and_removed(page, rig, tmp_path):
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


def test_a_card_is_brought_compared_and_removed(page, rig, tmp_path):
    root, client = rig
    path = write_a_card(tmp_path / "brought one.json", a_damper(lag=None))
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


def test_what_is_no_card_is_told_and_not_kept(page, rig, tmp_path):
    path = tmp_path / "bad.json"
    path.write_text('{"schema_version": 1}', encoding="utf-8")
    page.goto("/#/fit")
    choose(page, "Bring a card", path)
    page.locator("#toasts .fault").wait_for()
    assert "bad" in page.inner_text("#toasts .fault")
    assert not (rig[0] / "cards" / "bad").exists()


def _first_temperature(page):
    return float(saved_table(page, plot(page, "Temperatures"))[1][0][1])


def test_a_drawing_is_brought_and_its_ambient_taken(page, rig, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        DRAWING.read_text(encoding="utf-8").replace("ambient_degC = 20", "ambient_degC = 33"),
        encoding="utf-8",
    )
    page.goto("/#/heating?card=strong")
    page.wait_for_selector("figure[data-asked]")
    before = page.get_attribute("figure[data-asked]", "data-asked")
    choose(page, "Bring a drawing (TOML)", path)
    expect(page.get_by_label("Ambient", exact=True)).to_have_value("33")
    assert page.get_by_label("Damper's drawing").input_value() == "mine.toml"
    assert (rig[0] / "inputs" / "mine.toml").read_bytes() == path.read_bytes()
    page.wait_for_selector(f"figure[data-asked]:not([data-asked='{before}'])")
    until = time.monotonic() + within_reach(15.0)
    while abs(_first_temperature(page) - 33.0) > 0.5:  # of the drawing, but at the ambient before
        assert time.monotonic() < until
        page.wait_for_timeout(300.0)


def test_a_campaign_of_one_s_own_fills_the_folder(browser, tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    with served(tmp_path / "empty") as client, opened(browser, client.address) as page:
        page.goto("/")
        page.get_by_text("Runs of the virtual rig").click()
        choose(page, "Bring a campaign (TOML)", path)
        expect(page.get_by_label("Campaign")).to_have_value("tiny.toml")
        page.get_by_role("button", name="Run the campaign").click()
        expect(page.locator("h2", has_text="2 runs")).to_be_visible(timeout=20_000)
        shoot(page, "runs-campaign")


def test_a_rheometer_s_table_becomes_a_fluid_that_a_fit_can_take(page, rig, tmp_path):
    from tests.jobs.test_fluid import CELSIUS, VISCOSITY, write

    write(tmp_path / "viscosity.csv", "temperature_degC,viscosity_mPas", CELSIUS, 1e3 * VISCOSITY)
    page.goto("/#/jobs")
    choose(page, "Bring an input", tmp_path / "viscosity.csv")
    page.get_by_text("A fluid from rheometer tables").click()
    expect(page.get_by_label("viscosity.csv", exact=True)).to_be_checked()
    page.get_by_role("button", name="Fit a fluid").click()
    page.get_by_label(re.compile("Use the fluid of fluid-")).click()
    page.get_by_text("lies with the inputs now").wait_for()
    shoot(page, "jobs-fluid")
    page.goto("/#/fit")
    job = newest(rig[1], "fluid")["id"]
    page.get_by_label("Fluid, where runs do not tell").select_option(f"{job}.toml")
    kept = (rig[0] / "inputs" / f"{job}.toml").read_bytes()
    assert kept == rig[1].ask("GET", f"/api/jobs/{job}/files/fluid.toml").content


# ------------------------------------------------------------------------------------------------ heating


def test_the_time_to_the_limit_is_where_the_curve_crosses_it_and_the_full_study_says_the_same(page, rig):
    page.goto("/#/heating?card=strong")
    page.wait_for_selector("figure[data-asked]")
    move(page, "Frequency", 1.5)
    move(page, "Ambient", 40)
    asked = page.get_attribute("figure[data-asked]", "data-asked")
    page.get_by_label("go on past the fluid's limit").check()
    page.wait_for_selector(f"figure[data-asked]:not([data-asked='{asked}'])")
    rows = np.array(saved_table(page, plot(page, "Temperatures"))[1], dtype=float)
    minutes, fluid = rows[:, 0], rows[:, 1]
    k = int(np.argmax(fluid > 130.0))
    crossing = float(np.interp(130.0, fluid[k - 1 : k + 1], minutes[k - 1 : k + 1]))
    said = page.locator("#heat-tiles .tile", has_text="time to the limit").locator("b").inner_text()
    told = re.findall(r"[\d.]+", said)
    seconds = 60.0 * float(told[0]) + float(told[1]) if "min" in said and len(told) > 1 else float(told[0])
    assert seconds == pytest.approx(60.0 * crossing, abs=2.0)
    shoot(page, "heating-limit")
    page.click("#full-study")
    page.wait_for_selector("iframe.report", timeout=90_000)
    job = newest(rig[1], "heat")
    answer = rig[1].get(f"/api/jobs/{job['id']}")["answer"]
    assert answer["time_to_limit_s"] == pytest.approx(seconds, abs=2.0)
    report = page.frame_locator("iframe.report")
    report.locator("h1").first.wait_for()
    assert report.locator("svg, img").count() > 0
    shoot(page, "heating-study", whole=True)


# --------------------------------------------------------------------------------------------- keyboard


def test_a_fit_is_asked_for_with_the_keyboard_alone(page, rig):
    """Tab through the form in the order of the page, see where one is, tick with Space, start with Enter."""
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
            page.keyboard.press("Space")  # the first run is held out
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


def test_every_page_can_be_reached_and_left_with_tab(page):
    """No page keeps the focus: from its first to its last control and on, and where one is can be seen."""
    for name in PAGES:
        page.goto(f"/#/{name}")
        page.wait_for_selector(f"[data-shown={name}] h1")
        page.wait_for_timeout(150)
        page.evaluate("document.querySelector('main').focus()")
        hidden = []
        for _ in range(400):
            page.keyboard.press("Tab")
            at = page.evaluate(
                """() => { const e = document.activeElement;
                  if (!e.closest("main")) return null;
                  const s = getComputedStyle(e), r = e.getBoundingClientRect();
                  return [s.outlineStyle !== "none" && r.width > 0, e.outerHTML.slice(0, 120)]; }"""
            )
            if at is None:
                break
            if not at[0]:
                hidden.append(at[1])
        else:
            raise AssertionError(f"{name}: the focus never leaves the page")
        assert hidden == [], name


# ---------------------------------------------------------------------------------------------- printing


@pytest.mark.parametrize("scheme", [pytest.param("light", marks=pytest.mark.nightly), "dark"])
def test_a_page_is_printed_on_white_without_what_can_only_be_pressed(browser, rig, tool, tmp_path, scheme):
    to_text, to_picture = tool("pdftotext"), tool("pdftoppm")
    with opened(browser, rig[1].address, scheme=scheme) as page:
        page.goto("/#/heating?card=strong")
        page.wait_for_selector("figure[data-asked]")
        paper = tmp_path / "heating.pdf"
        paper.write_bytes(page.pdf(prefer_css_page_size=True))
        drawn = page.locator(".plot-paper").count()
    words = subprocess.run(
        [to_text, "-layout", paper, "-"], capture_output=True, text=True, check=True
    ).stdout
    for said in ("Heating", "time to the limit", "temperature, °C", "time, min", "fluid"):
        assert said in words
    for said in ("Skip to the page", "Jobs", "Full study with", "SVG"):
        assert said not in words
    assert drawn == 0  # the plots are canvases again
    picture = subprocess.run([to_picture, "-r", "20", "-gray", paper], capture_output=True, check=True).stdout
    _, size, _, pixels = picture.split(b"\n", 3)
    width, height = map(int, size.split())
    assert np.median(np.frombuffer(pixels[: width * height], np.uint8)) > 250  # mostly white
    assert words.count("\f") <= 3


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
def test_every_long_job_is_stopped_from_the_page_and_leaves_nothing_half_done(page, rig, kind):
    root, client = rig
    before = {path.name for path in (root / "runs").iterdir()}
    job_id = client.job(kind, **STOPPED[kind])
    pid = int(client.until(job_id, {"running"})["pid"])
    page.goto("/#/jobs")
    page.wait_for_timeout(1500)  # well into its work
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


def rows_in(path):
    return path.read_bytes().count(b"\n") if path.exists() else 0


def wait_until(page, holds, seconds=30.0):
    end = time.monotonic() + within_reach(seconds)
    while not holds():
        assert time.monotonic() < end
        page.wait_for_timeout(10)


def test_a_search_whose_process_died_is_resumed_to_the_same_front(page, rig, tmp_path):
    root, client = rig
    chosen = HeatsinkOptions(by_field=False, least_thickness_mm=2.0)
    duty = "sine:15mm:1Hz:2A:120s"
    job = client.job("heatsink", card="strong", duty=duty, by_field=False, least_thickness_mm=2.0)
    kept = root / "results" / f"{job}.progress"
    wait_until(page, lambda: rows_in(kept) > 2)
    os.kill(int(client.get(f"/api/jobs/{job}")["pid"]), signal.SIGKILL)
    assert client.ended(job)["state"] == "failed"
    page.goto(f"/#/heatsink?card=strong&job={job}")
    expect(page.locator("[data-job=sink] .notice.fault")).to_contain_text("what it had finished is kept")
    page.get_by_role("button", name=f"Resume {job}").click()
    page.wait_for_selector("#section svg")
    assert not kept.exists()
    card = root / "cards" / "strong" / "card.json"
    JOBS["heatsink"].perform({"card": card, "drawing": "paper", "duty": duty}, chosen, out=tmp_path / "whole")
    found = (root / "results" / job / "front.csv").read_text(encoding="utf-8")
    assert found == (tmp_path / "whole" / "front.csv").read_text(encoding="utf-8")
    assert client.get(f"/api/jobs/{job}")["resumed"] == 1


def test_a_job_that_is_removed_takes_along_what_it_had_left(rig):
    root, client = rig
    job = client.job("heatsink", card="strong", by_field=True, members=200)
    kept = root / "results" / f"{job}.progress"
    end = time.monotonic() + within_reach(30.0)
    while rows_in(kept) < 2:
        assert time.monotonic() < end
        time.sleep(0.02)
    client.ask("POST", f"/api/jobs/{job}/cancel")
    assert client.ended(job)["resumable"]
    assert kept.exists()
    assert client.ask("DELETE", f"/api/jobs/{job}").status_code == 200
    assert not kept.exists()


def a_free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return str(one.getsockname()[1])


def test_a_page_that_stays_open_finds_the_server_again(browser, tmp_path):
    """A power cut in the middle of a fit: the open page says so; what was done before is still there."""
    root, port = tmp_path / "damper", a_free_port()
    write_runs(root.parent / "made", short_runs())
    shutil.copytree(root.parent / "made", root / "runs")
    (root / "cards" / "strong").mkdir(parents=True)
    write_a_card(root / "cards" / "strong" / "card.json")
    with browser.new_context() as context:
        page = context.new_page()
        with served(root, "--port", port) as client:
            client.read_all()
            log_in(context, client.address)
            page.goto(f"{client.address}/#/heatsink?card=strong".replace("//#", "/#"))
            page.get_by_label("Thinnest fin, mm").fill("3")
            page.click("#start-sink")
            page.wait_for_selector("#section svg")
            page.goto(f"{client.address}/#/fit".replace("//#", "/#"))
            page.fill("#fit-card", "long")
            page.get_by_role("form", name="What to identify").get_by_text("More", exact=True).click()
            page.get_by_label("Search").select_option("genetic")
            page.click("#start-fit")
            page.wait_for_selector("figure:has-text('Cost while fitting') >> visible=true")
            client.kill()
        with served(root, "--port", port) as client:
            page.get_by_role("status").get_by_text(
                "was interrupted: the server"
            ).wait_for()  # without a reload
            shoot(page, "fit-interrupted")
            expect(page.locator("#busy")).to_be_hidden()
            page.goto(f"{client.address}/#/heatsink?card=strong".replace("//#", "/#"))
            page.wait_for_selector("#section svg")  # the finished search
    deadline = time.monotonic() + within_reach(8.0)
    while python_processes_of(root):
        assert time.monotonic() < deadline
        time.sleep(0.1)


# ------------------------------------------------------------------------------------------------ two at once


def test_two_browsers_and_a_long_fit_keep_quick_and_lose_nothing(browser, rig):
    """Asked: no request over one second apart from uploads. The worst that two windows ask is printed."""
    _, client = rig
    run = short_runs()[2].name
    fit = client.job("fit", card="long", law="double-bouc-wen", draws=100_000)
    client.until(fit, {"running"})
    while client.get(f"/api/jobs/{fit}")["progress"] is None:
        time.sleep(0.05)
    asked: list[tuple[float, str]] = []

    def note(request) -> None:
        if not request.url.endswith("/events"):
            asked.append((request.timing["responseEnd"], f"{request.method} {request.url}"))

    with opened(browser, client.address) as one, opened(browser, client.address, scheme="dark") as two:
        for window in (one, two):
            window.on("requestfinished", note)
            window.goto("/#/runs")
        for turn in range(2):
            for name in PAGES:
                for window in (one, two):
                    window.goto(f"/#/{name}")
                for window in (one, two):
                    window.wait_for_selector(f"[data-shown={name}] h1")
            for window in (one, two):
                window.goto(f"/#/loops?run={run}&turn={turn}")
            for window in (one, two):
                window.wait_for_selector("#loops-said[data-ms]")
            for window in (one, two):
                window.goto("/#/heating?card=strong")
            for window in (one, two):
                window.wait_for_selector("figure[data-asked]")
                for degrees in range(21, 26):
                    move(window, "Ambient", degrees)
        checks = [client.job("check"), client.job("check")]
        for job_id in checks:
            assert client.ended(job_id)["state"] == "done"
        assert client.get(f"/api/jobs/{fit}")["state"] == "running"
        for window in (one, two):
            window.goto("/#/jobs")
            for job_id in (fit, *checks):
                window.locator("tr", has_text=job_id).wait_for()
    client.ask("POST", f"/api/jobs/{fit}/cancel")
    client.ended(fit)
    longest, what = max(asked)
    print(f"two browsers and a fit: {len(asked)} requests, the longest {longest:.0f} ms ({what})")
    SHOTS.mkdir(parents=True, exist_ok=True)
    told = {"requests": len(asked), "longest_ms": longest, "longest": what.split("?")[0]}
    (SHOTS / "two_browsers.json").write_text(json.dumps(told), encoding="utf-8")
    assert len(asked) > 60
    assert longest <= within_reach(1000.0)
