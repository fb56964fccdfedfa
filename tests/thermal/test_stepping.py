"""Steps through time: they add up, grow, and end where they should; loads can be cut."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.errors import InputError
from mrdamper.thermal.model.stepping import Load, growing_steps, loads_until


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


@given(first=st.floats(1e-2, 60.0), times=st.floats(1.0, 100.0), longer=st.floats(1e-3, 200.0))
def test_steps_add_up_to_the_duration_and_grow_to_the_longest(first, times, longer):
    longest = first * times
    duration = longer * longest
    steps = growing_steps(duration, first, longest)
    assert sum(steps) == pytest.approx(duration, rel=1e-9)
    assert min(steps) > 0.0
    assert max(steps) <= longest * (1.0 + 1e-9)
    growing = [step for step in steps if step < steps[-1]]
    assert growing == sorted(growing)


@given(until=st.floats(0.0, 1000.0), durations=st.lists(st.floats(1.0, 300.0), min_size=1, max_size=6))
def test_loads_until_a_time_last_that_long_or_as_long_as_they_do(until, durations):
    loads = [Load(duration, constant(float(k)), coil_W=float(k)) for k, duration in enumerate(durations)]
    kept = loads_until(loads, until)
    assert sum(load.duration for load in kept) == pytest.approx(min(until, sum(durations)), abs=1e-6)
    assert [load.coil_W for load in kept] == [load.coil_W for load in loads[: len(kept)]]
    assert all(load.duration == whole.duration for load, whole in zip(kept[:-1], loads, strict=False))


def test_no_time_at_all_is_no_load():
    assert loads_until([Load(10.0, constant(1.0))], 0.0) == []


def test_a_power_that_is_none_is_refused():
    grid = np.linspace(300.0, 400.0, 5)
    for power in (lambda kelvin: kelvin * np.nan, lambda kelvin: np.zeros(3)):
        with pytest.raises(InputError, match="its power is not finite, or not one number per temperature"):
            Load(10.0, power).power_on(grid)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_load_lasts_a_while_and_its_coil_takes_nothing_at_the_least(value: float):
    assert Load(1e-9, constant(1.0), 0.0).coil_W == 0.0
    with pytest.raises(InputError, match=f"load: duration is {value} s; expected a positive, finite number"):
        Load(value, constant(1.0))
    with pytest.raises(InputError, match=f"load: coil heat is {value} W; expected zero or more, finite"):
        Load(1.0, constant(1.0), value)


def test_steps_grow_by_two_fifths_until_the_longest_and_then_share_what_is_left():
    assert growing_steps(100.0, 1.0, 5.0) == pytest.approx(
        [1.0, 1.4, 1.96, 2.744, 3.8416, *[89.0544 / 18.0] * 18]
    )
    assert growing_steps(10.0, 10.0, 10.0) == [10.0]
    assert growing_steps(0.5, 1.0, 60.0) == [0.5]
    assert growing_steps(30.0, 10.0, 10.0) == pytest.approx([10.0] * 3)
