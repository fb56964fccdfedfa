"""The virtual rig reproduces its documented values because an easier plant would improve all results."""

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
    """The peak forces of 5 mm, 1 Hz agree within 1 %."""
    force = peak_force(LUMPED["nominal"], MOTIONS["sine5mm1Hz"], current, degrees)
    assert force == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("start", "end"), [(0.0, 2.0), (0.0, 1.0), (1.0, 2.0)])
def test_step_response_takes_13_ms(start, end):
    """The time at 30 mm/s, the speed of the campaign, agrees within 1 ms."""
    plant = Plant(LUMPED["nominal"])
    n = 5000
    still, speed = np.zeros(n), np.full(n, 0.030)  # Constant displacement removes the spring force.
    before = plant.advance_many(still, speed, start, 20.0)[-1]
    after = plant.advance_many(still, speed, end, 20.0)
    risen = (after - before) / (after[-1] - before)
    assert 1e3 * STEP_S * (np.argmax(risen >= 1.0 - np.exp(-1.0)) + 1) == pytest.approx(13.5, abs=1.0)
