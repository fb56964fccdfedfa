"""The job ``check``: find faults in runs, and report how files were interpreted.

Unreadable files are part of the report. Each run is diagnosed (``data.diagnosis``). Then the runs are
compared with one another. No run is changed. With the option ``deep``, one model is fitted to all runs to
find runs that deviate from the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.diagnosis.campaign import HELD_OUT_EFFECT, compare
from mrdamper.data.diagnosis.declared import (
    find_against_names,
    find_implausible_damper,
    find_odd_siblings,
)
from mrdamper.data.diagnosis.diagnose import diagnose
from mrdamper.data.finding import SEVERITIES, Finding, Inference, Severity, without_repeats
from mrdamper.data.formats.table import Layout
from mrdamper.data.prepare import PreparedRun
from mrdamper.data.proposal.column import Column
from mrdamper.data.proposal.questions import Question
from mrdamper.data.readers import ReadFiles, UnreadableFile
from mrdamper.data.records import Recording, accepted_runs
from mrdamper.identify.consistency.joint import joint_test
from mrdamper.identify.consistency.runs import find_deviations
from mrdamper.jobs.channel_map import WrittenMap, write_map
from mrdamper.jobs.options import CheckOptions
from mrdamper.models.damper import Damper
from mrdamper.results import JobResult
from mrdamper.runtime.pool import Pool
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import finite_or_none

_USUAL = CheckOptions()

HELD_OUT_KINDS = frozenset(
    {
        "coarse_steps",
        "duplicate",
        "few_samples_per_cycle",
        "force_level_changes",
        "force_noise",
        "interference",
        "lost_samples",
        "phase_jumps",
        "poor_repeatability",
        "two_dampers",
    }
)
"""Kinds of findings whose text is also correct for a held-out run, because it does not mention the fit."""


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A file with its interpretation: layout, columns, names of the runs, and inferred values."""

    path: Path
    layout: Layout
    columns: tuple[Column, ...]
    runs: tuple[str, ...]
    inferred: tuple[Inference, ...] = ()


@dataclass(frozen=True, slots=True)
class CheckedRun:
    """Amplitude, forces and other values of a run (None: unknown), and its findings, worst first."""

    name: str
    source: str
    samples: int
    rate_Hz: float | None
    duration_s: float | None
    stroke_mm: float | None
    force_range_N: float | None
    findings: tuple[Finding, ...]
    samples_drawn: FloatArray = field(repr=False, compare=False)  # displacement [mm], force [N], shape (n, 2)

    @property
    def max_severity(self) -> Severity | None:
        return self.findings[0].severity if self.findings else None


@dataclass(frozen=True, slots=True, repr=False)
class CheckResult(JobResult):
    """Findings about runs and their files, and a channel map that describes how the files were read."""

    _job = "check"
    files: tuple[CheckedFile, ...]
    runs: tuple[CheckedRun, ...]
    unreadable: tuple[UnreadableFile, ...]
    channel_map: WrittenMap
    groups: tuple[Finding, ...] = ()  # findings about several runs; or why the fit of all runs failed

    @property
    def questions(self) -> tuple[Question, ...]:
        """Return questions that the user must answer before files can be read."""
        asked = [question for file in self.unreadable for question in file.questions]
        return tuple({(each.role, each.topic, each.text): each for each in reversed(asked)}.values())[::-1]

    @property
    def findings(self) -> tuple[Finding, ...]:
        return (*(finding for run in self.runs for finding in run.findings), *self.groups)

    @property
    def counts(self) -> dict[Severity, int]:
        """Return the number of findings of each severity, faults first."""
        return {severity: sum(f.severity == severity for f in self.findings) for severity in SEVERITIES}

    @property
    def usable(self) -> bool:
        """Return True if the runs can be fitted without changes."""
        return bool(self.runs) and not any(finding.severity == "fault" for finding in self.findings)


