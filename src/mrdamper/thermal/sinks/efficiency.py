"""Effect of a heat sink, and the paper's "heat dissipation efficiency", Eq. (10).

The equation is missing in the paper. The text states that the efficiency has a maximum at a fin width of 23
mm. It first rises and then falls for three, four and five fins, while the temperature always falls. Only one
interpretation as a ratio gives both trends: the reduction of the temperature rise, divided by 1 + A_fins /
A_damper. The search for a better sink (``design``) uses only temperature and mass.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import cap_area, fin_efficiency
from mrdamper.thermal.model.transient import simulate_network

PAPER_WIDTHS = (0.018, 0.023, 0.028, 0.033)  # [m], three fins
PAPER_FINS = (3, 4, 5)  # 23 mm wide
PAPER_PITCH = 0.020  # [m]

EFFICIENCY_FORMULA = "(T_bare - T_fins) / (T_bare - T_ambient) / (1 + A_fins / A_damper)"


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkEffect:
    """Temperatures of a damper at the end of a load cycle with and without a sink, and areas."""

    sink: HeatSink
    bare: float  # fluid without fins [K]
    finned: float  # fluid with the sink [K]
    ambient: float  # [K]
    fin_area: float  # all fins [m^2]
    body_area: float  # damper without fins [m^2]
    fin_efficiency: float  # one fin [-]

    @property
    def rise_reduction(self) -> float:
        """Return the fraction of the rise above ambient that the sink removes [-]."""
        return (self.bare - self.finned) / (self.bare - self.ambient)

    @property
    def efficiency(self) -> float:
        """Return the paper's heat dissipation efficiency (``EFFICIENCY_FORMULA``) [-]."""
        return self.rise_reduction / (1.0 + self.fin_area / self.body_area)


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Sinks that differ in one dimension, and the effect of each."""

    effects: tuple[SinkEffect, ...]

    @property
    def efficiency(self) -> FloatArray:
        """Efficiency of each sink [-], shape (sinks,)."""
        return np.array([effect.efficiency for effect in self.effects])

    @property
    def follows_paper(self) -> bool:
        """Return True if the only maximum of the efficiency is that of the paper: 23 mm, or four fins."""
        rises = np.diff(self.efficiency) > 0.0
        return bool(rises[0] and not rises[1:].any())


def judge_sink(drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load], *, bare: float) -> SinkEffect:
    """Return the effect of a sink at the end of loads, from the zone network.

    Parameters
    ----------
    drawing : the damper; its own sink is ignored
    bare : fluid temperature at the end without a sink [K]
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
    """Return the outer area of the damper without fins [m^2]: the tube and both caps."""
    body = drawing.body
    caps = cap_area(drawing, with_rod=True) + cap_area(drawing, with_rod=drawing.rod.through)
    return math.pi * body.outer_diameter * body.length + caps


def paper_sweeps(drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load]) -> tuple[Sweep, Sweep]:
    """Return the paper's two sweeps: 18 to 33 mm width of three fins, and three to five fins of 23 mm.

    Parameters
    ----------
    sink : gives the fixed properties: thickness, material, emissivity, multiplier

    Raises
    ------
    InputError
        If the paper's fins at 20 mm pitch do not fit on the damper.
    """
    bare = float(simulate_network(zone_network(drawing.with_sink(None)), loads).fluid[-1])
    base = replace(sink, pitch=PAPER_PITCH)

    def sweep(sinks: Sequence[HeatSink]) -> Sweep:
        return Sweep(tuple(judge_sink(drawing, each, loads, bare=bare) for each in sinks))

    return (
        sweep([replace(base, fins=PAPER_FINS[0], width=width) for width in PAPER_WIDTHS]),
        sweep([replace(base, fins=fins, width=PAPER_WIDTHS[1]) for fins in PAPER_FINS]),
    )
