"""Find the runs of a campaign that deviate from the model that was fitted to all of them, with the cause.

A fit reproduces a campaign in which one run has a wrong gain, delay, command or offset nearly as well as a
consistent one. The residual of the wrong run, however, has the shape of its cause (``effects``). A model has
small errors at each command and each motion. Therefore a size is compared with the sizes in the runs of the
same command and the same motion, and with the scatter of all runs. The simplest sufficient cause is reported.

Held-out runs have no influence on the fit or on the comparison of the fitted runs. If they deviate, the
finding states that they differ from the fitted model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import BoolArray, FloatArray, rms
from mrdamper.data.finding import Finding
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.causes import CAUSES, HELD_OUT_EFFECT, min_size
from mrdamper.identify.consistency.effects import ResidualAnalysis, analyse_residuals
from mrdamper.identify.consistency.groups import find_group_deviations
from mrdamper.identify.consistency.settings import DEFAULTS, ConsistencySettings
from mrdamper.models.damper import Damper

STANDARD_DEVIATION_PER_MAD = 1.4826  # of a normal distribution


@dataclass(frozen=True, slots=True)
class Deviation:
    """Deviation of one run from comparable runs by one cause."""

    kind: str
    size: float
    standard_error: float
    ratio: float  # divided by the threshold of the cause: reported from 1 on
    strength: float  # in typical residuals, times the weight of the cause


def find_deviations(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    free: Sequence[str] = (),
    held_out: Collection[str] = (),
    suspect: str = "",
    is_confirmed: bool = False,
    settings: ConsistencySettings = DEFAULTS,
) -> tuple[Finding, ...]:
    """Return findings about runs and groups of runs that deviate from the fitted model.

    Parameters
    ----------
    damper : fitted to the runs that are neither held out nor the suspect
    free : its fitted parameters
    held_out : names of runs that are compared with the model only
    suspect : name of the run that was omitted from the fit because it deviated from a former fit
    is_confirmed : the former fit reported the suspect; otherwise the suspect needs a larger deviation
    """
    steady = _steady_runs(runs)
    fitted = [number for number, run in enumerate(steady) if run.name not in held_out]
    if len(fitted) < settings.run_count_min:
        return ()
    analysis = analyse_residuals(damper, steady, free, held_out=held_out, suspect=suspect)
    common, groups = find_group_deviations(analysis.subset(fitted), settings)
    if groups:
        return (*common, *groups)
    ratios = np.array([settings.unfitted_ratio_min if run.name in held_out else 1.0 for run in steady])
    if not is_confirmed:
        ratios[[run.name == suspect for run in steady]] = settings.unfitted_ratio_min
    deviations = _deviating_runs(analysis, ratios, held_out, suspect, settings)
    exchanged = dict(_exchanged_labels(analysis, deviations, held_out, settings))
    return common + tuple(
        exchanged.get(number)
        or _run_finding(steady[number], deviation, is_held_out=steady[number].name in held_out)
        for number, deviation in deviations.items()
    )


def find_suspects(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    free: Sequence[str] = (),
    settings: ConsistencySettings = DEFAULTS,
) -> tuple[str, ...]:
    """Return the names of at most two runs to be omitted from a second fit, one at a time.

    These are the run with the largest deviation and the run with the largest residual. At the end of a series
    of motions they may differ, because the fit follows a wrong run there and deviates from correct runs.
    """
    steady = _steady_runs(runs)
    if len(steady) < settings.run_count_min:
        return ()
    analysis = analyse_residuals(damper, steady, free)
    ratios = np.full(len(steady), settings.suspect_ratio_min)
    suspects = list(_deviating_runs(analysis, ratios, (), "", settings))[:1]
    levels = analysis.levels / _typical_levels(analysis, np.ones(len(steady), dtype=bool), settings)
    worst = int(np.argmax(levels))
    if levels[worst] > settings.suspect_level_ratio_min and worst not in suspects:
        suspects.append(worst)
    return tuple(steady[number].name for number in suspects)


def rms_residual(damper: Damper, runs: Sequence[PreparedRun], *, without: str) -> float:
    """Return the rms residual of all runs except one, divided by the spread of their forces."""
    return rms(analyse_residuals(damper, [run for run in _steady_runs(runs) if run.name != without]).levels)


def _steady_runs(runs: Sequence[PreparedRun]) -> list[PreparedRun]:
    return [run for run in runs if run.run.constant_command is not None]


def _deviating_runs(
    analysis: ResidualAnalysis,
    ratios_min: FloatArray,
    held_out: Collection[str],
    suspect: str,
    settings: ConsistencySettings,
) -> dict[int, Deviation]:
    """Return the numbers of the deviating runs, worst first, each with its simplest cause.

    ``ratios_min`` holds the factor on the thresholds for each run. A run with a large deviation distorts the
    fit. Therefore runs with less than half of the largest deviation are ignored. A held-out run does not
    distort it.
    """
    runs = analysis.runs
    is_own = np.array([run.name not in held_out for run in runs])
    is_compared = is_own & np.array([run.name != suspect for run in runs])
    typical = _typical_levels(analysis, is_own, settings)
    peers, level_numbers = _peer_columns(runs, is_own, settings), _command_levels(runs, is_own, settings)
    command_range = float(np.ptp(_commands(runs)[is_own]))
    deviations: dict[int, Deviation] = {}
    for kind in CAUSES:
        limits = settings.limits[kind]
        effects = [analysis.run_effect(number, kind) for number in range(len(runs))]
        sizes = np.array([effect.size for effect in effects])
        per_size = np.array([effect.level / (abs(effect.size) or 1.0) for effect in effects]) / typical
        amounts, scatter_of_all = _amounts(sizes, per_size, peers, is_own, is_compared, settings)
        for number, amount in enumerate(amounts.tolist()):
            same_command = is_compared & (level_numbers == level_numbers[number])
            scatter = scatter_of_all
            if same_command.sum() >= settings.scatter_run_count_min:
                # The model error depends on the command.
                mad = float(np.median(np.abs(amounts[same_command])))
                scatter = max(scatter, STANDARD_DEVIATION_PER_MAD * mad)
            needed = max(limits.scatter_ratio_min * scatter, limits.deviation_min)
            size = amount / (per_size[number] or 1.0)
            ratio = min(
                abs(amount) / needed, abs(size) / min_size(kind, runs[number], command_range, settings)
            )
            if ratio < ratios_min[number]:
                continue
            error = max(scatter / (float(per_size[number]) or 1.0), effects[number].standard_error)
            deviation = Deviation(kind, size, error, ratio, limits.weight * abs(amount))
            former = deviations.get(number)
            if former is None or former.strength < settings.simple_cause_ratio_min * deviation.strength:
                deviations[number] = deviation
    worst = max((each.ratio for number, each in deviations.items() if is_own[number]), default=0.0)
    ordered = sorted(deviations.items(), key=lambda item: -item[1].ratio)
    return {number: each for number, each in ordered if each.ratio > settings.worst_ratio_min * worst}


def _typical_levels(
    analysis: ResidualAnalysis, is_own: BoolArray, settings: ConsistencySettings
) -> FloatArray:
    """Return the typical residual for each run: the median of the fitted runs of the same command.

    Without current, many models have larger errors. A wrong run, however, increases the residuals of all runs
    of its command. Therefore the value is limited to a multiple of the median of all runs.
    """
    levels, typical = analysis.levels, []
    numbers = _command_levels(analysis.runs, is_own, settings)
    median = float(np.median(levels[is_own]))
    for number in range(len(levels)):
        peers = is_own & (numbers == numbers[number])
        level = float(np.median(levels[peers])) if peers.sum() >= settings.peer_count_min else median
        typical.append(min(level, settings.level_ratio_max * median) or 1.0)
    return np.array(typical)


def _amounts(
    sizes: FloatArray,
    per_size: FloatArray,
    peers: FloatArray,
    is_own: BoolArray,
    is_compared: BoolArray,
    settings: ConsistencySettings = DEFAULTS,
) -> tuple[FloatArray, float]:
    """Return the deviation of each run from its peers in typical residuals, and the scatter.

    The sizes of the peers are estimated by least absolute deviations. One run of many has hardly any
    influence on them. Runs are compared with their peers by command and motion, or with all runs, whichever
    has less scatter.
    """
    best: tuple[FloatArray, float] | None = None
    for design in (peers, np.ones((len(sizes), 1))):
        weight, rest = per_size.copy(), sizes
        for _ in range(settings.iteration_count):
            root = np.sqrt(weight * is_compared)
            peer_sizes = np.linalg.lstsq(design * root[:, None], sizes * root, rcond=None)[0]
            rest = sizes - design @ peer_sizes
            distance = np.abs(rest * per_size)
            floor = 1e-3 * float(np.median(distance[is_own])) + 1e-300
            weight = per_size**2 / np.maximum(distance, floor)
        amounts = rest * per_size
        # As many deviations as there are levels vanish. They contain no information about the scatter.
        rank = int(np.linalg.matrix_rank(design[is_own]))
        remaining = np.sort(np.abs(amounts[is_compared]))[rank:]
        scatter = STANDARD_DEVIATION_PER_MAD * float(np.median(remaining))
        if best is None or scatter < best[1]:
            best = amounts, scatter
    assert best is not None
    return best


def _peer_columns(
    runs: Sequence[PreparedRun], is_own: BoolArray, settings: ConsistencySettings = DEFAULTS
) -> FloatArray:
    """Return the regression columns of the typical size of a cause, shape (runs, columns).

    A campaign at several temperatures has runs of the same command and motion: each such cell is a column.
    Otherwise there are columns for the commands and for the motions. If hardly any two runs have the same
    motion, each command has a slope with the logarithm of speed instead. If there are too few runs, only the
    commands are used, or one column for all runs. The fitted runs alone decide.
    """
    count, levels = int(is_own.sum()), _command_levels(runs, is_own, settings)
    own = np.flatnonzero(is_own).tolist()
    commands = np.array([levels == level for level in sorted({levels[k] for k in own})], dtype=np.float64).T
    run_cells = list(zip(levels.tolist(), (run.motion for run in runs), strict=True))
    cells, motions = sorted({run_cells[k] for k in own}), sorted({runs[k].motion for k in own})
    design = commands
    if len(cells) <= count / settings.peer_count_min:
        design = np.array(
            [[cell == own_cell for cell in run_cells] for own_cell in cells], dtype=np.float64
        ).T
    elif len(motions) <= count / settings.peer_count_min:
        columns = np.array([[run.motion == motion for run in runs] for motion in motions], dtype=np.float64).T
        design = np.column_stack([commands, columns])
    elif commands[own].sum(axis=0).min() > settings.peer_count_min:
        speed = np.log([float(np.std(run.trajectory.velocity)) for run in runs])
        mean = (commands[own].T @ speed[own]) / commands[own].sum(axis=0)
        design = np.column_stack([commands, commands * (speed[:, None] - mean)])
    for columns in (design, commands):
        if count - int(np.linalg.matrix_rank(columns[own])) >= settings.spare_run_count_min:
            return columns
    return np.ones((len(runs), 1))


def _commands(runs: Sequence[PreparedRun]) -> FloatArray:
    return np.array([run.run.constant_command for run in runs], dtype=np.float64)


def _command_levels(
    runs: Sequence[PreparedRun], is_own: BoolArray, settings: ConsistencySettings = DEFAULTS
) -> NDArray[np.intp]:
    """Return the number of each run's command among the different commands of the fitted runs, or -1."""
    commands = _commands(runs)
    own = np.sort(commands[is_own])
    tolerance = settings.command_tolerance_ratio * (float(np.ptp(own)) or 1.0)
    starts = own[np.concatenate([[True], np.diff(own) > tolerance])]
    levels = np.maximum(np.searchsorted(starts, commands, side="right") - 1, 0)
    distances = np.abs(commands[:, None] - own).min(axis=1)
    return np.where(distances <= tolerance, levels, -1)


