"""Injected faults: how many are found, with which cause, and how often a clean campaign is blamed.

    python -m bench.faults --data DIR               the half that is kept from tuning
    python -m bench.faults --data DIR --tuning      the other half
    python -m bench.faults --data DIR --smallest    the smallest size that is found, per fault and campaign

Each fault is put into the runs of a campaign as a user would have it, and the whole of ``check --deep`` is
asked. Its size is the smallest of its ladder with which the card of the broken campaign has twice the error
on the clean runs (for a fault of one run: on that run, clean), else the largest. Which half a fault is in
follows from a hash of its name and place. A silent acceptance is a fault that is not found although its card
is more than twice as bad. ``DIR`` holds public runs (``utfsm_sine*``, ``utfpr*``); virtual dampers need none.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.injections import FAULTS, Fault, Runs
from mrdamper.data.finding import Finding
from mrdamper.data.prepare import prepare_run
from mrdamper.data.readers import read_runs
from mrdamper.errors import ConvergenceError, InputError
from mrdamper.identify.consistency.joint import joint_fit
from mrdamper.identify.scores import score_run
from mrdamper.jobs.check import check
from mrdamper.jobs.inputs import ReadFiles
from mrdamper.jobs.options import CheckOptions
from mrdamper.models.damper import Damper
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import find_preset

_TRUE_OF_CLEAN = {
    "force_offset", "force_level_changes", "position_drift", "force_drift", "poor_repeatability",
    "force_noise",
}  # fmt: skip
"""What the public runs have in fact (docs/check.md): no false alarm."""

_DOUBLED = 2.0


@dataclass(frozen=True)
class Place:
    """A fault in one run of a campaign, or in all (run -1)."""

    campaign: str
    fault: Fault
    run: int

    @property
    def tuning(self) -> bool:
        name = f"{self.campaign}/{self.fault.name}/{self.run}"
        return hashlib.sha256(name.encode()).digest()[0] % 2 == 0


def campaigns(folder: Path | None) -> Iterator[tuple[str, Runs]]:
    """Yield campaigns of real and of virtual dampers."""
    if folder is not None:
        yield "utfsm", list(read_runs(sorted(folder.glob("utfsm_sine*"))))
        yield "utfpr", list(read_runs(sorted(folder.glob("utfpr*_0[1357].csv"))))
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


def places(campaign: str, clean: Runs) -> Iterator[Place]:
    """Yield where each fault is put: two runs of those that it can show in, or all."""
    for fault in FAULTS:
        if fault.extent != "run":
            yield Place(campaign, fault, -1)
            continue
        chosen = [k for k, run in enumerate(clean) if fault.where(run)]
        for k in (1, 3):
            yield Place(campaign, fault, chosen[k * len(chosen) // 5])


def findings(runs: Sequence) -> tuple[Finding, ...]:
    """Return the faults and warnings that ``check --deep`` tells."""
    found = check(ReadFiles((), (), tuple(runs)), CheckOptions(deep=True)).findings
    return tuple(each for each in found if each.severity != "note")


def error_of(damper: Damper, judged: Runs) -> float:
    """Return the error [%] of a damper on runs, the root of the mean of its squares."""
    errors = [score_run(damper, prepare_run(run)).nrmse_percent for run in judged]
    return float(np.sqrt(np.mean(np.square(errors))))


def card_error(runs: Runs, judged: Runs, first: Damper | None = None) -> tuple[float, Damper | None]:
    """Return the error [%] on clean runs of the damper fitted to runs, infinite where there is none."""
    try:
        damper, _, _ = joint_fit(runs, first=first)
        return error_of(damper, judged), damper
    except (InputError, ConvergenceError):
        return float("inf"), None


def damaging(place: Place, clean: Runs, sound: Damper) -> tuple[float, Runs, float]:
    """Return the smallest size of a fault that doubles the card's error, its campaign, and by how much."""
    judged = clean if place.run < 0 else [clean[place.run]]
    usual = error_of(sound, judged)
    tried = []
    for size in (place.fault.sizes[-1], *place.fault.sizes[:-1]):
        broken = place.fault.inject(clean, place.run, size)
        tried.append((size, broken, card_error(broken, judged, sound)[0] / usual))
        if (tried[-1][2] >= _DOUBLED) != (len(tried) == 1):
            break  # the largest does not, or this is the first that does
    return tried[-1] if tried[-1][2] >= _DOUBLED else tried[0]


