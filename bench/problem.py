"""The problem that every integrator is given: Bouc-Wen candidates driven by one sine, their squared errors.

All get the same: the candidates' coefficients, the motion in closed form, and its samples where they want
those. What each returns is compared with SciPy's LSODA at a tolerance of 1e-12, reversal by reversal, which
is no contender.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.excitation import Sine, Trajectory, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import COMMON, LAWS

__all__ = ["LIMIT", "STIFF", "USUAL", "Problem", "Shape"]

LIMIT = 1e-3
"""Largest error of a contender that counts, over the largest force; dampers are known to some 1e-2."""

CHECKED = 10_000  # samples whose exact force is worked out


@dataclass(frozen=True, slots=True)
class Shape:
    """A Bouc-Wen law's shape and the sine that drives it."""

    rho: float  # [1/m]
    kappa: float
    n: float
    amplitude_m: float
    frequency_Hz: float

    @property
    def motion(self) -> Sine:
        return Sine(self.amplitude_m, self.frequency_Hz)


USUAL = Shape(1500.0, -0.4, 1.6, 0.010, 1.7)
# The textbook's A = 301, beta = gamma = 363 cm^-2, n = 2 at 20 mm, 2 Hz; rho = A / z_m, z_m^2 = A / (2 beta).
STIFF = Shape(301.0 / np.sqrt(301.0 / 726e4), 0.0, 2.0, 0.020, 2.0)


@dataclass(frozen=True)
class Problem:
    """Candidates of one shape within 20 %, the first of them exactly it; the yield force is 1 N."""

    shape: Shape = USUAL
    candidates: int = 512
    samples: int = 10_000
    rate_Hz: float = 1000.0

    @cached_property
    def values(self) -> FloatArray:
        """Yield force, rho, kappa, n of each candidate, shape (candidates, 4)."""
        base = np.array([1.0, self.shape.rho, self.shape.kappa, self.shape.n])
        drawn = base * np.random.default_rng(0).uniform(0.8, 1.2, (self.candidates, 4))
        drawn[0] = base
        return drawn

    @cached_property
    def times(self) -> FloatArray:
        return np.arange(self.samples) / self.rate_Hz

    @cached_property
    def trajectory(self) -> Trajectory:
        end = (self.samples - 1) / self.rate_Hz
        return drive(self.shape.motion, duration=end, rate_Hz=self.rate_Hz, command=0.0)

    @cached_property
    def record(self) -> core.Record:
        return core.open_record(self.trajectory)

    @cached_property
    def exact(self) -> FloatArray:
        """The first candidate's force [N] of the first samples, integrated anew from each reversal."""
        shape, motion = self.shape, self.shape.motion
        times = self.times[:CHECKED]
        turning = np.arange(0.25, shape.frequency_Hz * times[-1], 0.5) / shape.frequency_Hz

        def rate(time: float, w: FloatArray) -> list[float]:
            v, state = float(motion.velocity(time)), float(w[0])
            u = state if v > 0.0 else -state  # positive while loading
            bend = u**shape.n if u >= 0.0 else shape.kappa * min(-u, 1.0) ** shape.n
            return [shape.rho * v * (1.0 - bend)]

        force, w = np.zeros(len(times)), 0.0
        for begin, end in pairwise(np.unique([0.0, *turning, times[-1]]).tolist()):
            inside = np.flatnonzero((times > begin) & (times <= end))
            found = solve_ivp(
                rate,
                (begin, end),
                [w],
                method="LSODA",
                t_eval=np.union1d(times[inside], end),
                rtol=1e-12,
                atol=1e-13,
            )
            force[inside], w = found.y[0, : len(inside)], float(found.y[0, -1])
        return force

    @cached_property
    def measured(self) -> FloatArray:
        """A force to take the error of [N], shape (samples,)."""
        tiled = np.resize(self.exact, self.samples)
        return np.ascontiguousarray(tiled)

    @cached_property
    def coefficients(self) -> FloatArray:
        """The candidates as the kernel takes them, shape (candidates, 1, coefficients)."""
        damper = Damper(
            LAWS["bouc-wen"], {name: Constant(1.0) for name in ("yield_force", "rho", "kappa", "n")}
        )
        table = np.tile(damper.coefficients_at(0.0)[:, 0], (self.candidates, 1, 1))
        table[:, 0, len(COMMON) :] = self.values
        return table

    def velocity(self) -> FloatArray:
        """Return the velocity [m/s] at each sample and between each two."""
        count = 2 * self.samples - 1
        return np.asarray(self.shape.motion.velocity(np.arange(count) / (2.0 * self.rate_Hz)))

    def error(self, force: FloatArray) -> float:
        """Return the first candidate's largest error over the largest force; inf where it is not finite."""
        count = min(len(force), len(self.exact))
        off = np.abs(np.asarray(force)[:count] - self.exact[:count])
        return float(off.max() / np.abs(self.exact).max()) if np.isfinite(off).all() else float("inf")
