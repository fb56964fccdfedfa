"""Find deviations of groups of runs, or of all runs: two dampers, drift, a delay of the force channel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding, percent
from mrdamper.identify.consistency.effects import Effect, ResidualAnalysis
from mrdamper.identify.consistency.settings import DEFAULTS, ConsistencySettings

NAME_COUNT_MAX = 4  # names of runs in one message


@dataclass(frozen=True, slots=True)
class GroupDeviation:
    """A finding, and the fraction of the mean square of the residual that it explains."""

    finding: Finding
    fraction: float


def find_group_deviations(
    analysis: ResidualAnalysis, settings: ConsistencySettings = DEFAULTS
) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Return findings about all runs, and about groups of runs: in both cases the simplest sufficient cause.

    If a group is late, the fit makes the others early and all together slightly late. Therefore only the
    better explanation is reported for two delays. A second cause is ignored if it explains much less than the
    first.
    """
    common = list(_common_deviations(analysis, settings))
    groups = list(_group_deviations(analysis, settings))
    has_late_group = any(each.finding.kind == "group_delay" for each in groups)
    ratio = 1.0 if has_late_group else settings.second_cause_ratio_min
    fraction_min = ratio * max((each.fraction for each in (*common, *groups)), default=0.0)
    return (
        tuple(each.finding for each in common if each.fraction >= fraction_min),
        tuple(each.finding for each in groups if each.fraction >= fraction_min),
    )


def _group_deviations(analysis: ResidualAnalysis, settings: ConsistencySettings) -> Iterator[GroupDeviation]:
    gains = [
        *_sessions(analysis, settings),
        *_two_groups(analysis, "force_gain", settings),
        *_drift(analysis, settings),
    ]
    delays = list(_two_groups(analysis, "force_delay", settings))
    yield from sorted([*gains[:1], *delays], key=lambda each: -each.fraction)[:1]


def _sizes(analysis: ResidualAnalysis, kind: str) -> FloatArray:
    return np.array([analysis.run_effect(number, kind).size for number in range(len(analysis.runs))])


def _common_deviations(analysis: ResidualAnalysis, settings: ConsistencySettings) -> Iterator[GroupDeviation]:
    """Yield a delay or a filter of the force of all runs; one frequency hardly distinguishes them."""
    delay, pole = analysis.common_effect("force_delay"), analysis.common_effect("force_bandwidth")
    is_filter = pole.size > 0.0 and pole.fraction > settings.filter_ratio_min * delay.fraction
    effect = pole if is_filter else delay
    if abs(effect.size) < settings.common_delay_min_s or effect.fraction < settings.common_fraction_min:
        return
    if _is_single_run(analysis, "force_delay", effect, settings):
        return
    if is_filter:
        words = f"filtered at about {1.0 / (2.0 * np.pi * effect.size):.2g} Hz"
    else:
        words = f"{1e3 * abs(effect.size):.2g} ms {'late' if effect.size > 0.0 else 'early'}"
    finding = Finding(
        kind="common_bandwidth" if is_filter else "common_delay",
        severity="warning",
        channel="force",
        size=effect.size,
        unit="s",
        found=f"the force of all runs together is {words} relative to the displacement, and the hysteresis "
        "of the model does not explain it",
        effect="Yield displacement and viscosity include the lag of the channel",
        remedy="Give both channels the same filter and converter, or shift the force by the delay",
    ).within(effect.standard_error)
    yield GroupDeviation(finding, effect.fraction)


def _sessions(analysis: ResidualAnalysis, settings: ConsistencySettings) -> Iterator[GroupDeviation]:
    """Yield sessions of several runs in which the gain differs from the gain in the other sessions."""
    gains = _sizes(analysis, "force_gain")
    names = np.array([run.run.session for run in analysis.runs])
    large = [name for name, count in Counter(names.tolist()).items() if count >= settings.peer_count_min]
    for name in large:
        sizes = gains[names == name]
        others = gains[np.isin(names, large) & (names != name)]
        if len(others) < settings.peer_count_min:
            continue
        gain = float(np.median(sizes) - np.median(others))
        scatter = rms(np.concatenate([sizes - np.median(sizes), others - np.median(others)]))
        error = scatter * float(np.sqrt(1.0 / len(sizes) + 1.0 / len(others)))
        if abs(gain) < max(settings.gain_difference_min, settings.session_error_ratio_min * error):
            continue
        fraction = analysis.common_effect("force_gain", (names == name).astype(np.float64)).fraction
        finding = _group_finding("session_gain", len(sizes), gain, error, f"of session {name!r}")
        yield GroupDeviation(finding, fraction)