@dataclass(frozen=True)
class Outcome:
    """What ``check --deep`` said anew: of the run at fault, and of how many others."""

    said: tuple[Finding, ...]
    others: int
    right: bool

    @property
    def words(self) -> str:
        said = ", ".join(f"{f.kind} {f.size:.3g}" if f.size else f.kind for f in self.said[:3]) or "-"
        return said + (f"  also {self.others} of other runs" if self.others else "")


def outcome(place: Place, broken: Runs, before: set[tuple[str, str]], clean: Runs) -> Outcome:
    """Ask ``check --deep`` about a broken campaign."""
    told = [f for f in findings(broken) if (f.run, f.kind) not in before]
    here = [f for f in told if place.run < 0 or f.run in (clean[place.run].name, broken[place.run].name)]
    return Outcome(tuple(here), len(told) - len(here), any(f.kind in place.fault.causes for f in here))


def corpus(name: str, clean: Runs, before: set[tuple[str, str]], *, tuning: bool) -> Counter[str]:
    """Try one half of the faults in a campaign; print a line for each."""
    total: Counter[str] = Counter()
    sound = card_error(clean, clean)[1]
    for place in places(name, clean):
        if place.tuning != tuning or sound is None:
            continue
        size, broken, times = damaging(place, clean, sound)
        result = outcome(place, broken, before, clean)
        silent = not result.said and times > _DOUBLED
        total["faults"] += 1
        total["found"] += bool(result.said)
        total["right cause and run"] += result.right
        listed = name in place.fault.published
        total["silent acceptances"] += silent and not listed
        total["silent, on the published list"] += silent and listed
        mark = "+" if result.right else "~" if result.said else "P" if listed else "-"
        where = clean[place.run].name if place.run >= 0 else place.fault.extent
        print(f"  {mark} {place.fault.name:22s} {size:6.3g} {where:31s} card x{times:5.2f}  {result.words}")
    return total


def smallest(name: str, clean: Runs, before: set[tuple[str, str]]) -> None:
    """Print the smallest size of each fault that is found with its cause in a campaign."""
    done = set()
    for place in places(name, clean):
        if place.fault.name in done:
            continue
        done.add(place.fault.name)
        for size in place.fault.sizes:
            if outcome(place, place.fault.inject(clean, place.run, size), before, clean).right:
                print(f"  {name:8s} {place.fault.name:22s} {size:g} {place.fault.unit}")
                break
        else:
            print(f"  {name:8s} {place.fault.name:22s} not found, up to {place.fault.sizes[-1]:g}")


def main() -> None:
    """Print a line for each fault, then the totals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--smallest", action="store_true")
    parser.add_argument("--only", default="", help="one campaign")
    given = parser.parse_args()
    total: Counter[str] = Counter()
    for name, clean in campaigns(given.data):
        if given.only and name != given.only:
            continue
        clock = time.process_time()
        before = {(each.run, each.kind) for each in findings(clean)}
        alarms = sorted((run, kind) for run, kind in before if kind not in _TRUE_OF_CLEAN)
        total += Counter({"clean runs": len(clean), "false alarms": len(alarms)})
        print(f"{name}: {len(clean)} runs, clean: {alarms or 'nothing'}, "
              f"{time.process_time() - clock:.1f} s of CPU")  # fmt: skip
        if given.smallest:
            smallest(name, clean, before)
        else:
            total += corpus(name, clean, before, tuning=given.tuning)
    print(", ".join(f"{count} {what}" for what, count in total.items()))


if __name__ == "__main__":
    main()
