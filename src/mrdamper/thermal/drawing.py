"""Geometry of a damper for thermal simulation: lengths, materials, surroundings.

Users write the geometry as TOML in millimetres and degC (docs/thermal.md, ``drawing_file``). The fields are
in metres and kelvin. The damper is axisymmetric. It consists of a tube with a flat cap at each end, a piston
in the middle of the bore, and a rod. The piston has a coil in its outer surface. Annular fins can surround
the middle of the body.
``network`` and ``finite_element`` compute the heat flow. ``surfaces`` computes the heat-transfer
coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated, Literal

from mrdamper.errors import InputError
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K, to_degC
from mrdamper.schema import Option, check_ranges
from mrdamper.thermal.heat_capacity import CapacityCurve, PolynomialHeatCapacity
from mrdamper.thermal.heatsink import HeatSink, Manufacture, length_option
from mrdamper.thermal.materials import INSULATION_DEGC, MATERIALS, SEALS_DEGC, Material
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.stirring import PAPER_STROKE, Channel, FluidHeat, Stroke, conduct_fluid

Orientation = Literal["horizontal", "vertical"]

_NOTHING: Mapping[str, float] = MappingProxyType({})
_STEEL = MATERIALS["steel"]
AIR_MAX_M_S = 50.0
"""Maximum air speed across the axis [m/s]."""

DISC_GAP = 0.010
"""Minimum gap between the fins of a vertical damper [m]. Closer fins do not behave like single discs."""


@dataclass(frozen=True, slots=True)
class Body:
    """The tube and its two caps; lengths in metres."""

    outer_diameter: Annotated[float, length_option("outer_diameter_mm")]
    """Outer diameter of the tube."""
    length: Annotated[float, length_option("length_mm")]
    """Length including the caps."""
    wall: Annotated[float, length_option("wall_mm")]
    """Wall thickness of the tube."""
    cap: Annotated[float, length_option("cap_mm", "the thickness of the wall")] = 0.0
    """Thickness of each cap; 0 selects the thickness of the wall."""
    material: Annotated[Material, Option(among=lambda: MATERIALS)] = _STEEL
    orientation: Orientation = "horizontal"
    """Orientation of the axis."""

    def __post_init__(self) -> None:
        if self.cap == 0.0:
            object.__setattr__(self, "cap", self.wall)

    @property
    def bore(self) -> float:
        """Inner diameter [m]."""
        return self.outer_diameter - 2.0 * self.wall

    @property
    def inner_length(self) -> float:
        """Length between the caps [m]."""
        return self.length - 2.0 * self.cap


@dataclass(frozen=True, slots=True)
class Piston:
    """The piston in its mean position in the middle of the bore; lengths in metres."""

    diameter: Annotated[float, length_option("diameter_mm")]
    """Diameter of the piston."""
    length: Annotated[float, length_option("length_mm")]
    """Axial length of the piston."""
    material: Annotated[Material, Option(among=lambda: MATERIALS)] = _STEEL


@dataclass(frozen=True, slots=True)
class Rod:
    """The rod. If ``through`` is True, the rod leaves the body at both ends."""

    diameter: Annotated[float, length_option("diameter_mm")]
    """Diameter of the rod."""
    through: bool = True
    """The rod leaves the body at both ends."""
    material: Annotated[Material, Option(among=lambda: MATERIALS)] = _STEEL
    mount: Annotated[float, Option(key="mount_W_K", unit="W/K", least=0.0)] = 0.0
    """Conductance from each outer end of the rod to its mounting, which has ambient temperature."""


@dataclass(frozen=True, slots=True)
class Coil:
    """The winding, which is a ring in the middle of the outer surface of the piston; lengths in metres."""

    resistance: Annotated[float, Option(key="resistance_ohm", unit="ohm", least=0.0)]
    """Coil resistance at 20 degC."""
    length: Annotated[float, length_option("length_mm")]
    """Axial length of the winding."""
    depth: Annotated[float, length_option("depth_mm", "0.4 of the gap between rod and piston surface")] = 0.0
    """Radial depth below the surface of the piston; 0 selects the default."""
    amperes_per_volt: Annotated[float | None, Option(key="A_per_V", unit="A/V", above=0.0)] = None
    """Current per volt, for cards with a command in volts."""
    material: Annotated[Material, Option(among=lambda: MATERIALS)] = MATERIALS["winding"]
    """Material of the winding."""
    insulation: Annotated[str, Option(key="insulation_class", among=lambda: INSULATION_DEGC)] = "F"
    """Insulation class, which limits the hottest point of the winding."""
    limit: Annotated[
        float | None, Option(key="limit_degC", unit="degC", default_help="the limit of the class")
    ] = None
    """Limit of the hottest point of the winding."""
    conductivity: Annotated[
        float | None,
        Option(key="conductivity_W_m_K", unit="W/(m K)", above=0.0, default_help="the value of the material"),
    ] = None
    """Conductivity across the wires, with enamel and potting."""

    def __post_init__(self) -> None:
        if self.conductivity is not None:
            material = replace(self.material, conductivity=self.conductivity)
            object.__setattr__(self, "material", material)


@dataclass(frozen=True, slots=True)
class Seals:
    """The seals of the rod in the caps."""

    material: Annotated[str, Option(among=lambda: SEALS_DEGC)] = "HNBR"
    """Material, which limits the hottest point of the seals."""
    limit: Annotated[
        float | None, Option(key="limit_degC", unit="degC", default_help="the value of the material")
    ] = None
    """Limit of the hottest point of the seals."""


@dataclass(frozen=True, slots=True)
class Filling:
    """Thermal properties of the fluid in the body."""

    name: str
    density: float  # [kg/m^3]
    heat_capacity: float  # [J/(kg K)]
    conductivity: float  # conductivity of the fluid at rest [W/(m K)]
    valid_K: tuple[float, float]
    stirring: float | None = None  # conductivity of the moving fluid / ``conductivity``; None: computed
    # Pumped fluid carries heat between the gap and each chamber: conductance [W/K]; None: computed.
    exchange: float | None = None

    @property
    def volumetric_heat(self) -> float:
        """Return the volumetric heat capacity [J/(m^3 K)]."""
        return self.density * self.heat_capacity


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Air and mountings of the damper."""

    ambient: Annotated[float, Option(key="ambient_degC", unit="degC", least=-50.0, most=100.0)] = REFERENCE_K
    """Temperature of the air around the damper."""
    air_speed: Annotated[float, Option(key="air_m_s", unit="m/s", least=0.0, most=AIR_MAX_M_S)] = 0.0
    """Speed of air across the axis."""
    emissivity: Annotated[float, Option(least=0.0, most=1.0)] = 0.3
    """Emissivity of the bare body."""
    mount: Annotated[float, Option(key="mount_W_K", unit="W/K", least=0.0)] = 0.0
    """Conductance of both ends of the body to the mountings, which have ambient temperature."""
    altitude: Annotated[float, Option(key="altitude_m", unit="m", least=-500.0, most=9000.0)] = 0.0
    """Altitude above sea level, which determines the density of air."""


