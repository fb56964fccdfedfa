"""Simulation of the force of a damper for a motion and a command.

Hysteresis laws of the kernel run in C. ``python_law`` integrates user-defined laws in Python. ``tangents``
computes derivatives of the force.
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
from mrdamper.models.python_law import integrate
from mrdamper.quantities import REFERENCE_K


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A trajectory that is prepared for many simulations.

    ``record`` contains the trajectory for the kernel. ``constant`` is the command if the command is constant,
    else None. ``temperature`` [K] is the temperature if it is known and constant, else None.
    ``temperature_varies`` is True if the temperature is not constant.
    """

    trajectory: Trajectory
    record: core.Record
    constant: float | None
    temperature: float | None
    temperature_varies: bool


def open_drive(trajectory: Trajectory, *, longest_step: float = core.LONGEST_STEP) -> Drive:
    """Prepare a trajectory for the kernel.

    ``longest_step`` [s] limits the integration step of ``series-valve`` and ``chain``.
    """
    command, kelvin = trajectory.command, trajectory.temperature
    constant = float(command[0]) if np.ptp(command) == 0.0 else None
    temperature_varies = kelvin is not None and bool(np.ptp(kelvin) > 0.0)
    temperature = None if kelvin is None or temperature_varies else float(kelvin[0])
    record = core.open_record(trajectory, longest_step=longest_step)
    return Drive(trajectory, record, constant, temperature, temperature_varies)


def simulate(
    damper: Damper, trajectory: Trajectory | Drive, *, form: Literal["record", "causal"] = "record"
) -> FloatArray:
    """Return the force of the damper [N] at every sample of a trajectory, shape (n,).

    Parameters
    ----------
    form : ``record`` (recorded run) evaluates the motion from one turning point to the next; turning points
        can be between samples. ``causal`` computes sample by sample, as on a real-time target. At 1 kHz, both
        methods agree within 1e-4 of the peak force.

    Raises
    ------
    InputError
        If a coefficient is invalid at a command or temperature of the trajectory. Also if the damper depends
        on temperature and the trajectory has no temperature.
    """
    python_tolerance = 1e-8  # tolerance of the integrator of laws in Python
    drive = trajectory if isinstance(trajectory, Drive) else open_drive(trajectory)
    require_temperature(damper, drive.trajectory)
    if damper.law.kernel is None:
        return integrate(damper, drive.trajectory, tolerance=python_tolerance)
    command, _, temperature = effective_command(damper, drive)
    coefficients = _admissible_coefficients(damper, command, temperature, drive.trajectory.displacement)
    if form == "causal":
        return core.causal(damper.law.kernel, drive.record, coefficients)
    return core.run(damper.law.kernel, drive.record, coefficients)[0]


def simulate_each(damper: Damper, trajectories: Sequence[Trajectory | Drive]) -> list[FloatArray]:
    """Return the force [N] of several trajectories, as ``simulate`` does for each.

    The forces equal the result of ``simulate`` within rounding errors. Runs with constant command and
    temperature are simulated together. The kernel then integrates ``series-valve`` and ``chain`` for several
    runs in parallel.

    Raises
    ------
    InputError
        If ``simulate`` raises this error for one of the trajectories.
    """
    drives = [each if isinstance(each, Drive) else open_drive(each) for each in trajectories]
    points = [operating_point(each, temperature_dependent=damper.temperature_dependent) for each in drives]
    together = [k for k, point in enumerate(points) if point is not None and damper.law.kernel is not None]
    together = together if len(together) >= 3 else []  # One or two runs are simulated separately.
    found = dict(zip(together, _simulate_at_points(damper, [drives[k] for k in together]), strict=True))
    return [found[k] if k in found else simulate(damper, drive) for k, drive in enumerate(drives)]


def _simulate_at_points(damper: Damper, drives: Sequence[Drive]) -> list[FloatArray]:
    if not drives:
        return []
    for drive in drives:
        require_temperature(damper, drive.trajectory)
    points = [operating_point(each, temperature_dependent=damper.temperature_dependent) for each in drives]
    levels = {point: k for k, point in enumerate(dict.fromkeys(points))}
    command, kelvin = np.array(list(levels), dtype=np.float64).T
    found = damper.coefficients_at(command, kelvin)
    coefficients = np.ascontiguousarray(found[:, [levels[point] for point in points]].T)
    pairs = zip(coefficients, drives, strict=True)
    pushes = any(_reversed_valve(damper, row, drive.trajectory.displacement) for row, drive in pairs)
    if pushes or damper.law.violations(dict(zip(damper.law.names, found, strict=True))):
        return [simulate(damper, drive) for drive in drives]  # ``simulate`` raises the InputError.
    return core.forces(damper.law.kernel or 0, [drive.record for drive in drives], coefficients)


def require_temperature(damper: Damper, trajectory: Trajectory) -> None:
    """Raise ``InputError`` if a damper depends on an unknown temperature."""
    if damper.temperature_dependent and trajectory.temperature is None:
        raise InputError(
            found="the model depends on temperature, and the run has no temperature channel",
            expected="a column such as temperature_degC",
            remedy=(
                "Map the channel, or state it as a constant in the channel map ([constant] temperature_degC "
                "= 20)"
            ),
        )


def operating_point(drive: Drive, *, temperature_dependent: bool) -> tuple[float, float] | None:
    """Return command and temperature [K] of a run if both are constant, else None."""
    if drive.constant is None or (temperature_dependent and drive.temperature_varies):
        return None
    kelvin = drive.temperature if temperature_dependent else None
    return drive.constant, REFERENCE_K if kelvin is None else kelvin


def effective_command(damper: Damper, drive: Drive) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Return the effective command, its derivative by the lag, and temperature [K].

    The effective command is the command after delay and lags. If command and temperature are constant, each
    array has only one element.
    """
    point = operating_point(drive, temperature_dependent=damper.temperature_dependent)
    if point is not None:
        return np.array([point[0]]), np.zeros(1), np.array([point[1]])
    path = drive.trajectory
    kelvin = (
        damper.clip_temperature(path.temperature)
        if damper.temperature_dependent and path.temperature is not None
        else None
    )
    if damper.actuation is not None:
        return damper.actuation.apply(path.command, path.step), np.zeros(len(path)), kelvin
    return *core.first_order_lag(path.command, path.step, damper.command_lag_s), kelvin


def _admissible_coefficients(
    damper: Damper, command: FloatArray, temperature: FloatArray | None, displacement: FloatArray
) -> FloatArray:
    """Return the coefficients, shape (m,) for one command, else (m, n).

    Raises
    ------
    InputError
        If a coefficient is invalid, or ``series-valve`` is invalid at a displacement [m].
    """
    found = damper.coefficients_at(command, temperature)
    violations: tuple[str, ...] = ()
    if not (damper.limited and np.isfinite(found).all()):  # Finite clipped values are always within limits.
        violations = damper.law.violations(dict(zip(damper.law.names, found, strict=True)))
    violations += _reversed_valve(damper, found, displacement)
    if violations:
        raise InputError(faults=[InputError(each) for each in violations])
    return np.ascontiguousarray(found[:, 0] if len(command) == 1 else found)


def _reversed_valve(damper: Damper, coefficients: FloatArray, displacement: FloatArray) -> tuple[str, ...]:
    """Return a message if ``series-valve`` has no bounded solution at a displacement."""
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
