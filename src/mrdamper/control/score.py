"""Scores of a tracking run, for all samples and for the feasible samples.

A semi-active damper cannot push. The forces that it can produce are found by simulating the motion twice,
with zero current and with the highest current. At each time t, lo(t) is the lower and hi(t) the higher of the
two forces. A sample is feasible if the target is between lo and hi and at least a margin (20 N or less) away
from both. The tracking error always refers to the original target, not to a target that is limited to lo and
hi.

All scores are computed at the time steps of the plant, without the unscored beginning of the scenario.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray, rms
from mrdamper.control.loop import LoopRun, ReferenceTrajectory
from mrdamper.control.protocol import Plant
from mrdamper.control.settings import SETTINGS
from mrdamper.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class AttainableRange:
    """Forces that a damper can produce along a motion, between zero and the highest current, shape (n,)."""

    low: FloatArray  # smallest possible force [N]
    high: FloatArray  # largest possible force [N]

    def feasible(self, target: FloatArray, *, margin_N: float | None = None) -> BoolArray:
        """Return True for every sample at which the damper can produce the target [N].

        Such a target is feasible: above the lowest and below the highest possible force, by at least the
        margin. The default margin is 20 N, or 2.5 % of the largest absolute target if this value is below 20
        N.
        """
        if margin_N is None:
            margin_N = min(SETTINGS.margin_N, SETTINGS.margin_ratio_max * float(np.abs(target).max()))
        return (target >= self.low + margin_N) & (target <= self.high - margin_N)

    def part(self, of: slice) -> AttainableRange:
        """Return the range for a slice of the samples."""
        return AttainableRange(self.low[of], self.high[of])


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Tracking errors, coil power and current changes of a run.

    A sample is feasible if the damper can produce the target force. Scores of feasible samples are None if
    no sample is feasible. The coil power is None if the coil resistance is unknown.
    """

    max_N: float
    rmse_N: float
    max_feasible_N: float | None
    rmse_feasible_N: float | None
    p99_feasible_N: float | None
    feasible_share: float
    rmse_over_range_percent: float  # RMS error divided by (max - min) of the target
    coil_power_W: float | None  # mean of i^2 R
    chatter_A_per_s: float  # sum of the absolute current changes, divided by the duration
    rmse_feasible_percent: float | None = None  # rmse_feasible_N / RMS of the target force [%]
    within_5_percent_share: float = 0.0  # fraction of time with an error below 5 % of the target's peak


def attainable_range(
    plant: Plant, course: ReferenceTrajectory, temperature_degC: float, highest_A: float
) -> AttainableRange:
    """Return the range of forces that a damper (plant) can produce in a motion."""
    ends = [
        plant.copy().advance_many(course.displacement, course.velocity, current, temperature_degC)
        for current in (0.0, highest_A)
    ]
    return AttainableRange(np.minimum(*ends), np.maximum(*ends))


def score_run(run: LoopRun, reach: AttainableRange, *, resistance_ohm: float | None = None) -> Score:
    """Return the scores of a run; ``resistance_ohm`` is the coil resistance at the temperature of the run."""
    scored = slice(run.course.scored_from, None)
    return score_forces(
        run.course.target[scored],
        run.force[scored],
        run.current[scored],
        reach.part(scored),
        step_s=run.course.step_s,
        resistance_ohm=resistance_ohm,
    )


def score_forces(
    target: FloatArray,
    force: FloatArray,
    current: FloatArray,
    reach: AttainableRange,
    *,
    step_s: float,
    resistance_ohm: float | None = None,
) -> Score:
    """Return the scores of a force [N] that has to follow a target [N], both of shape (n,).

    All samples are scored.

    Parameters
    ----------
    current : current of the driver [A], shape (n,)
    step_s : time between samples [s]
    resistance_ohm : resistance of the coil; None: the coil power is not computed
    """
    shapes = {len(values) for values in (target, force, current, reach.low, reach.high)}
    if len(shapes) != 1 or 0 in shapes:
        raise InputError(
            place="scores", found=f"lengths are {sorted(shapes)}", expected="one common length, at least 1"
        )
    error = np.abs(force - target)
    inside = reach.feasible(target)
    feasible = error[inside]
    rmse, rmse_inside, span = rms(error), rms(feasible) if feasible.size else None, float(np.ptp(target))
    worst_of_all = float(error.max())
    size, peak = rms(target), float(np.abs(target).max())
    return Score(
        max_N=worst_of_all,
        rmse_N=rmse,
        max_feasible_N=float(feasible.max()) if feasible.size else None,
        rmse_feasible_N=rmse_inside,
        p99_feasible_N=float(np.percentile(feasible, 99.0)) if feasible.size else None,
        feasible_share=np.count_nonzero(inside) / len(inside),
        rmse_over_range_percent=100.0 * rmse / span if span > 0.0 else float("inf"),
        coil_power_W=None if resistance_ohm is None else float(np.mean(current**2)) * resistance_ohm,
        chatter_A_per_s=float(np.abs(np.diff(current)).sum()) / (step_s * len(current)),
        rmse_feasible_percent=_percent(rmse_inside, size),
        within_5_percent_share=np.count_nonzero(error <= 0.05 * peak) / len(error),
    )


def _percent(value: float | None, of: float) -> float | None:
    return 100.0 * value / of if value is not None and of > 0.0 else None


def combine_worst(scores: Sequence[Score]) -> Score:
    """Return the worst value of each score: min of fractions, max of other scores."""
    if not scores:
        raise InputError(place="scores", found="there are no scores")
    found: dict[str, float | None] = {}
    for each in fields(Score):
        values = [value for score in scores if (value := getattr(score, each.name)) is not None]
        pick = min if each.name.endswith("_share") else max
        found[each.name] = pick(values) if values else None
    return Score(**found)  # type: ignore[arg-type]  # a score that is never None has values
