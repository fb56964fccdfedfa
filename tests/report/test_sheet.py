"""Figures as descriptions: ticks, SVG that is well formed and in its place, the same sheet by Matplotlib."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.report.figures.fit import errors_sheet
from mrdamper.report.figures.painted import painted
from mrdamper.report.figures.palette import colour_of, colour_of_share, colour_of_warmth
from mrdamper.report.figures.sheet import Band, Key, Points, Sheet
from mrdamper.report.figures.style import drawing_style
from mrdamper.report.figures.ticks import labels_of, log_ticks, nice_ticks

SVG = "{http://www.w3.org/2000/svg}"


@given(low=st.floats(-1e6, 1e6), span=st.floats(1e-3, 1e6), few=st.integers(3, 9))
def test_ticks_are_few_even_and_inside_the_limits_and_their_labels_are_read_back(low, span, few):
    ticks = nice_ticks((low, low + span), few)
    assert 1 <= len(ticks) <= few + 1
    slack = 1e-6 * (abs(low) + span)
    assert all(low - slack <= tick <= low + span + slack for tick in ticks)
    assert np.ptp(np.diff(ticks)) <= slack if len(ticks) > 1 else True
    labels, power = labels_of(ticks)
    scale = float(power.replace("−", "-") or "1")
    step = ticks[1] - ticks[0] if len(ticks) > 1 else max(abs(ticks[0]), 1.0)
    for tick, label in zip(ticks, labels, strict=True):
        assert scale * float(label.replace("−", "-")) == pytest.approx(tick, abs=0.01 * step + slack)


def test_ticks_of_a_logarithmic_axis_are_round():
    assert log_ticks(2.0, 60.0) == [2.0, 5.0, 10.0, 20.0, 50.0]
    assert log_ticks(0.9, 2e4) == pytest.approx([1.0, 10.0, 100.0, 1e3, 1e4])


def test_scales_of_colour_are_those_of_matplotlib():
    """To two steps of 255, which nobody sees."""
    import matplotlib as mpl

    for share in np.linspace(0.0, 1.0, 23):
        ours = (
            colour_of(share, 1.0),
            colour_of_warmth(share, (0.0, 1.0)),
            colour_of_share(2.0 * share - 1.0),
        )
        theirs = (("viridis", 0.08 + 0.70 * share), ("plasma", 0.05 + 0.70 * share), ("RdBu_r", share))
        for colour, (name, place) in zip(ours, theirs, strict=True):
            rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
            assert rgb == pytest.approx([255.0 * each for each in mpl.colormaps[name](place)[:3]], abs=2.6)


def example() -> Sheet:
    sheet = Sheet(4.0, 2.0, keys=[Key("<1 A>", "#112233")], keys_at="top", keys_title="& more")
    (axes,) = sheet.table(1, 1, left=0.2, right=0.9, top=0.9, bottom=0.3)
    x = np.linspace(0.0, 10.0, 5)
    axes.line(x, 1e-4 * x, "#112233")
    axes.marks += [Band(x, 0.5e-4 * x, 2e-4 * x, "#445566", 0.5), Points([5.0], [5e-4], "#778899", 4.0)]
    axes.x_ends, axes.y_ends, axes.title = (0.0, 10.0), (0.0, 1e-3), "a < b"
    return sheet


def test_a_point_is_where_its_values_say_and_texts_are_escaped():
    """The axes are from 0.8 to 3.6 inches across and from 0.6 to 1.8 up; SVG counts from the top."""
    root = ET.fromstring(example().svg('five "lines"'))
    assert root.attrib["aria-label"] == "five _lines_"
    lines = [each.attrib["d"] for each in root.iter(f"{SVG}path") if each.attrib.get("stroke") == "#112233"]
    numbers = [float(each) for each in lines[0].removeprefix("M").split()]
    assert numbers[:2] == pytest.approx([0.8 * 72.0, 1.4 * 72.0], abs=0.01)
    assert numbers[-2:] == pytest.approx([3.6 * 72.0, 0.2 * 72.0], abs=0.01)
    texts = [each.text for each in root.iter(f"{SVG}text")]
    assert {"a < b", "<1 A>", "& more", "10", "1e−3", "0.2"} - {*texts} == set()
    assert example().svg("a") == example().svg("a")


def test_matplotlib_draws_the_same_sheet():
    with drawing_style():
        (axes,) = painted(example()).axes
    assert axes.get_position().bounds == pytest.approx((0.2, 0.3, 0.7, 0.6))
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 10.0), (0.0, 1e-3))
    assert axes.get_title(loc="left") == "a < b"
    rows = [("sine", "training", 3.0), ("chirp", "held_out", 7.0)]
    with drawing_style():
        (bars,) = painted(errors_sheet(rows)).axes
    assert sorted(each.get_path().get_extents(each.get_patch_transform()).x1 for each in bars.patches) == [
        3,
        7,
    ]
    assert [each.get_text() for each in bars.get_yticklabels()] == ["sine", "chirp"]
