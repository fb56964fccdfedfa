"""The first time at a temperature limit is exact, and limits in the geometry file have priority."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.limits import first_time, limits_of

TIME = np.array([0.0, 10.0, 30.0, 60.0, 100.0])


def test_first_time_at_limit_is_returned():
    """The time is exact for a straight line, at and between samples. A second crossing is ignored."""
    line = 300.0 + 0.5 * TIME
    assert first_time(TIME, line, 307.5) == pytest.approx(15.0)
    assert first_time(TIME, line, 315.0) == pytest.approx(30.0)
    assert first_time(TIME, line, 350.0) == pytest.approx(100.0)
    assert first_time(TIME, line, 350.1) is None
    assert first_time(TIME, line, 300.0) == 0.0
    assert first_time(TIME, line, 290.0) == 0.0
    there_and_back = np.array([300.0, 310.0, 320.0, 300.0, 330.0])
    found = first_time(TIME, there_and_back, 315.0)
    assert found is not None
    assert 10.0 < found < 30.0
    assert first_time(TIME, there_and_back, 325.0) == pytest.approx(90.0, abs=7.0)


def test_limit_in_geometry_replaces_material_limit():
    drawing = read_drawing("paper")
    stated = replace(
        drawing, coil=replace(drawing.coil, limit=400.0), seals=replace(drawing.seals, limit=390.0)
    )
    usual, own = limits_of(drawing), limits_of(stated)
    assert [each.kelvin for each in own] == [drawing.filling.valid_K[1], 400.0, 390.0]
    assert [each.source for each in own[1:]] == ["of the drawing"] * 2
    assert [each.source for each in usual] == [
        f"of {drawing.filling.name}",
        "of insulation class F",
        "of HNBR",
    ]
    assert [each.name for each in usual] == ["fluid", "coil", "seals"]
    assert own[1].celsius == pytest.approx(126.85)
