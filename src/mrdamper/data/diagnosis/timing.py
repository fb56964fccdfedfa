"""Findings on time and on missing numbers: what can be said before anything else is looked at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.finding import Finding, percent
from mrdamper.data.records import Recording

_LOST = 1.5  # steps: a longer one lost a sample, or more
_JUMP = 0.6  # of the rms step of the displacement,
_ABOVE_NOISE = 10.0  # and of the scatter of its steps about their neighbours'
_FEWEST = 64  # samples, below which neighbours say nothing


def channels_of(recording: Recording) -> dict[str, FloatArray]:
    """Return the channels that a recording has, by role."""
    command = "current" if recording.command_unit == "A" else "voltage"
    channels = {
        "time": recording.time,
        "displacement": recording.displacement,
        "force": recording.force,
        command: recording.command,
    }
    if recording.velocity is not None:
        channels["velocity"] = recording.velocity
    if recording.temperature is not None:
        channels["temperature"] = recording.temperature
    return channels


def find_missing_numbers(recording: Recording) -> Iterator[Finding]:
    """Give the channels that hold NaN or infinity."""
    for role, values in channels_of(recording).items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            first, last = int(bad[0]), int(bad[-1])
            yield Finding(
                kind="missing_numbers",
                severity="fault",
                channel=role,
                size=float(len(bad)),
                unit="samples",
                from_s=_finite(recording.time, first),
                to_s=_finite(recording.time, last),
                found=f"{role} is no finite number at {len(bad)} samples, the first at sample {first}",
                effect="No fit can use the run: an error over such samples has no value",
                remedy="Fill the empty cells in the source, or cut the segment out of the file",
            )


def find_lost_samples(recording: Recording) -> Iterator[Finding]:
    """Yield lost samples of a time that increases without gaps."""
    steps = np.diff(recording.time)
    usual = float(np.median(steps))
    lost = np.flatnonzero(steps > _LOST * usual)
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
            remedy="Check the load of the recording computer; record again when the places are many",
        )


def find_phase_jumps(recording: Recording) -> Iterator[Finding]:
    """Give places where the motion jumps ahead or back between two samples that the clock calls neighbours.

    A smooth motion has neither. A spike goes and comes back; samples that were lost or written twice do not.
    """
    x = recording.displacement
    if len(x) < _FEWEST:
        return
    steps = np.diff(x) / np.diff(recording.time)
    near = np.median([steps[:-4], steps[1:-3], steps[3:-1], steps[4:]], axis=0)
    away = np.concatenate([[0.0, 0.0], steps[2:-2] - near, [0.0, 0.0]])
    usual = float(np.sqrt(np.mean(steps**2)))
    noise = 1.4826 * float(np.median(np.abs(away)))
    far = np.abs(away) > max(_JUMP * usual, _ABOVE_NOISE * noise)
    # a spike leaves two steps of opposite sign side by side
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
        effect="Velocity there is wrong, and all that follows is shifted against the clock",
        remedy="Check the load of the recording computer and its buffers; cut the run at these places",
    )


def _finite(time: FloatArray, k: int) -> float | None:
    return float(time[k]) if np.isfinite(time[k]) else None
