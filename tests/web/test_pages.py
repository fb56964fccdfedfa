"""Tests of the pages in a browser.

``MRDAMPER_SHOTS=1`` writes screenshots to build/web/. Look at them after a change of a page.
"""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from mrdamper.models.card_schema import read_card
from tests.web.browser import SCREENS, contrast, opened, palettes, shoot
from tests.web.served import series_of
from tests.web.walking import (
    AXES,
    CUT,
    FAINT,
    PAGES,
    STATIC,
    UNNAMED,
    download,
    plot,
    saved_table,
)

pytestmark = pytest.mark.system

RUN = "nominal_020C_1.00A_sine5mm1Hz"

# ------------------------------------------------------------------------------------------------- runs


# ------------------------------------------------------------------------------------------------ loops


def test_saved_plot_equals_server_values(page, site):
    """CSV, SVG and PNG of a loop contain the values of the server and the units of the axes."""
    page.goto(f"/#/loops?run={RUN}")
    page.wait_for_selector("#loops-said[data-ms]")
    head, columns = series_of(site[1].ask("GET", f"/api/runs/{RUN}/series").content)
    figure = plot(page, "Displacement loops")
    header, rows = saved_table(page, figure)
    assert header[0] == "displacement, mm"
    assert "force, N" in header[1]
    assert len(rows) == head["samples"]
    found = np.array(rows, dtype=float)
    assert found[:, 0] == pytest.approx(columns["displacement_mm"], rel=1e-6, abs=1e-6)
    assert found[:, 1] == pytest.approx(columns["force_N"], rel=1e-6, abs=1e-4)
    drawn = ElementTree.fromstring(download(page, figure.get_by_role("button", name="SVG").click))
    words = {each.text for each in drawn.iter("{http://www.w3.org/2000/svg}text")}
    assert {"displacement, mm", "force, N"} <= words
    assert download(page, figure.get_by_role("button", name="PNG").click).startswith(b"\x89PNG\r\n")


@pytest.mark.parametrize("kind", ["series", "loop"])
def test_decimation_keeps_single_spike(page, kind):
    """The decimation of a million samples keeps a single spike."""
    page.goto("/#/jobs")
    drawn = page.evaluate(
        """async (kind) => {
          const thin = await import("/static/decimate.js");
          const n = 1_000_000;
          const x = new Float32Array(n), y = new Float32Array(n);
          for (let k = 0; k < n; k += 1) {
            x[k] = kind === "series" ? k : 300 + 200 * Math.cos(k / 40);
            y[k] = 100 + 50 * Math.sin(k / 40);
          }
          y[123457] = 290;
          const toX = (v) => (kind === "series" ? (v * 600) / n : v), toY = (v) => v;
          const path = kind === "series" ? thin.seriesPath(x, y, 0, n, toX, toY, 600)
            : [...thin.loopPieces(x, y, 0, n, toX, toY, 600, 300)].flatMap(({ points }) => [...points]);
          let most = -Infinity, least = Infinity;
          for (let k = 1; k < path.length; k += 2) {
            if (path[k] > most) most = path[k];
            if (path[k] < least) least = path[k];
          }
          return [path.length / 2, least, most];
        }""",
        kind,
    )
    assert drawn[0] < 30_000
    assert drawn[1] == pytest.approx(50.0, abs=1.0)
    assert drawn[2] == 290.0


# --------------------------------------------------------------------------------- identify and predict


def test_fit_on_page_writes_readable_card(page, site):
    """A fit with held-out runs writes a card that the command line can read."""
    root, _ = site
    page.goto("/#/fit")
    page.fill("#fit-card", "fitted")
    page.fill("#fit-hold-out", "*_060C_*")
    page.select_option("#fit-law", "double-bouc-wen")  # The default compares all laws.
    page.click("#start-fit")
    page.wait_for_selector("#fit-tiles", timeout=120_000)
    assert page.locator("tr.held:has(a)").count() == 9
    card = read_card(root / "cards" / "fitted" / "card.json")
    shown = page.locator("table:has-text('standard error') tbody tr").all_inner_texts()
    assert len(shown) >= len(card.damper.coefficients)
    assert card.damper.temperature_dependent
    assert plot(page, "Cost while fitting").is_visible()
    shoot(page, "fit")
    page.reload()
    page.wait_for_selector("#fit-tiles", timeout=120_000)
    assert "fitted" in page.inner_text("h2 >> nth=0")
    page.get_by_label("Card", exact=True).select_option("fitted")
    page.click("#evaluate")
    page.get_by_text("fitted on 27 runs").wait_for()


