"""Two bodies from a warm-up: known ones come back, heat is kept, and the observer needs no more than that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.control.bodies import Bodies, identify_bodies, warm_bodies
from mrdamper.control.estimators import BodyObserver
from mrdamper.errors import InputError

KNOWN = Bodies(conductance_W_K=6.0, fluid_capacity_J_K=150.0, body_capacity_J_K=950.0, loss_W_K=2.0)
AMBIENT = 293.15
TIME = np.linspace(0.0, 1800.0, 361)


def power(seed: int = 0) -> np.ndarray:
    """Return a drive's power [W]: it changes every minute, and stops for five."""
    levels = np.random.default_rng(seed).uniform(60.0, 260.0, 31)
    levels[14:19] = 0.0
    return np.repeat(levels, 12)[: len(TIME)]


def test_known_bodies_come_back_within_their_standard_errors():
    """0.3 K of noise, eight seeds: G within 6 %, all within four standard errors."""
    off = []
    for seed in range(8):
        body = warm_bodies(KNOWN, TIME, power(seed), ambient=AMBIENT)[1]
        read = body + 0.3 * np.random.default_rng(100 + seed).standard_normal(len(body))
        found = identify_bodies(TIME, read, power(seed), fluid_capacity_J_K=150.0, ambient=AMBIENT)
        numbers = [(b.conductance_W_K, b.body_capacity_J_K, b.loss_W_K) for b in (found, KNOWN)]
        off.append(np.log(numbers[0]) - np.log(numbers[1]))
        assert abs(off[-1][0]) < 0.06
        assert (np.abs(off[-1]) < 4.0 * np.array(found.errors)).all()


def test_a_thermocouple_s_lag_does_not_count_as_the_fluid_s():
    body = warm_bodies(KNOWN, TIME, power(), ambient=AMBIENT, sensor_lag_s=10.0)[1]
    right = identify_bodies(TIME, body, power(), fluid_capacity_J_K=150.0, ambient=AMBIENT, sensor_lag_s=10.0)
    wrong = identify_bodies(TIME, body, power(), fluid_capacity_J_K=150.0, ambient=AMBIENT)
    assert right.conductance_W_K == pytest.approx(6.0, rel=1e-3)
    assert wrong.conductance_W_K < 5.0


def test_the_heat_that_comes_in_is_stored_or_lost():
    watts = power()
    fluid, body = warm_bodies(KNOWN, TIME, watts, ambient=AMBIENT)
    stored = 150.0 * (fluid[-1] - AMBIENT) + 950.0 * (body[-1] - AMBIENT)
    lost = 2.0 * np.trapezoid(body - AMBIENT, TIME)
    assert stored + lost == pytest.approx(np.sum(watts[:-1] * np.diff(TIME)), rel=1e-3)


def test_at_even_power_the_temperatures_are_the_conductances_own():
    time = np.linspace(0.0, 35_940.0, 600)
    fluid, body = warm_bodies(KNOWN, time, np.full(len(time), 120.0), ambient=AMBIENT)
    assert body[-1] - AMBIENT == pytest.approx(120.0 / 2.0, rel=1e-3)
    assert fluid[-1] - body[-1] == pytest.approx(120.0 / 6.0, rel=1e-3)


def test_an_observer_with_the_identified_conductance_finds_the_fluid():
    """It never saw the true one: 1.5 K rms where the body alone is 20 K and more off."""
    watts = power(3)
    fluid, body = warm_bodies(KNOWN, TIME, watts, ambient=AMBIENT)
    read = body + 0.3 * np.random.default_rng(7).standard_normal(len(body))
    found = identify_bodies(TIME, read, watts, fluid_capacity_J_K=150.0)
    observer = BodyObserver(
        conductance_W_K=found.conductance_W_K, fluid_capacity_J_K=150.0, period_s=float(TIME[1])
    )
    state, seen = observer.start(read[0]), [read[0]]
    for k in range(len(TIME) - 1):
        state = observer.step(state, read[k], watts[k])
        seen.append(state)
    assert np.sqrt(np.mean((body - fluid) ** 2)) > 20.0
    assert np.sqrt(np.mean((np.array(seen) - fluid) ** 2)) < 1.5


def test_a_tenth_more_fluid_is_a_tenth_more_conductance():
    """Body and power tell three numbers of four."""
    body = warm_bodies(KNOWN, TIME, power(), ambient=AMBIENT)[1]
    found = identify_bodies(TIME, body, power(), fluid_capacity_J_K=165.0, ambient=AMBIENT)
    assert found.conductance_W_K == pytest.approx(6.6, rel=0.03)
    again = warm_bodies(replace(found), TIME, power(), ambient=AMBIENT)[1]
    assert np.abs(again - body).max() < 0.2


def test_a_log_that_hardly_warms_is_refused():
    body = np.full(len(TIME), AMBIENT)
    with pytest.raises(InputError, match=r"moves by 0 K; expected at least 5 K.*Log a longer drive"):
        identify_bodies(TIME, body, power(), fluid_capacity_J_K=150.0)


def test_a_log_of_unequal_lengths_is_refused():
    with pytest.raises(InputError, match="lengths are 361, 360, 361"):
        identify_bodies(TIME, np.zeros(360), power(), fluid_capacity_J_K=150.0)
