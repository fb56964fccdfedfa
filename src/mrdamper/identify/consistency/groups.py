"""What groups of runs, or all runs of a campaign, have: two dampers, drift, a delay of the force channel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding, percent
from mrdamper.identify.consistency.effects import Effect, Residuals

_LEAST = 0.04  # of the gain: of sessions, groups and drift
_PEERS = 3  # runs, below which they are no group
_APART = 5.0  # times the scatter inside two groups, as no one group halved anywhere has
_DRIFTS = 0.1  # of the residual, that a drift has to explain
_DELAY_s = 1.2e-3
_LATER_s = 4e-3  # between two groups
_SHARE = 0.015  # of the residual, that a common cause has to explain
_HEAVY = 0.4  # of the usual weight: a gain of a run without force says nothing
_BESIDE = 0.5  # of what the first explains: a second cause that explains less is its shadow


@dataclass(frozen=True, slots=True)
class _Told:
    """A finding, and the share of the residual's mean square that it explains."""

    finding: Finding
    share: float


def find_together(found: Residuals) -> tuple[tuple[Finding, ...], tuple[Finding, ...]]:
    """Return what all runs have, and what several have: of each the simplest cause that explains them.

    A group that is late moves the others ahead, and all together by something between: of two delays the one
    that explains less is left out, of a delay and a gain that which explains far less.
    """
    common, groups = list(_common(found)), list(_groups(found))
    one_of_them = any(each.finding.kind == "group_delay" for each in groups)
    least = max((each.share for each in (*common, *groups)), default=0.0) * (1.0 if one_of_them else _BESIDE)
    return (
        tuple(each.finding for each in common if each.share >= least),
        tuple(each.finding for each in groups if each.share >= least),
    )


def _groups(found: Residuals) -> Iterator[_Told]:
    gains = _sizes(found, "force_gain")
    told = [*_sessions(found, gains), *_two_groups(found, "force_gain"), *_drift(found)][:1]
    late = list(_two_groups(found, "force_delay"))
    yield from sorted([*told, *late], key=lambda each: -each.share)[:1]


def _sizes(found: Residuals, kind: str) -> FloatArray:
    return np.array([found.of_run(number, kind).size for number in range(len(found.runs))])


def _common(found: Residuals) -> Iterator[_Told]:
    """Give a delay, or a filter, that the force of all runs has; motions of one frequency hardly show it."""
    delay, pole = found.of_all("force_delay"), found.of_all("force_bandwidth")
    filtered = pole.size > 0.0 and pole.share > 1.1 * delay.share
    told = pole if filtered else delay
    if abs(told.size) < _DELAY_s or told.share < _SHARE or _of_one_run(found, "force_delay", told):
        return
    late = f"{1e3 * abs(told.size):.2g} ms {'late' if told.size > 0.0 else 'early'}"
    what = f"filtered at about {1.0 / (2.0 * np.pi * told.size):.2g} Hz" if filtered else late
    finding = Finding(
        kind="common_bandwidth" if filtered else "common_delay",
        severity="warning",
        channel="force",
        size=told.size,
        unit="s",
        found=f"the force of all runs together is {what} against the displacement, which no hysteresis of "
        "this law explains",
        effect="Yield displacement and viscosity take up what is a lag of the channel",
        remedy="Give both channels the same filter and converter, or shift the force by the delay",
    ).within(told.error)
    yield _Told(finding, told.share)


def _sessions(found: Residuals, gains: FloatArray) -> Iterator[_Told]:
    """Give sessions of several runs whose forces are all larger or smaller than the other sessions'."""
    names = np.array([run.run.session for run in found.runs])
    large = [name for name, count in Counter(names.tolist()).items() if count >= _PEERS]
    for name in large:
        sizes = gains[names == name]
        others = gains[np.isin(names, large) & (names != name)]
        if len(others) < _PEERS:
            continue
        gain = float(np.median(sizes) - np.median(others))
        scatter = rms(np.concatenate([sizes - np.median(sizes), others - np.median(others)]))
        error = scatter * float(np.sqrt(1.0 / len(sizes) + 1.0 / len(others)))
        if abs(gain) < _LEAST or abs(gain) < 4.0 * error:
            continue
        share = found.of_all("force_gain", (names == name).astype(np.float64)).share
        yield _Told(_gain("session_gain", name, len(sizes), gain, error, "of this session"), share)