def _run_finding(run: PreparedRun, deviation: Deviation, *, is_held_out: bool = False) -> Finding:
    """Return the finding about one run."""
    kind, size = deviation.kind, deviation.size
    cause, unit = CAUSES[kind], run.run.command_unit
    value = 1.0 + size if kind == "force_gain" else size
    words = cause.words.format(
        size=1e3 * size if kind == "force_delay" else value,
        unit=unit,
        reference="the fitted model" if is_held_out else "the other runs",
    )
    return Finding(
        kind=kind,
        severity="warning",
        channel="current" if kind == "command_label" else "force",
        run=run.name,
        size=value,
        unit=unit if kind == "command_label" else cause.unit,
        found=("the run is held out and differs from the fitted model: " if is_held_out else "") + words,
        effect=HELD_OUT_EFFECT if is_held_out else cause.effect,
        remedy=f"{cause.remedy}; if it is right, the model is not valid for this run"
        if is_held_out
        else f"{cause.remedy}; until then leave the run out",
    ).within(deviation.standard_error)


def _exchanged_labels(
    analysis: ResidualAnalysis,
    deviations: Mapping[int, Deviation],
    held_out: Collection[str],
    settings: ConsistencySettings,
) -> Iterator[tuple[int, Finding]]:
    """Yield deviating runs that have the force of each other's command, with the finding."""
    runs = analysis.runs
    for a in deviations:
        for b in deviations:
            one, other = (runs[number].run.constant_command for number in (a, b))
            if a == b or one is None or other is None or runs[a].motion != runs[b].motion or one == other:
                continue
            difference = other - one
            shifts = [
                sign * analysis.run_effect(number, "command_label").size / difference
                for number, sign in ((a, 1.0), (b, -1.0))
            ]
            if min(shifts) <= settings.exchange_ratio_min or max(shifts) >= settings.exchange_ratio_max:
                continue
            error = abs(difference) * abs(shifts[0] - shifts[1])
            deviation = Deviation("command_label", difference, error, 1.0, 1.0)
            finding = _run_finding(runs[a], deviation, is_held_out=runs[a].name in held_out)
            yield (
                a,
                replace(
                    finding,
                    kind="labels_exchanged",
                    found=f"it has the force of {runs[b].name}'s command, and that run its own: "
                    "the two seem to be exchanged",
                    remedy="Exchange the two files' commands, or leave both out until it is known",
                ),
            )
