"""Figures of reports draw values at the correct positions and escape texts."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from matplotlib.patches import Rectangle

from mrdamper.report.figures.runs import errors_figure
from mrdamper.report.figures.small_multiples import Line, Panel, panel_figure
from mrdamper.report.figures.style import drawing_style, svg_drawn_by
from tests.report.test_campaign_report import an_error

X = np.linspace(0.0, 10.0, 5)
PANELS = [
    Panel("<1 A>", "time, s", [Line(X, X, "#112233")], y_label="a < b"),
    Panel("2 A", "time, s", [Line(X, 3.0 * X, "#445566")], held=True),
]


def svg() -> str:
    return svg_drawn_by(lambda: panel_figure(PANELS, share="row"), 'five "lines"')


def test_figure_panels_in_row_share_axis_limits() -> None:
    with drawing_style():
        first, second = panel_figure(PANELS, share="row").axes
    assert first.get_ylim() == second.get_ylim()
    assert first.get_ylim()[1] > 30.0
    assert first.get_title(loc="left") == "<1 A>"


def test_svg_figure_escapes_texts_and_is_reproducible() -> None:
    text = svg()
    root = ET.fromstring(text)
    assert root.attrib["aria-label"] == "five _lines_"
    texts = {each.text for each in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"a < b", "<1 A>", "2 A", "time, s"} <= texts
    assert svg() == text


def test_error_bars_have_length_of_errors() -> None:
    errors = [an_error(name="sine"), an_error(name="chirp", split="held_out", nrmse_percent=7.0)]
    with drawing_style():
        (axes,) = errors_figure(errors).axes
    bars = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert sorted(bar.get_width() for bar in bars) == [3.0, 7.0]
    assert [each.get_text() for each in axes.get_yticklabels()] == ["chirp", "sine"]
