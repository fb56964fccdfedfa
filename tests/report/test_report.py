"""The report of a fit loads no external files, escapes names, and has reproducible bytes."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

import mrdamper
from mrdamper.report.identification.page import PAGE
from tests.support.campaigns import short_runs

pytestmark = pytest.mark.system

NASTY = "阻尼器 <script>alert('x')</script> & \"run\" $x_1^"


class Page(HTMLParser):
    """Collect the elements, the text, and the references to files of a page."""

    def __init__(self):
        super().__init__()
        self.elements, self.references, self.said = [], [], []

    def handle_starttag(self, tag, attrs):
        self.elements.append(tag)
        self.references += [value for key, value in attrs if key in {"src", "href", "xlink:href", "data"}]

    def handle_data(self, data):
        self.said.append(data)


@pytest.fixture(scope="module")
def fitted():
    runs = list(short_runs())
    runs[1] = replace(runs[1], name=NASTY)
    found = mrdamper.fit(runs, "dahl", hold_out=["*_1.50V_sine5*"], terms=())
    return replace(found, title=f"Title {NASTY}", simulated="made up")


@pytest.fixture(scope="module")
def judged(fitted):
    return fitted.assessment


@pytest.fixture(scope="module")
def text(fitted):
    return PAGE.render(fitted)


@pytest.fixture(scope="module")
def page(text):
    parsed = Page()
    parsed.feed(text)
    return parsed


def test_run_names_in_report_are_escaped(page, judged):
    said = "".join(page.said)
    for error in judged.runs:
        assert error.name in said
    assert "script" not in page.elements


def test_report_loads_no_external_file(page, text):
    assert [ref for ref in page.references if not ref.startswith("#")] == []
    assert "@import" not in text
    assert re.findall(r"url\((?!#)", text) == []


def test_figures_in_report_contain_no_date(text):
    assert "<image" not in text
    assert "<metadata" not in text
    assert re.search(r"20\d\d-\d\d-\d\d", text) is None


def test_axes_in_report_have_units(page):
    said = {part.strip() for part in page.said}
    assert {"displacement, mm", "velocity, mm/s", "force, N", "voltage, V"} <= said


def test_held_out_runs_in_report_are_marked(page):
    said = " ".join("".join(page.said).split())
    assert re.search(r"Held-out runs: median error [\d.]+ %, worst [\d.]+ % \(1 run\)", said)
    assert re.search(r"Training runs: median error [\d.]+ %, worst [\d.]+ % \(5 runs\)", said)


def test_simulated_runs_in_report_are_marked(text):
    assert "simulated, not measured" in text