def _two_groups(
    analysis: ResidualAnalysis, kind: str, settings: ConsistencySettings
) -> Iterator[GroupDeviation]:
    """Yield the smaller of two groups of runs whose gains, or delays, are clearly separated."""
    is_delay = kind == "force_delay"
    numbers, values = _well_determined(analysis, kind, settings), _sizes(analysis, kind)
    order = numbers[np.argsort(values[numbers])]
    sizes = values[order]
    if len(sizes) < 2 * settings.peer_count_min:
        return
    cut = int(np.argmax(np.diff(sizes))) + 1
    low, high = sizes[:cut], sizes[cut:]
    difference = float(high.mean() - low.mean())
    scatter = rms(np.concatenate([low - low.mean(), high - high.mean()]))
    smallest = settings.group_delay_min_s if is_delay else settings.gain_difference_min
    if min(len(low), len(high)) < settings.peer_count_min:
        return
    if difference < max(smallest, settings.group_scatter_ratio_min * scatter):
        return
    group = order[:cut] if len(low) < len(high) else order[cut:]
    effect = analysis.common_effect(kind, np.isin(np.arange(len(values)), group).astype(np.float64))
    if effect.fraction < analysis.common_effect(kind, _ramp(analysis)).fraction:
        return  # It is a drift.
    error = scatter * float(np.sqrt(1.0 / len(low) + 1.0 / len(high)))
    names = ", ".join(analysis.runs[number].name for number in sorted(group.tolist())[:NAME_COUNT_MAX])
    which = f"({names}{' ...' * (len(group) > NAME_COUNT_MAX)})"
    finding = _group_finding(
        "group_delay" if is_delay else "two_groups", len(group), effect.size, error, which
    )
    yield GroupDeviation(finding, effect.fraction)


def _group_finding(kind: str, count: int, size: float, error: float, which: str) -> Finding:
    """Return the finding about a group with another delay, or with another gain."""
    if kind == "group_delay":
        difference = (
            f"is {1e3 * abs(size):.2g} ms {'later' if size > 0.0 else 'earlier'} than that of the others"
        )
        effect = "Yield displacement and viscosity of the card are between those of the two groups"
        remedy = "Compare filters and converters of the two groups; fit them separately until then"
    else:
        difference = (
            f"is {percent(abs(size))} {'larger' if size > 0.0 else 'smaller'} than that of the others"
        )
        effect = "One card is fitted to two dampers, two temperatures or two calibrations"
        remedy = "Fit the two groups separately and compare the cards; record the temperature"
    return Finding(
        kind=kind,
        severity="warning",
        channel="force",
        size=size if kind == "group_delay" else 1.0 + size,
        unit="s" if kind == "group_delay" else "",
        found=f"the force of the {count} runs {which} {difference}",
        effect=effect,
        remedy=remedy,
    ).within(error)


def _drift(analysis: ResidualAnalysis, settings: ConsistencySettings) -> Iterator[GroupDeviation]:
    """Yield a force that increases or decreases from run to run, in the given order of runs."""
    count = len(analysis.runs)
    effect = analysis.common_effect("force_gain", _ramp(analysis))
    if count < 2 * settings.peer_count_min or abs(effect.size) < settings.gain_difference_min:
        return
    if effect.fraction < settings.drift_fraction_min:
        return
    if _is_single_run(analysis, "force_gain", effect, settings):
        return
    finding = Finding(
        kind="campaign_drift",
        severity="warning",
        channel="force",
        size=effect.size,
        found=f"the force {'grows' if effect.size > 0.0 else 'falls'} by {percent(abs(effect.size))} from "
        f"the first to the last of the {count} runs, at the same command and motion",
        effect="The card is valid for the middle of the campaign, and its error is the drift",
        remedy="Record the temperature with each run (a damper that heats loses force), or check the "
        "amplifier for drift; repeat the first run at the end",
    ).within(effect.standard_error)
    yield GroupDeviation(finding, effect.fraction)


def _ramp(analysis: ResidualAnalysis) -> FloatArray:
    """Return factors that increase by one from the first run to the last."""
    return np.linspace(-0.5, 0.5, len(analysis.runs))


def _is_single_run(
    analysis: ResidualAnalysis, kind: str, effect: Effect, settings: ConsistencySettings
) -> bool:
    """Return True if one run alone explains as much as the effect of all runs."""
    count = len(analysis.runs)
    largest = max(analysis.run_effect(number, kind).level for number in range(count))
    return largest > settings.single_run_ratio_min * effect.level * float(np.sqrt(count))


def _well_determined(
    analysis: ResidualAnalysis, kind: str, settings: ConsistencySettings
) -> NDArray[np.intp]:
    """Return the numbers of the runs in which the size of a cause has a small standard error.

    A run without force, for example, contains no information about the gain.
    """
    errors = [analysis.run_effect(number, kind).standard_error for number in range(len(analysis.runs))]
    return np.flatnonzero(np.array(errors) <= settings.error_ratio_max * float(np.median(errors)))
