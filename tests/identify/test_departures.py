"""From which size on something is told of a run or of a campaign: both sides of each limit.

The effects are made up, so that a run leaves the others by just so much.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.identify.consistency import runs as among_runs
from mrdamper.identify.consistency.causes import CAUSES, least_told
from mrdamper.identify.consistency.effects import Effect
from mrdamper.identify.consistency.groups import find_together
from mrdamper.identify.consistency.runs import (
    _departures,
    _peers,
    _suspects,
    _usual_levels,
    consistency,
    doubted,
)
from tests.identify.truths import COMMANDS, TRUTHS, measured

TRUTH = TRUTHS["bouc-wen"]
NOTHING = Effect(0.0, 0.0, 0.0, 0.0)
USUAL = 0.02  # residual of every run over its force's spread


def runs_of(count: int, session: str = "rig") -> tuple[Any, ...]:
    """Return as many runs as are asked for, of four commands and three motions, with a period of 0.4 s."""
    return tuple(
        SimpleNamespace(
            name=f"run {k}",
            motion=f"motion {k // 4 % 3}",
            period_s=0.4,
            run=SimpleNamespace(constant_command=COMMANDS[k % 4], command_unit="A", session=session),
            trajectory=SimpleNamespace(velocity=np.array([1.0, -1.0])),
        )
        for k in range(count)
    )


@dataclass
class MadeUp:
    """Effects in place of those of residuals: by cause the size in each run, and what size one explains."""

    runs: Sequence[Any]
    sizes: Mapping[str, FloatArray] = field(default_factory=dict)
    per_size: Mapping[str, float | FloatArray] = field(default_factory=dict)
    errors: FloatArray | None = None
    common: Mapping[str, Effect] = field(default_factory=dict)
    drift: Effect = NOTHING
    together: float = 0.5  # share that a cause of one group explains
    shares: Mapping[str, float] = field(default_factory=dict)
    levels: FloatArray = field(default_factory=lambda: np.full(12, USUAL))

    def of_run(self, number: int, kind: str) -> Effect:
        size = float(self.sizes.get(kind, np.zeros(len(self.runs)))[number]) or 1e-15
        per_size = float(np.broadcast_to(self.per_size.get(kind, 0.1), len(self.runs))[number])
        error = 1e-4 if self.errors is None else float(self.errors[number])
        return Effect(size, error, abs(size) * per_size, self.shares.get(kind, 0.0))

    def of_all(self, kind: str, factors: FloatArray | None = None) -> Effect:
        if factors is None:
            return self.common.get(kind, NOTHING)
        if factors.min() < 0.0:
            assert factors == pytest.approx(np.linspace(-0.5, 0.5, len(self.runs)))
            return self.drift
        sizes = self.sizes[kind]
        return Effect(
            float(sizes[factors == 1.0].mean() - sizes[factors == 0.0].mean()), 0.0, 0.0, self.together
        )


def found_in(**given: Any) -> tuple[Any, ...]:
    """Return what all runs and what several have, of made-up effects."""
    common, groups = find_together(MadeUp(**{"runs": runs_of(12), **given}))  # type: ignore[arg-type]
    return (*common, *groups)


# --------------------------------------------------------------------------------- what all runs have


@pytest.mark.parametrize(
    ("size", "share", "told"),
    [
        (1.25e-3, 0.02, True),
        (1.15e-3, 0.02, False),
        (-1.25e-3, 0.02, True),
        (2e-3, 0.0155, True),
        (2e-3, 0.0145, False),
    ],
)
def test_a_delay_of_all_is_told_from_1_2_ms_and_1_5_percent_of_the_residual_on(size, share, told):
    found = found_in(common={"force_delay": Effect(size, 1e-4, 0.01, share)})
    assert [each.kind for each in found] == ["common_delay"] * told
    if told:
        assert (found[0].size, found[0].unit, found[0].low) == (size, "s", pytest.approx(size - 2e-4))
        assert f"{1e3 * abs(size):.2g} ms {'late' if size > 0.0 else 'early'}" in found[0].found


@pytest.mark.parametrize(
    ("pole", "share", "filtered"), [(0.02, 0.34, True), (0.02, 0.32, False), (-0.02, 0.9, False)]
)
def test_a_filter_is_told_where_it_explains_a_tenth_more_than_a_delay(pole, share, filtered):
    common = {"force_delay": Effect(5e-3, 1e-4, 0.1, 0.3), "force_bandwidth": Effect(pole, 1e-3, 0.1, share)}
    (found,) = found_in(common=common)
    assert found.kind == ("common_bandwidth" if filtered else "common_delay")
    assert found.size == (pole if filtered else 5e-3)
    if filtered:
        assert "filtered at about 8 Hz" in found.found


@pytest.mark.parametrize(("alone", "told"), [(0.89, True), (0.91, False)])
@pytest.mark.parametrize("kind", ["common_delay", "campaign_drift"])
def test_what_one_run_explains_by_itself_is_not_said_of_all(kind, alone, told):
    """As much as all are said to have: twelve runs of which one has it all."""
    effect = Effect(0.1, 1e-4, 0.01, 0.5)
    cause = "force_delay" if kind == "common_delay" else "force_gain"
    sizes = {cause: np.where(np.arange(12) == 4, alone * 0.01 * np.sqrt(12.0) / 0.1, 0.0)}
    given: Any = {"common": {cause: effect}} if kind == "common_delay" else {"drift": effect}
    assert [each.kind for each in found_in(sizes=sizes, **given)] == [kind] * told


# --------------------------------------------------------------------------------- what several runs have


def sessions(*names: str) -> tuple[Any, ...]:
    return tuple(
        SimpleNamespace(**{**vars(run), "run": SimpleNamespace(**{**vars(run.run), "session": name})})
        for run, name in zip(runs_of(len(names)), names, strict=True)
    )


@pytest.mark.parametrize(
    ("gain", "scatter", "told"),
    [
        (0.041, 1e-4, True),
        (0.039, 1e-4, False),
        (-0.041, 1e-4, True),
        (0.2, 0.0740, True),
        (0.2, 0.0750, False),
    ],
)
def test_a_session_is_told_from_four_percent_and_four_standard_errors_on(gain, scatter, told):
    """Of medians of five and of four runs; the scatter is that about both of them."""
    names = ["a"] * 5 + ["b"] * 4 + ["c", "c", "d"]
    way = np.array([-1.0, 1.0, 0.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 40.0, -90.0, 0.0])
    sizes = np.sqrt(9 / 8) * scatter * way + np.where(np.arange(12) < 5, gain, 0.0)
    found = found_in(runs=sessions(*names), sizes={"force_gain": sizes})
    assert [(each.kind, each.run) for each in found] == [("session_gain", "a")] * told
    if told:
        assert found[0].size == pytest.approx(1.0 + gain)
        assert found[0].high == pytest.approx(1.0 + gain + 2.0 * scatter * np.sqrt(1 / 5 + 1 / 4))
        assert ("more" if gain > 0.0 else "less") + " force" in found[0].found
        assert "the 5 runs of this session" in found[0].found
        drifting = found_in(
            runs=sessions(*names), sizes={"force_gain": sizes}, drift=Effect(0.3, 0.01, 1.0, 0.51)
        )
        assert [each.kind for each in drifting] == ["session_gain"], "the simplest that explains them"


def heaps(low: int, high: int, apart: float, inside: float) -> FloatArray:
    """Return sizes in two heaps so far apart, with an rms inside them, in no order."""

    def of(count: int) -> FloatArray:
        way = np.resize([1.0, -1.0], count)
        way = way - way.mean()
        return np.asarray(inside * way / np.sqrt(np.mean(way**2)))

    sizes = np.concatenate([of(low), apart + of(high)])
    return np.asarray(sizes[np.random.default_rng(1).permutation(len(sizes))])


@pytest.mark.parametrize(
    ("low", "high", "apart", "inside", "told"),
    [
        (8, 4, 0.041, 1e-4, True),
        (8, 4, 0.039, 1e-4, False),
        (8, 4, 0.2, 0.0395, True),
        (8, 4, 0.2, 0.0405, False),
        (3, 9, 0.2, 1e-3, True),
        (2, 10, 0.2, 1e-3, False),
        (9, 3, 0.2, 1e-3, True),
        (10, 2, 0.2, 1e-3, False),
        (3, 3, 0.2, 1e-3, True),
        (3, 2, 0.2, 1e-3, False),
    ],
)
def test_two_heaps_of_three_and_more_are_told_five_times_their_scatter_apart(low, high, apart, inside, told):
    sizes = heaps(low, high, apart, inside)
    found = found_in(runs=runs_of(len(sizes)), sizes={"force_gain": sizes})
    assert [each.kind for each in found] == ["two_groups"] * told
    if told:
        few = min(low, high)
        upper = sizes > apart / 2.0
        smaller = np.flatnonzero(upper if high <= low else ~upper)
        way = 1.0 if high <= low else -1.0
        assert found[0].size == pytest.approx(1.0 + way * apart)
        error = inside * np.sqrt(1 / low + 1 / high)
        assert found[0].high == pytest.approx(found[0].size + 2.0 * error, rel=1e-3)
        assert f"the {few} runs (" in found[0].found
        assert f"({', '.join(f'run {k}' for k in smaller[:4])}{' ...' * (few > 4)})" in found[0].found


@pytest.mark.parametrize(("apart", "told"), [(4.1e-3, True), (3.9e-3, False), (-4.1e-3, True)])
def test_a_group_is_late_from_4_ms_on(apart, told):
    sizes = np.where(np.arange(12) % 3 == 0, apart, 0.0)
    found = found_in(sizes={"force_delay": sizes})
    assert [each.kind for each in found] == ["group_delay"] * told
    if told:
        assert (found[0].size, found[0].unit) == (pytest.approx(apart), "s")
        word = "later" if apart > 0.0 else "earlier"
        assert (
            f"the 4 runs (run 0, run 3, run 6, run 9) is 4.1 ms {word} than that of the others"
            in found[0].found
        )


def test_five_late_runs_are_named_by_four_of_them():
    found = found_in(sizes={"force_delay": np.where(np.arange(12) < 5, 0.01, 0.0)})
    assert "the 5 runs (run 0, run 1, run 2, run 3 ...)" in found[0].found


@pytest.mark.parametrize(("ramp", "kind"), [(0.49, "two_groups"), (0.51, "campaign_drift")])
def test_two_heaps_are_a_drift_where_that_explains_more(ramp, kind):
    sizes = {"force_gain": np.where(np.arange(12) < 4, 0.0, 0.2)}
    (found,) = found_in(sizes=sizes, drift=Effect(0.3, 0.01, 1.0, ramp))
    assert found.kind == kind


@pytest.mark.parametrize(
    ("size", "share", "count", "told"),
    [
        (0.041, 0.2, 12, True),
        (0.039, 0.2, 12, False),
        (-0.041, 0.2, 12, True),
        (0.2, 0.11, 12, True),
        (0.2, 0.09, 12, False),
        (0.2, 0.2, 6, True),
        (0.2, 0.2, 5, False),
    ],
)
def test_a_drift_is_told_from_four_percent_and_a_tenth_of_the_residual_on(size, share, count, told):
    found = found_in(runs=runs_of(count), drift=Effect(size, 0.001, 0.01, share))
    assert [each.kind for each in found] == ["campaign_drift"] * told
    if told:
        assert (found[0].size, found[0].low) == (size, pytest.approx(size - 0.002))
        assert f"last of the {count} runs" in found[0].found
        assert ("grows" if size > 0.0 else "falls") in found[0].found


@pytest.mark.parametrize(("error", "told"), [(2.4e-4, True), (2.6e-4, False)])
def test_a_run_that_hardly_tells_of_a_cause_is_in_no_group(error, told):
    """Of three that are apart one has 2.4 or 2.6 times the usual standard error."""
    errors = np.where(np.arange(12) == 2, error, 1e-4)
    sizes = {"force_gain": np.where(np.arange(12) < 3, 0.2, 0.0)}
    assert bool(found_in(sizes=sizes, errors=errors)) == told
    assert found_in(sizes=sizes, errors=np.zeros(12)), "all are known exactly"


@pytest.mark.parametrize(
    ("share", "kinds"),
    [(0.24, ["two_groups"]), (0.26, ["common_delay", "two_groups"]), (0.99, ["common_delay", "two_groups"]),
     (1.01, ["common_delay"])],
)  # fmt: skip
def test_of_two_explanations_one_that_explains_less_than_half_of_the_other_is_its_shadow(share, kinds):
    found = found_in(
        sizes={"force_gain": np.where(np.arange(12) < 4, 0.2, 0.0)},
        common={"force_delay": Effect(5e-3, 1e-4, 0.1, share)},
    )
    assert [each.kind for each in found] == kinds


@pytest.mark.parametrize(("share", "kind"), [(0.49, "group_delay"), (0.51, "common_delay")])
def test_of_a_delay_of_a_group_and_one_of_all_the_one_that_explains_more_is_told(share, kind):
    found = found_in(
        sizes={"force_delay": np.where(np.arange(12) < 4, 0.01, 0.0)},
        common={"force_delay": Effect(5e-3, 1e-4, 0.1, share)},
    )
    assert [each.kind for each in found] == [kind]


# --------------------------------------------------------------------------------- one run


LIMITS = {  # the smallest size, how many times the scatter of the others, what part of the usual residual
    "force_delay": (1e-3, 3.2, 0.15),
    "force_gain": (0.03, 2.5, 0.4),
    "command_label": (0.04, 2.5, 0.4),  # 0.02 of each ampere of the range, which is 2 A
    "force_saturation": (0.06, 4.0, 0.4),
    "force_offset_of_run": (3.0, 6.0, 0.5),
}


def suspects(kind: str, size: float, departure: float, scatter: float = 0.0, **given: Any) -> dict[int, Any]:
    """Return who leaves twelve runs, of which one has a size that is so many usual residuals."""
    sizes = scatter * np.resize([1.0, -1.0, -1.0, 1.0, 1.0], 12) * abs(size / departure)
    sizes[6] = size
    per_size = {kind: USUAL * departure / abs(size)}
    made: Any = MadeUp(runs_of(12), {kind: sizes}, per_size, **given)
    return _suspects(made, [1.0] * 12)


@pytest.mark.parametrize("kind", LIMITS)
def test_a_run_is_told_from_the_smallest_size_and_strength_of_a_cause_on(kind):
    least, _, strength = LIMITS[kind]
    way = -1.0 if kind in ("force_gain", "force_delay") else 1.0
    assert set(suspects(kind, 1.02 * way * least, 10.0)) == {6}
    assert not suspects(kind, 0.98 * way * least, 10.0)
    assert set(suspects(kind, 50.0 * way * least, 1.02 * strength)) == {6}
    assert not suspects(kind, 50.0 * way * least, 0.98 * strength)
    (found,) = suspects(kind, 50.0 * way * least, 3.0 * strength).values()
    assert (found.kind, found.size) == (kind, pytest.approx(50.0 * way * least))
    assert found.times == pytest.approx(3.0)
    assert found.error == pytest.approx(1e-4)
    assert found.strength == pytest.approx(3.0 * strength * (0.7 if kind == "force_saturation" else 1.0))


@pytest.mark.parametrize("kind", LIMITS)
def test_a_run_has_to_leave_the_others_by_some_times_their_scatter(kind):
    least, clear, _ = LIMITS[kind]
    size = 200.0 * least
    sizes = np.random.default_rng(3).standard_normal(12)
    sizes[6] = 1e3
    departures, scatter = _departures(sizes, np.ones(12), _peers(runs_of(12)), np.ones(12, dtype=bool))
    for times in (1.03, 0.97):
        for _ in range(3):  # the departure asked for: what the peers say of it is taken out
            sizes[6] += times * clear * scatter - departures[6]
            departures, scatter = _departures(
                sizes, np.ones(12), _peers(runs_of(12)), np.ones(12, dtype=bool)
            )
        made: Any = MadeUp(runs_of(12), {kind: sizes * size}, {kind: USUAL * 100.0 / size})
        told = _suspects(made, [1.0] * 12)
        assert (6 in told) == (times > 1.0)
        if 6 in told:
            assert told[6].error == pytest.approx(scatter * size)


def test_a_delay_is_told_from_a_five_hundredth_of_the_period_on_and_a_command_by_its_range():
    runs: list[Any]
    for run_period, least in ((None, 1e-3), (0.4, 1e-3), (1.0, 2e-3), (5.0, 0.01)):
        runs = [SimpleNamespace(**{**vars(run), "period_s": run_period}) for run in runs_of(12)]
        assert least_told(CAUSES["force_delay"], runs, 6) == pytest.approx(least)
    for top, least in ((0.5, 0.02), (1.0, 0.02), (3.0, 0.06)):
        runs = [run for run in runs_of(12) if run.run.constant_command < 0.6]
        runs[1].run.constant_command = top
        assert least_told(CAUSES["command_label"], runs, 0) == pytest.approx(least)


@pytest.mark.parametrize(("share", "count"), [(0.52, 2), (0.48, 1)])
def test_runs_of_less_than_half_of_the_worst_departure_are_not_told(share, count):
    sizes = np.zeros(12)
    sizes[6], sizes[1] = 1.0, share
    made: Any = MadeUp(runs_of(12), {"force_gain": sizes}, {"force_gain": USUAL * 10.0})
    assert list(_suspects(made, [1.0] * 12)) == [6, 1][:count]


@pytest.mark.parametrize(("strength", "kind"), [(0.92, "force_delay"), (0.88, "force_gain")])
def test_the_simpler_cause_is_told_as_long_as_it_explains_nine_tenths(strength, kind):
    sizes = {"force_delay": np.zeros(12), "force_gain": np.zeros(12)}
    sizes["force_delay"][6], sizes["force_gain"][6] = 0.01 * strength, 0.5
    per_size = {"force_delay": USUAL * 1000.0, "force_gain": USUAL * 20.0}
    made: Any = MadeUp(runs_of(12), sizes, per_size)
    assert _suspects(made, [1.0] * 12)[6].kind == kind


def test_twelve_runs_of_a_command_have_a_scatter_of_their_own():
    """At one command all are off by more: none of these is told of it, but where they are eleven."""
    for count, told in ((12, False), (11, True)):
        runs = runs_of(40 + count)
        for k, run in enumerate(runs):
            run.run.constant_command = 5.0 if k >= 40 else float(k % 2)
            run.motion = f"motion {k // 2 % 2}"
        rng = np.random.default_rng(0)
        sizes = 0.01 * rng.standard_normal(len(runs))
        sizes[40:] += 0.08 * np.resize([1.0, -1.0], count)
        made: Any = MadeUp(
            runs, {"force_gain": sizes}, {"force_gain": USUAL * 20.0}, levels=np.full(len(runs), USUAL)
        )
        assert bool({k for k in _suspects(made, [1.0] * len(runs)) if k >= 40}) == told


def test_the_usual_residual_is_that_of_the_command_and_at_most_three_times_that_of_all():
    runs, levels = runs_of(12), np.full(12, 0.02)
    levels[[1, 5, 9]] = 0.05, 0.04, 0.045
    made: Any = MadeUp(runs, levels=levels)
    assert _usual_levels(made) == pytest.approx(np.where(np.arange(12) % 4 == 1, 0.045, 0.02))
    levels[[1, 5, 9]] = 0.5
    assert _usual_levels(made) == pytest.approx(np.where(np.arange(12) % 4 == 1, 0.06, 0.02))
    made = MadeUp(runs[:8], levels=levels[:8])  # two of a command: all stand for them
    assert _usual_levels(made) == pytest.approx(np.full(8, np.median(levels[:8])))
    assert _usual_levels(MadeUp(runs, levels=np.zeros(12))) == pytest.approx(np.ones(12))  # type: ignore[arg-type]


# --------------------------------------------------------------------------------- what is said of it


@pytest.fixture(scope="module")
def twelve() -> tuple[Any, ...]:
    return measured(TRUTH, noise=0.0, seed=0, duration=1.0, rate_Hz=200.0)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch, twelve: tuple[Any, ...]) -> MadeUp:
    """Return effects that stand for those of all runs; a gain of run 6 to begin with."""
    found = MadeUp(
        twelve, {"force_gain": np.where(np.arange(12) == 6, 0.2, 0.0)}, {"force_gain": USUAL * 20.0}
    )
    monkeypatch.setattr(among_runs, "residuals_of", lambda *_, **__: found)
    return found


@pytest.mark.parametrize(
    ("times", "sure", "told"), [(1.75, False, False), (1.85, False, True), (1.05, True, True)]
)
def test_a_run_left_out_is_told_again_when_it_leaves_the_others_further_or_was_sure(
    made, twelve, times, sure, told
):
    made.per_size = {"force_gain": USUAL * 0.4 * times / 0.2}
    found = consistency(TRUTH, twelve, without=twelve[6].name, sure=sure)
    assert [each.run for each in found] == [twelve[6].name] * told
    assert consistency(TRUTH, twelve) != ()


@pytest.mark.parametrize(
    ("strength", "worst", "names"), [(0.85, 1.5, [6]), (0.75, 1.5, []), (0.85, 1.7, [6, 3]), (0.75, 1.7, [3])]
)
def test_doubted_are_who_leaves_the_others_nearly_enough_and_who_is_fitted_far_worse(
    made, twelve, strength, worst, names
):
    made.per_size = {"force_gain": USUAL * 0.4 * strength / 0.2}
    made.levels = np.where(np.arange(12) == 3, USUAL * worst, USUAL)
    assert doubted(TRUTH, twelve) == tuple(twelve[k].name for k in names)
    made.levels = np.where(np.arange(12) == 6, USUAL * worst, USUAL)
    assert len(doubted(TRUTH, twelve)) <= 1


@pytest.mark.parametrize(("share", "said"), [(0.46, True), (0.44, False)])
def test_a_gain_and_a_command_are_both_said_where_they_explain_a_run_alike(made, twelve, share, said):
    """Within five percent of the residual's mean square."""
    made.sizes = {**made.sizes, "command_label": np.where(np.arange(12) == 6, 0.01, 0.0)}
    made.shares = {"force_gain": 0.5, "command_label": share}
    (found,) = consistency(TRUTH, twelve)
    assert found.found.startswith("its force is 1.200 times that of the other runs")
    assert (", or its command label is off by -0.010 A (one run cannot tell)" in found.found) == said
    assert found.remedy.endswith("; until then leave the run out")
    made.sizes = {
        "command_label": np.where(np.arange(12) == 6, 0.3, 0.0),
        "force_gain": 0.01 * (np.arange(12) == 6),
    }
    made.per_size = {"command_label": USUAL * 20.0}
    made.shares = {"command_label": 0.5, "force_gain": share}
    (found,) = consistency(TRUTH, twelve)
    assert (found.kind, found.unit, found.channel) == ("command_label", "A", "current")
    assert found.size == pytest.approx(0.3)
    assert (", or its force gain is 1.010 (one run cannot tell)" in found.found) == said


