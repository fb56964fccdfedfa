"""Scores of a tracking run: on all samples, and on those where the target was within the damper's reach.

A semi-active damper cannot push. Its reach at an instant is what it gives, along the same motion and at the
true temperature, at constant zero and at constant highest current: lo(t) and hi(t), the lower and the higher
of the two. A sample counts as feasible where lo + 20 N <= target <= hi - 20 N. The error is never taken
against a target clipped to the reach: the reach depends on history, and even the best current looks worse.

All scores are taken at the plant's steps, from the end of the scenario's unscored beginning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from mrdamper.arrays import BoolArray, FloatArray, rms
from mrdamper.control.loop import LoopRun, ReferenceTrajectory
from mrdamper.control.protocol import Plant
from mrdamper.errors import InputError

_MARGIN_N = 20.0  # how far inside the reach a feasible target lies, and at most this share of the target
_MARGIN = 0.025


@dataclass(frozen=True, slots=True, eq=False)
class AttainableRange:
    """The forces that a damper can give along a motion, between zero and the highest current, shape (n,)."""

    low: FloatArray  # [N]
    high: FloatArray  # [N]

    def feasible(self, target: FloatArray, *, margin_N: float | None = None) -> BoolArray:
        """Return where the target [N] lies inside by the margin; None: 20 N, or 2.5 % of a small target."""
        if margin_N is None:
            margin_N = min(_MARGIN_N, _MARGIN * float(np.abs(target).max()))
        return (target >= self.low + margin_N) & (target <= self.high - margin_N)

    def part(self, of: slice) -> AttainableRange:
        """Return the reach over a part of the samples."""
        return AttainableRange(self.low[of], self.high[of])


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How well a force was tracked, and what it cost; None where nothing was feasible, or not known."""

    max_N: float
    rmse_N: float
    max_feasible_N: float | None
    rmse_feasible_N: float | None
    p99_feasible_N: float | None
    feasible_share: float
    rmse_over_range_percent: float  # of max - min of the target
    coil_power_W: float | None  # mean i^2 R
    chatter_A_per_s: float  # sum of |dI| per second
    rmse_feasible_percent: float | None = None  # rmse_feasible_N over the target's RMS
    within_5_percent_share: float = 0.0  # of the time in which the error is within 5 % of the target's peak


def attainable_range(
    plant: Plant, course: ReferenceTrajectory, temperature_degC: float, highest_A: float
) -> AttainableRange:
    """Return the reach of a plant along a course, from the state that it has."""
    ends = [
        plant.copy().advance_many(course.displacement, course.velocity, current, temperature_degC)
        for current in (0.0, highest_A)
    ]
    return AttainableRange(np.minimum(*ends), np.maximum(*ends))


def score_run(run: LoopRun, reach: AttainableRange, *, resistance_ohm: float | None = None) -> Score:
    """Return the scores of a run; ``resistance_ohm`` is the coil's at the run's temperature."""
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
    """Return the scores of a force [N] against a target [N], both shape (n,), all samples scored.

    Parameters
    ----------
    current : that the driver gets [A], shape (n,)
    step_s : time from one sample to the next [s]
    resistance_ohm : of the coil; None: its power is not known
    """
    shapes = {len(values) for values in (target, force, current, reach.low, reach.high)}
    if len(shapes) != 1 or 0 in shapes:
        raise InputError(
            place="scores", found=f"lengths are {sorted(shapes)}", expected="one and the same, at least 1"
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


def worst(scores: Sequence[Score]) -> Score:
    """Return the worst of each figure over several runs: the highest, of the feasible share the lowest."""
    if not scores:
        raise InputError(place="scores", found="none to take the worst of")
    found: dict[str, float | None] = {}
    for each in fields(Score):
        values = [value for score in scores if (value := getattr(score, each.name)) is not None]
        pick = min if each.name.endswith("_share") else max
        found[each.name] = pick(values) if values else None
    return Score(**found)  # type: ignore[arg-type]  # a figure that is never None has values
