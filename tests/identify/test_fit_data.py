"""All fits of a job use the same runs and error scale, so their parameters can be compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.records import Dataset
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.selection.candidates import Candidate
from mrdamper.identify.selection.evaluator import CandidateEvaluator
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs

LAWS = ("bouc-wen", "series-valve", "chain")


def dataset(law: str = "series-valve") -> Dataset:
    runs = simulate_runs(REFERENCE_DAMPERS[law], noise=0.02, seed=0, rate_Hz=250.0)
    return Dataset(tuple(run.run for run in runs))


@pytest.fixture(scope="module")
def data() -> FitData:
    return FitData.prepare(dataset(), preparation=NO_SMOOTHING)


@pytest.mark.parametrize("law", LAWS)
def test_final_objective_reproduces_cost_of_quick_fit(data, law) -> None:
    """On the same run sections, the final objective equals the cost of the quick fit."""
    evaluator = CandidateEvaluator(data, samples_max=3000)
    terms = {"chain": ("viscosity", "knee")}.get(law, ())
    candidate = Candidate(law, terms)
    fitted = evaluator.fit(candidate, [evaluator.problem(candidate).template])
    final = Objective(data.problem(law, terms), evaluator.windows)
    cost = final.gram(fitted.damper.on_limits(), ())[-1, -1]
    assert np.sqrt(cost) == pytest.approx(fitted.training_rms_percent, rel=1e-9)
    assert final.costs_of([fitted.damper])[0] <= cost * (1.0 + 1e-9)


def test_parameter_bounds_are_independent_of_sample_count(data) -> None:
    """Bounds, starting values and fixed constants are equal for any number of samples."""
    few, many = (
        CandidateEvaluator(data, samples_max=n).problem(Candidate("chain", ())) for n in (1000, 1_000_000)
    )
    assert few.free == many.free == data.problem("chain", ()).free
    assert few.template.parameters == many.template.parameters


def test_order_of_runs_does_not_change_fit_data(data) -> None:
    reverse = FitData.prepare(Dataset(tuple(dataset())[::-1]), preparation=NO_SMOOTHING)
    assert [run.name for run in reverse.steady] == [run.name for run in data.steady]
    assert reverse.scale == data.scale


def test_repeated_run_is_used_once(data) -> None:
    """A copy of a run with a different name changes nothing, and a note reports the repetition."""
    runs = tuple(dataset())
    repeated = FitData.prepare(Dataset((*runs, replace(runs[0], name="copy"))), preparation=NO_SMOOTHING)
    assert len(repeated.steady) == len(data.steady)
    assert repeated.scale == data.scale
    assert any("repeat" in note for note in repeated.notes)
