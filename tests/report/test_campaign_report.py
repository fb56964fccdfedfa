"""Reports of campaigns with many runs or temperatures contain force losses and characteristics."""

from __future__ import annotations

import html
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import mrdamper
from mrdamper.data.prepare import Preparation, prepare_run
from mrdamper.excitation import Sine
from mrdamper.identify.scores import RunError
from mrdamper.models.characteristics import steady_cycle
from mrdamper.models.dependence import TemperatureDependent
from mrdamper.report.identification.campaign import (
    Campaign,
    levels_of,
    main_sine,
    peak_force,
    pick_of,
    sine_of,
)
from mrdamper.report.identification.page import PAGE
from mrdamper.report.identification.scores import pooled_table
from mrdamper.report.identification.temperature import characteristics_section, temperature_section
from mrdamper.report.page import significant
from tests.support.warm import MOTIONS, NOISE_N, warm_damper, warm_runs

pytestmark = pytest.mark.system

AS_IT_IS = Preparation(cutoff_Hz=math.inf, reference="none")


@pytest.fixture(scope="module")
def fitted():
    runs = warm_runs(warm_damper())
    return mrdamper.fit(runs, "dahl", hold_out=["*_060C_*"], terms=(), preparation=AS_IT_IS)


@pytest.fixture(scope="module")
def judged(fitted):
    return fitted.assessment


@pytest.fixture(scope="module")
def text(fitted):
    return PAGE.render(fitted)


def visible_text(text: str) -> str:
    """Return the visible text of a page with single spaces."""
    text = re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", text)).split())


def an_error(**changed: object) -> RunError:
    fields: dict[str, object] = {
        "name": "a",
        "split": "training",
        "rmse_N": 10.0,
        "nrmse_percent": 3.0,
        "nrmse_whole_percent": 3.0,
        "nrmse_offset_free_percent": 3.0,
        "command": 1.0,
        "command_unit": "A",
        "motion": "sine 5 mm 1 Hz",
        "temperature_degC": 20.0,
        "energy_measured_J": 1.0,
        "energy_model_J": 1.0,
        "peak_measured_N": 1.0,
        "peak_model_N": 1.0,
    }
    return RunError(**{**fields, **changed})  # type: ignore[arg-type]


# ----------------------------------------------------------------------------------------- levels and motions


def test_similar_temperatures_form_one_group():
    errors = [an_error(temperature_degC=t) for t in (19.8, 20.3, 119.9, 120.2, 123.0)]
    levels = levels_of(errors)
    assert (levels.kind, len(levels.values)) == ("temperature", 3)
    assert levels.values == pytest.approx((20.05, 120.05, 123.0))


def test_runs_without_temperature_are_grouped_by_current():
    errors = [an_error(temperature_degC=None, command=c) for c in (0.0, 2.0, 1.0, None)]
    levels = levels_of(errors)
    assert (levels.kind, levels.values) == ("command", (0.0, 1.0, 2.0))
    assert [levels.level_of(error) for error in errors] == [0.0, 2.0, 1.0, None]


def test_report_separates_training_and_held_out_errors():
    errors = [
        an_error(rmse_N=3.0),
        an_error(rmse_N=4.0, command=2.0),
        an_error(rmse_N=12.0, split="held_out"),
        an_error(rmse_N=7.0, motion="chirp", temperature_degC=60.0),
    ]
    rows = [row["cells"] for row in pooled_table(errors).web_json()["rows"]]
    assert rows == [
        ["sine 5 mm 1 Hz", f"{math.sqrt(12.5):.1f} (12.0)", None],
        ["chirp", None, "7.0"],
        ["all motions", f"{math.sqrt(12.5):.1f} (12.0)", "7.0"],
    ]


def test_main_sine_has_most_operating_points():
    errors = [an_error(command=c) for c in (0.0, 1.0)]
    errors += [an_error(command=c, motion="sine 3 mm 2 Hz") for c in (0.0, 1.0, 2.0)]
    errors += [an_error(command=c, motion="random 3 mm 1-3 Hz") for c in (0.0, 1.0, 2.0, 3.0)]
    assert main_sine(errors, levels_of(errors)) == "sine 3 mm 2 Hz"
    assert main_sine(errors[-4:], levels_of(errors)) is None


def test_measured_peak_force_equals_damper_force():
    """The mean peak force of two cycles has an error of a few standard deviations of the noise (4 N)."""
    damper = warm_damper()
    for run in warm_runs(damper):
        prepared = prepare_run(run, AS_IT_IS)
        assert run.temperature is not None
        motion = MOTIONS[run.name.rpartition("_")[2]]
        assert isinstance(motion, Sine)
        cycle = steady_cycle(damper, motion, float(run.command[0]), float(run.temperature[0]))
        peak, pick = peak_force(prepared), pick_of(prepared)
        assert peak is not None
        assert pick is not None
        assert peak == pytest.approx(cycle.peak_N, abs=4.0 * NOISE_N)
        fastest = 2.0 * math.pi * motion.frequency * motion.amplitude
        assert pick.velocity == pytest.approx(fastest, rel=0.02)
        # The measured force is a mean within 18 degrees of the peak velocity, where the speed is 1.7 % lower.
        assert pick.extension == pytest.approx(cycle.extension_N, rel=0.02, abs=NOISE_N)
        assert pick.retraction == pytest.approx(cycle.retraction_N, rel=0.02, abs=NOISE_N)


def test_amplitude_and_frequency_of_sine_are_recovered():
    prepared = [prepare_run(run, AS_IT_IS) for run in warm_runs(warm_damper()) if "sine3mm2Hz" in run.name]
    found = sine_of(prepared)
    assert found is not None
    assert (found.amplitude, found.frequency) == pytest.approx((3e-3, 2.0), rel=1e-3)


