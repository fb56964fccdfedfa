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

__all__ = ["LAG", "Drive", "Sensitivity", "Tangents", "open_drive", "sensitivities", "simulate"]

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
    violations += _reversed_valve(damper, coefficients, drive.trajectory.displacement)
    if violations:
        raise InputError("; ".join(violations))
    coefficients = np.ascontiguousarray(coefficients[:, 0] if len(command) == 1 else coefficients)
    if form == "causal":
        return core.causal(damper.law.kernel, drive.record, coefficients)
    return core.run(damper.law.kernel, drive.record, coefficients)[0]


def sensitivities(damper: Damper, drive: Drive, numbers: Sequence[str]) -> Sensitivity:
    """Return force and tangents of a damper along a run with respect to the named numbers.

    The conditions of the law are not checked here: a fit keeps inside them.
    """
    return Tangents(damper, numbers, [drive]).along(0)


class Tangents:
    """The same along many runs: what depends on the command alone is worked out once for all of them."""

    def __init__(self, damper: Damper, numbers: Sequence[str], drives: Sequence[Drive]) -> None:
        self._damper = damper
        self._numbers = tuple(numbers)
        self._drives = tuple(drives)
        if damper.law.kernel is None:
            return
        members = [number.partition(".") for number in self._numbers if number != LAG]
        self._places = sorted({damper.law.names.index(name) for name, _, _ in members})
        constant = [drive.constant for drive in drives]
        levels = np.unique([c for c in constant if c is not None])
        self._level = [None if c is None else int(np.searchsorted(levels, c)) for c in constant]
        # One row of coefficients, and one matrix from kernel columns to numbers, for each level.
        self._coefficients = np.ascontiguousarray(damper.coefficients_at(levels).T)
        self._combine = np.zeros((len(levels), len(self._numbers), len(self._places)))
        for row, number in enumerate(self._numbers):
            if number == LAG:
                continue
            name, _, member = number.partition(".")
            law = damper.coefficients[name]
            gradient = law.gradient(levels)[law.number_names.index(member)]
            self._combine[:, row, self._places.index(damper.law.names.index(name))] = gradient

    def along(self, run: int, *, store: FloatArray | None = None) -> Sensitivity:
        """Return force and tangents along one of the runs; ``store`` is room for columns, shape (.., n)."""
        damper, drive = self._damper, self._drives[run]
        if damper.law.kernel is None:
            return _by_differences(damper, drive, self._numbers)
        level = self._level[run]
        if level is None:
            return self._varying(drive)
        force, columns = core.run(
            damper.law.kernel,
            drive.record,
            self._coefficients[level],
            self._places,
            columns=None if store is None else store[: len(self._places)],
        )
        return Sensitivity(force, columns, self._combine[level])

    def _varying(self, drive: Drive) -> Sensitivity:
        """Return tangents where the command varies: a kernel column per number, its coefficient moving."""
        damper, law = self._damper, self._damper.law
        command, by_lag = _applied(damper, drive)
        moved: list[tuple[int, int, FloatArray]] = []  # (number, place of its coefficient, seed)
        for row, number in enumerate(self._numbers):
            if number == LAG:
                # A Hill form with an exponent below one is vertical at zero command: that point is left out.
                moved += [
                    (row, place, np.nan_to_num(damper.coefficients[name].slope(command), posinf=0.0) * by_lag)
                    for place, name in enumerate(law.names)
                    if damper.coefficients[name].kind != "constant"
                ]
                continue
            name, _, member = number.partition(".")
            dependence = damper.coefficients[name]
            gradient = dependence.gradient(command)[dependence.number_names.index(member)]
            moved.append((row, law.names.index(name), gradient))
        seeds = np.array([seed for _, _, seed in moved]).reshape(len(moved), len(command))
        combine = np.zeros((len(self._numbers), len(moved)))
        combine[[row for row, _, _ in moved], range(len(moved))] = 1.0
        coefficients = np.ascontiguousarray(damper.coefficients_at(command))
        places = [place for _, place, _ in moved]
        force, columns = core.run(law.kernel or 0, drive.record, coefficients, places, seeds)
        return Sensitivity(force, columns, combine)


def _applied(damper: Damper, drive: Drive) -> tuple[FloatArray, FloatArray]:
    """Return the command after the lag and its derivative by it; one sample when it is constant."""
    if drive.constant is not None:
        return np.array([drive.constant]), np.zeros(1)
    return core.lagged(drive.trajectory.command, drive.trajectory.step, damper.command_lag_s)


def _reversed_valve(damper: Damper, coefficients: FloatArray, displacement: FloatArray) -> tuple[str, ...]:
    """Say where along the run the series valve would push: its equation has no bounded solution there."""
    if damper.law.name != "series-valve":
        return ()
    share = 1.0 + coefficients[damper.law.names.index("position_gain")] * displacement
    worst = int(np.argmin(share))
    if share[worst] > 0.0:
        return ()
    return (
        f"series-valve: 1 + position_gain x is {share[worst]:g} at x = {displacement[worst]:g} m; the law is "
        "well posed while it is positive (shorten the stroke, or bring position_gain nearer to 0)",
    )


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
