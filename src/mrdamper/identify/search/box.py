"""The box of a search: coordinates and bounds of the nonlinear parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.identify.problem import FitProblem


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """The search coordinates of a problem's nonlinear parameters: logarithms where the scale is one."""

    low: FloatArray
    high: FloatArray
    log: BoolArray

    @classmethod
    def of(cls, problem: FitProblem) -> Box:
        free = problem.nonlinear
        return cls(
            np.array([float(f.to_search(f.lower)) for f in free]),
            np.array([float(f.to_search(f.upper)) for f in free]),
            np.array([f.scale == "log" for f in free], dtype=np.bool_),
        )

    def to_physical(self, points: FloatArray) -> FloatArray:
        """Return the values at points, shape (.., parameters)."""
        return np.exp(points, where=self.log, out=points.copy())

    def to_search(self, values: FloatArray) -> FloatArray:
        """Return the points of values, brought inside the box."""
        points = np.log(np.maximum(values, 1e-300), where=self.log, out=values.copy())
        return np.clip(points, self.low, self.high)

    def at_bound(self, points: FloatArray) -> BoolArray:
        """Say which coordinates sit on a bound."""
        return np.asarray((points <= self.low) | (points >= self.high))
