"""Tangents: derivatives of a damper's force by its parameters, along one run or many.

Kernel laws bring their tangents; for a law in Python central differences serve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.simulate import (
    Drive,
    applied_command,
    operating_point,
    require_temperature,
    simulate,
)

_DIFFERENCE = 1e-5  # relative step of the central differences that serve a law in Python


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Force and tangent columns along a run: d force / d parameter = combine @ columns.

    ``columns`` are the kernel's, one per coefficient that moves, shape (d, n); ``combine``, shape
    (numbers, d), turns them into columns per parameter. Keeping them apart lets Gram sums be taken over
    few columns.
    """

    force: FloatArray
    columns: FloatArray
    combine: FloatArray


def sensitivities(damper: Damper, drive: Drive, parameters: Sequence[str]) -> Sensitivity:
    """Return force and tangents of a damper along a run with respect to the named parameters.

    The conditions of the law are not checked here: a fit keeps inside them.
    """
    return Tangents(damper, parameters, [drive]).along(0)


class Tangents:
    """The same along many runs: what depends on the command alone is worked out once for all of them."""

    def __init__(self, damper: Damper, parameters: Sequence[str], drives: Sequence[Drive]) -> None:
        self._damper = damper
        self._parameters = tuple(parameters)
        self._drives = tuple(drives)
        self._workspace = core.Workspace()
        if damper.law.kernel is None:
            return
        members = [number.partition(".") for number in self._parameters if number != LAG]
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
        kelvin = np.array([point[1] for point in levels], dtype=np.float64)
        self._coefficients = np.ascontiguousarray(damper.coefficients_at(at, kelvin).T)
        self._combine = np.zeros((len(levels), len(self._parameters), len(self._places)))
        held = damper.held(kelvin)
        gradients = {name: damper.coefficients[name].gradient(at, held) for name, _, _ in members}
        for row, number in enumerate(self._parameters):
            if number == LAG:
                continue
            name, _, member = number.partition(".")
            gradient = gradients[name][damper.coefficients[name].parameter_names.index(member)]
            self._combine[:, row, self._places.index(damper.law.names.index(name))] = gradient

    def along(self, run: int, *, store: FloatArray | None = None) -> Sensitivity:
        """Return force and tangents along one of the runs; ``store`` is room for columns, shape (.., n)."""
        damper, drive = self._damper, self._drives[run]
        if damper.law.kernel is None:
            return _by_differences(damper, drive, self._parameters)
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
        """Return tangents where the command varies: a kernel column per parameter, its coefficient moving."""
        damper, law = self._damper, self._damper.law
        command, by_lag, temperature = applied_command(damper, drive)
        moved: list[tuple[int, int, FloatArray]] = []  # (number, place of its coefficient, seed)
        for row, number in enumerate(self._parameters):
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
            gradient = dependence.gradient(command, temperature)[dependence.parameter_names.index(member)]
            moved.append((row, law.names.index(name), gradient))
        seeds = np.array([seed for _, _, seed in moved]).reshape(len(moved), len(command))
        combine = np.zeros((len(self._parameters), len(moved)))
        combine[[row for row, _, _ in moved], range(len(moved))] = 1.0
        coefficients = np.ascontiguousarray(damper.coefficients_at(command, temperature))
        places = [place for _, place, _ in moved]
        force, columns = core.run(law.kernel or 0, drive.record, coefficients, places, seeds)
        return Sensitivity(force, columns, combine)


def _by_differences(damper: Damper, drive: Drive, parameters: Sequence[str]) -> Sensitivity:
    """Central differences through the reference integrator, for laws that bring no tangents."""
    force = simulate(damper, drive)
    columns = np.empty((len(parameters), len(force)))
    values = damper.parameters
    for row, number in enumerate(parameters):
        step = _DIFFERENCE * max(abs(values[number]), 1e-3)
        above = simulate(damper.with_parameters({number: values[number] + step}), drive)
        below = simulate(damper.with_parameters({number: values[number] - step}), drive)
        columns[row] = (above - below) / (2.0 * step)
    return Sensitivity(force, columns, np.eye(len(parameters)))