# --------------------------------------------------------------------------------------------- heating


# ------------------------------------------------------------------------------------------------ sink


# --------------------------------------------------------------------------------------------- tracking


# ------------------------------------------------------------------------------------- all of the pages


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("size", "scheme"),
    [
        (SCREENS[0], "light"),
        (SCREENS[1], "dark"),
        pytest.param(SCREENS[0], "dark", marks=pytest.mark.nightly),
        pytest.param(SCREENS[1], "light", marks=pytest.mark.nightly),
    ],
    ids=["desk-light", "tablet-dark", "desk-dark", "tablet-light"],
)
def test_every_page_fits_the_screen(browser, site, size, scheme):
    """Nothing is wider than the screen, text has contrast, controls have names, and axes have units."""
    with opened(browser, site[1].address, size=size, scheme=scheme) as page:
        for name in PAGES:
            page.goto(f"/#/{name}")
            page.wait_for_selector(f"[data-shown={name}] h1")
            page.wait_for_timeout(300)
            assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), name
            assert page.evaluate(CUT) == [], name
            assert page.evaluate(UNNAMED) == [], name
            assert page.evaluate(FAINT) == [], name
            for said in page.evaluate(AXES):
                assert re.search(r"\. [^.]+, [^ .,]+.* over [^.]+, [^ .,]+\. Arrow keys", said), said
            shoot(page, f"{name}-{scheme}-{size[0]}", whole=True)


@pytest.mark.nightly
def test_keyboard_reaches_pages_and_sliders(page):
    page.goto("/")
    page.wait_for_selector("#choose")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Skip to the page"
    for _ in range(6):
        page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Heating"
    page.keyboard.press("Enter")
    page.wait_for_selector("#heat-tiles .tile")
    ambient = page.get_by_label("Ambient", exact=True)
    ambient.focus()
    before = ambient.input_value()
    page.keyboard.press("ArrowRight")
    assert float(ambient.input_value()) == float(before) + 1.0


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("ink", ["ink", "soft", "faint", "accent", "held", "good", "warn"])
@pytest.mark.parametrize("back", ["back", "rail", "panel"])
def test_text_is_readable(scheme, ink, back):
    """WCAG 2 AA requires a contrast of at least 4.5 for text of normal size."""
    colours = palettes((STATIC / "style.css").read_text())[scheme]
    assert contrast(colours[ink], colours[back]) >= 4.5


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_plot_lines_and_edges_have_contrast(scheme):
    """WCAG 2 AA requires a contrast of at least 3 for graphics."""
    sheet = palettes((STATIC / "style.css").read_text())[scheme]
    assert min(contrast(sheet["edge"], sheet[back]) for back in ("back", "panel")) >= 3.0
    text = (STATIC / "theme.js").read_text().split(f"const {scheme.upper()} = {{")[1].split("};")[0]
    drawn = re.findall(r"#[0-9a-f]{6}", "".join(re.findall(r"(?:colours|ramp): \[[^]]*\]", text)))
    drawn += re.findall(r'(?:measured|accent): "(#[0-9a-f]{6})"', text)
    assert len(drawn) == 8 + 5 + 2
    assert [each for each in drawn if contrast(each, sheet["back"]) < 3.0] == []


def test_modules_never_parse_markup():
    """No module parses markup or contains the address of another host."""
    for path in STATIC.glob("*.js"):
        text = path.read_text()
        assert not re.search(
            r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", text
        )
        assert set(re.findall(r"https?://[^\"'\s)]+", text)) <= {"http://www.w3.org/2000/svg"}
    page = (STATIC / "index.html").read_text()
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son\w+=", page)


# ----------------------------------------------------------------------------------------------- speed
