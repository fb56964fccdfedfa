"""Simulation: one problem, ways to integrate it side by side.

A contender's error is the largest of its force from the closed form, over the largest force; one that errs by
more than ``problem.LIMIT`` is disqualified. Those that take a candidate at a time are timed on a share of the
problem, which their row names: time per candidate and sample is what is compared. ``full`` gives all of them
the whole problem.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from bench import integrators as ways
from bench.measure import Asked, Row, absent, judged, side_by_side
from bench.problem import LIMIT, STIFF, Problem
from mrdamper.core import _kernel

__all__ = ["run"]

BARS = {"v4": 9.0, "baseline": 13.0}  # [ns], of the ensemble by instruction set
OF_THE_SAME_TABLES = 1.15
ACCURATE = 1e-6  # what was asked of the kernel at 1 kHz


@dataclass(frozen=True, slots=True)
class Contender:
    """A way to integrate, and the share of the problem that it is timed on unless all is asked for."""

    name: str
    make: Callable[[Problem], ways.Job]
    candidates: int = 512
    samples: int = 10_000


CONTENDERS = (
    Contender("mrdamper kernel", ways.kernel),
    Contender("numba, the same tables", ways.numba_table),
    Contender("numba, RK4", ways.numba_rk4),
    Contender("scipy odeint, rtol 1e-6", ways.odeint, 1, 5_000),
)


def run(*, full: bool = False) -> list[Row]:
    """Return ensemble, long trace, stiff problem."""
    rows = _side_by_side("ensemble of 512 candidates x 10,000 samples", Problem(), CONTENDERS, full=full)
    asked, level = _asked(rows, "ensemble"), _kernel.level()
    if level in BARS and (ns := rows[0].ns_per_sample) is not None:
        figure = f"kernel, {level}, per candidate and sample"
        asked = (*asked, Asked(figure, BARS[level], ns, "ns"))
    trace = [replace(each, candidates=1, samples=1_000_000) for each in CONTENDERS[:3]]
    whole = Problem(candidates=1, samples=1_000_000)
    long = _side_by_side("one trace of 1e6 samples", whole, trace, full=full)
    stiff = [replace(each, candidates=1) for each in CONTENDERS]
    group = "a textbook damper (A = 301, beta = gamma = 363 cm^-2, n = 2), one candidate"
    hard = _side_by_side(group, Problem(STIFF, candidates=1), stiff, full=full)
    rows[0], long[0] = replace(rows[0], asked=asked), replace(long[0], asked=_asked(long, "one trace"))
    return [*rows, *long, *hard]


def _side_by_side(group: str, whole: Problem, contenders: Iterable[Contender], *, full: bool) -> list[Row]:
    """Return a row for each contender, gaps and wrong answers among them; the first one is the measure."""
    jobs: dict[str, ways.Job] = {}
    sizes: dict[str, int] = {}
    errors: dict[str, float] = {}
    gaps = []
    for each in contenders:
        problem = whole if full else replace(whole, candidates=each.candidates, samples=each.samples)
        share = "" if problem == whole else f"; on {problem.candidates} x {problem.samples:,}"
        try:
            job = each.make(problem)
        except ImportError as fault:
            gaps.append(absent(each.name, fault, group))
            continue
        name = each.name + share
        jobs[name], sizes[name] = job, problem.candidates * problem.samples
        errors[name] = problem.error(job())
    rows = side_by_side(group, jobs, sizes)
    return [*(_with_error(row, errors[row.contender]) for row in rows), *gaps]


def _with_error(row: Row, error: float) -> Row:
    return judged(replace(row, error=error, accuracy=f"{error:.1e} of the largest force"), LIMIT)


def _asked(rows: list[Row], what: str) -> tuple[Asked, ...]:
    """Return what was asked of the kernel, beside the same tables in numba."""
    ours, same = rows[0], rows[1]
    error = Asked(f"kernel, {what}: error over the largest force", ACCURATE, ours.error or 0.0, "-")
    if ours.ns_per_sample is None or same.ns_per_sample is None:
        return (error,)
    over = ours.ns_per_sample / same.ns_per_sample
    return error, Asked(f"kernel over the same tables in numba, {what}", OF_THE_SAME_TABLES, over, "x")
