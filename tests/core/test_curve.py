"""The Bouc-Wen curve of the kernel agrees with quadrature, formulas and its differential equation.

The curve is the hysteresis variable w versus the normalised travel tau, with exponent n and unloading shape
kappa. The reference integrates the travel over q = -ln(1 - u), which removes the singularity at u = 1.
Travel, slope and derivatives by kappa and n are therefore exact to rounding near w = 1, where
``scipy.special.hyp2f1`` loses digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper import core
from tests.oracles.reference import bouc_wen_distance

EXPONENTS = [0.2, 0.3, 0.7, 1.0, 1.6, 2.0, 3.5, 6.0, 12.0, 20.0]
KAPPAS = [-1.0, -0.4, 0.0, 0.5, 1.0]

exponents = st.floats(0.2, 20.0)
kappas = st.floats(-1.0, 1.0)


@dataclass(frozen=True)
class Branch:
    """Points of the solution u of du/dtau = 1 - k u^n with u(0) = 0, for tau = ``travel``.

    ``slope`` is du/dtau. ``by_k`` and ``by_n`` are the derivatives of u by k and n.
    """

    travel: np.ndarray
    u: np.ndarray
    slope: np.ndarray
    by_n: np.ndarray
    by_k: np.ndarray


def exact_branch(k: float, n: float, *, below: float = 1.0) -> Branch:
    """Return exact points with u < ``below`` from 16-point Gauss-Legendre quadrature on intervals of q."""
    # u = (1 - exp(-q))^power is smooth at zero for small n, too.
    power = math.ceil(4.0 / n) if n < 4.0 else 1
    edges = np.linspace(0.0, 34.0, 301)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    width = np.diff(edges)[:, None]
    q = edges[:-1, None] + width * (nodes + 1.0) / 2.0

    def at(q):
        log_s = np.where(q < 0.7, np.log(-np.expm1(-q)), np.log1p(-np.exp(-np.maximum(q, 0.1))))
        u_to_n = np.exp(power * n * log_s)
        return log_s, u_to_n, -np.expm1(power * n * log_s) + (1.0 - k) * u_to_n

    log_s, u_to_n, slope = at(q)
    du = width * weights / 2.0 * power * np.exp((power - 1.0) * log_s - q)

    def integral(f):
        return np.cumsum((du * f).sum(axis=1))

    log_end, _, slope_end = at(edges[1:])
    u = np.exp(power * log_end)
    inside = u < below
    return Branch(
        integral(1.0 / slope)[inside],
        u[inside],
        slope_end[inside],
        (-slope_end * integral(k * u_to_n * power * log_s / slope**2))[inside],
        (-slope_end * integral(u_to_n / slope**2))[inside],
    )


# ----------------------------------------------------------------------------------- reference solution


def test_reference_curve_matches_elementary_functions():
    """The curve is 1 - exp(-tau) for n = 1 and tanh(tau) for n = 2.

    With kappa = -1 and n = 2 it falls as tan(tau).
    """
    one, two, fall = exact_branch(1.0, 1.0), exact_branch(1.0, 2.0), exact_branch(-1.0, 2.0)
    np.testing.assert_allclose(one.u, -np.expm1(-one.travel), atol=2e-15)
    np.testing.assert_allclose(two.u, np.tanh(two.travel), atol=2e-15)
    np.testing.assert_allclose(fall.u, np.tan(fall.travel), atol=2e-15)


@pytest.mark.parametrize("n", [0.2, 0.3, 0.7, 3.3, 20.0])
def test_reference_curve_matches_hypergeometric_function(n):
    rise, fall = exact_branch(1.0, n, below=1.0 - 1e-6), exact_branch(-0.6, n)
    by_series = [bouc_wen_distance(w, -0.6, n) for w in rise.u[::10]]
    np.testing.assert_allclose(rise.travel[::10], by_series, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        fall.travel[::10], [-bouc_wen_distance(-w, -0.6, n) for w in fall.u[::10]], rtol=1e-12
    )


# ---------------------------------------------------------------------------------------- values of the curve


@pytest.mark.parametrize("n", EXPONENTS)
def test_kernel_curve_matches_reference_curve(n):
    """The table is designed for an error of 5e-7. The largest measured error is 2e-7 (exponent n = 0.2)."""
    for kappa in KAPPAS:
        rise, fall = exact_branch(1.0, n), exact_branch(kappa, n)
        assert np.abs(core.curve(kappa, n, rise.travel)[0] - rise.u).max() < 5e-7
        assert np.abs(core.curve(kappa, n, -fall.travel)[0] + fall.u).max() < 5e-7, kappa


@given(kappa=kappas, n=exponents)
def test_kernel_curve_is_monotonic_and_bounded(kappa, n):
    """The falling curve is tabulated only down to w = -1 because no hysteresis state is lower."""
    tau = np.concatenate(
        [np.linspace(-150.0, -3.0, 300), np.linspace(-3.0, 3.0, 4001), np.linspace(3.0, 150.0, 300)]
    )
    w = core.curve(kappa, n, tau)[0]
    assert np.all(np.diff(w) >= 0.0)
    assert w.max() <= 1.0
    assert core.curve(kappa, n, np.zeros(1))[0][0] == 0.0
    fall = exact_branch(kappa, n, below=1.0 - 1e-6)
    assert core.curve(kappa, n, -fall.travel)[0].min() >= -1.0


# ---------------------------------------------------------------------------------------------- tangents


@pytest.mark.parametrize("n", EXPONENTS)
def test_slope_of_curve_satisfies_differential_equation(n):
    """The slope dw/dtau is 1 - w^n for rising w and 1 - kappa |w|^n for falling w.

    The kernel differentiates a table of w with an error of 5e-7. For n < 0.7, |tau| < 1e-3 is excluded
    because the curve has a corner at zero.
    """
    for kappa in KAPPAS:
        rise, fall = exact_branch(1.0, n), exact_branch(kappa, n, below=1.0 - 1e-9)
        for branch, side in ((rise, 1.0), (fall, -1.0)):
            slope = core.curve(kappa, n, side * branch.travel)[1]
            smooth = (branch.travel > 1e-3) | (n >= 0.7)
            assert np.abs(slope - branch.slope)[smooth].max() < 1e-4, (kappa, side)


@pytest.mark.parametrize("n", EXPONENTS)
def test_derivatives_of_curve_match_reference(n):
    for kappa in KAPPAS:
        rise, fall = exact_branch(1.0, n), exact_branch(kappa, n, below=1.0 - 1e-9)
        _, _, by_kappa, by_n = core.curve(kappa, n, rise.travel)
        assert not np.any(by_kappa)  # The rising curve does not depend on kappa.
        assert np.abs(by_n - rise.by_n).max() < 1e-6 * max(1.0, np.abs(rise.by_n).max())
        _, _, by_kappa, by_n = core.curve(kappa, n, -fall.travel)
        for found, exact in ((by_n, -fall.by_n), (by_kappa, -fall.by_k)):
            bar = 1e-6 if kappa < 1.0 else 6e-6  # The table for kappa = 1 is truncated.
            assert np.abs(found - exact).max() < bar * max(1.0, np.abs(exact).max()), kappa
