"""Find deviations that several runs have in common: two dampers, drift, or a delay of the force channel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding, percent
from mrdamper.identify.consistency.effects import Effect, ResidualAnalysis
from mrdamper.identify.consistency.settings import SETTINGS

NAME_COUNT_MAX = 4  # max number of run names in one message


def find_group_deviations(analysis: ResidualAnalysis) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Return two tuples: findings about all runs together, and findings about groups of runs.

    A cause is ignored if it explains a much smaller fraction of the mean squared residual than the best
    cause. If the forces of some runs are delayed, the forces of all runs together also appear slightly late.
    Therefore, a delay of a group of runs and a delay of all runs are not reported together, but only the
    better explanation.
    """
    common = list(_common_deviations(analysis))
    gains = [*_two_groups(analysis, "force_gain"), *_drift(analysis)]
    groups = [*gains[:1], *_two_groups(analysis, "force_delay")]
    groups = sorted(groups, key=lambda group: -group[0])[:1]
    has_late_group = any(finding.kind == "group_delay" for _, finding in groups)
    ratio = 1.0 if has_late_group else SETTINGS.second_cause_ratio_min
    fraction_min = ratio * max((fraction for fraction, _ in (*common, *groups)), default=0.0)
    return (
        tuple(finding for fraction, finding in common if fraction >= fraction_min),
        tuple(finding for fraction, finding in groups if fraction >= fraction_min),
    )


def _common_deviations(analysis: ResidualAnalysis) -> Iterator[tuple[float, Finding]]:
    """Generate the finding that the force of all runs is delayed or filtered.

    At a single frequency, a delay and a filter have nearly the same effect. Therefore a filter has to explain
    clearly more than a delay.
    """
    delay, pole = analysis.common_effect("force_delay"), analysis.common_effect("force_bandwidth")
    is_filter = pole.size > 0.0 and pole.fraction > SETTINGS.filter_ratio_min * delay.fraction
    effect = pole if is_filter else delay
    if abs(effect.size) < SETTINGS.common_delay_min_s or effect.fraction < SETTINGS.common_fraction_min:
        return
    if _is_single_run(analysis, "force_delay", effect):
        return
    if is_filter:
        words = f"filtered at about {1.0 / (2.0 * np.pi * effect.size):.2g} Hz"
    else:
        words = f"{1e3 * abs(effect.size):.2g} ms {'late' if effect.size > 0.0 else 'early'}"
    finding = Finding(
        kind="common_bandwidth" if is_filter else "common_delay",
        channel="force",
        size=effect.size,
        unit="s",
        found=f"the force of all runs is {words} relative to the displacement, beyond the hysteresis of the "
        "model",
        effect="Yield displacement and viscosity of the card include the lag of the force channel",
        remedy="Use the same filter and converter for both channels, or shift the force by the delay",
    )
    yield effect.fraction, finding.add_interval(effect.standard_error)


def _two_groups(analysis: ResidualAnalysis, kind: str) -> Iterator[tuple[float, Finding]]:
    """Generate the finding that the runs form two groups with clearly different gains or delays.

    The finding describes the smaller group. Runs are ignored if the standard error of their gain or delay is
    large. For example, a run without force contains no information about the gain.
    """
    effects = analysis.run_effects(kind)
    values, errors = np.array([(effect.size, effect.standard_error) for effect in effects]).T
    numbers = np.flatnonzero(errors <= SETTINGS.error_ratio_max * np.median(errors))
    order = numbers[np.argsort(values[numbers])]
    sizes = values[order]
    if len(sizes) < 2 * SETTINGS.peer_count_min:
        return
    cut = int(np.argmax(np.diff(sizes))) + 1
    low, high = sizes[:cut], sizes[cut:]
    scatter = rms(np.concatenate([low - low.mean(), high - high.mean()]))
    smallest = SETTINGS.group_delay_min_s if kind == "force_delay" else SETTINGS.gain_difference_min
    difference_min = max(smallest, SETTINGS.group_scatter_ratio_min * scatter)
    if min(len(low), len(high)) < SETTINGS.peer_count_min or high.mean() - low.mean() < difference_min:
        return
    group = order[:cut] if len(low) < len(high) else order[cut:]
    effect = analysis.common_effect(kind, np.isin(np.arange(len(values)), group).astype(np.float64))
    if effect.fraction < analysis.common_effect(kind, _ramp(analysis)).fraction:
        return  # A drift explains the residuals better than two groups.
    names = ", ".join(analysis.runs[number].name for number in sorted(group.tolist())[:NAME_COUNT_MAX])
    which = f"the {len(group)} runs ({names}{' ...' * (len(group) > NAME_COUNT_MAX)})"
    size, is_larger = effect.size, effect.size > 0.0
    if kind == "force_delay":
        finding = Finding(
            kind="group_delay",
            channel="force",
            size=size,
            unit="s",
            found=f"the force of {which} is {1e3 * abs(size):.2g} ms {'later' if is_larger else 'earlier'} "
            "than the force of the other runs",
            effect="Yield displacement and viscosity of the card are between the values of the two groups",
            remedy="Compare the filters and converters of the two groups; until then, fit the groups "
            "separately",
        )
    else:
        finding = Finding(
            kind="two_groups",
            channel="force",
            size=1.0 + size,
            found=f"the force of {which} is {percent(abs(size))} {'larger' if is_larger else 'smaller'} "
            "than the force of the other runs",
            effect="One card is fitted to two dampers, two temperatures or two calibrations",
            remedy="Fit the two groups separately and compare the cards; record the temperature",
        )
    yield effect.fraction, finding.add_interval(scatter * float(np.sqrt(1.0 / len(low) + 1.0 / len(high))))


def _drift(analysis: ResidualAnalysis) -> Iterator[tuple[float, Finding]]:
    """Generate the finding that the force increases or decreases from the first run to the last run."""
    count = len(analysis.runs)
    effect = analysis.common_effect("force_gain", _ramp(analysis))
    if count < 2 * SETTINGS.peer_count_min or abs(effect.size) < SETTINGS.gain_difference_min:
        return
    if effect.fraction < SETTINGS.drift_fraction_min or _is_single_run(analysis, "force_gain", effect):
        return
    finding = Finding(
        kind="campaign_drift",
        channel="force",
        size=effect.size,
        found=f"the force {'grows' if effect.size > 0.0 else 'falls'} by {percent(abs(effect.size))} from "
        f"the first to the last of the {count} runs, at the same command and motion",
        effect="The card describes the middle of the campaign, and its error includes the drift",
        remedy="Record the temperature of each run because the force falls with temperature, and check the "
        "amplifier for drift; repeat the first run at the end",
    )
    yield effect.fraction, finding.add_interval(effect.standard_error)


def _ramp(analysis: ResidualAnalysis) -> FloatArray:
    """Return one factor per run, which increases linearly from -0.5 (first run) to 0.5 (last run)."""
    return np.linspace(-0.5, 0.5, len(analysis.runs))


def _is_single_run(analysis: ResidualAnalysis, kind: str, effect: Effect) -> bool:
    """Return True if a single run explains the effect that was estimated for all runs."""
    levels = [each.level for each in analysis.run_effects(kind)]
    return max(levels) > SETTINGS.single_run_ratio_min * effect.level * float(np.sqrt(len(levels)))
