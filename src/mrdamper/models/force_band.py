"""Prediction band of the force of a card: expected error of the force in a new motion.

The band is a conformal prediction band. Cross-validation fits the model several times, each time without some
of the motions. The band is just wide enough to contain the stated fraction of the errors on these held-out
motions. The band is wider for a run with changing current. It is also wider for a motion that differs more
from the fitted motions than the held-out motions did. The only assumption is that a new motion is similar to
the held-out motions. Outside the operating envelope, the band is too narrow.
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
    """Size and speed of a motion: standard deviations of displacement and velocity."""

    displacement_m: _Positive
    velocity_m_s: _Positive

    @classmethod
    def from_motion(cls, motion: Trajectory) -> MotionSize:
        return cls(float(np.std(motion.displacement)), float(np.std(motion.velocity)))

    def distance(self, others: Sequence[MotionSize]) -> float:
        """Return how much a motion differs from the most similar motion in ``others`` [-].

        The difference is abs(log(ratio)), for the ratio of displacements or of velocities, whichever is
        larger. For example, it is 0.69 for a motion that is half as fast.
        """
        known = np.log([(each.displacement_m, each.velocity_m_s) for each in others])
        return float(np.abs(known - np.log((self.displacement_m, self.velocity_m_s))).max(axis=1).min())


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceBand:
    r"""Band around the model force F that contains most measured forces.

    .. math:: h = factor\, c \max(1, 1 + widening (d - usual)) \sqrt{F^2 + (run\_share\, rms F)^2 + base^2}

    h is the half width of the band. d is the distance between the motion of the run and the most similar
    motion in ``motions``. *usual* is ``usual_distance``, the mean distance between the held-out motions and
    the fitted motions. Without ``motions``, h does not depend on d. c is ``changing_current_ratio`` for a run
    with changing current, otherwise 1.

    ``expected_nrmse_percent`` is the expected median error of new runs inside the operating envelope.
    ``worst_nrmse_percent`` is the largest error of the held-out runs.
    """

    share: Annotated[float, Option(above=0.0, below=1.0)]
    """Fraction of the samples of a new motion that the band is expected to contain."""
    factor: _Positive
    run_share: _Positive
    base_N: _Positive
    expected_nrmse_percent: _Positive
    worst_nrmse_percent: _Positive
    left_out: LeftOut
    folds: Annotated[int, Option(least=1)]
    motions: tuple[MotionSize, ...] = ()  # motions of the fitted runs
    usual_distance: _Positive = 0.0
    widening: _Positive = 0.0
    changing_current_ratio: Annotated[float, Option(least=1.0)] = 1.0

    def __post_init__(self) -> None:
        check_ranges(self, "force_band")

    def widened(self, motion: Trajectory) -> float:
        """Return the width of the band of a run, divided by the width for a typical motion."""
        factor = self.changing_current_ratio if np.ptp(motion.command) > 0.0 else 1.0
        if not self.motions or not (np.ptp(motion.displacement) > 0.0 and np.ptp(motion.velocity) > 0.0):
            return factor
        excess = MotionSize.from_motion(motion).distance(self.motions) - self.usual_distance
        return factor * max(1.0, 1.0 + self.widening * excess)

    def half_width(self, force: FloatArray, widened: float = 1.0) -> FloatArray:
        """Return the half width of the band [N] at each sample of a model force [N], shape (n,)."""
        return self.factor * widened * width_unit(force, self.run_share, self.base_N)

    def coverage(self, force: FloatArray, measured: FloatArray, widened: float = 1.0) -> float:
        """Return the fraction of samples whose measured force [N] is inside the band."""
        return float(np.mean(np.abs(measured - force) <= self.half_width(force, widened)))


def width_unit(force: FloatArray, run_share: float, base_N: float) -> FloatArray:
    """Return the half width [N] of a band with factor 1, for model forces, shape (n,)."""
    return np.sqrt(force**2 + (run_share * rms(force)) ** 2 + base_N**2)
