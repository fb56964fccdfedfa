"""Injected faults: how many are found, with which cause, and how often a clean campaign is blamed.

    python bench/faults.py --data DIR [--all] [--tuning]

Each fault is put into the runs of a campaign as a user would have it, and the whole of ``check --deep`` is
asked. Every other fault of a fixed order is kept from tuning: those are reported, unless ``--tuning`` asks
for the rest. A false alarm is a finding of a clean campaign's runs against each other.
``DIR`` holds public runs (``utfsm_sine*``, ``utfpr*``); the virtual dampers need nothing.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrdamper.data.finding import Finding
from mrdamper.data.readers import read_runs
from mrdamper.data.records import RigRun
from mrdamper.jobs.check import check
from mrdamper.jobs.inputs import ReadFiles
from mrdamper.jobs.options import CheckOptions
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import find_preset

Runs = list[RigRun]


@dataclass(frozen=True)
class Fault:
    """One kind of fault: what it does to one run, or to all, and the kinds of finding that name it."""

    name: str
    causes: tuple[str, ...]
    inject: Callable[[RigRun], RigRun]
    everywhere: bool = False
    where: Callable[[RigRun], bool] = lambda _: True


def late(by: float) -> Callable[[RigRun], RigRun]:
    """Delay the force [s]."""
    return lambda run: replace(run, force=np.interp(run.time - by, run.time, run.force))


def scaled(factor: float, *names: str) -> Callable[[RigRun], RigRun]:
    """Scale channels."""
    return lambda run: replace(run, **{n: v * factor for n in names if (v := getattr(run, n)) is not None})


def clipped(run: RigRun) -> RigRun:
    """Cut the force off at 70 % of its peak."""
    most = 0.7 * float(np.abs(run.force).max())
    return replace(run, force=np.clip(run.force, -most, most))


def stuck(run: RigRun) -> RigRun:
    """Hold the force for an eighth of the run."""
    force, n = run.force.copy(), len(run)
    force[n // 2 : n // 2 + n // 8] = force[n // 2]
    return replace(run, force=force)


def spiked(run: RigRun) -> RigRun:
    """Put two single samples far off."""
    force = run.force.copy()
    force[[len(run) // 3, len(run) // 2]] += 1.5 * float(np.ptp(run.force))
    return replace(run, force=force)


def lost(run: RigRun) -> RigRun:
    """Drop one sample in a hundred; the time stamps tell."""
    keep = np.ones(len(run), dtype=bool)
    keep[np.random.default_rng(1).integers(5, len(run) - 5, len(run) // 100)] = False
    return replace(run, **{n: v[keep] for n in _ARRAYS if (v := getattr(run, n)) is not None})


_ARRAYS = ("time", "displacement", "force", "command", "velocity", "temperature")
_LEVEL = ("force_gain", "command_label")


def driven(run: RigRun) -> bool:
    """Whether the run has a command well above none."""
    return float(np.mean(run.command)) > 0.3


FAULTS = (
    Fault("gain 1.1", _LEVEL, scaled(1.1, "force"), where=driven),
    Fault("gain 0.8", _LEVEL, scaled(0.8, "force"), where=driven),
    Fault("gain 1.5", _LEVEL, scaled(1.5, "force"), where=driven),
    Fault("force 3 ms late", ("force_delay",), late(3e-3), where=driven),
    Fault("force 10 ms late", ("force_delay", "force_late"), late(1e-2), where=driven),
    Fault("force 6 ms early", ("force_delay", "force_early"), late(-6e-3), where=driven),
    Fault(
        "command 0.08 high", ("command_label", "declared_command", "force_gain"),
        lambda run: replace(run, command=run.command + 0.08), where=driven,
    ),
    Fault(
        "command 0.3 high", ("command_label", "declared_command", "force_gain"),
        lambda run: replace(run, command=run.command + 0.3), where=driven,
    ),
    Fault("time times 1.04", ("time_scale", "declared_frequency"), scaled(1.04, "time")),
    Fault("time times 2", ("time_scale", "declared_frequency"), scaled(2.0, "time")),
    Fault(
        "stroke times 1.1", ("displacement_scale", "declared_stroke"), scaled(1.1, "displacement", "velocity")
    ),
    Fault("offset of 15 %", ("force_offset", "force_offset_of_run"), lambda run: replace(
        run, force=run.force + 0.15 * float(np.std(run.force)))),
    Fault("reversed force", ("force_sign", "refused"), scaled(-1.0, "force")),
    Fault("clipped force", ("clipped",), clipped),
    Fault("stuck force", ("stuck_sensor",), stuck),
    Fault("spikes", ("spikes",), spiked),
    Fault("lost samples", ("lost_samples",), lost),
    Fault("kgf read as N", ("implausible_damper",), scaled(1.0 / 9.80665, "force"), everywhere=True),
    Fault("current in per cent", ("implausible_damper", "declared_command", "implausible_size"),
          scaled(50.0, "command"), everywhere=True),
    Fault("current times 0.1", ("declared_command",), scaled(0.1, "command"), everywhere=True),
    Fault("inches read as mm", ("declared_stroke", "implausible_damper"),
          scaled(1.0 / 25.4, "displacement", "velocity"), everywhere=True),
    Fault("time times 2, all", ("declared_frequency",), scaled(2.0, "time"), everywhere=True),
)  # fmt: skip


_OF_ONE = {"force_offset", "force_late", "force_early", "stuck_sensor", "lost_samples", "force_sign"}
JOINT = {cause for fault in FAULTS for cause in fault.causes if "_" in cause} - _OF_ONE
"""Kinds of findings that compare runs with each other, their names, and the dampers that there are."""


def campaigns(folder: Path | None) -> Iterator[tuple[str, Runs]]:
    """Yield campaigns of real and of virtual dampers."""
    if folder is not None:
        for name, pattern in (("utfsm", "utfsm_sine*"), ("utfpr", "utfpr*")):
            yield name, list(read_runs(sorted(folder.glob(pattern))))
    plan = Campaign(
        motions=("sine5mm1Hz", "sine3mm2Hz", "sine15mm1Hz"),
        currents_A=(0.0, 0.5, 1.0, 1.5, 2.0),
        temperatures_degC=(20.0,),
        held_out_motions=(),
        held_out_temperatures_degC=(),
        steps=None,
    )
    for preset in ("nominal", "paper"):
        yield preset, [run for run, _ in measure(find_preset(preset), plan, seed=3)]


def findings(runs: Sequence[RigRun]) -> tuple[Finding, ...]:
    """Return the faults and warnings that ``check --deep`` tells."""
    found = check(ReadFiles((), (), tuple(runs)), CheckOptions(deep=True)).findings
    return tuple(each for each in found if each.severity != "note")


def main() -> None:
    """Print a line for each fault, then the totals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path)
    parser.add_argument("--all", action="store_true", help="every run of a campaign in turn, not two of them")
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    total: Counter[str] = Counter()
    number = 0
    for name, clean in campaigns(given.data):
        if given.only and name != given.only:
            continue
        clock = time.process_time()
        before = {(each.run, each.kind) for each in findings(clean)}
        total["clean campaigns"] += 1
        total["clean runs"] += len(clean)
        alarms = sorted((run, kind) for run, kind in before if kind in JOINT)
        total["false alarms"] += len(alarms)
        print(f"{name}: {len(clean)} runs, clean: {alarms or 'nothing'}, "
              f"{time.process_time() - clock:.1f} s of CPU")  # fmt: skip
        for fault in FAULTS:
            chosen = [run for run in clean if fault.where(run)]
            picked = [clean[0]] if fault.everywhere else [chosen[k * len(chosen) // 5] for k in (1, 3)]
            for run in chosen if given.all and not fault.everywhere else picked:
                number += 1
                if number % 2 == int(given.tuning):
                    continue
                broken = [fault.inject(each) if fault.everywhere or each is run else each for each in clean]
                told = [f for f in findings(broken) if (f.run, f.kind) not in before]
                here = [f for f in told if fault.everywhere or f.run == run.name]
                right = any(f.kind in fault.causes for f in here)
                total["faults"] += 1
                total["found"] += bool(here)
                total["right cause and run"] += right
                said = ", ".join(f"{f.kind} {f.size:.3g}" if f.size else f.kind for f in here[:3]) or "-"
                print(
                    f"  {'+' if right else '~' if here else '-'} {fault.name:20s} {run.name:34s} {said}"
                    + (f"  also {len(told) - len(here)} of other runs" if len(told) > len(here) else "")
                )
    print(", ".join(f"{count} {what}" for what, count in total.items()))


if __name__ == "__main__":
    main()
