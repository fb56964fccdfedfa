"""The kernel's banded solver against LAPACK's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import solveh_banded

from mrdamper.core import solve_banded


@given(st.integers(1, 60), st.integers(0, 7), st.integers(0, 2**32 - 1))
def test_system_is_solved_as_by_lapack(n, width, seed):
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-1.0, 1.0, (width + 1, n))
    lower[0] = 2.0 * (width + 1)  # more than the row's others together
    right = rng.standard_normal(n)
    wanted = solveh_banded(lower[: min(width + 1, n)], right, lower=True)
    assert solve_banded(lower.copy(), right.copy()) == pytest.approx(wanted, rel=1e-12, abs=1e-14)


def test_indefinite_matrix_is_rejected():
    for diagonal in ([1.0, -1.0], [0.0, 1.0], [np.nan, 1.0]):
        with pytest.raises(ValueError, match="not positive definite"):
            solve_banded(np.array([diagonal]), np.ones(2))
    with pytest.raises(ValueError, match="whole rows"):
        solve_banded(np.ones((1, 3)), np.ones(2))
    with pytest.raises(ValueError, match="whole rows"):
        solve_banded(np.ones((1, 0)), np.ones(0))
