"""The web app's pages in Debian's chromium: first paint, a long run on the screen, a slider's redraw.

Times are the browser's own, from the request to the frame after the last stroke.
"""

from __future__ import annotations

import shutil
import statistics

from bench.measure import Asked, Row

__all__ = ["rows"]

_PAINTS, _LOADS, _MOVES = 5, 5, 40

_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
_REDRAW = """async (value) => {
  const slider = document.getElementById("s-ambient"), figure = document.querySelector("figure[data-asked]");
  const before = figure.dataset.asked, begin = performance.now();
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  while (figure.dataset.asked === before) await new Promise((seen) => setTimeout(seen, 1));
  await new Promise((seen) => requestAnimationFrame(() => setTimeout(seen, 0)));
  return performance.now() - begin;
}"""
_LOAD = """async ([run, samples]) => {
  const begin = performance.now();
  window.location.hash = `#/loops?run=${encodeURIComponent(run)}`;
  while (!document.querySelector(`#loops-said[data-samples="${samples}"]`)) {
    await new Promise((seen) => setTimeout(seen, 2));
  }
  await new Promise((seen) => requestAnimationFrame(() => setTimeout(seen, 0)));
  return performance.now() - begin;
}"""


def rows(site: str, token: str, *, run: str, samples: int, card: str) -> list[Row]:
    """Return the pages' figures of a server that has a run and a card; one gap without a browser."""
    program = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        return [Row("pages in a browser", accuracy="playwright is not installed")]
    if program is None:
        return [Row("pages in a browser", accuracy="chromium is not installed")]
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        paints = []
        for _ in range(_PAINTS):
            context = browser.new_context(viewport={"width": 1280, "height": 800})  # nothing kept from before
            context.request.get(f"{site}/?token={token}")
            page = context.new_page()
            page.goto(site)
            page.wait_for_selector("#choose")
            paints.append(1e-3 * float(page.evaluate(_PAINT)))
            context.close()
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{site}/?token={token}")
        loads = []
        for _ in range(_LOADS):
            page.goto(f"{site}/#/jobs")
            page.wait_for_selector("[data-shown=jobs]")
            loads.append(1e-3 * float(page.evaluate(_LOAD, [run, samples])))
        page.goto(f"{site}/#/heating?card={card}")
        page.wait_for_selector("figure[data-asked]")
        page.wait_for_timeout(500)
        moves = sorted(float(page.evaluate(_REDRAW, 0.5 * k)) for k in range(_MOVES))
        browser.close()
    paint, load = statistics.median(paints), statistics.median(loads)
    slow = moves[int(0.95 * _MOVES)]
    return [
        Row(
            "first contentful paint",
            accuracy=f"{paint:.2f} s, slowest {max(paints):.2f} s",
            asked=(Asked("first contentful paint", 0.5, paint, "s"),),
        ),
        Row(
            f"{samples:,} samples on the screen, in loops and over time",
            accuracy=f"{load:.2f} s, slowest {max(loads):.2f} s",
            asked=(Asked(f"{samples:,} points on the screen", 3.0, load, "s"),),
        ),
        Row(
            "slider to redrawn heating curve",
            accuracy=f"{statistics.median(moves):.0f} ms, 95 % below {slow:.0f} ms",
            asked=(Asked("slider to redraw", 100.0, slow, "ms"),),
        ),
    ]
