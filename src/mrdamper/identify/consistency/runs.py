"""Find the runs of a campaign that deviate from the model fitted to all runs, and the cause of the deviation.

If a run has a wrong gain, delay, command or offset, its residual has a characteristic shape (``effects``).
The model itself also has errors, which depend on command and motion. Therefore the size of a cause in one run
is compared with its size in runs with the same command and motion. The difference is compared with the
scatter of all runs. The simplest sufficient cause is reported.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import DEVIATION_PER_MAD, BoolArray, FloatArray, level_numbers, rms
from mrdamper.data.finding import Finding
from mrdamper.data.prepare import PreparedRun
from mrdamper.identify.consistency.effects import ResidualAnalysis, analyse_residuals
from mrdamper.identify.consistency.groups import find_group_deviations
from mrdamper.identify.consistency.settings import SETTINGS
from mrdamper.models.damper import Damper


@dataclass(frozen=True, slots=True)
class Cause:
    """One possible cause of a deviation, with its thresholds.

    The *size* of a cause (for example a delay in seconds) is estimated for each run and compared with the
    size in comparable runs. The *deviation* of the run is the rms force that this difference explains,
    divided by the typical residual. The cause is reported only if the run exceeds all thresholds.
    """

    unit: str
    size_min: float  # min size; for a wrong command label multiplied by the command range (at least 1)
    scatter_ratio_min: float  # min deviation, divided by the scatter of the deviations of all runs
    deviation_min: float
    words: str  # message, a format string with the fields ``size`` and ``unit``
    effect: str
    remedy: str
    weight: float = 1.0  # weight in the comparison of causes; below 1 for a less common cause


# The causes are sorted from simple to complex.
CAUSES: Mapping[str, Cause] = MappingProxyType(
    {
        "force_delay": Cause(
            "s", 1.0e-3, 3.2, 0.15,
            "its force has a delay of {size:.3g} ms relative to the other runs, for example by a filter",
            "The fit describes the delay as hysteresis, so the yield displacement of the card is wrong",
            "Compare the filters and converters of this run with those of the other runs",
        ),
        "force_gain": Cause(
            "", 0.03, 2.5, 0.4,
            "its force is {size:.3f} times the force of the other runs",
            "This run changes the peak force and the viscosity of the card",
            "Check the range and amplifier of the load cell, and the current, because one run does not show "
            "which of them is wrong",
        ),
        "command_label": Cause(
            "A", 0.02, 2.5, 0.4,
            "its force equals the force of the other runs at another command, which differs by {size:+.3f} "
            "{unit} from the command of this run",
            "The force of the card is wrong near the command of this run",
            "Compare the current with the record of the current source, and check the gain of the force, "
            "because one run does not show which of them is wrong",
        ),
        "force_saturation": Cause(
            "", 0.06, 4.0, 0.4,
            "its force peaks are flatter than the peaks of the other runs, by {size:.2g} of the peak force, "
            "as with an amplifier near the end of its range",
            "Peak forces and viscosity of the card are too small",
            "Compare the range of the load cell with the peak force, and repeat the run with a larger range",
            weight=0.7,
        ),
        "force_offset_of_run": Cause(
            "N", 3.0, 6.0, 0.5,
            "its force is shifted by {size:+.4g} N relative to the force of the other runs",
            "A model without an offset cannot describe this shift, so its error is larger",
            "Zero the load cell before each run",
        ),
    }
)  # fmt: skip


def find_deviations(
    damper: Damper,
    runs: Sequence[PreparedRun],
    *,
    free: Sequence[str] = (),
    suspect: str = "",
    is_confirmed: bool = False,
) -> tuple[Finding, ...]:
    """Return findings about runs and groups of runs that deviate from the fitted model.

    Parameters
    ----------
    free : names of the fitted parameters that are not at a bound
    suspect : name of the run that was omitted from the fit because it deviated from a former fit
    is_confirmed : True if the test of the former fit reported the suspect; if False, the thresholds for
        reporting the suspect are higher
    """
    steady = _steady_runs(runs)
    if len(steady) < SETTINGS.run_count_min:
        return ()
    analysis = analyse_residuals(damper, steady, free, suspect=suspect)
    common, groups = find_group_deviations(analysis)
    if groups:
        return (*common, *groups)
    ratios = np.ones(len(steady))
    if not is_confirmed:
        ratios[[run.name == suspect for run in steady]] = SETTINGS.unfitted_ratio_min
    deviations = _deviating_runs(analysis, ratios, suspect)
    deviations |= dict(_exchanged_labels(analysis, deviations))
    return (*common, *deviations.values())


def find_suspects(
    damper: Damper, runs: Sequence[PreparedRun], *, free: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return the names of at most two suspect runs. The caller repeats the fit without each of them.

    The suspects are the run with the largest deviation and the run with the largest residual. The two
    suspects can differ if the wrong run has the slowest or the fastest motion. The model then fits the wrong
    run well and correct runs badly.
    """
    steady = _steady_runs(runs)
    if len(steady) < SETTINGS.run_count_min:
        return ()
    analysis = analyse_residuals(damper, steady, free)
    ratios = np.full(len(steady), SETTINGS.suspect_ratio_min)
    suspects = list(_deviating_runs(analysis, ratios, ""))[:1]
    levels = analysis.levels / _typical_levels(analysis)
    worst = int(np.argmax(levels))
    if levels[worst] > SETTINGS.suspect_level_ratio_min and worst not in suspects:
        suspects.append(worst)
    return tuple(steady[number].name for number in suspects)


