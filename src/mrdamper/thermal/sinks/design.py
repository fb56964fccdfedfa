"""Search of annular-fin heat sinks: the coolest damper for the least mass, inside an envelope.

``search_grid`` tries every sink of a grid, ``evolution`` searches freely. Both go by the zone network and
return a front: no sink on it is beaten in mass and temperature by another that was tried. ``confirm`` judges
a front again by finite elements. A sink outside its correlation's range is not admissible.

The fins' law, its multiplier and the contact resistance are those of the drawing's own sink: a multiplier
that was calibrated at wide gaps is carried over to narrow ones, which ``gain.spread`` shows. Fins further
apart than twice their width are not tried: the body between two fins cools by the fins' film at whatever
distance, and a search would find two fins at its ends to be a finned body.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np

from mrdamper.errors import ConvergenceError, EnvelopeError, InputError
from mrdamper.runtime.pool import ONE_CORE, Pool, cpu_seconds
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.drawing import DISC_GAP, DamperDrawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import Material
from mrdamper.thermal.model.finite_element import heat_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network, steady_state

DesignModel = Literal["network", "finite_element"]


class Memory(Protocol):
    """Finished pieces of a search by key; what was kept comes back as it was given."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return what was kept under ``key``, or None when that piece is still to be done."""

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        """Keep a finished piece."""


_PIECE = 50  # designs of the grid that are kept together
_LONGEST_STEP = 120.0  # [s]; some 10 mK after half an hour, alike for all sinks
_WIDTHS = (0.4, 0.6, 0.8, 1.0)  # of the greatest
_THICKNESSES = (1.0, 1.5, 2.0, 3.0)  # of the least
_FILLS = (0.6, 1.0)  # of the span
_FINENESS = 1e-4  # pitches and widths of the grid are whole tenths of a millimetre [m]
_WIDEST_GAP = 2.0  # of the fins' width: beyond, the body between two fins is no groove
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkLimits:
    """What a sink must keep to."""

    span: float  # of the body, from the first fin's outer face to the last one's, at most [m]
    width: float  # radial, at most [m]
    mass: float = math.inf  # of all fins, at most [kg]
    least_thickness: float = 1e-3  # that can be made [m]
    least_gap: float = 3e-3  # that can be made, and does not clog [m]
    materials: tuple[Material, ...]
    emissivities: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("span", "width", "least_thickness", "least_gap"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(
                    place="sink limits",
                    found=f"{name} is {1e3 * value:g} mm",
                    expected="a positive, finite number",
                )
        if not self.mass > 0.0:
            raise InputError(
                place="sink limits", found=f"mass is {1e3 * self.mass:g} g", expected="more than zero"
            )
        if not self.materials or not self.emissivities:
            raise InputError(
                place="sink limits", found="no material or no emissivity", expected="at least one of each"
            )
        for value in self.emissivities:
            if not 0.0 <= value <= 1.0:
                raise InputError(place="sink limits", found=f"an emissivity is {value}", expected="0 to 1")
        if self.least_thickness > self.span:
            raise InputError(
                place="sink limits",
                found=(
                    f"the span is {1e3 * self.span:g} mm, the least thickness {1e3 * self.least_thickness:g} "
                    "mm"
                ),
                expected="room for one fin at least",
            )

    def most_fins(self, thickness: float) -> int:
        """Return how many fins of a thickness [m] fit at the least gap; zero when not even one does."""
        if thickness > self.span * (1.0 + _ROUNDING):
            return 0
        return 1 + int((self.span - thickness) * (1.0 + _ROUNDING) / (thickness + self.least_gap))

    def widest_pitch(self, fins: int, width: float, thickness: float) -> float:
        """Return the greatest pitch of two fins or more [m]: within the span, with a gap that is a groove."""
        return min((self.span - thickness) / (fins - 1), thickness + _WIDEST_GAP * width)

    def allow(self, sink: HeatSink, body_diameter: float) -> bool:
        """Whether a sink keeps to all limits but those of material and finish."""
        slack = 1.0 + _ROUNDING
        return (
            sink.span <= self.span * slack
            and sink.width <= self.width * slack
            and sink.thickness * slack >= self.least_thickness
            and (sink.fins == 1 or self.least_gap <= sink.gap * slack <= _WIDEST_GAP * sink.width * slack**2)
            and sink.mass(body_diameter) <= self.mass * slack
        )


@dataclass(frozen=True, slots=True)
class SinkDesign:
    """A sink (None: the bare damper), and the temperatures at the end of the loads."""

    sink: HeatSink | None
    mass: float  # of all fins [kg]
    fluid: float  # mean of the fluid, by ``model`` [K]
    coil: float  # by ``model`` [K]
    network_fluid: float  # by the zone network [K]
    model: DesignModel = "network"
    steady: float | None = None  # what the fluid would settle at, by the zone network [K]; None: not known


@dataclass(frozen=True, slots=True, eq=False)
class HeatedDamper:
    """A damper under loads, to be given heat sinks; what is not searched is kept from ``pattern``."""

    drawing: DamperDrawing
    loads: tuple[Load, ...]
    pattern: HeatSink = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "pattern", _pattern_of(self.drawing))
        object.__setattr__(self, "loads", tuple(self.loads))

    @property
    def diameter(self) -> float:
        """Outer diameter of the body [m]."""
        return self.drawing.body.outer_diameter

    def evaluate(self, sink: HeatSink | None) -> SinkDesign:
        """Return a sink with its temperatures by the zone network.

        Raises
        ------
        EnvelopeError
            A correlation outside its range, or temperatures beyond the tables of losses.
        InputError
            It does not fit on the damper.
        """
        network = zone_network(self.drawing.with_sink(sink))
        heating = simulate_network(network, self.loads, longest_step=_LONGEST_STEP)
        fluid, coil = float(heating.fluid[-1]), float(heating.coil[-1])
        return SinkDesign(sink, 0.0 if sink is None else sink.mass(self.diameter), fluid, coil, fluid)

    def settled(self, design: SinkDesign) -> SinkDesign:
        """Return a design with the temperature that the last load ends in, if there is one."""
        network = zone_network(self.drawing.with_sink(design.sink))
        try:
            steady = float(network.fluid @ steady_state(network, self.loads[-1]))
        except (ConvergenceError, EnvelopeError):  # it never settles, or beyond the tables of losses
            return design
        return replace(design, steady=steady)


