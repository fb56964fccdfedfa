"""The damper ``nominal`` of the virtual rig has its documented forces and response time."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.excitation import MOTIONS
from mrdamper.virtual_rig.lumped import LUMPED
from mrdamper.virtual_rig.plant import STEP_S, Plant
from tests.oracles.paper_preset import peak_force


@pytest.mark.parametrize(
    ("current", "degrees", "expected"),
    [(2.0, 20.0, 1655.0), (2.0, 123.0, 1257.0), (0.0, 20.0, 307.0), (0.0, 123.0, 124.0)],
)
def test_nominal_damper_has_documented_peak_forces(current, degrees, expected):
    """The peak forces of a sine of 5 mm and 1 Hz agree with the documentation within 1 %."""
    force = peak_force(LUMPED["nominal"], MOTIONS["sine5mm1Hz"], current, degrees)
    assert force == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("start", "end"), [(0.0, 2.0), (0.0, 1.0), (1.0, 2.0)])
def test_force_step_response_takes_13_ms(start, end):
    """At 30 mm/s, the force needs 13.5 ms (within 1 ms) after a current step for 63 % of its change."""
    plant = Plant(LUMPED["nominal"])
    n = 5000
    # The displacement is constant so that the spring force does not change.
    still, speed = np.zeros(n), np.full(n, 0.030)
    before = plant.advance_many(still, speed, start, 20.0)[-1]
    after = plant.advance_many(still, speed, end, 20.0)
    risen = (after - before) / (after[-1] - before)
    assert 1e3 * STEP_S * (np.argmax(risen >= 1.0 - np.exp(-1.0)) + 1) == pytest.approx(13.5, abs=1.0)
