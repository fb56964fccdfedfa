"""Fits work with noisy current and with very large forces, and recognise their training runs."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.records import Dataset
from mrdamper.identify import fit as fitting
from mrdamper.identify.evaluate import evaluate
from mrdamper.identify.fit_data import FitData
from mrdamper.models.laws import find_law
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS, simulate_runs
from tests.support.tiers import one_by_day

TRUTH = REFERENCE_DAMPERS["bouc-wen"]


def raw(*, force: float = 1.0, noise_A: float = 0.0) -> Dataset:
    """Return runs of a known damper with scaled forces and noise on the current."""
    rng = np.random.default_rng(5)
    return Dataset(
        tuple(
            replace(
                each.run,
                force=force * each.run.force,
                command=each.run.command + noise_A * rng.standard_normal(len(each.run)),
            )
            for each in simulate_runs(TRUTH, noise=0.01, seed=3)
        )
    )


def data_of(*, force: float = 1.0, noise_A: float = 0.0) -> FitData:
    return FitData.prepare(raw(force=force, noise_A=noise_A), preparation=NO_SMOOTHING)


# Noise on the current


def test_noisy_current_counts_as_constant():
    found = fitting.fit_law(data_of(noise_A=0.03), "bouc-wen")
    assert found.actuation is None
    assert max(error.nrmse_percent for error in fitting.assess(found).runs) < 2.0
    (told,) = (note for note in found.result.notes if "is noise about a level" in note)
    assert re.search(r"\(at most (29|3[0-3]) mA\)", str(told))


# Very large forces


@pytest.mark.parametrize("law", one_by_day(["bouc-wen", "double-bouc-wen", "series-valve"]))
def test_fit_error_is_independent_of_force_size(law):
    """Forces of 200 kN are fitted as accurately as 1 kN because parameter bounds scale with the forces."""
    usual, scaled = (fitting.fit_law(data_of(force=size), law).cost_percent for size in (1.0, 150.0))
    assert scaled == pytest.approx(usual, rel=0.02)


# Recognition of the fitted runs


def test_fit_result_and_card_give_equal_errors():
    """Fit and card recognise their training runs. A training run with changed force counts as held out."""
    found = fitting.fit_law(data_of(), find_law("dahl"))
    runs = list(raw())
    seen = evaluate(found, runs)
    assert {each.split for each in seen} == {"training"}
    assert {each.split for each in evaluate(found.card(), runs)} == {"training"}
    bare = evaluate(found.damper, runs, preparation=NO_SMOOTHING)
    assert {each.split for each in bare} == {"held_out"}
    assert [each.rmse_N for each in bare] == pytest.approx([each.rmse_N for each in seen])
    other = replace(runs[5], force=1.5 * runs[5].force)
    assert evaluate(found.card(), [other])[0].split == "held_out"
