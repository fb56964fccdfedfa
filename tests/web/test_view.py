"""The linked view shows runs and cards with one cursor and one time span, which the address stores."""

from __future__ import annotations

import statistics

import numpy as np
import pytest
from playwright.sync_api import expect
from scipy.io import savemat

from tests.support.pace import within_reach
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import plot

pytestmark = pytest.mark.nightly

RUN = "nominal_020C_1.00A_sine5mm1Hz"
SAMPLES = 2_000_000
CURSOR_MS, FRAME_MS, DRAWN_S = 16.0, 100.0, 1.5

MOVES = """async () => {
  const named = (e) => e.textContent.includes("Force over time");
  const over = [...document.querySelectorAll("figure.plot")].find(named).querySelector(".u-over");
  const box = over.getBoundingClientRect();
  const took = [];
  for (let k = 0; k < 200; k += 1) {
    const clientX = box.left + box.width * (0.1 + 0.8 * ((k * 0.382) % 1));
    const began = performance.now();
    over.dispatchEvent(new MouseEvent("mousemove", { clientX, clientY: box.top + 50, bubbles: true }));
    took.push(performance.now() - began);
    await new Promise(requestAnimationFrame);
  }
  return took;
}"""
"""Time of 200 cursor moves until all linked plots show the cursor."""

WATCH = """() => {
  window.blocks = [];
  new PerformanceObserver((list) => window.blocks.push(...list.getEntries().map((e) => e.duration)))
    .observe({ type: "longtask" });
}"""


def _ready(page):
    page.wait_for_selector("#view-status[data-ms]")
    page.wait_for_selector("figure[data-drawing]", state="detached")


def _drag(page, title, begin, end):
    over = plot(page, title).locator(".plot-box")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 60 + begin * (box["width"] - 80), box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + 60 + end * (box["width"] - 80), box["y"] + 80, steps=5)
    page.mouse.up()


def _pictures(page):
    """Return the pixels of all plots."""
    page.mouse.move(2, 2)
    _ready(page)
    return page.evaluate("() => [...document.querySelectorAll('figure canvas')].map((e) => e.toDataURL())")


def test_two_million_samples_do_not_block_page(browser, tmp_path):
    """All samples are plotted in 1.5 s, the cursor moves in 16 ms, and a zoom blocks for less than 100 ms."""
    root = tmp_path / "long"
    (root / "runs").mkdir(parents=True)
    instants = np.arange(SAMPLES) / 1000.0
    phase = 2.0 * np.pi * 1.3 * instants
    x, v = 0.005 * np.sin(phase), np.cos(phase)
    noise = np.random.default_rng(7).normal(0.0, 8.0, SAMPLES)
    columns = {
        "time_s": instants,
        "displacement_mm": 1e3 * x,
        "force_N": 800.0 * np.tanh(4.0 * v) + 200.0 * v + 1500.0 * x + noise,
        "current_A": 1.0 + 0.5 * np.sin(0.01 * instants),
        "temperature_degC": 20.0 + 0.01 * instants,
    }
    savemat(root / "runs" / "long.mat", columns)
    with served(root) as client, opened(browser, client.address) as page:
        assert client.read_all()[0]["samples"] == SAMPLES
        page.goto("/#/jobs")
        page.wait_for_selector("[data-shown=jobs] h1")
        began = page.evaluate("performance.now()")
        page.evaluate("location.hash = '#/data?view.runs=[\"long\"]'")
        _ready(page)
        drawn_s = (page.evaluate("performance.now()") - began) / 1e3
        assert page.get_attribute("#view-status", "data-samples") == str(SAMPLES)
        moves = page.evaluate(MOVES)
        page.evaluate(WATCH)
        for begin in (0.1, 0.3, 0.2):
            _drag(page, "Force over time", begin, begin + 0.5)
            page.wait_for_url(lambda url: "view.t=" in url)
            page.get_by_role("button", name="Undo zoom").click()
            page.wait_for_url(lambda url: "view.t=" not in url)
            _ready(page)
        blocks = page.evaluate("window.blocks")
        shoot(page, "view-long", whole=True)
    median, longest = statistics.median(moves), max(blocks, default=0.0)
    print(f"2,000,000 samples: {drawn_s:.2f} s, cursor {median:.1f} ms, longest frame {longest:.0f} ms")
    assert drawn_s <= within_reach(DRAWN_S)
    assert median <= within_reach(CURSOR_MS)
    assert longest <= within_reach(FRAME_MS)


def test_url_restores_view_and_back_button_undoes_changes(browser, site, page):
    """Another browser restores runs, card, cycles, hidden curves and zooms from the URL of the page."""
    page.goto(f'/#/data?view.runs=["{RUN}"]&view.cards=["strong"]')
    _ready(page)
    whole = _pictures(page)
    _drag(page, "Force over time", 0.3, 0.7)
    page.wait_for_url(lambda url: "view.t=" in url)
    part = _pictures(page)
    assert part != whole
    _drag(page, "Velocity loops", 0.3, 0.6)
    page.wait_for_url(lambda url: "view.v=" in url)
    # Changes of files renew the list of runs. This must not change the view.
    page.evaluate("import('/static/state.js').then(({ refresh }) => refresh())")
    page.get_by_role("button", name="measured").click()
    page.get_by_label("Cycles").select_option("3")
    last = _pictures(page)
    with opened(browser, site[1].address) as other:
        other.goto(page.url)
        _ready(other)
        assert _pictures(other) == last
    for _ in range(3):
        page.go_back()
    page.wait_for_url(lambda url: "view.v=" not in url)
    assert _pictures(page) == part
    page.get_by_role("button", name="Undo zoom").click()
    page.wait_for_url(lambda url: "view.t=" not in url)
    assert _pictures(page) == whole


def test_cursor_shows_values_of_all_curves(page):
    """The table below the plots has the values at the cursor and the characteristic values of the runs."""
    page.goto(f'/#/data?view.runs=["{RUN}"]&view.cards=["strong"]')
    _ready(page)
    plot(page, "Force over time").locator(".u-over").hover()
    cells = page.locator(".readout-table tbody tr").first.locator("td.n")
    expect(cells.first).not_to_have_text("")
    assert float(cells.first.inner_text().replace("−", "-")) != 0.0
    page.get_by_role("tab", name="Characteristic").click()
    row = page.locator("tr", has_text=RUN).last
    expect(row.locator("td.n").nth(3)).not_to_have_text("–")
    assert float(row.locator("td.n").nth(3).inner_text()) > 0.0
