"""The optimiser solves nonlinear regression problems whose solutions are certified by NIST.

In addition, a fit must not depend on the kernel of the linear algebra library.

Source of data, models, starting points and certified values: NIST Statistical Reference Datasets, nonlinear
regression, Misra1a to Misra1d (D. Misra, NIST, 1978, dental research, monomolecular adsorption), in the
public domain.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.search.descent import Descents
from mrdamper.identify.search.objective import Box, Objective

PRESSURE = np.array(
    [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0]
)
VOLUME = np.array(
    [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78]
)
Column = Callable[[float], FloatArray]

# Each problem contains the model divided by b1, its derivative with respect to b2, and two starting points
# (b1, b2). The last values are the certified b1, b2 and sum of squared residuals.
PROBLEMS: dict[str, tuple[Column, Column, tuple[tuple[float, float], ...], tuple[float, float, float]]] = {
    "Misra1a": (
        lambda b: 1.0 - np.exp(-b * PRESSURE),
        lambda b: PRESSURE * np.exp(-b * PRESSURE),
        ((500.0, 1e-4), (250.0, 5e-4)),
        (2.3894212918e02, 5.5015643181e-04, 1.2455138894e-01),
    ),
    "Misra1b": (
        lambda b: 1.0 - (1.0 + b * PRESSURE / 2.0) ** -2.0,
        lambda b: PRESSURE * (1.0 + b * PRESSURE / 2.0) ** -3.0,
        ((500.0, 1e-4), (300.0, 2e-4)),
        (3.3799746163e02, 3.9039091287e-04, 7.5464681533e-02),
    ),
    "Misra1c": (
        lambda b: 1.0 - (1.0 + 2.0 * b * PRESSURE) ** -0.5,
        lambda b: PRESSURE * (1.0 + 2.0 * b * PRESSURE) ** -1.5,
        ((500.0, 1e-4), (600.0, 2e-4)),
        (6.3642725809e02, 2.0813627256e-04, 4.0966836971e-02),
    ),
    "Misra1d": (
        lambda b: b * PRESSURE / (1.0 + b * PRESSURE),
        lambda b: PRESSURE / (1.0 + b * PRESSURE) ** 2.0,
        ((500.0, 1e-4), (450.0, 3e-4)),
        (4.3736970754e02, 3.0227324449e-04, 5.6419295283e-02),
    ),
}


class Certified(Objective):
    """Objective of one problem. The optimiser varies b2, and linear least squares gives b1."""

    def __init__(self, column: Column, slope: Column) -> None:
        free = FreeParameter("b2", 1e-6, 1e-2, scale="log")
        self.problem = SimpleNamespace(nonlinear=(free,), linear=("b1",))  # type: ignore[assignment]
        self.box = Box.from_parameters(self.problem.nonlinear)
        self.nonlinear, self.linear, self.runs = ("b2",), ("b1",), ()
        self._rows, self._floor, self._light = np.zeros((0, 1)), np.zeros(0), np.zeros(1)
        self.column, self.slope, self.evaluations = column, slope, 0

    def sums(self, nonlinear: FloatArray, linear: FloatArray, *, tangents: bool = True) -> FloatArray:
        """Return a matrix of scalar products per point: derivative by b2, derivative by b1, and residual."""
        self.evaluations += len(nonlinear)
        sums = []
        for b2, b1 in zip(nonlinear[:, 0].tolist(), linear[:, 0].tolist(), strict=True):
            rows = np.array([b1 * self.slope(b2), self.column(b2), VOLUME - b1 * self.column(b2)])
            sums.append((rows if tangents else rows[1:]) @ (rows if tangents else rows[1:]).T)
        return np.array(sums)


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", PROBLEMS)
def test_optimiser_reaches_certified_solution(name: str, start: int) -> None:
    """From both starting points, the parameters agree to six digits and the squared residuals to eight."""
    column, slope, starts, (b1, b2, squares) = PROBLEMS[name]
    from_b1, from_b2 = starts[start]
    found = Descents(Certified(column, slope), np.log([[from_b2]]), np.array([[from_b1]]), most=150)
    found.run()
    assert found.converged.all()
    assert float(found.costs[0]) == pytest.approx(squares, rel=1e-8)
    assert float(np.exp(found.points[0, 0])) == pytest.approx(b2, rel=1e-6)
    assert float(found.linear[0, 0]) == pytest.approx(b1, rel=1e-6)


FIT = """
import json
from mrdamper.identify.consistency.joint import joint_fit
from mrdamper.models.simulate import simulate
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

plan = Campaign(motions=("sine5mm1Hz", "sine3mm2Hz"), currents_A=(0.0, 1.0, 2.0), temperatures_degC=(20.0,),
                held_out_motions=(), held_out_temperatures_degC=(), steps=None)
damper, prepared, _ = joint_fit([run for run, _ in measure(find_preset("nominal"), plan, seed=3)])
print(json.dumps([simulate(damper, run.trajectory).tolist() for run in prepared]))
"""


@pytest.mark.nightly
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names kernels of x86")
def test_fit_is_independent_of_linear_algebra_kernel():
    """OpenBLAS with and without AVX2 gives the same fitted force."""
    found = []
    for kernel in ("Prescott", "Haswell"):
        done = subprocess.run(
            [sys.executable, "-c", FIT], check=True, capture_output=True, text=True,
            env={**os.environ, "OPENBLAS_CORETYPE": kernel},
        )  # fmt: skip
        found.append(json.loads(done.stdout))
    for one, other in zip(*found, strict=True):
        assert np.abs(np.subtract(one, other)).max() < 1e-5 * np.abs(one).max()
