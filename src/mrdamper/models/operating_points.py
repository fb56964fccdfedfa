"""A damper's coefficients at a few operating points, for many sets of its parameters at once.

A fit asks for coefficients and their gradients at the same commands and temperatures thousands of times.
Here the damper is taken apart once; an evaluation is arithmetic on arrays, and no ``Damper`` is made for it.
Running the law with the coefficients is not done here.
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
    """A coefficient whose gradient depends on numbers that vary."""

    place: int  # in the law
    column: int  # among the places that are differentiated by; -1: none
    form: ParameterLaw
    fixed: FloatArray  # its parameters, shape (k, 1)
    members: list[int]  # which of them vary,
    sources: list[int]  # and where those stand among the values
    wanted: tuple[tuple[int, int], ...]  # (number of the form, row of the gradient)


class OperatingPoints:
    """Coefficients, and their gradients by the ``wanted`` numbers, while the ``varying`` ones move.

    Numbers go by their flat names; one that is no coefficient's (the command lag) is allowed and has no
    gradient. ``places`` are the coefficients in the law that the wanted parameters move. ``combine``, shape
    (points, wanted, places), has the gradients that no number changes: those of coefficients linear in
    all their parameters.
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
        self._temperature = damper.held(temperature)
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

    def at(self, values: FloatArray, combine: FloatArray) -> FloatArray:
        """Return the coefficients at values of the varying parameters, shape (candidates, points, m).

        Parameters
        ----------
        values : one row per candidate, shape (candidates, varying)
        combine : where to put the gradients, shape (candidates, points, wanted, places); those that no number
            changes are left as they are
        """
        count = len(values)
        coefficients = (values @ self._linear).reshape(count, *self._fixed.shape)
        coefficients += self._fixed
        for moving in self._moving:
            parameters = moving.fixed
            if moving.members:
                parameters = np.repeat(moving.fixed, count, axis=1)
                parameters[moving.members] = values[:, moving.sources].T
            value, gradient = moving.form.many(parameters, self._command, self._temperature)
            coefficients[:, :, moving.place] = value
            for k, row in moving.wanted:
                combine[:, :, row, moving.column] = gradient[k]
        return coefficients
