"""Actions of users on a page and checks of their results, for several test modules."""

from __future__ import annotations

import base64
import csv
import io
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Keyboard, Locator, Page

from mrdamper.arrays import FloatArray

STATIC = Path(__file__).parents[2] / "src" / "mrdamper" / "web" / "static"

PAGES = ("data", "model", "thermal", "controller", "jobs")
TABS = {
    "thermal": ("heat.tab", ("Heating", "Geometry", "Heat sink")),
    "controller": ("track.page", ("Try", "Export")),
    "data": ("view.tab", ("Plots", "Files", "Runs", "Characteristic", "Findings")),
}
"""Tabs of pages with the key of their choice."""

VIEWS = tuple(
    (page, f"{page}?{TABS[page][0]}={tab}" if page in TABS else page)
    for page in PAGES
    for tab in (TABS[page][1] if page in TABS else ("",))
)
"""All pages with all tabs: name and address."""

UNNAMED = """
[...document.querySelectorAll(`main :is(button, a, select, summary, div.plot-box, iframe,
  input:not([hidden]))`)]
  .filter((e) => {
    const labels = [...(e.labels ?? [])].map((label) => label.textContent).join("");
    const says = e.matches("button, a, summary") ? e.textContent : labels;
    return !(says.trim() || e.getAttribute("aria-label") || (e.matches("iframe") && e.title));
  })
  .map((e) => e.outerHTML)"""
"""Controls without a name for a screen reader; options and placeholders are not names."""

CUT = """
[...document.querySelectorAll("main :is(button, label, th, h1, h2, h3, .tile b, .tile span, .tag)")]
  .filter((e) => e.offsetParent && getComputedStyle(e).display !== "inline")
  .filter((e) => e.scrollWidth > e.clientWidth + 1)
  .map((e) => e.outerHTML)"""
"""Texts that are wider than their boxes."""

FAINT = """
(() => {
  const parsed = (text) => text.match(/[\\d.]+/g).map(Number);
  const luminance = (rgb) => {
    const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    const [r, g, b] = rgb.map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const backOf = (e) => {
    const [r, g, b, a = 1] = e ? parsed(getComputedStyle(e).backgroundColor) : [255, 255, 255];
    return a ? [r, g, b] : backOf(e.parentElement);
  };
  const isActive = (e) => !e.closest(":disabled, option, script, noscript, [aria-pressed=false].key");
  const ratio = (e) => {
    const pair = [parsed(getComputedStyle(e).color), backOf(e)].map((rgb) => luminance(rgb.slice(0, 3)));
    const [low, high] = pair.sort((p, q) => p - q);
    return (high + 0.05) / (low + 0.05);
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const all = [];
  while (texts.nextNode()) if (texts.currentNode.data.trim()) all.push(texts.currentNode.parentElement);
  const faint = all.filter((e) => isActive(e) && e.checkVisibility() && ratio(e) < 4.5);
  return faint.map((e) => `${ratio(e).toFixed(2)} ${e.outerHTML.slice(0, 160)}`);
})()"""
"""Texts with too little contrast by WCAG 2 AA; disabled controls are exempt."""

AXES = """
[...document.querySelectorAll("main div.plot-box")].map((e) => e.getAttribute("aria-label"))"""
"""Labels of the plots: title and both axes with their units."""

LOGGER = """\
Header Size:  7
Version:  2
Sampling Interval:  0.002
Sampling Rate:  500
Sample Count:  3000
Device Serial Number:  0
Sample Number, Date/Time, CHANNEL0, CHANNEL1, Events
"""


def a_logger_file(path: Path) -> Path:
    """Write a logger file with two tests in volts (10 mm/V and 980.665 N/V)."""
    time = np.arange(1500) / 500.0
    travel = 0.5 * np.sin(2.0 * np.pi * 2.0 * time)
    speed = np.gradient(travel, time)
    lines = []
    for test, strength in enumerate((0.2, 0.9)):
        force = strength * np.tanh(speed) + 0.05 * speed
        for k, (x, f) in enumerate(zip(travel, force, strict=True)):
            event = ", Resume" if k == 0 and test else ""
            lines.append(f"{1500 * test + k + 1:8d},   05/13/2022 05:04:23.839 PM, {x:.5f}, {f:.5f}{event}")
    path.write_text(LOGGER + "\n".join(lines) + "\n")
    return path


ACTIONS = {"click", "fill", "type", "press", "select_option", "check", "uncheck", "set_input_files"}


class Actions(Counter[str]):
    """Count clicks, choices, entries and key presses of a user for each named part of a test.

    Actions outside of a named part only make the test faster and are not counted.
    """

    part = ""


@contextmanager
def counted_actions() -> Iterator[Actions]:
    """Count each action of Playwright on a page."""
    actions = Actions()

    def counted(act: Callable[..., object]) -> Callable[..., object]:
        def wrapped(*arguments: object, **options: object) -> object:
            actions.update([actions.part] if actions.part else [])
            return act(*arguments, **options)

        return wrapped

    with pytest.MonkeyPatch.context() as patch:
        for kind in (Locator, Page, Keyboard):
            for name in ACTIONS & set(dir(kind)):
                patch.setattr(kind, name, counted(getattr(kind, name)))
        yield actions


def download(page: Page, press: Callable[[], object]) -> bytes:
    """Return the content of the download that a click starts."""
    with page.expect_download() as waiting:
        press()
    return Path(waiting.value.path()).read_bytes()


def saved_table(page: Page, figure: Locator) -> tuple[list[str], list[list[str]]]:
    """Download the CSV file of a plot, and return its header and rows."""
    text = download(page, figure.get_by_role("button", name="CSV").click).decode()
    header, *rows = csv.reader(io.StringIO(text))
    return header, rows


def go(page: Page, address: str) -> None:
    """Open a page and wait until it is filled."""
    page.goto(f"/#/{address}")
    page.wait_for_selector(f"[data-shown={address.partition('?')[0]}] h1")
    page.wait_for_timeout(500)


def plot(page: Page, title: str) -> Locator:
    """Return the plot with this title."""
    return page.locator("figure.plot").filter(has=page.get_by_text(title, exact=True))


def drop_files(page: Page, where: str, files: list[Path]) -> None:
    """Drop files on an element with the events that a mouse causes: enter, over, drop."""
    held = [[path.name, base64.b64encode(path.read_bytes()).decode()] for path in files]
    dragged = page.evaluate_handle(
        """(held) => {
          const dragged = new DataTransfer();
          for (const [name, text] of held) {
            dragged.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
          }
          return dragged;
        }""",
        held,
    )
    for event in ("dragenter", "dragover", "drop"):
        page.dispatch_event(where, event, {"dataTransfer": dragged})


def sine_columns(
    *, force_N: float = 400.0, mm: float = 5.0, currents_A: tuple[float, ...] = (1.0,), seconds: float = 4.0
) -> dict[str, FloatArray]:
    """Return the columns of a sine run of 1 Hz at 20 degC.

    The force is proportional to the current and to a tanh of the velocity. ``force_N`` is the force at 1 A.
    Each current lasts for an equal part of the time.
    """
    time = np.arange(round(200 * seconds)) / 200.0
    speed = 2.0 * np.pi * mm * np.cos(2.0 * np.pi * time)
    current = np.repeat(currents_A, len(time) // len(currents_A))
    return {
        "time_s": time,
        "displacement_mm": mm * np.sin(2.0 * np.pi * time),
        "force_N": force_N * (0.5 + 0.5 * current) * np.tanh(0.2 * speed) + 2.0 * speed,
        "current_A": current,
        "temperature_degC": np.full_like(time, 20.0),
    }
