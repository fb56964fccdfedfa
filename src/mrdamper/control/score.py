"""Scores of a tracking run: on all samples, and on those where the target was within the damper's reach.

A semi-active damper cannot push. Its reach at an instant is what it gives, along the same motion and at the
true temperature, at constant zero and at constant highest current: lo(t) and hi(t), the lower and the higher
of the two. A sample counts as feasible where lo + 20 N <= target <= hi - 20 N. The error is never taken
against a target clipped to the reach: the reach depends on history, and even the best current looks worse.

Constant currents take a driver for granted that is where it should be. A sample is dynamically feasible where
the target also lies so far inside the reach of the best known run under the driver's limits
(``dynamic_reach``).

All scores are taken at the plant's steps, from the end of the scenario's unscored beginning.
"""

from __future__ import annotations

import math
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
    dynamic: AttainableRange | None = None  # under the driver's limits, where that is known

    def feasible(self, target: FloatArray, *, margin_N: float | None = None) -> BoolArray:
        """Return where the target [N] lies inside by the margin; None: 20 N, or 2.5 % of a small target."""
        if margin_N is None:
            margin_N = min(_MARGIN_N, _MARGIN * float(np.abs(target).max()))
        return (target >= self.low + margin_N) & (target <= self.high - margin_N)

    def part(self, of: slice) -> AttainableRange:
        """Return the reach over a part of the samples."""
        dynamic = None if self.dynamic is None else self.dynamic.part(of)
        return AttainableRange(self.low[of], self.high[of], dynamic)


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
    max_over_optimum: float | None = None  # over all samples, as the next
    rmse_over_optimum: float | None = None
    excess_N: float | None = None  # root of what the squared RMS error is above that of the optimum
    rmse_feasible_percent: float | None = None  # rmse_feasible_N over the target's RMS
    within_5_percent_share: float = 0.0  # of the time in which the error is within 5 % of the target's peak
    max_dynamic_N: float | None = None  # where the driver can follow as well; as the next
    rmse_dynamic_N: float | None = None
    rmse_dynamic_percent: float | None = None  # of the target's RMS
    dynamic_share: float | None = None  # of the samples


def attainable_range(
    plant: Plant, course: ReferenceTrajectory, temperature_degC: float, highest_A: float
) -> AttainableRange:
    """Return the reach of a plant along a course, from the state that it has."""
    ends = [
        plant.copy().advance_many(course.displacement, course.velocity, current, temperature_degC)
        for current in (0.0, highest_A)
    ]
    return AttainableRange(np.minimum(*ends), np.maximum(*ends))


def score_run(
    run: LoopRun,
    reach: AttainableRange,
    *,
    resistance_ohm: float | None = None,
    optimum: Score | None = None,
    optimum_agrees: bool = True,
) -> Score:
    """Return the scores of a run; ``resistance_ohm`` is the coil's at the run's temperature."""
    scored = slice(run.course.scored_from, None)
    return score_forces(
        run.course.target[scored],
        run.force[scored],
        run.current[scored],
        reach.part(scored),
        step_s=run.course.step_s,
        resistance_ohm=resistance_ohm,
        optimum=optimum,
        optimum_agrees=optimum_agrees,
    )


def score_forces(
    target: FloatArray,
    force: FloatArray,
    current: FloatArray,
    reach: AttainableRange,
    *,
    step_s: float,
    resistance_ohm: float | None = None,
    optimum: Score | None = None,
    optimum_agrees: bool = True,
) -> Score:
    """Return the scores of a force [N] against a target [N], both shape (n,), all samples scored.

    Parameters
    ----------
    current : that the driver gets [A], shape (n,)
    step_s : time from one sample to the next [s]
    resistance_ohm : of the coil; None: its power is not known
    optimum : the score of the best current that a search found, for ratios and excess; ratios are left out
        where no second search has found the same (``optimum_agrees``)
    """
    dynamic = reach.dynamic or reach
    ends = (reach.low, reach.high, dynamic.low, dynamic.high)
    shapes = {len(values) for values in (target, force, current, *ends)}
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
    ratio_to = optimum if optimum_agrees else None
    followed = inside & dynamic.feasible(target)
    following = error[followed] if reach.dynamic else error[:0]
    rmse_following = rms(following) if following.size else None
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
        max_over_optimum=None if ratio_to is None else worst_of_all / ratio_to.max_N,
        rmse_over_optimum=None if ratio_to is None else rmse / ratio_to.rmse_N,
        excess_N=None if optimum is None else math.sqrt(max(0.0, rmse**2 - optimum.rmse_N**2)),
        rmse_feasible_percent=_percent(rmse_inside, size),
        within_5_percent_share=np.count_nonzero(error <= 0.05 * peak) / len(error),
        max_dynamic_N=float(following.max()) if following.size else None,
        rmse_dynamic_N=rmse_following,
        rmse_dynamic_percent=_percent(rmse_following, size),
        dynamic_share=None if reach.dynamic is None else np.count_nonzero(followed) / len(followed),
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
