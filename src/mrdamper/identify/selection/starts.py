"""Where the quick fits of a selection begin and end: former dampers with new groups, and short descents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import ConvergenceError
from mrdamper.identify.groups import LawGroup
from mrdamper.identify.limits import feasible
from mrdamper.identify.problem import FitProblem, FreeParameter
from mrdamper.identify.search.descent import Box, Descents
from mrdamper.identify.search.objective import Objective
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.quantities import REFERENCE_K

_SIZES = (1.0, 0.1, 0.01)  # of a new group, of its usual start: it begins at the one that misses least


@dataclass(frozen=True, slots=True)
class Level:
    """The mean force of runs, as it follows temperature."""

    force: float  # at 20 degC [N]
    slope: float  # [N/K]
    told_percent: float  # what a constant level misses more than this one, as the runs' error


def level_of(runs: Sequence[PreparedRun]) -> Level | None:
    """Return the level that the mean forces of runs are at; None where not all have a temperature."""
    warm = _warmth(runs)
    if warm is None:
        return None
    (force, slope), told_percent = _mean_force(runs, np.ones((len(runs), 1)), warm[:, None])
    return Level(force, slope, told_percent)


def asymmetry_percent(runs: Sequence[PreparedRun]) -> float:
    """Return how much is missed unless mean forces grow with force and speed [%], as the runs' error.

    A gas moves the mean of all runs alike; a damper that is stronger one way moves that of its strong runs.
    """
    warm = _warmth(runs)
    alike = [np.ones(len(runs)), *([] if warm is None else [warm])]
    sizes = [float(np.std(_whole_periods(run))) for run in runs]
    speeds = [float(np.std(run.trajectory.velocity)) for run in runs]
    return _mean_force(runs, np.column_stack(alike), np.column_stack([sizes, speeds]))[1]


def _warmth(runs: Sequence[PreparedRun]) -> FloatArray | None:
    """Return the runs' mean temperatures above 20 degC [K]; None where not all have one."""
    warm = [float(np.mean(t)) - REFERENCE_K for run in runs if (t := run.trajectory.temperature) is not None]
    return np.array(warm) if len(warm) == len(runs) else None


def _mean_force(
    runs: Sequence[PreparedRun], alike: FloatArray, more: FloatArray
) -> tuple[tuple[float, ...], float]:
    """Return the runs' mean forces [N] per unit of each column, and what is missed without the last ones [%].

    Each run's mean counts in its force's standard deviation, as its error does.

    Parameters
    ----------
    alike, more : columns that the mean forces follow, a row a run
    """
    forces = [_whole_periods(run) for run in runs]
    weights = np.array([1.0 / max(float(np.std(force)), np.finfo(float).tiny) for force in forces])
    means = weights * [float(np.mean(force)) for force in forces]
    missed = []
    for columns in (alike, np.hstack([alike, more])):
        rows = weights[:, None] * columns
        found = np.linalg.lstsq(rows, means, rcond=None)[0]
        missed.append(float(np.mean((means - rows @ found) ** 2)))
    return tuple(found.tolist()), 100.0 * float(np.sqrt(max(missed[0] - missed[1], 0.0)))


def _whole_periods(run: PreparedRun) -> FloatArray:
    """Return the scored force [N] over whole periods of the motion; all of it where there is none."""
    force, period = run.force[run.scored_from :], (run.period_s or np.inf) / run.trajectory.step
    whole = int(len(force) / period)
    return force[: round(whole * period)] if whole else force


def descend(
    problem: FitProblem,
    objective: Objective,
    dampers: Sequence[Damper],
    most: int,
    rounds: int = 1,
    falls: float = 1.0,
) -> tuple[Damper, float]:
    """Return the best end of short descents from dampers, and its error [%].

    Up to so many ``rounds`` of ``most`` steps are made, while one brings the least error down to the share
    ``falls``.
    """
    box = Box.of(problem)
    nonlinear, linear = (
        np.concatenate(parts) for parts in zip(*map(objective.candidate_of, dampers), strict=True)
    )
    points = np.stack([box.to_search(row) for row in nonlinear])
    descents = Descents(
        objective, points, linear, np.zeros((len(points), len(objective.sessions))), most=most
    )
    descents.run()
    costs = _finite(descents.costs)
    for _ in range(rounds - 1):
        before = costs.min()
        descents.go_on(most)
        costs = _finite(descents.costs)
        if not costs.min() <= falls**2 * before:
            break
    best = int(costs.argmin())
    if not np.isfinite(costs[best]):
        raise ConvergenceError(place=problem.template.law.name, found="no descent reached a finite cost")
    values = np.concatenate([box.to_physical(descents.points[best]), descents.linear[best]]).tolist()
    names = (*objective.nonlinear, *objective.linear)
    found = problem.template.with_parameters(dict(zip(names, values, strict=True)))
    return feasible(problem, found), float(np.sqrt(costs[best]))


def _finite(costs: FloatArray) -> FloatArray:
    return np.where(np.isfinite(costs), costs, np.inf)


def in_sizes(law: str, new: Sequence[LawGroup], start: Mapping[str, float]) -> list[Mapping[str, float]]:
    """Return a start with the first coefficient of each new group in several sizes, the least one last."""
    firsts = {entry.name: start.get(entry.name, entry.start) for entry in (each.entries[0] for each in new)}
    sized = {
        name: usual
        for name, usual in firsts.items()
        if usual and LAWS[law][name].default == 0.0 and not LAWS[law][name].linear
    }
    if not sized:
        return [start]
    return [{**start, **{name: size * usual for name, usual in sized.items()}} for size in _SIZES]


def least(objective: Objective, dampers: Sequence[Damper]) -> Damper:
    """Return the damper of the least error, of several of one problem."""
    if len(dampers) == 1:
        return dampers[0]
    nonlinear, linear = (
        np.concatenate(parts) for parts in zip(*map(objective.candidate_of, dampers), strict=True)
    )
    offsets = np.zeros((len(dampers), len(objective.sessions)))
    costs = objective.eliminate(nonlinear, linear, offsets, tangents=False).cost
    return dampers[int(np.where(np.isfinite(costs), costs, np.inf).argmin())]


def moved(damper: Damper) -> tuple[str, ...]:
    """Return the coefficients of a damper that are not at their law's default."""
    return tuple(
        c.name
        for c, form in zip(damper.law.coefficients, damper.coefficients.values(), strict=True)
        if form.kind != "constant" or form.parameters != (c.default or 0.0,)
    )


def carried(former: Damper, onto: Damper, free: Sequence[FreeParameter]) -> Damper:
    """Return a damper with what it shares with a former one of its law; a new form at its level."""
    known, values = former.parameters_and_lag, onto.parameters_and_lag
    defaults = {c.name for c in former.law.coefficients} - set(moved(former))
    carried = {}
    for each in free:
        name = each.name.partition(".")[0]
        if name in defaults:
            continue
        if each.name in known:
            carried[each.name] = known[each.name]
        elif name in former.coefficients and each.name.endswith((".c00", ".value", ".c0")):
            carried[each.name] = float(former.coefficients[name].value(0.0))
        else:
            carried[each.name] = 0.0 if each.name.rpartition(".")[2].startswith("c") else values[each.name]
    return onto.with_parameters(carried)
