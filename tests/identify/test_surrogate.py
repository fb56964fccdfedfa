"""The stand-in for a posterior's density: how well it stands in, and that chains which it leads are right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.errors import InputError
from mrdamper.identify.confidence import posterior, surrogate
from mrdamper.identify.confidence.copula import Copula
from mrdamper.identify.confidence.surrogate import Surrogate

LOW, HIGH = np.array([-3.0, -6.0]), np.array([3.0, 6.0])


def two_hills(points: FloatArray) -> FloatArray:
    """Return the log of a density with two hills along x, each bent along y."""
    x, y = points.T
    return np.asarray(-2.0 * (x**2 - 1.0) ** 2 + 0.4 * x - 0.5 * (y - x**2) ** 2)


def anywhere(count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 2))


def test_a_surrogate_follows_a_density_with_two_hills():
    fitted = Surrogate.of(at := anywhere(20_000, 0), two_hills(at), np.random.default_rng(0))
    assert fitted is not None
    new = anywhere(4000, 1)
    high = new[two_hills(new) > -6.0]
    error = fitted.log(high) - two_hills(high)
    assert np.std(error) < 0.1 * np.std(two_hills(high))


def test_a_surrogate_has_no_hill_beyond_what_it_was_fitted_to():
    at = anywhere(20_000, 0)
    fitted = Surrogate.of(at[at[:, 0] < 0.0], two_hills(at[at[:, 0] < 0.0]), np.random.default_rng(0))
    assert fitted is not None
    far = np.stack([np.full(20, 3.0), np.linspace(-6.0, 6.0, 20)], axis=1)
    assert fitted.log(far).max() < fitted.log(at[at[:, 0] < 0.0]).max() - 50.0


@pytest.mark.parametrize("log", [np.zeros(100), np.full(5000, -np.inf)], ids=["few", "without density"])
def test_too_few_places_give_no_surrogate(log):
    assert Surrogate.of(anywhere(len(log), 0), log, np.random.default_rng(0)) is None


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make surrogates of few places and bumps, which take no time."""
    for name, value in {
        "_MOST": 3000,
        "_ENOUGH": 300,
        "_CENTRES": 60,
        "_FEW_CENTRES": 30,
        "_FEW": 1500,
    }.items():
        monkeypatch.setattr(surrogate, name, value)


def fitted_to(points: FloatArray, log: FloatArray) -> Surrogate:
    found = Surrogate.of(points, log, np.random.default_rng(0))
    assert found is not None
    return found


