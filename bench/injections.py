"""Faults for ``bench.faults``, and functions that inject the faults into runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import signal

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun

Runs = list[RigRun]
Inject = Callable[[Runs, int, float], Runs]
Change = Callable[[RigRun, float], RigRun]

_CHANNELS = ("time", "displacement", "force", "command", "velocity", "temperature")


@dataclass(frozen=True)
class Fault:
    """A fault: the function ``inject`` and the tested ``sizes``, from small to large.

    ``causes`` are the kinds of findings that name the cause correctly. ``where`` selects suitable runs.
    """

    name: str
    causes: tuple[str, ...]
    inject: Inject
    sizes: tuple[float, ...]
    unit: str = ""
    extent: Literal["run", "all", "group"] = "run"
    where: Callable[[RigRun], bool] = lambda _: True


def one(change: Change) -> Inject:
    """Return a fault injection that changes one run of a campaign."""
    return lambda runs, at, size: [
        change(run, size) if number == at else run for number, run in enumerate(runs)
    ]


def every(change: Change) -> Inject:
    """Return a fault injection that changes all runs equally."""
    return lambda runs, _, size: [change(run, size) for run in runs]


def half(change: Change) -> Inject:
    """Return a fault injection that changes every second run."""
    return lambda runs, _, size: [change(run, size) if k % 2 else run for k, run in enumerate(runs)]


def growing(change: Change) -> Inject:
    """Return a fault injection whose size grows from run to run. The runs are put in random order first."""

    def inject(runs: Runs, _: int, size: float) -> Runs:
        order = np.random.default_rng(7).permutation(len(runs))
        rank = {int(number): k / (len(runs) - 1) for k, number in enumerate(order)}
        recorded = [change(run, size * rank[number]) for number, run in enumerate(runs)]
        return [recorded[number] for number in order]

    return inject


def times(*names: str) -> Change:
    """Return a change of a run that multiplies some channels by a factor."""
    return lambda run, size: replace(
        run, **{name: values * size for name in names if (values := getattr(run, name)) is not None}
    )


def with_force(change: Callable[[RigRun, float], FloatArray]) -> Change:
    """Return a change of a run that affects only the force."""
    return lambda run, size: replace(run, force=change(run, size))


def rows(run: RigRun, kept: np.ndarray, *, restamp: bool) -> RigRun:
    """Return selected samples of a run. With ``restamp``, their times are replaced by uniform times."""
    cut = {name: values[kept] for name in _CHANNELS if (values := getattr(run, name)) is not None}
    if restamp:
        cut["time"] = run.time[0] + np.median(np.diff(run.time)) * np.arange(len(kept))
    return replace(run, **cut)


def delayed(run: RigRun, ms: float) -> FloatArray:
    """Delay the force by a time [ms]."""
    return np.interp(run.time - 1e-3 * ms, run.time, run.force)


def low_passed(run: RigRun, cutoff_Hz: float) -> FloatArray:
    """Filter the force by a first-order low-pass, like the input of an amplifier."""
    step = float(np.median(np.diff(run.time)))
    pole = float(np.exp(-2.0 * np.pi * cutoff_Hz * step))
    state = np.array([pole * run.force[0]])
    return np.asarray(signal.lfilter([1.0 - pole], [1.0, -pole], run.force, zi=state)[0])


def hard_clipped(run: RigRun, share: float) -> FloatArray:
    """Limit the force to (1 - ``share``) times its peak."""
    most = (1.0 - share) * float(np.abs(run.force).max())
    return np.clip(run.force, -most, most)


def soft_clipped(run: RigRun, share: float) -> FloatArray:
    """Compress the force smoothly: its peak decreases by the fraction ``share``."""
    peak = float(np.abs(run.force).max())
    return run.force * (1.0 - share * (run.force / peak) ** 2)


def stuck(run: RigRun, share: float) -> FloatArray:
    """Freeze the force from the middle of the run, for a fraction of the run."""
    force, n = run.force.copy(), len(run)
    force[n // 2 : n // 2 + int(share * n)] = force[n // 2]
    return force


def spiked(run: RigRun, size: float) -> FloatArray:
    """Change two single force samples by a multiple of the force range."""
    force = run.force.copy()
    force[[len(run) // 3, len(run) // 2]] += size * float(np.ptp(run.force))
    return force


def hum(run: RigRun, share: float) -> FloatArray:
    """Add a sine of 6.37 Hz, like aliased mains hum. It is no harmonic of the motions."""
    return run.force + share * float(np.ptp(run.force)) / 2.0 * np.sin(2.0 * np.pi * 6.37 * run.time + 0.3)


def rounded(run: RigRun, levels: float) -> FloatArray:
    """Quantise the force to a number of levels."""
    step = float(np.ptp(run.force)) / levels
    return np.round(run.force / step) * step


def lost_with_stamps(run: RigRun, share: float) -> RigRun:
    """Remove a fraction of the samples and keep the time stamps, which show the gaps."""
    kept = np.ones(len(run), dtype=bool)
    kept[np.random.default_rng(1).integers(5, len(run) - 5, int(share * len(run)))] = False
    return rows(run, np.flatnonzero(kept), restamp=False)


def lost_unseen(run: RigRun, share: float) -> RigRun:
    """Remove four sections of samples; new uniform times hide the gaps."""
    kept = np.ones(len(run), dtype=bool)
    for start in np.linspace(0.15, 0.85, 4):
        kept[int(start * len(run)) : int((start + share / 4) * len(run)) + 1] = False
    return rows(run, np.flatnonzero(kept), restamp=True)


def doubled(run: RigRun, share: float) -> RigRun:
    """Repeat four sections of samples; new uniform times hide the repetitions."""
    kept = np.arange(len(run))
    for start in np.linspace(0.85, 0.15, 4):
        a, b = int(start * len(run)), int((start + share / 4) * len(run)) + 1
        kept = np.concatenate([kept[:b], kept[a:]])
    return rows(run, kept, restamp=True)


def copied(runs: Runs, at: int, gain: float) -> Runs:
    """Replace the data of a run by scaled data of another run; name and command stay."""
    victim = runs[at]
    near = sorted(
        (k for k in range(len(runs)) if k != at and runs[k].constant_command != victim.constant_command),
        key=lambda k: abs(float(np.ptp(runs[k].displacement)) - float(np.ptp(victim.displacement))),
    )
    other = runs[near[0]]
    command = np.full(len(other), float(np.median(victim.command)))
    copy = replace(
        other, name=victim.name, source=victim.source, session=victim.session, command=command,
        force=gain * other.force,
    )  # fmt: skip
    return [copy if k == at else run for k, run in enumerate(runs)]


def exchanged(runs: Runs, at: int, _: float) -> Runs:
    """Exchange the commands of two runs with similar motions."""
    mine = runs[at]
    near = sorted(
        (k for k in range(len(runs)) if abs(_command(runs[k]) - _command(mine)) > 0.2 and driven(runs[k])),
        key=lambda k: (round(abs(np.ptp(runs[k].displacement) / np.ptp(mine.displacement) - 1.0), 1), k),
    )
    other = runs[near[0]]
    swap = {at: _command(other), near[0]: _command(mine)}
    return [
        replace(run, command=np.full(len(run), swap[k])) if k in swap else run for k, run in enumerate(runs)
    ]


def _command(run: RigRun) -> float:
    return float(np.median(run.command))


def driven(run: RigRun) -> bool:
    """Return True if the run has a command well above zero."""
    return _command(run) > 0.3


def quick(run: RigRun) -> bool:
    """Return True if the run has a command well above zero and a motion above about 0.8 Hz."""
    x = run.displacement - np.mean(run.displacement)
    crossings = np.count_nonzero(np.diff(np.signbit(x)))
    return driven(run) and crossings > 1.6 * float(run.time[-1] - run.time[0])


_LEVEL = ("force_gain", "command_label", "labels_exchanged", "two_dampers")
_LABEL = ("command_label", "declared_command", "labels_exchanged", "force_gain")
_LATE = ("force_delay", "force_late", "common_delay")
_CLOCK = ("phase_jumps", "lost_samples")
_FORCE = times("force")

FAULTS = (
    Fault("gain up", _LEVEL, one(_FORCE), (1.05, 1.1, 1.2, 1.35, 1.5, 1.8), "times", where=driven),
    Fault("gain down", _LEVEL, one(_FORCE), (0.95, 0.9, 0.8, 0.7, 0.5), "times", where=driven),
    Fault("force late", _LATE, one(with_force(delayed)), (1, 2, 3, 6, 10, 20), "ms", where=quick),
    Fault("force early", ("force_delay", "force_early"), one(with_force(delayed)), (-1, -2, -3, -6, -10, -20),
          "ms", where=quick),
    Fault("force filtered", ("force_bandwidth", *_LATE), one(with_force(low_passed)), (40, 20, 12, 8, 4),
          "Hz", where=quick),
    Fault("command high", _LABEL, one(lambda run, by: replace(run, command=run.command + by)),
          (0.03, 0.05, 0.08, 0.2, 0.4), "A or V", where=driven),
    Fault("command low", _LABEL, one(lambda run, by: replace(run, command=run.command - by)),
          (0.03, 0.05, 0.08, 0.2, 0.29), "A or V", where=driven),
    Fault("time slower", ("time_scale", "declared_frequency"), one(times("time")), (1.02, 1.04, 1.1, 1.3, 2)),
    Fault("time faster", ("time_scale", "declared_frequency"), one(times("time")),
          (0.98, 0.96, 0.9, 0.7, 0.5)),
    Fault("stroke", ("displacement_scale", "declared_stroke"), one(times("displacement", "velocity")),
          (1.05, 1.1, 1.2, 1.5, 2.54)),
    Fault("offset", ("force_offset", "force_offset_of_run"),
          one(with_force(lambda run, size: run.force + size * float(np.std(run.force)))),
          (0.05, 0.1, 0.2, 0.4, 1), "sd"),
    Fault("reversed force", ("force_sign", "refused"), one(_FORCE), (-1,)),
    Fault("hard clipping", ("clipped",), one(with_force(hard_clipped)), (0.02, 0.05, 0.1, 0.2, 0.4),
          "of peak"),
    Fault("soft clipping", ("force_saturation", *_LEVEL), one(with_force(soft_clipped)), (0.1, 0.2, 0.3),
          "of peak", where=driven),
    Fault("stuck force", ("stuck_sensor",), one(with_force(stuck)), (0.02, 0.05, 0.1, 0.2), "of run"),
    Fault("spikes", ("spikes",), one(with_force(spiked)), (0.2, 0.5, 1, 3), "ranges"),
    Fault("aliased mains", ("interference",), one(with_force(hum)), (0.02, 0.05, 0.1, 0.2, 0.5), "of range"),
    Fault("coarse force", ("coarse_steps",), one(with_force(rounded)), (64, 32, 16, 8, 4), "levels"),
    Fault("lost, stamped", ("lost_samples", "gap"), one(lost_with_stamps), (0.002, 0.01, 0.05), "of run"),
    Fault("lost, unseen", _CLOCK, one(lost_unseen), (0.002, 0.005, 0.01, 0.03), "of run"),
    Fault("doubled, unseen", _CLOCK, one(doubled), (0.002, 0.005, 0.01, 0.03), "of run"),
    Fault("copy of another", ("duplicate", *_LEVEL), copied, (1.0, 1.03), where=driven),
    Fault("labels exchanged", _LABEL, exchanged, (1,), where=driven),
    Fault("kgf as N", ("implausible_damper",), every(_FORCE), (1 / 9.80665,), extent="all"),
    Fault("per cent as A", ("implausible_damper", "declared_command", "implausible_size"),
          every(times("command")), (50,), extent="all"),
    Fault("current times 0.1", ("declared_command", "implausible_damper"), every(times("command")), (0.1,),
          extent="all"),
    Fault("inches as mm", ("declared_stroke", "implausible_damper"),
          every(times("displacement", "velocity")), (1 / 25.4,), extent="all"),
    Fault("time times 2", ("declared_frequency",), every(times("time")), (2,), extent="all"),
    Fault("all filtered", ("common_bandwidth", *_LATE), every(with_force(low_passed)), (20, 12, 8, 4), "Hz",
          extent="all"),
    Fault("all late", _LATE, every(with_force(delayed)), (3, 6, 10, 14, 20), "ms", extent="all"),
    Fault("all early", ("force_early", "force_delay", "common_delay"),
          every(with_force(delayed)), (-3, -6, -10, -14, -20), "ms", extent="all"),
    Fault("two dampers", ("two_groups", "two_dampers"), half(_FORCE), (1.1, 1.2, 1.3, 1.5),
          "times", extent="group"),
    Fault("drift of gain", ("campaign_drift",),
          growing(lambda run, size: replace(run, force=run.force * (1.0 + size))), (0.1, 0.2, 0.3, 0.5),
          "of force", extent="group"),
    Fault("heating unrecorded", ("campaign_drift",),
          growing(lambda run, size: replace(run, force=run.force * (1.0 - size), temperature=None)),
          (0.1, 0.2, 0.3, 0.5), "of force", extent="group"),
)  # fmt: skip
