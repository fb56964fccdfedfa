"""Limit the coefficients of a fitted damper to their valid ranges at all currents and temperatures of runs.

The search enforces the conditions of a law only at some currents. Between two of these currents, a parabola
can leave the valid range of its coefficient. Runs that were not fitted can also have larger currents or
higher temperatures than the fitted runs.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.identify.problem import FitProblem, envelope_of
from mrdamper.identify.settings import NUMERICS
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import ParameterLaw
from mrdamper.models.laws import Coefficient
from mrdamper.quantities import REFERENCE_K

# Parameters that define the shape of a dependence on current or temperature, and not its size. ``_weaker``
# scales only the other parameters.
_SHAPES = ("half_command", "exponent", "sharpness", "vft_pole_K")


def make_feasible(problem: FitProblem, damper: Damper) -> Damper:
    """Return the damper with coefficients limited to the valid range of the law in all runs."""
    return limit_coefficients(damper, envelope_of(problem.runs))[0]


def limit_coefficients(damper: Damper, envelope: OperatingEnvelope) -> tuple[Damper, tuple[str, ...]]:
    """Limit the coefficients; return the damper and remarks on coefficients that changed much.

    If a coefficient is below its valid range, the first parameter of its dependence on the current (value at
    zero current) is increased. If an increase is not possible or not sufficient, the dependence on current
    and temperature is weakened as little as necessary.
    """
    commands = np.linspace(*envelope.command, NUMERICS.limit_command_count)
    kelvin = damper.temperature_range or envelope.temperature or (REFERENCE_K,) * 2
    temperatures = damper.clip_temperature(np.linspace(*kelvin, 9 if kelvin[1] > kelvin[0] else 1))
    at, warm = (grid.ravel() for grid in np.meshgrid(commands, temperatures))
    forms, notes = dict(damper.coefficients), []
    for name, form in damper.coefficients.items():
        # A coefficient that does not depend on current is checked once at each temperature.
        few = slice(None, None, NUMERICS.limit_command_count if form.kind == "constant" else 1)
        inside = _raised(form, damper.law[name], at[few], warm[few])
        if inside is form:
            continue
        before, after = form.value(at, warm), inside.value(at, warm)
        forms[name] = inside
        if np.abs(after - before).max() > NUMERICS.reported_change_min * np.abs(after).max():
            notes.append(
                f"{name} is limited to the range of the law, which the fit would exceed within the runs"
            )
    if damper.law.name == "series-valve":
        forms["position_gain"] = _open_valve(forms["position_gain"], envelope)
    return replace(damper, coefficients=forms), tuple(notes)


def _raised(form: ParameterLaw, admissible: Coefficient, at: FloatArray, kelvin: FloatArray) -> ParameterLaw:
    """Return a coefficient raised into its valid range; the same object if the coefficient is valid."""
    values = form.value(at, kelvin)
    floor = admissible.lower
    if values.min() < floor + 2e-6 * np.ptp(values):
        slope = form.gradient(at, kelvin)[0]
        if (slope > 0.0).all() and form.linear[0] and form.kind != "exponential":
            # The margin is needed because the coefficient can be lower between two currents of the grid.
            aim = floor + 2e-6 * float(np.ptp(values))
            lift = float(np.max((aim - values) / slope)) * (1.0 + 1e-9)
            # If the coefficient hardly depends on the parameter at one temperature, the increase would be so
            # large that the coefficient becomes wrong at other temperatures.
            if lift * float(slope.max()) <= float(np.ptp(values)):
                form = form.with_parameters((form.parameters[0] + lift, *form.parameters[1:]))
    if _keeps(form, admissible, at, kelvin):
        return form
    low, high = 0.0, 1.0
    for _ in range(NUMERICS.bisection_count):
        middle = 0.5 * (low + high)
        inside = _keeps(_weaker(form, middle, admissible), admissible, at, kelvin)
        low, high = (middle, high) if inside else (low, middle)
    return _weaker(form, low, admissible)


def _keeps(form: ParameterLaw, admissible: Coefficient, at: FloatArray, kelvin: FloatArray) -> bool:
    values = form.value(at, kelvin)
    return bool(((values >= admissible.lower) & (values <= admissible.upper)).all())


def _weaker(form: ParameterLaw, fraction: float, admissible: Coefficient) -> ParameterLaw:
    """Weaken the dependence on current and temperature to ``fraction`` (0: constant).

    All parameters are multiplied by ``fraction``, except the shape parameters and the first parameter. The
    first parameter is clipped to the valid range of the coefficient.
    """
    first, *others = form.parameters
    names = form.parameter_names[1:]
    rest = [
        number if name in _SHAPES else fraction * number for name, number in zip(names, others, strict=True)
    ]
    return form.with_parameters((min(max(first, admissible.lower), admissible.upper), *rest))


def _open_valve(gain: ParameterLaw, envelope: OperatingEnvelope) -> ParameterLaw:
    """Return ``position_gain``, limited so that the valve force keeps its sign within the stroke."""
    gain_max = NUMERICS.position_change_max / max(abs(end) for end in envelope.displacement)
    if abs(gain.parameters[0]) <= gain_max or gain.kind != "constant":
        return gain
    return gain.with_parameters((math.copysign(gain_max, gain.parameters[0]),))