@dataclass(frozen=True, slots=True)
class SinkFront:
    """The outcome of a search: sinks by rising mass and falling temperature."""

    designs: tuple[SinkDesign, ...]
    tried: int
    outside: int  # left out, being outside the range of a correlation
    cpu_s: float

    @property
    def best(self) -> SinkDesign:
        """The coolest."""
        return self.designs[-1]


def limits_of(
    drawing: DamperDrawing,
    *,
    span: float | None = None,
    width: float | None = None,
    mass: float | None = None,
    least_thickness: float | None = None,
    least_gap: float | None = None,
    materials: Sequence[Material] = (),
    emissivities: Sequence[float] = (),
) -> SinkLimits:
    """Return limits in [m] and [kg], those that are not given from the drawing: its sink, what can be made.

    Without a sink in the drawing: the body's length, its radius, and any mass. A least gap stays one in use,
    with tolerance and dirt.
    """
    own, body, made = drawing.sink, drawing.body, drawing.manufacture
    gap = made.least_gap if least_gap is None else least_gap
    gap = max(gap, DISC_GAP if body.orientation == "vertical" else 0.0) + made.closing
    pattern = _pattern_of(drawing)
    if span is None:
        span = own.span if own else body.length
    if not span <= body.length * (1.0 + _ROUNDING):
        raise InputError(
            place="sink limits",
            found=f"the span is {1e3 * span:g} mm, the body's length {1e3 * body.length:g} mm",
            expected="a span within it",
        )
    return SinkLimits(
        span=span,
        width=width if width is not None else own.width if own else 0.5 * body.outer_diameter,
        mass=mass if mass is not None else own.mass(body.outer_diameter) if own else math.inf,
        least_thickness=made.least_thickness if least_thickness is None else least_thickness,
        least_gap=gap,
        materials=tuple(materials) or (pattern.material,),
        emissivities=tuple(emissivities) or (pattern.emissivity,),
    )


