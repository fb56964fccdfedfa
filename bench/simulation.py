"""Simulation: one problem, every way to integrate it side by side, and what the kernel's other laws take.

A contender's error is the largest of its force from the closed form, over the largest force; one that errs by
more than ``problem.LIMIT`` is disqualified. Those that take a candidate at a time are timed on a share of the
problem, which their row names: time per candidate and sample is what is compared. ``full`` gives all of them
the whole problem.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from bench import integrators as ways
from bench.measure import Asked, Row, absent, judged, timed
from bench.native import CompilerMissingError
from bench.problem import LIMIT, STIFF, Problem
from mrdamper import core
from mrdamper.core import _kernel
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import COMMON, LAWS

__all__ = ["CONTENDERS", "SWEEPS", "Contender", "run"]

BARS = {"v4": 9.0, "baseline": 13.0}  # [ns]
OF_THE_REFERENCE = 1.15
ACCURATE = 1e-6  # what was asked of the kernel at 1 kHz
OF_LAWS = {
    "bouc-wen": {"yield_force": 500.0, "rho": 1500.0, "kappa": -0.4, "n": 1.6},
    "double-bouc-wen": {
        **{"yield_force": 500.0, "second_force": 200.0, "rho": 1500.0, "second_rho": 200.0},
        **{"kappa": -0.4, "n": 1.6},
    },
    "bingham": {"yield_force": 500.0, "yield_velocity": 0.01},
    "tanh": {"yield_force": 500.0, "slope": 50.0, "shift": 0.1},
    "series-valve": {
        **{
            "stiffness": 731.0,
            "offset": 48.0,
            "yield_force": 500.0,
            "thinning": 3.2,
            "thinning_exponent": 0.43,
        },
        **{"yield_velocity": 2.5e-3, "position_gain": -2.3, "gap_stiffness": 1.2e7, "gap": 1.67e-4},
        **{"gap_corner": 4.6e-5, "leak_damping": 3e4, "leak_exponent": 0.994},
    },
    "lugre": {
        **{"yield_force": 500.0, "rho": 1500.0, "static_excess": 0.4, "fade_velocity": 0.01},
        **{"bristle_damping": 600.0},
    },
    "spencer": {
        **{"yield_force": 800.0, "series_damping": 3e4, "inner_viscosity": 2500.0, "inner_stiffness": 5000.0},
        **{"rho": 1500.0, "kappa": -0.4, "n": 1.6},
    },
}
SUMS = {"double-bouc-wen": 17.0, "series-valve": 111.0, "bingham": 10.8, "tanh": 12.0}
"""Most that a candidate's Gram sums may take per sample [ns], at the widest instruction set."""


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
    """Return ensemble, long trace, stiff problem, accuracy against cost, instruction sets, the laws."""
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
    return [*rows, *_laws(Problem().record), *_sums()]


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


def _numbers(law: str) -> tuple[int, np.ndarray, list[int]]:
    """Return a law's number, its coefficients, and the places of those that it has of its own."""
    damper = Damper(LAWS[law], {name: Constant(value) for name, value in OF_LAWS[law].items()})
    values = np.ascontiguousarray(damper.coefficients_at(0.0)[:, 0])
    places = [*([1, 2] if law == "series-valve" else []), *range(len(COMMON), len(values))]
    return LAWS[law].kernel or 0, values, places


def _laws(record: core.Record) -> list[Row]:
    """Time one candidate at a time: the force alone, and with all the law's own tangents."""
    rows = []
    for law in OF_LAWS:
        number, values, own = _numbers(law)
        jobs = {
            f"{law}, force": partial(core.run, number, record, values),
            f"{law}, {len(own)} tangents": partial(core.run, number, record, values, own),
        }
        rows += _law_rows("the kernel's laws, one run of 10,000 samples", jobs, record.samples)
    return rows


def _sums() -> list[Row]:
    """Time the Gram sums of 8 candidates on 12 runs, as a fit asks for them, at every instruction set."""
    best, rows = _kernel.level(), []
    paths = [drive(Sine(0.006 + 0.001 * k, 1.0 + 0.2 * k), duration=3.0 - 0.04 * k, rate_Hz=1e3, command=0.0)
             for k in range(12)]  # fmt: skip
    records, zeros = [core.open_record(path) for path in paths], [np.zeros(len(path)) for path in paths]
    samples = 8 * sum(map(len, paths))
    for law in OF_LAWS:
        number, values, own = _numbers(law)
        near = np.random.default_rng(0).uniform(0.8, 1.2, (8, 12, len(values))) * values
        near[:, :, LAWS[law].names.index("viscous_exponent")] = 1.0
        if law not in ("bingham", "tanh", "series-valve", "lugre"):  # one curve a candidate, as in a fit
            near[:, :, -4:] = near[:, :1, -4:]
        places = sorted({0, 1, 2, *own})

        def sums(
            level: str, number: int = number, near: np.ndarray = near, places: list[int] = places
        ) -> None:
            _kernel.use_level(level)
            core.gram_sums(number, records, zeros, [0] * 12, near, places)

        jobs = {
            f"{law}, {len(places)} tangents, {level}": partial(sums, level)
            for level in _kernel.levels()[::-1]
        }
        made = _law_rows("Gram sums of 8 candidates on 12 runs of 3,000 samples", jobs, samples)
        _kernel.use_level(best)
        if law in SUMS and best == "v4":
            bar, ns = SUMS[law], made[0].ns_per_sample or 0.0
            asked = (Asked(f"Gram sums of {law}, {best}, per candidate and sample", bar, ns, "ns"),)
            made[0] = replace(made[0], bar=f"{bar:g} ns", asked=asked)
        rows += made
    return rows


def _law_rows(group: str, jobs: Mapping[str, Callable[[], object]], samples: int) -> list[Row]:
    """Return a row of each job, as a ratio to the first."""
    spent = timed(jobs, 15)
    first = next(iter(spent.values())).cpu_s
    return [
        Row(name, each.cpu_s, 1e9 * each.cpu_s / samples, each.cpu_s / first, group=group, spread=each.spread)
        for name, each in spent.items()
    ]
