"""Claims of the paper: a claim has a statement, a simulated value, the origin of this value, and a verdict.

Only predicted or tested values have a verdict. A value that was set by the user, calibrated with the paper,
or built into the virtual rig cannot confirm a claim. The verdict compares the simulated value with the value
of the paper: ``within`` the stated tolerance, ``better``, ``worse``, or ``contradicts``. Claims that
contradict other claims or physics are also marked. The module ``claim_table`` contains all claims.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Literal

from mrdamper.identify.assess import Assessment
from mrdamper.identify.fit import Identification
from mrdamper.jobs.thermal.heat import HeatResult
from mrdamper.jobs.thermal.heatsink import HeatsinkResult
from mrdamper.jobs.track import TrackResult
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.schema import Json
from mrdamper.thermal.dissipation import LoopWork


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Results of all jobs of the demo. Thermal jobs use the preset ``paper`` of the virtual rig."""

    fitted: Identification  # fit of the selected law to runs of the preset ``nominal``
    judged: Assessment  # assessment of the fit ``fitted``
    # assessment of a fit of the reference paper's law (Bouc-Wen with polynomials) to the same runs
    paper_law: Assessment
    fluid: Fluid
    warm_up: HeatResult  # heating by a sine of 15 mm, 1 Hz, 2 A for 35 min, also above the temperature limit
    small: HeatResult  # heating by a sine of 5 mm, 1 Hz
    fast: HeatResult  # heating by a sine of 3 mm, 2 Hz
    works: tuple[tuple[str, LoopWork], ...]  # load cycle and dissipated work of the three heating simulations
    sink: HeatsinkResult
    track: TrackResult


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
"""Origin of a simulated value, which decides whether the value can confirm a claim."""

JUDGED: tuple[Origin, ...] = (
    "predicted",
    "tested with the method of the paper",
    "tested with the method of mrdamper",
)
"""Origins of values that can differ from the paper. Only these values have a verdict."""

Verdict = Literal["within", "better", "worse", "contradicts"]

Judge = Callable[[float, float], Verdict]
"""Function that returns the verdict for a simulated value and the value to compare with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claim of the paper with the simulated value and the verdict.

    Attributes
    ----------
    claim : name of the claim in JSON
    row : number of the statement, in the order of the paper
    paper, ours : value in the paper, and simulated value
    compared_with : value of the paper, or simulated value with a different method
    verdict : result of the comparison; None if the origin of the value permits no verdict
    contradiction : True if the claim contradicts another claim of the paper, or physics
    why : explanation for the reader
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
        """Verdict as text; empty if there is no verdict."""
        return self.verdict or ""

    def to_json(self) -> Json:
        return asdict(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """Definition of one claim: how the simulated value is computed and compared.

    Attributes
    ----------
    ours : function that returns the simulated value
    judged : function that returns the verdict; None: the claim has no verdict
    against : function that returns the value to compare with; None: the value of the paper
    contradicts : function that returns True if the claim contradicts another claim of the paper, or physics
    when : function that returns False if the demo lacks the simulated value; the claim is then omitted

    Raises
    ------
    ValueError
        If ``judged`` is given although the origin permits no verdict, or is missing for a prediction.
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
        """Return the claim with its simulated value and its verdict."""
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
    """Return the verdict for a simulated value: within the tolerance, better, or worse than the paper.

    If neither a larger nor a smaller value is better, a value outside the tolerance is a contradiction.
    """
    if abs(ours - paper) <= within:
        return "within"
    if (less_is_better and ours < paper) or (more_is_better and ours > paper):
        return "better"
    return "worse" if less_is_better or more_is_better else "contradicts"


def tolerance_judge(
    within: float = 0.0, *, less_is_better: bool = False, more_is_better: bool = False
) -> Judge:
    """Return the function ``judge`` with fixed tolerance and direction, for ``Row.judged``."""

    def verdict(ours: float, paper: float) -> Verdict:
        return judge(ours, paper, within=within, less_is_better=less_is_better, more_is_better=more_is_better)

    return verdict


def is_larger(ours: float, paper: float) -> Verdict:
    """Return the verdict for a claim that states only which of two values is larger."""
    return "within" if ours > paper else "contradicts"
