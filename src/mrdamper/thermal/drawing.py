"""A damper's drawing: the lengths, materials, fluid, coil, mounting and surroundings that heat depends on.

Written by people as TOML in millimetres and degC (docs/thermal.md), held in metres and kelvin. The drawing
is axisymmetric: a tube with a flat cap at each end, a piston in the middle of the bore with a coil wound into
its face, a rod, and annular fins about the middle of the body. How heat moves in it is the business of
``network`` and ``finite_element``, film coefficients are ``surfaces``'.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal

from mrdamper.errors import InputError
from mrdamper.models.fluids.fluid import Fluid
from mrdamper.models.fluids.fluid_file import find_fluid
from mrdamper.quantities import to_degC
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import COPPER_PER_K, MATERIALS, Material

__all__ = [
    "DISC_GAP",
    "Body",
    "Calibration",
    "Coil",
    "DamperDrawing",
    "Filling",
    "Piston",
    "Rod",
    "Surroundings",
    "read_drawing",
    "read_sink",
]

Orientation = Literal["horizontal", "vertical"]

_STEEL = MATERIALS["steel"]
_CARRIER_CONDUCTIVITY = 0.14  # of the oil, for fluids that state none [W/(m K)]
DISC_GAP = 0.010
"""Gap between the fins of a vertical damper [m], below which they feel their neighbours."""


@dataclass(frozen=True, slots=True)
class Body:
    """The tube and its two caps."""

    outer_diameter: float  # [m]
    length: float  # over the caps [m]
    wall: float  # of the tube [m]
    cap: float  # thickness of each cap [m]
    material: Material = _STEEL
    orientation: Orientation = "horizontal"

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
    """The piston, drawn in the middle of the bore (its mean position)."""

    diameter: float  # [m]
    length: float  # [m]
    material: Material = _STEEL


@dataclass(frozen=True, slots=True)
class Rod:
    """The rod; ``through`` says that it leaves the body at both ends."""

    diameter: float  # [m]
    through: bool = True
    material: Material = _STEEL


@dataclass(frozen=True, slots=True)
class Coil:
    """The winding: a ring in the piston's face, in its middle."""

    resistance: float  # at 20 degC [ohm]
    length: float  # axial [m]
    depth: float  # radial, inwards from the piston's face [m]
    amperes_per_volt: float | None = None  # for cards whose command is a voltage
    material: Material = MATERIALS["winding"]

    def resistance_at(self, temperature_K: float) -> float:
        """Return the resistance [ohm] at a temperature [K]."""
        return self.resistance * (1.0 + COPPER_PER_K * (temperature_K - 293.15))