Multiplier = Annotated[float, Option("Factor of the value in the geometry file.", above=0.0)]


@dataclass(frozen=True, slots=True)
class Calibration:
    """Calibration factors of heat capacity (without fins) and of body convection."""

    heat_capacity: Multiplier = 1.0
    film: Multiplier = 1.0

    def __post_init__(self) -> None:
        check_ranges(self, "calibration")


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperDrawing:
    """Geometry of a damper; the constructor raises InputError if parts do not fit."""

    name: str = "drawing"
    body: Body
    piston: Piston
    rod: Rod
    coil: Coil
    filling: Filling
    seals: Seals = field(default_factory=Seals)
    surroundings: Surroundings = field(default_factory=Surroundings)
    sink: HeatSink | None = None
    calibration: Calibration = field(default_factory=Calibration)
    manufacture: Manufacture = field(default_factory=Manufacture)
    stroke: Stroke = PAPER_STROKE  # mean stroke of the piston, which stirs the fluid
    heat_capacity: PolynomialHeatCapacity | None = None  # None: heat capacities do not depend on temperature
    text: str = field(default="", repr=False, compare=False)  # text of the geometry file

    def __post_init__(self) -> None:
        _check_body(self)
        _check_inside(self)
        check_ranges(self.surroundings, f"{self.name}: surroundings")
        _check_limits(self)
        _take_means(self)
        if self.sink is not None:
            _check_sink(self, self.sink)

    @property
    def capacity_factor(self) -> float:
        """Return the correction factor of the heat capacity from volumes and materials.

        The factor contains the calibration. If the geometry file states the heat capacity of the whole
        damper, the factor also contains the ratio of stated to computed value. Fins are excluded.
        """
        measured = None if self.heat_capacity is None else self.heat_capacity.parts.get("damper")
        share = 1.0 if measured is None else measured.mean / self._geometric_capacity
        return share * self.calibration.heat_capacity

    @property
    def _geometric_capacity(self) -> float:
        """Return the heat capacity without fins from volumes and materials [J/K]."""
        body, piston, rod, coil = self.body, self.piston, self.rod, self.coil
        far = rod.diameter if rod.through else 0.0
        winding = _ring(piston.diameter - 2.0 * coil.depth, piston.diameter) * coil.length
        bore, caps = 0.25 * math.pi * body.bore**2, _ring(rod.diameter, body.bore) + _ring(far, body.bore)
        in_gap = bore - 0.25 * math.pi * piston.diameter**2
        shaft = body.length if rod.through else body.cap + self.chamber_length + piston.length
        heats = (
            (body.material, _ring(body.bore, body.outer_diameter) * body.length + caps * body.cap),
            (piston.material, _ring(rod.diameter, piston.diameter) * piston.length - winding),
            (rod.material, 0.25 * math.pi * rod.diameter**2 * shaft),
            (coil.material, winding),
            (self.filling, in_gap * piston.length + caps * self.chamber_length),
        )
        return math.fsum(of.volumetric_heat * volume for of, volume in heats)

    def capacity_growth(self, part: str) -> CapacityCurve | None:
        """Return the curve heat capacity / mean heat capacity of a part; None if constant."""
        if self.heat_capacity is None:
            return None
        parts = self.heat_capacity.parts
        found = parts.get(part) or (parts.get("damper") if part != "fins" else None)
        return None if found is None else found.over_mean()

    def with_sink(self, sink: HeatSink | None) -> DamperDrawing:
        """Return the same damper with the given heat sink; None: without heat sink."""
        return replace(self, sink=sink)

    @property
    def gap(self) -> float:
        """Return the radial width of the annular gap between piston and bore [m]."""
        return 0.5 * (self.body.bore - self.piston.diameter)

    @property
    def piston_area(self) -> float:
        """Return the annular area of the piston around the rod [m^2]. The pressure acts on this area."""
        return _ring(self.rod.diameter, self.piston.diameter)

    @property
    def chamber_length(self) -> float:
        """Return the length of each chamber between piston and cap [m]."""
        return 0.5 * (self.body.inner_length - self.piston.length)

    @property
    def fluid_heat(self) -> FluidHeat:
        """Return the effective conductivities of the moving fluid, and the conductance from gap to chamber.

        Values that the geometry file does not state are computed from the stroke.
        """
        body, piston, rod, filling = self.body, self.piston, self.rod, self.filling
        channel = Channel(
            gap=self.gap,
            gap_area=0.25 * math.pi * (body.bore**2 - piston.diameter**2),
            piston_area=self.piston_area,
            piston_length=piston.length,
            chamber_length=self.chamber_length,
            chamber_width=0.5 * (body.bore - rod.diameter),
            conductivity=filling.conductivity,
            volumetric_heat=filling.volumetric_heat,
        )
        found = conduct_fluid(channel, self.stroke)
        if filling.stirring is not None:
            stirred = filling.stirring * filling.conductivity
            found = replace(found, gap=stirred, chamber=stirred)
        return found if filling.exchange is None else replace(found, exchange=filling.exchange)

    @property
    def exchange_conductivity(self) -> float:
        """Return conductivity times area [W m/K] of a solid that acts like pumped fluid.

        The solid conducts as much heat from the middle of the gap to the middle of a chamber as the pumped
        fluid carries. Divide the result by the area of gap or chamber to obtain its axial conductivity.
        """
        return 0.5 * self.fluid_heat.exchange * (self.piston.length + self.chamber_length)


