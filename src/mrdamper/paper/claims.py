"""A quantitative claim of the paper: what it says, what is found here, and how the two compare.

A verdict is computed from the figures, never written down: ``reproduced`` within the stated tolerance,
``better`` past it, ``short`` of it; ``inconsistent`` where the paper contradicts itself or physics, with the
reason; ``not_checkable`` where there is nothing to compute. The claims themselves are in ``claim_table``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

from mrdamper.paper.findings import Findings
from mrdamper.schema import Json

__all__ = ["Claim", "Judge", "Row", "Verdict", "holds", "judge", "near"]

Verdict = Literal["reproduced", "better", "inconsistent", "short", "not_checkable"]

Judge = Callable[[Findings, float | str | None, float | str | None], Verdict]
"""Given what was found, our figure and the paper's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claim: what the paper says, what is found, and how they compare."""

    claim: str  # a stable name
    row: int  # of the paper's statements
    says: str  # the statement in words
    paper: float | str | None
    ours: float | str | None
    unit: str
    verdict: Verdict
    why: str

    def to_json(self) -> Json:
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One row of the table of claims: how a claim's figure is computed, and how it is judged."""

    row: int  # of the paper's statements
    claim: str  # a stable name
    says: str
    paper: float | str | None = None
    ours: Callable[[Findings], float | None] = lambda _: None
    unit: str = ""
    verdict: Verdict | Judge
    why: str | Callable[[Findings], str]
    when: Callable[[Findings], bool] = lambda _: True  # whether there is anything to compare

    def claim_of(self, found: Findings) -> Claim:
        """Return the claim with what was found."""
        ours = self.ours(found)
        return Claim(
            claim=self.claim,
            row=self.row,
            says=self.says,
            paper=self.paper,
            ours=ours,
            unit=self.unit,
            verdict=self.verdict if isinstance(self.verdict, str) else self.verdict(found, ours, self.paper),
            why=self.why if isinstance(self.why, str) else self.why(found),
        )


def judge(
    ours: float,
    paper: float,
    *,
    within: float = 0.0,
    less_is_better: bool = False,
    more_is_better: bool = False,
) -> Verdict:
    """Return the verdict on a figure: inside the tolerance, past it on the good side, or short of it."""
    if abs(ours - paper) <= within:
        return "reproduced"
    if (less_is_better and ours < paper) or (more_is_better and ours > paper):
        return "better"
    return "short"


def near(within: float = 0.0, *, less_is_better: bool = False, more_is_better: bool = False) -> Judge:
    """Judge our figure by the paper's; one that there is not falls short."""

    def verdict(_: Findings, ours: float | str | None, paper: float | str | None) -> Verdict:
        if not isinstance(ours, float | int) or not isinstance(paper, float | int):
            return "short"
        return judge(ours, paper, within=within, less_is_better=less_is_better, more_is_better=more_is_better)

    return verdict


def holds(condition: Callable[[Findings], bool]) -> Judge:
    """Judge a statement without a figure: it holds here, or it does not."""
    return lambda found, _, __: "reproduced" if condition(found) else "short"
