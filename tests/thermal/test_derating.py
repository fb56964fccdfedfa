"""Permissible loads respect every temperature limit, and larger loads exceed a limit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mrdamper.jobs.options import DerateOptions
from mrdamper.jobs.thermal.derate import derate
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.report.thermal.derate import REPORT
from mrdamper.thermal.derating import (
    Conditions,
    Quantity,
    derate_damper,
)
from mrdamper.thermal.duty import read_duty
from tests.support.heated import predict_rise
from tests.support.tiers import one_by_day
from tests.thermal.test_rise import BARE, temperature_dependent

DUTY = read_duty("sine:15mm:1Hz:2A:1800s")
SMALL = Conditions(np.array([293.15, 313.15]), np.array([0.0, 2.0]), np.array([1800.0, np.inf]))
MAP = DerateOptions(duration_min=(30.0,))


def card() -> ModelCard:
    return ModelCard(
        title="",
        damper=temperature_dependent(),
        envelope=OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.2, 0.2), (273.15, 403.15)),
        evidence=Evidence(runs=(), method="by hand", cost=0.0, dataset_fingerprint=""),
    )


@cache
def derated(quantity: Quantity):
    return derate_damper(temperature_dependent(), BARE, DUTY, SMALL, quantity)


def test_largest_current_reaches_temperature_limit():
    """The reference is a separate simulation of one condition of the derating map."""
    found = derated("current")
    for a, ambient in enumerate(SMALL.ambient):
        share, part = found.share[0, 0, a], int(found.part[0, 0, a])
        assert 0.2 < share < 1.0
        there = replace(BARE, surroundings=replace(BARE.surroundings, ambient=float(ambient)))
        rise = predict_rise(
            temperature_dependent(), there, f"sine:15mm:1Hz:{2.0 * share:.6f}A:1800s", stop_at_limit=False
        )
        assert rise.limits[part].hottest == pytest.approx(found.limits[part].kelvin, abs=0.3)
        assert all(each.hottest < each.limit.kelvin + 0.3 for each in rise.limits)


@pytest.mark.parametrize("quantity", one_by_day(["current", "stroke", "duty"]))
def test_harder_conditions_lower_permissible_load(quantity: Quantity):
    found = derated(quantity)
    assert (np.diff(found.share, axis=2) <= 1e-6).all()
    assert (np.diff(found.share, axis=1) >= -1e-6).all()
    assert (np.diff(found.share, axis=0) <= 1e-6).all()
    low = np.nan_to_num(found.low)
    assert (low <= found.share + 1e-9).all()
    assert (found.share <= found.high + 1e-9).all()
    assert (low < found.high - 0.05).any()


def test_derating_map_is_written_in_four_formats(tmp_path):
    few = replace(MAP, ambient_degC=(20.0, 40.0), air_m_s=(0.0, 2.0))
    run = derate(card(), BARE, DUTY, few)
    answer = REPORT.answer(run)
    assert np.shape(answer["largest"]) == (2, 2, 2)
    assert answer["duration_min"] == [30.0, None]
    assert {each for rows in answer["limited_by"] for row in rows for each in row} <= {
        "fluid",
        "coil",
        "seals",
        None,
    }
    assert REPORT.rows is not None
    assert len(REPORT.rows(run)) == 8
    for each in REPORT.files:
        if each.write is not None and isinstance(each.name, str):
            each.write(run, tmp_path / each.name)
    header = (tmp_path / "derate.h").read_text(encoding="utf-8")
    assert "static const float derate_current[2][2][2]" in header
    assert REPORT.page is not None
    assert "Derating of" in REPORT.page.render(run)
    assert answer["notes"] == []
