"""Meridian section of a damper: rectangles of material, and edges that lose heat.

The section defines the heat conduction problem without a mesh, for the finite elements of the package and for
other programs in ``cross_check``. ``section_of`` creates a section from a geometry.

In this model, the rod ends at the caps. Its ends lose heat only if the geometry file has a conductance to the
mounting of the rod. The moving fluid is modelled as a solid with effective conductivity. Its radial
conductivity is the conductivity of the stirred fluid. Its axial conductivity also includes the heat transport
by the pumped fluid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.heat_capacity import CapacityCurve
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import Material
from mrdamper.thermal.model.network import loss_grid
from mrdamper.thermal.model.surfaces import body_film, cap_area, fin_films

Role = Literal["core", "coil", "gap", "chamber", "wall", "fins"]

_CONTACT_LAYER = 0.5e-3  # max thickness of the layer at a fin root that models a contact resistance [m]


@dataclass(frozen=True, slots=True)
class Region:
    """A material in the section: conductivities, heat capacity, and role in the damper."""

    name: str
    role: Role
    conductivity_r: float  # [W/(m K)]
    conductivity_z: float  # [W/(m K)]
    volumetric_heat: float  # [J/(m^3 K)]
    growth: CapacityCurve | None = None  # heat capacity versus temperature, divided by its mean

    @property
    def part(self) -> str:
        """Return the part, such as fluid, whose mean temperature sets the heat capacity."""
        return {"gap": "fluid", "chamber": "fluid", "fins": "fins"}.get(self.role, self.name)


@dataclass(frozen=True, slots=True)
class Block:
    """A rectangle of the section with the material of a region. Blocks do not overlap."""

    region: int  # index in ``Section.regions``
    inner: float  # inner radius [m]
    outer: float  # outer radius [m]
    low: float  # axial position of the lower end [m]
    high: float  # axial position of the upper end [m]

    @property
    def volume(self) -> float:
        """Volume of the rectangle rotated about the axis [m^3]."""
        return math.pi * (self.outer**2 - self.inner**2) * (self.high - self.low)


@dataclass(frozen=True, slots=True)
class Surface:
    """A kind of outer surface and its cooling by convection, radiation and mounting."""

    name: str
    law: int  # row of ``Section.films`` with the convective coefficients of the surface
    emissivity: float
    mount: float  # conductance to the mountings divided by area [W/(m^2 K)]
    convection_path: str  # Heat loss by convection is reported under this entry of network.PATHS.
    radiation_path: str  # Heat loss by radiation is reported under this entry of network.PATHS.


@dataclass(frozen=True, slots=True)
class Edge:
    """A straight part of the outline along r or z that loses heat. The remaining outline is insulated."""

    surface: int  # index in ``Section.surfaces``
    inner: float  # inner radius [m]
    outer: float  # outer radius [m]; equal to ``inner`` for an edge along z
    low: float  # axial position of the lower end [m]
    high: float  # axial position of the upper end [m]; equal to ``low`` for an edge along r

    @property
    def area(self) -> float:
        """Return the area of the surface of revolution [m^2]."""
        if self.inner == self.outer:
            return 2.0 * math.pi * self.inner * (self.high - self.low)
        return math.pi * (self.outer**2 - self.inner**2)


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Geometry, materials and cooling of a meridian section.

    Mechanical power is distributed uniformly in the regions with the role ``gap``, and coil heat in the
    regions with the role ``coil``. The fluid temperature is the mean over ``gap`` and ``chamber``.
    """

    regions: tuple[Region, ...]
    blocks: tuple[Block, ...]
    surfaces: tuple[Surface, ...]
    edges: tuple[Edge, ...]
    ambient: float  # ambient temperature [K]
    grid: FloatArray  # equidistant surface temperatures [K], shape (g,)
    films: FloatArray  # convective coefficients at the temperatures ``grid`` [W/(m^2 K)], shape (rows, g)
    seals: tuple[Block, ...] = ()  # positions of the rod seals on the rod surface, as blocks of zero width
    drawing: DamperDrawing | None = None  # geometry of the section; None in tests

    def __post_init__(self) -> None:
        for name in ("grid", "films"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def volume(self, *roles: Role) -> float:
        """Return the volume of the regions with these roles [m^3]."""
        return math.fsum(block.volume for block in self.blocks if self.regions[block.region].role in roles)

    @property
    def heat_capacity(self) -> float:
        """Return the total heat capacity [J/K]."""
        return math.fsum(block.volume * self.regions[block.region].volumetric_heat for block in self.blocks)


def section_of(drawing: DamperDrawing) -> Section:
    """Return the meridian section of a geometry, with calibrated ``films``."""
    regions, blocks = _insides(drawing)
    around, sink = drawing.surroundings, drawing.sink
    grid = loss_grid(around.ambient)
    films = [body_film(drawing, grid)]
    surfaces = [Surface("bare", 0, around.emissivity, 0.0, "body convection", "body radiation")]
    edges = _caps(drawing, surfaces)
    outer, length = 0.5 * drawing.body.outer_diameter, drawing.body.length
    if sink is None:
        edges.append(Edge(0, outer, outer, 0.0, length))
    else:
        on_fins = fin_films(drawing, grid)
        films += [on_fins.sides, on_fins.rim, on_fins.floor]
        groove = sink.groove_share(drawing.body.outer_diameter, around.emissivity)
        surfaces += [
            Surface("floor", 3, groove, 0.0, "body convection", "body radiation"),
            Surface("groove", 1, groove, 0.0, "fin convection", "fin radiation"),
            Surface("outside", 1, sink.emissivity, 0.0, "fin convection", "fin radiation"),
            Surface("rim", 2, sink.emissivity, 0.0, "fin convection", "fin radiation"),
        ]
        _add_fins(regions, blocks, edges, drawing, sink)
    shaft = 0.5 * drawing.rod.diameter
    if drawing.rod.mount > 0.0:
        films.append(np.zeros_like(grid))
        mount = drawing.rod.mount / (math.pi * shaft**2)
        edges += [
            Edge(len(surfaces), 0.0, shaft, end, end) for end in (0.0, length)[: 1 + drawing.rod.through]
        ]
        surfaces.append(Surface("rod end", len(films) - 1, 0.0, mount, "body convection", "body radiation"))
    seals = [Block(0, shaft, shaft, 0.0, drawing.body.cap)]
    if drawing.rod.through:
        seals.append(Block(0, shaft, shaft, length - drawing.body.cap, length))
    return Section(
        tuple(regions), tuple(blocks), tuple(surfaces), tuple(edges), around.ambient, grid, np.array(films),
        tuple(seals), drawing,
    )  # fmt: skip


def _insides(drawing: DamperDrawing) -> tuple[list[Region], list[Block]]:
    """Return the regions and blocks of the damper without fins."""
    body, piston, rod, coil = drawing.body, drawing.piston, drawing.rod, drawing.coil
    factor, growth = drawing.capacity_factor, drawing.capacity_growth
    shaft, face, bore, outer = (
        0.5 * diameter for diameter in (rod.diameter, piston.diameter, body.bore, body.outer_diameter)
    )
    far_shaft, conducts = shaft if rod.through else 0.0, drawing.fluid_heat
    root = face - coil.depth
    start = body.cap + drawing.chamber_length
    stop, end, length = start + piston.length, body.length - body.cap, body.length
    first, last = 0.5 * (length - coil.length), 0.5 * (length + coil.length)

    def solid(name: str, role: Role, material: Material) -> Region:
        k = material.conductivity
        return Region(name, role, k, k, factor * material.volumetric_heat, growth(name))

    def fluid(name: str, role: Role, inner: float, outer: float) -> Region:
        across = conducts.gap if role == "gap" else conducts.chamber
        along = across + drawing.exchange_conductivity / (math.pi * (outer**2 - inner**2))
        return Region(name, role, across, along, factor * drawing.filling.volumetric_heat, growth("fluid"))

    regions = [
        solid("rod", "core", rod.material),
        solid("piston", "core", piston.material),
        solid("coil", "coil", coil.material),
        solid("body", "wall", body.material),
        fluid("gap", "gap", face, bore),
        fluid("near chamber", "chamber", shaft, bore),
        fluid("far chamber", "chamber", far_shaft, bore),
    ]
    blocks = [
        Block(0, 0.0, shaft, 0.0, length if rod.through else stop),
        Block(1, shaft, root, start, stop),
        Block(1, root, face, start, first),
        Block(1, root, face, last, stop),
        Block(2, root, face, first, last),
        Block(3, bore, outer, 0.0, length),
        Block(3, shaft, bore, 0.0, body.cap),
        Block(3, far_shaft, bore, end, length),
        Block(4, face, bore, start, stop),
        Block(5, shaft, bore, body.cap, start),
        Block(6, far_shaft, bore, stop, end),
    ]
    return regions, [block for block in blocks if block.high > block.low]


def _caps(drawing: DamperDrawing, surfaces: list[Surface]) -> list[Edge]:
    """Add a surface for each cap, and return the edges of both caps."""
    around, rod = drawing.surroundings, drawing.rod
    edges = []
    for name, at, shaft in (("near cap", 0.0, True), ("far cap", drawing.body.length, rod.through)):
        mount = 0.5 * around.mount / cap_area(drawing, with_rod=shaft)
        edges.append(
            Edge(
                len(surfaces), 0.5 * rod.diameter if shaft else 0.0, 0.5 * drawing.body.outer_diameter, at, at
            )
        )
        surfaces.append(Surface(name, 0, around.emissivity, mount, "body convection", "body radiation"))
    return edges


def _add_fins(
    regions: list[Region], blocks: list[Block], edges: list[Edge], drawing: DamperDrawing, sink: HeatSink
) -> None:
    """Add regions and blocks of the fins, and the edges of the fins and of the tube next to them."""
    bare, floor, groove, outside, rim = 0, 3, 4, 5, 6
    root, length = 0.5 * drawing.body.outer_diameter, drawing.body.length
    tip, half, k = root + sink.width, 0.5 * sink.thickness, sink.material.conductivity
    heat, growth = sink.material.volumetric_heat, drawing.capacity_growth("fins")
    regions.append(Region("fins", "fins", k, k, heat, growth))
    fins, foot = len(regions) - 1, root
    if sink.contact > 0.0:
        layer = min(_CONTACT_LAYER, 0.1 * sink.width)
        foot = root + layer
        tight = layer / (sink.contact + layer / k)
        regions.append(Region("fin feet", "fins", tight, k, heat, growth))
    centres = [float(centre) for centre in sink.centres(length)]
    for number, centre in enumerate(centres):
        low, high = max(centre - half, 0.0), min(centre + half, length)
        blocks.append(Block(fins, foot, tip, low, high))
        if foot > root:
            blocks.append(Block(fins + 1, root, foot, low, high))
        edges.append(Edge(rim, tip, tip, low, high))
        edges.append(Edge(outside if number == 0 else groove, root, tip, low, low))
        edges.append(Edge(outside if number == len(centres) - 1 else groove, root, tip, high, high))
        if number > 0:
            edges.append(Edge(floor, root, root, centres[number - 1] + half, low))
    for low, high in ((0.0, max(centres[0] - half, 0.0)), (min(centres[-1] + half, length), length)):
        if high > low:
            edges.append(Edge(bare, root, root, low, high))
