"""Findings on the timing of a run: lost samples and jumps of the displacement."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import DEVIATION_PER_MAD
from mrdamper.data.diagnosis.settings import SETTINGS
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording


def find_lost_samples(recording: Recording) -> Iterator[Finding]:
    """Generate a finding on lost samples: time steps longer than 1.5 times the median time step."""
    steps = np.diff(recording.time)
    usual = float(np.median(steps))
    lost = np.flatnonzero(steps > SETTINGS.lost_step_ratio_min * usual)
    if len(lost):
        missing = int(np.sum(np.round(steps[lost] / usual) - 1.0))
        share = 100.0 * missing / len(recording)
        yield Finding(
            kind="lost_samples",
            severity="warning" if share > 0.1 else "note",
            channel="time",
            size=float(missing),
            unit="samples",
            from_s=float(recording.time[lost[0]]),
            to_s=float(recording.time[lost[-1] + 1]),
            found=f"about {missing} samples are missing at {len(lost)} places ({percent(0.01 * share)}), "
            f"the first after sample {lost[0]}",
            effect="They are filled in by interpolation, which flattens the force at reversals",
            remedy="Check the load of the recording computer; record again if there are many such places",
        )


def find_phase_jumps(recording: Recording) -> Iterator[Finding]:
    """Generate findings on jumps of the displacement between two samples with regular time stamps.

    Lost or doubled samples cause such jumps. A spike is not a jump because the signal returns after it.
    """
    x = recording.displacement
    if len(x) < SETTINGS.jump_samples_min:
        return
    steps = np.diff(x) / np.diff(recording.time)
    near = np.median([steps[:-4], steps[1:-3], steps[3:-1], steps[4:]], axis=0)
    away = np.concatenate([[0.0, 0.0], steps[2:-2] - near, [0.0, 0.0]])
    usual = float(np.sqrt(np.mean(steps**2)))
    noise = DEVIATION_PER_MAD * float(np.median(np.abs(away)))
    far = np.abs(away) > max(SETTINGS.jump_slope_ratio_min * usual, SETTINGS.jump_noise_ratio_min * noise)
    # A spike has two consecutive steps of opposite sign, a jump has one step. Spikes are excluded.
    back = np.abs(away[:-1] + away[1:]) < 0.5 * np.maximum(np.abs(away[:-1]), np.abs(away[1:]))
    far[:-1] &= ~back
    far[1:] &= ~back
    places = np.flatnonzero(far)
    if not len(places) or len(places) > 0.01 * len(x):
        return
    samples = float(
        np.sum(np.round(np.abs(away[places]) / np.maximum(np.abs(near[places - 2]), 0.3 * usual)))
    )
    yield Finding(
        kind="phase_jumps",
        channel="time",
        size=samples,
        unit="samples",
        from_s=float(recording.time[places[0]]),
        to_s=float(recording.time[places[-1] + 1]),
        found=f"the displacement jumps at {len(places)} place{'s' if len(places) > 1 else ''} where time "
        f"goes on evenly, the first at {recording.time[places[0]]:.4g} s: about {samples:.0f} samples "
        "are lost or doubled",
        effect="Velocity there is wrong, and all later samples are shifted in time",
        remedy="Check the load of the recording computer and its buffers; cut the run at these places",
    )
