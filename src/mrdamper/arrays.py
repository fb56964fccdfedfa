"""Array types, read-only arrays, and small functions for matrices and grouping."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
DEVIATION_PER_MAD = 1.4826  # standard deviation / median absolute deviation, for a normal distribution


def read_only(values: ArrayLike) -> FloatArray:
    """Return the values as a new read-only, C-contiguous float64 array."""
    given = values if isinstance(values, np.ndarray) else None
    safe = given is not None and given.base is None and not given.flags.writeable
    if given is not None and safe and given.dtype == np.float64 and given.flags.c_contiguous:
        return given
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


def inverse_sizes(matrix: FloatArray) -> FloatArray:
    """Return factors (.., n) that scale rows and columns of matrices (.., n, n) to a unit diagonal."""
    return np.asarray(1.0 / np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-300)))


def pseudoinverse(matrix: FloatArray, singular: float = 1e-13) -> FloatArray:
    """Return the pseudoinverse of a symmetric positive semidefinite matrix, shape (n, n).

    The matrix is scaled to a unit diagonal first, so that its rows may have different units. Eigenvalues of
    the scaled matrix below ``singular`` times the largest eigenvalue count as zero.
    """
    size = inverse_sizes(matrix)
    both = np.outer(size, size)
    return np.asarray(np.linalg.pinv(matrix * both, rcond=singular, hermitian=True) * both)


def level_numbers(values: ArrayLike, distance_max: float) -> NDArray[np.intp]:
    """Group nearly equal values. Return the group number of each value, from 0 on, shape (n,).

    Sorted values belong to the same group as long as neighbours differ by at most ``distance_max``.
    """
    given = np.asarray(values, dtype=np.float64)
    order = np.argsort(given, kind="stable")
    numbers = np.empty(len(given), dtype=np.intp)
    numbers[order] = np.cumsum(np.diff(given[order], prepend=given[order[:1]]) > distance_max)
    return numbers


def rms(values: FloatArray) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