def _pattern_of(drawing: DamperDrawing) -> HeatSink:
    """Return the drawing's sink; without one a single plain fin, by the law of the body's orientation."""
    upright = drawing.body.orientation == "vertical"
    return drawing.sink or HeatSink(
        fins=1, width=0.01, thickness=2e-3, pitch=0.01, correlation="disc" if upright else "annular"
    )


# ---------------------------------------------------------------------------------------------- search


def search_grid(
    damper: HeatedDamper,
    limits: SinkLimits,
    *,
    on_progress: Progress = silent,
    memory: Memory | None = None,
    pool: Pool = ONE_CORE,
) -> SinkFront:
    """Return the front of every sink of a grid that keeps to the limits.

    All numbers of fins; four widths and thicknesses; the widest pitch or six tenths of it; every material and
    finish. A search of some 500 sinks takes about a second. A ``memory`` recalls and keeps what was tried.

    Raises
    ------
    InputError
        No sink keeps to the limits.
    EnvelopeError
        All that do are outside the range of a correlation.
    """
    clock = cpu_seconds()
    sinks = [sink for sink in _grid(damper.pattern, limits) if limits.allow(sink, damper.diameter)]
    if not sinks:
        raise InputError(
            place="sink limits",
            found=(
                f"no sink keeps to them (span {1e3 * limits.span:g} mm, width {1e3 * limits.width:g} mm, "
                f"mass {1e3 * limits.mass:g} g, thickness from {1e3 * limits.least_thickness:g} mm); raise "
                "the mass or lower the least thickness"
            ),
        )
    found: list[SinkDesign] = []
    for first in range(0, len(sinks), _PIECE):
        piece = sinks[first : first + _PIECE]
        on_progress(ProgressUpdate(done=first, total=len(sinks), text=f"{piece[0].fins} fins"))
        tried = evaluate_all(damper, piece, f"grid {first}", memory, pool)
        found += [design for design in tried if design is not None]
    if not found:
        damper.evaluate(sinks[-1])  # refuses, and says why
    outside = len(sinks) - len(found)
    return SinkFront(front_of(found), len(sinks), outside, cpu_seconds() - clock)


def evaluate_all(
    damper: HeatedDamper,
    sinks: Sequence[HeatSink],
    key: str,
    memory: Memory | None,
    pool: Pool = ONE_CORE,
) -> list[SinkDesign | None]:
    """Return sinks with their temperatures; None for one that is outside the range of a correlation."""

    def known() -> list[list[float] | None] | None:
        found = None if memory is None else memory.recall(key)
        return found["tried"] if found is not None and found["of"] == of else None

    def tried(sink: HeatSink) -> list[float] | None:
        try:
            design = damper.evaluate(sink)
        except EnvelopeError:
            return None
        return [design.fluid, design.coil]

    of = hashlib.sha256(repr(list(sinks)).encode()).hexdigest()[:16]
    rows = known()
    if rows is None:
        rows = list(pool.map(tried, sinks))
        if memory is not None:
            memory.keep(key, {"of": of, "tried": rows})
    return [
        None if row is None else SinkDesign(sink, sink.mass(damper.diameter), row[0], row[1], row[0])
        for sink, row in zip(sinks, rows, strict=True)
    ]


