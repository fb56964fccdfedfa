"""What a heat sink achieves, by every reading of the paper's "heat dissipation efficiency", Eq. (10).

The equation is lost. The text says that the efficiency peaks at a fin width of 23 mm and falls beyond, and
that over three, four and five fins it rises, then falls, while the temperature itself falls all the way. Each
candidate is a plain function of a ``SinkEffect``; ``paper_sweeps`` evaluates them on the paper's two sweeps.
Searching for a better sink is the business of ``design``, which goes by temperature and mass alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.correlations import annular_fin_efficiency, radiation_film
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.surfaces import cap_area, fin_film, fin_radiation
from mrdamper.thermal.model.transient import simulate_network

PAPER_WIDTHS = (0.018, 0.023, 0.028, 0.033)  # [m], of three fins
PAPER_FINS = (3, 4, 5)  # 23 mm wide
PAPER_PITCH = 0.020  # [m]

Trend = Literal["rises", "falls", "peaks", "other"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkEffect:
    """What a sink does to a damper at the end of a duty, and what it costs; the candidates' ingredients."""

    sink: HeatSink
    bare: float  # fluid's temperature without it [K]
    finned: float  # and with it [K]
    ambient: float  # [K]
    fin_area: float  # of all fins [m^2]
    body_area: float  # of the damper without fins [m^2]
    covered_area: float  # of the body under the fins' roots [m^2]
    fin_mass: float  # of all fins [kg]
    body_mass: float  # of the damper without fins [kg]
    fin_volume: float  # envelope of the fins around the body [m^3]
    body_volume: float  # envelope of the damper without fins [m^3]
    fin_efficiency: float  # of one fin [-]

    @property
    def drop(self) -> float:
        """How much cooler the fluid is [K]."""
        return self.bare - self.finned

    @property
    def overall_efficiency(self) -> float:
        """Overall surface efficiency 1 - (A_fins / A_all) (1 - eta_fin) [-]."""
        total = self.fin_area + self.body_area - self.covered_area
        return 1.0 - self.fin_area / total * (1.0 - self.fin_efficiency)

    @property
    def rise_reduction(self) -> float:
        """Share of the rise above ambient that the sink takes away [-]."""
        return self.drop / (self.bare - self.ambient)


@dataclass(frozen=True, slots=True)
class Efficiency:
    """One reading of "heat dissipation efficiency"."""

    name: str
    symbol: str
    formula: str
    unit: str  # "%" or "K/m^2"
    value: Callable[[SinkEffect], float]


def _table(*rows: Efficiency) -> Mapping[str, Efficiency]:
    return MappingProxyType({row.name: row for row in rows})


EFFICIENCIES: Mapping[str, Efficiency] = _table(
    Efficiency(
        "rise-reduction",
        "E1",
        "(T_bare - T_fins) / (T_bare - T_ambient)",
        "%",
        lambda e: 100.0 * e.rise_reduction,
    ),
    Efficiency(
        "celsius-reduction",
        "E1c",
        "(T_bare - T_fins) / T_bare, in degC",
        "%",
        lambda e: 100.0 * e.drop / (e.bare - ZERO_CELSIUS_K),
    ),
    Efficiency(
        "overall-surface",
        "E2",
        "1 - (A_fins / A_all) (1 - eta_fin)",
        "%",
        lambda e: 100.0 * e.overall_efficiency,
    ),
    Efficiency(
        "fin",
        "E3",
        "heat of a fin / heat of a fin at root temperature",
        "%",
        lambda e: 100.0 * e.fin_efficiency,
    ),
    Efficiency(
        "rise-reduction-per-area",
        "E4a",
        "E1 / (1 + A_fins / A_damper)",
        "%",
        lambda e: 100.0 * e.rise_reduction / (1.0 + e.fin_area / e.body_area),
    ),
    Efficiency(
        "rise-reduction-per-mass",
        "E4m",
        "E1 / (1 + m_fins / m_damper)",
        "%",
        lambda e: 100.0 * e.rise_reduction / (1.0 + e.fin_mass / e.body_mass),
    ),
    Efficiency(
        "rise-reduction-per-volume",
        "E4v",
        "E1 / (1 + V_fins / V_damper), envelopes",
        "%",
        lambda e: 100.0 * e.rise_reduction / (1.0 + e.fin_volume / e.body_volume),
    ),
    Efficiency(
        "rise-reduction-times-surface",
        "E5",
        "E1 x E2",
        "%",
        lambda e: 100.0 * e.rise_reduction * e.overall_efficiency,
    ),
    Efficiency(
        "drop-per-area",
        "E6",
        "(T_bare - T_fins) / (A_fins + A_damper)",
        "K/m^2",
        lambda e: e.drop / (e.fin_area + e.body_area),
    ),
    Efficiency(
        "drop-per-fin-area", "E7", "(T_bare - T_fins) / A_fins", "K/m^2", lambda e: e.drop / e.fin_area
    ),
)
"""The candidates, by name."""

DEFAULT_EFFICIENCY = "rise-reduction-per-area"
"""The reading that follows both of the paper's trends and is a share; E6 is the same but for a factor.

For a sink's worth in one number use E1, ``rise-reduction``: it is what the paper's 48.23 % is.
"""


# ---------------------------------------------------------------------------------------------- one sink


