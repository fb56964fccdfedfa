"""The diagnosis of one run; ``campaign`` compares runs with each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mrdamper.data.diagnosis.mechanics import find_drift, find_force_lag, find_force_offset, find_wrong_sign
from mrdamper.data.diagnosis.resolution import (
    find_few_cycles,
    find_few_samples,
    find_interference,
    find_noise,
)
from mrdamper.data.diagnosis.sensors import (
    find_clipping,
    find_coarse_steps,
    find_implausible_sizes,
    find_spikes,
    find_stuck_sensors,
)
from mrdamper.data.diagnosis.timing import find_lost_samples, find_missing_numbers, find_phase_jumps
from mrdamper.data.finding import Finding, worst_first
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import Recording, find_time_faults
from mrdamper.errors import InputError


def diagnose(recording: Recording, prepared: PreparedRun | None = None) -> tuple[Finding, ...]:
    """Return what is wrong with a run, worst first; a run with a fault cannot be fitted as it is.

    Parameters
    ----------
    recording : as read; a ``RigRun`` has passed the checks on time and range already
    prepared : the run as prepared for a fit, when that was done; else it is prepared here
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is a fault of its size
        found = list(find_missing_numbers(recording))
        if not found and _same_lengths(recording) and len(recording) > 1:
            found = [*find_time_faults(recording.time), *find_implausible_sizes(recording)]
        if not any(finding.severity == "fault" for finding in found):
            found += _of_a_whole_record(recording, prepared)
    found.sort(key=worst_first)
    return tuple(replace(finding, run=recording.name) for finding in found)


def _of_a_whole_record(recording: Recording, prepared: PreparedRun | None) -> list[Finding]:
    """Return the findings of a run whose numbers and time are sound."""
    try:
        run = recording.checked()
    except InputError as error:
        return _refused(error)
    found = [*find_lost_samples(recording), *_ask_sensors(recording)]
    if prepared is None:
        try:
            prepared = prepare_run(run)
        except InputError as refusal:
            try:
                prepared = prepare_run(replace(run, force=-run.force))
            except InputError:
                return [*found, *_refused(refusal)]
            return [*found, find_wrong_sign(prepared)]
    for find in (
        find_force_offset,
        find_drift,
        find_force_lag,
        find_few_cycles,
        find_few_samples,
        find_noise,
        find_interference,
    ):
        found += find(prepared)
    return found


def _ask_sensors(recording: Recording) -> Iterable[Finding]:
    for find in (find_phase_jumps, find_clipping, find_stuck_sensors, find_coarse_steps, find_spikes):
        yield from find(recording)


def _refused(error: InputError) -> list[Finding]:
    """Return one finding for each fault of a refused run; the run is named by the finding."""
    return [
        Finding(
            kind="refused",
            severity="fault",
            found=f"{fault.found}; expected {fault.expected}" if fault.expected else fault.found,
            effect="The run is refused",
            remedy=fault.remedy,
        )
        for fault in error.faults or (error,)
    ]


def _same_lengths(recording: Recording) -> bool:
    sizes = {
        array.shape for array in (recording.time, recording.displacement, recording.force, recording.command)
    }
    return len(sizes) == 1
