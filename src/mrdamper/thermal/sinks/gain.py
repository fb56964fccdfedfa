"""Temperature difference between two heat sinks, with its interval.

The heat-transfer coefficients and the power are each moved to both ends of their 90 % interval while all
else is kept. The differences are added in squares, separately above and below the gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.surfaces import fin_uncertainty
from mrdamper.thermal.sinks.design import HeatedDamper

PROBABILITY = 0.90
"""Probability of the interval."""

# Half widths of 90 % intervals, relative except for the exponent.
GAP_EXPONENT_ERROR = 0.12  # A correlation may be wrong by this power of the ratio of two gaps.
BODY_FILM_ERROR = 0.15
POWER_ERROR = 0.165  # 1.645 standard deviations of a tenth


@dataclass(frozen=True, slots=True)
class GainBand:
    """Temperature of the fluid with one sink less that with another [K], and its interval."""

    middle: float  # as computed [K]
    low: float  # [K]
    high: float  # [K]

    @property
    def better(self) -> bool:
        """Whether the sink is cooler over the whole interval."""
        return self.low > 0.0


def gain_band(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink, gain: float) -> GainBand:
    """Return the interval of a gain, by the zone network.

    Parameters
    ----------
    reference : None for the bare damper
    gain : the computed gain [K], by any model; the interval moves with it
    """
    fins = 1.0 + fin_uncertainty(damper.drawing.with_sink(best))
    changes: list[Callable[[float], float]] = [
        lambda side: _gain(damper, _scale_film(reference, fins**side), _scale_film(best, fins**side)),
        lambda side: _gain(_scale_body_film(damper, (1.0 + BODY_FILM_ERROR) ** side), reference, best),
        lambda side: _gain(_scale_power(damper, 1.0 + side * POWER_ERROR), reference, best),
    ]
    if reference is not None and min(reference.fins, best.fins) > 1 and reference.gap != best.gap:
        by_gap = math.exp(GAP_EXPONENT_ERROR * abs(math.log(best.gap / reference.gap)))
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
