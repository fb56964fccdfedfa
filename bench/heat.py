"""Heating for 30 min: run time and error of the zone network compared with SciPy's solvers.

All solvers solve the same problem: SciPy gets the right-hand side and Jacobian of the network. The error is
the largest deviation of the mean temperatures of fluid, coil and wall from Radau's method, every 5 min.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bench.measure import Row, side_by_side
from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, NetworkSystem, simulate_network

MARKS_S = 300.0 * np.arange(1, 7)
DRAWING = read_drawing(Path(__file__).parents[1] / "examples" / "paper_damper.toml")


def fading(kelvin: FloatArray) -> FloatArray:
    """Return a power [W] that decreases with temperature [K] like the power of an MR damper."""
    return np.asarray(95.0 - 0.25 * (np.clip(kelvin, 273.15, 473.15) - DRAWING.surroundings.ambient))


LOAD_CYCLE = Load(1800.0, fading, 16.8)


def scipy_on(network: ThermalNetwork, load: Load, method: str, tolerance: float) -> Callable[[], FloatArray]:
    """Return a function that integrates a network by ``solve_ivp`` and returns mean temperatures [K]."""
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
    """Interpolate the mean temperatures of fluid, coil and wall [K] at ``MARKS_S``."""
    from scipy.interpolate import CubicSpline

    parts = (course.fluid, course.coil, course.wall)
    return np.stack([CubicSpline(course.time, part)(MARKS_S) for part in parts])


def run() -> list[Row]:
    """Compare the solvers on 30 min of the load cycle of the reference paper."""
    network = zone_network(DRAWING)
    reference = scipy_on(network, LOAD_CYCLE, "Radau", 1e-11)()
    jobs: dict[str, Callable[[], FloatArray]] = {
        "mrdamper network, steps up to 60 s": lambda: _at_marks(simulate_network(network, [LOAD_CYCLE])),
        "mrdamper network, steps up to 10 s": lambda: _at_marks(
            simulate_network(network, [LOAD_CYCLE], longest_step=10.0)
        ),
    }
    for method in ("LSODA", "BDF"):
        for tolerance in (1e-4, 1e-6):
            name = f"scipy {method}, rtol {tolerance:.0e}, our Jacobian"
            jobs[name] = scipy_on(network, LOAD_CYCLE, method, tolerance)
    group = "30 min on the network of zones, the paper's damper with five fins"
    errors = {name: float(np.abs(job() - reference).max()) for name, job in jobs.items()}
    return [
        replace(row, ns_per_sample=None, accuracy=f"{1e3 * error:.3g} mK")
        for row, error in zip(side_by_side(group, jobs, dict.fromkeys(jobs, 1)), errors.values(), strict=True)
    ]
