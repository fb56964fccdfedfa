"""Interval of the *gain*: how much cooler the fluid is with one heat sink than with another.

Heat-transfer coefficients and power are changed one by one to the two ends of their 90 % intervals. Each
change of the gain is computed with the zone network. The half widths of the interval, above and below the
gain, are the root sums of squares of these changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.surfaces import fin_uncertainty
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.sinks.design import HeatedDamper


@dataclass(frozen=True, slots=True)
class GainBand:
    """Gain of a heat sink and its interval; positive if the heat sink is cooler than the reference."""

    middle: float  # computed gain [K]
    low: float  # lower end of the interval [K]
    high: float  # upper end of the interval [K]

    @property
    def better(self) -> bool:
        """Return True if the heat sink is cooler than the reference in the whole interval."""
        return self.low > 0.0


def gain_band(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink, gain: float) -> GainBand:
    """Return the 90 % interval of the gain of one heat sink relative to another, from the zone network.

    Parameters
    ----------
    reference : heat sink with which ``best`` is compared; None: the bare damper
    gain : gain [K], computed with any model, to which the half widths are added
    """
    fins = 1.0 + fin_uncertainty(damper.drawing.with_sink(best))
    body = 1.0 + SETTINGS.body_film_error
    changes: list[Callable[[float], float]] = [
        lambda side: _gain(damper, _scale_film(reference, fins**side), _scale_film(best, fins**side)),
        lambda side: _gain(_scale_body_film(damper, body**side), reference, best),
        lambda side: _gain(_scale_power(damper, 1.0 + side * SETTINGS.sink_power_error), reference, best),
    ]
    if reference is not None and min(reference.fins, best.fins) > 1 and reference.gap != best.gap:
        by_gap = math.exp(SETTINGS.gap_exponent_error * abs(math.log(best.gap / reference.gap)))
        changes.append(lambda side: _gain(damper, reference, _scale_film(best, by_gap**side)))
    here = _gain(damper, reference, best)
    ends = np.array([[change(side) - here for side in (-1.0, 1.0)] for change in changes])
    below, above = (np.linalg.norm(np.maximum(side, 0.0).max(axis=1)) for side in (-ends, ends))
    return GainBand(gain, gain - float(below), gain + float(above))


def _gain(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink | None) -> float:
    return damper.evaluate(reference).fluid - damper.evaluate(best).fluid


def _scale_film(sink: HeatSink | None, factor: float) -> HeatSink | None:
    return sink and replace(sink, film_multiplier=sink.film_multiplier * factor)


def _scale_body_film(damper: HeatedDamper, factor: float) -> HeatedDamper:
    own = damper.drawing.calibration
    return replace(damper, drawing=replace(damper.drawing, calibration=replace(own, film=own.film * factor)))


def _scale_power(damper: HeatedDamper, factor: float) -> HeatedDamper:
    loads = tuple(replace(load.scaled(factor), coil_W=factor * load.coil_W) for load in damper.loads)
    return replace(damper, loads=loads)
