"""What must hold before any figure counts: how times are judged, and the kernel's instructions."""

from __future__ import annotations

import numpy as np

from bench import instructions
from bench.growth import line
from bench.measure import Row, judged, table, timed

__all__ = ["check"]


def check() -> str | None:
    """Return what does not hold: turns, wrong answers that are out, fixed costs, instructions."""
    order: list[str] = []
    timed({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, repeats=3)
    rows = [judged(Row("quick", ratios=(0.01,), error=off), 1e-3) for off in (2e-3, np.inf, np.nan)]
    out = all(row.state == "disqualified" and "| out |" in table("t", [row, Row("first")]) for row in rows)
    fixed, each = line([10, 100, 1000], [3.0 + 0.1 * n for n in (10, 100, 1000)])
    if order != ["a", "b"] * 4 or not out or abs(fixed - 3.0) + abs(each - 0.1) > 1e-9:
        return "bench: times are not judged as they should be; see bench/check.py"
    return instructions.check()
