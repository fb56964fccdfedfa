"""Heating for 30 min: the network against SciPy's solvers, finite elements beside their reduced model.

All solve the same problem: SciPy is given the network's own rate (and, where it takes one, its Jacobian).
Errors are the largest of the means of fluid, coil and wall at 5, 10, ... 30 min from a reference in fine
steps: of the network one by Radau's method, of the finite elements ours in steps of 2 s, which independent
programs confirm (``tests/oracles``). More than ``LIMIT_K`` is out.

What is made once is not counted: SciPy's tables as little as ours, meshing and assembly with ours only where
the row says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from bench.measure import Asked, Row, judged, timed
from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.heat_equation import FieldHeating, simulate_field
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, NetworkSystem, simulate_network

__all__ = ["LIMIT_K", "MARKS_S", "run", "scipy_on"]

LIMIT_K = 0.1  # two thermocouples differ by more
MARKS_S = 300.0 * np.arange(1, 7)
DRAWING = read_drawing(Path(__file__).parents[1] / "examples" / "paper_damper.toml")
NETWORK = "30 min on the network of zones, the paper's damper with five fins"
ELEMENTS = "30 min on the finite elements, nonlinear"


def fading(kelvin: FloatArray) -> FloatArray:
    """Power that falls with temperature, as an MR damper's does."""
    return np.asarray(95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - DRAWING.surroundings.ambient))


DUTY = Load(1800.0, fading, 16.8)


def run(*, full: bool = False) -> list[Row]:
    """Return both comparisons; ``full`` takes five fins for the finite elements, else none."""
    repeats = 5 if full else 3
    drawing = DRAWING if full else DRAWING.with_sink(None)
    return [*_networks(), *_elements(drawing, repeats)]


# ------------------------------------------------------------------------------------ the network


def scipy_on(
    network: ThermalNetwork, load: Load, method: str, tolerance: float, *, exact: bool = True
) -> Callable[[], FloatArray]:
    """Return a job that integrates a network by ``solve_ivp``; it gives temperatures at the marks [K].

    ``exact`` gives the solver the Jacobian, else it takes differences.
    """
    from scipy.integrate import solve_ivp

    system = NetworkSystem(network)
    system.take(load)
    start = np.full(len(network.names), network.ambient)

    def rate(_: float, state: FloatArray) -> FloatArray:
        return system.rate_and_jacobian(state)[0]

    def jacobian(_: float, state: FloatArray) -> FloatArray:
        return system.rate_and_jacobian(state)[1]

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
        "mrdamper network, steps up to 60 s": lambda: _at_marks(simulate_network(network, [DUTY])),
        "mrdamper network, steps up to 10 s": lambda: _at_marks(
            simulate_network(network, [DUTY], longest_step=10.0)
        ),
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
) -> list[Row]:
    """Return a row for each job, its error from the truth beside its time; the first is the measure."""
    errors = {name: float(np.abs(job() - truth).max()) for name, job in jobs.items()}
    spent = timed(jobs, repeats)
    first = next(iter(spent.values())).cpu_s
    rows = []
    for name, each in spent.items():
        row = Row(
            name,
            each.cpu_s,
            ratio=each.cpu_s / first,
            accuracy=f"{1e3 * errors[name]:.3g} mK",
            group=group,
            wall_s=each.wall_s,
            spread=each.spread,
            error=errors[name],
        )
        rows.append(judged(row, LIMIT_K))
    return rows


# ------------------------------------------------------------------------------------ finite elements


def _elements(drawing: DamperDrawing, repeats: int) -> list[Row]:
    """Compare half an hour of the nonlinear problem, ours with mesh and assembly and without."""
    model = build_field(drawing)
    reduced = reduce_field(model)
    truth = _at_marks(simulate_field(model.equation, [DUTY], longest_step=2.0))
    ours = "mrdamper finite elements, steps up to 60 s, mesh and assembly included"
    jobs: dict[str, Callable[[], FloatArray]] = {
        ours: lambda: _at_marks(simulate_field(build_field(drawing).equation, [DUTY])),
        "mrdamper finite elements, after assembly": lambda: _at_marks(simulate_field(model.equation, [DUTY])),
        "mrdamper reduced model, 16 unknowns, after its build": lambda: _at_marks(
            simulate_field(reduced.equation, [DUTY])
        ),
    }
    return _side_by_side(ELEMENTS, jobs, truth, repeats=repeats)
