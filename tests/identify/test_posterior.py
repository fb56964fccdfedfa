"""Posterior draws: against closed forms, and by simulation-based calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from mrdamper.arrays import FloatArray, rms
from mrdamper.errors import InputError
from mrdamper.excitation import Harmonics, drive
from mrdamper.identify.confidence import posterior
from mrdamper.identify.confidence.posterior import effective_sample_sizes, sample_posterior
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.objective import Objective
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.models.card_draws import read_draws, write_draws
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import find_law
from mrdamper.models.simulate import simulate
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import ProgressUpdate
from tests.identify.test_identifiability import linear_problem, normal_matrix
from tests.identify.truths import TRUTHS, measured

_FREE = (
    FreeParameter("rho.value", 900.0, 3600.0, scale="log"),
    FreeParameter("kappa.value", -0.8, 0.2),
    FreeParameter("n.value", 0.8, 2.4, scale="log"),
    FreeParameter("viscosity.value", 0.0, 1e5, linear=True),
    FreeParameter("offset.value", -1e4, 1e4, linear=True),
    FreeParameter("yield_force.value", 0.0, 1e5, linear=True),
)
_DRAWS = 99


def test_the_effective_sample_size_of_an_autoregression_is_the_closed_form():
    """Of x' = a x + noise, n draws tell as much of the mean as n (1 - a) / (1 + a) independent ones."""
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((20_000, 16, 3))
    chains = np.stack(
        [lfilter([1.0], [1.0, -a], noise[..., k], axis=0) for k, a in enumerate((0, 0.5, 0.9))], -1
    )
    expected = chains[..., 0].size * np.array([1.0, 1.0 / 3.0, 1.0 / 19.0])
    assert effective_sample_sizes(chains) == pytest.approx(expected, rel=0.1)


def test_parameters_that_the_force_is_linear_in_have_the_normal_posterior_of_regression():
    problem, result = linear_problem()
    found = sample_posterior(problem, result, draws=4000)
    share = np.array([found.standard_deviation[e.name] / e.standard_error for e in result.estimates])
    assert np.exp(np.mean(np.log(share))) == pytest.approx(1.0, rel=0.05)
    for e in result.estimates:
        spread = found.standard_deviation[e.name]
        column = found.draws.values[:, found.draws.names.index(e.name)]
        assert np.mean(column) == pytest.approx(e.value, abs=4.0 * spread / np.sqrt(4000))
        assert found.draws.percentiles[e.name] == pytest.approx(
            (e.value - 1.645 * spread, e.value + 1.645 * spread), abs=0.12 * spread
        )


def ranks(campaigns: int, seed: int) -> FloatArray:
    """Return the ranks of known parameters, and of predictions, among their draws, shape (campaigns, ...).

    Predicted is a run that no fit has seen, another motion at another command: its mean power, by which a
    damper heats, and its RMS distance from a wanted force, which is what an error of tracking is.

    The nonlinear ones are drawn from the prior, the linear ones from a range beside which a posterior is
    narrow; each campaign has four runs with noise of 5 % of a run's spread, as the cost weighs them.
    """
    rng = np.random.default_rng(seed)
    found = []
    for k in range(campaigns):
        forms = {
            "rho": Constant(float(np.exp(rng.uniform(*np.log([900.0, 3600.0]))))),
            "kappa": Constant(float(rng.uniform(-0.8, 0.2))),
            "n": Constant(float(np.exp(rng.uniform(*np.log([0.8, 2.4]))))),
            "viscosity": Constant(float(rng.uniform(500.0, 2000.0))),
            "offset": Constant(float(rng.uniform(-50.0, 50.0))),
            "yield_force": Constant(float(rng.uniform(300.0, 900.0))),
        }
        truth = Damper(find_law("bouc-wen"), forms)
        problem = FitProblem(truth, _FREE, measured(truth, noise=0.05, seed=seed + k)[:4])
        result = fit_variable_projection(problem, starts=0, first=truth)
        draws = sample_posterior(problem, result, draws=_DRAWS, seed=k).draws
        values = truth.parameters_and_lag
        known = np.array([values[name] for name in draws.names])
        foretold = np.array([predictions(each) for each in draws.dampers(result.damper, len(draws))])
        drawn = np.hstack([draws.values, foretold])
        found.append((drawn < np.append(known, predictions(truth))).sum(axis=0))
    return np.array(found, dtype=np.float64)


def predictions(damper: Damper) -> tuple[float, float]:
    """Return the mean power [W] of a damper on a new run, and its RMS distance from a wanted force [N]."""
    path = drive(Harmonics((4e-3, 2e-3), (0.9, 3.1), (0.2, 1.0)), duration=2.0, rate_Hz=500.0, command=1.0)
    force = simulate(damper, path)
    return float(np.mean(force * path.velocity)), rms(force - 600.0 * np.sign(path.velocity))


