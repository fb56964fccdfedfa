"""A run that the kernel simulates in several batches has the same force as in one batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper import core
from mrdamper.models.laws import LAWS
from tests.core.test_laws import FRICTION, TYPICAL, random_drive

PATIENCE = 1_000_000


def values_of(name: str) -> np.ndarray:
    """Return typical coefficients of the law of this name."""
    given = {**TYPICAL[name], **FRICTION}
    return np.array([given.get(c.name, c.default or 0.0) for c in LAWS[name].coefficients])


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize("size", [2, 7, 300])
def test_simulation_in_batches_equals_whole_run(name, size):
    """The force is bit-identical for any division of the samples into batches."""
    path, law, values = replace(random_drive(5), dead_band=1e-5), LAWS[name].kernel or 0, values_of(name)
    motion, state = np.zeros(core.MOTION_NUMBERS), np.zeros(core.STATE_NUMBERS)
    columns = (path.displacement, path.velocity, path.acceleration)
    held, forces, workspace = tuple(column[:0] for column in columns), [], core.Workspace()
    for begin in range(0, len(path), size):
        x, v, a = (np.concatenate([a, b[begin : begin + size]]) for a, b in zip(held, columns, strict=True))
        last = begin + size >= len(path)
        batch = core.open_batch(
            path.step, (x, v, a), motion, dead_band=path.dead_band, patience=PATIENCE, last=last
        )
        forces.append(core.carry(law, batch, values, state, workspace)[batch.behind :])
        keep = max(batch.samples - 1, 0)
        held = tuple(column[keep:].copy() for column in (x, v, a))
    whole, _ = core.run(law, core.open_record(path), values)
    np.testing.assert_array_equal(np.concatenate(forces), whole)
