"""Derating: find the largest load at which no part exceeds its temperature limit.

The load is reduced by reducing the current, the stroke or the duty ratio (fraction of time in operation).

The result is a table with the axes ambient temperature, air speed and duration. A single reduced thermal
model is sufficient for the table, because only heat-transfer coefficients and ambient temperature vary. Its
basis contains the responses at the lowest and highest ambient temperature and air speed. For each entry of
the table, the load is simulated with 0, 25, 50, 75 and 100 % of the current, stroke or duty ratio. Piecewise
cubic Hermite interpolation yields the temperatures of the hottest points at all other percentages. The entry
is the percentage at which the first part reaches its temperature limit.

The 90 % interval follows from the uncertainty of geometry and model card (``ModelUncertainty``). For every
air speed and duration, the temperature rise is multiplied by its lower and upper relative bound. The bounds
of the interval are the percentages at which the multiplied rise reaches the limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.models.damper import Damper
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty, Segment, stroke_of
from mrdamper.thermal.estimation.interval import rise_factors
from mrdamper.thermal.limits import Limit, limits_of
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.model.finite_element import build_field, cooling_in
from mrdamper.thermal.model.heat_equation import HeatEquation, simulate_field, steady_field
from mrdamper.thermal.model.reduced import ReducedModel, reduce_field
from mrdamper.thermal.model.stepping import Load, Part
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.temperature_rise import loads_of, works_of

Quantity = Literal["current", "stroke", "duty"]
"""Quantity that is reduced: the command, the stroke, or the fraction of time in operation."""

FRACTIONS = np.linspace(0.0, 1.0, 5)  # simulated fractions of the current, stroke or duty ratio


@dataclass(frozen=True, slots=True)
class Conditions:
    """The axes of a derating table, each with rising values."""

    ambient: FloatArray  # ambient temperature [K], shape (a,)
    air: FloatArray  # air speed [m/s], shape (w,)
    duration: FloatArray  # duration of the load [s], infinity for the steady state, shape (d,)

    def __post_init__(self) -> None:
        for name in ("ambient", "air", "duration"):
            axis = getattr(self, name)
            if not len(axis) or np.isnan(axis).any() or not (np.diff(axis) > 0.0).all():
                raise InputError(
                    place="derating", found=f"{name} is {axis}", expected="rising numbers, at least one"
                )


@dataclass(frozen=True, slots=True, eq=False)
class Derating:
    """Largest permissible fraction of current, stroke or duty ratio.

    The arrays have the axes duration, air speed and ambient temperature, shape (d, w, a). NaN means that even
    the fraction 0 exceeds a temperature limit.
    """

    quantity: Quantity
    conditions: Conditions
    limits: tuple[Limit, ...]
    share: FloatArray  # largest permissible fraction of ``quantity``
    low: FloatArray  # lower end of the 90 % interval of ``share``
    high: FloatArray  # upper end of the 90 % interval of ``share``
    part: FloatArray  # index of the limit that is reached first; -1: no limit is reached


def derate_damper(
    damper: Damper, drawing: DamperDrawing, duty: Duty, conditions: Conditions, quantity: Quantity
) -> Derating:
    """Return the largest permissible fraction of current, stroke or duty ratio.

    The segments of the load cycle are replaced by a single segment with their mean power.

    Raises
    ------
    InputError
        If units of load cycle and damper differ, or an ambient temperature is at or above a limit.
    """
    drawing = replace(drawing, stroke=stroke_of(duty))
    limits = limits_of(drawing)
    hottest = float(conditions.ambient[-1])
    lowest = min(limits, key=lambda each: each.kelvin)
    if hottest >= lowest.kelvin:
        raise InputError(
            place="derating",
            found=f"the ambient goes up to {hottest - 273.15:.4g} degC, the limit of the {lowest.name} is "
            f"{lowest.celsius:.4g} degC",
            expected="ambients below every limit",
            remedy="Check the ambients, and the limits of the geometry file, all in degC",
        )
    loads = [_mean_load(damper, drawing, duty, quantity, share) for share in FRACTIONS]
    model = _joint_model(drawing, conditions)
    shape = (len(conditions.duration), len(conditions.air), len(conditions.ambient))
    found = np.full((4, *shape), np.nan)
    for w, air in enumerate(conditions.air):
        factors = _rise_factors(drawing, loads[-1], float(air), conditions)
        for a, ambient in enumerate(conditions.ambient):
            equation = _equation_in(model, drawing, float(ambient), float(air))
            parts = [limit.part for limit in limits]
            rise = np.array([_rise(equation, load, conditions.duration, parts) for load in loads])
            for d in range(shape[0]):
                found[:, d, w, a] = _largest(rise[:, :, d], limits, float(ambient), factors[d])
    share, low, high, part = found
    return Derating(quantity, conditions, limits, share, low, high, part)


def _mean_load(damper: Damper, drawing: DamperDrawing, duty: Duty, quantity: Quantity, share: float) -> Load:
    """Return the mean load of a load cycle with ``quantity`` multiplied by ``share``."""
    motion = share if quantity == "stroke" else 1.0
    command = share if quantity == "current" else 1.0
    segments = tuple(_scaled(each, motion, command) for each in duty.segments)
    changed = replace(duty, segments=segments)
    loads = loads_of(works_of(damper, changed), drawing, changed)
    at_work = share if quantity == "duty" else 1.0
    weights = np.array([at_work * each.duration / duty.duration for each in duty.segments])

    def power(kelvin: FloatArray) -> FloatArray:
        return np.asarray(sum(w * each.power(kelvin) for w, each in zip(weights, loads, strict=True)))

    return Load(3600.0, power, float(sum(w * each.coil_W for w, each in zip(weights, loads, strict=True))))


def _scaled(segment: Segment, motion: float, command: float) -> Segment:
    path = segment.path
    if path is None or motion == 0.0:
        return replace(segment, path=None, command=command * segment.command)
    moved = {name: motion * getattr(path, name) for name in ("displacement", "velocity", "acceleration")}
    changed = replace(path, **moved, command=command * path.command)
    return replace(segment, path=changed, command=command * segment.command)


def _joint_model(drawing: DamperDrawing, conditions: Conditions) -> ReducedModel:
    """Return one reduced thermal model for all ambient temperatures and air speeds."""
    ends = [(ambient, air) for ambient in conditions.ambient[[0, -1]] for air in conditions.air[[0, -1]]]
    around = [
        replace(drawing.surroundings, ambient=float(t), air_speed=float(u)) for t, u in dict.fromkeys(ends)
    ]
    model = build_field(replace(drawing, surroundings=around[0]))
    coolings = [cooling_in(model, each) for each in around[1:]]
    return reduce_field(model, order=SETTINGS.map_model_order, elsewhere=coolings)


def _equation_in(model: ReducedModel, drawing: DamperDrawing, ambient: float, air: float) -> HeatEquation:
    """Return the reduced heat equation for an ambient temperature [K] and an air speed [m/s]."""
    around = replace(drawing.surroundings, ambient=ambient, air_speed=air)
    growth = 1.0 + COPPER_PER_K * (ambient - REFERENCE_K)
    cooling = cooling_in(model.full, around, reference=ambient)
    return replace(model.equation, ambient=ambient, cooling=cooling, reference_growth=growth)


def _rise(equation: HeatEquation, load: Load, duration: FloatArray, parts: Sequence[Part]) -> FloatArray:
    """Return the rise of the hottest points above ambient [K], shape (parts, durations).

    The rise is infinite if the temperature leaves the range of the model or if there is no steady state.
    """
    found = np.full((len(parts), len(duration)), np.inf)
    finite = np.isfinite(duration)
    try:
        if finite.any():
            longest = replace(load, duration=float(duration[finite][-1]))
            first, most = SETTINGS.map_first_step_s, SETTINGS.map_step_max_s
            course = simulate_field(equation, [longest], first_step=first, longest_step=most)
            for k, part in enumerate(parts):
                hottest = np.maximum.accumulate(course.hottest(part) - equation.ambient)
                found[k, finite] = PchipInterpolator(course.time, hottest)(duration[finite])
        if not finite.all():
            state = steady_field(equation, load)
            for k, part in enumerate(parts):
                found[k, ~finite] = float((getattr(equation.spots, part) @ state).max())
    except (EnvelopeError, ConvergenceError):  # The model has no valid temperature. The rise stays infinite.
        pass
    return found


def _rise_factors(drawing: DamperDrawing, load: Load, air: float, conditions: Conditions) -> FloatArray:
    """Return the bounds of the 90 % interval of temperature rise / predicted rise."""
    ambient = float(np.median(conditions.ambient))
    around = replace(drawing.surroundings, ambient=ambient, air_speed=air)
    ends = np.where(np.isfinite(conditions.duration), conditions.duration, SETTINGS.map_steady_time_s)
    longest = replace(load, duration=float(ends.max()))
    return rise_factors(replace(drawing, surroundings=around), longest, ends)


def _largest(
    rise: FloatArray, limits: Sequence[Limit], ambient: float, factors: FloatArray
) -> tuple[float, float, float, float]:
    """Return the largest permissible fraction, its bounds, and the index of its limit.

    Parameters
    ----------
    rise : temperature rise of the hottest points for all ``FRACTIONS`` [K], shape (fractions, limits)
    factors : bounds of the 90 % interval of the rise, divided by the rise, shape (2,)
    """
    known = np.isfinite(rise).all(axis=1)
    shares = FRACTIONS[known]
    if len(shares) < 2:
        return math.nan, math.nan, math.nan, -1.0
    fine = np.linspace(shares[0], shares[-1], 401)
    curves = PchipInterpolator(shares, rise[known])(fine)
    allowed = np.array([limit.kelvin - ambient for limit in limits])

    def largest(factor: float) -> tuple[float, float]:
        beyond = factor * curves - allowed
        over = (beyond > 0.0).any(axis=1)
        if not over.any():
            return (float(fine[-1]), -1.0)
        k = int(over.argmax())
        part = int(beyond[k].argmax())
        if k == 0:  # A limit is exceeded even for the fraction 0.
            return math.nan, float(part)
        low, high = beyond[k - 1 : k + 1, part]
        return float(fine[k - 1] + (fine[k] - fine[k - 1]) * low / (low - high)), float(part)

    share, part = largest(1.0)
    ends = [largest(float(factor))[0] for factor in factors[::-1]]
    return share, ends[0], ends[1], part
