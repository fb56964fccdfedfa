"""Modified Bessel functions of two orders, which fins need; SciPy's take a fifth of a second to load.

Each is its integral by the trapezoidal rule, whose error falls exponentially with the count of places: the
integrand of I is periodic, that of K falls doubly exponentially. Exponentially scaled, as in SciPy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mrdamper.arrays import FloatArray

__all__ = ["first_kind", "second_kind"]

_PLACES = 80  # of the integral of K
_FALLEN = 60.0  # exponent at which that of K is cut


def first_kind(x: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Return I0(x) exp(-x) and I1(x) exp(-x), x >= 0 of any shape.

    .. math:: I_k(x) = \frac{1}{\pi} \int_0^\pi \cos^k\theta \, e^{x \cos\theta} \, d\theta, \quad k = 0, 1

    Source: DLMF 10.32.3; both halves of the integral are taken together, so that small x cancel nothing.
    """
    size = np.asarray(x, dtype=np.float64)[..., None]
    count = 16 + 4 * int(np.sqrt(np.max(size, initial=0.0)))
    angle = 0.5 * np.pi * (np.arange(count) + 0.5) / count
    cosine = np.cos(angle)
    near, apart = np.exp(-2.0 * size * np.sin(0.5 * angle) ** 2), np.expm1(-2.0 * size * cosine)
    zeroth: FloatArray = np.mean(0.5 * near * (2.0 + apart), axis=-1)
    first: FloatArray = np.mean(-0.5 * cosine * near * apart, axis=-1)
    return zeroth, first


def second_kind(x: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Return K0(x) exp(x) and K1(x) exp(x), x > 0 of any shape.

    .. math:: K_k(x) = \int_0^\infty \cosh(kt) \, e^{-x \cosh t} \, dt, \quad k = 0, 1

    Source: DLMF 10.32.9.
    """
    size = np.asarray(x, dtype=np.float64)[..., None]
    step = np.arccosh(1.0 + _FALLEN / size) / _PLACES
    t = step * np.arange(_PLACES + 1)
    value = step * np.exp(-2.0 * size * np.sinh(0.5 * t) ** 2)
    value[..., 0] *= 0.5
    return np.sum(value, axis=-1), np.sum(value * np.cosh(t), axis=-1)
