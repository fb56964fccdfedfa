"""The recommended controller's step once more: slow, from the law's own formulas, without any table.

Coefficients come from the damper at every call, w from the curve looked up both ways, the current from a
bracketing root search. Estimators are the Python ones. Readings are taken as good.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.models.damper import Damper
from tests.oracles.estimators import AppliedCurrent, Motion, MotionFilter, Underway


@dataclass
class SlowController:
    """Preview, exact solve, reversal clamp; it remembers, unlike the one it is held against."""

    damper: Damper
    period: float
    preview: float
    margin: float
    motion: Motion | None = None

    def __post_init__(self) -> None:
        assert self.damper.actuation is not None
        self.filter = MotionFilter(self.period)
        self.current = AppliedCurrent(self.damper.actuation, self.period)
        self.underway: Underway = self.current.start()
        self.w = [0.0, 0.0]
        self.command = 0.0
        self.largest = self.damper.actuation.largest_command or 0.0
        c = self.coefficients(0.0, 293.15)
        self.travels = np.sinh(np.linspace(-4.5, 4.5, 400_001))
        self.curve = np.maximum.accumulate(core.curve(c["kappa"], c["n"], self.travels)[0])

    def step(self, ahead: float, displacement: float, kelvin: float) -> float:
        before, applied = self.motion, self.underway.applied
        self.motion = Motion(displacement) if before is None else self.filter.step(before, displacement)
        self.underway = self.current.step(self.underway, self.command)
        mean = 0.5 * (applied + self.underway.applied)
        v0 = 0.0 if before is None else before.velocity
        self.w = self.along(self.w, mean, kelvin, v0, self.motion.velocity, self.period)

        then = self.motion.after(self.preview)
        free = self.free()
        mean = 0.5 * (self.underway.applied + free)
        w = self.along(self.w, mean, kelvin, self.motion.velocity, then.velocity, self.preview)
        current = self.solve(ahead, then, w, kelvin)
        side = -1.0 if then.velocity < 0.0 else 1.0
        current = min(current, self.solve(ahead, then, [side, side], kelvin) + self.margin)
        current = self.before_play(current)
        self.command = min(max(current, 0.0), self.largest)
        return self.command

    def free(self) -> float:
        """Return the effective current at the preview with a held command, in steps of 1 % of a period."""
        assert self.damper.actuation is not None
        fine = AppliedCurrent(self.damper.actuation, self.period / 100.0)
        line = [c for c in (self.command, *self.underway.line) for _ in range(100)]
        # the commands that the fine observer still has on their way, newest first
        need = len(fine.start().line)
        state = Underway(
            self.underway.first, self.underway.second, self.underway.behind, tuple(line[100 : 100 + need])
        )
        for _ in range(round(100 * self.preview / self.period)):
            state = fine.step(state, self.command)
        return state.applied

    def before_play(self, felt: float) -> float:
        """Invert the hysteresis by its definition: the effective current rises with the lagged command."""
        assert self.damper.actuation is not None
        play = self.damper.actuation.hysteresis_width_A

        def excess(lagged: float) -> float:
            behind = min(max(self.underway.behind, lagged), lagged + 2.0 * play)
            return lagged + 0.5 * (behind - lagged) - felt

        return float(brentq(excess, felt - 1.0, felt + 1.0, xtol=1e-12))

    def coefficients(self, current: float, kelvin: float) -> dict[str, float]:
        row = self.damper.coefficients_at(min(max(current, 0.0), self.largest), kelvin)[:, 0]
        return dict(zip(self.damper.law.names, row.tolist(), strict=True))

    def along(
        self, w: list[float], current: float, kelvin: float, v0: float, v1: float, h: float
    ) -> list[float]:
        c = self.coefficients(current, kelvin)
        tolerance = v0 / (v0 - v1) if v0 * v1 < 0.0 else 1.0
        ways = [0.5 * h * v0 * tolerance, 0.5 * h * v1 * (1.0 - tolerance)]
        if v0 * v1 >= 0.0:
            ways = [0.5 * h * (v0 + v1)]
        out = []
        for state, rho in zip(w, (c["rho"], c.get("second_rho", c["rho"])), strict=True):
            moved = state
            for way in ways:
                if way != 0.0:
                    side = math.copysign(1.0, way)
                    moved = side * self.travelled(side * moved, rho * abs(way))
            out.append(moved)
        return out

    def travelled(self, u: float, tau: float) -> float:
        """Return u after a scaled travel, along the universal curve, looked up both ways."""
        start = float(np.interp(u, self.curve, self.travels))
        return float(np.interp(start + tau, self.travels, self.curve))

    def force(self, current: FloatArray, at: Motion, w: list[float], kelvin: float) -> FloatArray:
        rows = self.damper.coefficients_at(current, kelvin)
        c = dict(zip(self.damper.law.names, rows, strict=True))
        v = at.velocity
        bent = (max(abs(v), 1e-300) / 0.1) ** (c["viscous_exponent"] - 1.0)
        fade = np.exp(-((v / c["stribeck_velocity"]) ** 2))
        friction = (c["coulomb_friction"] + c["breakaway_friction"] * fade) * np.tanh(
            v / c["transition_velocity"]
        )
        yields = c["yield_force"] * w[0] + c["second_force"] * w[1]
        return np.asarray(
            c["viscosity"] * v * bent + c["stiffness"] * at.displacement + c["offset"] + friction + yields
        )

    def solve(self, wanted: float, at: Motion, w: list[float], kelvin: float) -> float:
        """Return the lowest current that gives the wanted force; else that which comes nearest to it."""
        grid = np.linspace(0.0, self.largest, 401)
        off = self.force(grid, at, w, kelvin) - wanted
        crossed = np.flatnonzero(np.signbit(off[:-1]) != np.signbit(off[1:]))
        if not crossed.size:
            return float(grid[np.argmin(np.abs(off))])
        low, high = grid[crossed[0]], grid[crossed[0] + 1]
        return float(
            brentq(
                lambda i: float(self.force(np.array([i]), at, w, kelvin)[0]) - wanted, low, high, xtol=1e-9
            )
        )
