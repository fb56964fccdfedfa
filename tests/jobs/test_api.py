"""The Python interface has the same options and the same results as the command line."""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import pytest

import mrdamper
from mrdamper.models.card_schema import card_from_json, card_to_json
from mrdamper.runtime.outputs import atomic_output
from tests.support.campaigns import short_runs
from tests.support.rigs import PYTHON_LAW

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def runs():
    return short_runs()


@pytest.fixture(scope="module")
def fitted(runs):
    return mrdamper.fit(runs, "bouc-wen", hold_out=["*_0.75V_*"])


def test_written_card_reproduces_errors_of_fit(fitted, runs):
    card = card_from_json(_as_read(card_to_json(fitted.card())))
    stated = {run["name"]: run for run in card.evidence.runs}
    for error in mrdamper.evaluate(card, runs):
        assert error.rmse_N == pytest.approx(stated[error.name]["rmse_N"], rel=1e-9)
        assert error.split == stated[error.name]["split"]


def test_held_out_runs_do_not_change_fit(fitted, runs):
    alone = mrdamper.fit([run for run in runs if "_0.75V_" not in run.name], "bouc-wen")
    assert alone.damper.parameters == fitted.damper.parameters
    assert alone.fingerprint == fitted.fingerprint


def test_changed_run_counts_as_held_out(fitted, runs):
    other = replace(runs[0], force=1.01 * runs[0].force)
    assert mrdamper.evaluate(fitted.card(), [other])[0].split == "held_out"


@pytest.mark.nightly
def test_python_law_class_or_object_is_fitted(runs, tmp_path):
    path = tmp_path / "own_law.py"
    path.write_text(PYTHON_LAW, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("own_law", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    few = [_beginning(run) for run in runs if "1.50V_sine10mm2Hz" in run.name]
    by_class = mrdamper.fit(few[:1], module.Relaxing, one_command=True)
    assert by_class.damper.law.name == "relaxing"
    assert mrdamper.evaluate(by_class, [replace(few[0], name="other")])[0].split == "held_out"
    assert mrdamper.assess(by_class).runs[0].nrmse_percent < 60.0


@pytest.mark.parametrize("option", [{"temperature": "guess"}, {"posterior": -1}, {"law": "bouc-when"}])
def test_invalid_fit_option_is_rejected(runs, option):
    with pytest.raises(mrdamper.InputError):
        mrdamper.fit(runs, **option)


def test_fit_message_names_all_invalid_runs(runs):
    wrong = [replace(run, force=-run.force) for run in runs[:2]]
    with pytest.raises(mrdamper.InputError) as fault:
        mrdamper.fit([*wrong, *runs[2:]], "dahl")
    assert all(run.name in str(fault.value) for run in wrong)


def test_interrupted_output_writes_no_file(tmp_path):
    out = tmp_path / "new" / "out"

    def fail_half_way():
        with atomic_output(out) as beside:
            (beside / "card.json").write_text("half", encoding="utf-8")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail_half_way()
    assert list(tmp_path.iterdir()) == []
    with atomic_output(out) as beside:
        (beside / "card.json").write_text("whole", encoding="utf-8")
    assert [p.name for p in out.iterdir()] == ["card.json"]
    assert [p.name for p in tmp_path.iterdir()] == ["new"]


def _beginning(run, samples=1200):
    """Return the beginning of a run because simulating a law in Python is slow."""
    return replace(
        run,
        **{name: getattr(run, name)[:samples] for name in ("time", "displacement", "force", "command")},
    )


def _as_read(document):
    import json

    return json.loads(json.dumps(document, default=dict))
