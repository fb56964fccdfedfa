"""Effect of a heat sink: efficiency, and gain relative to another heat sink.

The reference paper judges heat sinks by a "heat dissipation efficiency", but its Eq. (10) is not legible in
the available copy. According to the text, the efficiency has a maximum at a fin width of 23 mm. With three,
four and five fins, the efficiency first rises and then falls, while the temperature always falls. Only one
ratio has these trends: the relative reduction of the temperature rise, divided by 1 + A_fins / A_damper. The
search for a better heat sink (``design``) does not use the efficiency.

The *gain* of a heat sink is the reduction of the fluid temperature, compared with another heat sink. Its
90 % interval accounts for the errors of heat-transfer coefficients and power. Each of these quantities is
set to the lower and to the upper bound of its 90 % interval, and the zone network simulates the gain. The
upper and the lower half width of the interval are the root sums of squares of the changes of the gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import cap_area, fin_efficiency, fin_uncertainty
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.sinks.design import HeatedDamper

# Parameter studies of the reference paper
PAPER_WIDTHS = (0.018, 0.023, 0.028, 0.033)  # fin widths of the first study, with three fins [m]
PAPER_FINS = (3, 4, 5)  # numbers of fins in the second study, with 23 mm wide fins
PAPER_PITCH = 0.020  # fin pitch in both parameter studies [m]

EFFICIENCY_FORMULA = "(T_bare - T_fins) / (T_bare - T_ambient) / (1 + A_fins / A_damper)"


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkEffect:
    """Fluid temperatures after a load cycle with and without a heat sink, and areas."""

    sink: HeatSink
    bare: float  # fluid temperature without fins [K]
    finned: float  # fluid temperature with the heat sink [K]
    ambient: float  # ambient temperature [K]
    fin_area: float  # area of all fins [m^2]
    body_area: float  # outer area of the damper without fins [m^2]
    fin_efficiency: float  # efficiency of one fin [-]

    @property
    def rise_reduction(self) -> float:
        """Return the relative reduction of the temperature rise by the heat sink [-]."""
        return (self.bare - self.finned) / (self.bare - self.ambient)

    @property
    def efficiency(self) -> float:
        """Return the heat dissipation efficiency of the reference paper (``EFFICIENCY_FORMULA``) [-]."""
        return self.rise_reduction / (1.0 + self.fin_area / self.body_area)


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Effects of several heat sinks that differ only in width or only in the number of fins."""

    effects: tuple[SinkEffect, ...]

    @property
    def efficiency(self) -> FloatArray:
        """Efficiency of each heat sink [-], shape (sinks,)."""
        return np.array([effect.efficiency for effect in self.effects])

    @property
    def follows_paper(self) -> bool:
        """Return True if the efficiency rises to the second heat sink, and then falls."""
        rises = np.diff(self.efficiency) > 0.0
        return bool(rises[0] and not rises[1:].any())


def judge_sink(drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load], *, bare: float) -> SinkEffect:
    """Simulate a damper with a heat sink by the zone network; return the effect.

    Parameters
    ----------
    drawing : geometry of the damper; its own heat sink is ignored
    bare : fluid temperature after the loads without a heat sink [K]
    """
    finned = drawing.with_sink(sink)
    heating = simulate_network(zone_network(finned), loads)
    return SinkEffect(
        sink=sink,
        bare=bare,
        finned=float(heating.fluid[-1]),
        ambient=drawing.surroundings.ambient,
        fin_area=sink.fins * sink.fin_area(drawing.body.outer_diameter),
        body_area=body_area(drawing),
        fin_efficiency=float(fin_efficiency(finned, heating.wall[-1])[1]),
    )


def body_area(drawing: DamperDrawing) -> float:
    """Return the outer area of tube and caps [m^2]."""
    body = drawing.body
    caps = cap_area(drawing, with_rod=True) + cap_area(drawing, with_rod=drawing.rod.through)
    return math.pi * body.outer_diameter * body.length + caps


def paper_sweeps(drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load]) -> tuple[Sweep, Sweep]:
    """Repeat the two parameter studies of the reference paper with the zone network.

    The first study varies the width of three fins, the second study the number of 23 mm wide fins.

    Parameters
    ----------
    sink : heat sink whose thickness, material, emissivity and multiplier are used in both studies

    Raises
    ------
    InputError
        If the fins of the reference paper, with a pitch of 20 mm, do not fit on the damper.
    """
    bare = float(simulate_network(zone_network(drawing.with_sink(None)), loads).fluid[-1])
    base = replace(sink, pitch=PAPER_PITCH)

    def sweep(sinks: Sequence[HeatSink]) -> Sweep:
        return Sweep(tuple(judge_sink(drawing, each, loads, bare=bare) for each in sinks))

    return (
        sweep([replace(base, fins=PAPER_FINS[0], width=width) for width in PAPER_WIDTHS]),
        sweep([replace(base, fins=fins, width=PAPER_WIDTHS[1]) for fins in PAPER_FINS]),
    )


@dataclass(frozen=True, slots=True)
class GainBand:
    """Temperature reduction by a heat sink relative to a reference (gain), and its 90 % interval.

    A positive value means that the heat sink is cooler than the reference.
    """

    middle: float  # computed temperature reduction [K]
    low: float  # lower end of the interval [K]
    high: float  # upper end of the interval [K]

    @property
    def better(self) -> bool:
        """Return True if the heat sink is cooler than the reference in the whole interval."""
        return self.low > 0.0


def gain_band(damper: HeatedDamper, reference: HeatSink | None, best: HeatSink, gain: float) -> GainBand:
    """Return the 90 % interval of the gain of a heat sink relative to a reference.

    The zone network computes the half widths of the interval.

    Parameters
    ----------
    reference : heat sink with which ``best`` is compared; None: the bare damper
    gain : middle of the interval [K], which can be the result of a more accurate model
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
