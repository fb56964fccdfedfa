"""A known actuation (delay, lags, magnetic hysteresis, driver) is identified from simulated runs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import (
    CURRENT_STEPS,
    MOTIONS,
    CurrentSteps,
    Motion,
    RandomCurrent,
    RandomMotion,
    drive,
)
from mrdamper.identify.actuation import ActuationFit, fit_actuation, refine_actuation
from mrdamper.identify.actuation.step_responses import STEP_FRACTION, mean_time
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import NO_SMOOTHING, REFERENCE_DAMPERS

LAGS = ("rise_s", "fall_s", "second_s", "delay_s")
NOISE_N = 5.0
RATE_Hz = 1000.0
OVERSAMPLING = 16  # Number of simulated samples per measured sample
LAW = REFERENCE_DAMPERS["bouc-wen"]
KNOWN = {
    "slow rise": Actuation(0.009, 0.006, 0.003, 0.002),
    "slow fall": Actuation(0.004, 0.012, 0.002, 0.003),
    "equal": Actuation(0.010, 0.010, 0.003, 0.002),
}


def with_actuation(actuation: Actuation, damper: Damper = LAW, **changes: float) -> Damper:
    return replace(damper, actuation=replace(actuation, **changes))


def with_constants(damper: Damper, **constants: float) -> Damper:
    replaced = {name: Constant(value) for name, value in constants.items()}
    return replace(damper, coefficients={**damper.coefficients, **replaced})


def simulate_runs(
    damper: Damper,
    *,
    seed: int = 0,
    noise_N: float = NOISE_N,
    current: CurrentSteps | RandomCurrent = CURRENT_STEPS,
    motion: Motion = MOTIONS["steps"],
) -> PreparedRun:
    """Return a simulated run with force noise. The simulation has 16 samples per sample of the run."""
    duration = current.duration if isinstance(current, CurrentSteps) else 4.0
    samples, rate_Hz = round(duration * RATE_Hz), OVERSAMPLING * RATE_Hz
    times = np.arange(OVERSAMPLING * (samples - 1) + 1) / rate_Hz
    path = drive(motion, duration=times[-1], rate_Hz=rate_Hz, command=current.current(times))
    noise = noise_N * np.random.default_rng(seed).standard_normal(samples)
    run = RigRun(
        name="steps",
        time=path.time[::OVERSAMPLING],
        displacement=path.displacement[::OVERSAMPLING],
        force=simulate(damper, path)[::OVERSAMPLING] + noise,
        command=path.command[::OVERSAMPLING],
        command_unit="A",
        motion="steps",
    )
    return prepare_run(run, NO_SMOOTHING)


def random_current(seed: int = 1) -> RandomCurrent:
    return RandomCurrent(highest=2.0, shortest=0.02, longest=0.3, seed=seed)


def fit(*runs: PreparedRun, damper: Damper = LAW) -> ActuationFit:
    return fit_actuation(damper, runs)[1]


@cache
def fit_known(name: str, *, seed: int = 0, noise_N: float = NOISE_N) -> ActuationFit:
    return fit(simulate_runs(with_actuation(KNOWN[name]), seed=seed, noise_N=noise_N))


def lags_of(actuation: Actuation) -> FloatArray:
    return np.array([getattr(actuation, name) for name in LAGS])


def errors_of(result: ActuationFit) -> FloatArray:
    return np.array([result.standard_errors[name] for name in LAGS])


# Delay and lags between current and force


@pytest.mark.nightly
def test_identified_lags_are_within_standard_errors():
    """At most one of 16 lags (four lags, four seeds) deviates by three standard errors, and none by four."""
    deviations = []
    for seed in range(4):
        result = fit_known("slow fall", seed=seed)
        assert (errors_of(result) < 3e-4).all()
        deviations.append(np.abs(lags_of(result.actuation) - lags_of(KNOWN["slow fall"])) / errors_of(result))
    assert np.sum(np.array(deviations) >= 3.0) <= 1
    assert np.max(deviations) < 4.0


@pytest.mark.parametrize("name", KNOWN)
def test_identified_lags_are_exact_without_noise(name):
    """In addition, the force error is below 5 % of the error without lags."""
    result = fit_known(name, noise_N=0.0)
    assert lags_of(result.actuation) == pytest.approx(lags_of(KNOWN[name]), rel=0.02, abs=2e-5)
    assert result.rmse_N < 0.05 * result.unlagged_rmse_N


def test_force_errors_of_law_leave_identified_lags_unchanged():
    """The lags stay the same if the law has 20 % too much yield force and an offset error of 50 N."""
    yield_force = LAW.coefficients["yield_force"]
    assert isinstance(yield_force, Polynomial)
    stronger = Polynomial(tuple(1.2 * number for number in yield_force.parameters))
    wrong = with_constants(LAW, offset=90.0)
    wrong = replace(wrong, coefficients={**wrong.coefficients, "yield_force": stronger})
    reference = fit_known("slow rise", seed=3)
    result = fit(simulate_runs(with_actuation(KNOWN["slow rise"]), seed=3), damper=wrong)
    difference = np.abs(lags_of(result.actuation) - lags_of(reference.actuation))
    assert (difference < 3.0 * errors_of(reference)).all()


def test_response_time_ignores_force_change_over_stroke():
    """A force that is a third larger at both ends of the stroke changes the times by less than 8 %."""
    run = simulate_runs(with_actuation(KNOWN["slow rise"]), seed=2)
    x = run.trajectory.displacement
    result = fit(replace(run, force=run.force * (1.0 + 0.3 * (x / x.max()) ** 2)))
    for time_s, ends in ((result.t63_s, (0.0, 1.0)), (result.t63_fall_s, (1.0, 0.0))):
        assert time_s == pytest.approx(KNOWN["slow rise"].response_time(STEP_FRACTION, *ends), rel=0.08)
    assert result.actuation.rise_s == pytest.approx(KNOWN["slow rise"].rise_s, rel=0.08)
    assert result.t63_error_s > 0.0


def test_response_time_solves_closed_form():
    """After the delay, the response of two lags in series is 1 - (a exp(-t/a) - b exp(-t/b)) / (a - b)."""
    result = fit_known("slow rise")
    a, b = result.actuation.rise_s, result.actuation.second_s

    def remaining(t: float, fraction: float) -> float:
        return float(1.0 - (a * np.exp(-t / a) - b * np.exp(-t / b)) / (a - b)) - fraction

    for fraction, time_s in ((0.63, result.actuation.response_time(0.63)), (0.9, result.t90_s)):
        expected_s = result.actuation.delay_s + brentq(remaining, 0.0, 1.0, args=(fraction,))
        assert time_s == pytest.approx(expected_s, abs=2e-5)


def test_lag_in_law_does_not_change_identified_lags():
    """A lag that the law already contains is ignored, so that no lag is counted twice."""
    run = simulate_runs(with_actuation(KNOWN["slow rise"]))
    lagged = fit(run, damper=replace(LAW, command_lag_s=0.02))
    assert lags_of(lagged.actuation) == pytest.approx(lags_of(fit_known("slow rise").actuation))


def test_response_times_are_found_from_random_current():
    """Without intervals of constant current, the response times are derived from the force of whole runs."""
    run = simulate_runs(with_actuation(KNOWN["slow fall"]), current=random_current(), noise_N=0.0)
    result = fit(run)
    for time_s, ends in ((result.t63_s, (0.0, 1.0)), (result.t63_fall_s, (1.0, 0.0))):
        assert time_s == pytest.approx(KNOWN["slow fall"].response_time(STEP_FRACTION, *ends), rel=0.1)
    assert result.driver_quadrants is None


@pytest.mark.nightly
def test_force_fraction_that_follows_current_immediately_is_identified():
    """Half of the bristle force follows the current immediately.

    The fit finds this from two initial values.
    """
    bristles = {"bristle_share": 0.9, "bristle_stiffness": 4e5, "friction_force": 60.0}
    chain = with_constants(REFERENCE_DAMPERS["chain"], **bristles, friction_stiffness=2e5)
    truth = with_actuation(KNOWN["slow rise"], with_constants(chain, follow_share=0.5))
    run = simulate_runs(truth, current=RandomCurrent(), motion=RandomMotion(6e-3, 0.5, 4.0))
    damper, result = fit_actuation(with_constants(chain, follow_share=0.3), [run])
    far = with_actuation(KNOWN["slow rise"], with_constants(chain, follow_share=0.8))
    other, _ = fit_actuation(chain, [run], start=far)
    for found in (damper, other):
        assert float(found.coefficients["follow_share"].value(0.0)) == pytest.approx(0.5, abs=0.1)
    assert damper.actuation == result.actuation
    assert result.t63_s == pytest.approx(KNOWN["slow rise"].response_time(STEP_FRACTION), rel=0.1)


@given(st.integers(0, 2**32 - 1), st.integers(2, 5), st.integers(2, 6))
def test_error_of_mean_response_time_includes_scatter(seed, kind_count, repeat_count):
    """The standard error combines 6 % of the mean with the scatter of step kinds or of repeated steps."""
    times = np.random.default_rng(seed).uniform(5e-3, 2e-2, (kind_count, repeat_count))
    pairs = [((0, kind), float(time_s)) for kind, row in enumerate(times) for time_s in row]
    mean = mean_time(pairs, 0.06)
    repeat_error = np.sqrt(times.var(axis=1, ddof=1).mean() / times.size)
    scatter = times.mean(axis=1).std(ddof=1) / np.sqrt(kind_count)
    assert mean.mean_s == pytest.approx(times.mean())
    assert mean.repeat_error_s == pytest.approx(repeat_error)
    assert mean.error_s == pytest.approx(np.hypot(max(scatter, repeat_error), 0.06 * times.mean()))
    assert np.isnan(mean_time([]).mean_s)


# Magnetic hysteresis


@pytest.mark.nightly
@pytest.mark.parametrize("play", [0.0, 0.02, 0.08])
def test_identified_hysteresis_deviates_by_few_standard_errors(play):
    """For eight seeds, the fitted loop width deviates by at most four standard errors plus 2 %."""
    damper = with_actuation(KNOWN["slow rise"], hysteresis_width_A=play)
    results = [fit(simulate_runs(damper, seed=seed)) for seed in range(8)]
    errors = np.array([result.standard_errors["hysteresis_width_A"] for result in results])
    deviations = np.array([result.actuation.hysteresis_width_A for result in results]) - play
    assert (errors < 2e-3).all()
    assert (np.abs(deviations) < 4.0 * errors + 0.02 * play).all()


def test_wide_hysteresis_is_found_from_random_current():
    """Lags and hysteresis are fitted together. Both increase the force after a decrease of the current."""
    known = Actuation(0.0012, 0.0018, 0.0006, 0.0001, hysteresis_width_A=0.34)
    run = simulate_runs(with_actuation(known), current=random_current(), motion=MOTIONS["sine15mm1Hz"])
    result = fit(run)
    assert result.actuation.hysteresis_width_A == pytest.approx(0.34, rel=0.03)
    assert result.rmse_N < 3.0 * NOISE_N


# Runs without usable steps


def test_lag_fit_without_current_steps_is_rejected():
    """The message names the missing test. A damper that ignores the current is rejected, too."""
    constant = simulate_runs(LAW, current=CurrentSteps((1.0,), 4.0))
    with pytest.raises(InputError, match=r"no run has a step of the command.*current stepped at mid-stroke"):
        fit(constant)
    passive = with_constants(LAW, viscosity=800.0, stiffness=1500.0, offset=40.0, yield_force=300.0)
    with pytest.raises(InputError, match="no run has a step of the command that moves the force"):
        fit(simulate_runs(passive), damper=passive)


# Driver and magnetic core


def test_one_quadrant_driver_is_detected():
    """The free-wheeling current decays with a time constant of 25 ms to zero or to the next set current."""
    run = simulate_runs(with_actuation(Actuation(0.005, 0.005, 0.001, 0.001)), seed=4)
    path, step_s = run.trajectory, run.trajectory.step
    applied, current = [], 0.0
    for command in path.command.tolist():
        pulled = command + (current - command) * np.exp(-step_s / 0.005)
        current = max(pulled, current * np.exp(-step_s / 0.025))
        applied.append(current)
    force = simulate(LAW, replace(path, command=np.array(applied)))
    free_wheeling = fit(replace(run, force=force))
    assert free_wheeling.driver_quadrants == 1
    assert free_wheeling.t63_fall_s > 2.0 * free_wheeling.t63_s
    assert fit(run).driver_quadrants == 2


@pytest.mark.nightly
def test_freewheeling_time_is_identified():
    """The error is at most 2 %. A driver that can reverse its voltage gets no free-wheeling time."""
    known = Actuation(0.005, 0.001, 0.001, 0.001, hysteresis_width_A=0.05, freewheel_time_s=0.025)
    damper = with_actuation(known)
    runs = [simulate_runs(damper, seed=6), simulate_runs(damper, current=random_current())]
    _, result = refine_actuation(*fit_actuation(LAW, runs), runs)
    assert result.actuation.freewheel_time_s == pytest.approx(0.025, rel=0.02)
    assert result.actuation.hysteresis_width_A == pytest.approx(0.05, rel=0.05)
    assert result.standard_errors["freewheel_time_s"] < 0.02 * 0.025
    assert result.actuation.saturation == 0.0
    pulled = fit_actuation(LAW, [simulate_runs(with_actuation(known, freewheel_time_s=0.0))])
    assert refine_actuation(*pulled, runs) == pulled


@pytest.mark.nightly
def test_saturation_and_wide_loop_of_core_are_identified():
    """Saturation and wide hysteresis loop deviate by at most 10 %. Both are zero for a core without them."""
    known = Actuation(
        0.004, 0.005, 0.002, 0.001, hysteresis_width_A=0.04, wide_hysteresis_width_A=0.2, saturation=1.5
    )

    def refined(actuation: Actuation, count: int) -> ActuationFit:
        damper = with_actuation(actuation)
        random = [simulate_runs(damper, current=random_current(seed)) for seed in range(1, count + 1)]
        runs = [simulate_runs(damper, seed=6), *random]
        return refine_actuation(*fit_actuation(LAW, runs), runs)[1]

    saturating, linear = (
        refined(known, 2),
        refined(replace(known, wide_hysteresis_width_A=0.0, saturation=0.0), 1),
    )
    assert saturating.driver_quadrants != 1
    for name in ("wide_hysteresis_width_A", "saturation"):
        assert getattr(saturating.actuation, name) == pytest.approx(getattr(known, name), rel=0.1)
        assert saturating.standard_errors[name] < 0.1 * getattr(known, name)
    assert (
        linear.actuation.saturation
        == linear.actuation.wide_hysteresis_width_A
        == linear.actuation.freewheel_time_s
        == 0.0
    )


@pytest.mark.nightly
def test_saturation_with_freewheeling_is_identified():
    """The identified saturation deviates by at most 10 %.

    If the type of the driver is unknown, cross-validation finds that the driver has one quadrant.
    """
    known = Actuation(
        0.005, 0.001, 0.001, 0.001, hysteresis_width_A=0.05, freewheel_time_s=0.05, saturation=0.8
    )
    damper = with_actuation(known)
    runs = [
        simulate_runs(damper, seed=6),
        *(simulate_runs(damper, current=random_current(seed)) for seed in (1, 2)),
    ]
    first_damper, first = fit_actuation(LAW, runs)
    assert first.driver_quadrants == 1
    result = refine_actuation(first_damper, first, runs)[1]
    for name, tolerance in (("saturation", 0.1), ("freewheel_time_s", 0.05), ("hysteresis_width_A", 0.05)):
        assert getattr(result.actuation, name) == pytest.approx(getattr(known, name), rel=tolerance)
        assert result.standard_errors[name] < tolerance * getattr(known, name)
    unknown = replace(first, driver_quadrants=None)
    assert refine_actuation(first_damper, unknown, runs)[1].driver_quadrants == 1
