"""What must hold before any figure counts: ``python -m bench --check``.

The contenders solve the problem that they are given, a wrong answer is out however quick, and the kernel
takes no more instructions than it did (``bench.instructions``).
"""

from __future__ import annotations

import sys

import numpy as np

from bench import instructions, integrators
from bench.controller import DAMPER, _told
from bench.growth import exponent
from bench.measure import Row, judged, table, timed
from bench.plain import PlainBank
from bench.problem import LIMIT, STIFF, Problem
from mrdamper.control.controllers import controllers_for
from mrdamper.control.stepper import Flag

__all__ = ["check"]


def check() -> None:
    """Check all; end the program with a message at the first thing that does not hold."""
    for holds, said in (
        (_measures(), "how times are measured"),
        (_integrators(), "integrators"),
        (_bank(), "bank"),
    ):
        if not holds:
            sys.exit(f"bench: {said}: not what it should be; see bench/check.py")
    sys.exit(instructions.check())


def _measures() -> bool:
    """Check that jobs take turns, a cubic cost has exponent three, and NaN is within no limit."""
    order: list[str] = []
    timed({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, repeats=3)
    sizes = [1e4, 1e5, 1e6]
    rows = [judged(Row("quick", 1e-9, ratio=0.01, error=off), 1e-3) for off in (2e-3, np.inf, np.nan)]
    return (
        order == ["a", "b"] * 4
        and abs(exponent(sizes, [1e-9 * n**3 for n in sizes]) - 3.0) < 1e-9
        and all(
            row.state == "disqualified" and "| out |" in table("t", [row, Row("first", 1.0)]) for row in rows
        )
        and judged(Row("right", 1.0, ratio=1.0, error=1e-3), 1e-3).ratio == 1.0
    )


def _integrators() -> bool:
    """Check that the C beside the kernel agrees, and that RK4 converges but leaves a textbook damper."""
    problem, stiff = Problem(candidates=24, samples=3_000), Problem(STIFF, candidates=1, samples=1_000)
    coarse, fine = (problem.error(integrators.rk4_c(problem, n)()) for n in (1, 16))
    theirs, ours = integrators.reference_errors(problem), integrators.kernel_errors(problem)
    return (
        np.allclose(theirs, ours, rtol=2e-5, atol=1e-9)
        and fine < 1e-6
        and coarse > 30.0 * fine
        and stiff.error(integrators.rk4_c(stiff)()) > 100.0 * LIMIT
        and stiff.error(integrators.kernel(stiff)()) < 1e-6
        and problem.error(np.full(3_000, np.nan)) == np.inf
    )


def _bank() -> bool:
    """Check that the plain bank gives our commands to 1 mA, where a current gives the force."""
    paper = controllers_for(DAMPER)["paper"]
    rows = _told(paper)[:600]
    plain = PlainBank(DAMPER, paper)
    found = np.array([plain.step(row[0], row[2], row[3]) for row in rows.tolist()])
    _, current, flags = paper.run(paper.start(), rows)
    return bool(
        np.abs(found - current)[(flags & int(Flag.INFEASIBLE)) == 0].max() < 1e-3 and np.ptp(current) > 0.5
    )