def filling_of(fluid: Fluid, given: Mapping[str, float] = _NOTHING) -> Filling:
    """Return the thermal properties of a fluid; entries of ``given`` replace them.

    If the conductivity is missing, it is computed by Maxwell's formula for well-conducting spheres in oil.
    The oil has a conductivity of 0.14 W/(m K).
    """
    share = fluid.particle_fraction
    stated: dict[str, float | None] = {
        "density": fluid.density_kg_m3,
        "heat_capacity": fluid.heat_capacity_J_kg_K,
        "conductivity": fluid.conductivity_W_m_K
        or SETTINGS.carrier_conductivity_W_mK * (1.0 + 2.0 * share) / (1.0 - share),
    }
    known = {**stated, **given}
    for name, unit in (("density", "kg_m3"), ("heat_capacity", "J_kg_K")):
        if known[name] is None:
            raise InputError(
                place=f"fluid {fluid.name!r}",
                found=f"it states no {name}; give [fluid] {name}_{unit} in the drawing",
            )
    return Filling(
        name=fluid.name,
        valid_K=fluid.valid_K,
        **{name: float(value) for name, value in known.items() if value is not None},
    )


def find_filling(preset: str, given: Mapping[str, float] = _NOTHING) -> Filling:
    """Return the thermal properties of a fluid preset or of a fluid file (TOML)."""
    return filling_of(find_fluid(preset), given)


