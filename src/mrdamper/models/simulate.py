"""Simulation: the force of a damper driven through a trajectory, and how it moves with its numbers.

Kernel laws run in C; a user's law in Python runs through the reference integrator. Both answer the same
two questions (``simulate`` and ``sensitivities``), so that nothing above this module asks which it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.excitation import Trajectory
from mrdamper.models.damper import Damper
from mrdamper.models.temperature import REFERENCE_K

__all__ = [
    "LAG",
    "Drive",
    "Sensitivity",
    "Tangents",
    "open_drive",
    "operating_point",
    "require_temperature",
    "reversed_valve",
    "sensitivities",
    "simulate",
]


LAG = "command_lag_s"
"""The name under which a damper's command lag stands among its numbers."""

_DIFFERENCE = 1e-5  # relative step of the central differences that serve a law in Python


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A trajectory made ready for many simulations: the kernel's record of it, its command and temperature.

    ``constant`` is the command when it does not vary over the run, else ``None``; ``temperature`` [K] is the
    run's when it is known and does not vary; ``warms`` says that it does.
    """

    trajectory: Trajectory
    record: core.Record
    constant: float | None
    temperature: float | None
    warms: bool


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
    """Return the trajectory made ready for the kernel; implicit laws take steps of at most so long [s]."""
    command, warm = trajectory.command, trajectory.temperature
    constant = float(command[0]) if np.ptp(command) == 0.0 else None
    warms = warm is not None and bool(np.ptp(warm) > 0.0)
    temperature = None if warm is None or warms else float(warm[0])
    record = core.open_record(trajectory, longest_step=longest_step)
    return Drive(trajectory, record, constant, temperature, warms)


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
        When the law is not well posed at a command or temperature of the trajectory; a damper that depends
        on temperature on a trajectory that has none.
    """
    drive = trajectory if isinstance(trajectory, Drive) else open_drive(trajectory)
    require_temperature(damper, drive.trajectory)
    if damper.law.kernel is None:
        from mrdamper.models.reference import simulate_reference

        return simulate_reference(damper, drive.trajectory, tolerance=1e-8)
    command, _, temperature = _applied(damper, drive)
    coefficients = damper.coefficients_at(command, temperature)
    violations = damper.law.violations(dict(zip(damper.law.names, coefficients, strict=True)))
    violations += reversed_valve(damper, coefficients, drive.trajectory.displacement)
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
        self._workspace = core.Workspace()
        if damper.law.kernel is None:
            return
        members = [number.partition(".") for number in self._numbers if number != LAG]
        self._places = sorted({damper.law.names.index(name) for name, _, _ in members})
        if damper.temperature_dependent and any(drive.trajectory.temperature is None for drive in drives):
            require_temperature(
                damper, next(d.trajectory for d in drives if d.trajectory.temperature is None)
            )
        temperature_dependent = damper.temperature_dependent
        points = [operating_point(drive, temperature_dependent=temperature_dependent) for drive in drives]
        levels = {point: k for k, point in enumerate(dict.fromkeys(p for p in points if p is not None))}
        self._level = [None if point is None else levels[point] for point in points]
        # One row of coefficients, and one matrix from kernel columns to numbers, for each level.
        at = np.array([point[0] for point in levels], dtype=np.float64)
        warm = np.array([point[1] for point in levels], dtype=np.float64)
        self._coefficients = np.ascontiguousarray(damper.coefficients_at(at, warm).T)
        self._combine = np.zeros((len(levels), len(self._numbers), len(self._places)))
        held = damper.held(warm)
        gradients = {name: damper.coefficients[name].gradient(at, held) for name, _, _ in members}
        for row, number in enumerate(self._numbers):
            if number == LAG:
                continue
            name, _, member = number.partition(".")
            gradient = gradients[name][damper.coefficients[name].number_names.index(member)]
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
            workspace=self._workspace,
        )
        return Sensitivity(force, columns, self._combine[level])

    def _varying(self, drive: Drive) -> Sensitivity:
        """Return tangents where the command varies: a kernel column per number, its coefficient moving."""
        damper, law = self._damper, self._damper.law
        command, by_lag, temperature = _applied(damper, drive)
        moved: list[tuple[int, int, FloatArray]] = []  # (number, place of its coefficient, seed)
        for row, number in enumerate(self._numbers):
            if number == LAG:
                # A Hill form with an exponent below one is vertical at zero command: that point is left out.
                moved += [
                    (row, place, np.nan_to_num(form.slope(command, temperature), posinf=0.0) * by_lag)
                    for place, form in enumerate(damper.coefficients.values())
                    if form.kind != "constant"
                ]
                continue
            name, _, member = number.partition(".")
            dependence = damper.coefficients[name]
            gradient = dependence.gradient(command, temperature)[dependence.number_names.index(member)]
            moved.append((row, law.names.index(name), gradient))
        seeds = np.array([seed for _, _, seed in moved]).reshape(len(moved), len(command))
        combine = np.zeros((len(self._numbers), len(moved)))
        combine[[row for row, _, _ in moved], range(len(moved))] = 1.0
        coefficients = np.ascontiguousarray(damper.coefficients_at(command, temperature))
        places = [place for _, place, _ in moved]
        force, columns = core.run(law.kernel or 0, drive.record, coefficients, places, seeds)
        return Sensitivity(force, columns, combine)


def require_temperature(damper: Damper, trajectory: Trajectory) -> None:
    """Raise ``InputError`` where a damper that depends on temperature has none to go by."""
    if damper.temperature_dependent and trajectory.temperature is None:
        raise InputError(
            "the model depends on temperature, and the run has no temperature channel; expected a column "
            "such as temperature_degC. Map the channel, or state it as a constant in the channel map "
            "([constant] temperature_degC = 20)"
        )


def operating_point(drive: Drive, *, temperature_dependent: bool) -> tuple[float, float] | None:
    """Return command and temperature [K] of a run at one operating point; None where either varies."""
    if drive.constant is None or (temperature_dependent and drive.warms):
        return None
    warm = drive.temperature if temperature_dependent else None
    return drive.constant, REFERENCE_K if warm is None else warm


def _applied(damper: Damper, drive: Drive) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return the command at the law, its derivative by the lag, and the temperature [K].

    One sample each where neither varies.
    """
    point = operating_point(drive, temperature_dependent=damper.temperature_dependent)
    if point is not None:
        return np.array([point[0]]), np.zeros(1), np.array([point[1]])
    path = drive.trajectory
    warm = (
        damper.held(path.temperature)
        if damper.temperature_dependent and path.temperature is not None
        else None
    )
    if damper.actuation is not None:
        return damper.actuation.applied(path.command, path.step), np.zeros(len(path)), warm
    return *core.lagged(path.command, path.step, damper.command_lag_s), warm


def reversed_valve(damper: Damper, coefficients: FloatArray, displacement: FloatArray) -> tuple[str, ...]:
    """Say where along a displacement [m] the series valve would push: it has no bounded solution there."""
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