@dataclass(frozen=True, slots=True)
class Filling:
    """The fluid in the body, as heat sees it."""

    name: str
    density: float  # [kg/m^3]
    heat_capacity: float  # [J/(kg K)]
    conductivity: float  # at rest [W/(m K)]
    valid_K: tuple[float, float]
    stirring: float = 10.0  # effective over own conductivity, across the chambers
    exchange: float = 20.0  # heat that pumping carries between the gap and each chamber [W/K]

    @property
    def volumetric_heat(self) -> float:
        """Heat capacity of a cubic metre [J/(m^3 K)]."""
        return self.density * self.heat_capacity

    @property
    def effective_conductivity(self) -> float:
        """Conductivity of the stirred fluid across the chambers and the gap [W/(m K)]."""
        return self.stirring * self.conductivity


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Where the damper hangs."""

    ambient: float = 293.15  # [K]
    air_speed: float = 0.0  # across the axis [m/s]
    emissivity: float = 0.3  # of the bare body
    mount: float = 0.0  # conductance into the mountings at ambient, both ends together [W/K]


@dataclass(frozen=True, slots=True)
class Calibration:
    """Multipliers that a measured curve or the finite elements gave; 1 is the drawing as it stands.

    ``heat_capacity`` and ``film`` are of the damper itself, and every model uses them. The others mend the
    network's few nodes and leave the finite elements alone.
    """

    heat_capacity: float = 1.0  # of everything but the fins
    film: float = 1.0  # convection of the bare body
    fluid_wall: float = 1.0
    fluid_core: float = 1.0
    wall_axial: float = 1.0
    core_axial: float = 1.0
    coil: float = 1.0
    fin_root: float = 1.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"calibration: {each.name} is {value}; expected a positive, finite number")


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperDrawing:
    """A damper as heat sees it, checked when built: everything fits into everything else."""

    name: str = "drawing"
    body: Body
    piston: Piston
    rod: Rod
    coil: Coil
    filling: Filling
    surroundings: Surroundings = field(default_factory=Surroundings)
    sink: HeatSink | None = None
    calibration: Calibration = field(default_factory=Calibration)
    text: str = field(default="", repr=False, compare=False)  # of the file that it was read from

    def __post_init__(self) -> None:
        _check_body(self)
        _check_inside(self)
        _check_surroundings(self)
        if self.sink is not None:
            _check_sink(self, self.sink)

    def with_sink(self, sink: HeatSink | None) -> DamperDrawing:
        """Return the same damper with another heat sink, or none."""
        return replace(self, sink=sink)

    @property
    def gap(self) -> float:
        """Annular gap between piston and bore [m]."""
        return 0.5 * (self.body.bore - self.piston.diameter)

    @property
    def chamber_length(self) -> float:
        """Length of each chamber, between piston and cap [m]."""
        return 0.5 * (self.body.inner_length - self.piston.length)

    @property
    def exchange_conductivity(self) -> float:
        """Axial conductivity times area of the fluid [W m/K] that carries ``filling.exchange``.

        Between the middles of gap and chamber; over the local annulus' area it is an effective axial
        conductivity.
        """
        return 0.5 * self.filling.exchange * (self.piston.length + self.chamber_length)

    @classmethod
    def from_toml(cls, text: str, place: str = "drawing") -> DamperDrawing:
        """Return the drawing that a TOML text holds; ``place`` stands in messages."""
        from mrdamper.thermal.drawing_file import drawing_of  # which builds on this module

        return drawing_of(text, place)


def read_drawing(path: str | Path) -> DamperDrawing:
    """Return the drawing in a TOML file, or the preset ``paper``.

    Raises
    ------
    InputError
        No such file, or a drawing that cannot be; with the place, what is expected and the remedy.
    """
    from mrdamper.thermal.drawing_file import drawing_of, text_of

    return drawing_of(text_of(path), Path(path).name)


def read_sink(path: str | Path) -> HeatSink:
    """Return the heat sink in a TOML file with a table [sink] (a drawing's will do)."""
    from mrdamper.thermal.drawing_file import sink_of, text_of

    return sink_of(text_of(path), Path(path).name)


def filling_of(fluid: Fluid, **given: float) -> Filling:
    """Return the filling that a fluid of ``models.fluid`` makes; ``given`` overrides its properties.

    A fluid that states no conductivity is taken for well-conducting spheres in an oil of 0.14 W/(m K), by
    Maxwell's formula.
    """
    share = fluid.particle_fraction
    stated: dict[str, float | None] = {
        "density": fluid.density_kg_m3,
        "heat_capacity": fluid.heat_capacity_J_kg_K,
        "conductivity": fluid.conductivity_W_m_K
        or _CARRIER_CONDUCTIVITY * (1.0 + 2.0 * share) / (1.0 - share),
    }
    known = {**stated, **given}
    for name, unit in (("density", "kg_m3"), ("heat_capacity", "J_kg_K")):
        if known[name] is None:
            raise InputError(
                f"fluid {fluid.name!r}: it states no {name}; give [fluid] {name}_{unit} in the drawing"
            )
    return Filling(
        name=fluid.name,
        valid_K=fluid.valid_K,
        **{name: float(value) for name, value in known.items() if value is not None},
    )


def find_filling(preset: str, **given: float) -> Filling:
    """Return the filling of a fluid preset, or of a fluid's TOML file."""
    return filling_of(find_fluid(preset), **given)


# ------------------------------------------------------------------------------------------------- checks


def _check_body(drawing: DamperDrawing) -> None:
    body, place = drawing.body, drawing.name
    _lengths(place, "body", body, ("outer_diameter", "length", "wall", "cap"))
    if not body.wall < 0.5 * body.outer_diameter:
        raise InputError(
            f"{place}: body.wall_mm is {_mm(body.wall)}, the outer radius {_mm(0.5 * body.outer_diameter)}; "
            "expected a wall thinner than the radius. Check outer_diameter_mm: is it the diameter?"
        )
    if not body.inner_length > 0.0:
        raise InputError(
            f"{place}: body.cap_mm is {_mm(body.cap)}, length_mm {_mm(body.length)}; expected caps that "
            "leave room between them"
        )
    if body.orientation not in ("horizontal", "vertical"):
        raise InputError(
            f"{place}: body.orientation is {body.orientation!r}; use one of: horizontal, vertical"
        )


def _check_inside(drawing: DamperDrawing) -> None:
    body, piston, rod, coil, place = drawing.body, drawing.piston, drawing.rod, drawing.coil, drawing.name
    _lengths(place, "piston", piston, ("diameter", "length"))
    _lengths(place, "rod", rod, ("diameter",))
    if not piston.diameter < body.bore:
        hint = ""
        if piston.diameter < 2.0 * body.outer_diameter - 2.0 * body.wall:
            hint = (
                f". Is {_mm(body.outer_diameter)} mm the body's radius? Then outer_diameter_mm is "
                f"{_mm(2.0 * body.outer_diameter)}"
            )
        raise InputError(
            f"{place}: piston.diameter_mm is {_mm(piston.diameter)}, the bore {_mm(body.bore)} "
            f"(outer_diameter_mm less two walls); expected a piston narrower than the bore{hint}"
        )
    if not rod.diameter < piston.diameter:
        raise InputError(
            f"{place}: rod.diameter_mm is {_mm(rod.diameter)}, the piston's {_mm(piston.diameter)}; expected "
            "a rod thinner than the piston"
        )
    if not piston.length < body.inner_length:
        raise InputError(
            f"{place}: piston.length_mm is {_mm(piston.length)}, between the caps there are "
            f"{_mm(body.inner_length)}; expected a piston shorter than that"
        )
    _lengths(place, "coil", coil, ("length", "depth"))
    if not coil.length <= piston.length:
        raise InputError(
            f"{place}: coil.length_mm is {_mm(coil.length)}, the piston's {_mm(piston.length)}; expected a "
            "coil inside the piston"
        )
    if not coil.depth < 0.5 * (piston.diameter - rod.diameter):
        raise InputError(
            f"{place}: coil.depth_mm is {_mm(coil.depth)}; expected less than "
            f"{_mm(0.5 * (piston.diameter - rod.diameter))}, what the piston leaves around the rod"
        )
    if not (math.isfinite(coil.resistance) and coil.resistance >= 0.0):
        raise InputError(f"{place}: coil.resistance_ohm is {coil.resistance}; expected zero or more, finite")
    if coil.amperes_per_volt is not None and not 0.0 < coil.amperes_per_volt < math.inf:
        raise InputError(f"{place}: coil.A_per_V is {coil.amperes_per_volt}; expected a positive number")
    _lengths(
        place, "fluid", drawing.filling, ("density", "heat_capacity", "conductivity", "stirring"), unit=""
    )
    if not 0.0 <= drawing.filling.exchange < math.inf:
        raise InputError(f"{place}: fluid.exchange_W_K is {drawing.filling.exchange}; expected zero or more")


def _check_surroundings(drawing: DamperDrawing) -> None:
    around, place = drawing.surroundings, f"{drawing.name}: surroundings"
    if not 223.15 <= around.ambient <= 373.15:
        raise InputError(
            f"{place}.ambient_degC is {to_degC(around.ambient):g}; expected -50 to 100 (air around a damper, "
            "in degrees Celsius)"
        )
    if not 0.0 <= around.air_speed <= 50.0:
        raise InputError(f"{place}.air_m_s is {around.air_speed}; expected 0 to 50 m/s")
    if not 0.0 <= around.emissivity <= 1.0:
        raise InputError(f"{place}.emissivity is {around.emissivity}; expected 0 to 1")
    if not 0.0 <= around.mount < math.inf:
        raise InputError(f"{place}.mount_W_K is {around.mount}; expected zero or more, finite")


def _check_sink(drawing: DamperDrawing, sink: HeatSink) -> None:
    place, body = drawing.name, drawing.body
    if sink.span > body.length * (1.0 + 1e-9):
        raise InputError(
            f"{place}: {sink.fins} fins at pitch_mm {_mm(sink.pitch)} span {_mm(sink.span)} mm, the body's "
            f"length_mm is {_mm(body.length)}; expected fins that fit on the body. Take fewer fins or a "
            "smaller pitch"
        )
    upright = body.orientation == "vertical"
    if upright != (sink.correlation == "disc"):
        use = '"disc"' if upright else '"channel" or "vdi"'
        raise InputError(
            f"{place}: sink.correlation is {sink.correlation!r} on a {body.orientation} body; expected "
            f"{use}: the fins of a vertical damper lie flat"
        )
    if upright and sink.fins > 1 and sink.gap < DISC_GAP * (1.0 - 1e-9):
        raise InputError(
            f"{place}: the fins of a vertical damper are {_mm(sink.gap)} mm apart; expected at least "
            f"{_mm(DISC_GAP)}: the correlation for single discs knows no neighbours. Widen the pitch"
        )


def _lengths(place: str, table: str, part: object, names: tuple[str, ...], *, unit: str = "_mm") -> None:
    for name in names:
        value = getattr(part, name)
        if not (math.isfinite(value) and value > 0.0):
            said = _mm(value) if unit else f"{value:g}"
            raise InputError(f"{place}: {table}.{name}{unit} is {said}; expected a positive, finite number")


def _mm(length: float) -> str:
    return f"{1e3 * length:.6g}"
