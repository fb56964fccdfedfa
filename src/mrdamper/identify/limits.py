"""A fitted damper brought inside its law's range over what its runs cover: a bound never ends a fit.

A search keeps the law's conditions at some commands of the steady runs. Between two of those a parabola can
dip, and runs whose command steps, warms up or carries noise reach further than the steady ones.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import FitProblem, envelope_of
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import ParameterLaw
from mrdamper.models.laws import Coefficient
from mrdamper.notes import Note
from mrdamper.quantities import REFERENCE_K

_FINE = 1001  # commands at which a fitted damper is checked against its law's range
_TOLD = 1e-3  # share of a coefficient's span from which a change is worth a note
_HALVINGS = 40
_SHAPES = ("half_command", "exponent", "sharpness", "vft_pole_K")  # parameters that set where, not how much
_MOST_POSITION = 0.99  # share of the valve force that its position gain may take at the end of the stroke


def feasible(problem: FitProblem, damper: Damper) -> Damper:
    """Return the damper inside its law's range at the commands and temperatures of the problem's runs."""
    return brought_inside(damper, envelope_of(problem.runs))[0]


def brought_inside(damper: Damper, envelope: OperatingEnvelope) -> tuple[Damper, tuple[str, ...]]:
    """Return the damper inside its law's range over an envelope, and a note for each change that is seen.

    A coefficient that dips below its range is raised as a whole where its first parameter does that; else its
    dependence on command and temperature is made weaker, by as little as it takes.
    """
    commands = np.linspace(*envelope.command, _FINE)
    kelvin = damper.temperature_range or envelope.temperature or (REFERENCE_K,) * 2
    temperatures = damper.held(np.linspace(*kelvin, 9 if kelvin[1] > kelvin[0] else 1))
    at, warm = (grid.ravel() for grid in np.meshgrid(commands, temperatures))
    forms, notes = dict(damper.coefficients), []
    for name, form in damper.coefficients.items():
        few = slice(0, 1 if form.kind == "constant" else None)  # one value is there to be looked at
        inside = _raised(form, damper.law[name], at[few], warm[few])
        if inside is form:
            continue
        before, after = form.value(at, warm), inside.value(at, warm)
        forms[name] = inside
        if np.abs(after - before).max() > _TOLD * np.abs(after).max():
            words = "{name} is held inside the law's range over the runs: left alone it would leave it"
            notes.append(Note("held_inside", words, name=name))
    if damper.law.name == "series-valve":
        forms["position_gain"] = _open_valve(forms["position_gain"], envelope)
    return replace(damper, coefficients=forms), tuple(notes)


def _raised(form: ParameterLaw, admissible: Coefficient, at: FloatArray, kelvin: FloatArray) -> ParameterLaw:
    """Return a form whose values keep inside a coefficient's range; the same one where they do already."""
    values = form.value(at, kelvin)
    floor = admissible.lower
    if values.min() < floor + 2e-6 * np.ptp(values):
        slope = form.gradient(at, kelvin)[0]
        if (slope > 0.0).all() and form.linear[0] and form.kind != "exponential":
            aim = floor + 2e-6 * float(np.ptp(values))  # a dip between two of the commands
            lift = float(np.max((aim - values) / slope)) * (1.0 + 1e-9)
            form = form.with_parameters((form.parameters[0] + lift, *form.parameters[1:]))
    if _keeps(form, admissible, at, kelvin):
        return form
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        inside = _keeps(_weaker(form, middle, admissible), admissible, at, kelvin)
        low, high = (middle, high) if inside else (low, middle)
    return _weaker(form, low, admissible)


def _keeps(form: ParameterLaw, admissible: Coefficient, at: FloatArray, kelvin: FloatArray) -> bool:
    values = form.value(at, kelvin)
    return bool(((values >= admissible.lower) & (values <= admissible.upper)).all())


def _weaker(form: ParameterLaw, share: float, admissible: Coefficient) -> ParameterLaw:
    """Return a form with a share of its dependence on command and temperature, its level in range."""
    first, *others = form.parameters
    names = form.parameter_names[1:]
    rest = [number if name in _SHAPES else share * number for name, number in zip(names, others, strict=True)]
    return form.with_parameters((min(max(first, admissible.lower), admissible.upper), *rest))


def _open_valve(gain: ParameterLaw, envelope: OperatingEnvelope) -> ParameterLaw:
    """Return a position gain with which the valve's force keeps its sign over the stroke."""
    most = _MOST_POSITION / max(abs(end) for end in envelope.displacement)
    if abs(gain.parameters[0]) <= most or gain.kind != "constant":
        return gain
    return gain.with_parameters((math.copysign(most, gain.parameters[0]),))
