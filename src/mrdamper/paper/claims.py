"""A claim of the paper: what it says, what is found here, where that comes from, and how they compare.

The origin says what agreement is worth: a figure that was set, given to the model, calibrated to this very
number or built into the virtual rig proves nothing. Only what was predicted, or tried, has a verdict. It is
computed from two figures: ``within`` the stated tolerance, ``better`` past it, ``short`` of it, or
``contradicts``. Where the paper contradicts itself or physics is a finding of its own, computed too. The
claims themselves are in ``claim_table``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

from mrdamper.paper.findings import Findings
from mrdamper.schema import Json

Origin = Literal[
    "setting",
    "input",
    "follows from an input",
    "calibrated to this figure",
    "built into the rig",
    "predicted",
    "tried with the paper's method",
    "tried with our method",
    "nothing to compare",
]
"""Where a figure comes from: what was asked of the rig, what the model was given, ..."""

JUDGED: tuple[Origin, ...] = ("predicted", "tried with the paper's method", "tried with our method")
"""Origins whose figures can be wrong, and have a verdict."""

Verdict = Literal["within", "better", "short", "contradicts"]

Judge = Callable[[float, float], Verdict]
"""Given our figure and the one that it is compared with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claim: what the paper says, what is found, where from, and how they compare."""

    claim: str  # a stable name
    row: int  # of the paper's statements
    says: str  # the statement in words
    origin: Origin
    paper: float | str | None
    ours: float | str | None
    compared_with: float | str | None  # the paper's figure, or what the same dampers gave another way
    unit: str
    verdict: Verdict | None  # None: nothing that could be wrong, or nothing to compare with
    contradiction: bool  # the paper contradicts itself or physics here
    why: str

    @property
    def outcome(self) -> str:
        """The verdict in words; empty where there is none."""
        return self.verdict or ""

    def to_json(self) -> Json:
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One row of the table of claims: how a claim's figure is computed, and how it is judged.

    Raises
    ------
    ValueError
        A verdict on what cannot be wrong, or a prediction without one.
    """

    row: int  # of the paper's statements
    claim: str  # a stable name
    says: str
    origin: Origin
    paper: float | str | None = None
    ours: Callable[[Findings], float | None] = lambda _: None
    unit: str = ""
    judged: Judge | None = None
    against: Callable[[Findings], float | None] | None = None  # in place of the paper's figure
    contradicts: Callable[[Findings], bool] = lambda _: False  # whether the paper contradicts itself
    why: str | Callable[[Findings], str]
    when: Callable[[Findings], bool] = lambda _: True  # whether there is anything to compare

    def __post_init__(self) -> None:
        if (self.judged is not None and self.origin not in JUDGED) or (
            self.judged is None and self.origin == "predicted"
        ):
            raise ValueError(f"claim {self.claim}: origin is {self.origin}, and judged is {self.judged}")

    def claim_of(self, found: Findings) -> Claim:
        """Return the claim with what was found."""
        ours = self.ours(found)
        compared = self.paper if self.against is None else self.against(found)
        return Claim(
            claim=self.claim,
            row=self.row,
            says=self.says,
            origin=self.origin,
            paper=self.paper,
            ours=ours,
            compared_with=compared,
            unit=self.unit,
            verdict=self._verdict(ours, compared),
            contradiction=self.contradicts(found),
            why=self.why if isinstance(self.why, str) else self.why(found),
        )

    def _verdict(self, ours: float | None, compared: float | str | None) -> Verdict | None:
        if self.judged is None or ours is None or not isinstance(compared, float | int):
            return None
        return self.judged(ours, compared)


def judge(
    ours: float,
    paper: float,
    *,
    within: float = 0.0,
    less_is_better: bool = False,
    more_is_better: bool = False,
) -> Verdict:
    """Return the verdict on a figure: inside the tolerance, past it on the good side, or short of it.

    Where neither side is good, a figure outside the tolerance contradicts.
    """
    if abs(ours - paper) <= within:
        return "within"
    if (less_is_better and ours < paper) or (more_is_better and ours > paper):
        return "better"
    return "short" if less_is_better or more_is_better else "contradicts"


def near(within: float = 0.0, *, less_is_better: bool = False, more_is_better: bool = False) -> Judge:
    """Judge our figure by the other one."""

    def verdict(ours: float, paper: float) -> Verdict:
        return judge(ours, paper, within=within, less_is_better=less_is_better, more_is_better=more_is_better)

    return verdict


def above(ours: float, paper: float) -> Verdict:
    """Judge a figure of which the paper says only that it is larger than another."""
    return "within" if ours > paper else "contradicts"
