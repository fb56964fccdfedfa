"""Simulation: one problem, every way to integrate it side by side.

A contender's error is the largest of its force from the closed form, over the largest force; one that errs by
more than ``problem.LIMIT`` is disqualified. Those that take a candidate at a time are timed on a share of the
problem, which their row names: time per candidate and sample is what is compared. ``full`` gives all of them
the whole problem.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from bench import integrators as ways
from bench.measure import Asked, Row, absent, judged, timed
from bench.native import CompilerMissingError
from bench.problem import LIMIT, STIFF, Problem
from mrdamper.core import _kernel

__all__ = ["CONTENDERS", "SWEEPS", "Contender", "run"]

BARS = {"v4": 9.0, "baseline": 13.0}  # [ns]
OF_THE_REFERENCE = 1.15
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
    Contender("plain C, exact-flow table (bench/reference.c)", ways.reference_c),
    Contender("plain C, RK4 (bench/rk4.c)", ways.rk4_c),
    Contender("numba, RK4, fastmath", ways.numba_rk4),
    Contender("JAX, RK4, scan + vmap", ways.jax_rk4, 64),
    Contender("diffrax, Tsit5, rtol 1e-7, vmap", partial(ways.diffrax_tsit5, tolerance=1e-7), 16, 5_000),
    Contender("scipy odeint, rtol 1e-6", ways.odeint, 1, 5_000),
    Contender("scikit-sundae CVODE, rtol 1e-6, Python right-hand side", ways.cvode, 1, 2_000),
    Contender("scipy solve_ivp RK45, rtol 1e-6", ways.solve_ivp, 1, 2_000),
    Contender("scipy solve_ivp LSODA, rtol 1e-6", partial(ways.solve_ivp, method="LSODA"), 1, 2_000),
    Contender("GNU Octave lsode, rtol 1e-6, its start included", ways.octave_lsode, 1, 5_000),
    Contender("NumPy, Euler's step", ways.explicit_euler, 512, 1_000),
)

SWEEPS: dict[str, tuple[Callable[..., ways.Job], str, tuple[Any, ...]]] = {
    "mrdamper kernel": (ways.kernel, "", ()),
    "plain C, exact-flow table": (ways.reference_c, "", ()),
    "plain C, RK4": (ways.rk4_c, "substeps", (1, 2, 4, 8, 16)),
    "numba, RK4": (ways.numba_rk4, "substeps", (1, 2, 4, 8, 16)),
    "JAX, RK4": (ways.jax_rk4, "substeps", (1, 4)),
    "diffrax, Tsit5": (ways.diffrax_tsit5, "tolerance", (1e-5, 1e-7, 1e-9)),
    "scipy odeint": (ways.odeint, "tolerance", (1e-3, 1e-5, 1e-7, 1e-9)),
    "scipy solve_ivp RK45": (ways.solve_ivp, "tolerance", (1e-4, 1e-6, 1e-8)),
    "scikit-sundae CVODE": (ways.cvode, "tolerance", (1e-4, 1e-6, 1e-8)),
    "GNU Octave lsode": (ways.octave_lsode, "tolerance", (1e-4, 1e-6, 1e-8)),
}
ONE_BY_ONE = {ways.odeint, ways.solve_ivp, ways.cvode, ways.octave_lsode}


def run(*, full: bool = False) -> list[Row]:
    """Return ensemble, long trace, stiff problem, accuracy against cost, instruction sets."""
    rows = _side_by_side("ensemble of 512 candidates x 10,000 samples", Problem(), CONTENDERS, full=full)
    rows[0] = _against_the_bars(rows, "ensemble")
    fast = [replace(each, candidates=1, samples=1_000_000) for each in CONTENDERS[:4]]
    fast += [replace(each, candidates=1, samples=10_000) for each in CONTENDERS[4:7]]
    trace = _side_by_side(
        "one trace of 1e6 samples", Problem(candidates=1, samples=1_000_000), fast, full=full
    )
    rows += [_against_the_bars(trace, "one trace"), *trace[1:]]
    stiff = [replace(each, candidates=1) for each in CONTENDERS[:3]]
    stiff.append(Contender("plain C, RK4, 16 steps a sample", partial(ways.rk4_c, substeps=16), 1))
    stiff += [replace(each, samples=2_000) for each in CONTENDERS[6:9]]
    group = "a textbook damper (A = 301, beta = gamma = 363 cm^-2, n = 2), one candidate"
    rows += _side_by_side(group, Problem(STIFF, candidates=1), stiff, full=full)
    rows += [*_sweep(), *_levels(rows[0])]
    return rows


# ------------------------------------------------------------------------------------ side by side


def _side_by_side(group: str, whole: Problem, contenders: Iterable[Contender], *, full: bool) -> list[Row]:
    """Return a row for each contender, gaps and wrong answers among them; the first one is the measure."""
    jobs: dict[str, ways.Job] = {}
    rows: dict[str, Row] = {}
    sizes: dict[str, int] = {}
    for each in contenders:
        share = replace(whole, candidates=each.candidates, samples=each.samples)
        problem = whole if full else share
        name = each.name
        if problem != whole:
            name += f"; on {problem.candidates} x {problem.samples:,}"
        try:
            job = each.make(problem)
        except (ImportError, CompilerMissingError) as fault:
            rows[name] = absent(each.name, fault, group)
            continue
        error = problem.error(job())
        said = f"{error:.1e} of the largest force"
        rows[name] = Row(name, accuracy=said, group=group, error=error)
        jobs[name], sizes[name] = job, problem.candidates * problem.samples
    spent = timed(jobs, 3 if full else 5)
    first = next(iter(spent))
    for name, found in spent.items():
        ns = 1e9 * found.cpu_s / sizes[name]
        ratio = ns / (1e9 * spent[first].cpu_s / sizes[first])
        timing = {"cpu_s": found.cpu_s, "wall_s": found.wall_s, "spread": found.spread}
        rows[name] = judged(replace(rows[name], ns_per_sample=ns, ratio=ratio, **timing), LIMIT)  # type: ignore[arg-type]
    return list(rows.values())


def _against_the_bars(rows: list[Row], what: str) -> Row:
    """Return the kernel's row with what was asked of it, beside the hand-written C."""
    ours, reference = rows[0], rows[1]
    assert "reference.c" in reference.contender
    asked = [Asked(f"kernel, {what}: error over the largest force", ACCURATE, ours.error or 0.0, "-")]
    if ours.ns_per_sample is not None and reference.ns_per_sample is not None:
        over = ours.ns_per_sample / reference.ns_per_sample
        asked.append(Asked(f"kernel over the plain C table kernel, {what}", OF_THE_REFERENCE, over, "x"))
    return replace(ours, asked=tuple(asked))


