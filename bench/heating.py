"""Heating for 30 min: the network against SciPy's solvers.

All solve the same problem: SciPy is given the network's own rate and its Jacobian. Errors are the largest of
the means of fluid, coil and wall at 5, 10, ... 30 min from a reference in fine steps by Radau's method. More
than ``LIMIT_K`` is out. What is made once is not counted: SciPy's tables as little as ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.measure import Asked, Row, judged, side_by_side
from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, NetworkSystem, simulate_network

__all__ = ["run"]

LIMIT_K = 0.1  # two thermocouples differ by more
MARKS_S = 300.0 * np.arange(1, 7)
DRAWING = read_drawing(Path(__file__).parents[1] / "examples" / "paper_damper.toml")
NETWORK = "30 min on the network of zones, the paper's damper with five fins"


def fading(kelvin: FloatArray) -> FloatArray:
    """Power that falls with temperature, as an MR damper's does."""
    return np.asarray(95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - DRAWING.surroundings.ambient))


DUTY = Load(1800.0, fading, 16.8)


def scipy_on(network: ThermalNetwork, load: Load, method: str, tolerance: float) -> Callable[[], FloatArray]:
    """Return a job that integrates a network by ``solve_ivp``; it gives the means [K] at the marks."""
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
            jac=jacobian,
        )  # fmt: skip
        return np.stack([found.y.T @ part for part in (network.fluid, network.coil, network.wall)])

    return job


def _at_marks(course: Heating) -> FloatArray:
    """Return the means of fluid, coil and wall at the marks: ends of steps, or between two by a cubic."""
    from scipy.interpolate import CubicSpline

    parts = (course.fluid, course.coil, course.wall)
    return np.stack([CubicSpline(course.time, part)(MARKS_S) for part in parts])


def run() -> list[Row]:
    """Return the comparison on half an hour of the paper's duty."""
    network = zone_network(DRAWING)
    truth = scipy_on(network, DUTY, "Radau", 1e-11)()
    jobs: dict[str, Callable[[], FloatArray]] = {
        "mrdamper network, steps up to 60 s": lambda: _at_marks(simulate_network(network, [DUTY])),
        "mrdamper network, steps up to 10 s": lambda: _at_marks(
            simulate_network(network, [DUTY], longest_step=10.0)
        ),
    }
    for method in ("LSODA", "BDF"):
        for tolerance in (1e-4, 1e-6):
            name = f"scipy {method}, rtol {tolerance:.0e}, our Jacobian"
            jobs[name] = scipy_on(network, DUTY, method, tolerance)
    rows = _compared(jobs, truth)
    assert rows[0].timing is not None
    rows[0] = replace(rows[0], asked=(Asked("network: 30 min", 5.0, 1e3 * rows[0].timing.cpu_s, "ms"),))
    return rows


def _compared(jobs: dict[str, Callable[[], FloatArray]], truth: FloatArray) -> list[Row]:
    """Return a row for each job, its error from the truth beside its time; the first is the measure."""
    errors = {name: float(np.abs(job() - truth).max()) for name, job in jobs.items()}
    rows = side_by_side(NETWORK, jobs, dict.fromkeys(jobs, 1))
    return [
        judged(
            replace(row, ns_per_sample=None, accuracy=f"{1e3 * error:.3g} mK", error=error),
            LIMIT_K,
        )
        for row, error in zip(rows, errors.values(), strict=True)
    ]
