"""Gram matrices of the tangents and the residual over the runs, for least squares.

One kernel call evaluates all runs with constant current and temperature, for many candidates. Runs with
changing current or temperature, and laws in Python, are evaluated one by one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.identify.windows import FitWindow
from mrdamper.models.damper import Damper
from mrdamper.models.operating_points import OperatingPoints
from mrdamper.models.simulate import operating_point, require_temperature
from mrdamper.models.tangents import Tangents
from mrdamper.runtime.pool import thread_count


class GramSums:
    """Weighted Gram matrices of the residual and of the force derivatives (tangents).

    A tangent is the derivative of the force with respect to one of the ``wanted`` parameters. The ``varying``
    parameters differ between candidates (parameter sets). All other parameters have the values of the damper.
    The rows of a matrix are the wanted parameters, followed by the residual.
    """

    def __init__(
        self, damper: Damper, varying: Sequence[str], wanted: Sequence[str], runs: Sequence[FitWindow]
    ) -> None:
        self._damper = damper
        self._varying, self._wanted = tuple(varying), tuple(wanted)
        self._size = len(wanted) + 1
        for run in runs:
            require_temperature(damper, run.drive.trajectory)
        # Runs with equal command and temperature are in one group. The point of a run is None if the command
        # or the temperature changes, or if the law is in Python.
        warm = damper.temperature_dependent
        points = [operating_point(run.drive, temperature_dependent=warm) for run in runs]
        if damper.law.kernel is None:
            points = [None] * len(runs)
        self._single = [run for run, point in zip(runs, points, strict=True) if point is None]
        groups = list(dict.fromkeys(point for point in points if point is not None))
        steady = sorted((groups.index(point), k) for k, point in enumerate(points) if point is not None)
        self._runs = [runs[k] for _, k in steady]
        self._group = np.array([group for group, _ in steady], dtype=np.intp)
        self._first = np.searchsorted(self._group, range(len(groups)))  # index of each group's first run
        self._weight = np.array([run.weight for run in self._runs])[:, None]
        if not steady:
            return
        self._levels = OperatingPoints(
            damper,
            self._varying,
            self._wanted,
            np.array([point[0] for point in groups], dtype=np.float64),
            np.array([point[1] for point in groups], dtype=np.float64),
        )
        self._records = tuple(run.drive.record for run in self._runs)
        self._measured = tuple(run.force for run in self._runs)
        self._starts = tuple(run.start for run in self._runs)
        # The kernel returns tangents of coefficients and the residual. For each group of runs, a matrix
        # converts the tangents of coefficients to tangents of parameters.
        width = len(self._levels.places) + 1
        self._spread = np.zeros((1, len(groups), self._size, width))
        self._spread[..., : len(wanted), : len(self._levels.places)] = self._levels.combine
        self._spread[..., -1, -1] = 1.0

    def evaluate(self, values: FloatArray) -> FloatArray:
        """Return one Gram matrix for each candidate (row of ``values``), shape (candidates, rows, rows)."""
        total = self._steady(values) if self._runs else np.zeros((len(values), self._size, self._size))
        if self._single:
            total += np.array([self._one_by_one(row) for row in values])
        return total

    def _steady(self, values: FloatArray) -> FloatArray:
        count, wanted, places = len(values), len(self._wanted), len(self._levels.places)
        spread = np.repeat(self._spread, count, axis=0)
        coefficients = self._levels.evaluate(values, spread[:, :, :wanted, :places])
        sums = core.gram_sums(
            self._damper.law.kernel or 0,
            self._records,
            self._measured,
            self._starts,
            np.take(coefficients, self._group, axis=1),
            self._levels.places,
            threads=thread_count(),
        )
        groups, width = spread.shape[1], spread.shape[3]
        weighted = self._weight * sums.reshape(count, len(self._runs), width**2)
        with np.errstate(invalid="ignore"):  # The sums of a diverged candidate are not finite.
            grouped = np.add.reduceat(weighted, self._first, axis=1).reshape(count, groups, width, width)
            left = (spread @ grouped).transpose(0, 2, 1, 3).reshape(count, self._size, groups * width)
            right = spread.transpose(0, 1, 3, 2).reshape(count, groups * width, self._size)
            return left @ right

    def _one_by_one(self, values: FloatArray) -> FloatArray:
        damper = self._damper.with_parameters(dict(zip(self._varying, values.tolist(), strict=True)))
        total = np.zeros((self._size, self._size))
        tangents = Tangents(damper, self._wanted, [run.drive for run in self._single])
        for index, run in enumerate(self._single):
            s = tangents.evaluate_run(index)
            residual = run.force - s.force
            columns = np.vstack([s.columns, residual])
            spread = np.zeros((self._size, len(columns)))
            spread[: len(self._wanted), :-1] = s.combine
            spread[-1, -1] = 1.0
            total += run.weight * (spread @ core.gram(columns, run.start) @ spread.T)
        return total
