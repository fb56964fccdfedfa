"""``mrdamper check``: what is wrong with runs before they are fitted, and how their files were understood.

Files that cannot be read are told beside the others; runs are diagnosed one by one (``data.diagnosis``).
Nothing is repaired and nothing is fitted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.data.channels import read_channel_map
from mrdamper.data.diagnosis.diagnose import compare, diagnose
from mrdamper.data.diagnosis.finding import SEVERITIES, Finding, worst_first
from mrdamper.data.prepare import PreparedRun
from mrdamper.data.readers import RigFile, find_files, joined_faults, read_file
from mrdamper.data.records import Recording
from mrdamper.errors import InputError
from mrdamper.runtime.outputs import atomic_output, write_json, write_table
from mrdamper.schema import Json

__all__ = ["check", "findings_of", "render_check"]

_COLUMNS = (
    "run",
    "severity",
    "kind",
    "channel",
    "size",
    "unit",
    "from_s",
    "to_s",
    "found",
    "effect",
    "remedy",
)


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A run and what was found in it, worst first."""

    recording: Recording
    findings: tuple[Finding, ...]


def check(paths: Sequence[str | Path], *, channels: Path | None = None, out: Path | None = None) -> Json:
    """Diagnose runs; with ``out`` write check.html, check.json and findings.csv there.

    Returns
    -------
    The answer of ``--json``; ``usable`` is false when a run has a fault.

    Raises
    ------
    InputError
        No file could be read.
    """
    chosen = None if channels is None else read_channel_map(channels)
    read: list[tuple[Path, RigFile]] = []
    unreadable: list[tuple[Path, str]] = []
    for path in find_files(list(paths)):
        try:
            read.append((path, read_file(path, chosen)))
        except InputError as error:
            unreadable.append((path, str(error)))
    if not read:
        raise InputError(joined_faults([said for _, said in unreadable]))
    recordings = [recording for _, file in read for recording in file.recordings]
    twins = list(compare(recordings))
    runs = [
        _Run(
            recording,
            tuple(
                sorted(
                    (*diagnose(recording), *(t for t in twins if t.run == recording.name)), key=worst_first
                )
            ),
        )
        for recording in recordings
    ]
    findings = [finding for run in runs for finding in run.findings]
    counts = Counter(finding.severity for finding in findings)
    answer: Json = {
        "usable": not counts["fault"],
        "counts": {severity: counts[severity] for severity in SEVERITIES},
        "files": [
            {
                "path": str(path),
                "understood": file.layout.in_words(),
                "layout": file.layout.to_dict(),
                "columns": [
                    {"role": each.role, "name": each.name, "unit": each.unit} for each in file.columns
                ],
                "runs": [recording.name for recording in file.recordings],
            }
            for path, file in read
        ],
        "runs": [_row(run) for run in runs],
        "findings": [dict(finding.to_dict()) for finding in findings],
        "unreadable": [{"path": str(path), "error": said} for path, said in unreadable],
    }
    if out is not None:
        with atomic_output(out) as beside:
            answer |= {"report": str(out / "check.html")}
            (beside / "check.html").write_text(render_check(answer), encoding="utf-8")
            write_json(beside / "check.json", answer)
            rows = [{key: finding.to_dict()[key] for key in _COLUMNS} for finding in findings]
            write_table(beside / "findings.csv", rows or [dict.fromkeys(_COLUMNS)])
    return answer


def findings_of(runs: Iterable[PreparedRun]) -> tuple[Finding, ...]:
    """Return what prepared runs show by themselves, for the report of a fit."""
    prepared = tuple(runs)
    found = [finding for run in prepared for finding in diagnose(run.run, run)]
    return tuple(sorted((*found, *compare([run.run for run in prepared])), key=worst_first))


def render_check(answer: Json) -> str:
    """Return the page's HTML."""
    from mrdamper.report.page import environment

    return environment().get_template("check.html.j2").render(it=answer)


def _row(run: _Run) -> Json:
    recording, time = run.recording, run.recording.time
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) and np.isfinite(steps).all() else 0.0
    return {
        "name": recording.name,
        "source": recording.source,
        "samples": len(recording),
        "rate_Hz": 1.0 / step if step > 0.0 else None,
        "duration_s": _finite(time[-1] - time[0]) if len(time) else None,
        "stroke_mm": _span(recording.displacement, 1e3),
        "force_range_N": _span(recording.force, 1.0),
        "worst": run.findings[0].severity if run.findings else None,
        "findings": [finding.kind for finding in run.findings],
    }


def _span(values: np.ndarray, scale: float) -> float | None:
    return _finite(scale * float(np.max(values) - np.min(values))) if len(values) else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
