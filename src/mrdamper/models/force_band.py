"""The prediction band of a card's force: how far a measured force may be from it on a motion nobody fitted.

It is conformal: the law was fitted again without each motion, and the band is as wide as holds the stated
share of what those fits missed by. A motion that is farther from those that were fitted than they are from
one another has a wider band. Nothing else is assumed of the errors but that a new motion is one more of the
same kind; beyond the card's envelope it is too narrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.excitation import Trajectory
from mrdamper.schema import Option, check_ranges

LeftOut = Literal["motions", "commands", "blocks of time"]

_Positive = Annotated[float, Option(least=0.0)]


@dataclass(frozen=True, slots=True)
class MotionSize:
    """How large and how fast a motion is: standard deviations of its displacement and of its velocity."""

    displacement_m: _Positive
    velocity_m_s: _Positive

    @classmethod
    def of(cls, motion: Trajectory) -> MotionSize:
        return cls(float(np.std(motion.displacement)), float(np.std(motion.velocity)))

    def distance(self, others: Sequence[MotionSize]) -> float:
        """Return the distance to the nearest of others, in logarithms: 0.7 where one is half as fast."""
        known = np.log([(each.displacement_m, each.velocity_m_s) for each in others])
        return float(np.abs(known - np.log((self.displacement_m, self.velocity_m_s))).max(axis=1).min())


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBand:
    r"""Half width over the force F of a run, and the errors that were found on what was left out.

    .. math:: h = factor \max(1, 1 + widening (d - usual)) \sqrt{F^2 + (run\_share \cdot rms F)^2 + base^2}

    with the distance d of the run's motion to the nearest of ``motions``, and what it usually was of those
    that were left out, ``usual_distance``; without ``motions`` no distance counts.

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
    motions: tuple[MotionSize, ...] = ()  # that the law was fitted to
    usual_distance: _Positive = 0.0
    widening: _Positive = 0.0

    def __post_init__(self) -> None:
        check_ranges(self, "force_band")

    def widened(self, motion: Trajectory) -> float:
        """Return by what factor the band of a run of this motion is wider than the usual one."""
        if not self.motions or not (np.ptp(motion.displacement) > 0.0 and np.ptp(motion.velocity) > 0.0):
            return 1.0
        away = MotionSize.of(motion).distance(self.motions) - self.usual_distance
        return max(1.0, 1.0 + self.widening * away)

    def half_width(self, force: FloatArray, widened: float = 1.0) -> FloatArray:
        """Return the half width [N] at each sample of a model's force [N] over a run, shape (n,)."""
        return self.factor * widened * width_unit(force, self.run_share, self.base_N)

    def coverage(self, force: FloatArray, measured: FloatArray, widened: float = 1.0) -> float:
        """Return the share of samples whose measured force [N] lies in the band about the model's [N]."""
        return float(np.mean(np.abs(measured - force) <= self.half_width(force, widened)))


def width_unit(force: FloatArray, run_share: float, base_N: float) -> FloatArray:
    """Return the half width [N] that a band of factor one has."""
    return np.sqrt(force**2 + (run_share * rms(force)) ** 2 + base_N**2)