def judge_sink(
    drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load], *, bare: float | None = None
) -> SinkEffect:
    """Return what a sink does to a damper at the end of loads, by the zone network.

    Parameters
    ----------
    drawing : the damper; its own sink does not matter
    bare : the fluid's temperature at the end without a sink [K]; None: computed
    """
    if bare is None:
        bare = float(simulate_network(zone_network(drawing.with_sink(None)), loads).fluid[-1])
    finned = drawing.with_sink(sink)
    heating = simulate_network(zone_network(finned), loads)
    diameter = drawing.body.outer_diameter
    root = math.pi * diameter
    return SinkEffect(
        sink=sink,
        bare=bare,
        finned=float(heating.fluid[-1]),
        ambient=drawing.surroundings.ambient,
        fin_area=sink.fins * sink.fin_area(diameter),
        body_area=body_area(drawing),
        covered_area=root * sink.fins * sink.thickness,
        fin_mass=sink.mass(diameter),
        body_mass=damper_mass(drawing),
        fin_volume=math.pi * (sink.tip_radius(diameter) ** 2 - 0.25 * diameter**2) * sink.span,
        body_volume=0.25 * math.pi * diameter**2 * drawing.body.length,
        fin_efficiency=fin_efficiency(finned, float(heating.wall[-1])),
    )


def fin_efficiency(drawing: DamperDrawing, root_K: float) -> float:
    """Return the efficiency of one fin of a drawing's sink [-], its film at the root's temperature [K]."""
    sink = drawing.sink
    if sink is None:
        raise InputError(
            place=drawing.name, found="it has no heat sink", expected="one, for a fin's efficiency"
        )
    emissivity, _ = fin_radiation(drawing)
    film = fin_film(drawing, root_K) + radiation_film(emissivity, root_K, drawing.surroundings.ambient)
    diameter = drawing.body.outer_diameter
    found = annular_fin_efficiency(
        film, 0.5 * diameter, sink.corrected_radius(diameter), sink.thickness, sink.material.conductivity
    )
    return float(found)


def body_area(drawing: DamperDrawing) -> float:
    """Return the area of the damper's outside without fins [m^2]: the tube and both caps."""
    body = drawing.body
    caps = cap_area(drawing, with_rod=True) + cap_area(drawing, with_rod=drawing.rod.through)
    return math.pi * body.outer_diameter * body.length + caps


def damper_mass(drawing: DamperDrawing) -> float:
    """Return the mass of a damper without fins [kg]: body, piston, coil, fluid, and the rod within it."""
    body, piston, rod, coil = drawing.body, drawing.piston, drawing.rod, drawing.coil

    def cylinder(diameter: float, length: float) -> float:
        return 0.25 * math.pi * diameter**2 * length

    chambers = 2.0 if rod.through else 1.0
    shaft = cylinder(rod.diameter, chambers * (drawing.chamber_length + body.cap) + piston.length)
    in_chambers = cylinder(rod.diameter, chambers * drawing.chamber_length)
    tube = cylinder(body.outer_diameter, body.length) - cylinder(body.bore, body.inner_length)
    tube -= cylinder(rod.diameter, chambers * body.cap)
    inner = piston.diameter - 2.0 * coil.depth
    winding = cylinder(piston.diameter, coil.length) - cylinder(inner, coil.length)
    iron = cylinder(piston.diameter, piston.length) - cylinder(rod.diameter, piston.length) - winding
    fluid = cylinder(body.bore, body.inner_length) - cylinder(piston.diameter, piston.length) - in_chambers
    return math.fsum(
        (
            tube * body.material.density,
            iron * piston.material.density,
            winding * coil.material.density,
            shaft * rod.material.density,
            fluid * drawing.filling.density,
        )
    )


# -------------------------------------------------------------------------------------- the paper's sweeps


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Sinks that differ in one thing, what each does, and every candidate's values."""

    of: Literal["width", "fins"]
    effects: tuple[SinkEffect, ...]
    values: Mapping[str, FloatArray]  # by candidate, shape (sinks,)

    def trend(self, name: str) -> Trend:
        """Return how a candidate goes along the sweep."""
        return trend_of(self.values[name])

    def follows_paper(self, name: str) -> bool:
        """Whether a candidate has the paper's trend: a peak at 23 mm, or at four fins."""
        values = self.values[name]
        return self.trend(name) == "peaks" and int(np.argmax(values)) == 1


def paper_sweeps(drawing: DamperDrawing, sink: HeatSink, loads: Sequence[Load]) -> tuple[Sweep, Sweep]:
    """Return the paper's sweeps on a damper: widths of 18 to 33 mm of three fins, and three to five of 23 mm.

    Parameters
    ----------
    sink : gives what the sweeps do not vary: thickness, material, finish, law, multiplier, contact

    Raises
    ------
    InputError
        The paper's fins at 20 mm pitch do not fit on the damper.
    """
    bare = float(simulate_network(zone_network(drawing.with_sink(None)), loads).fluid[-1])
    base = replace(sink, pitch=PAPER_PITCH)
    widths = [replace(base, fins=PAPER_FINS[0], width=width) for width in PAPER_WIDTHS]
    numbers = [replace(base, fins=fins, width=PAPER_WIDTHS[1]) for fins in PAPER_FINS]

    def sweep(of: Literal["width", "fins"], sinks: Sequence[HeatSink]) -> Sweep:
        effects = tuple(judge_sink(drawing, each, loads, bare=bare) for each in sinks)
        values = {
            name: np.array([each.value(effect) for effect in effects]) for name, each in EFFICIENCIES.items()
        }
        return Sweep(of, effects, MappingProxyType(values))

    return sweep("width", widths), sweep("fins", numbers)


def trend_of(values: Sequence[float] | FloatArray) -> Trend:
    """Return whether numbers rise, fall, or rise and then fall; anything else is ``other``."""
    steps = np.sign(np.diff(np.asarray(values, dtype=np.float64)))
    if (steps > 0.0).all():
        return "rises"
    if (steps < 0.0).all():
        return "falls"
    turns = np.flatnonzero(np.diff(steps))
    return "peaks" if len(turns) == 1 and steps[0] > 0.0 and steps[-1] < 0.0 else "other"
