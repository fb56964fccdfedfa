"""Join runs that are parts of one record.

Loggers divide long records into files of equal size. The clock continues in the next file. If each part were
used alone, it would count as much as a whole run in a fit and would need its own warm-up of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrdamper.arrays import rms
from mrdamper.data.records import CHANNELS, Dataset, RigRun, channels_of, command_slack

_SEAM_STEPS_MAX = 2.5  # Max time [steps] from the last sample of a part to the first of the next.
_RMS_RATIO_MAX = 1.3  # max ratio of the rms values (displacement, speed) of two parts
_SEAM_TEMPERATURE_K_MAX = 1.0


def join_continuations(runs: Dataset) -> tuple[Dataset, tuple[str, ...]]:
    """Return the joined runs, and the names of the runs that were appended to another run.

    A run continues a previous run if it begins at most 2.5 time steps after the end of the previous run. It
    must be from a different file, have the same constant command, and continue the motion and the
    temperature. A joined run has the name of its first part.
    """
    first_parts: dict[str, list[RigRun]] = {}  # name of the last run of a record -> all parts of the record
    for run in sorted(runs, key=lambda run: (float(run.time[0]), run.name)):
        previous = [name for name, parts in first_parts.items() if _continues(run, parts[-1])]
        parts = first_parts.pop(previous[0]) if len(previous) == 1 else []
        first_parts[run.name] = [*parts, run]
    records = {parts[0].name: _join(parts) for parts in first_parts.values()}
    continued = tuple(run.name for run in runs if run.name not in records)
    joined = tuple(records[run.name] for run in runs if run.name in records)
    return replace(runs, runs=joined), continued


def _continues(run: RigRun, previous: RigRun) -> bool:
    step_s = float(previous.time[-1] - previous.time[0]) / (len(previous) - 1)
    is_next = -0.5 * step_s < run.time[0] - previous.time[-1] < _SEAM_STEPS_MAX * step_s
    if not is_next or run.source == previous.source != "":  # A file is never a continuation of itself.
        return False
    return _has_same_settings(run, previous) and _has_same_motion(run, previous)


def _has_same_settings(run: RigRun, previous: RigRun) -> bool:
    """Return True if the runs have the same channels, command and temperature."""
    settings = {(each.command_unit, each.session, *channels_of(each)) for each in (run, previous)}
    command, before = run.constant_command, previous.constant_command
    if len(settings) > 1 or command is None or before is None:
        return False
    seam_K = 0.0
    if run.temperature is not None and previous.temperature is not None:
        seam_K = abs(float(run.temperature[0] - previous.temperature[-1]))
    return abs(command - before) <= command_slack(command) and seam_K <= _SEAM_TEMPERATURE_K_MAX


def _has_same_motion(run: RigRun, previous: RigRun) -> bool:
    """Return True if displacement continues without a jump, and rms displacement and speed are similar."""
    steps_m = [np.abs(np.diff(each.displacement)) for each in (previous, run)]
    seam_m = abs(float(run.displacement[0] - previous.displacement[-1]))
    rms_values = [rms(each) for each in steps_m], [np.std(each.displacement) for each in (previous, run)]
    return seam_m <= _SEAM_STEPS_MAX * max(float(each.max()) for each in steps_m) and all(
        max(pair) <= _RMS_RATIO_MAX * min(pair) for pair in rms_values
    )


def _join(parts: Sequence[RigRun]) -> RigRun:
    """Return the parts as one run. A sample that is in two adjacent parts is used once."""
    ends = [float(np.nextafter(part.time[-1], np.inf)) for part in parts]
    kept = [parts[0], *(part.between(end, None) for part, end in zip(parts[1:], ends, strict=False))]
    channels = [name for name in CHANNELS if getattr(parts[0], name) is not None]
    columns: dict[str, Any] = {key: np.concatenate([getattr(run, key) for run in kept]) for key in channels}
    return replace(parts[0], **columns)
