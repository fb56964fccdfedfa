"""Assessment of a fit: error per run, cross-validation, energy, passivity, remarks in plain words.

``nrmse_percent`` of a run is 100 x RMS error / standard deviation of the measured force. It is computed from
half a period after the motion starts, at the full sampling rate, from the raw force, without removing an
offset. Two more values are the error of the whole run, and the error with a free constant offset, because
load cells are not always zeroed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.confidence.resampling import Bootstrap, bootstrap
from mrdamper.identify.confidence.settings import DEFAULT_SETTINGS
from mrdamper.identify.problem import FitProblem, SearchResult, envelope_of
from mrdamper.identify.scores import RunError, score_each, score_run, summary
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.temperature import temperature_levels
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import simulate_each
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.runtime.pool import ONE_CORE, Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

__all__ = [
    "Assessment",
    "CrossValidated",
    "RunError",
    "assess",
    "cross_validate",
    "passivity",
    "score_run",
    "summary",
]

Kind = Literal["run", "current", "motion", "temperature"]


@dataclass(frozen=True, slots=True)
class CrossValidated:
    """The errors on the runs that were held out of a fit to the other runs."""

    kind: Kind
    left_out: str
    errors: tuple[RunError, ...]


@dataclass(frozen=True, slots=True)
class Assessment:
    """The assessment of a fit.

    Parameters
    ----------
    runs : errors of the training runs and of the held-out runs
    left_out : errors of the cross-validation
    passivity_min : minimum work of a closed cycle, divided by 4 x amplitude x peak force [-]; if it is
        negative, the model can return work
    words : remarks
    bootstrap : None unless requested
    """

    runs: tuple[RunError, ...]
    left_out: tuple[CrossValidated, ...]
    passivity_min: float
    words: tuple[str, ...]
    bootstrap: Bootstrap | None = None


def assess(  # noqa: PLR0913 - the options are keywords
    result: SearchResult,
    training: Sequence[PreparedRun],
    held_out: Sequence[PreparedRun] = (),
    *,
    problem: FitProblem | None = None,
    leave_out: Sequence[Kind] = (),
    draws: int = 0,
    seed: int = 0,
    on_progress: Progress = silent,
    pool: Pool = ONE_CORE,
) -> Assessment:
    """Compute errors by run, cross-validation errors, passivity, the bootstrap, and remarks.

    Parameters
    ----------
    problem : the problem of the fit; required for cross-validation and bootstrap
    leave_out : kinds of groups that are held out one after the other
    draws : number of bootstrap fits; each contains every current and temperature
    pool : computes the fits
    """
    runs = (
        *score_each(result.damper, training, "training"),
        *score_each(result.damper, held_out, "held_out"),
    )
    cross_validated: list[CrossValidated] = []
    if leave_out and problem is None:
        raise InputError("leaving runs out means fitting again", remedy="give the problem that was fitted")
    for kind in leave_out:
        assert problem is not None
        cross_validated += cross_validate(
            _fitter(problem, result),
            problem.runs,
            kind,
            on_progress=on_progress,
            pool=pool,
        )
    work_min = passivity(result.damper, training)
    resampled: Bootstrap | None = None
    if draws and problem is not None and not result.cancelled and result.damper.law.kernel is not None:
        resampled = bootstrap(
            problem,
            result,
            draws=draws,
            seed=seed,
            stratified=True,
            on_progress=on_progress,
            pool=pool,
        )
    validated_kinds = {group.kind for group in cross_validated}
    words = (
        *_remarks(result, runs, work_min),
        *_limit_remarks(result, training),
        *(_no_group_remark(kind) for kind in leave_out if kind not in validated_kinds),
        *(() if resampled is None else (resampled.sentence,)),
    )
    return Assessment(runs, tuple(cross_validated), work_min, words, resampled)


def cross_validate(
    fit: Callable[[Sequence[PreparedRun]], Damper],
    runs: Sequence[PreparedRun],
    kind: Kind,
    *,
    folds: int | None = None,
    on_progress: Progress = silent,
    pool: Pool = ONE_CORE,
) -> list[CrossValidated]:
    """Return the errors of each run, current, temperature or motion with a fit to all other runs.

    ``folds`` is the maximum number of fits; neighbouring groups are then held out together. The smallest and
    the largest current or temperature are not held out because the fit would have to extrapolate.
    """
    labels = _temperature_labels(runs) if kind == "temperature" else {}
    keys: dict[Kind, Callable[[PreparedRun], str]] = {
        "run": lambda r: r.name,
        "motion": lambda r: r.motion,
        "current": _command_label,
        "temperature": lambda r: labels[r.name],
    }
    key = keys[kind]
    groups = sorted({key(run) for run in runs})
    if kind == "temperature":
        groups = list(dict.fromkeys(labels.values()))[1:-1]
    if kind == "current":
        constant = sorted({c for r in runs if (c := r.run.constant_command) is not None})
        inner = {f"{c:g} {runs[0].run.command_unit}" for c in constant[1:-1]}
        groups = [g for g in groups if g in inner]
    if not groups or len({key(run) for run in runs}) < 2:
        return []
    parts = np.array_split(np.array(groups, dtype=object), min(folds or len(groups), len(groups)))
    held_out = {f"without {kind} {', '.join(sorted(fold))}": frozenset(fold.tolist()) for fold in parts}

    def errors_of(held: frozenset[str]) -> tuple[RunError, ...]:
        damper = fit([run for run in runs if key(run) not in held])
        return tuple(score_each(damper, [run for run in runs if key(run) in held]))

    validated = []
    with closing(pool.map(errors_of, list(held_out.values()))) as results:
        for (name, held), errors in zip(held_out.items(), results, strict=True):
            validated.append(CrossValidated(kind, ", ".join(sorted(held)), errors))
            on_progress(ProgressUpdate(done=len(validated), total=len(held_out), text=name))
    return validated


def passivity(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    """Return the minimum work of a closed cycle, divided by 4 x amplitude x peak force [-].

    The cycles are sines inside the envelope of the runs: 1 to 100 % of the stroke, 20 and 100 % of the
    maximum velocity, five currents, the lowest and the highest temperature. The second of two cycles is
    evaluated.
    """
    envelope = envelope_of(runs)
    stroke = max(abs(end) for end in envelope.displacement)
    speed = max(abs(end) for end in envelope.velocity)
    ends = (None,) if envelope.temperature is None else envelope.temperature
    paths = []
    for amplitude in (0.01 * stroke, 0.1 * stroke, stroke):
        for velocity in (0.2 * speed, speed):
            frequency = velocity / (2.0 * np.pi * amplitude)
            for command, kelvin in product(np.linspace(*envelope.command, 5), dict.fromkeys(ends)):
                path = drive(
                    Sine(amplitude, frequency),
                    duration=2.0 / frequency,
                    rate_Hz=500.0 * frequency,
                    command=float(command),
                    temperature=kelvin,
                )
                paths.append((amplitude, path))
    work_min = np.inf
    for (amplitude, path), force in zip(paths, simulate_each(damper, [p for _, p in paths]), strict=True):
        second = slice(len(path) // 2 + 1, None)  # A closed cycle contains only one of its two end points.
        work = float(force[second] @ path.velocity[second]) * path.step
        peak = 4.0 * amplitude * float(np.abs(force[second]).max())
        work_min = min(work_min, work / peak if peak > 0.0 else 0.0)
    return float(work_min)


def _fitter(problem: FitProblem, result: SearchResult) -> Callable[[Sequence[PreparedRun]], Damper]:
    """Return a function that fits the problem to other runs, from the fit and from one random start."""

    def fit(runs: Sequence[PreparedRun]) -> Damper:
        refit_problem = replace(problem, runs=tuple(runs))
        refit = fit_variable_projection(refit_problem, dampers=[result.damper], starts=1, with_errors=False)
        if refit.cancelled:  # The search handles an interrupt itself, but it has to end the cross-validation.
            raise KeyboardInterrupt
        return refit.damper

    return fit


def _command_label(run: PreparedRun) -> str:
    command = run.run.constant_command
    return "varying" if command is None else f"{command:g} {run.run.command_unit}"


def _correlation_remarks(result: SearchResult) -> list[str]:
    """Name strongly correlated parameters of different coefficients, the strongest correlation first."""
    names = [estimate.name for estimate in result.estimates]
    strength = np.abs(np.triu(np.nan_to_num(result.correlation), 1))
    for i, j in zip(*np.nonzero(strength), strict=True):
        if names[i].partition(".")[0] == names[j].partition(".")[0]:
            strength[i, j] = 0.0  # The terms of one polynomial are always correlated.
    settings = DEFAULT_SETTINGS
    count = np.count_nonzero(strength > settings.correlation_min)
    pairs = [divmod(int(k), len(names)) for k in np.argsort(-strength, axis=None)[:count]]
    remarks = [
        f"{names[i]} and {names[j]} are strongly correlated ({result.correlation[i, j]:.2f}): the runs "
        "determine them together, not separately."
        for i, j in pairs[: settings.correlations_max_count]
    ]
    if len(pairs) > settings.correlations_max_count:
        more = len(pairs) - settings.correlations_max_count
        remarks.append(f"{more} more pairs of parameters are strongly correlated: see the matrix.")
    return remarks


def _temperature_labels(runs: Sequence[PreparedRun]) -> dict[str, str]:
    """Return the temperature level of each run by the run's name, the coldest first."""
    levels = temperature_levels(runs)
    if not levels:
        raise InputError("no run has a temperature to leave out", expected="runs with a temperature channel")
    kelvin = {run.name: run.trajectory.temperature for run in runs}
    means = {name: float(np.mean(track)) for name, track in kelvin.items() if track is not None}
    return {
        name: f"{min(levels, key=lambda level: abs(level - mean)) - ZERO_CELSIUS_K:.0f} degC"
        for name, mean in sorted(means.items(), key=lambda pair: pair[1])
    }


