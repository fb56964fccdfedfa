"""The rules of a choice between laws and groups, on candidates whose errors are known: no run is fitted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mrdamper.errors import ConvergenceError
from mrdamper.identify.groups import Archetype
from mrdamper.identify.motions import Fold
from mrdamper.identify.selection.candidates import Candidate, Fitted, Judged
from mrdamper.identify.selection.select import _better, select
from mrdamper.models.damper import Damper
from mrdamper.runtime.signals import Interrupted
from tests.identify.truths import TRUTHS, measured

FOLDS = 6


class KnownErrors:
    """Stands for a judge: the error of a candidate is its law's, less what each of its groups takes off.

    ``law`` maps a law's name to its error [%], ``group`` a group's name to the share of it that it takes off
    on the runs themselves and on those left out; ``apart`` is how much folds differ in that.
    """

    def __init__(
        self,
        law: Mapping[str, float],
        group: Mapping[str, tuple[float, float]],
        *,
        apart: float = 0.0,
        untold: tuple[str, ...] = (),
        archetypes: Mapping[str, tuple[str, ...]] | None = None,
        dampers: Mapping[str, Damper] | None = None,
    ) -> None:
        self.law, self.group, self.apart, self.untold = law, group, apart, untold
        self.dampers = dampers or {}
        self.training: Mapping[str, float] = {}
        self.archetypes = archetypes or {}
        self.folds = tuple(Fold(f"motion {k}", (k,)) for k in range(FOLDS))
        self.runs = measured(TRUTHS["dahl"], noise=0.01, seed=0, duration=2.0)[::4]
        self.changing: tuple[Any, ...] = ()
        self.judged: list[Candidate] = []
        self.failing: dict[Candidate, Exception] = {}

    def error(self, candidate: Candidate, part: int) -> float:
        shares = [1.0 - self.group[name][part] for name in candidate.groups if name in self.group]
        return self.law[candidate.law] * math.prod(shares)

    def side_by_side(self, work: Any, items: Any) -> Any:
        return map(work, items)

    def kinds(self, law: str) -> tuple[Archetype | None, ...]:
        return tuple(Archetype((name,), {}) for name in self.archetypes.get(law, ())) or (None,)

    def beginning(self, law: str, kind: Archetype | None) -> tuple[Candidate, Damper | None]:
        return Candidate(law, () if kind is None else kind.groups), None

    def fit_anew(self, candidate: Candidate, hopeless_percent: float = math.inf) -> Fitted:
        if candidate in self.failing:
            raise self.failing[candidate]
        error = self.training.get(candidate.law, self.error(candidate, 0))
        damper = self.dampers.get(candidate.law, TRUTHS["dahl"])
        return Fitted(candidate, damper, 5 + len(candidate.groups), error, error, 1.0)

    def fit_from(self, candidate: Candidate, formers: Sequence[Damper], near: Damper | None = None) -> Fitted:
        return self.fit_anew(candidate)

    def on_segments(self, fitted: Fitted) -> float:
        return fitted.training_percent

    def glance(self, candidate: Candidate, former: Damper) -> tuple[Damper, float]:
        return former, self.error(candidate, 0)

    def open_groups(self, candidate: Candidate) -> list[str]:
        return [name for name in self.group if name not in candidate.groups]

    def closable_groups(self, candidate: Candidate) -> list[str]:
        return list(candidate.groups)

    def identifiable(self, fitted: Fitted, name: str) -> bool:
        return name not in self.untold

    def cross_validate(self, fitted: Fitted, former: Judged | None = None) -> Judged:
        self.judged.append(fitted.candidate)
        error = self.error(fitted.candidate, 1)
        by_fold = error * (1.0 + self.apart * len(fitted.candidate.groups) * np.cos(np.arange(FOLDS)))
        squares = np.where(np.eye(FOLDS, dtype=bool), by_fold**2, np.nan)
        return Judged(fitted, squares, (), 1.0)


def chosen(judge: KnownErrors, laws: tuple[str, ...], **how: Any) -> Any:
    return select(judge, laws, **how)  # type: ignore[arg-type]


def reasons(found: Any) -> dict[str, str]:
    return {" + ".join((row.law, *row.groups)): row.reason for row in found.table}


def test_the_law_of_the_least_error_is_taken_and_far_ones_are_not_left_out_at_all():
    judge = KnownErrors({"dahl": 4.0, "bouc-wen": 3.0, "tanh": 4.6, "lugre": 5.0}, {})
    found = chosen(judge, ("dahl", "bouc-wen", "tanh", "lugre"))
    assert found.chosen.candidate == Candidate("bouc-wen", ())
    told = reasons(found)
    assert told["bouc-wen"] == "chosen"
    assert told["tanh"] == "training error +53 %"
    assert told["lugre"] == "training error +67 %"
    assert {each.law for each in judge.judged} <= {"dahl", "bouc-wen"}
    assert [row.law for row in found.table] == ["bouc-wen", "dahl", "tanh", "lugre"]
    assert told["dahl"] == "training error above the best left out"
    assert found.left_out == f"{FOLDS} folds of whole motions"


def test_no_more_than_three_laws_are_left_out_of():
    errors = {"dahl": 3.0, "bouc-wen": 3.1, "tanh": 3.2, "lugre": 3.3, "bingham": 3.4}
    judge = KnownErrors(errors, {})
    chosen(judge, tuple(errors))
    assert {each.law for each in judge.judged} <= {"dahl", "bouc-wen", "tanh"}


def test_groups_that_pay_are_switched_on_and_others_are_rows_with_a_reason():
    group = {
        "friction": (0.2, 0.15),
        "thinning": (0.1, 0.05),
        "gas": (0.001, 0.5),  # no gain on the runs themselves
        "viscosity": (0.05, -0.1),  # worse on what was left out
    }
    found = chosen(KnownErrors({"dahl": 4.0}, group), ("dahl",))
    assert set(found.chosen.candidate.groups) == {"friction", "thinning"}
    told = reasons(found)
    assert told["dahl + gas"] == "no gain on short segments"
    assert told["dahl"] == f"left out {100.0 * (1.0 / (0.85 * 0.95) - 1.0):+.1f} %"
    row = found.table[0]
    assert row.left_out_percent == pytest.approx(4.0 * 0.85 * 0.95)
    assert row.training_percent == pytest.approx(4.0 * 0.8 * 0.9)
    assert row.held_out_median == row.held_out_worst == pytest.approx(row.left_out_percent)
    assert row.cpu_s == 2.0
    assert row.free_parameters == 7


def test_a_group_that_the_runs_do_not_tell_is_not_taken():
    judge = KnownErrors({"dahl": 4.0}, {"friction": (0.3, 0.3)}, untold=("friction",))
    found = chosen(judge, ("dahl",))
    assert found.chosen.candidate.groups == ()
    assert reasons(found)["dahl + friction"] == "the runs do not tell the numbers of friction"


def test_of_many_groups_the_two_that_gain_most_are_tried_in_a_round_and_the_others_again_in_the_next():
    group = {name: (0.05 * k, 0.05 * k) for k, name in enumerate(("a", "b", "c", "d"), 1)}
    found = chosen(KnownErrors({"dahl": 4.0}, group), ("dahl",))
    assert set(found.chosen.candidate.groups) == {"a", "b", "c", "d"}, "two rounds of two"
    five = {**group, "e": (0.3, 0.3)}
    assert set(chosen(KnownErrors({"dahl": 4.0}, five), ("dahl",)).chosen.candidate.groups) == {
        *("b", "c", "d", "e")
    }
    told = reasons(chosen(KnownErrors({"dahl": 4.0}, five), ("dahl",)))
    assert "less gain on short segments than others" in told.values()


def test_a_law_that_is_made_of_groups_grows_until_nothing_pays():
    names = ("spread", "friction", "thinning", "mass", "creep", "bypass", "knee")
    group = dict.fromkeys(names, (0.1, 0.1))
    judge = KnownErrors({"chain": 9.0, "dahl": 4.6}, group, archetypes={"chain": ("position", "bristles")})
    opened = judge.open_groups
    judge.open_groups = lambda candidate: [] if candidate.law == "dahl" else opened(candidate)  # type: ignore[method-assign]
    found = chosen(judge, ("dahl", "chain"))
    assert found.chosen.candidate.law == "chain", "though it begins far behind"
    assert set(group) <= set(found.chosen.candidate.groups)


def test_a_group_whose_loss_costs_next_to_nothing_is_switched_off_again():
    judge = KnownErrors(
        {"chain": 4.0}, {"friction": (0.2, 0.2), "position": (0.0, 0.0)}, archetypes={"chain": ("position",)}
    )
    found = chosen(judge, ("chain",))
    assert found.chosen.candidate == Candidate("chain", ("friction",))


def pair(gain: float, spread: float, *groups: str) -> tuple[Judged, Judged]:
    """Return a candidate with groups and one without that is worse by a gain, folds differing by a spread."""
    judge = KnownErrors({"dahl": 2.0}, {})
    base = judge.cross_validate(judge.fit_anew(Candidate("dahl", ())))
    judged = []
    for candidate, share in ((Candidate("dahl", groups), 1.0 - gain), (Candidate("dahl", ()), 1.0)):
        falls = 1.0 + spread * np.cos(np.pi * np.arange(FOLDS)) * (share < 1.0)
        squares = base.squares * share**2 * falls
        judged.append(Judged(judge.fit_anew(candidate), squares, (), 0.0))
    return judged[0], judged[1]


@pytest.mark.parametrize(
    ("gain", "spread", "better"),
    [
        (0.05, 0.0, True),
        (0.05, 0.5, False),  # chance: some folds gain, others lose
        (0.005, 0.001, True),  # small and sure
        (0.005, 0.015, False),  # small and not so sure
        (0.002, 0.0, False),  # next to nothing
        (-0.05, 0.0, False),
    ],
)
def test_a_gain_has_to_be_clear_or_sure(gain, spread, better):
    one, other = pair(gain, spread, "friction")
    assert _better(one, other) is better
    assert not _better(other, one) or gain < 0.0


def test_a_small_gain_buys_no_mass():
    assert _better(*pair(0.005, 0.0, "friction"))
    assert not _better(*pair(0.005, 0.0, "mass"))
    assert _better(*pair(0.05, 0.0, "mass"))


@pytest.mark.parametrize(("other", "taken"), [(3.005, "bouc-wen"), (3.2, "dahl")])
def test_of_errors_alike_a_law_that_a_controller_takes_is_taken(other, taken):
    dampers = {"dahl": TRUTHS["dahl"], "bouc-wen": TRUTHS["bouc-wen"]}
    judge = KnownErrors({"dahl": 3.0, "bouc-wen": other}, {}, dampers=dampers)
    judge.training = {"bouc-wen": 2.9, "dahl": 3.0}
    found = chosen(judge, tuple(dampers), supports=lambda damper: damper.law.name == "bouc-wen")
    assert found.chosen.candidate.law == taken
    found = chosen(judge, tuple(dampers), supports=lambda damper: damper.law.name == "dahl")
    assert found.chosen.candidate.law == "dahl"


def test_a_candidate_that_fails_is_a_row_and_all_that_fail_are_the_first_one_s_error():
    judge = KnownErrors({"dahl": 3.0, "bouc-wen": 4.0}, {})
    judge.failing = {Candidate("dahl", ()): ConvergenceError(place="dahl", found="no finite cost")}
    found = chosen(judge, ("dahl", "bouc-wen"))
    assert found.chosen.candidate.law == "bouc-wen"
    assert reasons(found)["dahl"].startswith("failed: dahl: no finite cost")
    row = next(row for row in found.table if row.law == "dahl")
    assert row.free_parameters == 0
    assert np.isnan([row.training_percent, row.held_out_median, row.left_out_percent]).all()
    judge.failing[Candidate("bouc-wen", ())] = ConvergenceError(place="bouc-wen", found="neither")
    with pytest.raises(ConvergenceError, match="dahl"):
        chosen(judge, ("dahl", "bouc-wen"))


def test_an_interrupt_keeps_the_best_so_far_and_before_any_it_goes_on():
    judge = KnownErrors({"dahl": 3.0, "bouc-wen": 2.5}, {"friction": (0.2, 0.2)})
    plain = judge.cross_validate

    def stopped(fitted: Fitted, former: Judged | None = None) -> Judged:
        if fitted.candidate.groups:
            raise Interrupted
        return plain(fitted, former)

    judge.cross_validate = stopped  # type: ignore[method-assign]
    found = chosen(judge, ("dahl", "bouc-wen"))
    assert found.interrupted
    assert found.chosen.candidate == Candidate("bouc-wen", ())

    def at_once(candidate: Candidate, hopeless_percent: float = 0.0) -> Fitted:
        raise Interrupted

    judge.fit_anew = at_once  # type: ignore[method-assign]
    with pytest.raises(Interrupted):
        chosen(judge, ("dahl",))


def test_what_was_left_out_is_said():
    judge = KnownErrors({"dahl": 3.0}, {})
    judge.changing = (SimpleNamespace(), SimpleNamespace())
    assert chosen(judge, ("dahl",)).left_out.endswith("whole motions, 2 runs of changing command")
    judge.changing = judge.changing[:1]
    assert chosen(judge, ("dahl",)).left_out.endswith("1 run of changing command")
    judge.runs, judge.changing = judge.runs[:1], ()
    assert chosen(judge, ("dahl",)).left_out == f"{FOLDS} folds of whole commands"
    judge.folds = (Fold("at 1 A", (0,)),)
    judge.cross_validate = lambda fitted, former=None: Judged(fitted, np.ones((1, 1)), (), 0.0)  # type: ignore[method-assign]
    assert chosen(judge, ("dahl",)).left_out == "at 1 A"
    judge.folds = tuple(Fold("block", (0,), (0.2 * k, 0.2 * k + 0.2)) for k in range(5))
    assert chosen(judge, ("dahl",)).left_out == "5 blocks of time"
