"""Cycles with known energy, spread, drift and delay give these values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.cycles import cycles
from mrdamper.data.diagnosis.repeatability import drift, estimate_lag, repeatability
from mrdamper.data.prepare import prepare_run
from mrdamper.excitation import Harmonics, Sine
from tests.support.campaigns import make_run

SINE = Sine(0.010, 1.0)


def _prepared(force, motion=SINE, duration=10.0, **how):
    time = np.arange(round(duration * 1000) + 1) / 1000.0
    return prepare_run(make_run(motion, {"force": force(time)}, duration=duration, **how))


@given(dashpot=st.floats(100.0, 1e4), spring=st.floats(-1e4, 1e4), preload=st.floats(-500.0, 500.0))
def test_dashpot_cycle_energy_matches_formula(dashpot, spring, preload):
    """A spring or a preload stores energy and returns all of it."""
    force = lambda t: dashpot * SINE.velocity(t) + spring * SINE.displacement(t) + preload  # noqa: E731
    found = cycles(_prepared(force))
    assert len(found) == 9
    expected = np.pi * dashpot * 2 * np.pi * 1.0 * 0.010**2
    np.testing.assert_allclose(found.energy_J, expected, rtol=1e-4, atol=1e-6 * abs(preload))
    np.testing.assert_allclose(found.period_s, 1.0)
    np.testing.assert_allclose(found.stroke_m, 0.020, rtol=1e-6)


def test_preload_dissipates_no_energy():
    """The cycles are not closed, because the centre of the motion moves by up to 2 mm in a cycle."""
    moving = Harmonics((0.010, 0.008), (1.0, 0.04), (0.0, 0.0))
    found = [
        cycles(_prepared(lambda t, preload=preload: 100.0 * moving.velocity(t) + preload, moving))
        for preload in (0.0, 500.0)
    ]
    assert len(found[0]) == len(found[1]) == 9
    np.testing.assert_allclose(found[1].energy_J, found[0].energy_J, rtol=1e-9)


def test_friction_cycle_energy_matches_formula():
    found = cycles(_prepared(lambda t: 300.0 * np.sign(SINE.velocity(t))))
    np.testing.assert_allclose(found.energy_J, 4 * 300.0 * 0.010, rtol=1e-3)
    assert {*found.highest_force_N.tolist(), *(-found.lowest_force_N).tolist()} == {300.0}


def test_periodic_run_has_zero_repeatability():
    assert repeatability(_prepared(SINE.velocity)) == pytest.approx(0.0, abs=1e-6)


def test_repeatability_equals_force_noise():
    rng = np.random.default_rng(0)
    force = lambda t: 1000.0 * SINE.velocity(t) + 2.0 * rng.standard_normal(len(t))  # noqa: E731
    spread = 1000.0 * 0.010 * 2 * np.pi / np.sqrt(2.0)
    percent = 100.0 * 2.0 / np.hypot(spread, 2.0)
    assert repeatability(_prepared(force, duration=30.0)) == pytest.approx(percent, rel=0.1)


def test_drift_compares_first_and_last_cycle():
    """The damping grows by 1 % and the mean force by 2 N in each cycle of one second."""
    force = lambda t: 1000.0 * SINE.velocity(t) * (1.0 + 0.01 * t) + 2.0 * t  # noqa: E731
    prepared = _prepared(force)
    found, count = drift(prepared), len(cycles(prepared))
    assert found is not None
    assert found.displacement_m == pytest.approx(0.0, abs=1e-9)
    assert found.force_N == pytest.approx(2.0 * (count - 1), rel=0.01)
    assert found.spread_percent == pytest.approx(1.0 * (count - 1), rel=0.1)


@given(delay=st.floats(-0.05, 0.05))
def test_delay_of_force_is_estimated(delay):
    prepared = _prepared(lambda t: SINE.velocity(t - delay))
    assert estimate_lag(prepared, 1.0) == pytest.approx(delay, abs=1e-5)
