"""Diagnosis of a single run. The module ``campaign`` compares runs with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrdamper.data.diagnosis.mechanics import find_drift, find_force_lag, find_force_offset, find_wrong_sign
from mrdamper.data.diagnosis.resolution import find_few_samples, find_interference, find_noise
from mrdamper.data.diagnosis.sensors import find_clipping, find_coarse_steps, find_spikes, find_stuck_sensors
from mrdamper.data.diagnosis.timing import find_lost_samples, find_phase_jumps
from mrdamper.data.finding import Finding, severity_rank
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import (
    Recording,
    channels_of,
    find_implausible_sizes,
    find_missing_numbers,
    find_time_faults,
)
from mrdamper.errors import InputError


def diagnose(recording: Recording, prepared: PreparedRun | None = None) -> tuple[Finding, ...]:
    """Return the findings on one run, worst first. A run with a finding of severity "fault" cannot be fitted.

    Parameters
    ----------
    recording : run as read, or a ``RigRun``, in which time and ranges are valid.
    prepared : run as prepared for a fit. If it is missing, it is computed here.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # Overflow is reported as an implausible size.
        found = list(find_missing_numbers(recording))
        lengths = {len(values) for values in channels_of(recording).values()}
        if not found and len(lengths) == 1 and len(recording) > 1:
            found = [*find_time_faults(recording.time), *find_implausible_sizes(recording)]
        if not any(finding.severity == "fault" for finding in found):
            found += _diagnose_valid_record(recording, prepared)
    found.sort(key=severity_rank)
    return tuple(replace(finding, run=recording.name) for finding in found)


def _diagnose_valid_record(recording: Recording, prepared: PreparedRun | None) -> list[Finding]:
    """Return the findings of a run with valid numbers and time."""
    try:
        run = recording.checked()
    except InputError as error:
        return _fault_findings(error)
    found = [*find_lost_samples(recording), *find_phase_jumps(recording), *find_clipping(recording)]
    found += [*find_stuck_sensors(recording), *find_coarse_steps(recording), *find_spikes(recording)]
    if prepared is None:
        try:
            prepared = prepare_run(run)
        except InputError as refusal:
            try:
                prepared = prepare_run(replace(run, force=-run.force))
            except InputError:
                return [*found, *_fault_findings(refusal)]
            return [*found, find_wrong_sign(prepared)]
    found += [*find_force_offset(prepared), *find_drift(prepared), *find_force_lag(prepared)]
    return [*found, *find_few_samples(prepared), *find_noise(prepared), *find_interference(prepared)]


def _fault_findings(error: InputError) -> list[Finding]:
    """Return one finding for each fault in the error of a rejected run."""
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
