"""The check reports a wrong run of a campaign with cause and size. It does not report correct runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrdamper
from mrdamper.data.readers import ReadFiles
from mrdamper.data.records import Dataset
from mrdamper.identify.consistency.errors import find_contradictions
from mrdamper.identify.consistency.joint import joint_test
from mrdamper.identify.consistency.runs import find_deviations, find_suspects, rms_residual
from mrdamper.identify.scores import score_each, summarize_errors
from mrdamper.jobs.check import check, findings_of
from mrdamper.jobs.options import CheckOptions
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset
from tests.identify.reference_dampers import TRUTH, changed, simulate_runs

PLAN = Campaign(
    motions=("sine5mm1Hz", "sine3mm2Hz", "sine15mm1Hz"),
    currents_A=(0.0, 0.5, 1.0, 1.5, 2.0),
    temperatures_degC=(20.0,),
    held_out_motions=(),
    held_out_temperatures_degC=(),
    steps=None,
)
WRONG = "nominal_020C_1.50A_sine3mm2Hz"


@pytest.fixture(scope="module")
def rig_runs():
    return [run for run, _ in measure(find_preset("nominal"), PLAN, seed=3)]


@pytest.fixture(scope="module")
def noisy():
    """Return twelve runs of a known damper: three motions at four currents."""
    return simulate_runs(TRUTH, noise=0.02, seed=5, duration=3.0, rate_Hz=400.0)


def late(run, seconds):
    return replace(run, force=np.interp(run.time - seconds, run.time, run.force))


def with_wrong_run(runs, change):
    return [change(run) if run.name == WRONG else run for run in runs]


def warnings_by_run(runs):
    findings = check(ReadFiles((), (), tuple(runs)), CheckOptions(deep=True)).findings
    return {finding.run: finding for finding in findings if finding.severity != "note"}


def test_run_with_late_force_is_reported(rig_runs):
    assert warnings_by_run(rig_runs) == {}
    finding = warnings_by_run(with_wrong_run(rig_runs, lambda run: late(run, 3e-3)))[WRONG]
    assert finding.kind == "force_delay"
    assert finding.size == pytest.approx(3e-3, rel=0.25)
    assert finding.low < finding.size < finding.high


@pytest.mark.nightly
def test_wrong_last_run_is_reported():
    """A fit to all runs adapts to the wrong run, so correct runs deviate. A second fit omits this run."""
    series = []
    for k, current in enumerate((0.0, 0.7, 1.4, 2.0)):
        motions = ((20, 0.5 + 0.03 * k), (17, 0.7 + 0.02 * k), (13, 0.9 - 0.02 * k), (9 + k, 1.1 + 0.05 * k))
        plan = replace(
            PLAN, motions=tuple(f"sine:{a}mm:{f:.2f}Hz" for a, f in motions), currents_A=(current,)
        )
        runs = [run for run, _ in measure(find_preset("nominal"), plan, seed=k)]
        series += [replace(run, name=f"{current:g}A {j}", source="") for j, run in enumerate(runs)]
    assert joint_test(series) == []
    wrong = [replace(run, force=0.7 * run.force) if run.name == "1.4A 3" else run for run in series]
    (finding,) = joint_test(wrong)
    assert (finding.run, finding.kind) == ("1.4A 3", "force_gain")
    assert finding.size == pytest.approx(0.7, abs=0.01)


@pytest.mark.nightly
def test_model_error_is_not_reported_as_fault():
    """The fitted law is inaccurate for a motion at all temperatures, so no single run is wrong."""
    plan = replace(
        PLAN,
        motions=("sine5mm1Hz", "sine3mm2Hz", "nonperiodic"),
        currents_A=(0.0, 1.0, 2.0),
        temperatures_degC=(20.0, 60.0, 100.0),
    )
    runs = tuple(run for run, _ in measure(find_preset("nominal"), plan, seed=3))
    fitted = mrdamper.fit(Dataset(runs), "dahl")
    free = [estimate.name for estimate in fitted.estimates if not estimate.at_bound]

    def run_findings(runs):
        return [finding for finding in find_deviations(fitted.damper, runs, free=free) if finding.run]

    assert run_findings(fitted.training) == []
    (wrong,) = (run for run in fitted.training if run.name == "nominal_060C_1.00A_sine3mm2Hz")
    stronger = replace(wrong, force=1.1 * wrong.force)
    (finding,) = run_findings([stronger if run is wrong else run for run in fitted.training])
    assert (finding.run, finding.kind) == (wrong.name, "force_gain")
    assert finding.size == pytest.approx(1.1, rel=0.03)


def test_correct_runs_have_no_finding(noisy):
    assert find_deviations(TRUTH, noisy) == ()
    assert find_suspects(TRUTH, noisy) == ()
    assert rms_residual(TRUTH, noisy, without="") == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize(
    ("kind", "size", "value", "unit", "words"),
    [
        ("force_gain", 0.2, 1.2, "", "its force is 1."),
        ("force_gain", -0.15, 0.85, "", "its force is 0.8"),
        ("force_delay", 4e-3, 4e-3, "s", "its force has a delay of "),
        ("force_offset_of_run", 60.0, 60.0, "N", "shifted by +"),
    ],
)
@pytest.mark.parametrize("number", [2, 6])
def test_wrong_run_is_reported_with_cause_and_size(noisy, number, kind, size, value, unit, words):
    runs = list(noisy)
    runs[number] = changed(runs[number], kind, size)
    (finding,) = find_deviations(TRUTH, runs)
    assert (finding.run, finding.kind, finding.severity) == (runs[number].name, kind, "warning")
    assert finding.size == pytest.approx(value, rel=0.25)
    assert [finding.low, finding.high] == pytest.approx([finding.size] * 2, rel=0.125)
    assert words in finding.found
    assert (finding.channel, finding.unit) == ("force", unit)
    assert find_suspects(TRUTH, runs)[0] == runs[number].name
    assert rms_residual(TRUTH, runs, without=runs[number].name) == pytest.approx(0.02, rel=0.06)


def test_exchanged_commands_are_reported_for_both_runs(noisy):
    runs = list(noisy)
    runs[6], runs[7] = replace(runs[6], force=runs[7].force), replace(runs[7], force=runs[6].force)
    findings = {finding.run: finding for finding in find_deviations(TRUTH, runs)}
    assert {finding.kind for finding in findings.values()} == {"labels_exchanged"}
    assert findings[runs[6].name].size == pytest.approx(1.0)
    assert findings[runs[7].name].size == pytest.approx(-1.0)
    assert runs[7].name in findings[runs[6].name].found


@pytest.mark.parametrize(("percent", "kinds"), [(2.0, ["errors_contradict"]), (9.0, []), (np.nan, [])])
def test_training_error_above_cross_validation_is_reported(noisy, percent, kinds):
    """A wrong model has a large training error, which contradicts a cross-validation error of 2 %."""
    wrong = TRUTH.with_parameters({"viscosity.c0": 1.2 * TRUTH.parameters["viscosity.c0"]})

    def kinds_of(split):
        errors = summarize_errors(score_each(wrong, noisy, split), (percent,) * 3)
        return [finding.kind for finding in find_contradictions(errors)]

    assert kinds_of("training") == kinds
    assert kinds_of("held_out") == []


def test_duplicate_of_held_out_run_is_reported(noisy):
    copy = replace(noisy[3], run=replace(noisy[3].run, name="copy"))

    def effect(training, held_out):
        (finding,) = (f for f in findings_of(training, held_out, TRUTH) if f.kind == "duplicate")
        assert finding.run == "copy"
        return finding.effect

    assert "A fit uses one of the two" in effect([*noisy, copy], [])
    assert "the fit uses its copy" in effect(noisy, [copy])
    assert effect([*noisy[:3], *noisy[4:]], [noisy[3], copy]) == "The run counts twice in the held-out error"


@pytest.mark.parametrize(
    ("cause", "size", "kind", "words"),
    [
        ("force_delay", 5e-3, "common_delay", "ms late"),
        ("force_delay", -5e-3, "common_delay", "ms early"),
        ("force_bandwidth", 0.02, "common_bandwidth", "filtered at about 8 Hz"),
    ],
)
def test_common_lag_of_runs_is_reported_once(noisy, cause, size, kind, words):
    (finding,) = find_deviations(TRUTH, [changed(run, cause, size) for run in noisy])
    assert (finding.run, finding.kind) == ("", kind)
    assert finding.size == pytest.approx(size, rel=0.2)
    assert [finding.low, finding.high] == pytest.approx([finding.size] * 2, rel=0.125)
    assert words in finding.found


@pytest.mark.parametrize(
    ("cause", "kind", "size", "value"),
    [("force_gain", "two_groups", 0.2, 1.2), ("force_delay", "group_delay", 12e-3, 12e-3)],
)
def test_wrong_runs_of_one_cause_are_grouped(noisy, cause, kind, size, value):
    group = (1, 4, 6, 11)
    runs = [changed(run, cause, size) if k in group else run for k, run in enumerate(noisy)]
    (finding,) = (finding for finding in find_deviations(TRUTH, runs) if finding.kind == kind)
    assert finding.size == pytest.approx(value, rel=0.2)
    assert "the 4 runs (" in finding.found
    assert all(noisy[k].name in finding.found for k in group)


@pytest.mark.parametrize(("rise", "word"), [(0.2, "grows"), (-0.2, "falls")])
def test_steadily_changing_gain_is_reported_as_drift(noisy, rise, word):
    order = np.random.default_rng(7).permutation(len(noisy))
    ramp = np.linspace(-0.5, 0.5, len(noisy))
    runs = [changed(noisy[k], "force_gain", rise * factor) for k, factor in zip(order, ramp, strict=True)]
    (finding,) = find_deviations(TRUTH, runs)
    assert finding.kind == "campaign_drift"
    assert finding.size == pytest.approx(rise, rel=0.1)
    assert f"the force {word} by" in finding.found