@pytest.mark.usefixtures("small")
def test_a_normal_density_is_met_exactly_and_falls_off_by_the_square_of_the_distance_beyond():
    """Of what is fitted the density is at most 8 and one a parameter below the highest."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-8.0, 12.0, (2500, 1))
    log = 3.0 - 0.5 * ((x[:, 0] - 2.0) / 1.5) ** 2
    found = fitted_to(x, log)
    near = x[log > log.max() - 9.0, 0]
    inside = np.linspace(near.min(), near.max(), 200)
    assert found.log(inside[:, None]) == pytest.approx(3.0 - 0.5 * ((inside - 2.0) / 1.5) ** 2, abs=2e-3)
    spread = np.std(x[log > log.max() - 2.0], ddof=1)
    for end, way in ((near.min(), -1.0), (near.max(), 1.0)):
        beyond = end + way * spread * np.array([0.0, 0.1, 1.0, 3.0])
        fall = found.log(beyond[:, None]) - found.log(np.array([[end]]))
        assert fall == pytest.approx(-50.0 * np.array([0.0, 0.01, 1.0, 9.0]), rel=1e-9)


def terms_of(z: FloatArray, centres: FloatArray, lengths: FloatArray) -> FloatArray:
    x, y = z.T
    bumps = np.exp(-0.5 * np.sum(((z[:, None] - centres) / lengths) ** 2, axis=2))
    return np.column_stack([np.ones(len(z)), x, y, x * x, x * y, y * y, bumps])


def ridge(terms: FloatArray, log: FloatArray, weight: FloatArray) -> FloatArray:
    """Return heights of least weighed squares, bumps at the cost of 0.001 of their squares."""
    count = terms.shape[1] - 6
    penalty = np.diag([0.0] * 6 + [np.sqrt(1e-3)] * count)
    rows = np.vstack([weight[:, None] * terms, penalty])
    return np.asarray(np.linalg.lstsq(rows, np.append(weight * log, np.zeros(6 + count)), rcond=None)[0])


@pytest.mark.usefixtures("small")
def test_a_surrogate_is_the_ridge_regression_of_the_log_density_on_a_quadratic_and_bumps():
    """High places weigh more, by a tenth of their log; each halving of a length meets others better."""
    at = anywhere(2500, 3)
    at = at[two_hills(at) > two_hills(at).max() - 10.0]
    log, new = two_hills(at), drawn(200, 8)
    found = fitted_to(at, log)
    core = at[log > log.max() - 3.0]
    white = np.linalg.inv(np.linalg.cholesky(np.cov(core.T))).T
    z, centres, lengths = (at - core.mean(axis=0)) @ white, found._centres, found._lengths
    assert len(centres) == 60
    assert np.min(np.abs(z[:, None] - centres).max(axis=2), axis=0) == pytest.approx(np.zeros(60), abs=1e-12)
    weight = np.exp(0.1 * (log - log.max()))
    heights = ridge(terms_of(z, centres, lengths), log, weight)
    expected = terms_of((new - core.mean(axis=0)) @ white, centres, lengths) @ heights
    assert found.log(new) == pytest.approx(np.minimum(expected, log.max() + 1.0), abs=0.01)
    assert np.std(found.log(new) - two_hills(new)) < 0.2

    order = np.random.default_rng(0).permutation(len(at))[:1500]
    held = np.arange(len(order)) % 4 == 0

    def missed(lengths: FloatArray) -> float:
        terms = terms_of(z[order], centres[:30], lengths)
        heights = ridge(terms[~held], log[order][~held], weight[order][~held])
        return float(np.mean((weight[order] * (terms @ heights - log[order]))[held] ** 2))

    halvings = np.log2(4.0 / lengths).sum()
    assert halvings > 0
    assert missed(lengths) < 0.98**halvings * missed(np.full(2, 4.0))


@pytest.mark.usefixtures("small")
def test_bumps_are_short_along_what_a_quadratic_does_not_follow_and_long_along_the_rest():
    at = np.random.default_rng(0).uniform(-2.0, 2.0, (1500, 2))
    smooth = -0.1 * (at**2).sum(axis=1)
    lengths = fitted_to(at, smooth + 0.5 * np.sin(1.5 * at[:, 1]))._lengths
    assert 0.25 <= lengths[1] < lengths[0] <= 4.0
    rough = fitted_to(at, smooth + np.abs(at[:, 0]) * np.sign(at[:, 1]))._lengths
    assert rough.min() >= 0.25
    assert set(np.log2(rough)) <= {-2.0, -1.0, 0.0, 1.0, 2.0}


@pytest.mark.usefixtures("small")
def test_a_surrogate_takes_just_enough_places_that_are_high_enough_and_differ():
    rng = np.random.default_rng(0)
    at, log = rng.standard_normal((400, 2)), np.full(400, -10.0)
    log[:300] = rng.uniform(-9.0, 0.0, 300)
    log[0] = 0.0
    assert Surrogate.of(at, log, rng) is not None
    log[1] = -10.0
    assert Surrogate.of(at, log, rng) is None
    flat = np.column_stack([at[:, 0], np.ones(400)])
    assert Surrogate.of(flat, np.zeros(400), rng) is None
    assert Surrogate.of(np.zeros((400, 0)), np.zeros(400), rng) is None


class Hills:
    """The posterior's density, of which no parameter is linear."""

    box: Any = SimpleNamespace(low=LOW, high=HIGH, log=np.array([False, False]), to_physical=lambda x: x)
    mode = np.array([1.0, 1.0])
    guess = np.empty(0)
    objective: Any = SimpleNamespace(
        nonlinear=("x", "y"),
        linear=(),
        sums=lambda *_: None,
        projected=lambda *_: (np.eye(2)[None], None, None),
    )

    def inside(self, points: FloatArray) -> BoolArray:
        return np.asarray(((points > LOW) & (points < HIGH)).all(axis=1))

    def at(self, points: FloatArray, _: np.random.Generator) -> Any:
        log = np.where(self.inside(points), two_hills(points), -np.inf)
        return posterior._Places(points, np.empty((len(points), 0)), log)


