"""A cheap stand-in for a posterior's log density: a quadratic with Gaussian bumps, fitted where chains went.

It only leads chains to their proposals; whether these are taken, the density itself decides (``posterior``).
"""

from __future__ import annotations

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.search.gram_sums import ONE_THREAD

_BELOW = 8.0  # the highest log density, and one more a parameter: what lies lower is not fitted
_MOST = 8000  # places that are fitted
_ENOUGH = 2000  # of them; with fewer there is no surrogate
_CENTRES = 1024
_FEW_CENTRES, _FEW = 192, 4000  # centres and places for the choice of the lengths
_HELD = 4  # of which every so manieth is held out
_LONGEST, _SHORTEST = 4.0, 0.25  # of the bumps' lengths, in standard deviations
_GAIN = 0.98  # a length is halved where the error that is left falls to this share
_NOTHING = np.float32(-30.0)  # of a bump's logarithm
_PENALTY = 1e-3  # on the bumps' heights squared
_WEIGHT = 0.1  # a unit of log density: high places count more
_OUTSIDE = 50.0  # lower one standard deviation beyond the places that were fitted, by the square of that


class Surrogate:
    """A fitted log density, but for a constant.

    Parameters
    ----------
    points : places that differ, shape (n, size)
    log : log density there, shape (n,); minus infinity where it vanishes
    """

    def __init__(self, points: FloatArray, log: FloatArray, rng: np.random.Generator) -> None:
        size = points.shape[1]
        core = points[log > log.max() - size - 1.0]
        self._mean = core.mean(axis=0)
        self._white = np.linalg.inv(np.linalg.cholesky(np.cov(core.T).reshape(size, size))).T
        self._pairs = np.triu_indices(size)
        near = rng.permutation(np.flatnonzero(log > log.max() - size - _BELOW))[:_MOST]
        z, log = self._standard(points[near]), log[near]
        self._low, self._high, self._top = z.min(axis=0), z.max(axis=0), float(log.max())
        weight = np.exp(_WEIGHT * (log - self._top))
        self._centres = z[:_FEW_CENTRES]
        self._lengths = self._chosen_lengths(z[:_FEW], log[:_FEW], weight[:_FEW])
        self._centres = z[:_CENTRES]
        self._heights = self._fitted(self._terms(z, self._lengths), log, weight)

    @staticmethod
    def of(points: FloatArray, log: FloatArray, rng: np.random.Generator) -> Surrogate | None:
        """Return one fitted to places, or None where there are too few with any density."""
        size = points.shape[1]
        near = np.isfinite(log) & (log > np.max(log, initial=-np.inf) - size - _BELOW)
        if not size or np.count_nonzero(near) < _ENOUGH:
            return None
        try:
            return Surrogate(points[near], log[near], rng)
        except np.linalg.LinAlgError:  # all in a plane
            return None

    def log(self, points: FloatArray) -> FloatArray:
        """Return the log density at points, shape (n, size); where nothing was fitted it falls off."""
        z = self._standard(points)
        inside = np.clip(z, self._low, self._high)
        found = np.empty(len(z))
        step = max(1, ONE_THREAD // self._centres.size)
        for begin in range(0, len(z), step):
            part = slice(begin, begin + step)
            found[part] = np.einsum("ij,j->i", self._terms(inside[part], self._lengths), self._heights)
        found = np.minimum(found, self._top + 1.0)
        return np.asarray(found - _OUTSIDE * np.sum((z - inside) ** 2, axis=1))

    def _standard(self, points: FloatArray) -> FloatArray:
        return np.asarray((points - self._mean) @ self._white)

    def _terms(self, z: FloatArray, lengths: FloatArray) -> FloatArray:
        """Return what the heights multiply, shape (n, terms): one, z, products of two, bumps."""
        at, centres = (np.asarray(each / lengths, np.float32) for each in (z, self._centres))
        apart = at @ centres.T
        apart -= 0.5 * np.sum(at**2, axis=1)[:, None]
        apart -= 0.5 * np.sum(centres**2, axis=1)
        first, second = self._pairs
        bumps = np.exp(np.maximum(apart, _NOTHING, out=apart), out=apart)
        return np.concatenate([np.ones((len(z), 1)), z, z[:, first] * z[:, second], bumps], axis=1)

    def _fitted(self, terms: FloatArray, log: FloatArray, weight: FloatArray) -> FloatArray:
        weighed = terms * weight[:, None]
        matrix = weighed.T @ weighed
        penalty = 1e-9 * np.diag(matrix)
        penalty[-len(self._centres) :] += _PENALTY
        return np.asarray(np.linalg.solve(matrix + np.diag(penalty), weighed.T @ (log * weight)))

    def _chosen_lengths(self, z: FloatArray, log: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the bumps' length along each axis: halved as long as held-out places are met better."""
        held = np.arange(len(z)) % _HELD == 0

        def error_of(lengths: FloatArray) -> float:
            terms = self._terms(z, lengths)
            heights = self._fitted(terms[~held], log[~held], weight[~held])
            return float(np.mean((weight[held] * (terms[held] @ heights - log[held])) ** 2))

        lengths = np.full(z.shape[1], _LONGEST)
        least = error_of(lengths)
        open_axes = list(range(z.shape[1]))
        while open_axes:
            for axis in tuple(open_axes):
                tried = lengths.copy()
                tried[axis] *= 0.5
                error = error_of(tried)
                if error > _GAIN * least:
                    open_axes.remove(axis)
                    continue
                lengths, least = tried, error
                if tried[axis] <= _SHORTEST:
                    open_axes.remove(axis)
        return lengths
