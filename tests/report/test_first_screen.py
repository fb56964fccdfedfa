"""Every report begins with the same first screen: verdict, tiles and figure, which fit on a phone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import mrdamper
from mrdamper.registry import JOBS
from mrdamper.report.page import FirstScreen, Page, Tile, environment, sentence
from mrdamper.report.sections import table_of
from tests.support.campaigns import short_runs
from tests.web.browser import chromium

WITHOUT_A_PAGE = {"rig", "data list", "data fetch"}
"""Jobs that write text or runs and have no figure."""

NASTY = "<script>alert('x')</script> & \"run\""
ORDER = (
    "<h1>",
    'class="verdict"',
    'class="tiles"',
    'class="picture"',
    'class="flag"',
    'class="caveats"',
    "<h2>",
)


def a_page() -> Page[list[float]]:
    def first(values: list[float]) -> FirstScreen:
        tiles = (Tile(f"{max(values):g} N", NASTY, "90 %: 1 to 2 N"), Tile("1", "b"), Tile("2", "c"))
        return FirstScreen(
            title=NASTY, verdict="it works", tiles=tiles, flags=[("Beware", NASTY)], notes=[NASTY]
        )

    def picture(values: list[float]) -> Figure:
        figure = Figure(figsize=(10.6, 3.0))
        figure.subplots().plot(values)
        return figure

    return Page(
        name="a.html",
        first=first,
        picture=picture,
        label="Force",
        sections=lambda values: table_of([{"force_N": value} for value in values]),
    )


def test_every_report_with_figure_has_page():
    assert {name for name, job in JOBS.items() if job.reported.page is None} == WITHOUT_A_PAGE


@pytest.mark.parametrize(
    "job", [job for name, job in JOBS.items() if name not in WITHOUT_A_PAGE], ids=lambda j: j.name
)
def test_report_templates_share_first_screen(job):
    """All jobs use one template for the first screen. The template of a job adds only the part below."""
    page = job.reported.page
    loader = environment().loader
    assert loader is not None
    text = loader.get_source(environment(), page.template)[0]
    assert '{% extends "page.html.j2" %}' in text
    assert set(re.findall(r"{% block (\w+)", text)) <= {"style", "contents", "rest"}
    assert page.name.endswith(".html")


def test_first_screen_has_fixed_order_of_parts():
    text = a_page().render([1.0, 2.0])
    places = [text.index(mark) for mark in ORDER]
    assert places == sorted(places)
    assert text.count('class="tile"') == 3
    assert "<script" not in text
    assert "It works." in text
    assert a_page().render([1.0, 2.0]) == text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("the runs can be fitted", "The runs can be fitted."),
        ("yield_force rests on its bound", "yield_force rests on its bound."),
        ("worn is weaker than new.", "worn is weaker than new."),
        ("", "."),
    ],
)
def test_verdict_is_formatted_as_sentence(given, said):
    assert sentence(given) == said


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> list[Path]:
    """Return pages of real results with wide tables, long names and several figures."""
    out = tmp_path_factory.mktemp("pages")
    fitted = mrdamper.fit(list(short_runs()), "dahl", hold_out=["*_1.50V_sine5*"])
    checked = mrdamper.check(list(short_runs()))
    found = {"fit": fitted, "check": checked}
    for name, result in found.items():
        JOBS[name].save(result, out / name)
    (out / "made_up.html").write_text(a_page().render([1.0, 2.0]), encoding="utf-8")
    return sorted(out.rglob("*.html"))


@pytest.mark.nightly
def test_report_pages_fit_phone_screen(pages, tool):
    with chromium(tool("chromium")) as browser:
        for path in pages:
            page = browser.new_page(viewport={"width": 390, "height": 844})
            page.goto(path.as_uri())
            assert page.evaluate("document.documentElement.scrollWidth") == 390, path.name
            top = page.evaluate("document.querySelector('.picture').getBoundingClientRect().top")
            assert top < 600.0, f"{path.name}: the picture is not on the first screen"
            before = page.evaluate("document.querySelector('.picture svg').getBoundingClientRect().width")
            page.click(".picture .zoom svg")
            after = page.evaluate("document.querySelector('.picture svg').getBoundingClientRect().width")
            assert after > max(before, 1000.0)
            page.close()