def _two_groups(found: Residuals, kind: str) -> Iterator[_Told]:
    """Give runs whose gains, or delays, lie in two heaps with nothing between them."""
    delay = kind == "force_delay"
    weighed, values = _weighed(found, kind), _sizes(found, kind)
    order = weighed[np.argsort(values[weighed])]
    sizes = values[order]
    if len(sizes) < 2 * _PEERS:
        return
    cut = int(np.argmax(np.diff(sizes))) + 1
    low, high = sizes[:cut], sizes[cut:]
    apart = float(high.mean() - low.mean())
    inside = rms(np.concatenate([low - low.mean(), high - high.mean()]))
    if min(len(low), len(high)) < _PEERS or apart < max(_LATER_s if delay else _LEAST, _APART * inside):
        return
    few = order[:cut] if len(low) < len(high) else order[cut:]
    together = found.of_all(kind, np.isin(np.arange(len(values)), few).astype(np.float64))
    if together.share < found.of_all(kind, _in_order(found)).share:
        return  # they drift apart
    error = inside * float(np.sqrt(1.0 / len(low) + 1.0 / len(high)))
    names = ", ".join(found.runs[number].name for number in sorted(few.tolist())[:4])
    which = f"({names}{' ...' * (len(few) > 4)})"
    if delay:
        yield _Told(_late(len(few), together.size, error, which), together.share)
    else:
        yield _Told(_gain("two_groups", "", len(few), together.size, error, which), together.share)


def _gain(kind: str, run: str, count: int, gain: float, error: float, which: str) -> Finding:
    return Finding(
        kind=kind,
        severity="warning",
        channel="force",
        run=run,
        size=1.0 + gain,
        found=f"the {count} runs {which} have {percent(abs(gain))} {'more' if gain > 0.0 else 'less'} force "
        "than the others'",
        effect="One card is fitted to two dampers, two temperatures or two calibrations",
        remedy="Identify the two groups apart and compare the cards; record the temperature",
    ).within(error)


def _late(count: int, delay: float, error: float, which: str) -> Finding:
    return Finding(
        kind="group_delay",
        severity="warning",
        channel="force",
        size=delay,
        unit="s",
        found=f"the force of the {count} runs {which} is {1e3 * abs(delay):.2g} ms "
        f"{'later' if delay > 0.0 else 'earlier'} than that of the others, by a delay or a filter",
        effect="Yield displacement and viscosity of the card lie between those of the two groups",
        remedy="Compare filters and converters of the two groups; identify them apart until it is known",
    ).within(error)


def _drift(found: Residuals) -> Iterator[_Told]:
    """Give a force that grows or falls from run to run, in the order in which they were given."""
    count = len(found.runs)
    told = found.of_all("force_gain", _in_order(found))
    slope, error = told.size, told.error
    if count < 2 * _PEERS or abs(slope) < _LEAST or told.share < _DRIFTS:
        return
    if _of_one_run(found, "force_gain", told):
        return
    finding = Finding(
        kind="campaign_drift",
        severity="warning",
        channel="force",
        size=slope,
        found=f"the force {'grows' if slope > 0.0 else 'falls'} by {percent(abs(slope))} from the first to "
        f"the last of the {count} runs, at like command and motion",
        effect="The card holds for the middle of the campaign, and its error is the drift",
        remedy="Record the temperature with each run (a damper that heats loses force), or look for the "
        "drift of the amplifier; repeat the first run at the end",
    ).within(error)
    yield _Told(finding, told.share)


def _in_order(found: Residuals) -> FloatArray:
    return np.linspace(-0.5, 0.5, len(found.runs))


def _of_one_run(found: Residuals, kind: str, told: Effect) -> bool:
    """Tell whether one run alone explains as much as what all are said to have."""
    count = len(found.runs)
    most = max(found.of_run(number, kind).explained for number in range(count))
    return most > 0.9 * told.explained * float(np.sqrt(count))


def _weighed(found: Residuals, kind: str) -> np.ndarray:
    """Return the runs in which a cause's size is known well enough to count."""
    errors = np.array([found.of_run(number, kind).error for number in range(len(found.runs))])
    return np.flatnonzero(errors <= float(np.median(errors)) / _HEAVY)
