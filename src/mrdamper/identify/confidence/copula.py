"""A distribution that is fitted to points, drawn from and evaluated: any marginals, and a normal copula."""

from __future__ import annotations

import numpy as np

from mrdamper.arrays import FloatArray

_BINS = 24  # of the histograms,
_TAIL = 0.04  # and the share beyond them


class Copula:
    """A distribution fitted to points: histograms of equal counts, joined by a normal copula.

    It reaches over the whole box, so that chains that follow it come everywhere.
    """

    def __init__(self, points: FloatArray, low: FloatArray, high: FloatArray) -> None:
        edge = _TAIL / 2.0
        inner = np.quantile(points, np.linspace(edge, 1.0 - edge, _BINS + 1), axis=0)
        reach = 0.5 * (inner[-1] - inner[0])
        near = np.maximum(inner[:1] - reach, 0.5 * (low + inner[0]))
        far = np.minimum(inner[-1:] + reach, 0.5 * (high + inner[-1]))
        knots = np.concatenate([low[None], near, inner, far, high[None]])
        gaps = 1e-9 * (high - low)
        self._knots = np.maximum.accumulate(knots + gaps * np.arange(len(knots))[:, None] / len(knots))
        ends = (0.2 * edge, edge)
        self._levels = np.concatenate(
            [[0.0], ends[:1], np.linspace(edge, 1.0 - edge, _BINS + 1), [1.0 - ends[0], 1.0]]
        )
        self._density = np.diff(self._levels)[:, None] / np.diff(self._knots, axis=0)
        normal = self._normal(points)
        size = points.shape[1]
        correlation = np.corrcoef(normal.T).reshape(size, size) if size else np.empty((0, 0))
        self._root = np.linalg.cholesky(0.98 * correlation + 0.02 * np.eye(size))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return points, shape (count, parameters)."""
        from scipy.special import ndtr  # SciPy takes long to load, and most fits ask for no draws

        share = ndtr(rng.standard_normal((count, len(self._root))) @ self._root.T)
        columns = [np.interp(share[:, k], self._levels, self._knots[:, k]) for k in range(len(self._root))]
        return np.stack(columns, axis=1) if columns else np.empty((count, 0))

    def log(self, points: FloatArray) -> FloatArray:
        """Return the log density at points inside the box, but for a constant."""
        normal = self._normal(points)
        own = np.linalg.solve(self._root, normal.T)
        log = 0.5 * np.sum(normal**2, axis=1) - 0.5 * np.sum(own**2, axis=0)
        for k in range(points.shape[1]):
            cell = np.searchsorted(self._knots[1:-1, k], points[:, k], side="right")
            log += np.log(self._density[cell, k])
        return np.asarray(log)

    def _normal(self, points: FloatArray) -> FloatArray:
        """Return the points' normal scores."""
        from scipy.special import ndtri

        scores = np.empty_like(points)
        for k in range(points.shape[1]):
            share = np.interp(points[:, k], self._knots[:, k], self._levels)
            scores[:, k] = ndtri(np.clip(share, 1e-12, 1.0 - 1e-12))
        return scores
