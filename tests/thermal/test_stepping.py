"""Time steps: they grow and add up to the duration; loads can be cut."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.thermal.model.stepping import Load, growing_steps, loads_until


def constant(watts: float):
    return lambda kelvin: np.full_like(kelvin, watts)


@given(first=st.floats(1e-2, 60.0), times=st.floats(1.0, 100.0), longer=st.floats(1e-3, 200.0))
def test_growing_steps_add_up_to_duration(first, times, longer):
    longest = first * times
    duration = longer * longest
    steps = growing_steps(duration, first, longest)
    assert sum(steps) == pytest.approx(duration, rel=1e-9)
    assert min(steps) > 0.0
    assert max(steps) <= longest * (1.0 + 1e-9)
    growing = [step for step in steps if step < steps[-1]]
    assert growing == sorted(growing)


@given(until=st.floats(0.0, 1000.0), durations=st.lists(st.floats(1.0, 300.0), min_size=1, max_size=6))
def test_cut_loads_last_until_the_time(until, durations):
    loads = [Load(duration, constant(float(k)), coil_W=float(k)) for k, duration in enumerate(durations)]
    kept = loads_until(loads, until)
    assert sum(load.duration for load in kept) == pytest.approx(min(until, sum(durations)), abs=1e-6)
    assert [load.coil_W for load in kept] == [load.coil_W for load in loads[: len(kept)]]
    assert all(load.duration == whole.duration for load, whole in zip(kept[:-1], loads, strict=False))