@pytest.mark.nightly
def test_chains_that_a_wrong_surrogate_leads_have_the_density_of_the_posterior(monkeypatch):
    """The share below a limit is that of the density, summed over a fine grid."""
    monkeypatch.setattr(surrogate, "_CENTRES", 128)
    fitted = Surrogate.log
    monkeypatch.setattr(
        Surrogate, "log", lambda self, at: fitted(self, at) + np.sin(3.0 * at[:, 0] + at[:, 1])
    )
    chains: Any = posterior._Chains(Hills(), np.random.default_rng(1))  # type: ignore[arg-type]
    chains.settle()
    assert chains._surrogate is not None
    found = np.array([chains.move() for _ in range(150)])
    effective = float(posterior.effective_sample_sizes(found).min())
    assert effective > 0.1 * found[..., 0].size
    fine = np.stack(np.meshgrid(np.linspace(-3, 3, 601), np.linspace(-6, 6, 601)), axis=-1).reshape(-1, 2)
    weight = np.exp(two_hills(fine))
    limits: tuple[tuple[int, float], ...] = ((0, 0.0), (0, 1.2), (1, 0.0), (1, 1.0), (1, 2.0))
    for axis, limit in limits:
        expected = weight[fine[:, axis] < limit].sum() / weight.sum()
        share = np.mean(found[..., axis] < limit)
        assert share == pytest.approx(expected, abs=4.0 * np.sqrt(expected * (1 - expected) / effective))


# --------------------------------------------------------------------------------- what chains are made of


class Exact:
    """In place of a surrogate: the density itself, beside something that is wrong by ``off``."""

    def __init__(self, off: float = 0.0) -> None:
        self._off = off

    def log(self, points: FloatArray) -> FloatArray:
        return two_hills(points) + self._off * np.sin(2.0 * points[:, 0] - points[:, 1])


def drawn(count: int, seed: int) -> FloatArray:
    """Return independent points of the two hills, by rejection."""
    at, rng = anywhere(40 * count, seed), np.random.default_rng(seed + 1)
    taken = at[np.log(rng.random(len(at))) < two_hills(at) - 0.5]
    assert len(taken) >= count
    return taken[:count]


def chains_at(points: FloatArray, independent: float, by: Any, seed: int = 3) -> Any:
    """Return chains of which each half stands at points; ``by`` leads them, or nothing does."""
    chains: Any = posterior._Chains(Hills(), np.random.default_rng(seed))  # type: ignore[arg-type]
    chains._settling, chains._independent, chains._surrogate = False, independent, by
    chains._proposal = Copula(drawn(1500, 77) * 1.2, LOW, HIGH)
    chains._halves = [Hills().at(points, chains._rng)] * 2
    return chains


def check_hills(found: FloatArray) -> None:
    """Check that points are of the two hills: shares below limits are sums over a grid."""
    fine = np.stack(np.meshgrid(np.linspace(-3, 3, 301), np.linspace(-6, 6, 301)), axis=-1).reshape(-1, 2)
    weight = np.exp(two_hills(fine))
    for axis, limit in ((0, -1.0), (0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0), (1, 2.0)):
        expected = weight[fine[:, axis] < limit].sum() / weight.sum()
        error = np.sqrt(expected * (1.0 - expected) / len(found))
        assert np.mean(found[:, axis] < limit) == pytest.approx(expected, abs=4.0 * error + 0.01)


