"""Linked view: runs and cards with one cursor and one time span, stored in the address."""

from __future__ import annotations

import statistics
import time

import numpy as np
import pytest
from scipy.io import savemat

from tests.support.pace import within_reach
from tests.web.browser import opened, shoot
from tests.web.served import served
from tests.web.walking import plot

pytestmark = pytest.mark.nightly

RUN = "nominal_020C_1.00A_sine5mm1Hz"
SAMPLES = 2_000_000
CURSOR_MS, BLOCK_MS = 16.0, 100.0
PATIENCE_S = 10.0

MOVES = """async () => {
  const named = (e) => e.textContent.includes("Force over time");
  const figure = [...document.querySelectorAll("figure.plot")].find(named);
  const over = figure.querySelector("canvas.plot-over");
  const box = over.getBoundingClientRect();
  const took = [];
  for (let k = 0; k < 200; k += 1) {
    const clientX = box.left + box.width * (0.1 + 0.8 * ((k * 0.382) % 1));
    const began = performance.now();
    over.dispatchEvent(new PointerEvent("pointermove", { clientX, clientY: box.top + 50, bubbles: true }));
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

PIXELS = """() => [...document.querySelectorAll("canvas.plot-canvas")]
  .filter((canvas) => canvas.clientWidth)
  .map((canvas) => canvas.toDataURL())"""
"""Pixels of all visible plots, because hidden plots are not drawn."""


def _ready(page):
    page.wait_for_selector("#loops-said[data-ms]")
    page.wait_for_selector("figure[data-drawing]", state="detached")


def _drag(page, title, begin, end, steps=5):
    over = plot(page, title).locator("canvas.plot-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + begin * box["width"], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + end * box["width"], box["y"] + 100, steps=steps)
    page.mouse.up()


def _picture(page):
    """Return the pixels of all plots."""
    page.mouse.move(2, 2)
    _ready(page)
    return page.evaluate(PIXELS)


def _soon(page, shown):
    """Return True if the plots equal ``shown()`` after some time."""
    until = time.monotonic() + PATIENCE_S
    while _picture(page) != shown():
        if time.monotonic() > until:
            return False
    return True


def test_two_million_samples_never_block(browser, tmp_path):
    """The cursors follow within 16 ms, and a dragged time span never blocks the page for 100 ms."""
    root = tmp_path / "long"
    (root / "runs").mkdir(parents=True)
    instants = np.arange(SAMPLES) / 1000.0
    phase = 2.0 * np.pi * 1.3 * instants
    x, v = 0.005 * np.sin(phase), np.cos(phase)
    noise = np.random.default_rng(7).normal(0.0, 8.0, SAMPLES)
    force = 800.0 * np.tanh(4.0 * v) + 200.0 * v + 1500.0 * x + noise
    current = 1.0 + 0.5 * np.sin(0.01 * instants)
    columns = {
        "time_s": instants,
        "displacement_mm": 1e3 * x,
        "force_N": force,
        "current_A": current,
        "temperature_degC": 20.0 + 0.01 * instants,
    }
    savemat(root / "runs" / "long.mat", columns)
    with served(root) as client, opened(browser, client.address) as page:
        assert client.read_all()[0]["samples"] == SAMPLES
        page.goto("/#/loops?run=long")
        _ready(page)
        assert page.get_attribute("#loops-said", "data-samples") == str(SAMPLES)
        moves = page.evaluate(MOVES)
        page.evaluate(WATCH)
        for begin in (0.1, 0.3, 0.2):
            _drag(page, "Force over time", begin, begin + 0.5, steps=25)
            page.get_by_role("button", name="Undo zoom").click()
            _ready(page)
        blocks = page.evaluate("window.blocks")
        shoot(page, "view-long", whole=True)
    median, longest = statistics.median(moves), max(blocks, default=0.0)
    print(f"2,000,000 samples: cursor {median:.1f} ms (median of 200), longest block {longest:.0f} ms")
    assert median <= within_reach(CURSOR_MS)
    assert longest <= within_reach(BLOCK_MS)


def test_address_restores_view_and_back_undoes(browser, site, page):
    """Another browser restores runs, card, colours, hidden curve and zooms from the address."""
    page.goto(f"/#/loops?run={RUN}&card=strong")
    _ready(page)
    whole = _picture(page)
    _drag(page, "Force over time", 0.3, 0.7)
    page.wait_for_url(lambda url: "&t=" in url)
    part = _picture(page)
    assert part != whole
    _drag(page, "Velocity loops", 0.3, 0.6)
    page.wait_for_url(lambda url: "&v=" in url)
    page.get_by_role("button", name="measured").click()
    page.get_by_label("Colour by").select_option("card")
    page.get_by_label("nominal_020C_0.50A_sine5mm1Hz").check()
    _ready(page)
    with opened(browser, site[1].address) as other:
        other.goto(page.url)
        _ready(other)
        assert _soon(other, lambda: _picture(page))
    for _ in range(3):
        page.go_back()
    page.go_back()
    page.wait_for_url(lambda url: "&v=" not in url)
    assert _soon(page, lambda: part)
    page.get_by_role("button", name="Undo zoom").click()
    page.wait_for_url(lambda url: "&t=" not in url)
    assert _soon(page, lambda: whole)
    page.get_by_role("button", name="Redo zoom").click()
    page.wait_for_url(lambda url: "&t=" in url)
    assert _soon(page, lambda: part)
