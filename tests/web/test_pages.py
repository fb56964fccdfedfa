"""Pages in a browser: plots, fits, layout and safe texts.

``MRDAMPER_SHOTS=1`` writes screenshots to build/web/. Look at them after a change of a page.
"""

from __future__ import annotations

import hashlib
import json
import re

import numpy as np
import pytest
from playwright.sync_api import expect

from mrdamper.models.card_schema import read_card
from tests.support.cards import write_card_of
from tests.web.browser import SCREENS, opened, shoot
from tests.web.served import series_of, served
from tests.web.walking import AXES, CUT, FAINT, STATIC, UNNAMED, VIEWS, download, go, plot, saved_table

pytestmark = pytest.mark.system

RUN = "nominal_020C_1.00A_sine5mm1Hz"
MARKUP = "<img src=x onerror='window.ran = 1'>"
HEIGHT_MAX_px, SERVED_MAX_kB = 1800, 220
PATHS = """async (kind) => {
  const { finished, seriesPath, thinned } = await import("/static/plot.js");
  const n = 1_000_000;
  const x = new Float32Array(n), y = new Float32Array(n);
  for (let k = 0; k < n; k += 1) {
    x[k] = kind === "series" ? k : 300 + 200 * Math.cos(k / 40);
    y[k] = 100 + 50 * Math.sin(k / 40);
  }
  y[123457] = 290;
  let points = [];
  if (kind === "loop") {
    const kept = finished(thinned({ x, y, kind }, { x: [0, 600], y: [0, 300] }, null, 600, 300));
    points = kept.y.filter((value) => !Number.isNaN(value));
  } else {
    const before = window.Path2D;
    window.Path2D = class { moveTo(a, b) { points.push(300 - b); } lineTo(a, b) { points.push(300 - b); } };
    seriesPath({ bbox: { left: 0, top: 0, width: 600, height: 300 },
      scales: { x: { min: 0, max: n }, y: { min: 0, max: 300 } } }, { x, y });
    window.Path2D = before;
  }
  const ends = points.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [1e9, -1e9]);
  return [points.length, ...ends];
}"""


def test_downloaded_plot_has_server_values(page, site):
    """The CSV file of a loop has the values of the server and the units of the axes."""
    page.goto(f'/#/data?view.runs=["{RUN}"]')
    page.wait_for_selector("#view-status[data-ms]")
    page.wait_for_selector("figure[data-drawing]", state="detached")
    head, columns = series_of(site[1].ask("GET", f"/api/runs/{RUN}/series").content)
    figure = plot(page, "Displacement loops")
    header, rows = saved_table(page, figure)
    assert header[0] == "displacement, mm"
    assert "force, N" in header[1]
    assert len(rows) == head["samples"]
    found = np.array(rows, dtype=float)
    assert found[:, 0] == pytest.approx(columns["displacement_mm"], rel=1e-6, abs=1e-6)
    assert found[:, 1] == pytest.approx(columns["force_N"], rel=1e-6, abs=1e-4)
    assert download(page, figure.get_by_role("button", name="PNG").click).startswith(b"\x89PNG\r\n")


@pytest.mark.parametrize("kind", ["series", "loop"])
def test_decimated_plot_keeps_single_spike(page, kind):
    """The path of a million samples is short, but a spike of one sample remains."""
    page.goto("/#/jobs")
    count, low, high = page.evaluate(PATHS, kind)
    assert count < 30_000
    assert low == pytest.approx(50.0, abs=1.0)
    assert high == pytest.approx(290.0, abs=0.01)


def test_fit_on_page_writes_readable_card(page, site):
    """The command line can read the card of a fit on the page. The result of the fit fits one screen."""
    root, _ = site
    page.goto("/#/model")
    page.fill("#fit-card", "fitted")
    page.fill("#fit-hold-out", "*_060C_*")
    page.select_option("#fit-law", "dahl")  # The default compares all laws, which takes longer.
    page.click("#start-fit")
    page.wait_for_selector("#fit-tiles", timeout=240_000)
    page.wait_for_selector("#view-status[data-ms]")
    height = page.evaluate("document.documentElement.scrollHeight")
    print(f"result of a fit: {height} px")
    assert height <= HEIGHT_MAX_px
    shoot(page, "fit", whole=True)
    expect(page.locator("[data-page=model]")).to_have_attribute("data-step", "done")
    page.get_by_role("tab", name="Error by run").click()
    assert page.locator("tr.held:has(a)").count() == 7
    page.get_by_role("tab", name="Coefficients").click()
    shown = page.locator("table:has-text('standard error') tbody tr").all_inner_texts()
    card = read_card(root / "cards" / "fitted" / "card.json")
    assert len(shown) >= len(card.damper.coefficients)
    assert card.damper.temperature_dependent
    page.reload()
    page.wait_for_selector("#fit-tiles", timeout=120_000)
    expect(page.locator("h2").first).to_contain_text("fitted")


