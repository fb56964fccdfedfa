"""Posterior samples of parameters agree with linear regression, stay in bounds and cover known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.excitation import Harmonics, Motion, Sine, drive
from mrdamper.identify.confidence.held_out_folds import refit_without_folds, with_errors_between_motions
from mrdamper.identify.confidence.posterior import sample_posterior
from mrdamper.identify.problem import FitProblem, FreeParameter, SearchResult
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import find_law
from mrdamper.models.simulate import simulate
from tests.identify.reference_dampers import simulate_runs
from tests.identify.small_problems import linear_problem

FREE = (
    FreeParameter("rho.value", 900.0, 3600.0, scale="log"),
    FreeParameter("kappa.value", -0.8, 0.2),
    FreeParameter("n.value", 0.8, 2.4, scale="log"),
    FreeParameter("viscosity.value", 0.0, 1e5, linear=True),
    FreeParameter("offset.value", -1e4, 1e4, linear=True),
    FreeParameter("yield_force.value", 0.0, 1e5, linear=True),
)


def random_campaign(seed: int) -> tuple[Damper, FitProblem, SearchResult]:
    """Return a damper with random parameters and a fit to four simulated runs with noise."""
    rng = np.random.default_rng(seed)
    values = {
        "rho": np.exp(rng.uniform(*np.log([1200.0, 2700.0]))),
        "kappa": rng.uniform(-0.6, 0.0),
        "n": np.exp(rng.uniform(*np.log([1.0, 2.0]))),
        "viscosity": rng.uniform(500.0, 2000.0),
        "offset": rng.uniform(-50.0, 50.0),
        "yield_force": rng.uniform(300.0, 900.0),
    }
    reference = Damper(find_law("bouc-wen"), {name: Constant(float(v)) for name, v in values.items()})
    problem = FitProblem(reference, FREE, simulate_runs(reference, noise=0.05, seed=seed)[:4])
    return reference, problem, fit_variable_projection(problem, dampers=[reference])


def with_standard_errors(result: SearchResult, **errors: float) -> SearchResult:
    estimates = tuple(
        replace(e, standard_error=errors.get(e.name.partition(".")[0], e.standard_error))
        for e in result.estimates
    )
    return replace(result, estimates=estimates)


def test_posterior_of_linear_regression_is_normal():
    """The bounds are far away, so mean and covariance of the samples equal the fit and its covariance."""
    problem, result = linear_problem()
    samples = sample_posterior(problem, result, draws=20_000).values
    errors = np.array([e.standard_error for e in result.estimates])
    mean = np.array([e.value for e in result.estimates])
    assert (samples.mean(axis=0) - mean) / errors == pytest.approx(np.zeros(3), abs=0.03)
    expected = result.correlation
    assert np.cov(samples.T) / np.outer(errors, errors) == pytest.approx(expected, abs=0.04)


def test_posterior_samples_match_standard_errors():
    """A wrong model has larger standard errors from motion to motion. The samples have the same spread."""
    problem, _ = linear_problem()
    runs = tuple(
        replace(run, force=np.asarray(run.force) * (1.01 if run.run.motion == "harmonics" else 1.0))
        for run in problem.runs
    )
    problem = replace(problem, runs=runs)
    own = fit_variable_projection(problem, dampers=[problem.template])
    folds = refit_without_folds(problem, own)
    assert folds is not None
    result = with_errors_between_motions(problem, own, folds)
    errors = np.array([e.standard_error for e in result.estimates])
    assert (errors > 1.2 * np.array([e.standard_error for e in own.estimates])).any()
    assert result.covariance is not None
    assert np.sqrt(np.diag(result.covariance)) == pytest.approx(errors, rel=1e-12)
    assert np.linalg.eigvalsh(result.covariance / np.outer(errors, errors)).min() > -1e-12
    samples = sample_posterior(problem, result, draws=20_000).values
    assert samples.std(axis=0) / errors == pytest.approx(np.ones(3), abs=0.03)


def test_posterior_samples_stay_inside_bounds():
    """The standard errors exceed the range between the bounds, so the samples fill this range."""
    _, problem, result = random_campaign(1)
    wide = with_standard_errors(result, rho=1e6, kappa=50.0, yield_force=2000.0)
    samples = sample_posterior(problem, wide, draws=2000)
    columns = dict(zip(samples.names, samples.values.T, strict=True))
    for free in FREE[:3]:
        assert free.lower < columns[free.name].min() < columns[free.name].max() < free.upper
    assert np.ptp(columns["kappa.value"]) > 0.9
    assert np.ptp(np.log(columns["rho.value"])) > 0.9 * np.log(4.0)
    assert columns["yield_force.value"].min() >= 0.0


def test_power_interval_covers_reference_power():
    """The 90 % interval contains the mean power of the reference damper in most of ten campaigns."""
    motions: list[Motion] = [Harmonics((4e-3, 2e-3), (0.9, 3.1), (0.2, 1.0)), Sine(8e-3, 1.4)]
    paths = [drive(motion, duration=2.0, rate_Hz=250.0, command=1.0) for motion in motions]

    def power(damper: Damper) -> FloatArray:
        return np.array([np.mean(simulate(damper, path) * path.velocity) for path in paths])

    inside = []
    for seed in range(100, 110):
        reference, problem, result = random_campaign(seed)
        samples = sample_posterior(problem, result, draws=50)
        powers = [power(damper) for damper in samples.dampers(result.damper, len(samples))]
        low, high = np.percentile(powers, (5.0, 95.0), axis=0)
        inside.append((low <= power(reference)) & (power(reference) <= high))
    assert 0.75 <= np.mean(inside) <= 1.0


@pytest.mark.nightly
def test_parameter_intervals_contain_known_values():
    """The 90 % intervals of six parameters contain the known values in 85 to 97 % of 60 campaigns."""
    inside = []
    for seed in range(7000, 7060):
        reference, problem, result = random_campaign(seed)
        percentiles = sample_posterior(problem, result, draws=400, seed=seed).percentiles
        values = reference.parameters_and_lag
        inside.append([low <= values[name] <= high for name, (low, high) in percentiles.items()])
    assert 0.85 <= np.mean(inside) <= 0.97


def test_same_seed_gives_same_posterior_samples():
    problem, result = linear_problem()
    one, two, other = (sample_posterior(problem, result, draws=50, seed=s).values for s in (3, 3, 4))
    assert np.array_equal(one, two)
    assert not np.allclose(one, other)