@pytest.mark.parametrize(
    ("independent", "by"), [(0.0, None), (1.0, None), (1.0, Exact(1.0))], ids=["along", "fitted", "led"]
)
def test_moves_of_each_kind_leave_the_density_as_it_is(independent, by):
    points = drawn(2000, 5)
    chains = chains_at(points, independent, by)
    for _ in range(4):
        found = chains.move()
    assert found.shape == (4000, 2)
    check_hills(found)
    assert 0.1 < chains.accepted_share < 1.0


def test_moves_that_cross_the_box_forget_where_they_began():
    """All walkers begin at one place, and a few moves later are anywhere in both hills."""
    start = np.tile([[1.0, 1.0]], (2000, 1))
    for by, moves in ((Exact(0.5), 2), (None, 25)):
        chains = chains_at(start, 1.0, by)
        for _ in range(moves):
            found = chains.move()
        check_hills(found)


def test_where_the_density_itself_leads_its_lead_is_always_taken():
    """What the chains on the surrogate have gained is what the density has gained."""
    points, others = drawn(500, 1), drawn(500, 2)
    chains = chains_at(points, 1.0, Exact())
    led, against = chains._following(Exact(), points, others)
    assert two_hills(led) - two_hills(points) + against == pytest.approx(np.zeros(500), abs=1e-9)
    assert np.mean(np.any(led != points, axis=1)) > 0.9
    check_hills(np.concatenate([chains._following(Exact(), points, others)[0] for _ in range(6)]))
    chains.move()
    assert chains.accepted_share == 1.0


def test_steps_along_are_differences_of_two_others_as_long_as_is_best_and_now_and_then_whole():
    """Of n parameters 2.38 / sqrt(2 n) of a difference (ter Braak, Stat. Comput. 16 (2006) 239)."""
    others = np.random.default_rng(0).multivariate_normal([5.0, -5.0], [[4.0, 1.0], [1.0, 9.0]], 10_000)
    chains = chains_at(np.zeros((10_000, 2)), 0.0, None)
    steps = chains._along(np.zeros((10_000, 2)), others)
    square = 0.1 + 0.9 * 2.38**2 / 4.0
    assert np.cov(steps.T) == pytest.approx(2.0 * square * np.cov(others.T), rel=0.07, abs=0.3)
    assert steps.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.2)
    assert np.abs(steps).max(axis=1).min() > 1e-7, "never of one with itself"
    two = np.array([[0.0, 0.0], [1.0, 2.0]])  # one difference, and its opposite
    sizes = np.abs(np.concatenate([chains._along(np.zeros((2, 2)), two) for _ in range(200)])[:, 0])
    whole = np.isclose(sizes, 1.0, atol=1e-3)
    assert np.mean(whole) == pytest.approx(0.1, abs=0.06)
    assert sizes[~whole] == pytest.approx(np.full((~whole).sum(), 1.19), abs=1e-3)


class Ellipse(Hills):
    """A density about which only its curvature is known; it vanishes beyond a distance from the mode."""

    curvature = np.array([[30.0, -6.0], [-6.0, 5.0]])
    mode = np.array([0.5, -1.0])
    objective: Any = SimpleNamespace(
        nonlinear=("x", "y"),
        linear=(),
        sums=lambda *_: None,
        projected=lambda *_: (Ellipse.curvature[None], None, None),
    )
    reach = np.inf

    def at(self, points: FloatArray, _: np.random.Generator) -> Any:
        away = np.abs(points - self.mode).max(axis=1)
        return posterior._Places(
            points, np.empty((len(points), 0)), np.where(away <= self.reach, 0.0, -np.inf)
        )


