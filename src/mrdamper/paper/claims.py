"""A claim of the paper: statement, simulated value, origin of the value, and verdict.

Only predicted or tested values have a verdict. A value that was set, calibrated with the paper, or built
into the virtual rig proves nothing. The verdict compares two values. It is ``within`` the stated tolerance,
``better``, ``worse``, or ``contradicts``. Contradictions of the paper with itself or with
physics are also computed. The module ``claim_table`` has the claims.
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
    "calibrated to this value",
    "built into the rig",
    "predicted",
    "tested with the method of the paper",
    "tested with the method of mrdamper",
    "not comparable",
]
"""Origin of a simulated value: input of the rig, input of the model, ..."""

JUDGED: tuple[Origin, ...] = (
    "predicted",
    "tested with the method of the paper",
    "tested with the method of mrdamper",
)
"""Origins whose values can be wrong and have a verdict."""

Verdict = Literal["within", "better", "worse", "contradicts"]

Judge = Callable[[float, float], Verdict]
"""Function that compares the simulated value with another value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claim of the paper with the simulated value and the verdict.

    Attributes
    ----------
    claim : name of the claim in JSON
    row : number of the statement in the paper
    compared_with : the value of the paper, or of the same dampers with another method
    verdict : None if the value cannot be wrong, or cannot be compared
    contradiction : True if the paper contradicts itself or physics
    """

    claim: str
    row: int
    statement: str
    origin: Origin
    paper: float | str | None
    ours: float | str | None
    compared_with: float | str | None
    unit: str
    verdict: Verdict | None
    contradiction: bool
    why: str

    @property
    def outcome(self) -> str:
        """The verdict as text, or an empty string."""
        return self.verdict or ""

    def to_json(self) -> Json:
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One row of the table of claims: calculation and judgement of a value.

    Attributes
    ----------
    against : returns the value to compare with, if it is not the value of the paper
    contradicts : returns True if the paper contradicts itself or physics
    when : returns False if there is no value

    Raises
    ------
    ValueError
        If a value that cannot be wrong has a judge, or a prediction has none.
    """

    row: int
    claim: str
    statement: str
    origin: Origin
    paper: float | str | None = None
    ours: Callable[[Findings], float | None] = lambda _: None
    unit: str = ""
    judged: Judge | None = None
    against: Callable[[Findings], float | None] | None = None
    contradicts: Callable[[Findings], bool] = lambda _: False
    why: str | Callable[[Findings], str]
    when: Callable[[Findings], bool] = lambda _: True

    def __post_init__(self) -> None:
        if (self.judged is not None and self.origin not in JUDGED) or (
            self.judged is None and self.origin == "predicted"
        ):
            raise ValueError(f"claim {self.claim}: origin is {self.origin}, and judged is {self.judged}")

    def claim_of(self, found: Findings) -> Claim:
        """Return the claim with the simulated value."""
        ours = self.ours(found)
        compared = self.paper if self.against is None else self.against(found)
        return Claim(
            claim=self.claim,
            row=self.row,
            statement=self.statement,
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
    """Return the verdict on a value: within the tolerance, better, or worse than the other value.

    If neither larger nor smaller is better, a value outside the tolerance contradicts.
    """
    if abs(ours - paper) <= within:
        return "within"
    if (less_is_better and ours < paper) or (more_is_better and ours > paper):
        return "better"
    return "worse" if less_is_better or more_is_better else "contradicts"


def tolerance_judge(
    within: float = 0.0, *, less_is_better: bool = False, more_is_better: bool = False
) -> Judge:
    """Return a judge that allows a relative tolerance."""

    def verdict(ours: float, paper: float) -> Verdict:
        return judge(ours, paper, within=within, less_is_better=less_is_better, more_is_better=more_is_better)

    return verdict


def is_larger(ours: float, paper: float) -> Verdict:
    """Return the verdict on a value which the paper states only as larger than another one."""
    return "within" if ours > paper else "contradicts"
