"""Windows around changes of the command, for runs whose command is not held between its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray, rms
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.actuation.least_squares import LaggedForces
from mrdamper.identify.actuation.settings import ActuationSettings
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import Drive, open_drive, simulate, simulate_each

WindowedRun = tuple[Drive, FloatArray, list[slice]]
"""A run with its measured force [N] and its windows."""


def find_windows(command: FloatArray, step_s: float, settings: ActuationSettings) -> list[slice]:
    """Return the windows around the changes of a command [A or V]. Windows that touch are joined."""
    span = float(np.ptp(command))
    delay = max(round(settings.change_duration_s / step_s), 1)
    changes = np.flatnonzero(np.abs(command[delay:] - command[:-delay]) > settings.step_size_min * span)
    windows: list[slice] = []
    for k in changes.tolist() if span > 0.0 else []:
        start = max(k - round(settings.window_before_s / step_s), 0)
        stop = min(k + delay + round(settings.window_after_s / step_s), len(command))
        if windows and start <= windows[-1].stop:
            start = windows.pop().start
        windows.append(slice(start, stop))
    return windows


def select_windows(
    still: Damper, runs: Sequence[PreparedRun], settings: ActuationSettings
) -> list[WindowedRun]:
    """Return the runs with windows in which the command changes the force.

    Runs with long windows are omitted if others remain. Raise InputError if no run has a window.
    """
    selected: list[WindowedRun] = []
    short = []
    force_min_N = settings.window_force_min * max(float(np.abs(run.force).max()) for run in runs)
    for run in runs:
        path, drive = run.trajectory, open_drive(run.trajectory)
        constant = replace(path, command=np.full(len(path), path.command.min()))
        change_N = simulate(still, drive) - simulate(still, constant)  # The motion is the same in both.
        windows = [
            window
            for window in find_windows(path.command, path.step, settings)
            if np.ptp(change_N[window]) > force_min_N and window.start >= run.scored_from
        ]
        if windows:
            selected.append((drive, run.force, windows))
            longest_s = max(window.stop - window.start for window in windows) * path.step
            if longest_s <= settings.window_duration_max_s:
                short.append(selected[-1])
    if not selected:
        raise InputError(
            found="no run has a step of the command that moves the force",
            expected="runs such as a triangle of constant speed with the current stepped at mid-stroke",
            remedy="Without one the lags are unknown",
        )
    return short or selected


def window_error(forces: Sequence[FloatArray], runs: Sequence[WindowedRun]) -> FloatArray:
    """Return the force error [N] in all windows. A gain and an offset are fitted in each window."""
    errors = []
    for force, (_, measured_force, windows) in zip(forces, runs, strict=True):
        for window in windows:
            model, measured = force[window], measured_force[window]
            model, measured = model - model.mean(), measured - measured.mean()
            square = float(model @ model)
            gain = float(model @ measured) / square if square > 0.0 else 0.0
            errors.append(measured - gain * model)
    return np.concatenate(errors)


def window_rmse_N(
    still: Damper, lags: Actuation | None, runs: Sequence[WindowedRun], settings: ActuationSettings
) -> float:
    """Return the RMS force error [N] in all windows of a damper behind an actuation, or without one."""
    drives = [drive for drive, _, _ in runs]
    if lags is None:
        return rms(window_error(simulate_each(still, drives), runs))
    return rms(window_error(LaggedForces(still, drives, settings.oversampling).behind(lags), runs))
