"""Decisions of the consistency test on synthetic effects, on both sides of each threshold of the settings."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.identify.consistency.causes import min_size
from mrdamper.identify.consistency.effects import NO_EFFECT, Effect
from mrdamper.identify.consistency.groups import find_group_deviations
from mrdamper.identify.consistency.runs import _amounts, _command_levels, _deviating_runs, _peer_columns
from mrdamper.identify.consistency.settings import DEFAULTS

LEVEL = 0.02  # residual of each run divided by the spread of the force
ALL = np.ones(12, dtype=bool)
FOUR = np.where(np.arange(12) < 4, 1.0, 0.0)
ONE = np.eye(12)[6]


def runs_of(count: int = 12) -> list[Any]:
    """Return runs at four commands with three motions."""
    return [
        SimpleNamespace(
            name=f"run {k}",
            motion=f"motion {k // 4 % 3}",
            period_s=0.4,
            run=SimpleNamespace(constant_command=(0.0, 0.5, 1.0, 2.0)[k % 4], command_unit="A", session=""),
            trajectory=SimpleNamespace(velocity=(1.0 + k) * np.array([1.0, -1.0])),
        )
        for k in range(count)
    ]


@dataclass
class SyntheticEffects:
    """Effects with a given size in each run, for each cause, and a residual level per size."""

    sizes: dict[str, Any]
    level_per_size: float = 0.1
    runs: list[Any] = field(default_factory=runs_of)
    common: dict[str, Effect] = field(default_factory=dict)
    drift: Effect = NO_EFFECT
    standard_errors: Any = field(default_factory=lambda: np.full(12, 1e-4))
    levels: Any = field(default_factory=lambda: np.full(12, LEVEL))

    def run_effect(self, number: int, kind: str) -> Effect:
        size = float(self.sizes.get(kind, np.zeros(12))[number]) or 1e-15
        return Effect(size, self.standard_errors[number], abs(size) * self.level_per_size, 0.0)

    def common_effect(self, kind: str, factors: Any = None) -> Effect:
        if factors is None:
            return self.common.get(kind, NO_EFFECT)
        if factors.min() < 0.0:
            return self.drift
        sizes = self.sizes[kind]
        return Effect(float(sizes[factors == 1.0].mean() - sizes[factors == 0.0].mean()), 0.0, 0.0, 0.5)


def group_kinds(sizes: Any, **given: Any) -> list[str]:
    common, groups = find_group_deviations(SyntheticEffects(sizes, **given))  # type: ignore[arg-type]
    return [finding.kind for finding in (*common, *groups)]


def deviating(effects: SyntheticEffects) -> dict[int, Any]:
    return _deviating_runs(effects, np.ones(12), (), "", DEFAULTS)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", DEFAULTS.limits)
def test_run_is_reported_above_its_limits(kind):
    """Both the size and the deviation in typical residuals must exceed their limits."""
    limits, smallest = DEFAULTS.limits[kind], min_size(kind, runs_of()[6], 2.0)
    for size, deviation, count in (
        (1.02 * smallest, 10.0, 1),
        (0.98 * smallest, 10.0, 0),
        (50.0 * smallest, 1.02 * limits.deviation_min, 1),
        (50.0 * smallest, 0.98 * limits.deviation_min, 0),
    ):
        found = deviating(SyntheticEffects({kind: size * ONE}, LEVEL * deviation / size))
        assert list(found) == [6][:count]


def test_small_deviations_next_to_worst_are_ignored():
    for ratio, numbers in ((1.05, [6, 1]), (0.95, [6])):
        sizes = ONE + ratio * DEFAULTS.worst_ratio_min * np.roll(ONE, -5)
        assert list(deviating(SyntheticEffects({"force_gain": sizes}, LEVEL * 10.0))) == numbers


def test_simpler_cause_is_preferred():
    for ratio, kind in ((1.02, "force_delay"), (0.98, "force_gain")):
        sizes = {"force_delay": ratio * DEFAULTS.simple_cause_ratio_min * ONE, "force_gain": ONE}
        assert deviating(SyntheticEffects(sizes, LEVEL * 20.0))[6].kind == kind


@pytest.mark.parametrize(
    ("kind", "cause", "limit"),
    [
        ("two_groups", "force_gain", DEFAULTS.gain_difference_min),
        ("group_delay", "force_delay", DEFAULTS.group_delay_min_s),
    ],
)
def test_group_has_min_difference_and_count(kind, cause, limit):
    assert group_kinds({cause: 1.02 * limit * FOUR}) == [kind]
    assert group_kinds({cause: 0.98 * limit * FOUR}) == []
    assert group_kinds({cause: 5.0 * limit * np.where(np.arange(12) < 2, 1.0, 0.0)}) == []
    scatter = 5.0 * limit / DEFAULTS.group_scatter_ratio_min * np.resize([1.0, -1.0], 12)
    assert group_kinds({cause: 5.0 * limit * FOUR + 0.95 * scatter}) == [kind]
    assert group_kinds({cause: 5.0 * limit * FOUR + 1.05 * scatter}) == []
    inexact = np.where(np.arange(12) < 2, 1.0, 1e-4)  # Two of the four runs are not well determined.
    assert group_kinds({cause: 5.0 * limit * FOUR}, standard_errors=inexact) == []


@pytest.mark.parametrize(
    ("fraction", "kinds"),
    [(0.24, ["two_groups"]), (0.26, ["common_delay", "two_groups"]), (1.01, ["common_delay"])],
)
def test_much_weaker_second_cause_is_ignored(fraction, kinds):
    common = {"force_delay": Effect(5e-3, 1e-4, 0.1, fraction)}
    assert group_kinds({"force_gain": 0.2 * FOUR}, common=common) == kinds


def test_drift_replaces_groups_if_it_explains_more():
    for fraction, kind in ((0.49, "two_groups"), (0.51, "campaign_drift")):
        drift = Effect(0.3, 0.01, 1.0, fraction)
        assert group_kinds({"force_gain": 0.2 * FOUR}, drift=drift) == [kind]


def test_common_effect_of_single_run_is_ignored():
    """One run of twelve that explains the whole effect is not a drift or a delay of all runs."""
    for ratio, count in ((0.98, 1), (1.02, 0)):
        size = ratio * DEFAULTS.single_run_ratio_min * 0.01 * np.sqrt(12.0) / 0.1 * ONE
        effect = Effect(0.1, 1e-4, 0.01, 0.5)
        assert group_kinds({"force_gain": size}, drift=effect) == ["campaign_drift"] * count
        assert group_kinds({"force_delay": size}, common={"force_delay": effect}) == ["common_delay"] * count


def test_peer_sizes_are_robust_to_one_run():
    """The effect of command and motion is removed, and one wrong run does not change it."""
    rng, k = np.random.default_rng(0), np.arange(12)
    sizes = np.array([0.1, 0.5, -0.2, 0.3])[k % 4] + np.array([0.0, 0.4, -0.3])[k // 4]
    sizes += 0.01 * rng.standard_normal(12) + 3.0 * ONE
    amounts, scatter = _amounts(sizes, np.full(12, 2.0), _peer_columns(runs_of(), ALL), ALL, ALL)
    assert amounts[6] == pytest.approx(6.0, rel=0.03)
    assert np.abs(np.delete(amounts, 6)).max() < 0.1
    assert 0.002 < scatter < 0.05


def test_peer_columns_depend_on_repeated_motions():
    assert np.linalg.matrix_rank(_peer_columns(runs_of(), ALL)) == 3 + 4 - 1
    many, fitted = runs_of(36), np.ones(36, dtype=bool)
    cells = _peer_columns(many, fitted)  # Three runs of each command and motion.
    assert cells.sum(axis=0).tolist() == [3.0] * 12
    unique: list[Any] = [SimpleNamespace(**{**vars(run), "motion": run.name}) for run in many]
    slopes = _peer_columns(unique, fitted)[:, 4:]
    assert np.linalg.matrix_rank(slopes) == 4
    assert np.abs(slopes.sum(axis=0)).max() < 1e-9
    assert _peer_columns(runs_of(4), ALL[:4]).tolist() == [[1.0]] * 4


def test_command_levels_ignore_noise_of_commands():
    runs = runs_of(8)
    for run, command in zip(runs, (0.0, 0.02, 1.0, 1.03, 2.0, 0.05, 1.98, 1.5), strict=True):
        run.run.constant_command = command
    is_own = np.arange(8) < 7  # The last run is held out, and its command is not in the fit.
    assert _command_levels(runs, is_own).tolist() == [0, 0, 1, 1, 2, 0, 2, -1]
