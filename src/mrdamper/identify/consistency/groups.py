"""What groups of runs, or all runs of a campaign, have: two dampers, drift, a delay of the force channel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.finding import Finding, percent
from mrdamper.identify.consistency.effects import Effect, Residuals

__all__ = ["find_common", "find_groups"]

_LEAST = 0.04  # of the gain: of sessions, groups and drift
_PEERS = 3  # runs, below which they are no group
_APART = 5.0  # times the scatter inside two groups, as no one group halved anywhere has
_DRIFTS = 0.1  # of the residual, that a drift has to explain
_DELAY_s = 1.2e-3
_SHARE = 0.015  # of the residual, that a common cause has to explain
_HEAVY = 0.4  # of the usual weight: a gain of a run without force says nothing


def find_groups(found: Residuals) -> Iterator[Finding]:
    """Give what several runs have together; the simplest one that explains them."""
    gains = np.array([found.of_run(number, "force_gain").size for number in range(len(found.runs))])
    yield from [*_sessions(found, gains), *_two_groups(found, gains), *_drift(found)][:1]


def find_common(found: Residuals) -> Iterator[Finding]:
    """Give a delay, or a filter, that the force of all runs has; motions of one frequency hardly show it."""
    delay, pole = found.of_all("force_delay"), found.of_all("force_bandwidth")
    filtered = pole.size > 0.0 and pole.share > 1.1 * delay.share
    told = pole if filtered else delay
    if abs(told.size) < _DELAY_s or told.share < _SHARE or _of_one_run(found, "force_delay", told):
        return
    late = f"{1e3 * abs(told.size):.2g} ms {'late' if told.size > 0.0 else 'early'}"
    what = f"filtered at about {1.0 / (2.0 * np.pi * told.size):.2g} Hz" if filtered else late
    yield Finding(
        kind="common_bandwidth" if filtered else "common_delay",
        severity="warning",
        channel="force",
        size=told.size,
        low=told.size - 2.0 * told.error,
        high=told.size + 2.0 * told.error,
        unit="s",
        found=f"the force of all runs together is {what} against the displacement, which no hysteresis of "
        "this law explains",
        effect="Yield displacement and viscosity take up what is a lag of the channel",
        remedy="Give both channels the same filter and converter, or shift the force by the delay",
    )


def _sessions(found: Residuals, gains: FloatArray) -> Iterator[Finding]:
    """Give sessions of several runs whose forces are all larger or smaller than the other sessions'."""
    groups: dict[str, list[float]] = {}
    for run, gain in zip(found.runs, gains.tolist(), strict=True):
        groups.setdefault(run.run.session, []).append(gain)
    large = {name: np.array(sizes) for name, sizes in groups.items() if len(sizes) >= _PEERS}
    for name, sizes in large.items():
        others = np.concatenate([each for other, each in large.items() if other != name] or [np.empty(0)])
        if len(others) < _PEERS:
            continue
        gain = float(np.median(sizes) - np.median(others))
        scatter = rms(np.concatenate([sizes - np.median(sizes), others - np.median(others)]))
        error = scatter * float(np.sqrt(1.0 / len(sizes) + 1.0 / len(others)))
        if abs(gain) < _LEAST or abs(gain) < 4.0 * error:
            continue
        yield _two("session_gain", name, len(sizes), gain, error, "of this session")


def _two_groups(found: Residuals, gains: FloatArray) -> Iterator[Finding]:
    """Give runs whose gains lie in two heaps with nothing between them."""
    heavy = _weighed(found)
    order = heavy[np.argsort(gains[heavy])]
    sizes = gains[order]
    for cut in np.argsort(np.diff(sizes))[::-1][:1].tolist():
        low, high = sizes[: cut + 1], sizes[cut + 1 :]
        if min(len(low), len(high)) < _PEERS:
            continue
        gain = float(high.mean() - low.mean())
        inside = rms(np.concatenate([low - low.mean(), high - high.mean()]))
        if gain < _LEAST or gain < _APART * inside:
            continue
        smaller = low if len(low) < len(high) else high
        few = order[: cut + 1] if smaller is low else order[cut + 1 :]
        belongs = np.isin(np.arange(len(gains)), few).astype(np.float64)
        together = found.of_all("force_gain", belongs)
        if together.share < found.of_all("force_gain", _in_order(found)).share:
            continue  # they drift apart
        error = inside * float(np.sqrt(1.0 / len(low) + 1.0 / len(high)))
        names = ", ".join(found.runs[number].name for number in sorted(few.tolist())[:4])
        yield _two("two_groups", "", len(few), together.size, error, f"({names}{' ...' * (len(few) > 4)})")


def _two(kind: str, run: str, count: int, gain: float, error: float, which: str) -> Finding:
    return Finding(
        kind=kind,
        severity="warning",
        channel="force",
        run=run,
        size=1.0 + gain,
        low=1.0 + gain - 2.0 * error,
        high=1.0 + gain + 2.0 * error,
        found=f"the {count} runs {which} have {percent(abs(gain))} {'more' if gain > 0.0 else 'less'} force "
        "than the others'",
        effect="One card is fitted to two dampers, two temperatures or two calibrations",
        remedy="Identify the two groups apart and compare the cards; record the temperature",
    )


def _drift(found: Residuals) -> Iterator[Finding]:
    """Give a force that grows or falls from run to run, in the order in which they were given."""
    count = len(found.runs)
    told = found.of_all("force_gain", _in_order(found))
    slope, error = told.size, told.error
    if count < 2 * _PEERS or abs(slope) < _LEAST or told.share < _DRIFTS:
        return
    if _of_one_run(found, "force_gain", told):
        return
    yield Finding(
        kind="campaign_drift",
        severity="warning",
        channel="force",
        size=slope,
        low=slope - 2.0 * error,
        high=slope + 2.0 * error,
        found=f"the force {'grows' if slope > 0.0 else 'falls'} by {percent(abs(slope))} from the first to "
        f"the last of the {count} runs, at like command and motion",
        effect="The card holds for the middle of the campaign, and its error is the drift",
        remedy="Record the temperature with each run (a damper that heats loses force), or look for the "
        "drift of the amplifier; repeat the first run at the end",
    )


def _in_order(found: Residuals) -> FloatArray:
    return np.linspace(-0.5, 0.5, len(found.runs))


def _of_one_run(found: Residuals, kind: str, told: Effect) -> bool:
    """Tell whether one run alone explains as much as what all are said to have."""
    count = len(found.runs)
    most = max(found.of_run(number, kind).explained for number in range(count))
    return most > 0.9 * told.explained * float(np.sqrt(count))


def _weighed(found: Residuals) -> np.ndarray:
    """Return the runs whose gains are known well enough to count."""
    errors = np.array([found.of_run(number, "force_gain").error for number in range(len(found.runs))])
    return np.flatnonzero(errors <= float(np.median(errors)) / _HEAVY)