def _limit_remarks(result: SearchResult, training: Sequence[PreparedRun]) -> list[str]:
    """Name the linear coefficients that are at the limit of their admissible range."""
    envelope, unit = envelope_of(training), result.damper.command_unit
    kelvin = np.unique(envelope.temperature or (REFERENCE_K,))
    commands, temperatures = (g.ravel() for g in np.meshgrid(np.linspace(*envelope.command, 41), kelvin))
    remarks = []
    tolerances: dict[str, float] = {}
    for e in result.estimates:
        if e.linear:
            tolerances.setdefault(e.name.partition(".")[0], 1e-6 * abs(e.upper))
    for name, tolerance in tolerances.items():
        form = result.damper.coefficients[name]
        values = form.value(commands, temperatures)
        lower = result.damper.law[name].lower
        if values.min() <= lower + max(tolerance, 3e-3 * float(np.ptp(values))):
            location = f"{commands[values.argmin()]:g} {unit}"
            if form.temperature_dependent:
                location += f" and {temperatures[values.argmin()] - ZERO_CELSIUS_K:.0f} degC"
            remarks.append(
                f"{name} is at the limit of the model ({lower:g}) near {location}: without the limit, the "
                "fit would exceed it."
            )
    return remarks


def _no_group_remark(kind: Kind) -> str:
    """Return the reason why no run, motion, current or temperature was held out."""
    if kind in ("current", "temperature"):
        return (
            f"Cross-validation by {kind} needs at least one {kind} between the smallest and the largest: the "
            "runs contain none."
        )
    return f"Cross-validation by {kind} needs at least two {kind}s: the runs contain one."


