"""Runs with known truth, for the tests of this room: a motion in closed form through a damper of sign(v)."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.excitation import Motion, Sine

SINE = Sine(0.010, 2.0)


def dry_friction(velocity: FloatArray) -> FloatArray:
    """Return the force [N] of 1 kN, softened within 10 mm/s."""
    return np.asarray(1000.0 * np.tanh(velocity / 0.01), dtype=np.float64)


def fields_of_run(
    motion: Motion = SINE,
    *,
    duration: float = 5.0,
    rate_Hz: float = 1000.0,
    rest: float = 0.0,
    noise: float = 0.0,
    quantum: float = 0.0,
    seed: int = 0,
) -> dict[str, Any]:
    """Return the fields of a run: ``rest`` seconds at rest, then the motion, with sensor noise and steps."""
    time = np.arange(round((duration + rest) * rate_Hz) + 1) / rate_Hz
    since = np.maximum(time - rest, 0.0)
    x = np.where(time < rest, motion.displacement(0.0), motion.displacement(since))
    v = np.where(time < rest, 0.0, motion.velocity(since))
    if noise:
        x = x + noise * np.random.default_rng(seed).standard_normal(len(x))
    if quantum:
        x = np.round(x / quantum) * quantum
    return {
        "name": "run",
        "time": time,
        "displacement": x,
        "force": dry_friction(v),
        "command": np.full(len(time), 0.5),
        "command_unit": "A",
    }


def make_run(motion: Motion = SINE, changed: Mapping[str, Any] | None = None, **how: Any) -> RigRun:
    """Return a run; ``changed`` replaces fields, ``how`` goes to ``fields_of_run``."""
    fields = fields_of_run(motion, **how)
    return RigRun(**{**fields, **(changed or {})})
