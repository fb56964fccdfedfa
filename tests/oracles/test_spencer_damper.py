"""The simulated rig: facts that any damper keeps, and the order of its integrator."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.excitation import Sine
from tests.oracles.spencer_damper import SpencerDamper, simulate

pytestmark = pytest.mark.system

DAMPER = SpencerDamper()
SINE = Sine(10e-3, 2.0)
VOLTAGES = [0.0, 0.75, 2.25]


@pytest.mark.nightly
def test_the_integrator_is_of_fourth_order():
    """Halving the step divides the error by 16 while the slip keeps its sign (|slip| has a kink)."""

    def force(rate_Hz):
        return simulate(DAMPER, [Sine(4e-3, 2.0)], [1.5], duration_s=0.36, rate_Hz=rate_Hz)[2][0]

    finest = force(80_000.0)
    coarse, fine = (np.abs(force(5_000.0 * k)[::k] - finest[::16]).max() for k in (1, 2))
    assert coarse / fine == pytest.approx(16.0, rel=0.1)


@pytest.fixture(scope="module")
def driven():
    """Return time, displacement and force at three voltages."""
    return simulate(DAMPER, [SINE] * len(VOLTAGES), VOLTAGES, duration_s=2.3)


def test_the_hysteretic_force_stays_bounded(driven):
    """The state z is bounded by (A / (beta + gamma))^(1/2), and with it the force."""
    _, x, force = driven
    bound = np.sqrt(DAMPER.a / (DAMPER.beta + DAMPER.gamma))
    speed = 2 * np.pi * SINE.frequency * SINE.amplitude * 1.6
    for voltage, row in zip(VOLTAGES, force, strict=True):
        alpha, c0 = DAMPER.alpha + DAMPER.alpha_per_V * voltage, DAMPER.c0 + DAMPER.c0_per_V * voltage
        springs = DAMPER.k0 * 2 * 0.01 + DAMPER.k1 * (DAMPER.x0 + 0.01)
        assert np.abs(row).max() < alpha * bound + c0 * speed + springs
    assert np.isfinite(x).all()


def test_every_closed_cycle_takes_power(driven):
    time, x, force = driven
    cycle = (time >= 1.3) & (time <= 1.8)
    for displacement, row in zip(x, force, strict=True):
        assert np.trapezoid(row[cycle], displacement[cycle]) > 0.0


def test_the_damper_pushes_with_its_accumulator_alone_while_at_rest():
    force = simulate(DAMPER, [SINE], [1.5], duration_s=0.2)[2]
    assert force[0] == pytest.approx(-DAMPER.k1 * DAMPER.x0)
