"""Coefficients of a damper at a few operating points for many sets of parameters at once.

A fit evaluates coefficients and their gradients at the same commands and temperatures thousands of times.
This module analyses the damper once. Each evaluation then needs only arithmetic on arrays, without a new
``Damper``. This module does not simulate the force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import ParameterLaw


@dataclass(frozen=True, slots=True, eq=False)
class _Moving:
    """A coefficient that is nonlinear in a parameter; its gradient is not constant."""

    place: int  # index of the coefficient in the order of the hysteresis law
    column: int  # index among the coefficients with a gradient; -1: without gradient
    form: ParameterLaw
    fixed: FloatArray  # parameters of the form, shape (k, 1)
    members: list[int]  # indices of the varying parameters in the form
    sources: list[int]  # indices of the varying parameters of this form among all varying parameters
    wanted: tuple[tuple[int, int], ...]  # (index of a parameter in the form, index of its gradient)


class OperatingPoints:
    """Coefficients of a damper and their gradients at a few operating points.

    An operating point is a command and a temperature. The ``varying`` parameters change between evaluations.
    The gradients are with respect to the ``wanted`` parameters. Both have names such as ``yield_force.gain``.
    The command lag is allowed, but has no gradient. ``places`` are the indices of all coefficients that
    depend on wanted parameters. The array ``combine``, shape (points, wanted, places), contains the gradients
    of coefficients that are linear in all their parameters, because these gradients are constant.
    """

    def __init__(
        self,
        damper: Damper,
        varying: Sequence[str],
        wanted: Sequence[str],
        command: FloatArray,
        temperature: FloatArray,
    ) -> None:
        self._command = command
        self._temperature = damper.clip_temperature(temperature)
        names = damper.law.names
        self.places = sorted({names.index(w.partition(".")[0]) for w in wanted if "." in w})
        self.combine = np.zeros((len(command), len(wanted), len(self.places)))
        self._fixed = np.ascontiguousarray(damper.coefficients_at(command, temperature).T)
        self._linear = np.zeros((len(varying), *self._fixed.shape))
        self._moving: list[_Moving] = []
        for place, (name, form) in enumerate(damper.coefficients.items()):
            flat = [f"{name}.{number}" for number in form.parameter_names]
            members = [k for k, number in enumerate(flat) if number in varying]
            sources = [varying.index(flat[k]) for k in members]
            rows = tuple((k, wanted.index(number)) for k, number in enumerate(flat) if number in wanted)
            if not members and not rows:
                continue
            column = self.places.index(place) if rows else -1
            parameters = np.array(form.parameters)
            if all(form.linear):
                gradient = form.gradient(self._command, self._temperature)
                self._linear[sources, :, place] = gradient[members]
                parameters[members] = 0.0
                self._fixed[:, place] = parameters @ gradient
                for k, row in rows:
                    self.combine[:, row, column] = gradient[k]
            else:
                self._moving.append(_Moving(place, column, form, parameters[:, None], members, sources, rows))
        self._linear = self._linear.reshape(len(varying), self._fixed.size)

    def evaluate(self, values: FloatArray, combine: FloatArray) -> FloatArray:
        """Return the coefficients for sets of varying parameters, shape (sets, points, m).

        Parameters
        ----------
        values : values of the varying parameters, shape (sets, varying)
        combine : output array for the gradients, shape (sets, points, wanted, places)

        Before the call, each set in the output array must be a copy of the attribute ``combine``. This method
        writes only the gradients that are not constant.
        """
        count = len(values)
        coefficients = (values @ self._linear).reshape(count, *self._fixed.shape)
        coefficients += self._fixed
        for moving in self._moving:
            parameters = moving.fixed
            if moving.members:
                parameters = np.repeat(moving.fixed, count, axis=1)
                parameters[moving.members] = values[:, moving.sources].T
            value, gradient = moving.form.evaluate_batch(parameters, self._command, self._temperature)
            coefficients[:, :, moving.place] = value
            for k, row in moving.wanted:
                combine[:, :, row, moving.column] = gradient[k]
        return coefficients
