"""Answers from drawn dampers: the draws are even, the crossings and intervals those of closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from mrdamper.thermal.estimation.sampling import draw_evenly, first_crossing, interval_of, summarise_times


@given(rows=st.integers(1, 12), half=st.integers(13, 60), seed=st.integers(0, 1000))
def test_even_draws_have_means_of_zero_and_a_covariance_of_one(rows, half, seed):
    drawn = draw_evenly(np.random.default_rng(seed), rows, 2 * half)
    assert drawn.mean(axis=1) == pytest.approx(0.0, abs=1e-12)
    assert drawn @ drawn.T / (2 * half) == pytest.approx(np.eye(rows), abs=1e-9)


def test_with_few_columns_the_last_rows_are_even():
    drawn = draw_evenly(np.random.default_rng(0), 30, 20, least=4)
    assert drawn.mean(axis=1) == pytest.approx(0.0, abs=1e-12)
    assert drawn[-4:] @ drawn[-4:].T / 20 == pytest.approx(np.eye(4), abs=1e-9)


def test_the_interval_of_normal_numbers_is_theirs():
    values = norm.ppf((np.arange(20000) + 0.5) / 20000)
    middle, low, high = interval_of(values, 0.90)
    assert (float(middle), float(low), float(high)) == pytest.approx((0.0, -1.6449, 1.6449), abs=1e-3)


def test_crossings_are_between_samples_and_infinite_without_one():
    values = np.array([[0.0, 5.0, 0.0], [2.0, 6.0, 0.5], [4.0, 7.0, 0.7]])
    found = first_crossing(np.array([10.0, 20.0, 30.0]), values, 3.0)
    assert found.tolist() == [25.0, 10.0, math.inf]


def test_a_limit_that_some_reach_has_an_open_end():
    """Of ten dampers three never get there: the median is a time, the late end is none."""
    told = summarise_times(np.array([*range(100, 800, 100), *[math.inf] * 3], dtype=float), 403.15, 0.9, 1e3)
    assert told.not_reached == pytest.approx(0.3)
    assert 500.0 <= told.median_s <= 600.0
    assert (told.low_s, told.high_s) == (100.0, math.inf)
    assert "not reached within 17 min: 30 %" in str(told)


def test_times_are_told_in_minutes_and_degrees():
    told = summarise_times(np.array([60.0, 120.0, 180.0]), 403.15, 0.9, 1800.0)
    assert str(told) == "130 degC: 2.0 min (1.0 min to 3.0 min; not reached within 30 min: 0 %)"
    assert (told.limit_K, told.looked_s, told.not_reached) == (403.15, 1800.0, 0.0)


def test_a_curve_that_touches_a_limit_has_reached_it():
    time = np.array([0.0, 10.0, 20.0])
    values = np.array([[1.0, 3.0, 1.0], [3.0, 1.0, 2.0], [3.0, 4.0, 2.5]])
    assert first_crossing(time, values, 3.0).tolist() == [10.0, 0.0, math.inf]
    assert first_crossing(time, values, 2.0).tolist() == [5.0, 0.0, 10.0]


def test_an_odd_number_of_draws_lacks_one_opposite():
    drawn = draw_evenly(np.random.default_rng(1), 3, 9)
    assert drawn.shape == (3, 9)
    assert drawn[:, 5:] == pytest.approx(-drawn[:, :4])
    whole = draw_evenly(np.random.default_rng(1), 3, 10)
    assert whole @ whole.T / 10 == pytest.approx(np.eye(3), abs=1e-9)
    few = draw_evenly(np.random.default_rng(1), 4, 6)  # three pairs for four rows: left to chance
    assert few.shape == (4, 6)
    assert few.mean(axis=1) == pytest.approx(0.0, abs=1e-12)
