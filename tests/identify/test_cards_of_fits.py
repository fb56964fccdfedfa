"""A fit sorts interchangeable elements of a law, and a fit to a single current requires an option."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.records import Dataset
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.problem import canonical
from mrdamper.models.dependence import Constant, Hill, Polynomial
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import REFERENCE_DAMPERS, simulate_runs

LAW = REFERENCE_DAMPERS["bouc-wen"]


def test_interchangeable_elements_are_sorted() -> None:
    truth = REFERENCE_DAMPERS["double-bouc-wen"]
    quick, slow = truth.coefficients["rho"], truth.coefficients["second_rho"]
    strong, weak = truth.coefficients["yield_force"], truth.coefficients["second_force"]
    other_way = {"rho": slow, "second_rho": quick, "yield_force": weak, "second_force": strong}
    turned = replace(truth, coefficients={**truth.coefficients, **other_way})
    assert canonical(turned) == truth
    assert canonical(truth) == truth
    path = drive(Sine(5e-3, 1.0), duration=1.0, rate_Hz=500.0, command=1.0)
    np.testing.assert_allclose(simulate(turned, path), simulate(truth, path), rtol=1e-9)
    for name, other in (("yield_force", Hill(90.0, 1100.0, 1.2, 1.6, 2.0)), ("rho", Constant(1.0))):
        unlike = replace(turned, coefficients={**turned.coefficients, name: other})
        assert canonical(unlike) == unlike
    lines = Polynomial((30.0, 250.0))
    shorter = replace(turned, coefficients={**turned.coefficients, "yield_force": lines})
    assert canonical(shorter) == shorter


def test_fit_to_single_current_requires_option() -> None:
    all_runs = simulate_runs(LAW, noise=0.01, seed=0)
    runs = tuple(run.run for run in all_runs if run.run.constant_command == 1.0)[:2]
    with pytest.raises(InputError, match="all 2 training runs have one command"):
        fit_law(FitData.prepare(Dataset(runs)), "bingham")
    found = fit_law(FitData.prepare(Dataset(runs), one_command=True), "bingham")
    assert found.damper.law.name == "bingham"
