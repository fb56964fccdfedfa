"""Heating for 30 min: the network against SciPy's solvers, finite elements against FreeFem++ and CalculiX.

All solve the same problem: SciPy is given the network's own rate (and, where it takes one, its Jacobian), the
programs the very mesh, films and sources. Errors are the largest of the means of fluid, coil and wall at 5,
10, ... 30 min from a reference in fine steps: of the network one by Radau's method, of the finite elements
ours in steps of 2 s, which the independent programs confirm (``heat_models``). More than ``LIMIT_K`` is out.
FreeFem++ is run in several steps of time; it is compared at the longest that errs no more than we do.

What is made once is not counted: SciPy's tables as little as ours, meshing and assembly with ours only where
the row says so, a program's own start not at all (an empty problem's time is taken off).
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from bench.heat_models import BARE, fading
from bench.measure import Asked, Row, absent, judged, timed
from mrdamper.arrays import FloatArray
from mrdamper.thermal.calculix import run_calculix, write_calculix
from mrdamper.thermal.cross_check import backward_euler
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.freefem import run_freefem, write_freefem
from mrdamper.thermal.model.finite_element import build_field, discretise
from mrdamper.thermal.model.heat_equation import FieldHeating, heat_through
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, _Stepper, heat_up
from mrdamper.thermal.programs import run_program
from tests.thermal.designs import DRAWING

__all__ = ["LIMIT_K", "MARKS_S", "run", "scipy_on"]

LIMIT_K = 0.1  # two thermocouples differ by more
MARKS_S = 300.0 * np.arange(1, 7)
DUTY = Load(1800.0, fading, 16.8)
NETWORK = "30 min on the network of zones, the paper's damper with five fins"
ELEMENTS = "30 min on the finite elements, nonlinear"
FROZEN = "30 min on the finite elements, films and sources frozen, 60 backward Euler steps"
FREEFEM_STEPS = (300.0, 150.0, 100.0, 60.0, 30.0)


def run(*, full: bool = False) -> list[Row]:
    """Return the three comparisons; ``full`` takes five fins for the finite elements, else none."""
    repeats = 5 if full else 3
    drawing = DRAWING if full else BARE
    return [*_networks(), *_elements(drawing, repeats), *_frozen(drawing, repeats)]


# ------------------------------------------------------------------------------------ the network


def scipy_on(
    network: ThermalNetwork, load: Load, method: str, tolerance: float, *, exact: bool = True
) -> Callable[[], FloatArray]:
    """Return a job that integrates a network by ``solve_ivp``; it gives temperatures at the marks [K].

    ``exact`` gives the solver the Jacobian, else it takes differences.
    """
    from scipy.integrate import solve_ivp

    stepper = _Stepper(network)
    stepper.take(load)
    start = np.full(len(network.names), network.ambient)

    def rate(_: float, state: FloatArray) -> FloatArray:
        return stepper.rate_and_jacobian(state)[0]

    def jacobian(_: float, state: FloatArray) -> FloatArray:
        return stepper.rate_and_jacobian(state)[1]

    def job() -> FloatArray:
        found = solve_ivp(  # type: ignore[call-overload]
            rate, (0.0, load.duration), start, method, MARKS_S, rtol=tolerance, atol=tolerance * 300.0,
            jac=jacobian if exact else None,
        )  # fmt: skip
        return np.asarray(found.y.T)

    return job


def _means(network: ThermalNetwork, state: FloatArray) -> FloatArray:
    return np.stack([state @ part for part in (network.fluid, network.coil, network.wall)])


def _at_marks(course: Heating | FieldHeating) -> FloatArray:
    """Return the means of fluid, coil and wall at the marks: ends of steps, or between two by a cubic."""
    from scipy.interpolate import CubicSpline

    parts = (course.fluid, course.coil, course.wall)
    return np.stack([CubicSpline(course.time, part)(MARKS_S) for part in parts])


def _networks() -> list[Row]:
    network = zone_network(DRAWING)
    truth = _means(network, scipy_on(network, DUTY, "Radau", 1e-11)())
    jobs: dict[str, Callable[[], FloatArray]] = {
        "mrdamper network, steps up to 60 s": lambda: _at_marks(heat_up(network, [DUTY])),
        "mrdamper network, steps up to 10 s": lambda: _at_marks(heat_up(network, [DUTY], longest_step=10.0)),
    }
    for method in ("LSODA", "BDF"):
        for tolerance in (1e-4, 1e-6):
            for exact in (True, False):
                name = f"scipy {method}, rtol {tolerance:.0e}, {'our' if exact else 'no'} Jacobian"
                job = scipy_on(network, DUTY, method, tolerance, exact=exact)
                jobs[name] = partial(_mean_of, network, job)
    rows = _side_by_side(NETWORK, jobs, truth, repeats=7)
    spent = rows[0].cpu_s
    assert spent is not None
    rows[0] = replace(rows[0], bar="5 ms", asked=(Asked("network: 30 min", 5.0, 1e3 * spent, "ms"),))
    return rows


def _mean_of(network: ThermalNetwork, job: Callable[[], FloatArray]) -> FloatArray:
    return _means(network, job())


def _side_by_side(
    group: str,
    jobs: dict[str, Callable[[], FloatArray]],
    truth: FloatArray,
    *,
    repeats: int,
    less_s: float = 0.0,
) -> list[Row]:
    """Return a row for each job, its error from the truth beside its time; the first is the measure.

    ``less_s`` is taken off the time of every job but ours.
    """
    errors = {name: float(np.abs(job() - truth).max()) for name, job in jobs.items()}
    spent = timed(jobs, repeats)
    first = next(iter(spent.values())).cpu_s
    rows = []
    for name, each in spent.items():
        cpu = each.cpu_s - (0.0 if name.startswith("mrdamper") else less_s)
        row = Row(
            name,
            cpu,
            ratio=cpu / first,
            accuracy=f"{1e3 * errors[name]:.3g} mK",
            group=group,
            wall_s=each.wall_s,
            spread=each.spread,
            error=errors[name],
        )
        rows.append(judged(row, LIMIT_K))
    return rows


# ------------------------------------------------------------------------------------ finite elements


def _elements(drawing: DamperDrawing, repeats: int) -> Iterator[Row]:
    """Compare half an hour of the nonlinear problem, ours with mesh and assembly and without."""
    model = build_field(drawing)
    reduced = reduce_field(model)
    truth = _at_marks(heat_through(model.equation, [DUTY], longest_step=2.0))
    ours = "mrdamper finite elements, steps up to 60 s, mesh and assembly included"
    jobs: dict[str, Callable[[], FloatArray]] = {
        ours: lambda: _at_marks(heat_through(build_field(drawing).equation, [DUTY])),
        "mrdamper finite elements, after assembly": lambda: _at_marks(heat_through(model.equation, [DUTY])),
        "mrdamper reduced model, 16 unknowns, after its build": lambda: _at_marks(
            heat_through(reduced.equation, [DUTY])
        ),
    }
    if shutil.which("FreeFem++") is None:
        yield from _side_by_side(ELEMENTS, jobs, truth, repeats=repeats)
        yield absent("FreeFem++", "the program is not installed", ELEMENTS)
        return
    with tempfile.TemporaryDirectory() as name:
        for step in FREEFEM_STEPS:
            folder = Path(name) / f"{step:g}"
            folder.mkdir()
            script = write_freefem(model, DUTY, folder, step=step)
            jobs[f"FreeFem++, steps of {step:g} s"] = partial(_freefem, script)
        rows = _side_by_side(ELEMENTS, jobs, truth, repeats=repeats, less_s=_empty_freefem(Path(name)))
    least = rows[0].error or 0.0
    equal = next(
        (row for row in rows if "FreeFem" in row.contender and (row.error or 0.0) <= least), rows[-1]
    )
    assert equal.ratio is not None
    over = Asked(
        f"finite elements: CPU over ours of FreeFem++ where it errs no more ({equal.contender})",
        3.0, equal.ratio, "x", at_least=True,
    )  # fmt: skip
    yield replace(rows[0], asked=(over,), bar="3 x faster than FreeFem++ at equal error")
    yield from rows[1:]


def _freefem(script: Path) -> FloatArray:
    found = run_freefem(script)
    where = np.searchsorted(found.time, MARKS_S - 1e-6)
    return np.stack([found.fluid, found.coil, found.wall])[:, where]


def _empty_freefem(folder: Path) -> float:
    """Return the CPU time [s] of a FreeFem++ that has nothing to do."""
    (folder / "empty.edp").write_text("real a = 1.;\n", encoding="utf-8")
    given = ["-nw", "-ne", "-v", "0", "empty.edp"]
    job = partial(run_program, "FreeFem++", given, folder, package="freefem++")
    return timed({"empty": job}, 3)["empty"].cpu_s


def _frozen(drawing: DamperDrawing, repeats: int) -> Iterator[Row]:
    """Compare with CalculiX on what it can do; the method is the same, so the truth is ours, node by node."""
    model = build_field(drawing)
    section, step, steps = model.section, 30.0, 60
    films = np.array([np.interp(section.ambient + 60.0, section.grid, row) for row in section.films])
    mechanical, coil = 75.0, 18.0
    steady = Load(step * steps, lambda kelvin: np.full(kelvin.shape, mechanical), coil)

    def ours() -> FloatArray:
        equation = discretise(section.with_constant_films(films), model.mesh).equation
        frozen = replace(equation, warming=0.0 * equation.warming, reference_growth=1.0)
        return backward_euler(frozen, steady, step=step, steps=steps) + section.ambient

    jobs: dict[str, Callable[[], FloatArray]] = {"mrdamper, assembly included": ours}
    missing = shutil.which("ccx") is None
    with tempfile.TemporaryDirectory() as name:
        if not missing:
            powers = {"mechanical_W": mechanical, "coil_W": coil}
            deck = write_calculix(model, films, Path(name), **powers, step=step, steps=steps)
            jobs["CalculiX, its start included"] = partial(run_calculix, deck, len(model.nodes))
        rows = _side_by_side(FROZEN, jobs, ours(), repeats=repeats)
    for row in rows:
        yield (
            row
            if "mrdamper" in row.contender
            else replace(row, accuracy=f"{row.accuracy} from ours, node by node")
        )
    if missing:
        yield absent("CalculiX", "the program ccx is not installed", FROZEN)
