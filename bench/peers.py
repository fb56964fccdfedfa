"""The kernel's integration of the Bouc-Wen law, compared with SciPy's odeint.

Both programs get the same coefficients and the same sine. The error is the largest deviation of the first
candidate's force from SciPy's LSODA at a tolerance of 1e-12, divided by the largest force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import cos, pi

import numpy as np

from bench.measure import Limit, Row, side_by_side
from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import COMMON, LAWS

AMPLITUDE_m, FREQUENCY_Hz, RATE_Hz = 0.010, 1.7, 1000.0
SHAPE = np.array([1.0, 1500.0, -0.4, 1.6])  # yield force [N], rho [1/m], kappa, n

Job = Callable[[], FloatArray]


@dataclass(frozen=True)
class Problem:
    """Candidates with random coefficients within 20 % of ``SHAPE`` on a sine; the first equals ``SHAPE``."""

    candidates: int = 512
    samples: int = 10_000

    @cached_property
    def values(self) -> FloatArray:
        """Yield force, rho, kappa and n of each candidate, shape (candidates, 4)."""
        values = SHAPE * np.random.default_rng(0).uniform(0.8, 1.2, (self.candidates, 4))
        values[0] = SHAPE
        return values

    @cached_property
    def times(self) -> FloatArray:
        return np.arange(self.samples) / RATE_Hz

    @cached_property
    def exact(self) -> FloatArray:
        """Return the force [N] of the first candidate by LSODA with small tolerances."""
        from scipy.integrate import solve_ivp

        motion, (_, rho, kappa, n) = Sine(AMPLITUDE_m, FREQUENCY_Hz), SHAPE
        turning = np.arange(0.25, FREQUENCY_Hz * self.times[-1], 0.5) / FREQUENCY_Hz

        def rate(time: float, w: FloatArray) -> list[float]:
            v, state = float(motion.velocity(time)), float(w[0])
            u = state if v > 0.0 else -state  # hysteresis variable, positive while loading
            return [rho * v * (1.0 - (u**n if u >= 0.0 else kappa * min(-u, 1.0) ** n))]

        force, w = np.zeros(self.samples), 0.0
        for begin, end in pairwise(np.unique([0.0, *turning, self.times[-1]]).tolist()):
            inside = np.flatnonzero((self.times > begin) & (self.times <= end))
            solution = solve_ivp(
                rate, (begin, end), [w], method="LSODA", t_eval=np.union1d(self.times[inside], end),
                rtol=1e-12, atol=1e-13,
            )  # fmt: skip
            force[inside], w = solution.y[0, : len(inside)], float(solution.y[0, -1])
        return force

    def error(self, force: FloatArray) -> float:
        """Return the largest error of the first candidate divided by the largest force."""
        off = np.abs(np.asarray(force) - self.exact)
        return float(off.max() / np.abs(self.exact).max()) if np.isfinite(off).all() else float("inf")


def kernel(problem: Problem) -> Job:
    """Return a function that integrates all candidates with the kernel's exact solution."""
    path = drive(Sine(AMPLITUDE_m, FREQUENCY_Hz), duration=problem.times[-1], rate_Hz=RATE_Hz, command=0.0)
    ones = {name: Constant(1.0) for name in ("yield_force", "rho", "kappa", "n")}
    row = Damper(LAWS["bouc-wen"], ones).coefficients_at(0.0)[:, 0]
    table = np.tile(row, (problem.candidates, 1, 1))
    table[:, 0, len(COMMON) :] = problem.values
    number, record = LAWS["bouc-wen"].kernel or 0, core.open_record(path)
    force = core.run(number, record, np.ascontiguousarray(table[0, 0]))[0]

    def job() -> FloatArray:
        core.squared_errors(number, [record], [problem.exact], [0], table)
        return force

    return job


def odeint(problem: Problem) -> Job:
    """Return a function that integrates the candidates one by one with SciPy's ``odeint`` (LSODA)."""
    from scipy.integrate import odeint as integrate

    omega = 2.0 * pi * FREQUENCY_Hz

    def slope(w: FloatArray, t: float, rho: float, kappa: float, n: float) -> float:
        u, v = float(w[0]), AMPLITUDE_m * omega * cos(omega * t)
        return rho * v * (1.0 - (1.0 if u * v >= 0.0 else kappa) * abs(u) ** n)

    def job() -> FloatArray:
        forces = []
        for size, *values in problem.values.tolist():
            state = integrate(slope, [0.0], problem.times, args=tuple(values), rtol=1e-6, atol=1e-8)
            forces.append(size * state[:, 0])
        return np.asarray(forces[0])

    return job


def run() -> list[Row]:
    """Measure the time per sample of the kernel (512 candidates) and of odeint (one candidate)."""
    group = "512 candidates x 10,000 samples"
    problems = {"mrdamper kernel": Problem(), "scipy odeint, rtol 1e-6, one candidate": Problem(candidates=1)}
    jobs = {
        name: prepare(each) for (name, each), prepare in zip(problems.items(), (kernel, odeint), strict=True)
    }
    errors = {name: problems[name].error(job()) for name, job in jobs.items()}
    sizes = {name: each.candidates * each.samples for name, each in problems.items()}
    rows = [
        replace(row, accuracy=f"{error:.1e} of the largest force")
        for row, error in zip(side_by_side(group, jobs, sizes), errors.values(), strict=True)
    ]
    limit = Limit("kernel: error divided by the largest force", 1e-6, errors[rows[0].contender], "-")
    return [replace(rows[0], limits=(limit,)), *rows[1:]]
