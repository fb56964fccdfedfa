"""Diagnosis of a single run. The module ``campaign`` compares runs with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrdamper.data import records
from mrdamper.data.diagnosis import mechanics, resolution, sensors
from mrdamper.data.finding import Finding, severity_rank
from mrdamper.data.prepare import OppositeSignError, PreparedRun, prepare_run
from mrdamper.errors import InputError

OF_RECORDING = (
    *(sensors.find_lost_samples, sensors.find_phase_jumps, sensors.find_clipping),
    *(sensors.find_stuck_sensors, sensors.find_coarse_steps, sensors.find_spikes),
)
OF_PREPARED_RUN = (
    *(mechanics.find_force_offset, mechanics.find_drift, mechanics.find_force_lag),
    *(resolution.find_few_samples, resolution.find_noise, resolution.find_interference),
)
"""Functions that generate findings on a valid run as read, and on the prepared run."""


def diagnose(recording: records.Recording, prepared: PreparedRun | None = None) -> tuple[Finding, ...]:
    """Return the findings on one run, worst first. A run with a finding of severity "fault" cannot be fitted.

    Parameters
    ----------
    recording : run as read, or a ``RigRun``, in which time and ranges are valid.
    prepared : run as prepared for a fit. If it is missing, it is computed here.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # Overflow is reported as an implausible size.
        found = list(records.find_missing_numbers(recording))
        lengths = {len(values) for values in records.channels_of(recording).values()}
        if not found and len(lengths) == 1 and len(recording) > 1:
            found = [*records.find_time_faults(recording.time), *records.find_implausible_sizes(recording)]
        if not any(finding.severity == "fault" for finding in found):
            found += _diagnose_valid_record(recording, prepared)
    found.sort(key=severity_rank)
    return tuple(replace(finding, run=recording.name) for finding in found)


def _diagnose_valid_record(recording: records.Recording, prepared: PreparedRun | None) -> list[Finding]:
    """Return the findings of a run with valid numbers and time."""
    try:
        run = recording.checked()
    except InputError as error:
        return _fault_findings(error)
    found = [finding for find in OF_RECORDING for finding in find(recording)]
    if prepared is None:
        try:
            prepared = prepare_run(run)
        except InputError as refusal:
            return [*found, *_fault_findings(refusal)]
    return [*found, *(finding for find in OF_PREPARED_RUN for finding in find(prepared))]


def _fault_findings(error: InputError) -> list[Finding]:
    """Return one finding for each fault in the error of a rejected run."""
    faults = {
        f"{each.found}; expected {each.expected}" if each.expected else each.found: each.remedy
        for each in error.faults or (error,)
    }
    refused = Finding("refused", "", "The run is refused", "", severity="fault")
    if isinstance(error, OppositeSignError):
        refused = replace(refused, kind="force_sign", channel="force", size=error.correlation)
    return [replace(refused, found=found, remedy=fix) for found, fix in faults.items()]
