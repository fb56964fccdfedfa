"""The prediction band of a card's force: how far a measured force may be from it on a motion nobody fitted.

It is conformal: the law was fitted again without each motion, and the band is as wide as holds the stated
share of what those fits missed by. Nothing is assumed of the errors but that a new motion is one more of the
same kind; beyond the card's envelope it is too narrow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.schema import Option, check_ranges

LeftOut = Literal["motions", "commands", "blocks of time"]

_Positive = Annotated[float, Option(least=0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBand:
    r"""Half width over the force F of a run, and the errors that were found on what was left out.

    .. math:: h = factor \sqrt{F^2 + (run\_share \cdot rms F)^2 + base^2}

    ``expected_nrmse_percent`` is the median error to expect of new runs inside the envelope,
    ``worst_nrmse_percent`` the worst that was found, each on runs that a fit had not seen.
    """

    share: Annotated[float, Option("of samples inside", above=0.0, below=1.0)]
    factor: _Positive
    run_share: _Positive
    base_N: _Positive
    expected_nrmse_percent: _Positive
    worst_nrmse_percent: _Positive
    left_out: LeftOut
    folds: Annotated[int, Option(least=1)]

    def __post_init__(self) -> None:
        check_ranges(self, "force_band")

    def half_width(self, force: FloatArray) -> FloatArray:
        """Return the half width [N] at each sample of a model's force [N] over a run, shape (n,)."""
        return self.factor * width_unit(force, self.run_share, self.base_N)

    def coverage(self, force: FloatArray, measured: FloatArray) -> float:
        """Return the share of samples whose measured force [N] lies in the band about the model's [N]."""
        return float(np.mean(np.abs(measured - force) <= self.half_width(force)))


def width_unit(force: FloatArray, run_share: float, base_N: float) -> FloatArray:
    """Return the half width [N] that a band of factor one has."""
    return np.sqrt(force**2 + (run_share * rms(force)) ** 2 + base_N**2)