# ------------------------------------------------------------------------------------------------- checks


def _check_body(drawing: DamperDrawing) -> None:
    body = drawing.body
    check_ranges(body, f"{drawing.name}: body")
    _require(
        drawing,
        body.wall < 0.5 * body.outer_diameter,
        f"body.wall_mm is {_mm(body.wall)}, the outer radius {_mm(0.5 * body.outer_diameter)}",
        "a wall thinner than the radius; is outer_diameter_mm the diameter?",
    )
    _require(
        drawing,
        body.inner_length > 0.0,
        f"body.cap_mm is {_mm(body.cap)}, length_mm {_mm(body.length)}",
        "caps that leave space between them",
    )


def _check_inside(drawing: DamperDrawing) -> None:
    body, piston, rod, coil, place = drawing.body, drawing.piston, drawing.rod, drawing.coil, drawing.name
    check_ranges(piston, f"{place}: piston")
    check_ranges(rod, f"{place}: rod")
    hint = ""
    if piston.diameter < 2.0 * body.outer_diameter - 2.0 * body.wall:
        hint = (
            f". Is {_mm(body.outer_diameter)} mm the body's radius? Then outer_diameter_mm is "
            f"{_mm(2.0 * body.outer_diameter)}"
        )
    _require(
        drawing,
        piston.diameter < body.bore,
        f"piston.diameter_mm is {_mm(piston.diameter)}, the bore {_mm(body.bore)} (outer_diameter_mm less "
        "two walls)",
        f"a piston narrower than the bore{hint}",
    )
    _require(
        drawing,
        rod.diameter < piston.diameter,
        f"rod.diameter_mm is {_mm(rod.diameter)}, the piston's {_mm(piston.diameter)}",
        "a rod thinner than the piston",
    )
    _require(
        drawing,
        piston.length < body.inner_length,
        f"piston.length_mm is {_mm(piston.length)}, between the caps there are {_mm(body.inner_length)}",
        "a piston shorter than that",
    )
    depth = 0.5 * (piston.diameter - rod.diameter)
    if coil.depth == 0.0:
        coil = replace(coil, depth=SETTINGS.coil_depth_ratio * depth)
        object.__setattr__(drawing, "coil", coil)
    check_ranges(coil, f"{place}: coil")
    _require(
        drawing,
        coil.length <= piston.length,
        f"coil.length_mm is {_mm(coil.length)}, the piston's {_mm(piston.length)}",
        "a coil inside the piston",
    )
    _require(
        drawing,
        coil.depth < depth,
        f"coil.depth_mm is {_mm(coil.depth)}",
        f"less than {_mm(depth)}, which the piston leaves around the rod",
    )


