"""Inject faults into test data; count findings and false alarms of ``check``.

    python -m bench.faults --data DIR               half of the faults, for reports
    python -m bench.faults --data DIR --tuning      the other half, for development

The tested command is ``check --deep``. The runs without injected faults are called sound. The size of each
fault is the smallest size that doubles the error of a card, fitted to the faulty runs, on the sound runs. If
no size doubles the error, the largest size is used. A *silent acceptance* is a fault that doubles the error
but causes no finding. The hash of name and location of a fault decides to which half the fault belongs.
``DIR`` contains public runs (``utfsm_sine*``, ``utfpr*``). Without ``DIR``, only virtual dampers are tested.
"""

from __future__ import annotations

import argparse
import hashlib
from collections import Counter
from collections.abc import Iterator
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

# Findings that are true for the public runs (docs/check.md) and therefore do not count as false alarms.
TRUE_FINDINGS = {
    "force_offset", "force_level_changes", "position_drift", "force_drift", "poor_repeatability",
    "force_noise",
}  # fmt: skip
ERROR_RATIO = 2.0


def campaigns(folder: Path | None) -> Iterator[tuple[str, Runs]]:
    """Generate name and runs of each campaign. The dampers are real or virtual."""
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


def locations(fault: Fault, runs: Runs) -> list[int]:
    """Return the indices of two runs that can show the fault; [-1] if the fault affects all runs."""
    if fault.extent != "run":
        return [-1]
    suitable = [k for k, run in enumerate(runs) if fault.where(run)]
    return [suitable[k * len(suitable) // 5] for k in (1, 3)]


def is_tuning(campaign: str, fault: Fault, index: int) -> bool:
    """Return True if a fault in the run ``index`` belongs to the half for development."""
    return hashlib.sha256(f"{campaign}/{fault.name}/{index}".encode()).digest()[0] % 2 == 0


def findings(runs: Runs) -> tuple[Finding, ...]:
    """Run ``check --deep``; return its findings except notes."""
    report = check(ReadFiles((), (), tuple(runs)), CheckOptions(deep=True))
    return tuple(each for each in report.findings if each.severity != "note")


def error_of(damper: Damper, runs: Runs) -> float:
    """Return the root mean square of the errors [%] of a damper on several runs."""
    errors = [score_run(damper, prepare_run(run)).nrmse_percent for run in runs]
    return float(np.sqrt(np.mean(np.square(errors))))


def damaging(fault: Fault, index: int, sound: Runs, damper: Damper) -> tuple[float, Runs, float]:
    """Find the smallest size that doubles the error; return size, runs, error ratio.

    If no size doubles the error, the largest size is used.
    """
    judged = sound if index < 0 else [sound[index]]
    tried = []
    for size in (fault.sizes[-1], *fault.sizes[:-1]):
        faulty = fault.inject(sound, index, size)
        try:
            ratio = error_of(joint_fit(faulty, first=damper)[0], judged) / error_of(damper, judged)
        except (InputError, ConvergenceError):
            ratio = float("inf")
        tried.append((size, faulty, ratio))
        if (ratio >= ERROR_RATIO) != (len(tried) == 1):
            break  # The first tried size, the largest, is too small; or a smaller size doubles the error.
    return tried[-1] if tried[-1][2] >= ERROR_RATIO else tried[0]


def judge_campaign(name: str, sound: Runs, before: set[tuple[str, str]], *, tuning: bool) -> Counter[str]:
    """Print a line for each fault (for tuning or for reports); return the totals."""
    total: Counter[str] = Counter()
    damper = joint_fit(sound)[0]
    for fault, index in [(each, k) for each in FAULTS for k in locations(each, sound)]:
        if is_tuning(name, fault, index) != tuning:
            continue
        size, faulty, ratio = damaging(fault, index, sound, damper)
        new = [each for each in findings(faulty) if (each.run, each.kind) not in before]
        here = [each for each in new if index < 0 or each.run in (sound[index].name, faulty[index].name)]
        is_right = any(each.kind in fault.causes for each in here)
        total += Counter(
            {
                "faults": 1,
                "found": bool(here),
                "right cause and run": is_right,
                "silent acceptances": not here and ratio > ERROR_RATIO,
            }
        )
        mark = "+" if is_right else "~" if here else "-"
        kinds = ", ".join(each.kind for each in here[:3]) or "no finding"
        where = sound[index].name if index >= 0 else fault.extent
        print(f"  {mark} {fault.name:22s} {size:6.3g} {where:31s} card x{ratio:5.2f}  {kinds}", flush=True)
    return total


def main() -> None:
    """Print a line for each fault, then the totals."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path)
    parser.add_argument("--tuning", action="store_true")
    arguments = parser.parse_args()
    total: Counter[str] = Counter()
    for name, sound in campaigns(arguments.data):
        before = {(each.run, each.kind) for each in findings(sound)}
        alarms = sorted(each for each in before if each[1] not in TRUE_FINDINGS)
        print(f"{name}: {len(sound)} runs, false alarms: {alarms or 'no'}", flush=True)
        total += Counter({"sound runs": len(sound), "false alarms": len(alarms)})
        total += judge_campaign(name, sound, before, tuning=arguments.tuning)
    print(", ".join(f"{count} {what}" for what, count in total.items()))


if __name__ == "__main__":
    main()