@pytest.mark.nightly
@pytest.mark.parametrize("size", SCREENS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_page_fits_screen(browser, site, size, scheme):
    """No element is wider than the screen, text has contrast, controls have names, and axes have units."""
    with opened(browser, site[1].address, size=size, scheme=scheme) as page:
        for _, address in VIEWS:
            go(page, address)
            if "Heating" in address:
                page.wait_for_selector("[data-asked]")
            assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), address
            assert page.evaluate(CUT) == [], address
            assert page.evaluate(UNNAMED) == [], address
            assert page.evaluate(FAINT) == [], address
            for words in page.evaluate(AXES):
                assert re.search(r"\. [^.]+, [^ .,]+.* over [^.]+, [^ .,]+\. Arrow keys", words), words
            shoot(page, f"{re.sub(r'[^a-z]+', '-', address.lower())}-{scheme}-{size[0]}", whole=True)


def test_javascript_never_parses_markup():
    """No JavaScript module parses markup or names another host. All modules together are small."""
    for path in STATIC.glob("*.js"):
        text = path.read_text()
        assert not re.search(r"(inner|outer|insertAdjacent)HTML|document\.write|\beval\(|new Function", text)
        assert not re.search(r"https?://", text)
    page = (STATIC / "index.html").read_text()
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son\w+=", page)
    served_kB = sum(path.stat().st_size for kind in ("js", "css") for path in STATIC.rglob(f"*.{kind}")) / 1e3
    print(f"served JavaScript and CSS: {served_kB:.0f} kB")
    assert served_kB <= SERVED_MAX_kB


def test_vendored_files_have_documented_hashes():
    lines = (STATIC / "vendor" / "SHA256SUMS").read_text().splitlines()
    digests = {name: digest for digest, name in (line.split() for line in lines)}
    files = [path for path in (STATIC / "vendor").iterdir() if path.suffix in {".js", ".css"}]
    assert {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files} == digests


@pytest.fixture(scope="module")
def haunted(tmp_path_factory):
    """Return a client of a folder whose files, runs, cards and jobs have HTML in their names."""
    root = tmp_path_factory.mktemp("strangers") / "damper"
    name = MARKUP.replace("/", "")
    job = root / "results" / "check-001"
    for place in (root / "runs", root / "inputs", root / "cards" / name, job):
        place.mkdir(parents=True)
    rows = "".join(f"{0.01 * k:.2f},{k % 7},{k % 5},1,{k}\n" for k in range(60))
    table = f"time_s,displacement_mm,force_N,current_A,{MARKUP}\n{rows}"
    (root / "runs" / f"{name}.csv").write_text(table, encoding="utf-8")
    (root / "inputs" / f"{name}.toml").write_text(f'motions = ["{MARKUP}"]\n', encoding="utf-8")
    write_card_of(root / "cards" / name / "card.json")
    texts = {"id": job.name, "kind": "check", "state": "failed", "message": MARKUP, "card": MARKUP}
    times = dict.fromkeys(("asked_at", "started_at", "ended_at"), "2026-01-01T00:00:00Z")
    (job / "job.json").write_text(json.dumps({**texts, **times, "options": {"card": MARKUP}}))
    with served(root) as client:
        yield client


@pytest.mark.nightly
def test_markup_in_names_is_shown_as_text(browser, haunted):
    with opened(browser, haunted.address) as page:
        for name, address in VIEWS:
            go(page, address)
            if "Files" in address or name == "jobs":
                expect(page.locator("main")).to_contain_text("onerror='window.ran = 1'>")
            assert page.locator("main img, main script").count() == 0, address
        page.goto("/#/data?view.tab=Files")
        page.get_by_label(re.compile("Look into <img")).click()
        page.wait_for_selector("#save-map")  # Column headers of the file also contain markup.
        assert MARKUP in page.inner_text("#sheet")
        assert page.locator("main img").count() == 0
        assert page.evaluate("window.ran") is None
