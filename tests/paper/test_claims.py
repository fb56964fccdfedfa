"""The comparison with the paper judges only values that could be wrong, and each verdict can change."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from mrdamper.jobs.options import HeatOptions
from mrdamper.jobs.thermal.heat import heat
from mrdamper.paper.claim_table import TABLE
from mrdamper.paper.claims import Row, is_larger, judge
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.sinks.effects import paper_sweeps
from mrdamper.thermal.temperature_rise import loads_of, works_of
from tests.support.campaigns import paper_card

PREDICTED = [row for row in TABLE if row.origin == "predicted"]


def test_verdict_is_required_only_for_predicted_claims():
    with pytest.raises(ValueError, match="origin is calibrated to this value"):
        Row(row=1, claim="x", statement="", why="", origin="calibrated to this value", judged=is_larger)
    with pytest.raises(ValueError, match="origin is predicted, and judged is None"):
        Row(row=1, claim="x", statement="", why="", origin="predicted")


@pytest.mark.parametrize("row", [row for row in TABLE if row.judged], ids=lambda row: row.claim)
def test_every_verdict_can_change(row):
    compared = row.paper if isinstance(row.paper, float) else 100.0
    scale = abs(compared) or 1.0
    verdicts = {row.judged(compared + change * scale, compared) for change in (-0.9, 0.0, 0.9)}
    assert len(verdicts) > 1


def found_with(card, drawing):
    """Return the results that predictions use: the damper at 5 mm, and sinks by width and number of fins."""
    duty = read_duty("sine:15mm:1Hz:2A:1800s")
    loads = loads_of(works_of(card.damper, duty), drawing, duty)
    small = heat(card, drawing, read_duty("sine:5mm:1Hz:2A:1800s"), HeatOptions())
    return SimpleNamespace(
        small=small, sink=SimpleNamespace(sweeps=paper_sweeps(drawing, drawing.sink, loads))
    )


def figure_of(row, found):
    figure = row.ours(found)
    assert figure is not None
    return figure


@pytest.mark.nightly
def test_predictions_depend_on_law_and_geometry():
    """The measured values of the rig influence a prediction only through the card."""
    card, drawing = paper_card(), read_drawing("paper")
    parameters = card.damper.parameters
    changed = {
        name: 1.3 * value for name, value in parameters.items() if name.startswith(("viscosity.c", "yield"))
    }
    stronger = replace(card, damper=card.damper.with_parameters(changed))
    longer = replace(drawing, body=replace(drawing.body, length=1.1 * drawing.body.length))
    usual = found_with(card, drawing)
    for found in (found_with(stronger, drawing), found_with(card, longer)):
        for row in PREDICTED:
            before, after = figure_of(row, usual), figure_of(row, found)
            assert abs(after - before) > 1e-3 * abs(before), row.claim


def test_verdict_follows_from_value():
    assert judge(140.3, 140.0, within=0.5) == "within"
    assert judge(141.0, 140.0, within=0.5) == "contradicts"
    assert judge(40.0, 62.5, less_is_better=True) == "better"
    assert judge(70.0, 62.5, less_is_better=True) == "worse"
    assert judge(6.0, 4.6, more_is_better=True) == "better"
    assert is_larger(0.1, 0.0) == "within"
    assert is_larger(-0.1, 0.0) == "contradicts"
