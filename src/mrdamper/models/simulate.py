"""Simulation: the force of a damper driven through a trajectory, and how it moves with its numbers.

Kernel laws run in C; a user's law in Python runs through the reference integrator. Both answer the same
two questions (``simulate`` and ``sensitivities``), so that nothing above this module asks which it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper

__all__ = ["LAG", "Drive", "Sensitivity", "open_drive", "sensitivities", "simulate"]

FloatArray = NDArray[np.float64]

LAG = "command_lag_s"
"""The name under which a damper's command lag stands among its numbers."""

_DIFFERENCE = 1e-5  # relative step of the central differences that serve a law in Python


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A trajectory made ready for many simulations: the kernel's record of it, and its command.

    ``constant`` is the command when it does not vary over the run, else ``None``.
    """

    trajectory: Trajectory
    record: core.Record
    constant: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Force and tangent columns along a run: d force / d number = combine @ columns.

    ``columns`` are the kernel's, one per coefficient that moves, shape (d, n); ``combine``, shape
    (numbers, d), turns them into columns per number. Keeping them apart lets Gram sums be taken over
    few columns.
    """

    force: FloatArray
    columns: FloatArray
    combine: FloatArray


def open_drive(trajectory: Trajectory, *, longest_step: float = core.LONGEST_STEP) -> Drive:
    """Return the trajectory made ready for the kernel."""
    command = trajectory.command
    constant = float(command[0]) if np.ptp(command) == 0.0 else None
    return Drive(trajectory, core.open_record(trajectory, longest_step=longest_step), constant)


def simulate(
    damper: Damper, trajectory: Trajectory | Drive, *, form: Literal["record", "causal"] = "record"
) -> FloatArray:
    """Return the damper's force [N] at every sample of a trajectory, shape (n,).

    Parameters
    ----------
    form : ``record`` uses whole monotone pieces between turning points located inside the sample
        interval; ``causal`` is the per-sample map of a real-time target. At 1 kHz they agree within
        1e-4 of the peak force.

    Raises
    ------
    InputError
        When the law is not well posed at a command of the trajectory.
    """
    drive = trajectory if isinstance(trajectory, Drive) else open_drive(trajectory)
    if damper.law.kernel is None:
        from mrdamper.models.reference import simulate_reference

        return simulate_reference(damper, drive.trajectory, tolerance=1e-8)
    command = _applied(damper, drive)[0]
    coefficients = damper.coefficients_at(command)
    violations = damper.law.violations(dict(zip(damper.law.names, coefficients, strict=True)))
    if violations:
        raise InputError("; ".join(violations))
    coefficients = np.ascontiguousarray(coefficients[:, 0] if len(command) == 1 else coefficients)
    if form == "causal":
        return core.causal(damper.law.kernel, drive.record, coefficients)
    return core.run(damper.law.kernel, drive.record, coefficients)[0]


def sensitivities(
    damper: Damper, drive: Drive, numbers: Sequence[str], *, columns: FloatArray | None = None
) -> Sensitivity:
    """Return force and tangents of a damper along a run with respect to the named numbers.

    The conditions of the law are not checked here: a fit keeps inside them.
    """
    if damper.law.kernel is None:
        return _by_differences(damper, drive, numbers)
    command, by_lag = _applied(damper, drive)
    coefficients = damper.coefficients_at(command)
    moved: list[tuple[int, int, FloatArray]] = []  # (number, coefficient, seed)
    for row, number in enumerate(numbers):
        if number == LAG:
            for place, name in enumerate(damper.law.names):
                law = damper.coefficients[name]
                if drive.constant is None and law.kind != "constant":
                    moved.append((row, place, law.slope(command) * by_lag))
            continue
        name, _, member = number.partition(".")
        law = damper.coefficients[name]
        gradient = law.gradient(command)[law.number_names.index(member)]
        moved.append((row, damper.law.names.index(name), gradient))

    if len(command) == 1:
        places = sorted({place for _, place, _ in moved})
        combine = np.zeros((len(numbers), len(places)))
        for row, place, seed in moved:
            combine[row, places.index(place)] = seed[0]
        force, tangents = core.run(
            damper.law.kernel,
            drive.record,
            np.ascontiguousarray(coefficients[:, 0]),
            places,
            columns=None if columns is None else columns[: len(places)],
        )
        return Sensitivity(force, tangents, combine)

    combine = np.zeros((len(numbers), len(moved)))
    for column, (row, _, _) in enumerate(moved):
        combine[row, column] = 1.0
    seeds = np.array([seed for _, _, seed in moved]).reshape(len(moved), len(command))
    force, tangents = core.run(
        damper.law.kernel, drive.record, np.ascontiguousarray(coefficients), [p for _, p, _ in moved], seeds
    )
    return Sensitivity(force, tangents, combine)


def _applied(damper: Damper, drive: Drive) -> tuple[FloatArray, FloatArray]:
    """Return the command after the lag and its derivative by it; one sample when it is constant."""
    if drive.constant is not None:
        return np.array([drive.constant]), np.zeros(1)
    return core.lagged(drive.trajectory.command, drive.trajectory.step, damper.command_lag_s)


def _by_differences(damper: Damper, drive: Drive, numbers: Sequence[str]) -> Sensitivity:
    """Central differences through the reference integrator, for laws that bring no tangents."""
    force = simulate(damper, drive)
    columns = np.empty((len(numbers), len(force)))
    values = damper.numbers
    for row, number in enumerate(numbers):
        step = _DIFFERENCE * max(abs(values[number]), 1e-3)
        above = simulate(damper.with_numbers({number: values[number] + step}), drive)
        below = simulate(damper.with_numbers({number: values[number] - step}), drive)
        columns[row] = (above - below) / (2.0 * step)
    return Sensitivity(force, columns, np.eye(len(numbers)))
