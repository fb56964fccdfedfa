"""The choice of a law and its groups, by what was left out: whole motions, commands, or blocks of time.

Every law is fitted once, one of many groups from each of its archetypes. Those that come near the best are
fitted again without each fold, and their groups are switched on one by one while that lowers the left-out
error; whose error on the runs themselves is above the left-out error of another is not tried further. A group
whose coefficients the runs do not tell is not taken. Runs whose command changes, which no law is fitted to,
count as left out. Groups of the best candidate are switched off again where that costs nothing. A candidate
that fails is a row with its reason. The left-out error of the chosen one is a little too good: it was chosen
by it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mrdamper.errors import ConvergenceError, MrdamperError
from mrdamper.identify.groups import Archetype, archetypes_of
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.selection.candidates import Candidate, Fitted, Judged
from mrdamper.identify.selection.judge import Judge
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.runtime.pool import cpu_seconds
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.runtime.signals import Interrupted

__all__ = ["LawScore", "Selection", "select"]

_FAR = 1.5  # times the least error on the runs themselves: from here on a law is out
_FINALISTS = 3  # laws that are cross-validated at most
_TRIED, _MOST_TRIED = 2, 3  # groups of a round that are; of a law that is made of groups
_ROUNDS, _MOST_ROUNDS = 2, 8  # of groups switched on; of a law that is made of groups,
_NEAR = 1.2  # of whose archetypes those are judged that come so near to the best on the runs themselves;
#              times the least left-out error: from here on the groups of a law that has few are not tried
_BEHIND = 1.05  # while the law's left-out error is no further behind that of the best
_CLEAR, _CLEAR_T = 0.01, 1.0  # gain in left-out error that is taken, with Student's t,
_SMALL, _SMALL_T = 0.003, 2.0  # or a smaller one that is surer,
_WORTH = 0.25  # of the gain in training of a group that pays: those of less are not judged beside it
_MISSED = 0.01  # error that a group's loss may cost on short segments for it to be tried
_FAR_REACHING = "mass"  # but not for this group: its force grows with the square of the frequency

_FAILURES = (MrdamperError, ValueError, ArithmeticError, RuntimeError)  # of one candidate, not of the choice

_HOPELESS = "training error above the best left out"
_NO_GAIN = "no gain in training"

Supports = Callable[[Damper], bool]


@dataclass(frozen=True, slots=True)
class LawScore:
    """One candidate of a selection; errors are of runs' ``nrmse_percent``, NaN where they were not found.

    ``left_out_percent`` is the root of the mean square over the runs that were left out: what was compared.
    """

    law: str
    free_parameters: int
    training_median: float
    held_out_median: float
    held_out_worst: float
    cpu_s: float
    groups: tuple[str, ...] = ()
    training_percent: float = math.nan  # root of the mean square over the runs that were fitted
    left_out_percent: float = math.nan
    reason: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """The candidate that was chosen, its quick fit, and every candidate with its reason, the chosen first."""

    chosen: Fitted
    table: tuple[LawScore, ...]
    left_out: str  # what was left out, for people
    cpu_s: float
    interrupted: bool = False


class _Race:
    """The candidates so far, and the best of them."""

    def __init__(self, judge: Judge, supports: Supports, on_progress: Progress) -> None:
        self._judge, self._supports, self._on_progress = judge, supports, on_progress
        self.rows: dict[Candidate, LawScore] = {}
        self.fitted: list[Fitted] = []
        self.errors: list[Exception] = []
        self.best: Judged | None = None

    def fit(
        self, candidate: Candidate, formers: Sequence[Damper], near: Damper | None = None
    ) -> Fitted | None:
        """Fit a candidate; one that fails is a row."""
        self._on_progress(ProgressUpdate(text=f"fitting {candidate.title}"))
        return self._take(candidate, _fitted(self._judge, candidate, formers, near))

    def _take(self, candidate: Candidate, fitted: Fitted | Exception) -> Fitted | None:
        """Take a candidate that was fitted; one that failed is a row."""
        if isinstance(fitted, Exception):
            self.fail(candidate, fitted)
            return None
        self.fitted.append(fitted)
        self.rows[candidate] = _row(fitted)
        return fitted

    def judge(self, fitted: Fitted, former: Judged | None = None) -> Judged | None:
        """Cross-validate a fitted candidate that can still win; one that fails is a row."""
        if self.best is not None and fitted.training_percent > self.best.highest_training_percent:
            self.say(fitted.candidate, _HOPELESS)
            return None
        self._on_progress(ProgressUpdate(text=f"leaving out motions: {fitted.candidate.title}"))
        try:
            judged = self._judge.cross_validate(fitted, former)
        except _FAILURES as error:
            self.fail(fitted.candidate, error)
            return None
        if not math.isfinite(judged.percent):
            self.say(fitted.candidate, "no finite error on what was left out")
            return None
        self.rows[fitted.candidate] = _row(fitted, judged)
        return judged

    def fail(self, candidate: Candidate, error: Exception) -> None:
        """Take a candidate that failed as a row."""
        self._aside(candidate, f"failed: {str(error).splitlines()[0]}")
        self.errors.append(error)

    def say(self, candidate: Candidate, reason: str) -> None:
        self.rows[candidate] = replace(self.rows[candidate], reason=reason)

    def laws(self, laws: Iterable[str]) -> list[list[Fitted]]:
        """Fit what each law begins with; return those laws that come near, the least error first.

        A law that is made of groups is near: it has hardly begun.
        """
        starts = [(law, kind) for law in laws for kind in self._judge.kinds(law)]
        self._on_progress(ProgressUpdate(text="fitting laws"))
        begun: dict[str, list[Fitted]] = {law: [] for law, _ in starts}
        failed: dict[str, list[Exception]] = {law: [] for law, _ in starts}
        hopeless = math.inf  # on short segments: far behind the first law, which the best is not
        for some in (starts[:1], starts[1:]):
            work = partial(_begun, self._judge, hopeless)
            for law, start in self._judge.side_by_side(work, some):
                if isinstance(start, Exception):
                    failed[law].append(start)
                else:
                    fitted = self._take(*start)
                    begun[law] += [] if fitted is None else [fitted]
                self._on_progress(ProgressUpdate(text=f"fitted {law}"))
            first = next((each for fitted in begun.values() for each in fitted), None)
            hopeless = math.inf if first is None else _FAR * self._judge.on_segments(first)
        for law, kinds in failed.items():
            if kinds and not begun[law]:
                self.fail(Candidate(law, ()), kinds[0])
        found = [sorted(fitted, key=_training) for fitted in begun.values() if fitted]
        found.sort(key=lambda each: each[0].training_percent)
        least = found[0][0].training_percent if found else math.inf
        near = [each for each in found if each[0].training_percent <= _FAR * least][:_FINALISTS]
        for each in found:
            if each not in near and not _grows(each[0]):
                over = 100.0 * (each[0].training_percent / least - 1.0)
                self.say(each[0].candidate, f"training error {over:+.0f} %")
        return [each for each in found if each in near or _grows(each[0])]

    def climb(self, begun: Sequence[Fitted]) -> None:
        """Switch groups of one law on while that lowers the left-out error; the best candidate is kept."""
        known, base = self._begun(begun)
        if known is not None and self._far(known):
            return
        idle: set[str] = set()
        for _ in range(_MOST_ROUNDS if _grows(base) else _ROUNDS):
            grown = self._gaining(base, self._grown(base, self._promising(base, idle)))
            taken = self._taken(known, self._judged(base, known, grown))
            if taken is None and known is None and grown:
                base = grown[0][1]  # not near enough to be judged: by the training error until it is
                continue
            if taken is None:
                return
            known, base = taken, taken.fitted
            idle.clear()  # beside what was taken they may gain
            self._keep(known)
            if self.best is not None and not _grows(base) and known.percent > _BEHIND * self.best.percent:
                return

    def _grown(
        self, base: Fitted, promising: Sequence[tuple[str, Damper | None]]
    ) -> list[tuple[str, Fitted | None]]:
        """Fit a candidate with each of some groups added; one that fails is None, and a row."""
        added = [(base.candidate.with_group(name), near) for name, near in promising]
        self._on_progress(ProgressUpdate(text=f"fitting {base.candidate.title} and one group more"))
        fitted = self._judge.side_by_side(
            lambda each: _fitted(self._judge, each[0], [base.damper], each[1]), added
        )
        taken = [self._take(candidate, each) for (candidate, _), each in zip(added, fitted, strict=True)]
        return [(name, each) for (name, _), each in zip(promising, taken, strict=True)]

    def _gaining(self, base: Fitted, grown: Sequence[tuple[str, Fitted | None]]) -> list[tuple[str, Fitted]]:
        """Return candidates that gain on the runs themselves by numbers that these tell, the best first."""
        gaining = []
        for name, found in grown:
            if found is None:
                continue
            if not _gains(found, base):
                self.say(found.candidate, _NO_GAIN)
            elif not self._judge.identifiable(found, name):
                self.say(found.candidate, f"the runs do not tell the numbers of {name}")
            else:
                gaining.append((name, found))
        return sorted(gaining, key=lambda pair: pair[1].training_percent)

    def _judged(
        self, base: Fitted, known: Judged | None, grown: Sequence[tuple[str, Fitted]]
    ) -> list[tuple[str, Judged]]:
        """Cross-validate candidates, the least left-out error first.

        One that pays lets those wait that gain far less than it does on the runs themselves.
        """
        judged, asked = [], math.inf
        for name, found in grown:
            if found.training_percent > asked:
                self.say(found.candidate, "less gain in training than others")
                continue
            each = self.judge(found, known)
            if each is None:
                continue
            judged.append((name, each))
            if known is not None and _better(each, known):
                least = base.training_percent - _WORTH * (base.training_percent - found.training_percent)
                asked = min(asked, least)
        return sorted(judged, key=lambda pair: pair[1].percent)

    def _begun(self, begun: Sequence[Fitted]) -> tuple[Judged | None, Fitted]:
        """Return the beginning of the least left-out error; of the least error where none is judged."""
        judged = []
        for each in begun:
            if each.training_percent <= _NEAR * begun[0].training_percent:
                found = self.judge(each)
                judged += [] if found is None else [found]
                self._keep(found)
            else:
                self.say(each.candidate, "another archetype is nearer")
        if not judged:
            return None, begun[0]
        best = min(judged, key=lambda each: each.percent)
        return best, best.fitted

    def _far(self, known: Judged) -> bool:
        """Say whether a law is so far behind on what was left out that its few groups change nothing."""
        behind = self.best is not None and known.percent > _NEAR * self.best.percent
        return behind and not _grows(known.fitted)

    def _keep(self, known: Judged | None) -> None:
        if known is not None and (self.best is None or self._preferred(known, self.best)):
            self.best = known

    def _taken(self, base: Judged | None, judged: Sequence[tuple[str, Judged]]) -> Judged | None:
        """Return the best group that pays, with the runners-up that pay on top of it; None: no one does."""
        best: Judged | None = None
        for name, each in judged:
            if best is None:
                best = each if base is None or _better(each, base) else None
            elif base is None or _better(each, base):
                formers = [best.fitted.damper, each.fitted.damper]
                found = self.fit(best.fitted.candidate.with_group(name), formers)
                if found is not None and not _gains(found, best.fitted):
                    self.say(found.candidate, _NO_GAIN)
                    found = None
                both = None if found is None else self.judge(found, best)
                best = both if both is not None and _better(both, best) else best
        return best

    def _promising(self, base: Fitted, idle: set[str]) -> list[tuple[str, Damper | None]]:
        """Return the groups that lower the error on short segments of the runs most, and the dampers there.

        Those that gain nothing are ``idle``: they are not looked at again beside the same groups.
        """
        added = {name: base.candidate.with_group(name) for name in self._judge.open_groups(base.candidate)}
        added = {name: each for name, each in added.items() if each not in self.rows and name not in idle}
        (_, known), *glances = self._glances([base.candidate, *added.values()], base.damper)
        found = []
        for (name, candidate), (damper, percent) in zip(added.items(), glances, strict=True):
            if percent < (1.0 if _grows(base) else 1.0 - _SMALL) * known:
                found.append((percent, name, damper))
                continue
            idle.add(name)
            if candidate not in self.rows:
                self._aside(candidate, "no gain on short segments")
        found.sort(key=lambda each: each[0])
        tried = _MOST_TRIED if _grows(base) else _TRIED
        for _, name, _ in found[tried:]:
            self._aside(base.candidate.with_group(name), "less gain on short segments than others")
        return [(name, damper) for _, name, damper in found[:tried]]

    def _glances(self, candidates: Sequence[Candidate], former: Damper) -> list[tuple[Damper | None, float]]:
        """Look at candidates from a former damper; one that fails is a row."""
        self._on_progress(ProgressUpdate(text=f"looking at {len(candidates)} candidates"))
        found: list[tuple[Damper | None, float]] = []
        seen = self._judge.side_by_side(lambda each: _seen(self._judge, each, former), candidates)
        for candidate, each in zip(candidates, seen, strict=True):
            if isinstance(each, Exception):
                self.fail(candidate, each)
            found.append((None, math.inf) if isinstance(each, Exception) else each)
        return found

    def _aside(self, candidate: Candidate, reason: str) -> None:
        """Take a candidate that is not fitted as a row."""
        nothing = (math.nan, math.nan, math.nan, 0.0)
        self.rows[candidate] = LawScore(candidate.law, 0, *nothing, candidate.groups, reason=reason)

    def _preferred(self, one: Judged, other: Judged) -> bool:
        """Say whether a candidate replaces another: a clearly lower error, or the same and a controller."""
        takes, took = (self._supports(each.fitted.damper) for each in (one, other))
        return not _better(other, one) if takes and not took else _better(one, other)

    def switch_off(self) -> None:
        """Switch groups off whose loss costs next to nothing."""
        base = self.best
        if base is None:
            return
        grows = _grows(base.fitted)
        known = self._glances([base.fitted.candidate], base.fitted.damper)[0][1] if grows else math.inf
        for name in self._judge.closable_groups(base.fitted.candidate):
            candidate = base.fitted.candidate.without(name)
            if candidate in self.rows:
                continue
            near, percent = self._glances([candidate], base.fitted.damper)[0] if grows else (None, 0.0)
            if percent > (1.0 + _MISSED) * known:
                self._aside(candidate, "more error on short segments")
                continue
            found = self.fit(candidate, [base.fitted.damper], near)
            judged = None if found is None else self.judge(found, base)
            if judged is not None and judged.percent < (1.0 + _SMALL) * base.percent:
                self.best = base = judged


def select(
    judge: Judge,
    laws: Sequence[str],
    *,
    supports: Supports = lambda _: True,
    on_progress: Progress = silent,
) -> Selection:
    """Return the law and groups of the least error on what was left out.

    ``supports`` says which dampers are preferred where errors are the same within the rule's threshold (those
    that a controller takes). An interrupt keeps the best candidate so far.

    Raises
    ------
    MrdamperError
        No candidate could be fitted: the first one's.
    Interrupted
        Before any was.
    """
    clock, race, interrupted = cpu_seconds(), _Race(judge, supports, on_progress), False
    try:
        for near in race.laws(laws):
            race.climb(near)
        race.switch_off()
    except Interrupted:
        if not race.fitted:
            raise
        interrupted = True
    if race.best is not None:
        chosen = race.best.fitted
    elif race.fitted:
        chosen = min(race.fitted, key=lambda each: each.training_percent)
    else:
        raise race.errors[0]
    table = _table(race, chosen)
    return Selection(chosen, table, _left_out(judge), cpu_seconds() - clock, interrupted)


def _fitted(
    judge: Judge, candidate: Candidate, formers: Sequence[Damper], near: Damper | None = None
) -> Fitted | Exception:
    """Return a fitted candidate, or why it could not be."""
    try:
        return judge.fit_from(candidate, formers, near)
    except _FAILURES as error:
        return error


def _begun(
    judge: Judge, hopeless: float, begin: tuple[str, Archetype | None]
) -> tuple[str, tuple[Candidate, Fitted | Exception] | Exception]:
    """Return a law with what one of its searches begins with, fitted, or why it could not be.

    One that is drawn is fitted roughly where its error [%] on short segments is ``hopeless``.
    """
    law, kind = begin
    try:
        start = judge.beginning(law, kind)
    except _FAILURES as error:
        return law, error
    if start is None:
        return law, ConvergenceError(place=law, found="no descent reached a finite cost")
    candidate, damper = start
    try:
        if damper is None:
            return law, (candidate, judge.fit_anew(candidate, hopeless))
        return law, (candidate, judge.fit_from(candidate, [damper]))
    except _FAILURES as error:
        return law, (candidate, error)


def _seen(judge: Judge, candidate: Candidate, former: Damper) -> tuple[Damper, float] | Exception:
    """Return a candidate's quick fit on short segments and its error [%], or why there is none."""
    try:
        return judge.glance(candidate, former)
    except _FAILURES as error:
        return error


