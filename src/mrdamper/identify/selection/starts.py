"""Compute start values for the fits of the model selection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.terms import Term
from mrdamper.models.damper import Damper
from mrdamper.models.laws import LAWS
from mrdamper.quantities import REFERENCE_K

# A new term is tried with its default start value times each of these factors. The best factor is used.
START_SIZE_RATIOS = (1.0, 0.1, 0.01)


def mean_force_level(runs: Sequence[PreparedRun], error_percent_min: float) -> tuple[float, float] | None:
    """Return the mean force of the runs at 20 degC [N] and its slope with respect to temperature [N/K].

    The mean force of a symmetric damper is its gas force. Return None if a run has no temperature, or if the
    slope explains less than ``error_percent_min`` of the mean forces (see ``_mean_force``).
    """
    warming_K = _warming_K(runs)
    if warming_K is None:
        return None
    (force, slope), percent = _mean_force(runs, np.ones((len(runs), 1)), warming_K[:, None])
    return (force, slope) if percent >= error_percent_min else None


def asymmetry_percent(runs: Sequence[PreparedRun]) -> float:
    """Return the part [%] of the runs' mean forces that force amplitude and speed explain.

    If the damper is symmetric, the mean force of a run is the gas force. If the damper is stronger in one
    direction, runs with larger forces have larger mean forces. Therefore the result is large for an
    asymmetric damper. ``_mean_force`` defines the percentage.
    """
    warming_K = _warming_K(runs)
    base = [np.ones(len(runs)), *([] if warming_K is None else [warming_K])]
    sizes = [float(np.std(_period_forces(run))) for run in runs]
    speeds = [float(np.std(run.trajectory.velocity)) for run in runs]
    return _mean_force(runs, np.column_stack(base), np.column_stack([sizes, speeds]))[1]


def _warming_K(runs: Sequence[PreparedRun]) -> FloatArray | None:
    """Return the mean temperature of each run minus 20 degC [K]; None if a run has no temperature."""
    warm = [float(np.mean(t)) - REFERENCE_K for run in runs if (t := run.trajectory.temperature) is not None]
    return np.array(warm) if len(warm) == len(runs) else None


def _mean_force(
    runs: Sequence[PreparedRun], base: FloatArray, more: FloatArray
) -> tuple[tuple[float, ...], float]:
    """Fit the mean forces of runs by linear regression; return coefficients and explained part [%].

    ``base`` and ``more`` are columns of the regression matrix with one row per run. The explained part is the
    root-mean-square part of the mean forces that only the columns ``more`` explain. The mean force of a run
    is divided by the standard deviation of the run's force, like the error of a run.
    """
    forces = [_period_forces(run) for run in runs]
    weights = np.array([1.0 / max(float(np.std(force)), np.finfo(float).tiny) for force in forces])
    means = weights * [float(np.mean(force)) for force in forces]
    squares = []
    for columns in (base, np.hstack([base, more])):
        rows = weights[:, None] * columns
        solution = np.linalg.lstsq(rows, means, rcond=None)[0]
        squares.append(float(np.mean((means - rows @ solution) ** 2)))
    return tuple(solution.tolist()), 100.0 * float(np.sqrt(max(squares[0] - squares[1], 0.0)))


def _period_forces(run: PreparedRun) -> FloatArray:
    """Return the scored force samples [N] in whole periods, or all of them if the motion has no period."""
    force, period = run.force[run.scored_from :], (run.period_s or np.inf) / run.trajectory.step
    whole = int(len(force) / period)
    return force[: round(whole * period)] if whole else force


def starts_of_sizes(law: str, new: Sequence[Term], start: Mapping[str, float]) -> list[Mapping[str, float]]:
    """Return several copies of the start values with different sizes of the new terms, smallest last.

    The size of a term is the start value of its first coefficient.
    """
    firsts = {entry.name: start.get(entry.name, entry.start) for entry in (each.entries[0] for each in new)}
    sized = {
        name: usual
        for name, usual in firsts.items()
        if usual and LAWS[law][name].default == 0.0 and not LAWS[law][name].linear
    }
    if not sized:
        return [start]
    return [{**start, **{name: size * usual for name, usual in sized.items()}} for size in START_SIZE_RATIOS]


def default_coefficients(damper: Damper) -> set[str]:
    """Return the names of the coefficients of a damper that are constant at the default value of the law."""
    return {
        c.name
        for c, form in zip(damper.law.coefficients, damper.coefficients.values(), strict=True)
        if form.kind == "constant" and form.parameters == (c.default or 0.0,)
    }


def warm_start_from(previous: Damper, onto: Damper, free: Sequence[FreeParameter]) -> Damper:
    """Return the damper ``onto`` with start values from a fitted damper (``previous``) of the same law.

    Parameters that exist in both dampers are copied. If the dependence of a coefficient on current has a
    different type, the coefficient starts as a constant with its previous value at zero current. Coefficients
    at the default value of the law are not copied.
    """
    known, values = previous.parameters_and_lag, onto.parameters_and_lag
    defaults, shared = default_coefficients(previous), {}
    for each in free:
        name = each.name.partition(".")[0]
        if name in defaults:
            continue
        if each.name in known:
            shared[each.name] = known[each.name]
        elif name in previous.coefficients and each.name.endswith((".c00", ".value", ".c0")):
            shared[each.name] = float(previous.coefficients[name].value(0.0))
        else:
            shared[each.name] = 0.0 if each.name.rpartition(".")[2].startswith("c") else values[each.name]
    return onto.with_parameters(shared)
