"""How much cooler a sink makes a damper than another one does, and how sure that is.

Films and power are each moved to both ends of their interval of 90 % with all else held; the differences add
as independent ones do, each side on its own. So the band tells what it is made of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.optimize import brentq

from mrdamper.arrays import FloatArray
from mrdamper.errors import EnvelopeError
from mrdamper.thermal.heatsink import FinLaw, HeatSink
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import fin_uncertainty
from mrdamper.thermal.sinks.design import HeatedDamper

BAND = 0.90
"""Probability of the band."""

_OF_GAP = 0.12  # exponent of the gap by which a law's error may differ between two sinks, +- (90 %)
_OF_BODY = 0.15  # film of the bare body, relative (90 %)
_OF_POWER = 0.165  # what heats the damper, relative (90 %): a standard deviation of a tenth
_DRAUGHTS = (0.02, 20.0)  # air speeds among which one is sought that does what a multiplier does [m/s]


@dataclass(frozen=True, slots=True)
class GainBand:
    """How much cooler the fluid is with one sink than with another [K], and what that hangs on."""

    middle: float  # as computed [K]
    low: float  # with ``high``, holds it with the probability ``BAND`` [K]
    high: float
    causes: Mapping[str, tuple[float, float]]  # what each cause alone makes of it, both ends [K]

    @property
    def better(self) -> bool:
        """Whether the sink is cooler whatever the causes do within their intervals."""
        return self.low > 0.0


def gain_band(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink, gain: float) -> GainBand:
    """Return the band of a gain, by the zone network.

    Parameters
    ----------
    reference : None is the bare damper
    gain : the middle [K], by whatever model; the band moves with it
    """
    of_fins = 1.0 + fin_uncertainty(damper.drawing.with_sink(best))
    ways: dict[str, Callable[[float], float]] = {
        "film of the fins": lambda side: _gain(
            damper, _times(reference, of_fins**side), _times(best, of_fins**side)
        ),
        "film of the bare body": lambda side: _gain(
            _with_body_film(damper, (1.0 + _OF_BODY) ** side), reference, best
        ),
        "power": lambda side: _gain(_with_power(damper, 1.0 + side * _OF_POWER), reference, best),
    }
    if reference is not None and min(reference.fins, best.fins) > 1 and reference.gap != best.gap:
        narrower = abs(math.log(best.gap / reference.gap))
        by_gap = math.exp(_OF_GAP * narrower)
        ways["film over the gap"] = lambda side: _gain(damper, reference, _times(best, by_gap**side))
    here = _gain(damper, reference, best)
    causes = {name: (gain + way(-1.0) - here, gain + way(1.0) - here) for name, way in ways.items()}
    below = math.hypot(*(max(gain - min(ends), 0.0) for ends in causes.values()))
    above = math.hypot(*(max(max(ends) - gain, 0.0) for ends in causes.values()))
    return GainBand(gain, gain - below, gain + above, MappingProxyType(causes))


def _gain(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink | None) -> float:
    return damper.evaluate(reference).fluid - damper.evaluate(best).fluid


def _times(sink: HeatSink | None, factor: float) -> HeatSink | None:
    return sink and replace(sink, film_multiplier=sink.film_multiplier * factor)


def _with_body_film(damper: HeatedDamper, factor: float) -> HeatedDamper:
    own = damper.drawing.calibration
    return replace(damper, drawing=replace(damper.drawing, calibration=replace(own, film=own.film * factor)))


def _with_power(damper: HeatedDamper, factor: float) -> HeatedDamper:
    def times(load: Load) -> Load:
        def power(kelvin: FloatArray) -> FloatArray:
            return np.asarray(factor * load.power(kelvin))

        return replace(load, power=power, coil_W=factor * load.coil_W)

    return replace(damper, loads=tuple(times(load) for load in damper.loads))


# ----------------------------------------------------------------------------------------- law by law


@dataclass(frozen=True, slots=True)
class Spread:
    """Two sinks under one law, multiplier and air speed of the fins' convection."""

    correlation: FinLaw
    film_multiplier: float
    air_speed: float  # [m/s]
    reference: float | None  # fluid's temperature [K]; None: outside the law's range
    best: float | None  # [K]


def spread(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink) -> tuple[Spread, ...]:
    """Return what two sinks do by the law and multiplier in use (first), by the other laws, and without it.

    Last, where a multiplier raises the film in still air: the draught that would do so to the reference.
    """
    upright = damper.drawing.body.orientation == "vertical"
    laws: tuple[FinLaw, ...] = ("disc",) if upright else ("annular", "channel", "vdi")
    laws = tuple(sorted(laws, key=lambda law: law != damper.pattern.correlation))
    multipliers = dict.fromkeys((damper.pattern.film_multiplier, 1.0))

    def row(law: FinLaw, multiplier: float, air_speed: float) -> Spread:
        moved = _in_wind(damper, air_speed)

        def fluid(sink: HeatSink | None) -> float | None:
            changed = sink and replace(sink, correlation=law, film_multiplier=multiplier)
            try:
                return moved.evaluate(changed).fluid
            except EnvelopeError:
                return None

        return Spread(law, multiplier, air_speed, fluid(reference), fluid(best))

    still = damper.drawing.surroundings.air_speed
    rows = [row(law, multiplier, still) for multiplier in multipliers for law in laws]
    draught = _draught(damper, reference)
    return tuple(rows if draught is None else [*rows, row(damper.pattern.correlation, 1.0, draught)])


def _in_wind(damper: HeatedDamper, air_speed: float) -> HeatedDamper:
    around = replace(damper.drawing.surroundings, air_speed=air_speed)
    return replace(damper, drawing=replace(damper.drawing, surroundings=around))


def _draught(damper: HeatedDamper, reference: HeatSink | None) -> float | None:
    """Return the air speed that does to the reference what its multiplier does [m/s]; None: there is none."""
    if reference is None or reference.film_multiplier <= 1.0 or damper.drawing.surroundings.air_speed > 0.0:
        return None
    wanted, plain = damper.evaluate(reference).fluid, replace(reference, film_multiplier=1.0)

    def miss(speed: float) -> float:
        return _in_wind(damper, speed).evaluate(plain).fluid - wanted

    try:
        low, high = _DRAUGHTS
        return float(brentq(miss, low, high, xtol=1e-3)) if miss(low) > 0.0 > miss(high) else None
    except EnvelopeError:
        return None