def _check_limits(drawing: DamperDrawing) -> None:
    """Raise InputError if a temperature limit is at or below the ambient temperature."""
    ambient, coil, seals = drawing.surroundings.ambient, drawing.coil, drawing.seals
    held = {
        "fluid": drawing.filling.valid_K[1],
        "coil": coil.limit or INSULATION_DEGC[coil.insulation] + ZERO_CELSIUS_K,
        "seals": seals.limit or SEALS_DEGC[seals.material] + ZERO_CELSIUS_K,
    }
    for name, limit in held.items():
        if not limit > ambient:
            raise InputError(
                place=drawing.name,
                found=f"the {name}'s limit is {to_degC(limit):.4g} degC, ambient {to_degC(ambient):.4g} degC",
                expected="a limit above ambient",
                remedy=f"Check {name}.limit_degC and surroundings.ambient_degC: both are in degC",
            )


def _check_sink(drawing: DamperDrawing, sink: HeatSink) -> None:
    body, closing = drawing.body, drawing.manufacture.closing
    _require(
        drawing,
        sink.span <= body.length * (1.0 + 1e-9),
        f"{sink.fins} fins at pitch_mm {_mm(sink.pitch)} span {_mm(sink.span)} mm, the body's length_mm is "
        f"{_mm(body.length)}",
        "fins that fit on the body",
    )
    if sink.fins == 1:
        return
    _require(
        drawing,
        sink.gap > closing,
        f"the fins' gap of {_mm(sink.gap)} mm is closed by {_mm(closing)} mm of tolerance and dirt",
        "a gap that stays open",
    )
    _require(
        drawing,
        body.orientation == "horizontal" or sink.gap >= DISC_GAP * (1.0 - 1e-9),
        f"the fins of a vertical damper are {_mm(sink.gap)} mm apart",
        f"at least {_mm(DISC_GAP)} because the correlation is that of single discs",
    )


def _require(drawing: DamperDrawing, holds: bool, found: str, expected: str) -> None:  # noqa: FBT001
    if not holds:
        raise InputError(place=drawing.name, found=found, expected=expected)


def _take_means(drawing: DamperDrawing) -> None:
    """Replace heat capacities that depend on temperature by their mean values."""
    if drawing.heat_capacity is None:
        return
    means = {name: part.mean for name, part in drawing.heat_capacity.parts.items()}
    for holder, name in (*((each, each) for each in ("body", "piston", "rod", "coil")), ("sink", "fins")):
        part = getattr(drawing, holder)
        if name in means and part is not None:
            material = replace(part.material, heat_capacity=means[name])
            object.__setattr__(drawing, holder, replace(part, material=material))
    if "fluid" in means:
        object.__setattr__(drawing, "filling", replace(drawing.filling, heat_capacity=means["fluid"]))


def _ring(inner: float, outer: float) -> float:
    """Return the area between two diameters [m^2]."""
    return 0.25 * math.pi * (outer**2 - inner**2)


def _mm(length: float) -> str:
    return f"{1e3 * length:.6g}"
