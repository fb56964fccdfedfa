"""The stand-in for a posterior's density: how well it stands in, and that chains which it leads are right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import BoolArray, FloatArray
from mrdamper.identify.confidence import posterior, surrogate
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
