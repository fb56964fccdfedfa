"""Thermal networks: nodes with heat capacities, conductances, losses to ambient, and heat sources.

``zone_network`` builds a network from a geometry. The network has three axial zones (chamber, piston,
chamber), each with a node for core (rod or piston), fluid and wall. With the coil and the fins of each zone,
there are ten to thirteen nodes. The module ``lumped`` builds a network with one node. ``transient``
integrates a network in time, and ``temperature_rise`` computes the heat sources.

The heat loss of a surface depends only on its temperature because the ambient temperature is constant.
Therefore each loss is a table of heat flow versus temperature, and the time integration does not evaluate
correlations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.films.correlations import radiation_film
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.model.surfaces import (
    body_film,
    cap_area,
    fin_efficiency,
    fin_film,
    fin_films,
    fin_radiation,
)

PATHS = ("body convection", "body radiation", "fin convection", "fin radiation", "mount")
"""Paths of heat losses, in the order in which reports list them."""

LOSS_STEP_K = 2.0  # temperature step of the tables of heat losses
LOSS_RANGE_K = (233.15, 653.15)  # temperature range of the tables of heat losses
# Temperature rise at which the conductance of the fins is computed. Another rise hardly changes results.
FIN_RISE_K = 60.0


@dataclass(frozen=True, slots=True)
class NodeFactors:
    """Factors on conductances that adapt the network with few nodes to the finite-element model.

    The factors were fitted to 16 random dampers (even seeds of ``tests/thermal/bodies``). They are needed
    because the network does not resolve two effects: the fluid temperature near the walls, and the
    constriction of the heat flow at the root of a fin.
    """

    fluid_wall: float = 2.22
    fluid_core: float = 1.24
    coil: float = 1.22
    fin_root: float = 0.60


NODE_FACTORS = NodeFactors()


@dataclass(frozen=True, slots=True, eq=False)
class ThermalNetwork:
    """A thermal network with n nodes and m losses. Arrays are read-only.

    A loss is a heat flow from one node to ambient. ``watts[j]`` is the loss of node ``loss_node[j]`` at the
    temperatures ``grid``. ``mechanical`` and ``electrical`` are the fractions of mechanical power and coil
    heat that each node receives. ``fluid``, ``coil`` and ``wall`` are the weights of the nodes in the mean
    temperatures of fluid, coil and wall. The sum of each of these five arrays is 1.
    """

    model: str  # "network" or "lumped"
    names: tuple[str, ...]
    capacity: FloatArray  # heat capacity of the nodes [J/K], shape (n,)
    conductance: FloatArray  # conductance between nodes [W/K], shape (n, n), symmetric, zero diagonal
    mechanical: FloatArray  # fractions of the mechanical power [-], shape (n,)
    electrical: FloatArray  # fractions of the coil heat [-], shape (n,)
    fluid: FloatArray  # weights in the mean fluid temperature [-], shape (n,)
    coil: FloatArray  # weights in the mean coil temperature [-], shape (n,)
    wall: FloatArray  # weights in the mean wall temperature [-], shape (n,)
    ambient: float  # ambient temperature [K]
    grid: FloatArray  # equidistant temperatures of the loss tables [K], shape (g,)
    loss_node: tuple[int, ...]  # index of the node of each loss
    loss_path: tuple[str, ...]  # path of each loss, one of PATHS
    watts: FloatArray  # heat losses at the temperatures ``grid`` [W], shape (m, g)

    def __post_init__(self) -> None:
        for name in (
            "capacity",
            "conductance",
            "mechanical",
            "electrical",
            "fluid",
            "coil",
            "wall",
            "watts",
            "grid",
        ):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def total_capacity(self) -> float:
        """Return the heat capacity of the whole damper [J/K]."""
        return float(self.capacity.sum())


def loss_grid(ambient: float) -> FloatArray:
    """Return equidistant temperatures for the loss tables [K]; the ambient temperature is one of them."""
    below = math.floor((ambient - LOSS_RANGE_K[0]) / LOSS_STEP_K)
    above = math.floor((LOSS_RANGE_K[1] - ambient) / LOSS_STEP_K)
    steps = np.arange(-below, above + 1, dtype=np.float64)
    return np.asarray(ambient + LOSS_STEP_K * steps)


def zone_network(drawing: DamperDrawing, factors: NodeFactors = NODE_FACTORS) -> ThermalNetwork:
    """Return the thermal network of a geometry with three axial zones.

    Conductances are computed for annuli and discs between the centres of the nodes. For nodes with a heat
    source (coil, fluid), the thermal resistance refers to the mean temperature of the node. The fins have
    the steady-state heat flow of the exact solution (``fin_root_conductance``).
    """
    parts = _Parts(factors)
    _add_solids(parts, drawing)
    _join_radially(parts, drawing)
    _join_axially(parts, drawing)
    losses = _Losses(drawing)
    _add_walls(parts, losses, drawing)
    if drawing.sink is not None:
        _add_fins(parts, losses, drawing, drawing.sink)
    names = tuple(parts.capacity)
    order = {name: k for k, name in enumerate(names)}
    conductance = np.zeros((len(names), len(names)))
    for (one, other), value in parts.conductance.items():
        conductance[order[one], order[other]] += value
        conductance[order[other], order[one]] += value
    capacity = np.array(list(parts.capacity.values()))

    def share(*chosen: str) -> FloatArray:
        weights = np.array([capacity[order[name]] if name in chosen else 0.0 for name in names])
        return np.asarray(weights / weights.sum())

    return ThermalNetwork(
        model="network",
        names=names,
        capacity=capacity,
        conductance=conductance,
        mechanical=share("fluid 1"),
        electrical=share("coil"),
        fluid=share("fluid 0", "fluid 1", "fluid 2"),
        coil=share("coil"),
        wall=share("wall 0", "wall 1", "wall 2"),
        ambient=drawing.surroundings.ambient,
        grid=losses.grid,
        loss_node=tuple(order[name] for name in losses.nodes),
        loss_path=tuple(losses.paths),
        watts=np.array(losses.watts),
    )


class _Parts:
    """Heat capacities and conductances of a network under construction, by node and by pair of nodes."""

    def __init__(self, factors: NodeFactors) -> None:
        self.factors = factors
        self.capacity: dict[str, float] = {}
        self.conductance: dict[tuple[str, str], float] = {}

    def join(self, one: str, other: str, value: float) -> None:
        if one in self.capacity and other in self.capacity and value > 0.0:
            self.conductance[one, other] = self.conductance.get((one, other), 0.0) + value


def _add_solids(parts: _Parts, drawing: DamperDrawing) -> None:
    """Add the nodes of core, fluid, wall and coil with their heat capacities."""
    body, piston, rod, coil = drawing.body, drawing.piston, drawing.rod, drawing.coil
    factor = drawing.capacity_factor
    steel, fluid = body.material.volumetric_heat, drawing.filling.volumetric_heat
    bore, chamber = 0.5 * body.bore, drawing.chamber_length
    for zone in (0, 1, 2):
        shaft = _rod_radius(drawing, zone)
        tube = _ring(bore, 0.5 * body.outer_diameter)
        if zone == 1:
            winding = _ring(0.5 * piston.diameter - coil.depth, 0.5 * piston.diameter) * coil.length
            iron = _ring(shaft, 0.5 * piston.diameter) * piston.length - winding
            shaft_heat = _ring(0.0, shaft) * piston.length * rod.material.volumetric_heat
            parts.capacity["core 1"] = factor * (iron * piston.material.volumetric_heat + shaft_heat)
            parts.capacity["fluid 1"] = factor * fluid * _ring(0.5 * piston.diameter, bore) * piston.length
            parts.capacity["wall 1"] = factor * steel * tube * piston.length
            parts.capacity["coil"] = factor * winding * coil.material.volumetric_heat
            continue
        if shaft > 0.0:
            length = chamber + body.cap
            parts.capacity[f"core {zone}"] = (
                factor * _ring(0.0, shaft) * length * rod.material.volumetric_heat
            )
        parts.capacity[f"fluid {zone}"] = factor * fluid * _ring(shaft, bore) * chamber
        parts.capacity[f"wall {zone}"] = (
            factor * steel * (tube * (chamber + body.cap) + _ring(shaft, bore) * body.cap)
        )


def _join_radially(parts: _Parts, drawing: DamperDrawing) -> None:
    """Connect core, fluid and wall in every zone, and the coil with its neighbours."""
    body, piston, rod, coil = drawing.body, drawing.piston, drawing.rod, drawing.coil
    factors = parts.factors
    conducts, steel = drawing.fluid_heat, body.material.conductivity
    stirred, in_gap = conducts.chamber, conducts.gap
    bore, face, outer = 0.5 * body.bore, 0.5 * piston.diameter, 0.5 * body.outer_diameter
    chamber = drawing.chamber_length
    half_wall = math.log((bore + outer) / (2.0 * bore)) / (2.0 * math.pi * steel)  # [K/W] for 1 m of length
    for zone in (0, 2):
        shaft = _rod_radius(drawing, zone)
        outwards = _from_mean(shaft, bore) / (2.0 * math.pi * stirred) + half_wall
        to_cap = _ring(shaft, bore) / (chamber / (6.0 * stirred) + 0.5 * body.cap / steel)
        parts.join(f"fluid {zone}", f"wall {zone}", factors.fluid_wall * (chamber / outwards + to_cap))
        if shaft > 0.0:
            inwards = _to_inner_from_mean(shaft, bore) / (2.0 * math.pi * stirred)
            inwards += 1.0 / (8.0 * math.pi * rod.material.conductivity)
            parts.join(f"fluid {zone}", f"core {zone}", factors.fluid_core * chamber / inwards)
            along = rod.material.conductivity * _ring(0.0, shaft) / (0.5 * chamber)
            parts.join(f"core {zone}", f"wall {zone}", along)
    # One half of the fluid in the gap heats the wall, and one half heats the piston. The resistance of each
    # half refers to its mean temperature.
    middle = 0.5 * (face + bore)
    half_gap = math.log(bore / middle) / (2.0 * math.pi * in_gap) / 3.0
    parts.join("fluid 1", "wall 1", factors.fluid_wall * piston.length / (half_gap + half_wall))
    half_gap = math.log(middle / face) / (2.0 * math.pi * in_gap) / 3.0
    iron = piston.length - coil.length
    if iron > 0.0:
        solid = 1.0 / (8.0 * math.pi * piston.material.conductivity)
        parts.join("fluid 1", "core 1", factors.fluid_core * iron / (half_gap + solid))
    across, root = coil.material.conductivity, face - coil.depth
    half = face - 0.5 * coil.depth
    outwards = half_gap + math.log(face / half) / (2.0 * math.pi * across) / 3.0
    parts.join("fluid 1", "coil", factors.coil * coil.length / outwards)
    inwards = math.log(half / root) / (2.0 * math.pi * across) / 3.0
    ends = 2.0 * _ring(root, face) * across / (coil.length / 6.0)
    parts.join("coil", "core 1", factors.coil * (coil.length / inwards + (ends if iron > 0.0 else 0.0)))


def _join_axially(parts: _Parts, drawing: DamperDrawing) -> None:
    """Connect the zones by conduction in tube, rod and piston ends, and by the pumped fluid."""
    body, piston, rod = drawing.body, drawing.piston, drawing.rod
    factors, chamber, conducts = parts.factors, drawing.chamber_length, drawing.fluid_heat
    tube = body.material.conductivity * _ring(0.5 * body.bore, 0.5 * body.outer_diameter)
    for zone in (0, 2):
        shaft = _rod_radius(drawing, zone)
        parts.join(f"wall {zone}", "wall 1", 2.0 * tube / (chamber + piston.length))
        parts.join(f"fluid {zone}", "fluid 1", conducts.exchange)
        if shaft > 0.0:
            resistance = 0.5 * chamber / (rod.material.conductivity * _ring(0.0, shaft))
            resistance += (
                0.5 * piston.length / (piston.material.conductivity * _ring(0.0, 0.5 * piston.diameter))
            )
            parts.join(f"core {zone}", "core 1", 1.0 / resistance)
        end = _ring(shaft, 0.5 * piston.diameter)
        resistance = chamber / (6.0 * conducts.chamber)
        resistance += 0.5 * piston.length / piston.material.conductivity
        parts.join(f"fluid {zone}", "core 1", factors.fluid_core * end / resistance)


class _Losses:
    """Heat losses to ambient of a network under construction."""

    def __init__(self, drawing: DamperDrawing) -> None:
        self.drawing = drawing
        self.grid = loss_grid(drawing.surroundings.ambient)
        self.excess = self.grid - drawing.surroundings.ambient
        self.body_film = body_film(drawing, self.grid)
        self.black_film = radiation_film(1.0, self.grid, drawing.surroundings.ambient)
        self.fins = fin_films(drawing, self.grid) if drawing.sink is not None else None
        self.nodes: list[str] = []
        self.paths: list[str] = []
        self.watts: list[FloatArray] = []

    def add(self, node: str, path: str, conductance: FloatArray | float) -> None:
        """Add the heat loss of a node with a conductance to ambient [W/K], unless zero."""
        watts = np.asarray(conductance * self.excess)
        if watts.any():
            self.nodes.append(node)
            self.paths.append(path)
            self.watts.append(watts)


def _add_walls(parts: _Parts, losses: _Losses, drawing: DamperDrawing) -> None:
    """Add the heat losses of tube, caps and mountings."""
    around, sink = drawing.surroundings, drawing.sink
    edges = _zone_edges(drawing)
    circumference = math.pi * drawing.body.outer_diameter
    groove = fin_radiation(drawing)[1] if sink is not None else 0.0
    for zone in (0, 1, 2):
        low, high = edges[zone], edges[zone + 1]
        covered, floors = (0.0, 0.0) if sink is None else _covered(sink, drawing.body.length, low, high)
        bare = circumference * (high - low - covered)
        if zone != 1:
            bare += cap_area(drawing, with_rod=_rod_radius(drawing, zone) > 0.0)
        floor = circumference * floors
        film = bare * losses.body_film
        radiating = bare * around.emissivity + floor * groove
        if losses.fins is not None:
            film = film + floor * losses.fins.floor
        losses.add(f"wall {zone}", "body convection", film)
        losses.add(f"wall {zone}", "body radiation", radiating * losses.black_film)
        if zone != 1:
            losses.add(f"wall {zone}", "mount", 0.5 * around.mount)
            _add_rod_end(losses, drawing, zone)


def _add_rod_end(losses: _Losses, drawing: DamperDrawing, zone: int) -> None:
    """Add the heat losses through the mounting of a rod end, from the rod and from the cap."""
    shaft, rod, body = _rod_radius(drawing, zone), drawing.rod, drawing.body
    if shaft == 0.0 or rod.mount == 0.0:
        return
    along = rod.material.conductivity * _ring(0.0, shaft) / (0.5 * drawing.chamber_length + body.cap)
    across = 2.0 * math.pi * body.material.conductivity * body.cap / math.log(0.5 * body.bore / shaft)
    for node, share in ((f"core {zone}", along), (f"wall {zone}", across)):
        losses.add(node, "mount", rod.mount * share / (rod.mount + along + across))


def _add_fins(parts: _Parts, losses: _Losses, drawing: DamperDrawing, sink: HeatSink) -> None:
    """Add one node for the fins of each zone, with conductance to the wall and heat losses."""
    diameter = drawing.body.outer_diameter
    edges = _zone_edges(drawing)
    area = sink.fin_area(diameter)
    emissivity, _ = fin_radiation(drawing)
    root = fin_root_conductance(drawing, sink)
    convection = fin_film(drawing, losses.grid)
    for zone in (0, 1, 2):
        count = _fins_on(sink, drawing.body.length, edges[zone], edges[zone + 1])
        if count == 0.0:
            continue
        name = f"fins {zone}"
        heat = sink.material.volumetric_heat
        parts.capacity[name] = count * sink.fin_volume(diameter) * heat
        parts.join(f"wall {zone}", name, parts.factors.fin_root * count * root)
        losses.add(name, "fin convection", count * area * convection)
        losses.add(name, "fin radiation", count * area * emissivity * losses.black_film)


def fin_root_conductance(drawing: DamperDrawing, sink: HeatSink) -> float:
    """Return the conductance between body and node of one fin [W/K], with contact.

    The node has the mean temperature of the fin. The conduction in the fin is h A eta / (1 - eta) with the
    heat-transfer coefficient h, the area A and the efficiency eta. With this conductance, the steady-state
    heat flow agrees with the exact solution for a fin. The conductance is computed at 60 K above ambient.
    """
    diameter = drawing.body.outer_diameter
    film, efficiency = map(float, fin_efficiency(drawing, drawing.surroundings.ambient + FIN_RISE_K))
    conduction = film * sink.fin_area(diameter) * efficiency / (1.0 - efficiency)
    contact = sink.contact / (math.pi * diameter * sink.thickness)
    return 1.0 / (1.0 / conduction + contact)


# ------------------------------------------------------------------------------------------------ geometry


def _ring(inner: float, outer: float) -> float:
    """Return the area between two radii [m^2]."""
    return math.pi * (outer**2 - inner**2)


def _rod_radius(drawing: DamperDrawing, zone: int) -> float:
    """Return the rod radius in a zone [m]; zero if the zone contains no rod."""
    return 0.5 * drawing.rod.diameter if zone != 2 or drawing.rod.through else 0.0


def _zone_edges(drawing: DamperDrawing) -> tuple[float, float, float, float]:
    """Return the four axial positions at which the three zones of the body begin and end [m]."""
    first = drawing.body.cap + drawing.chamber_length
    return 0.0, first, first + drawing.piston.length, drawing.body.length


def _covered(sink: HeatSink, body_length: float, low: float, high: float) -> tuple[float, float]:
    """Return lengths from ``low`` to ``high`` [m]: under the sink, gaps between fins."""
    centres, half = sink.centres(body_length), 0.5 * sink.thickness

    def overlap(start: FloatArray, stop: FloatArray) -> float:
        return float(np.maximum(np.minimum(stop, high) - np.maximum(start, low), 0.0).sum())

    span = overlap(centres[:1] - half, centres[-1:] + half)
    return span, overlap(centres[:-1] + half, centres[1:] - half)


def _fins_on(sink: HeatSink, body_length: float, low: float, high: float) -> float:
    """Return the number of fins between two axial positions, with fractions of fins."""
    centres, half = sink.centres(body_length), 0.5 * sink.thickness
    shares = np.minimum(centres + half, high) - np.maximum(centres - half, low)
    return float(np.maximum(shares, 0.0).sum() / sink.thickness)


def _from_mean(inner: float, outer: float) -> float:
    """Return 2 pi k L R for an annulus of conductivity k and length L.

    The annulus has a uniform heat source and an insulated inner surface. R is the temperature difference
    between the mean and the outer surface, divided by the heat flow. The result for a cylinder is 1/4.
    """
    if inner == 0.0:
        return 0.25
    area = outer**2 - inner**2
    ratio = math.log(outer / inner)
    # ``mean`` is the mean of (r2^2 - r^2)/4 - r1^2/2 ln(r2/r), the temperature for heat source / k = 1.
    mean = (area**2 / 16.0 - 0.25 * inner**2 * (0.5 * area - inner**2 * ratio)) * 2.0 / area
    return 2.0 * mean / area


def _to_inner_from_mean(inner: float, outer: float) -> float:
    """Return 2 pi k L R for an annulus of conductivity k and length L.

    The annulus has a uniform heat source and an insulated outer surface. R is the temperature difference
    between the mean and the inner surface, divided by the heat flow.
    """
    area = outer**2 - inner**2
    ratio = math.log(outer / inner)
    # ``mean`` is the mean of r2^2/2 ln(r/r1) - (r^2 - r1^2)/4, the temperature for heat source / k = 1.
    logs = 0.5 * (outer**2 * ratio - 0.5 * area)
    mean = (0.5 * outer**2 * logs - area**2 / 16.0) * 2.0 / area
    return 2.0 * mean / area