def _remarks(result: SearchResult, runs: Sequence[RunError], work_min: float) -> list[str]:
    """Return remarks on parameters, correlations, passivity and energy."""
    remarks = []
    for estimate in result.estimates:
        if estimate.at_bound:
            bound = estimate.lower if estimate.at_bound == "lower" else estimate.upper
            remarks.append(
                f"{estimate.name} is on its {estimate.at_bound} bound ({bound:g} {estimate.unit}): the best "
                "value is beyond the bound or the model's range. The other parameters were fitted with this "
                "value."
            )
        elif not estimate.identifiable:
            percent = estimate.design_error_percent
            limit = f"{percent:.0f} %" if percent < 1000.0 else "over 1000 %"
            remarks.append(
                f"{estimate.name} is not identifiable from these runs (standard error {limit} by design): "
                "its value has no physical meaning."
            )
    remarks += _correlation_remarks(result)
    if work_min < 0.0:
        remarks.append(
            "The model is not passive inside the envelope: at least one closed cycle returns work "
            f"({100 * work_min:.1f} % of 4 x amplitude x peak force)."
        )
    for error in runs:
        if not error.energy_measured_J > 0.0:
            continue
        difference = error.energy_model_J / error.energy_measured_J - 1.0
        if abs(difference) > DEFAULT_SETTINGS.energy_error_max:
            remarks.append(f"{error.name}: the energy per cycle differs by {100.0 * difference:+.0f} %.")
    if result.cancelled:
        remarks.append("The fit was interrupted: the parameters are the best so far and have not converged.")
    return remarks
