"""Ways to integrate the Bouc-Wen law: ours, the same tables in numba, and what one would take instead.

Each takes a ``Problem`` and returns a job without arguments that gives the first candidate's force [N]; what
it prepares once (compiling, sampling the motion) is not part of the job. An import that fails is the caller's
to tell.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from math import cos, pi

import numpy as np

from bench.problem import Problem
from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.models.laws import LAWS

__all__ = ["Job", "kernel", "numba_rk4", "numba_table", "odeint"]

Job = Callable[[], FloatArray]


def kernel(problem: Problem) -> Job:
    """Prepare the project's kernel: exact flow, one table a candidate."""
    number = LAWS["bouc-wen"].kernel or 0
    record, table, measured = problem.record, problem.coefficients, [problem.measured]
    force = core.run(number, record, np.ascontiguousarray(table[0, 0]))[0]

    def job() -> FloatArray:
        core.squared_errors(number, [record], measured, [0], table)
        return force

    return job


def numba_table(problem: Problem) -> Job:
    """Prepare the kernel's algorithm, by another hand and compiled by numba (``numba_peers``).

    Raises
    ------
    RuntimeError
        Its squared errors are not the kernel's.
    """
    errors_of = import_module("bench.numba_peers").table_errors
    pieces = problem.record.pieces
    first = np.array([*(piece[0] for piece in pieces), problem.samples])
    turns = np.array([*(piece[1] for piece in pieces), problem.trajectory.displacement[-1]])
    sides = np.array([float(piece[2]) for piece in pieces])
    x, force = problem.trajectory.displacement, np.empty(problem.samples)
    errors = np.empty(problem.candidates)

    def job() -> FloatArray:
        errors_of(x, problem.measured, first, turns, sides, problem.values, errors, force)
        return force

    job()
    number = LAWS["bouc-wen"].kernel or 0
    ours = core.squared_errors(number, [problem.record], [problem.measured], [0], problem.coefficients)[:, 0]
    if not np.allclose(errors, ours, rtol=2e-5, atol=1e-9):
        raise RuntimeError("the tables in numba do not give the kernel's squared errors")
    return job


def numba_rk4(problem: Problem) -> Job:
    """Prepare Runge-Kutta in time, one step a sample, compiled by numba."""
    errors_of = import_module("bench.numba_peers").rk4_errors
    velocity, rows, step = problem.velocity(), problem.values.T.copy(), 1.0 / problem.rate_Hz
    force = np.empty(problem.samples)

    def job() -> FloatArray:
        errors_of(velocity, problem.measured, step, rows, force)
        return force

    job()
    return job


def odeint(problem: Problem) -> Job:
    """Prepare ``scipy.integrate.odeint`` (LSODA), a candidate at a time, the rate in plain Python."""
    from scipy.integrate import odeint as integrate

    omega = 2.0 * pi * problem.shape.frequency_Hz
    speed = problem.shape.amplitude_m * omega

    def slope(w: FloatArray, t: float, rho: float, kappa: float, n: float) -> float:
        u, v = float(w[0]), speed * cos(omega * t)
        return rho * v * (1.0 - (1.0 if u * v >= 0.0 else kappa) * abs(u) ** n)

    def job() -> FloatArray:
        forces = []
        for size, *numbers in problem.values.tolist():
            found = integrate(slope, [0.0], problem.times, args=tuple(numbers), rtol=1e-6, atol=1e-8)
            forces.append(size * found[:, 0])
            error = problem.measured - forces[-1]
            float(error @ error)
        return np.asarray(forces[0])

    return job
