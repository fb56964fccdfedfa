"""Cut measured runs into windows for a fit, and choose a subset of windows that represents all runs.

A *window* is a section of one run. The first samples of a window are a warm-up: they are simulated, so that
the hysteresis state is correct, but not scored. A fit to all data uses whole runs. The model selection uses a
subset because it evaluates thousands of models. The subset depends on the measured data only, never on the
order of the files:

1. Every run is cut into windows of about one period.
2. Each window has features: amplitude, speed, mean position, current, temperature and time along the run.
3. Greedy k-center selection (Gonzalez, Theor. Comput. Sci. 38 (1985) 293-306) adds the window that is
   farthest from all selected windows, until the number of samples reaches a limit.
4. Every window is assigned to the nearest selected window. The weight of a selected window is the sum of the
   weights of all windows that are assigned to it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.data.prepare import PreparedRun, decimate
from mrdamper.errors import InputError
from mrdamper.identify.settings import DEFAULT_SETTINGS, NUMERICS, FitSettings
from mrdamper.models.simulate import Drive, open_drive


@dataclass(frozen=True, slots=True, eq=False)
class FitWindow:
    """A section of one run that a fit simulates and scores."""

    run: int  # index of the run
    drive: Drive  # motion, current and temperature in the format of the kernel, including the warm-up
    force: FloatArray  # measured force [N], shape (n,)
    start: int  # index of the first scored sample
    fraction: float  # weight of the window in the cost; all windows of a fit sum up to 1
    weight: float  # factor of a squared force error in the cost [%^2 / N^2]
    block: int = 0  # index of the time block (larger section of the run) that contains the window


@dataclass(frozen=True, slots=True)
class _Span:
    """Sample indices of one window: warm-up from ``first``, scored from ``start`` to ``stop``."""

    run: int
    first: int
    start: int
    stop: int
    block: int


def run_fractions(runs: Sequence[PreparedRun]) -> FloatArray:
    """Return the weight of each run in the cost; all weights sum up to 1.

    All operating points (motion, current, temperature) have the same weight. The weight of a point is divided
    among its runs in proportion to their durations. A run that is stored as several files therefore has the
    same total weight as one file.
    """
    highest = max(float(np.abs(run.trajectory.command).max()) for run in runs) or 1.0
    seconds = np.array([(len(run) - run.scored_from) * run.trajectory.step for run in runs])
    features = np.array([_operating_point(run, highest) for run in runs])
    point_of = np.empty(len(runs), dtype=np.intp)
    first: list[int] = []
    for k, feature in enumerate(features):
        near = (n for n, j in enumerate(first) if np.abs(feature - features[j]).max() < 1.0)
        point_of[k] = next(near, len(first))
        if point_of[k] == len(first):
            first.append(k)
    return seconds / np.bincount(point_of, weights=seconds)[point_of] / len(first)


def _operating_point(run: PreparedRun, highest_current: float) -> tuple[float, ...]:
    """Return the features of a run, scaled so that a difference of 1 means another operating point."""
    path, part = run.trajectory, slice(run.scored_from, None)
    kelvin = 0.0 if path.temperature is None else float(path.temperature[part].mean())
    current = path.command[part] / (NUMERICS.same_current_ratio * highest_current)
    return (
        math.log(max(float(np.std(path.displacement[part])), 1e-9)) / math.log(NUMERICS.same_motion_ratio),
        math.log(max(float(np.std(path.velocity[part])), 1e-9)) / math.log(NUMERICS.same_motion_ratio),
        float(current.mean()),
        float(np.std(current)),
        kelvin / NUMERICS.same_temperature_K,
    )


def run_windows(runs: Sequence[PreparedRun], settings: FitSettings) -> tuple[FitWindow, ...]:
    """Return windows that contain all samples of all runs.

    A run is one window. If its temperature changes much, the run is cut into several windows.
    """
    windows = []
    for k, (run, fraction) in enumerate(zip(runs, run_fractions(runs), strict=True)):
        coarse = _decimate(run, settings)
        scored = len(coarse) - coarse.scored_from
        for span in _split_by_temperature(coarse, _Span(k, 0, coarse.scored_from, len(coarse), 0), settings):
            windows.append(_window(coarse, span, fraction * (span.stop - span.start) / scored))
    return tuple(windows)


def changing_sample_count(runs: Sequence[PreparedRun], settings: FitSettings) -> int:
    """Return the total number of samples of the runs with changing current, at the sampling rate of a fit."""
    changing = [run for run in runs if np.ptp(run.trajectory.command) > 0.0]
    return sum(len(_decimate(run, settings)) for run in changing)


def one_window(run: PreparedRun, run_count: int, settings: FitSettings = DEFAULT_SETTINGS) -> FitWindow:
    """Return a whole run as one window with weight 1 / ``run_count`` and the measured temperature curve."""
    coarse = _decimate(run, settings)
    window = _window(coarse, _Span(0, 0, coarse.scored_from, len(coarse), 0), 1.0 / run_count)
    return replace(window, drive=open_drive(coarse.trajectory))


def representative_windows(
    runs: Sequence[PreparedRun], settings: FitSettings, *, samples_max: float, blocks: int = 1
) -> tuple[FitWindow, ...]:
    """Return a subset of windows that represents all runs, with at most ``samples_max`` simulated samples.

    The order of the runs affects only the run indices. At least one window is returned. ``blocks`` is the
    number of equal time blocks into which each run is divided. No window extends over two blocks, and each
    block has at least one window.
    """
    coarse = [_decimate(run, settings) for run in runs]
    spans = [span for k, run in enumerate(coarse) for span in _spans(k, run, settings, blocks)]
    scored = [len(run) - run.scored_from for run in coarse]
    fractions = run_fractions(runs)
    share = np.array([fractions[s.run] * (s.stop - s.start) / scored[s.run] for s in spans])
    order, nearest = _k_center(_features(coarse, spans, settings), spans, samples_max)
    fraction = np.bincount(nearest, weights=share, minlength=len(spans))
    merged = _merge(coarse, [spans[k] for k in order], fraction[order].tolist(), settings)
    if sum(span.stop for span, _ in merged) <= samples_max:
        merged = [(replace(span, first=0), weight) for span, weight in merged]
    return tuple(_window(coarse[span.run], span, weight) for span, weight in merged)


def _decimate(run: PreparedRun, settings: FitSettings) -> PreparedRun:
    """Return the run at the sampling rate of a fit, which is lower for slow motions."""
    return decimate(run, min(settings.rate_Hz, settings.samples_per_period / _shortest_period_s(run)))


def _shortest_period_s(run: PreparedRun) -> float:
    """Return the period [s]; for an aperiodic motion, twice the 10 % quantile of the reversal intervals."""
    path = run.trajectory
    if run.period_s:
        return run.period_s
    turns = np.flatnonzero(np.diff(np.sign(path.velocity[run.scored_from :])) != 0.0)
    if len(turns) < 3:
        return len(path) * path.step
    return float(2.0 * path.step * np.quantile(np.diff(turns), 0.1))


def _window(run: PreparedRun, span: _Span, fraction: float) -> FitWindow:
    spread = float(np.std(run.force[run.scored_from :]))
    if not spread > 0.0:
        raise InputError(place=run.run.name, found="the force does not change after the motion starts")
    weight = 1e4 * fraction / (spread**2 * (span.stop - span.start))
    path = run.trajectory.part(slice(span.first, span.stop))
    if path.temperature is not None:
        mean = float(path.temperature[span.start - span.first :].mean())
        path = replace(path, temperature=np.full(len(path), mean))
    longest_step_s = max(core.LONGEST_STEP, _shortest_period_s(run) / NUMERICS.steps_per_period_min)
    drive = open_drive(path, longest_step=longest_step_s)
    force = np.ascontiguousarray(run.force[span.first : span.stop])
    return FitWindow(span.run, drive, force, span.start - span.first, fraction, weight, span.block)


def _split_by_temperature(run: PreparedRun, span: _Span, settings: FitSettings) -> list[_Span]:
    """Cut a section of a run into parts with little change of temperature, each with its own warm-up.

    The kernel is much faster at constant temperature. Each part is simulated at its mean temperature.
    """
    kelvin = run.trajectory.temperature
    if kelvin is None:
        return [span]
    scored = kelvin[span.start : span.stop]
    count = math.ceil(float(np.ptp(scored)) / settings.temperature_change_K_max - 1e-9)
    if count <= 1:
        return [span]
    level = np.floor((scored - scored.min()) / (float(np.ptp(scored)) / count))
    cuts = np.flatnonzero(np.diff(np.minimum(level, count - 1)) != 0.0) + 1
    edges = [span.start, *(span.start + cuts).tolist(), span.stop]
    warm_up = max(_period_samples(run), settings.window_samples_min)
    return [
        _Span(span.run, span.first if a == span.start else max(a - warm_up, 0), a, b, span.block)
        for a, b in itertools.pairwise(edges)
    ]


def _period_samples(run: PreparedRun) -> int:
    """Return the number of samples per period.

    For an aperiodic motion, twice the mean time between reversals counts as the period.
    """
    path = run.trajectory
    if run.period_s:
        return max(round(run.period_s / path.step), 2)
    moving = path.velocity[run.scored_from :]
    turns = int(np.count_nonzero(np.diff(np.sign(moving)) != 0.0))
    return max(round(2.0 * len(moving) / max(turns, 1)), 2)


def _spans(k: int, run: PreparedRun, settings: FitSettings, blocks: int) -> list[_Span]:
    start, stop = run.scored_from, len(run)
    period = _period_samples(run)
    length = max(period if run.period_s else 2 * period, settings.window_samples_min)
    warm_up = max(period, settings.window_samples_min)
    cuts: list[tuple[int, int, int]] = []
    edges = np.linspace(start, stop, blocks + 1).round().astype(int).tolist()
    for block, (low, high) in enumerate(itertools.pairwise(edges)):
        parts = max((high - low) // length, 1)
        ends = np.linspace(low, high, parts + 1).round().astype(int).tolist()
        cuts += [(block, a, b) for a, b in itertools.pairwise(ends) if b > a]
    spans = [_Span(k, 0 if a == start else max(a - warm_up, 0), a, b, block) for block, a, b in cuts]
    return [part for span in spans for part in _split_by_temperature(run, span, settings)]


def _features(runs: Sequence[PreparedRun], spans: Sequence[_Span], settings: FitSettings) -> FloatArray:
    """Return the features (amplitude, speed, ...) of windows, scaled, shape (windows, features).

    ``FitSettings`` defines the difference of each feature that counts as distance 1.
    """
    stroke = max(float(np.ptp(run.trajectory.displacement)) for run in runs)
    speed = max(float(np.abs(run.trajectory.velocity).max()) for run in runs)
    current = max(float(np.abs(run.trajectory.command).max()) for run in runs) or 1.0
    rows = []
    for span in spans:
        path, part = runs[span.run].trajectory, slice(span.start, span.stop)
        kelvin = 0.0 if path.temperature is None else float(path.temperature[part].mean())
        x, v = path.displacement[part], path.velocity[part]
        size = np.log(max(float(np.ptp(x)), 1e-3 * stroke)) / np.log(settings.size_ratio)
        fast = np.log(max(float(np.std(v)), 1e-3 * speed)) / np.log(settings.size_ratio)
        rows.append(
            (
                size,
                fast,
                float(x.mean()) / (settings.position_step * stroke),
                float(path.command[part].mean()) / (settings.current_step * current),
                float(np.std(path.command[part])) / (settings.current_step * current),
                kelvin / settings.temperature_step_K,
                0.5 * (span.start + span.stop) / len(path),
            )
        )
    return np.array(rows)


def _k_center(
    features: FloatArray, spans: Sequence[_Span], samples_max: float
) -> tuple[list[int], np.ndarray]:
    """Return the sorted indices of the selected windows, and the nearest selected window of every window.

    First, every time block contributes the window nearest to the median of the features. Then the window that
    is farthest from all selected windows is added repeatedly.
    """
    content = np.lexsort(features.T[::-1])  # Sorting makes the result independent of the order of the files.
    away = np.abs(features - np.median(features, axis=0)).sum(axis=1)
    distance, nearest = away.copy(), np.zeros(len(spans), dtype=np.intp)
    blocks = np.array([span.block for span in spans])
    order: list[int] = []
    while len(order) < len(spans):
        missing = content[~np.isin(blocks[content], blocks[order])]
        at = missing[np.argmin(away[missing])] if len(missing) else content[np.argmax(distance[content])]
        k = _cheapest_alike(int(at), features, spans, distance)
        if not len(missing) and sum(spans[j].stop - spans[j].first for j in [*order, k]) > samples_max:
            break
        closer = np.linalg.norm(features - features[k], axis=1)
        nearest = np.where(closer < distance, k, nearest) if order else np.full(len(spans), k)
        distance = np.minimum(distance, closer) if order else closer
        order.append(k)
        nearest[order], distance[order] = order, -1.0
    return sorted(order), nearest


def _cheapest_alike(k: int, features: FloatArray, spans: Sequence[_Span], distance: FloatArray) -> int:
    """Return the unselected window near window ``k`` with the smallest number of simulated samples.

    Only windows of the same run and time block are considered. The first window of a run has few samples
    because the run starts at rest, so that no warm-up is necessary.
    """
    near = [
        j
        for j, span in enumerate(spans)
        if span.run == spans[k].run
        and span.block == spans[k].block
        and distance[j] >= 0.0
        and np.linalg.norm(features[j] - features[k]) <= 1.0
    ]
    return min(near, key=lambda j: (spans[j].stop - spans[j].first, j))


def _merge(
    runs: Sequence[PreparedRun], spans: Sequence[_Span], fractions: Sequence[float], settings: FitSettings
) -> list[tuple[_Span, float]]:
    """Join adjacent windows (sections of a run) of one time block; return them with their weights.

    Two windows are joined if they have equal weight per sample and if the temperature of the joined window
    changes little. At constant current, the length of joined windows is limited because the kernel integrates
    several windows in parallel.
    """
    merged: list[tuple[_Span, float]] = []
    longest = sum(span.stop - span.start for span in spans) / NUMERICS.parallel_window_count
    for span, fraction in zip(spans, fractions, strict=True):
        if merged:
            last, before = merged[-1]
            joined = replace(last, stop=span.stop)
            is_short = joined.stop - joined.start <= longest or runs[span.run].run.constant_command is None
            ratio = before / (last.stop - last.start) / (fraction / (span.stop - span.start))
            if (
                is_short
                and (last.run, last.block, last.stop) == (span.run, span.block, span.start)
                and abs(ratio - 1.0) < NUMERICS.same_weight_tolerance
                and len(_split_by_temperature(runs[span.run], joined, settings)) == 1
            ):
                merged[-1] = (joined, before + fraction)
                continue
        merged.append((span, float(fraction)))
    return merged