def _sweep() -> list[Row]:
    """Return error and cost of every integrator over its steps or tolerances: the picture's points."""
    rows, group = [], "accuracy against cost"
    for name, (make, knob, settings) in SWEEPS.items():
        problem = Problem(candidates=1 if make in ONE_BY_ONE else 64, samples=2_000)
        jobs: dict[str, ways.Job] = {}
        try:
            for setting in settings or (None,):
                options = {} if setting is None else {knob: setting}
                said = "" if setting is None else f", {knob} {setting:g}"
                jobs[f"{name}{said}"] = make(problem, **options)
        except (ImportError, CompilerMissingError) as fault:
            rows.append(absent(name, fault, group))
            continue
        errors = {title: problem.error(job()) for title, job in jobs.items()}
        for title, each in timed(jobs, 3).items():
            ns = 1e9 * each.cpu_s / (problem.candidates * problem.samples)
            said = f"{errors[title]:.1e} of the largest force"
            rows.append(Row(title, each.cpu_s, ns, accuracy=said, group=group, error=errors[title]))
    return rows


# ------------------------------------------------------------------------------------ the kernel alone


def _levels(kernel: Row) -> list[Row]:
    """Return the kernel's ensemble at each instruction-set level that this machine has."""
    group, problem = "the kernel by instruction set, ensemble", Problem()
    best, levels = _kernel.level(), _kernel.levels()[::-1]
    job = ways.kernel(problem)

    def ensemble(level: str) -> None:
        _kernel.use_level(level)
        job()

    spent = timed({level: partial(ensemble, level) for level in levels})
    _kernel.use_level(best)
    rows = []
    for level, each in spent.items():
        ns = 1e9 * each.cpu_s / (problem.candidates * problem.samples)
        ratio = each.cpu_s / spent[levels[0]].cpu_s
        bar = BARS.get(level)
        asked = () if bar is None else (Asked(f"kernel, {level}, per candidate and sample", bar, ns, "ns"),)
        rows.append(
            Row(
                level,
                each.cpu_s,
                ns,
                ratio,
                kernel.accuracy,
                "" if bar is None else f"{bar:g} ns",
                asked,
                group,
                spread=each.spread,
            )
        )
    return rows