def rms_residual(damper: Damper, runs: Sequence[PreparedRun], *, without: str) -> float:
    """Return the rms residual / standard deviation of the force, over all runs except one."""
    return rms(analyse_residuals(damper, [run for run in _steady_runs(runs) if run.name != without]).levels)


def _steady_runs(runs: Sequence[PreparedRun]) -> list[PreparedRun]:
    return [run for run in runs if run.run.constant_command is not None]


def _deviating_runs(analysis: ResidualAnalysis, ratios_min: FloatArray, suspect: str) -> dict[int, Finding]:
    """Return index and simplest sufficient cause of each deviating run, worst run first.

    ``ratios_min``, shape (runs,), multiplies the thresholds of each run. A run with a large deviation
    distorts the fit. Therefore runs with a much smaller deviation than the worst run are ignored.
    """
    runs = analysis.runs
    is_compared = np.array([run.name != suspect for run in runs])
    typical = _typical_levels(analysis)
    peers, levels = _peer_columns(runs), _command_levels(runs)
    # Values: deviation / threshold, strength of the cause, and finding. The strength is the deviation divided
    # by the typical residual, times the weight of the cause.
    deviations: dict[int, tuple[float, float, Finding]] = {}
    for kind, cause in CAUSES.items():
        effects = analysis.run_effects(kind)
        sizes = np.array([effect.size for effect in effects])
        per_size = np.array([effect.level / (abs(effect.size) or 1.0) for effect in effects]) / typical
        amounts, scatter_of_all = _amounts(sizes, per_size, peers, is_compared)
        for number, amount in enumerate(amounts.tolist()):
            same_command = is_compared & (levels == levels[number])
            scatter = scatter_of_all
            if same_command.sum() >= SETTINGS.scatter_run_count_min:
                # The model error depends on the command, so each command has its own scatter.
                mad = float(np.median(np.abs(amounts[same_command])))
                scatter = max(scatter, DEVIATION_PER_MAD * mad)
            needed = max(cause.scatter_ratio_min * scatter, cause.deviation_min)
            size = amount / (per_size[number] or 1.0)
            size_min = cause.size_min
            if kind == "command_label":
                size_min *= max(float(np.ptp(_commands(runs))), 1.0)
            elif kind == "force_delay":
                size_min = max(size_min, SETTINGS.delay_period_ratio_min * (runs[number].period_s or 0.0))
            ratio = min(abs(amount) / needed, abs(size) / size_min)
            if ratio < ratios_min[number]:
                continue
            error = max(scatter / (float(per_size[number]) or 1.0), effects[number].standard_error)
            strength = cause.weight * abs(amount)
            if number not in deviations or deviations[number][1] < SETTINGS.simple_cause_ratio_min * strength:
                deviations[number] = ratio, strength, _run_finding(runs[number], kind, size, error)
    ordered = sorted(deviations.items(), key=lambda item: -item[1][0])
    ratio_min = SETTINGS.worst_ratio_min * max((ratio for ratio, _, _ in deviations.values()), default=0.0)
    return {number: finding for number, (ratio, _, finding) in ordered if ratio > ratio_min}


def _typical_levels(analysis: ResidualAnalysis) -> FloatArray:
    """Return the typical residual of each run: the median over the runs with the same command, shape (runs,).

    Each command has its own typical residual because many models have larger errors at zero current. But a
    wrong run distorts the fit and increases the residuals of other runs with the same command. Therefore the
    typical residual is limited to a multiple of the median of all runs.
    """
    levels, typical = analysis.levels, []
    numbers = _command_levels(analysis.runs)
    median = float(np.median(levels))
    for number in numbers:
        peers = numbers == number
        level = float(np.median(levels[peers])) if peers.sum() >= SETTINGS.peer_count_min else median
        typical.append(min(level, SETTINGS.level_ratio_max * median) or 1.0)
    return np.array(typical)


