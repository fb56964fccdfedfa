"""Figures of the reports: values are drawn at the correct location, and texts are escaped."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from mrdamper.report.figures.fit import errors_figure
from mrdamper.report.figures.palette import colour_of, colour_of_temperature
from mrdamper.report.figures.small_multiples import Line, Row, grid, grid_figure
from mrdamper.report.figures.style import drawing_style

X = np.linspace(0.0, 10.0, 5)
ROWS = [Row("time, s", "force, N", ((Line(X, X, "#112233"),), (Line(X, 3.0 * X, "#445566"),)), "a < b")]
TITLES = [("<1 A>", False), ("2 A", True)]


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 23))
def test_colour_scales_agree_with_matplotlib(share: float) -> None:
    """They agree to 3 of 255 levels, which is not visible."""
    import matplotlib as mpl

    for colour, name, place in (
        (colour_of(share, 1.0), "viridis", 0.08 + 0.70 * share),
        (colour_of_temperature(share, (0.0, 1.0)), "plasma", 0.05 + 0.70 * share),
    ):
        levels = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
        assert levels == pytest.approx([255.0 * each for each in mpl.colormaps[name](place)[:3]], abs=2.6)


def test_panels_of_row_share_limits() -> None:
    with drawing_style():
        first, second = grid_figure(TITLES, ROWS).axes
    assert first.get_ylim() == second.get_ylim()
    assert first.get_ylim()[1] > 30.0
    assert first.get_title(loc="left") == "a < b"


def test_svg_escapes_texts_and_is_reproducible() -> None:
    svg = grid(TITLES, ROWS, 'five "lines"')
    root = ET.fromstring(svg)
    assert root.attrib["aria-label"] == "five _lines_"
    texts = {each.text for each in root.iter("{http://www.w3.org/2000/svg}text")}
    assert {"a < b", "<1 A>", "2 A", "time, s", "force, N"} <= texts
    assert grid(TITLES, ROWS, 'five "lines"') == svg


def test_error_bars_have_lengths_of_errors() -> None:
    with drawing_style():
        (axes,) = errors_figure([("sine", "training", 3.0), ("chirp", "held_out", 7.0)]).axes
    bars = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert sorted(bar.get_width() for bar in bars) == [3.0, 7.0]
    assert [each.get_text() for each in axes.get_yticklabels()] == ["sine", "chirp"]
