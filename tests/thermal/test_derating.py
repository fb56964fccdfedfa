"""Derating: what the map allows keeps every limit, and it is the largest that does."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.jobs.options import DerateOptions
from mrdamper.jobs.thermal.derate import derate
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import OperatingEnvelope
from mrdamper.report.thermal.derate import REPORT
from mrdamper.schema import read_record
from mrdamper.thermal.derating import (
    Conditions,
    Quantity,
    _largest,
    _mean_load,
    _rise_factors,
    derate_damper,
)
from mrdamper.thermal.dissipation import tabulate_work
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import Duty, read_duty, segment_of
from mrdamper.thermal.limits import limits_of
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.temperature_rise import predict_rise
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


def test_at_the_largest_current_the_hottest_point_is_at_its_limit():
    """By the model of that very cell, built and run alone."""
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


def test_a_share_is_where_the_first_rise_crosses_its_limit_and_its_band_where_the_factors_do():
    """Rises in proportion to the share: what is allowed over what the whole duty brings."""
    limits, shares = limits_of(BARE), np.linspace(0.0, 1.0, 5)
    allowed = np.array([each.kelvin - 300.0 for each in limits])
    whole = allowed * np.array([1.25, 2.0, 1.6])
    rise = shares[:, None] * whole
    share, low, high, part = _largest(rise, limits, 300.0, np.array([0.8, 1.25]))
    assert (share, low, high, part) == pytest.approx((0.5, 0.4, 0.625, 1))
    assert _largest(0.3 * rise, limits, 300.0, np.array([0.8, 1.25])) == (1.0, 1.0, 1.0, -1.0)
    assert _largest(rise[-1:], limits, 300.0, np.array([0.8, 1.25])) == (1.0, 1.0, 1.0, -1.0)
    runs_away = np.where(shares[:, None] < 0.6, rise, np.inf)
    assert _largest(0.5 * runs_away, limits, 300.0, np.ones(2))[0] == pytest.approx(0.5)
    assert np.isnan(_largest(rise + 1.1 * allowed, limits, 300.0, np.ones(2))[0])  # rest itself is too much
    *nothing, part = _largest(np.full((5, 3), np.inf), limits, 300.0, np.ones(2))  # whatever is done
    assert np.isnan(nothing).all()
    assert part == -1


def test_a_share_of_a_duty_heats_by_its_part_of_the_time_its_current_s_square_or_a_smaller_motion():
    damper, kelvin = temperature_dependent(), np.array([320.0])
    longer = Duty((DUTY.segments[0], replace(DUTY.segments[0], path=None, duration=600.0)), "A", "")
    quantities: tuple[Quantity, ...] = ("current", "stroke", "duty")
    loads = {each: _mean_load(damper, BARE, longer, each, 0.6) for each in quantities}
    whole = _mean_load(damper, BARE, longer, "duty", 1.0)
    smaller = tabulate_work(damper, segment_of(Sine(0.009, 1.0), 2.0, 60.0)).power_at(kelvin)
    weaker = tabulate_work(damper, segment_of(Sine(0.015, 1.0), 1.2, 60.0)).power_at(kelvin)
    assert whole.coil_W == pytest.approx(2.0**2 * 4.2)
    assert loads["duty"].power(kelvin) == pytest.approx(0.6 * whole.power(kelvin))
    assert loads["duty"].coil_W == pytest.approx(0.6 * whole.coil_W)
    assert loads["current"].coil_W == pytest.approx(0.36 * whole.coil_W)
    assert loads["current"].power(kelvin) == pytest.approx(0.75 * weaker, rel=1e-6)
    assert loads["stroke"].coil_W == pytest.approx(whole.coil_W)
    assert loads["stroke"].power(kelvin) == pytest.approx(0.75 * smaller, rel=1e-3)


@pytest.mark.parametrize("quantity", one_by_day(["current", "stroke", "duty"]))
def test_warmer_air_longer_times_and_less_wind_allow_less(quantity: Quantity):
    found = derated(quantity)
    assert (np.diff(found.share, axis=2) <= 1e-6).all()
    assert (np.diff(found.share, axis=1) >= -1e-6).all()
    assert (np.diff(found.share, axis=0) <= 1e-6).all()
    low = np.nan_to_num(found.low)
    assert (low <= found.share + 1e-9).all()
    assert (found.share <= found.high + 1e-9).all()
    assert (low < found.high - 0.05).any()


def test_a_map_of_25_cells_takes_at_most_5_s_of_cpu_and_is_written_in_four_ways(tmp_path):
    started = time.process_time()
    run = derate(card(), BARE, DUTY, MAP)
    assert time.process_time() - started < 5.0
    answer = REPORT.answer(run)
    assert np.shape(answer["largest"]) == (2, 5, 5)
    assert answer["duration_min"] == [30.0, None]
    assert {each for rows in answer["limited_by"] for row in rows for each in row} <= {
        "fluid",
        "coil",
        "seals",
        None,
    }
    assert REPORT.rows is not None
    assert len(REPORT.rows(run)) == 50
    for each in REPORT.files:
        if each.write is not None and isinstance(each.name, str):
            each.write(run, tmp_path / each.name)
    header = (tmp_path / "derate.h").read_text(encoding="utf-8")
    assert "static const float derate_current[2][5][5]" in header
    assert REPORT.page is not None
    assert "Derating of" in REPORT.page.render(run)
    assert answer["notes"] == []


def test_a_map_beyond_the_card_says_so_first():
    small = replace(card(), envelope=replace(card().envelope, command=(0.0, 1.5)))
    run = derate(small, BARE, DUTY, replace(MAP, ambient_degC=(20.0,), air_m_s=(0.0,)))
    (note,) = run.notes
    assert "command runs from 2 to 2 A; the card was identified from 0 to 1.5 A" in note
    assert REPORT.page is not None
    assert "the card was identified from 0 to 1.5 A" in REPORT.page.render(run)


def test_axes_are_read_as_declared():
    """From the command line, a page or Python, each number in its range."""
    given = read_record(DerateOptions, {"ambient_degC": [20.0, 50.0], "duration_min": [10.0]}, "derate")
    assert (given.ambient_degC, given.duration_min) == ((20.0, 50.0), (10.0,))
    with pytest.raises(InputError, match="air_m_s"):
        read_record(DerateOptions, {"air_m_s": [90.0]}, "derate")


def test_axes_that_fall_and_an_ambient_above_a_limit_are_refused():
    with pytest.raises(InputError, match="expected rising numbers"):
        derate(card(), BARE, DUTY, DerateOptions(ambient_degC=(20.0, 0.0)))
    cool = replace(read_drawing("paper"), seals=replace(BARE.seals, limit=320.0))
    with pytest.raises(
        InputError, match=r"the ambient goes up to 50 degC, the limit of the seals is 46.85 degC"
    ):
        derate(card(), cool, DUTY, MAP)
    with pytest.raises(InputError, match="its command is in V"):
        derate(card(), BARE, Duty(DUTY.segments, "V", "volts"), MAP)


@pytest.mark.parametrize("axis", ["ambient", "air", "duration"])
@pytest.mark.parametrize("values", [[], [1.0, 1.0], [2.0, 1.0], [math.nan]])
def test_every_axis_rises_and_has_a_number(axis: str, values: list[float]):
    one = np.array([1.0])
    assert Conditions(one, one, np.array([1.0, np.inf])).duration[-1] == np.inf
    with pytest.raises(InputError, match=f"derating: {axis} is"):
        Conditions(**{**dict.fromkeys(("ambient", "air", "duration"), one), axis: np.array(values)})


def test_early_rises_differ_by_power_over_capacity_and_late_ones_by_power_over_losses():
    """Two deviations of 10 % at first; the losses' 25 % come in later: of cool dampers and of hot ones."""
    there = Conditions(np.array([293.15]), np.array([0.0]), np.array([60.0, np.inf]))
    load = Load(3600.0, lambda kelvin: np.full(np.shape(kelvin), 60.0))
    early, late = _rise_factors(BARE, load, 0.0, there)
    assert early[0] == pytest.approx(math.exp(-1.645 * math.hypot(0.1, 0.1)), abs=0.05)
    assert early[1] == pytest.approx(math.exp(1.645 * math.hypot(0.1, 0.1)), abs=0.08)
    assert late[0] < early[0] < 1.0 < early[1] < late[1]
    steady = math.hypot(0.1, 0.25) / 1.25  # losses grow as the rise to the power of 1.25 or so
    assert late == pytest.approx(np.exp([-1.645 * steady, 1.645 * steady]), rel=0.12)


def test_a_load_of_a_smaller_share_is_that_of_a_smaller_duty():
    nothing = _mean_load(temperature_dependent(), BARE, DUTY, "stroke", 0.0)
    assert float(nothing.power(np.array([300.0]))[0]) == 0.0
    assert nothing.coil_W == pytest.approx(16.8)
    still = _mean_load(temperature_dependent(), BARE, DUTY, "duty", 0.0)
    assert (float(still.power(np.array([300.0]))[0]), still.coil_W) == (0.0, 0.0)