@pytest.mark.parametrize(
    ("one", "other", "told"),
    [
        (1.0, 1.0, True),
        (0.35, 1.0, True),
        (0.25, 1.0, False),
        (1.0, 0.25, False),
        (2.9, 1.0, True),
        (3.1, 1.0, False),
    ],
)
def test_two_labels_are_exchanged_where_each_run_is_off_by_about_the_other_s_command(
    made, twelve, one, other, told
):
    """Runs 6 and 7 are of one motion at 1 and 2 A."""
    sizes = np.zeros(12)
    sizes[6], sizes[7] = one, -other
    per_size = USUAL * 0.8 / np.where(sizes == 0.0, 1.0, np.abs(sizes))
    made.sizes, made.per_size = {"command_label": sizes}, {"command_label": per_size}
    found = {each.run: each for each in consistency(TRUTH, twelve)}
    kinds = {each.kind for each in found.values()}
    assert (kinds == {"labels_exchanged"}) == told
    if told:
        first: Any = found[twelve[6].name]
        assert (first.size, first.high) == (1.0, pytest.approx(1.0 + 2.0 * abs(one - other)))
        assert f"it has the force of {twelve[7].name}'s command" in first.found
    far = [replace(run, motion="another") if k == 7 else run for k, run in enumerate(twelve)]
    made.runs = far
    assert "labels_exchanged" not in {each.kind for each in consistency(TRUTH, far)}
