"""The runs that a selection looks at: few samples, every motion, command and temperature among them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrdamper.data.prepare import PreparedRun, shortened
from mrdamper.identify.motions import motion_groups
from mrdamper.identify.temperature import LEVEL_K

_MANY_SAMPLES = 20_000  # of all runs at the fit's rate: with more, each run is cut;
_ENOUGH_SAMPLES = 30_000  # with still more, some stay aside
_PERIODS, _SECONDS = 3.0, 5.0  # that a cut leaves of a run; seconds where it has no period
_RATE_Hz = 200.0


def enough_of(runs: Sequence[PreparedRun]) -> tuple[PreparedRun, ...]:
    """Return runs of few enough samples in all, in their order.

    Long runs are cut; of runs that are still too many, those stay that bring something new.
    """
    if sum(map(_cost, runs)) > _MANY_SAMPLES:
        runs = [_cut(run) for run in runs]
    cost = [_cost(run) for run in runs]
    if sum(cost) <= _ENOUGH_SAMPLES:
        return tuple(runs)
    motion = {k: place for place, group in enumerate(motion_groups(runs)) for k in group}
    seen: set[object] = set()
    fresh: list[int] = []
    order = np.random.default_rng(0).permutation(len(runs)).tolist()
    for k in order:
        kelvin = runs[k].trajectory.temperature
        labels = {
            ("motion", motion[k]),
            ("command", runs[k].run.constant_command),
            ("temperature", None if kelvin is None else round(float(np.mean(kelvin)) / LEVEL_K)),
        }
        if not labels <= seen:
            fresh.append(k)
        seen |= labels
    chosen, spent = set(fresh), sum(cost[k] for k in fresh)
    for k in order:
        if k not in chosen and spent + cost[k] <= _ENOUGH_SAMPLES:
            chosen.add(k)
            spent += cost[k]
    return tuple(run for k, run in enumerate(runs) if k in chosen)


def _cost(run: PreparedRun) -> float:
    """Return the number of samples of a run at the fit's rate."""
    return _RATE_Hz * run.trajectory.step * len(run)


def _cut(run: PreparedRun) -> PreparedRun:
    seconds = max(_PERIODS * run.period_s, 1.0) if run.period_s else _SECONDS
    return shortened(run, run.scored_from + max(round(seconds / run.trajectory.step), 64))