def check_even(found: FloatArray, bins: int) -> None:
    """Check that ranks of every parameter are even over 0 .. draws, by chi-square at 0.1 % over all."""
    for column in found.T:
        counts = np.histogram(column, bins=bins, range=(0.0, _DRAWS + 1.0))[0]
        expected = len(column) / bins
        statistic = float(np.sum((counts - expected) ** 2) / expected)
        assert chi2.sf(statistic, bins - 1) > 1e-3 / found.shape[1], counts


@pytest.mark.release
def test_ranks_of_known_parameters_are_even_over_two_hundred_campaigns():
    """Simulation-based calibration (Talts et al. 2018): of a posterior that is right, ranks are even."""
    check_even(ranks(200, seed=1000), bins=10)


def test_draws_are_read_again_beside_their_own_card_alone(tmp_path):
    problem, result = linear_problem()
    draws = sample_posterior(problem, result, draws=50).draws
    write_draws(draws, result.damper, tmp_path / "posterior.npz")
    again = read_draws(tmp_path, result.damper)
    assert again.names == draws.names
    assert np.array_equal(again.values, draws.values)
    with pytest.raises(InputError, match="draws are of another card"):
        read_draws(tmp_path, TRUTHS["bouc-wen"])
    with pytest.raises(InputError, match="is not there"):
        read_draws(tmp_path / "elsewhere", result.damper)
    (tmp_path / "posterior.npz").write_text("no archive")
    with pytest.raises(InputError, match="expected draws as identify writes them"):
        read_draws(tmp_path, result.damper)


@pytest.mark.nightly
def test_draws_are_the_same_bits_on_two_cores(monkeypatch):
    monkeypatch.setattr(posterior, "_SETTLING", 20)
    monkeypatch.setattr(posterior, "_REFITTED", 20)
    values = {
        "rho": 1800.0,
        "kappa": -0.3,
        "n": 1.4,
        "viscosity": 1000.0,
        "offset": 10.0,
        "yield_force": 600.0,
    }
    truth = Damper(find_law("bouc-wen"), {name: Constant(value) for name, value in values.items()})
    problem = FitProblem(truth, _FREE, measured(truth, noise=0.05, seed=0)[:4])
    result = fit_variable_projection(problem, starts=0, first=truth)
    one, two = (sample_posterior(problem, result, draws=10, pool=Pool(n)).draws.values for n in (1, 2))
    assert np.array_equal(one, two)


def test_the_same_seed_gives_the_same_draws_and_one_draw_is_none():
    problem, result = linear_problem()
    one, again, other = (sample_posterior(problem, result, draws=50, seed=s).draws.values for s in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    with pytest.raises(InputError, match="expected 2 or more"):
        sample_posterior(problem, replace(result), draws=1)


# --------------------------------------------------------------------------------- how much is drawn


def test_the_effective_sample_size_is_that_of_plain_sums_over_lags():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((60, 5, 4))
    chains = np.stack(
        [lfilter([1.0], [1.0, -a], noise[..., k], axis=0) for k, a in enumerate((-0.5, 0.2, 0.6, 0.9))], -1
    )
    expected = []
    for k in range(4):
        x = chains[..., k] - chains[..., k].mean()
        covariance = np.array([np.sum(x[: 60 - lag] * x[lag:]) for lag in range(60)])
        time = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
        window = next((lag for lag in range(60) if lag >= 5.0 * time[lag]), 59)
        expected.append(60 * 5 / max(time[window], 1.0))
    assert effective_sample_sizes(chains) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("moves", "count"), [(2, 2), (7, 5), (40, 3)])
def test_chains_that_stand_still_tell_as_much_as_there_are_chains(moves, count):
    still = np.random.default_rng(0).standard_normal((1, count, 3)).repeat(moves, axis=0)
    assert effective_sample_sizes(still) == pytest.approx(np.full(3, count))


def test_a_posterior_rests_on_as_many_samples_as_leave_the_standard_errors():
    """Of regression: the cost over its curvature, over the square of what is told, in the geometric mean."""
    problem, result = linear_problem()
    found = sample_posterior(problem, result, draws=20)
    softness = np.diag(np.linalg.inv(normal_matrix(problem)))
    told = np.array([e.standard_error for e in result.estimates])
    samples = result.cost_percent**2 * np.exp(np.mean(np.log(softness / told**2)))
    assert found.effective_samples == pytest.approx(samples, rel=1e-6)
    assert found.accepted_share == 1.0, "what is integrated out needs no chain"
    assert found.effective_draws >= 20.0
    assert (len(found.draws), found.cancelled) == (20, False)
    assert 0.0 < found.cpu_s < 60.0
    assert list(found.standard_deviation.values()) == pytest.approx(
        np.std(found.draws.values, axis=0, ddof=1)
    )
    some = tuple(replace(e, standard_error=np.nan if e.name[0] == "v" else 2.0) for e in result.estimates)
    few = sample_posterior(problem, replace(result, estimates=some), draws=20)
    softness = np.diag(np.linalg.inv(normal_matrix(problem)[1:, 1:]))
    assert few.effective_samples == pytest.approx(
        result.cost_percent**2 * np.exp(np.mean(np.log(softness / 4.0))), rel=1e-6
    )
    for nothing in ({"standard_error": np.nan}, {"standard_error": 0.0}, {"at_bound": "lower"}):
        none = tuple(replace(e, **nothing) for e in result.estimates)
        with pytest.raises(InputError, match="no parameter of the fit has a standard error"):
            sample_posterior(problem, replace(result, estimates=none), draws=20)