def _amounts(
    sizes: FloatArray, per_size: FloatArray, peers: FloatArray, is_compared: BoolArray
) -> tuple[FloatArray, float]:
    """Return the deviation of each run from comparable runs, and the scatter of these deviations.

    The deviation is the difference between the size of the cause in a run and the typical size, times
    ``per_size``: the rms force per unit of the cause, divided by the typical residual. The typical size comes
    from runs with the same command and motion, or from all runs; the choice with less scatter is used. The
    regression uses least absolute deviations, so that a single run has hardly any influence.
    """
    results = []
    for design in (peers, np.ones((len(sizes), 1))):
        weight, rest = per_size.copy(), sizes
        for _ in range(SETTINGS.iteration_count):
            root = np.sqrt(weight * is_compared)
            peer_sizes = np.linalg.lstsq(design * root[:, None], sizes * root, rcond=None)[0]
            rest = sizes - design @ peer_sizes
            distance = np.abs(rest * per_size)
            floor = 1e-3 * float(np.median(distance)) + 1e-300
            weight = per_size**2 / np.maximum(distance, floor)
        amounts = rest * per_size
        # Least absolute deviations fit as many runs exactly as there are coefficients. These zeros contain no
        # information about the scatter.
        remaining = np.sort(np.abs(amounts[is_compared]))[int(np.linalg.matrix_rank(design)) :]
        results.append((amounts, DEVIATION_PER_MAD * float(np.median(remaining))))
    return min(results, key=lambda result: result[1])


def _peer_columns(runs: Sequence[PreparedRun]) -> FloatArray:
    """Return the regression matrix for the typical size of a cause, shape (runs, columns).

    If most combinations of command and motion are repeated, for example at several temperatures, each
    combination has a column. Otherwise each command and each motion has a column. If hardly any two runs have
    the same motion, each command has two columns: a constant, and a slope versus the logarithm of speed. A
    small campaign has only columns for the commands, or a single column.
    """
    levels, motions = _command_levels(runs).tolist(), [run.motion for run in runs]

    def columns_of(labels: Sequence[object]) -> FloatArray:
        return np.array([[label == each for each in dict.fromkeys(labels)] for label in labels], np.float64)

    commands, cells = columns_of(levels), list(zip(levels, motions, strict=True))
    design, group_count_max = commands, len(runs) / SETTINGS.peer_count_min
    if len(set(cells)) <= group_count_max:
        design = columns_of(cells)
    elif len(set(motions)) <= group_count_max:
        design = np.column_stack([commands, columns_of(motions)])
    elif commands.sum(axis=0).min() > SETTINGS.peer_count_min:
        speed = np.log([float(np.std(run.trajectory.velocity)) for run in runs])
        mean = (commands.T @ speed) / commands.sum(axis=0)
        design = np.column_stack([commands, commands * (speed[:, None] - mean)])
    for columns in (design, commands):
        if len(runs) - int(np.linalg.matrix_rank(columns)) >= SETTINGS.spare_run_count_min:
            return columns
    return np.ones((len(runs), 1))


def _commands(runs: Sequence[PreparedRun]) -> FloatArray:
    return np.array([run.run.constant_command for run in runs], dtype=np.float64)


def _command_levels(runs: Sequence[PreparedRun]) -> NDArray[np.intp]:
    """Return the group number of each run, shape (runs,); runs with equal commands have the same number."""
    commands = _commands(runs)
    return level_numbers(commands, SETTINGS.command_tolerance_ratio * (float(np.ptp(commands)) or 1.0))


def _run_finding(run: PreparedRun, kind: str, size: float, standard_error: float) -> Finding:
    cause, unit = CAUSES[kind], run.run.command_unit
    value = 1.0 + size if kind == "force_gain" else size
    return Finding(
        kind=kind,
        channel="current" if kind == "command_label" else "force",
        run=run.name,
        size=value,
        unit=unit if kind == "command_label" else cause.unit,
        found=cause.words.format(size=1e3 * size if kind == "force_delay" else value, unit=unit),
        effect=cause.effect,
        remedy=f"{cause.remedy}; until then, exclude the run",
    ).add_interval(standard_error)


def _exchanged_labels(
    analysis: ResidualAnalysis, deviations: Collection[int]
) -> Iterator[tuple[int, Finding]]:
    """Generate index and finding of each run that probably has another run's command label."""
    runs, commands = analysis.runs, _commands(analysis.runs)
    shifts_A = np.array([effect.size for effect in analysis.run_effects("command_label")])
    for a, b in permutations(deviations, 2):
        difference = float(commands[b] - commands[a])
        if difference == 0.0 or runs[a].motion != runs[b].motion:
            continue
        ratios = np.array([shifts_A[a], -shifts_A[b]]) / difference
        if SETTINGS.exchange_ratio_min < ratios.min() and ratios.max() < SETTINGS.exchange_ratio_max:
            error = abs(difference) * float(np.ptp(ratios))
            finding = _run_finding(runs[a], "command_label", difference, error)
            found = (
                f"its force belongs to the command of {runs[b].name}, and the force of that run to this "
                "command: the two commands are probably exchanged"
            )
            remedy = "Exchange the commands of the two runs, or exclude both runs until the cause is known"
            yield a, replace(finding, kind="labels_exchanged", found=found, remedy=remedy)