def _training(fitted: Fitted) -> float:
    return fitted.training_percent


def _gains(found: Fitted, base: Fitted) -> bool:
    """Say whether a candidate is so much better on the runs themselves that it may be so on others."""
    return found.training_percent < (1.0 - _SMALL) * base.training_percent


def _grows(fitted: Fitted) -> bool:
    """Say whether a candidate's law is made of groups."""
    return bool(archetypes_of(LAWS[fitted.candidate.law]))


def _better(one: Judged, other: Judged) -> bool:
    """Say whether the first candidate's left-out error is lower by more than chance.

    A small gain does not buy a mass: beyond the frequencies of the runs, which none of the left-out motions
    passes, a mass that is not there costs far more than it gained among them.
    """
    gain, t = one.gain_over(other)
    with_it, without = (_FAR_REACHING in each.fitted.candidate.groups for each in (one, other))
    small_counts = without or not with_it
    return (gain > _CLEAR and t > _CLEAR_T) or (small_counts and gain > _SMALL and t > _SMALL_T)


def _row(fitted: Fitted, judged: Judged | None = None) -> LawScore:
    errors = np.array([np.nan]) if judged is None else judged.by_run
    return LawScore(
        law=fitted.candidate.law,
        groups=fitted.candidate.groups,
        free_parameters=fitted.free_parameters,
        training_median=fitted.training_median,
        training_percent=fitted.training_percent,
        held_out_median=float(np.median(errors)),
        held_out_worst=float(errors.max()),
        left_out_percent=math.nan if judged is None else judged.percent,
        cpu_s=fitted.cpu_s + (0.0 if judged is None else judged.cpu_s),
    )


def _table(race: _Race, chosen: Fitted) -> tuple[LawScore, ...]:
    """Return every candidate with its reason: the chosen, then by the error on what was left out."""
    rows = []
    for candidate, row in race.rows.items():
        reason = row.reason
        if candidate == chosen.candidate:
            reason = "chosen"
        elif not reason and race.best is not None and math.isfinite(row.left_out_percent):
            over = 100.0 * (row.left_out_percent / race.best.percent - 1.0)
            reason = f"left out {over:+.1f} %"
        rows.append(replace(row, reason=reason))
    return tuple(
        sorted(
            rows,
            key=lambda row: (
                row.reason != "chosen",
                np.nan_to_num(row.left_out_percent, nan=np.inf),
                np.nan_to_num(row.training_percent, nan=np.inf),
            ),
        )
    )


def _left_out(judge: Judge) -> str:
    """Return what was left out, for people."""
    count = len(judge.folds)
    if not judge.folds[0].whole:
        return f"{count} blocks of time"
    left = "motions" if len(motion_groups(judge.runs)) > 1 else "commands"
    held = f"{count} folds of whole {left}" if count > 1 else judge.folds[0].label
    count = len(judge.changing)
    return f"{held}, {count} run{'s' * (count > 1)} of changing command" if count else held
