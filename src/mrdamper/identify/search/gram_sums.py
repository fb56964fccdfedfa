"""Gram sums of a problem's runs: all that least squares needs to know of them at a set of parameters.

Runs at one operating point go through the kernel together, many candidates in one call; a run whose
command or temperature varies, and a law in Python, go one by one. Weights, session offsets and the light
pull on those are applied here; nothing is solved.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import PreparedFit
from mrdamper.models.damper import Damper
from mrdamper.models.operating_points import OperatingPoints
from mrdamper.models.simulate import operating_point, require_temperature
from mrdamper.models.tangents import Tangents

_PULL = 1e-6  # of session offsets towards zero, as a share of what the data say
_MOST = 1 << 21  # sums of single runs that are kept at a time
ONE_THREAD = 1 << 17  # products that OpenBLAS does not share out to threads, which would wait in a loop


class GramSums:
    """Weighted Gram matrices of the tangents by ``wanted`` parameters, the session offsets, and the residual.

    ``varying`` are the parameters that move; all others are the damper's. The order of rows is: wanted
    parameters, sessions, residual.
    """

    def __init__(
        self,
        damper: Damper,
        varying: Sequence[str],
        wanted: Sequence[str],
        runs: Sequence[PreparedFit],
        sessions: Sequence[str],
    ) -> None:
        self._damper = damper
        self._varying, self._wanted, self._sessions = tuple(varying), tuple(wanted), tuple(sessions)
        self._size = len(wanted) + len(sessions) + 1
        for run in runs:
            require_temperature(damper, run.drive.trajectory)
        temperature_dependent = damper.temperature_dependent
        points = [
            None
            if damper.law.kernel is None
            else operating_point(run.drive, temperature_dependent=temperature_dependent)
            for run in runs
        ]
        self._single = [run for run, point in zip(runs, points, strict=True) if point is None]
        steady = [(run, point) for run, point in zip(runs, points, strict=True) if point is not None]
        keys = [(point, run.session if sessions else "") for run, point in steady]
        groups = {key: k for k, key in enumerate(dict.fromkeys(keys))}
        group = np.array([groups[key] for key in keys], dtype=np.intp)
        order = np.argsort(group, kind="stable")
        self._runs = [steady[k][0] for k in order]
        self._group = group[order]
        self._first = np.searchsorted(self._group, range(len(groups)))  # of each group's runs
        self._weight = np.array([run.weight for run in self._runs])[:, None]
        if not steady:
            return
        self._levels = OperatingPoints(
            damper,
            self._varying,
            self._wanted,
            np.array([point[0] for point, _ in groups], dtype=np.float64),
            np.array([point[1] for point, _ in groups], dtype=np.float64),
        )
        self._records = tuple(run.drive.record for run in self._runs)
        self._measured = tuple(run.force for run in self._runs)
        self._starts = tuple(run.start for run in self._runs)
        # From kernel columns (tangents, one where there are sessions, residual) to rows, group by group.
        width = len(self._levels.places) + 1 + bool(sessions)
        self._session = [self._sessions.index(session) if sessions else -1 for _, session in groups]
        self._spread = np.zeros((1, len(groups), self._size, width))
        self._spread[..., : len(wanted), : len(self._levels.places)] = self._levels.combine
        self._spread[..., -1, -1] = 1.0
        for k, session in enumerate(self._session):
            if session >= 0:
                self._spread[:, k, len(wanted) + session, -2] = 1.0

    def at(self, values: FloatArray, session_offsets: FloatArray) -> FloatArray:
        """Return the Gram matrix of every candidate, shape (candidates, rows, rows).

        Parameters
        ----------
        values : of the varying parameters, shape (candidates, varying)
        tares : the session offsets [N], shape (candidates, sessions)
        """
        total = np.zeros((len(values), self._size, self._size))
        if self._runs:
            each = len(self._runs) * self._spread.shape[-1] ** 2
            step = max(1, _MOST // each)
            for begin in range(0, len(values), step):
                part = slice(begin, begin + step)
                total[part] = self._steady(values[part], session_offsets[part])
        if self._single:
            for k, (row, session_offset) in enumerate(zip(values, session_offsets, strict=True)):
                total[k] += self._one_by_one(row, session_offset)
        if self._sessions:
            self._pulled(total, session_offsets)
        return total

    def _steady(self, values: FloatArray, session_offsets: FloatArray) -> FloatArray:
        count, wanted, places = len(values), len(self._wanted), len(self._levels.places)
        spread = np.repeat(self._spread, count, axis=0)
        coefficients = self._levels.at(values, spread[:, :, :wanted, :places])
        if self._sessions:
            spread[:, :, -1, -2] = -session_offsets[:, self._session]
        sums = core.gram_sums(
            self._damper.law.kernel or 0,
            self._records,
            self._measured,
            self._starts,
            np.take(coefficients, self._group, axis=1),
            self._levels.places,
            ones=bool(self._sessions),
        )
        groups, width = spread.shape[1], spread.shape[3]
        weighted = self._weight * sums.reshape(count, len(self._runs), width**2)
        grouped = np.add.reduceat(weighted, self._first, axis=1).reshape(count, groups, width, width)
        with np.errstate(invalid="ignore"):  # a candidate that diverged has no finite sums, and no cost
            left = (spread @ grouped).transpose(0, 2, 1, 3).reshape(count, self._size, groups * width)
            right = spread.transpose(0, 1, 3, 2).reshape(count, groups * width, self._size)
            step = max(1, ONE_THREAD // self._size**2)
            total = np.zeros((count, self._size, self._size))
            for begin in range(0, groups * width, step):
                part = slice(begin, begin + step)
                total += left[:, :, part] @ right[:, part]
        return total

    def _one_by_one(self, values: FloatArray, session_offsets: FloatArray) -> FloatArray:
        damper = self._damper.with_parameters(dict(zip(self._varying, values.tolist(), strict=True)))
        total = np.zeros((self._size, self._size))
        tangents = Tangents(damper, self._wanted, [run.drive for run in self._single])
        for index, run in enumerate(self._single):
            s = tangents.along(index)
            residual = run.force - s.force
            columns = np.vstack([s.columns, np.ones_like(residual), residual])
            spread = np.zeros((self._size, len(columns)))
            spread[: len(self._wanted), :-2] = s.combine
            spread[-1, -1] = 1.0
            if self._sessions:
                session = self._sessions.index(run.session)
                spread[len(self._wanted) + session, -2] = 1.0
                spread[-1, -2] = -session_offsets[session]
            total += run.weight * (spread @ core.gram(columns, run.start) @ spread.T)
        return total

    def _pulled(self, total: FloatArray, session_offsets: FloatArray) -> None:
        """Add a light pull of each tare towards zero: what all sessions share is the law's own offset."""
        rows = np.arange(len(self._wanted), self._size - 1)
        pull = _PULL * np.mean(total[:, rows, rows], axis=1)[:, None]
        total[:, rows, rows] += pull
        total[:, rows, -1] -= pull * session_offsets
        total[:, -1, rows] -= pull * session_offsets
        total[:, -1, -1] += np.sum(pull * session_offsets**2, axis=1)