def test_walkers_begin_about_the_mode_as_wide_as_the_curvature_and_the_box_say(monkeypatch):
    chains: Any = posterior._Chains(Ellipse(), np.random.default_rng(0))  # type: ignore[arg-type]
    points = chains._first_points(20_000)
    expected = np.linalg.inv(Ellipse.curvature + np.diag([1.0, 0.25]))  # a sixth of the box, at the most
    assert points.mean(axis=0) == pytest.approx(Ellipse.mode, abs=0.02)
    assert np.cov(points.T) == pytest.approx(expected, rel=0.05)
    monkeypatch.setattr(Ellipse, "curvature", np.diag([3.0, 0.3]))
    assert np.var(chains._first_points(20_000), axis=0) == pytest.approx([1.0 / 4.0, 1.0 / 0.55], rel=0.05)
    monkeypatch.setattr(Ellipse, "curvature", np.diag([0.0, 1e-9]))
    points = chains._first_points(20_000)
    assert points.min(axis=0) == pytest.approx([-3.0 + 0.006, -6.0 + 0.012])
    assert points.max(axis=0) == pytest.approx([3.0 - 0.006, 6.0 - 0.012])
    logarithmic = SimpleNamespace(low=LOW, high=HIGH, log=np.array([True, False]), to_physical=np.exp)
    monkeypatch.setattr(Ellipse, "box", logarithmic)
    monkeypatch.setattr(Ellipse, "curvature", np.diag([100.0, 100.0]))
    spread = np.std(chains._first_points(20_000), axis=0)
    curvature = np.array([100.0 * np.exp(2 * 0.5), 100.0]) + np.array([1.0, 0.25])
    assert spread == pytest.approx(1.0 / np.sqrt(curvature), rel=0.03)


@pytest.mark.parametrize("reach", [1e-3, 0.05, 0.3])
def test_walkers_begin_where_there_is_density_or_it_is_said_that_there_is_none(monkeypatch, reach):
    monkeypatch.setattr(Ellipse, "reach", reach)
    chains: Any = posterior._Chains(Ellipse(), np.random.default_rng(0))  # type: ignore[arg-type]
    for half in chains._halves:
        assert np.isfinite(half.log).all()
        assert np.abs(half.points - Ellipse.mode).max() <= reach
        assert len(np.unique(half.points, axis=0)) > 3
    monkeypatch.setattr(Ellipse, "reach", -1.0)
    with pytest.raises(InputError, match="no admissible parameters about the fit"):
        posterior._Chains(Ellipse(), np.random.default_rng(0))  # type: ignore[arg-type]


@pytest.mark.parametrize("sign", [1.0, -3.0], ids=["right", "upside down"])
def test_a_surrogate_leads_where_its_lead_is_taken_and_is_given_up_elsewhere(monkeypatch, sign):
    monkeypatch.setattr(posterior, "_SETTLING", 24)
    monkeypatch.setattr(posterior, "_REFITTED", 6)
    fitted = SimpleNamespace(log=lambda points: sign * two_hills(points))
    seen: list[tuple[FloatArray, FloatArray]] = []

    def of(points: FloatArray, log: FloatArray, _: np.random.Generator) -> Any:
        seen.append((points, log))
        return fitted

    monkeypatch.setattr(Surrogate, "of", of)
    chains: Any = posterior._Chains(Hills(), np.random.default_rng(0))  # type: ignore[arg-type]
    begun = chains.evaluations
    chains.settle()
    assert chains._surrogate is (fitted if sign > 0.0 else None)
    assert [len(points) for points, _ in seen] == [begun + 128 * 18, begun + 128 * 24]
    inside = np.isfinite(seen[1][1])
    assert seen[1][1][inside] == pytest.approx(two_hills(seen[1][0][inside]))
    assert chains._independent == posterior._RULE
    assert chains.accepted_share == 0.0, "counted from here on"
    assert not chains._seen
    chains.move()
    assert chains.evaluations == begun + 128 * (24 + 10 + 1)
