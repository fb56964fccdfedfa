"""The "heat dissipation efficiency" of the paper has the trends and the areas that the paper states."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.thermal.drawing_file import read_drawing, read_sink
from mrdamper.thermal.model.section import section_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import fin_efficiency
from mrdamper.thermal.sinks.effects import body_area, judge_sink, paper_sweeps

DRAWING = read_drawing("paper")
SINK = read_sink("paper")

# Power [W] of the preset ``paper`` at 15 mm, 1 Hz and 2 A at three temperatures [K] (see
# tests/thermal/test_paper.py). The coil of 4.2 ohm releases 16.8 W.
KELVIN, WATTS = np.array([293.15, 353.15, 413.15]), np.array([73.4, 62.0, 53.9])
LOADS = (Load(1800.0, lambda kelvin: np.interp(kelvin, KELVIN, WATTS), 16.8),)


@pytest.fixture(scope="module")
def sweeps():
    return paper_sweeps(DRAWING, SINK, LOADS)


def test_dissipation_efficiency_peaks_at_paper_sizes(sweeps):
    """The efficiency is largest at a width of 23 mm and at four fins. Larger sinks are cooler, however."""
    width, fins = sweeps
    assert [effect.sink.width for effect in width.effects] == [0.018, 0.023, 0.028, 0.033]
    assert [effect.sink.fins for effect in fins.effects] == [3, 4, 5]
    for sweep in sweeps:
        assert sweep.follows_paper
        assert (np.diff([effect.finned for effect in sweep.effects]) < 0.0).all()


def test_cooling_by_five_fins_agrees_with_paper(sweeps):
    """The paper reports a reduction of 48.23 %.

    The limit includes the error of the network (1.4 K of 57 K).
    """
    assert 100.0 * sweeps[1].effects[2].rise_reduction == pytest.approx(48.23, abs=2.0)


def test_uncorrected_dissipation_efficiency_has_no_maximum():
    """Without the multiplier that was fitted to the paper, the efficiency increases with the fin area."""
    for sweep in paper_sweeps(DRAWING, replace(SINK, film_multiplier=1.0), LOADS):
        assert (np.diff(sweep.efficiency) > 0.0).all()


def test_dissipation_efficiency_uses_areas_of_section():
    section = section_of(DRAWING.with_sink(None))
    assert body_area(DRAWING) == pytest.approx(math.fsum(edge.area for edge in section.edges), rel=1e-12)
    effect = judge_sink(DRAWING, SINK, LOADS, bare=400.0)
    assert effect.fin_area == pytest.approx(5 * 2 * math.pi * (0.0475**2 - 0.023**2))
    reduction = (400.0 - effect.finned) / (400.0 - 293.15)
    areas = effect.body_area + effect.fin_area
    assert effect.efficiency == pytest.approx(reduction * effect.body_area / areas)


def test_conductive_fins_are_more_efficient():
    found = []
    for conductivity in (16.0, 160.0, 1600.0, 1.6e9):
        sink = replace(SINK, material=replace(SINK.material, conductivity=conductivity))
        found.append(float(fin_efficiency(DRAWING.with_sink(sink), 350.0)[1]))
    assert found == sorted(found)
    assert found[-1] == pytest.approx(1.0, abs=1e-7)
