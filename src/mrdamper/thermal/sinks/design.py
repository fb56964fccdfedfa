"""Search annular-fin heat sinks: Pareto front of low fluid temperature and low mass within given limits.

``search_grid`` evaluates every heat sink of a grid with the zone network and returns the Pareto front. No
heat sink on the front is both heavier and warmer than another. ``confirm`` evaluates designs with finite
elements. Heat sinks outside the range of a correlation are excluded.

All evaluated heat sinks have the emissivity, the contact resistance and the convection multiplier of the heat
sink in the geometry file. A multiplier that was calibrated for wide gaps is also used for narrow gaps. Gaps
wider than twice the fin width are excluded: the heat-transfer coefficient between two fins is invalid there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from mrdamper.errors import EnvelopeError, InputError
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.thermal.drawing import DISC_GAP, DamperDrawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.thermal.materials import Material
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.heat_equation import simulate_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.reduced import reduce_field
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import simulate_network
from mrdamper.thermal.settings import SETTINGS

DesignModel = Literal["network", "finite_element"]

ROUNDING_RATIO = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkLimits:
    """Limits of a heat sink."""

    span: float  # maximum distance between the outer sides of the first and the last fin [m]
    width: float  # maximum radial width of a fin [m]
    mass: float = math.inf  # maximum mass of all fins [kg]
    least_thickness: float = 1e-3  # smallest thickness that can be manufactured [m]
    least_gap: float = 3e-3  # smallest gap that can be manufactured and does not clog [m]
    materials: tuple[Material, ...]  # permitted materials

    def __post_init__(self) -> None:
        for name in ("span", "width", "mass", "least_thickness", "least_gap"):
            if not getattr(self, name) > 0.0:
                raise InputError(
                    place="sink limits",
                    found=f"{name} is {getattr(self, name):g}",
                    expected="a positive number",
                )
        if self.least_thickness > self.span:
            raise InputError(
                place="sink limits",
                found=f"the span is {1e3 * self.span:g} mm, the smallest thickness "
                f"{1e3 * self.least_thickness:g} mm",
                expected="space for at least one fin",
            )

    def fin_count_max(self, thickness: float) -> int:
        """Return the largest number of fins of a given thickness [m] within the span; zero if no fin fits."""
        if thickness > self.span * (1.0 + ROUNDING_RATIO):
            return 0
        return 1 + int((self.span - thickness) * (1.0 + ROUNDING_RATIO) / (thickness + self.least_gap))

    def widest_pitch(self, fins: int, width: float, thickness: float) -> float:
        """Return the largest pitch [m] of two or more fins within the limits of span and gap."""
        return min((self.span - thickness) / (fins - 1), thickness + SETTINGS.fin_gap_max_widths * width)

    def allow(self, sink: HeatSink, body_diameter: float) -> bool:
        """Return True if a heat sink is within all limits; the material is not checked."""
        slack = 1.0 + ROUNDING_RATIO
        return (
            sink.span <= self.span * slack
            and sink.width <= self.width * slack
            and sink.thickness * slack >= self.least_thickness
            and sink.mass(body_diameter) <= self.mass * slack
            and (sink.fins == 1 or self.least_gap <= sink.gap * slack)
            and (sink.fins == 1 or sink.gap <= SETTINGS.fin_gap_max_widths * sink.width * slack)
        )


@dataclass(frozen=True, slots=True)
class SinkDesign:
    """A heat sink (None: the bare damper), and the temperatures after the load cycle."""

    sink: HeatSink | None
    mass: float  # mass of all fins [kg]
    fluid: float  # mean fluid temperature, computed with ``model`` [K]
    coil: float  # mean coil temperature, computed with ``model`` [K]
    network_fluid: float  # mean fluid temperature, computed with the zone network [K]
    model: DesignModel = "network"


@dataclass(frozen=True, slots=True, eq=False)
class HeatedDamper:
    """A damper and its loads, for the evaluation of heat sinks.

    ``pattern`` is a heat sink with the properties that the search does not vary, such as the emissivity.
    """

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
        """Simulate the damper with a heat sink by the zone network; return the design.

        Raises
        ------
        EnvelopeError
            If a correlation or a temperature is outside its valid range.
        InputError
            If the heat sink does not fit on the damper.
        """
        network = zone_network(self.drawing.with_sink(sink))
        heating = simulate_network(network, self.loads, longest_step=SETTINGS.sink_step_max_s)
        fluid, coil = float(heating.fluid[-1]), float(heating.coil[-1])
        return SinkDesign(sink, 0.0 if sink is None else sink.mass(self.diameter), fluid, coil, fluid)


@dataclass(frozen=True, slots=True)
class SinkFront:
    """Pareto front of a search: designs in order of increasing mass and decreasing temperature."""

    designs: tuple[SinkDesign, ...]
    tried: int  # number of heat sinks that were evaluated
    outside: int  # number of heat sinks outside the range of a correlation

    @property
    def best(self) -> SinkDesign:
        """Return the coolest design."""
        return self.designs[-1]


def limits_of(
    drawing: DamperDrawing,
    *,
    span: float | None = None,
    width: float | None = None,
    mass: float | None = None,
    materials: Sequence[Material] = (),
) -> SinkLimits:
    """Return the limits of a search. Lengths are in [m], the mass is in [kg].

    If an argument is None, its limit is the value of the heat sink in the geometry file. If the file has no
    heat sink, span and width are limited to length and radius of the body, and the mass is not limited. The
    smallest gap is increased by tolerance and fouling.
    """
    own, body, made = drawing.sink, drawing.body, drawing.manufacture
    gap = max(made.least_gap, DISC_GAP if body.orientation == "vertical" else 0.0) + made.closing
    if span is None:
        span = own.span if own else body.length
    if not span <= body.length * (1.0 + ROUNDING_RATIO):
        raise InputError(
            place="sink limits",
            found=f"the span is {1e3 * span:g} mm, the body's length {1e3 * body.length:g} mm",
            expected="a span within it",
        )
    return SinkLimits(
        span=span,
        width=width if width is not None else own.width if own else 0.5 * body.outer_diameter,
        mass=mass if mass is not None else own.mass(body.outer_diameter) if own else math.inf,
        least_thickness=made.least_thickness,
        least_gap=gap,
        materials=tuple(materials) or (_pattern_of(drawing).material,),
    )


def _pattern_of(drawing: DamperDrawing) -> HeatSink:
    """Return the heat sink in the geometry file, or a single fin with default properties."""
    return drawing.sink or HeatSink(fins=1, width=0.01, thickness=2e-3, pitch=0.01)


# ---------------------------------------------------------------------------------------------- search


def search_grid(damper: HeatedDamper, limits: SinkLimits, *, on_progress: Progress = silent) -> SinkFront:
    """Return the Pareto front of all heat sinks of a grid within the limits.

    The grid combines all possible numbers of fins, four widths, four thicknesses, two pitches (100 and 60 %
    of the largest pitch), and all permitted materials. A search of 500 heat sinks takes about a second.

    Raises
    ------
    InputError
        If no heat sink of the grid is within the limits.
    EnvelopeError
        If all heat sinks of the grid are outside the range of a correlation.
    """
    sinks = [sink for sink in _grid(damper.pattern, limits) if limits.allow(sink, damper.diameter)]
    if not sinks:
        raise InputError(
            place="sink limits",
            found=f"no sink is within them (span {1e3 * limits.span:g} mm, width {1e3 * limits.width:g} mm, "
            f"mass {1e3 * limits.mass:g} g, thickness from {1e3 * limits.least_thickness:g} mm)",
            remedy="Raise the mass, or lower the smallest thickness in the geometry file's [manufacture]",
        )
    designs: list[SinkDesign] = []
    fault: EnvelopeError | None = None
    for k, sink in enumerate(sinks):
        if k % 50 == 0:
            on_progress(ProgressUpdate(done=k, total=len(sinks), text=f"{sink.fins} fins"))
        try:
            designs.append(damper.evaluate(sink))
        except EnvelopeError as outside:
            fault = outside
    if fault is not None and not designs:
        raise fault
    return SinkFront(front_of(designs), len(sinks), len(sinks) - len(designs))


def _grid(pattern: HeatSink, limits: SinkLimits) -> Iterator[HeatSink]:
    for material in limits.materials:
        for thickness in (ratio * limits.least_thickness for ratio in SETTINGS.fin_thickness_ratios):
            # A single fin needs a valid pitch, although the pitch has no effect.
            plain = replace(
                pattern, fins=1, thickness=thickness, pitch=thickness + limits.least_gap, material=material
            )
            ratios = SETTINGS.sink_width_ratios
            for width in (limits.width if w == 1.0 else _on_grid(w * limits.width) for w in ratios):
                for fins in range(1, limits.fin_count_max(thickness) + 1):
                    for pitch in _pitches(fins, width, thickness, limits):
                        yield replace(plain, fins=fins, width=width, pitch=pitch)


def _pitches(fins: int, width: float, thickness: float, limits: SinkLimits) -> list[float]:
    """Return the fin pitches of the search grid for a number of fins [m]."""
    least = thickness + limits.least_gap
    if fins == 1:
        return [least]
    widest = limits.widest_pitch(fins, width, thickness)
    return sorted({max(_on_grid(ratio * widest), least) for ratio in SETTINGS.sink_span_ratios})


def _on_grid(length: float) -> float:
    step = SETTINGS.sink_grid_m
    return max(round(math.floor(length / step + ROUNDING_RATIO) * step, 9), step)


def front_of(designs: Sequence[SinkDesign]) -> tuple[SinkDesign, ...]:
    """Return the Pareto front of designs: each design is heavier and cooler than the previous one."""
    front: list[SinkDesign] = []
    for design in sorted(designs, key=lambda each: (each.mass, each.fluid)):
        if not front or design.fluid < front[-1].fluid:
            front.append(design)
    return tuple(front)


def thinned(front: Sequence[SinkDesign], most: int) -> tuple[SinkDesign, ...]:
    """Return at most ``most`` designs of a front, about evenly spaced in temperature.

    The first and the last design are always included. ``most`` is at least 2.
    """
    if len(front) <= most:
        return tuple(front)
    fluid = np.array([design.fluid for design in front])
    wanted = np.linspace(fluid[0], fluid[-1], most)
    chosen = sorted({int(np.argmin(np.abs(fluid - at))) for at in wanted})
    return tuple(front[k] for k in chosen)


def lightest_as_cool(front: Sequence[SinkDesign], fluid: float) -> SinkDesign | None:
    """Return the lightest design no warmer than ``fluid`` [K]; None if all are warmer."""
    return next((design for design in front if design.fluid <= fluid), None)


# ---------------------------------------------------------------------------------------- verification


def confirm(
    damper: HeatedDamper, designs: Sequence[SinkDesign], *, on_progress: Progress = silent
) -> tuple[SinkDesign, ...]:
    """Recompute the temperatures of designs by the reduced-order finite-element model."""
    confirmed = []
    for number, design in enumerate(designs):
        on_progress(ProgressUpdate(done=number, total=len(designs), text="finite elements"))
        model = reduce_field(build_field(damper.drawing.with_sink(design.sink)))
        course = simulate_field(model.equation, damper.loads)
        fluid, coil = float(course.fluid[-1]), float(course.coil[-1])
        confirmed.append(replace(design, fluid=fluid, coil=coil, model="finite_element"))
    return tuple(confirmed)
