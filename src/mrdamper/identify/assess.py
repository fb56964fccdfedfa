"""Judging a fit: error per run, what happens on runs that were left out, energy, passivity, plain words.

A run's ``nrmse_percent`` is 100 x RMS error / standard deviation of the measured force, from half a period
after the motion starts, at full rate, force raw, no offset removed. Beside it the same over the whole run
and with a free constant offset (force cells are not always zeroed).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.excitation import Sine, drive
from mrdamper.identify.checkpoint import CheckpointStore, NoCheckpoint, kept_pieces
from mrdamper.identify.confidence.direction import Direction, worst_direction
from mrdamper.identify.confidence.profiles import Profile, profile
from mrdamper.identify.confidence.resampling import Bootstrap, bootstrap
from mrdamper.identify.confidence.sentences import sentence
from mrdamper.identify.problem import FitProblem, FitResult, envelope_of
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

_STRONG = 0.95  # correlations beyond this are named,
_MOST_PAIRS = 4  # but no more than so many


@dataclass(frozen=True, slots=True)
class CrossValidated:
    """The errors on what was left out of a fit to the rest."""

    kind: Kind
    left_out: str
    errors: tuple[RunError, ...]


@dataclass(frozen=True, slots=True)
class Assessment:
    """The assessment of a fit.

    ``passivity_min`` is the least work that a closed cycle inside the envelope takes, over 4 x amplitude x
    peak force: negative means that the model can push. ``direction`` is the combination of parameters that
    the data pin down least; ``profile`` and ``bootstrap`` are there when asked for.
    """

    runs: tuple[RunError, ...]
    left_out: tuple[CrossValidated, ...]
    passivity_min: float
    words: tuple[str, ...]
    direction: Direction | None = None
    profile: Profile | None = None
    bootstrap: Bootstrap | None = None


def assess(  # noqa: PLR0913 - what is asked of the fit, by keyword
    result: FitResult,
    training: Sequence[PreparedRun],
    held_out: Sequence[PreparedRun] = (),
    *,
    problem: FitProblem | None = None,
    leave_out: Sequence[Kind] = (),
    profiled: bool = False,
    draws: int = 0,
    seed: int = 0,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
    pool: Pool = ONE_CORE,
) -> Assessment:
    """Return errors by run, errors on what is left out (needs ``problem``), passivity, and all in words.

    With the ``problem`` also what the data cannot tell apart; ``profiled`` follows that along its profile,
    ``draws`` is the number of bootstrap fits to runs drawn with replacement (every level kept). A
    ``checkpoint`` recalls and keeps every fit that is made for it; the ``pool`` makes them.
    """
    runs = (
        *score_each(result.damper, training, "training"),
        *score_each(result.damper, held_out, "held_out"),
    )
    left: list[CrossValidated] = []
    if leave_out and problem is None:
        raise InputError("leaving runs out means fitting again", remedy="give the problem that was fitted")
    for kind in leave_out:
        assert problem is not None
        left += cross_validate(
            _fitter(problem, result, seed),
            problem.runs,
            kind,
            on_progress=on_progress,
            checkpoint=checkpoint,
            pool=pool,
        )
    least = passivity(result.damper, training)
    found: list[Direction | Profile | Bootstrap] = []
    if problem is not None and not result.cancelled and result.damper.law.kernel is not None:
        found.append(worst_direction(problem, result))
        if profiled:
            found.append(profile(problem, result, found[0], on_progress=on_progress, checkpoint=checkpoint))  # type: ignore[arg-type]
        if draws:
            found.append(
                bootstrap(
                    problem,
                    result,
                    draws=draws,
                    seed=seed,
                    stratified=True,
                    on_progress=on_progress,
                    checkpoint=checkpoint,
                    pool=pool,
                )
            )
    words = (
        *_words(result, runs, least),
        *_edges(result, training),
        *(_nothing_left_out(kind) for kind in leave_out if not any(each.kind == kind for each in left)),
        *(sentence(each) for each in found),
    )
    return Assessment(
        runs,
        tuple(left),
        least,
        words,
        next((each for each in found if isinstance(each, Direction)), None),
        next((each for each in found if isinstance(each, Profile)), None),
        next((each for each in found if isinstance(each, Bootstrap)), None),
    )


def cross_validate(
    fit: Callable[[Sequence[PreparedRun]], Damper],
    runs: Sequence[PreparedRun],
    kind: Kind,
    *,
    folds: int | None = None,
    on_progress: Progress = silent,
    checkpoint: CheckpointStore | None = None,
    pool: Pool = ONE_CORE,
) -> list[CrossValidated]:
    """Return, for each run, current, temperature or motion, the errors on it of a fit to all the others.

    ``folds`` leaves out neighbours together where there would be more fits than that. A current or
    temperature at the edge of the range is not left out: that would be extrapolation, not a test.
    """
    labels = _temperature_labels(runs) if kind == "temperature" else {}
    checkpoint = checkpoint or NoCheckpoint()
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
    left_out = {f"without {kind} {', '.join(sorted(fold))}": frozenset(fold.tolist()) for fold in parts}

    def errors_on(left: frozenset[str]) -> dict[str, list[dict[str, Any]]]:
        damper = fit([run for run in runs if key(run) not in left])
        return {"errors": list(map(asdict, score_each(damper, [run for run in runs if key(run) in left])))}

    found = []
    for name, piece in kept_pieces(errors_on, left_out, checkpoint, pool):
        errors = tuple(RunError(**error) for error in piece["errors"])
        found.append(CrossValidated(kind, ", ".join(sorted(left_out[name])), errors))
        on_progress(ProgressUpdate(done=len(found), total=len(left_out), text=name))
    return found


def passivity(damper: Damper, runs: Sequence[PreparedRun]) -> float:
    """Return the least work of a closed cycle over 4 x amplitude x peak force, over the envelope.

    Sines from a hundredth of the stroke to the whole of it, from a fifth of the top speed to all of it,
    at five commands over the range, at the coldest and the warmest run; the second of two cycles is counted.
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
    least = np.inf
    for (amplitude, path), whole in zip(paths, simulate_each(damper, [p for _, p in paths]), strict=True):
        second = slice(len(path) // 2 + 1, None)  # a whole cycle: one of its ends counts
        work = float(whole[second] @ path.velocity[second]) * path.step
        peak = 4.0 * amplitude * float(np.abs(whole[second]).max())
        least = min(least, work / peak if peak > 0.0 else 0.0)
    return float(least)


def _fitter(problem: FitProblem, result: FitResult, seed: int) -> Callable[[Sequence[PreparedRun]], Damper]:
    """Return a function that fits the problem to other runs, from the fit's own parameters and one draw."""

    def fit(runs: Sequence[PreparedRun]) -> Damper:
        again = FitProblem(
            problem.template, problem.free, tuple(runs), problem.session_offsets, problem.rate_Hz
        )
        found = fit_variable_projection(again, starts=1, seed=seed, first=result.damper, with_errors=False)
        if found.cancelled:  # by an interrupt that it took for its own
            raise KeyboardInterrupt
        return found.damper

    return fit


def _command_label(run: PreparedRun) -> str:
    command = run.run.constant_command
    return "varying" if command is None else f"{command:g} {run.run.command_unit}"


def _traded(result: FitResult) -> list[str]:
    """Name the parameters of different coefficients that are traded against each other, the worst first."""
    names = [estimate.name for estimate in result.estimates]
    strength = np.abs(np.triu(np.nan_to_num(result.correlation), 1))
    for i, j in zip(*np.nonzero(strength), strict=True):
        if names[i].partition(".")[0] == names[j].partition(".")[0]:
            strength[i, j] = 0.0  # powers of one polynomial always are
    order = np.argsort(-strength, axis=None)[: np.count_nonzero(strength > _STRONG)]
    pairs = [divmod(int(k), len(names)) for k in order]
    said = [
        f"{names[i]} and {names[j]} are traded against each other "
        f"(correlation {result.correlation[i, j]:.2f})."
        for i, j in pairs[:_MOST_PAIRS]
    ]
    if len(pairs) > _MOST_PAIRS:
        said.append(
            f"So are {len(pairs) - _MOST_PAIRS} more pairs of parameters: see the matrix of correlations."
        )
    return said


def _temperature_labels(runs: Sequence[PreparedRun]) -> dict[str, str]:
    """Return each run's temperature level by its name, the coldest first."""
    levels = temperature_levels(runs)
    if not levels:
        raise InputError("no run has a temperature to leave out", expected="runs with a temperature channel")
    kelvin = {run.name: run.trajectory.temperature for run in runs}
    means = {name: float(np.mean(track)) for name, track in kelvin.items() if track is not None}
    return {
        name: f"{min(levels, key=lambda level: abs(level - mean)) - ZERO_CELSIUS_K:.0f} degC"
        for name, mean in sorted(means.items(), key=lambda pair: pair[1])
    }


def _edges(result: FitResult, training: Sequence[PreparedRun]) -> list[str]:
    """Return where an eliminated coefficient lies on the edge of its law's range."""
    envelope, unit = envelope_of(training), result.damper.command_unit
    kelvin = np.unique(envelope.temperature or (REFERENCE_K,))
    commands, temperatures = (g.ravel() for g in np.meshgrid(np.linspace(*envelope.command, 41), kelvin))
    said = []
    sizes: dict[str, float] = {}
    for e in result.estimates:
        if e.linear:
            sizes.setdefault(e.name.partition(".")[0], 1e-6 * abs(e.upper))
    for name, size in sizes.items():
        form = result.damper.coefficients[name]
        values = form.value(commands, temperatures)
        least = result.damper.law[name].lower
        if values.min() <= least + max(size, 3e-3 * float(np.ptp(values))):
            where = f"{commands[values.argmin()]:g} {unit}"
            if form.temperature_dependent:
                where += f" and {temperatures[values.argmin()] - ZERO_CELSIUS_K:.0f} degC"
            said.append(
                f"{name} is held at the law's limit ({least:g}) near {where}: left alone, the data would "
                "take it beyond."
            )
    return said


def _nothing_left_out(kind: Kind) -> str:
    """Return why there was no run, motion, current or temperature to leave out."""
    if kind in ("current", "temperature"):
        why = "the least and the largest stay, and the runs have none between them"
    else:
        why = "the runs have one alone"
    return f"Nothing was left out by {kind}: {why}."


def _words(result: FitResult, runs: Sequence[RunError], least: float) -> list[str]:
    """Return what a reader should know before using the parameters."""
    said = []
    for estimate in result.estimates:
        if estimate.at_bound:
            end = estimate.lower if estimate.at_bound == "lower" else estimate.upper
            said.append(
                f"{estimate.name} rests on its {estimate.at_bound} bound ({end:g} {estimate.unit}): the data "
                "ask for more than the bound or the law allows; read the fit as one with this parameter "
                "fixed."
            )
        elif not estimate.identifiable:
            percent = estimate.design_error_percent
            told = f"{percent:.0f} %" if percent < 1000.0 else "over 1000 %"
            said.append(
                f"{estimate.name} is not identifiable from these runs (standard error {told} by design): its "
                "value carries no meaning of its own."
            )
    said += _traded(result)
    if least < 0.0:
        said.append(
            "The model is not passive inside the envelope: some closed cycle returns work "
            f"({100 * least:.1f} % of 4 x amplitude x peak force)."
        )
    for error in runs:
        if error.energy_measured_J > 0.0 and abs(error.energy_model_J / error.energy_measured_J - 1.0) > 0.15:
            gap = 100.0 * (error.energy_model_J / error.energy_measured_J - 1.0)
            said.append(f"{error.name}: energy per cycle is off by {gap:+.0f} %.")
    if result.cancelled:
        said.append("The fit was interrupted: these are the best parameters so far, not converged ones.")
    return said
