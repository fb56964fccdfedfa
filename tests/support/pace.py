"""Present speed of this machine, so that limits of CPU time are comparable between machines.

A limit is stated in seconds of a reference machine: an idle core that needs ``REFERENCE_S`` for a fixed
computation. Shared machines are slower, sometimes much slower. A measured time is divided by the present
duration of the same computation and multiplied by ``REFERENCE_S``.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

__all__ = ["REFERENCE_S", "pace", "taken", "within_reach"]

REFERENCE_S = 0.0043
"""CPU time of the work below on a quiet core of an AMD EPYC, measured in seconds."""


def pace() -> float:
    """Return the present duration of the fixed computation divided by its reference duration."""
    begun = time.process_time()
    _work()
    return (time.process_time() - begun) / REFERENCE_S


def taken(job: Callable[[], object]) -> float:
    """Return the CPU time of a function [s], converted to the reference machine."""
    before, begun = pace(), time.process_time()
    job()
    spent = time.process_time() - begun
    return 2.0 * spent / (before + pace())


def within_reach(asked: float) -> float:
    """Return a limit of wall-clock time. The limit is ten times as long on a shared machine.

    ``MRDAMPER_QUIET`` states that no other program is running (`make release-check` sets this variable).
    """
    return asked if os.environ.get("MRDAMPER_QUIET") else 10.0 * asked


def _work() -> float:
    """Run typical work of the package: small arrays, calls, attributes, strings."""
    values = np.linspace(0.0, 1.0, 200)
    total, seen = 0.0, {}
    for k in range(1500):
        values = 0.5 * values + np.sqrt(values + 1.0)
        seen[f"{k % 50}:{values.size}"] = total
        for j in range(20):
            total += j * 0.5
        total += float(values[k % 200])
    return total + len(seen)