def _grid(pattern: HeatSink, limits: SinkLimits) -> Iterator[HeatSink]:
    for material in limits.materials:
        for emissivity in limits.emissivities:
            for thickness in (share * limits.least_thickness for share in _THICKNESSES):
                plain = replace(
                    pattern,
                    fins=1,
                    thickness=thickness,
                    pitch=thickness + limits.least_gap,  # a single fin has none; anything will do
                    material=material,
                    emissivity=emissivity,
                )
                for width in (limits.width if w == 1.0 else _whole(w * limits.width) for w in _WIDTHS):
                    for fins in range(1, limits.most_fins(thickness) + 1):
                        for pitch in _pitches(fins, width, thickness, limits):
                            yield replace(plain, fins=fins, width=width, pitch=pitch)


def _pitches(fins: int, width: float, thickness: float, limits: SinkLimits) -> list[float]:
    """Return the pitches to try: rounded down, so that the fins fit; the least gap at least."""
    least = thickness + limits.least_gap
    if fins == 1:
        return [least]
    widest = limits.widest_pitch(fins, width, thickness)
    return sorted({max(_whole(fill * widest), least) for fill in _FILLS})


def _whole(length: float) -> float:
    """Return a length rounded down to the grid's fineness [m], never to nothing."""
    return max(round(math.floor(length / _FINENESS + _ROUNDING) * _FINENESS, 9), _FINENESS)


def front_of(designs: Sequence[SinkDesign]) -> tuple[SinkDesign, ...]:
    """Return the designs that no other beats: each is heavier and cooler than the one before."""
    front: list[SinkDesign] = []
    for design in sorted(designs, key=lambda each: (each.mass, each.fluid)):
        if not front or design.fluid < front[-1].fluid:
            front.append(design)
    return tuple(front)


def thinned(front: Sequence[SinkDesign], most: int) -> tuple[SinkDesign, ...]:
    """Return at most so many members of a front, both ends among them, evenly spaced in temperature."""
    if most < 2:
        raise InputError(found=f"front: {most} members are asked for", expected="2 or more")
    if len(front) <= most:
        return tuple(front)
    fluid = np.array([design.fluid for design in front])
    wanted = np.linspace(fluid[0], fluid[-1], most)
    chosen = sorted({int(np.argmin(np.abs(fluid - at))) for at in wanted})
    return tuple(front[k] for k in chosen)


def lightest_as_cool(front: Sequence[SinkDesign], fluid: float) -> SinkDesign | None:
    """Return the lightest member whose fluid is no warmer than a temperature [K]; None when none is."""
    return next((design for design in front if design.fluid <= fluid), None)


# ---------------------------------------------------------------------------------------------- judging


def confirm(
    damper: HeatedDamper,
    designs: Sequence[SinkDesign],
    *,
    on_progress: Progress = silent,
    memory: Memory | None = None,
    pool: Pool = ONE_CORE,
) -> tuple[SinkDesign, ...]:
    """Return designs with their temperatures by finite elements; a ``memory`` recalls and keeps them."""

    def judged(design: SinkDesign) -> dict[str, float]:
        _, course = heat_field(damper.drawing.with_sink(design.sink), damper.loads)
        return {"fluid": float(course.fluid[-1]), "coil": float(course.coil[-1])}

    keys = [f"finite elements {hashlib.sha256(repr(d.sink).encode()).hexdigest()[:16]}" for d in designs]
    kept = [None if memory is None else memory.recall(key) for key in keys]
    fresh = pool.map(judged, [d for d, known in zip(designs, kept, strict=True) if known is None])
    found = []
    for number, (design, key, before) in enumerate(zip(designs, keys, kept, strict=True)):
        on_progress(ProgressUpdate(done=number, total=len(designs), text="finite elements"))
        known = next(fresh) if before is None else before
        if before is None and memory is not None:
            memory.keep(key, known)
        found.append(replace(design, fluid=known["fluid"], coil=known["coil"], model="finite_element"))
    return tuple(found)
