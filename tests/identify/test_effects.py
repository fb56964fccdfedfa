"""The estimated size of a measurement error equals its least-squares estimate and its known size.

The estimate uses force residuals of the damper that generated the runs. No damper is fitted.
"""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.effects import (
    WINDOW_SETTINGS,
    ResidualAnalysis,
    analyse_residuals,
)
from mrdamper.identify.windows import one_window
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import TRUTH, changed, simulate_runs

SIZES = {
    "force_gain": 0.05,
    "force_delay": 2e-4,
    "command_label": 0.02,
    "force_saturation": 0.05,
    "force_offset_of_run": 7.0,
}


@pytest.fixture(scope="module")
def clean() -> tuple[PreparedRun, ...]:
    return simulate_runs(TRUTH, noise=0.0, seed=0, duration=3.0, rate_Hz=400.0)


@pytest.fixture(scope="module")
def noisy() -> tuple[PreparedRun, ...]:
    return simulate_runs(TRUTH, noise=0.02, seed=5, duration=3.0, rate_Hz=400.0)


@pytest.mark.parametrize("kind", SIZES)
@pytest.mark.parametrize("number", [1, 7])
def test_estimated_measurement_error_has_known_size(clean, kind, number):
    most = max(float(np.abs(run.force).max()) for run in clean)
    runs = list(clean)
    runs[number] = changed(runs[number], kind, SIZES[kind], most)
    found = analyse_residuals(TRUTH, runs)
    effect = found.run_effects(kind)[number]
    assert effect.size == pytest.approx(SIZES[kind], rel=0.1 if kind == "force_saturation" else 0.03)
    assert effect.fraction > 0.98
    left = (runs[number].force - clean[number].force)[runs[number].scored_from :]
    if kind != "force_offset_of_run":  # The mean force is relevant only for an offset.
        left = left - left.mean()
    spread = np.std(runs[number].force[runs[number].scored_from :])
    assert effect.level == pytest.approx(np.sqrt(np.mean(left**2)) / spread, rel=0.03)
    assert all(each.level < 1e-9 for k, each in enumerate(found.run_effects(kind)) if k != number)
    own = 0.0 if kind == "force_offset_of_run" else float(np.std(left))
    assert found.levels[number] == pytest.approx(own / spread, rel=1e-6, abs=1e-9)


def test_estimated_force_filter_has_known_time_constant(clean):
    lagged = [changed(run, "force_bandwidth", 0.02, 1.0) for run in clean]
    assert analyse_residuals(TRUTH, lagged).common_effect("force_bandwidth").size == pytest.approx(
        0.02, rel=1e-6
    )


def stacked(found: ResidualAnalysis, kind: str, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the force residuals and the regression columns: the parameters and one measurement error."""
    rows, columns = [], []
    for run, factor in zip(found.residuals, factors.tolist(), strict=True):
        root = np.sqrt(run.weight)
        direction = run.directions[kind]
        if kind != "force_offset_of_run":
            direction = direction - direction.mean()
        rows.append(root * run.residual)
        columns.append(root * np.vstack([run.columns, factor * direction]))
    return np.concatenate(rows), np.concatenate(columns, axis=1).T


@pytest.mark.parametrize("kind", ["force_gain", "force_delay", "command_label", "force_offset_of_run"])
def test_measurement_error_equals_least_squares_estimate(noisy, kind):
    """The size equals the least-squares estimate that includes the free parameters of the damper."""
    free = ("viscosity.c0", "yield_force.c1", "rho.value")
    found = analyse_residuals(TRUTH, noisy, free)
    one = (np.arange(len(noisy)) == 4).astype(float)
    ramp = np.linspace(-0.5, 0.5, len(noisy))
    for factors, effect in (
        (one, found.run_effects(kind)[4]),
        (np.ones(len(noisy)), found.common_effect(kind)),
        (ramp, found.common_effect(kind, ramp)),
    ):
        residual, columns = stacked(found, kind, factors)
        solved = np.linalg.lstsq(columns, residual, rcond=None)[0]
        assert effect.size == pytest.approx(solved[-1], rel=1e-6)
        without = np.linalg.lstsq(columns[:, :-1], residual, rcond=None)[0]
        gained = np.sum((residual - columns[:, :-1] @ without) ** 2)
        gained -= np.sum((residual - columns @ solved) ** 2)
        scale = found.residuals[4].weight if factors is one else 1.0
        total = 0.0
        for k, run in enumerate(found.residuals):
            if factors is one and k != 4:
                continue
            left = run.residual if kind == "force_offset_of_run" else run.residual - run.residual.mean()
            total += (1.0 if factors is one else run.weight) * float(left @ left)
        assert effect.fraction == pytest.approx(gained / scale / total, rel=1e-5)
        # The standard error is based on a tenth of the samples because neighbouring samples are correlated.
        count = sum(
            len(run.residual) for k, run in enumerate(found.residuals) if factors is not one or k == 4
        )
        power = np.linalg.inv(columns.T @ columns)[-1, -1] * scale
        usual = np.sqrt((1.0 - effect.fraction) * total * power / (count / 10.0))
        assert effect.standard_error == pytest.approx(usual, rel=1e-5)


def test_force_derivatives_equal_difference_quotients(noisy):
    free = ("viscosity.c0", "rho.value")
    found = analyse_residuals(TRUTH, noisy, free, suspect=noisy[2].name)
    for number in (0, 5):
        fit = one_window(noisy[number], len(noisy), WINDOW_SETTINGS)
        assert found.residuals[number].weight == pytest.approx(fit.weight)
        for name, column in zip(free, found.residuals[number].columns, strict=True):
            value = TRUTH.parameters[name]
            ends = [
                simulate(TRUTH.with_parameters({name: value * (1.0 + way)}), fit.drive)
                for way in (1e-4, -1e-4)
            ]
            slope = ((ends[0] - ends[1]) / (2e-4 * value))[fit.start :]
            assert column == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max())
    assert not found.residuals[2].columns.any(), "A run that is not fitted does not change the parameters."