def check(files: ReadFiles, options: CheckOptions = _USUAL, *, on_progress: Progress = silent) -> CheckResult:
    """Diagnose single runs, then compare the runs; with the option ``deep``, fit one model to all runs."""
    together = campaign_findings(files.runs)
    if options.deep:
        together += joint_test(files.runs)
    told = [*together, *files.findings]
    names = {run.name for run in files.runs}
    runs = []
    for number, run in enumerate(files.runs):
        on_progress(ProgressUpdate(done=number, total=len(files.runs), text=run.name))
        found = (*diagnose(run), *(each for each in told if each.run == run.name))
        runs.append(_checked(run, tuple(without_repeats(found))))
    return CheckResult(
        files=tuple(
            CheckedFile(
                path, file.layout, file.columns, tuple(each.name for each in file.recordings), file.inferred
            )
            for path, file in files.files
        ),
        runs=tuple(runs),
        unreadable=files.unreadable,
        channel_map=write_map(files),
        groups=tuple(each for each in told if each.run not in names),
    )


def campaign_findings(runs: Sequence[Recording], held_out: Sequence[Recording] = ()) -> list[Finding]:
    """Compare runs with each other, and with the values in their names.

    Findings are, for example, runs of another damper and wrong currents in names. Invalid recordings are
    ignored, for example if time does not increase.
    """
    runs, held_out = accepted_runs(runs), accepted_runs(held_out)
    findings = [
        finding for find in (find_against_names, find_odd_siblings) for finding in find((*runs, *held_out))
    ]
    return [*compare(runs, held_out), *findings, *find_implausible_damper(runs)]


def findings_of(
    training: Sequence[PreparedRun],
    held_out: Sequence[PreparedRun],
    damper: Damper,
    reading: Sequence[Finding] = (),
    *,
    free: Sequence[str] = (),
) -> tuple[Finding, ...]:
    """Return all findings about the training runs and held-out runs of a fit.

    Sources are each run, the comparison of runs, and deviations of training runs from the fitted damper. The
    fit does not use held-out runs. Therefore findings about a held-out run mention no effect on the fit.

    Parameters
    ----------
    damper : damper fitted to the training runs
    reading : findings that were made while the files were read; they are included in the result
    free : names of the fitted parameters that are not at a bound
    """
    names = {run.name for run in held_out}
    sources: list[Callable[[], list[Finding]]] = [
        lambda: [finding for run in (*training, *held_out) for finding in diagnose(run.run, run)],
        lambda: campaign_findings([run.run for run in training], [run.run for run in held_out]),
        lambda: list(find_deviations(damper, training, free=free)),
    ]
    *found, deviations = Pool().map(lambda source: source(), sources)
    of_runs = [
        _finding_if_held_out(finding) if finding.run in names else finding
        for findings in found
        for finding in findings
    ]
    return tuple(without_repeats([*reading, *of_runs, *deviations]))


def _finding_if_held_out(finding: Finding) -> Finding:
    """Return the finding with an effect that is correct for a held-out run."""
    return finding if finding.kind in HELD_OUT_KINDS else replace(finding, effect=HELD_OUT_EFFECT)


def _checked(run: Recording, findings: tuple[Finding, ...]) -> CheckedRun:
    time = run.time
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) and np.isfinite(steps).all() else 0.0
    return CheckedRun(
        name=run.name,
        source=run.source,
        samples=len(run),
        rate_Hz=1.0 / step if step > 0.0 else None,
        duration_s=finite_or_none(time[-1] - time[0]) if len(time) else None,
        stroke_mm=_span(run.displacement, 1e3),
        force_range_N=_span(run.force, 1.0),
        findings=findings,
        samples_drawn=_plot_samples(run),
    )


def _plot_samples(run: Recording) -> FloatArray:
    """Return plotted samples: displacement [mm] and force [N], shape (n, 2)."""
    sample_count_max = 400  # max number of plotted samples of each run
    count = min(len(run.displacement), len(run.force))
    chosen = np.unique(
        np.linspace(0, max(count - 1, 0), min(count, sample_count_max)).round().astype(np.intp)
    )
    return np.column_stack([1e3 * run.displacement[chosen], run.force[chosen]])


def _span(values: FloatArray, scale: float) -> float | None:
    return finite_or_none(scale * float(np.max(values) - np.min(values))) if len(values) else None