def test_an_interrupt_keeps_the_draws_so_far_and_one_before_them_is_one(monkeypatch):
    """Of these, or of all there are when it is enough, the draws asked for are spread evenly."""
    problem, result = linear_problem()
    updates: list[ProgressUpdate] = []

    def stopping(update: ProgressUpdate) -> None:
        updates.append(update)
        raise KeyboardInterrupt

    found = sample_posterior(problem, result, draws=10**6, on_progress=stopping)
    assert found.cancelled
    assert len(found.draws) == found.evaluations - 2 * 64 == 20 * 128
    assert found.effective_draws == pytest.approx(20 * 128, rel=0.2)
    assert (updates[0].done, updates[0].total) == (int(found.effective_draws), 10**6)
    assert f"{found.effective_draws:.0f} of 1000000 independent draws" in updates[0].text
    few = sample_posterior(problem, result, draws=5, seed=0, on_progress=updates.append)
    assert updates[1].done == updates[1].total == 5
    assert np.array_equal(few.draws.values, found.draws.values[[0, 640, 1280, 1919, 2559]])
    monkeypatch.setattr(posterior._Chains, "move", lambda _: stopping(updates[0]))
    with pytest.raises(KeyboardInterrupt):
        sample_posterior(problem, result, draws=10)


def test_chains_that_do_not_mix_are_given_up_and_it_is_said(monkeypatch):
    problem, result = linear_problem()
    monkeypatch.setattr(posterior, "_SETTLING", 12)
    monkeypatch.setattr(posterior, "effective_sample_sizes", lambda _: np.array([3.0, 1.5]))
    found = sample_posterior(problem, result, draws=100)
    assert (found.effective_draws, len(found.draws), found.cancelled) == (1.5, 100, False)
    enough = 60 * 100 + 2 * 12 * 128
    assert enough <= found.evaluations < enough + 20 * 128
    monkeypatch.setattr(posterior, "effective_sample_sizes", lambda _: np.array([100.0]))
    assert sample_posterior(problem, result, draws=100).evaluations == 128 + 20 * 128, "just enough"


def test_what_the_runs_do_not_tell_of_is_drawn_from_the_prior():
    """A normal distribution as wide as the bound is large, cut where the law admits no more."""
    problem, result = linear_problem()
    light = [replace(run, weight=1e-20) for run in problem.prepare()]
    density = posterior._Density(problem, Objective(problem, light), result, ONE_CORE)
    found = density.at(np.zeros((4000, 0)), np.random.default_rng(0))
    for k, size in enumerate((1e4, 1e5, 700.0)):
        column = found.linear[:, k] / size
        cut = k < 2  # neither viscosity nor spring is negative
        mean, spread = (np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)) if cut else (0.0, 1.0)
        assert column.mean() == pytest.approx(mean, abs=0.05)
        assert column.std() == pytest.approx(spread, abs=0.04)
    share = np.exp(found.log - found.log.max())  # of 64 tries, of which a quarter is admitted
    assert share.std() / share.mean() == pytest.approx(np.sqrt(0.75 / 0.25 / 64), rel=0.1)


def test_without_linear_parameters_the_density_is_that_of_the_squared_residuals():
    truth = TRUTHS["bouc-wen"]
    problem = FitProblem(truth, (_FREE[0],), measured(truth, noise=0.05, seed=1)[:2], rate_Hz=1e4)
    result = fit_variable_projection(problem, starts=0, first=truth)
    density = posterior._Density(problem, Objective(problem, problem.prepare()), result, ONE_CORE)
    points = np.log([[1000.0], [1800.0], [3000.0]])
    squares = np.zeros(3)
    for k, value in enumerate(np.exp(points[:, 0]).tolist()):
        for run in problem.runs:
            kept = slice(run.scored_from, None)
            residual = (simulate(truth.with_parameters({"rho.value": value}), run.trajectory) - run.force)[
                kept
            ]
            squares[k] += 1e4 * np.mean(residual**2) / np.var(run.force[kept]) / 2
    found = density.at(points, np.random.default_rng(0))
    assert found.log == pytest.approx(-0.5 * squares, rel=1e-6)
    assert found.linear.shape == (3, 0)
    assert density.mode == pytest.approx([np.log(result.damper.parameters["rho.value"])])
