"""All outputs of a fit (terminal, report, web page, JSON, card) state its convergence and errors."""

from __future__ import annotations

import json
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from mrdamper.data.records import Dataset
from mrdamper.identify import fit as fitting
from mrdamper.identify.consistency.errors import find_contradictions
from mrdamper.identify.fit_data import FitData
from mrdamper.identify.settings import DEFAULT_SETTINGS
from mrdamper.jobs.fit import FitResult, fit
from mrdamper.jobs.options import FitOptions
from mrdamper.jobs.previews.card import card_line
from mrdamper.models.card_schema import write_card
from mrdamper.report.identification.page import PAGE
from mrdamper.report.identification.report import REPORT
from mrdamper.runtime.outputs import write_table
from tests.support.campaigns import short_runs

pytestmark = pytest.mark.system

NOT_CONVERGED = "The fit has not converged"


def terminal_of(found, width=80):
    stream = StringIO()
    REPORT.show(found, Console(width=width, file=stream))
    return stream.getvalue()


def fit_with(**settings):
    data = FitData.prepare(Dataset(tuple(short_runs())), hold_out=["*_1.50V_sine5*"])
    data = replace(data, settings=replace(DEFAULT_SETTINGS, **settings))
    fitted = fitting.fit_law(data, "dahl")
    return FitResult(**vars(fitted), assessment=fitting.assess(fitted))


@pytest.fixture(scope="module")
def stopped():
    """Return a fit that stops after one iteration, before it has converged."""
    return fit_with(
        iterations_max=1, start_iterations_max=1, screening_iterations_max=1, finalist_iterations_max=1
    )


@pytest.fixture(scope="module")
def selected():
    """Return a fit that has selected the model."""
    runs = Dataset(tuple(short_runs()))
    return fit(runs, options=FitOptions(hold_out=("*_1.50V_sine5*",), terms=("none",)))


def test_unconverged_fit_is_reported_first(stopped, tmp_path):
    """Terminal, report, web page, JSON, card and the list of cards state that the fit has not converged."""
    assert terminal_of(stopped).startswith(NOT_CONVERGED)
    assert PAGE.web_json(stopped)["verdict"].startswith(NOT_CONVERGED)
    assert f'<p class="verdict">{NOT_CONVERGED}' in PAGE.render(stopped)
    assert REPORT.answer(stopped)["converged"] is False
    write_card(stopped.card(), tmp_path / "card.json")
    card = json.loads((tmp_path / "card.json").read_text(encoding="utf-8"))
    assert card["evidence"]["converged"] is False
    assert card_line(tmp_path / "card.json")["converged"] is False


def test_cancelled_fit_counts_as_unconverged(selected):
    cancelled = replace(selected, result=replace(selected.result, cancelled=True))
    assert selected.converged
    assert not cancelled.converged
    assert not cancelled.card().evidence.converged
    assert terminal_of(cancelled).startswith(NOT_CONVERGED)


def test_error_table_agrees_with_errors_csv(selected, tmp_path):
    """Median, RMS and worst error in the table are equal to values computed from errors.csv."""
    assert REPORT.rows is not None
    write_table(tmp_path / "errors.csv", REPORT.rows(selected))
    rows = np.genfromtxt(tmp_path / "errors.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    errors = {(error["kind"], error["current"]): error for error in REPORT.answer(selected)["errors"]}
    for split in ("training", "held_out"):
        percent = rows["nrmse_percent"][rows["split"] == split]
        error = errors[split, "constant"]
        assert error["run_count"] == len(percent)
        assert error["median_percent"] == pytest.approx(np.median(percent))
        assert error["rms_percent"] == pytest.approx(np.sqrt(np.mean(percent**2)))
        assert error["worst_percent"] == pytest.approx(percent.max())


def test_selection_reports_errors_on_subset_and_all_runs(selected):
    selection = REPORT.answer(selected)["selection"]
    assert selection["candidates"][0]["reason"] == "chosen"
    assert selection["sample_count"] > 0
    assert selection["subset_error_percent"] <= 1.2 * selection["all_runs_error_percent"]
    assert selection["is_subset"] in (True, False)


def test_contradicting_errors_of_fit_are_reported(selected):
    """A finding is reported if the cross-validation error is far below the training error."""
    first, *others = selected.selection.scores
    small = replace(first, cv_percent_by_run=tuple(0.1 * e for e in first.cv_percent_by_run))
    changed = replace(selected, selection=replace(selected.selection, scores=(small, *others)))
    assert [finding.kind for finding in find_contradictions(changed.errors)] == ["errors_contradict"]
    assert find_contradictions(selected.errors) == ()