# ------------------------------------------------------------------------------------------- sections


def test_smaller_force_loss_at_high_current_is_reported(fitted, judged):
    warmth = temperature_section(Campaign(fitted, judged.runs))
    assert warmth is not None
    assert "The relative loss is smaller at higher current, measured and modelled." in warmth.summary
    assert warmth.summary.startswith("From 20 to 100 °C, the peak force of the sine 5 mm 1 Hz decreases by ")


def test_larger_force_loss_at_high_current_is_reported():
    """The relative force loss increases with current if the viscosity does not depend on temperature."""
    runs = warm_runs(warm_damper(viscous_loss_K=0.0, yield_slope=4e-3))
    fitted = mrdamper.fit(runs, "dahl", terms=(), preparation=AS_IT_IS)
    warmth = temperature_section(Campaign(fitted, mrdamper.assess(fitted).runs))
    assert warmth is not None
    assert "only for some currents, measured and modelled." in warmth.summary


def test_reported_force_loss_equals_known_loss(fitted, judged):
    """The loss at 2 A and 100 degC contains the losses of viscous force and yield force."""
    warmth = temperature_section(Campaign(fitted, judged.runs))
    assert warmth is not None
    truth = warm_damper()
    peaks = [steady_cycle(truth, Sine(5e-3, 1.0), 2.0, warm).peak_N for warm in (293.15, 373.15)]
    (told,) = re.findall(r"(\d+) % \(measured (\d+) %\) at 2 A", warmth.summary)
    lost = 100.0 * (1.0 - peaks[1] / peaks[0])
    assert [float(number) for number in told] == pytest.approx([lost, lost], abs=1.5)


def test_reported_characteristics_equal_known_characteristics(fitted, judged):
    found = characteristics_section(Campaign(fitted, judged.runs)).found
    assert found.scope.temperatures == pytest.approx((293.15, 333.15, 373.15))
    assert found.scope.commands == (0.0, 1.0, 2.0)
    truth = warm_damper()
    for t, warm in enumerate(found.scope.temperatures):
        for i, command in enumerate(found.scope.commands):
            cycle = steady_cycle(truth, found.scope.motion, command, warm)
            assert found.energy[t, i] == pytest.approx(cycle.energy_J, rel=0.02)
    assert found.gas_N[0] == pytest.approx([20.0] * 3, abs=1.0)
    assert found.responses == ()


# ----------------------------------------------------------------------------------------- page of the report


def test_report_shows_each_temperature(text, judged):
    said = visible_text(text)
    for level in ("20 °C", "60 °C", "100 °C"):
        assert said.count(level) > 5
    pooled = math.sqrt(np.mean([e.rmse_N**2 for e in judged.runs if e.split == "held_out"]))
    assert f"({pooled:.1f})" in said
    assert "no run has current steps" in said


def test_report_table_contains_every_run(text, judged):
    for error in judged.runs:
        assert error.name in text


@pytest.mark.nightly
def test_assumed_temperature_factors_in_report_are_marked(fitted, text):
    assert "assumed" not in visible_text(text)
    forms = {
        name: replace(form, assumed=True)
        if isinstance(form, TemperatureDependent) and name == "viscosity"
        else form
        for name, form in fitted.damper.coefficients.items()
    }
    damper = replace(fitted.damper, coefficients=forms)
    assumed = replace(fitted, result=replace(fitted.result, damper=damper))
    said = visible_text(PAGE.render(assumed))
    assert "The temperature dependence is assumed." in said
    assert "The temperature factor of viscosity was taken from a fluid" in said
    assert "viscosity, N s/m (assumed)" in said
    assert "temperature assumed" in said
    assert "Assumed: From 20 to 100 °C" in said


@pytest.mark.nightly
def test_report_of_current_steps_has_temperature_effects(fitted, judged):
    """Without runs at constant current, the report has no measured operating points."""
    stepping = tuple(replace(error, command=None) for error in judged.runs)
    said = visible_text(PAGE.render(replace(fitted, assessment=replace(judged, runs=stepping))))
    assert "Effect of temperature" in said
    assert "current steps" in said


@pytest.mark.nightly
def test_report_of_many_runs_shows_worst_runs(fitted, judged):
    """A report with 49 runs contains a table of the worst run of each motion."""
    training = [run for run in fitted.training if "sine5mm" in run.name][:4]
    runs, errors = [], []
    by_name = {error.name: error for error in judged.runs}
    for copy in range(49):
        run = training[copy % len(training)]
        name = f"{run.name}_{copy}"
        runs.append(replace(run, run=replace(run.run, name=name)))
        errors.append(replace(by_name[run.name], name=name, temperature_degC=None))
    many = PAGE.render(
        replace(fitted, training=tuple(runs), held_out=(), assessment=replace(judged, runs=tuple(errors)))
    )
    assert "All 49 runs" in visible_text(many)
    assert 'aria-label="The worst run of each motion"' in many
    few = PAGE.render(
        replace(
            fitted, training=tuple(runs[:3]), held_out=(), assessment=replace(judged, runs=tuple(errors[:3]))
        )
    )
    assert "<details>" not in few
    assert 'aria-label="The worst run of each motion"' not in few


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (21.96, 3, "22.0"),
        (999.6, 3, "1000"),
        (0.0, 2, "0.0"),
        (1234.0, 2, "1200"),
        (-0.04567, 2, "-0.046"),
        (math.nan, 3, ""),
        (None, 3, ""),
        (1.2e-8, 2, "1.2e-08"),
    ],
)
def test_significant_digits_keep_trailing_zeros(value, digits, text):
    assert significant(value, digits) == text
