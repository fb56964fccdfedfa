"""Tangents: derivatives of the force of a damper with respect to its parameters, for one or many runs.

The C kernel computes the tangents of its hysteresis laws. The tangents of a user-defined law in Python are
central differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.python_law import force_of_states, integrate_states
from mrdamper.models.simulate import (
    Drive,
    effective_command,
    operating_point,
    require_temperature,
)


@dataclass(frozen=True, slots=True, eq=False)
class Sensitivity:
    """Force in a run, and its derivatives with respect to parameters as two factors.

    d force / d parameter = ``combine`` @ ``columns``. The kernel computes ``columns``, the derivatives with
    respect to d coefficients, shape (d, n). ``combine``, shape (parameters, d), contains the derivatives of
    the coefficients. The product is not stored, because least-squares sums are computed faster from the few
    rows of ``columns``.
    """

    force: FloatArray
    columns: FloatArray
    combine: FloatArray


def sensitivities(damper: Damper, drive: Drive, parameters: Sequence[str]) -> Sensitivity:
    """Return the force in a run and its derivatives with respect to parameters.

    Limits of coefficients are not checked, because a fit does not leave them.
    """
    return Tangents(damper, parameters, [drive]).evaluate_run(0)


class Tangents:
    """Forces in many runs, and their parameter derivatives (tangents).

    Coefficients are evaluated when the object is created. A run with constant current and temperature needs
    one evaluation, and any other run needs one evaluation per sample.
    """

    def __init__(self, damper: Damper, parameters: Sequence[str], drives: Sequence[Drive]) -> None:
        self._damper = damper
        self._parameters = tuple(parameters)
        self._drives = tuple(drives)
        self._workspace = core.Workspace()
        if damper.law.kernel is None:
            return
        if damper.temperature_dependent and any(drive.trajectory.temperature is None for drive in drives):
            require_temperature(
                damper, next(d.trajectory for d in drives if d.trajectory.temperature is None)
            )
        temperature_dependent = damper.temperature_dependent
        points = [operating_point(drive, temperature_dependent=temperature_dependent) for drive in drives]
        levels = {point: k for k, point in enumerate(dict.fromkeys(p for p in points if p is not None))}
        self._level = [None if point is None else levels[point] for point in points]
        self._members = [number.partition(".")[::2] for number in self._parameters]
        self._prepare_levels(list(levels))
        self._prepare_varying([k for k, point in enumerate(points) if point is None])

    def _prepare_levels(self, levels: Sequence[tuple[float, float]]) -> None:
        damper = self._damper
        members = [member for member in self._members if member[0] != LAG]
        self._places = sorted({damper.law.names.index(name) for name, _ in members})
        at = np.array([point[0] for point in levels], dtype=np.float64)
        kelvin = np.array([point[1] for point in levels], dtype=np.float64)
        self._coefficients = np.ascontiguousarray(damper.coefficients_at(at, kelvin).T)
        self._combine = np.zeros((len(levels), len(self._parameters), len(self._places)))
        held = damper.clip_temperature(kelvin)
        gradients = {name: damper.coefficients[name].gradient(at, held) for name, _ in members}
        for row, (name, member) in enumerate(self._members):
            if name == LAG:
                continue
            gradient = gradients[name][damper.coefficients[name].parameter_names.index(member)]
            self._combine[:, row, self._places.index(damper.law.names.index(name))] = gradient

    def _prepare_varying(self, runs: Sequence[int]) -> None:
        if not runs:
            return
        damper = self._damper
        applied = [effective_command(damper, self._drives[run]) for run in runs]
        ends = np.cumsum([len(command) for command, _, _ in applied]).tolist()
        self._samples = {
            run: slice(end - len(command), end)
            for run, end, (command, _, _) in zip(runs, ends, applied, strict=True)
        }
        command = np.concatenate([each[0] for each in applied])
        by_lag = np.concatenate([np.broadcast_to(each[1], each[0].shape) for each in applied])
        kelvin = [each[2] for each in applied if each[2] is not None]
        temperature = np.concatenate(kelvin) if kelvin else None
        gradients = {
            name: damper.coefficients[name].gradient(command, temperature)
            for name in dict.fromkeys(name for name, _ in self._members if name != LAG)
        }
        moved: list[tuple[int, int, FloatArray]] = []  # (index of parameter, index of coefficient, gradient)
        for row, (name, member) in enumerate(self._members):
            if name == LAG:
                # A Hill form with an exponent below 1 has an infinite slope at zero current, which is
                # replaced by 0.
                moved += [
                    (row, place, np.nan_to_num(form.slope(command, temperature), posinf=0.0) * by_lag)
                    for place, form in enumerate(damper.coefficients.values())
                    if form.kind != "constant"
                ]
                continue
            index = damper.coefficients[name].parameter_names.index(member)
            moved.append((row, damper.law.names.index(name), gradients[name][index]))
        self._varying_places = [place for _, place, _ in moved]
        self._seeds = np.array([np.broadcast_to(seed, command.shape) for _, _, seed in moved])
        self._seeds = self._seeds.reshape(len(moved), len(command))
        self._varying_combine = np.zeros((len(self._parameters), len(moved)))
        self._varying_combine[[row for row, _, _ in moved], range(len(moved))] = 1.0
        self._varying_coefficients = damper.coefficients_at(command, temperature)

    def evaluate_run(self, run: int, *, store: FloatArray | None = None) -> Sensitivity:
        """Return force and derivatives of a run; ``store`` is optional memory, shape (.., n)."""
        damper, drive = self._damper, self._drives[run]
        if damper.law.kernel is None:
            return _by_differences(damper, drive, self._parameters)
        level = self._level[run]
        if level is None:
            part = self._samples[run]
            force, columns = core.run(
                damper.law.kernel,
                drive.record,
                np.ascontiguousarray(self._varying_coefficients[:, part]),
                self._varying_places,
                np.ascontiguousarray(self._seeds[:, part]),
            )
            return Sensitivity(force, columns, self._varying_combine)
        force, columns = core.run(
            damper.law.kernel,
            drive.record,
            self._coefficients[level],
            self._places,
            columns=None if store is None else store[: len(self._places)],
            workspace=self._workspace,
        )
        return Sensitivity(force, columns, self._combine[level])


def _by_differences(damper: Damper, drive: Drive, parameters: Sequence[str]) -> Sensitivity:
    """Return force and parameter derivatives of a law in Python (central differences).

    Coefficients with a linear effect on the force do not change the internal states. For the derivatives with
    respect to these coefficients, the states are therefore not integrated again.
    """
    # Fits integrate a law in Python with a larger tolerance than simulations, to save time. The parameter
    # step of the differences is so large that this error does not matter.
    python_law_tolerance = 1e-6
    python_law_difference = 1e-3
    path = drive.trajectory
    require_temperature(damper, path)
    linear = {each.name for each in damper.law.coefficients if each.linear}
    states = integrate_states(damper, path, tolerance=python_law_tolerance)
    force = force_of_states(damper, path, states)
    columns = np.empty((len(parameters), len(force)))
    values = damper.parameters
    for row, name in enumerate(parameters):
        step = python_law_difference * max(abs(values[name]), 1e-3)
        sides = [damper.with_parameters({name: values[name] + change}) for change in (step, -step)]
        is_linear = name.partition(".")[0] in linear
        above, below = (
            force_of_states(
                side,
                path,
                states if is_linear else integrate_states(side, path, tolerance=python_law_tolerance),
            )
            for side in sides
        )
        columns[row] = (above - below) / (2.0 * step)
    return Sensitivity(force, columns, np.eye(len(parameters)))
