"""Temperature rise: card, drawing and duty give temperatures, fade of force, heat paths and energy account.

The mechanical power is that of the card's own loop at the running temperature (``dissipation``); the coil's
heat follows its resistance. The thermal model distributes both (``reduced``, ``network``, ``lumped``). A card
without temperature model keeps its force constant, and the result states that. Limits are judged at the
hottest point of each part. The curve stops where the fluid's mean reaches its limit because the force is
known up to there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.thermal.dissipation import LoopWork, tabulate_work
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty, stroke_of
from mrdamper.thermal.limits import LimitReached, first_time, limits_of
from mrdamper.thermal.model.finite_element import build_field
from mrdamper.thermal.model.heat_equation import FieldHeating, simulate_field
from mrdamper.thermal.model.lumped import lumped_network
from mrdamper.thermal.model.network import ThermalNetwork, zone_network
from mrdamper.thermal.model.reduced import ReducedModel, reduce_field
from mrdamper.thermal.model.stepping import Load, Part
from mrdamper.thermal.model.surfaces import name_correlations
from mrdamper.thermal.model.transient import Heating, simulate_network

Model = Literal["reduced", "network", "lumped"]
"""Reduced finite elements, three axial zones, or one node (the paper's Eq. (8))."""

_HIGHEST_PA = 50e6  # of a force on its piston; above it card and drawing are of two dampers


@dataclass(frozen=True, slots=True, eq=False)
class Rise:
    """What a duty does to a damper; arrays over the ends of the steps taken, shape (k,)."""

    time: FloatArray  # [s]
    fluid: FloatArray  # mean of the fluid [K]
    coil: FloatArray  # [K]
    wall: FloatArray  # mean of the wall [K]
    mechanical_W: FloatArray  # power from the motion
    coil_W: FloatArray
    paths_W: Mapping[str, FloatArray]  # heat given off, by path
    energy_J: Mapping[str, float]  # at the end: in, out, stored, and each path
    energy_closure: float  # largest miss of the account over the energy [-]
    peak_force_N: FloatArray  # of the cycle; NaN at rest
    force_loss_percent: (
        float | None
    )  # of the peak force at the end, against 20 degC; None: at rest, or not known
    hot: Mapping[Part, FloatArray]  # hottest point of gap, coil and seals [K]; by a network its node's mean
    limits: tuple[LimitReached, ...]  # of fluid, coil and seals
    model: Model
    correlations: Mapping[str, str]  # by surface
    notes: tuple[str, ...]
    heating: Heating | FieldHeating
    field: ReducedModel | None  # with which the unknowns give temperatures everywhere

    @property
    def limit_K(self) -> float:
        """What the fluid's hottest point may reach."""
        return self.limits[0].limit.kelvin

    @property
    def first_limit(self) -> LimitReached:
        """The limit that is reached first, else the one that its part comes nearest to."""
        return min(
            self.limits,
            key=lambda each: (
                math.inf if each.time_s is None else each.time_s,
                each.limit.kelvin - each.hottest,
            ),
        )

    @property
    def time_to_limit_s(self) -> float | None:
        """When the fluid's hottest point does; None: not reached."""
        return self.limits[0].time_s

    @property
    def fluid_degC(self) -> FloatArray:
        return self.fluid - ZERO_CELSIUS_K

    @property
    def coil_degC(self) -> FloatArray:
        return self.coil - ZERO_CELSIUS_K

    @property
    def wall_degC(self) -> FloatArray:
        return self.wall - ZERO_CELSIUS_K

    def fluid_at(self, time_s: float) -> float:
        """Return the fluid's mean temperature at a time [K], between steps by monotone cubics.

        Raises
        ------
        InputError
            The curve does not reach that time.
        """
        if not 0.0 <= time_s <= self.time[-1] * (1.0 + 1e-12):
            raise InputError(
                place="rise", found=f"no temperature at {time_s:g} s; the curve ends at {self.time[-1]:g} s"
            )
        return float(PchipInterpolator(self.time, self.fluid)(min(time_s, self.time[-1])))


def simulate_rise(
    works: Sequence[LoopWork],
    drawing: DamperDrawing,
    duty: Duty,
    *,
    model: Model = "reduced",
    start_K: float | None = None,
    stop_at_limit: bool = True,
    longest_step: float = 60.0,
) -> Rise:
    """Return how a damper heats under a duty.

    Parameters
    ----------
    works : of the card's loop (``works_of``), one for each segment of the duty
    model : ``reduced`` (22 unknowns of the finite elements), ``network`` (three axial zones, no hot spots) or
        ``lumped`` (the paper's Eq. (8))
    start_K : temperature of everything at the start; None: ambient
    stop_at_limit : end the curve where the fluid's mean reaches its limit; else go on, and note when it did
    longest_step : of time [s]
    """
    drawing = replace(drawing, stroke=stroke_of(duty))
    limit = drawing.filling.valid_K[1]
    loads = loads_of(works, drawing, duty)
    field, simulate = _simulator(drawing, model, loads, start_K, longest_step)
    heating = simulate(limit)
    reached = float(heating.time[-1]) if heating.stopped else None
    if heating.stopped and not stop_at_limit:
        heating = simulate(math.inf)
    notes: tuple[str, ...] = ()
    if reached is not None:
        does = "the curve ends there" if stop_at_limit else "the curve goes on, outside what the fluid is for"
        notes = (
            f"the fluid's mean reaches its limit, {limit - ZERO_CELSIUS_K:.4g} degC, after {reached:.0f} s; "
            f"{does}",
        )
    peak, loss = _fade(works, duty, heating.fluid, heating.time)
    hot = {each.part: heating.hottest(each.part) for each in limits_of(drawing)}
    return Rise(
        time=heating.time,
        fluid=heating.fluid,
        coil=heating.coil,
        wall=heating.wall,
        mechanical_W=heating.mechanical_W,
        coil_W=heating.coil_W,
        paths_W=heating.paths_W,
        energy_J=heating.energy_J,
        energy_closure=heating.closure,
        peak_force_N=peak,
        force_loss_percent=loss,
        hot=MappingProxyType(hot),
        limits=tuple(
            LimitReached(
                each, float(hot[each.part].max()), first_time(heating.time, hot[each.part], each.kelvin)
            )
            for each in limits_of(drawing)
        ),
        model=model,
        correlations=name_correlations(drawing),
        notes=notes,
        heating=heating,
        field=field,
    )


def _simulator(
    drawing: DamperDrawing, model: Model, loads: Sequence[Load], start_K: float | None, longest_step: float
) -> tuple[ReducedModel | None, Callable[[float], Heating | FieldHeating]]:
    """Return the reduced model (None for networks) and its simulation up to a fluid temperature [K]."""
    if model == "reduced":
        reduced = reduce_field(build_field(drawing))
        return reduced, lambda stop_at: simulate_field(
            reduced.equation, loads, start=start_K, longest_step=longest_step, stop_at=stop_at
        )
    network = build_network(drawing, model)
    return None, lambda stop_at: simulate_network(
        network, loads, start=start_K, longest_step=longest_step, stop_at=stop_at
    )


def works_of(damper: Damper, duty: Duty) -> list[LoopWork]:
    """Return the work of a damper on each segment of a duty.

    Raises
    ------
    InputError
        The duty's command is in another unit than the damper's.
    """
    if duty.command_unit != damper.command_unit:
        raise InputError(
            place=f"duty {duty.text!r}",
            found=f"its command is in {duty.command_unit}, the card's in {damper.command_unit}",
            expected=f"the same unit, as in sine:15mm:1Hz:2{damper.command_unit}:1800s",
        )
    known: dict[tuple[int, float], LoopWork] = {}  # pieces of a segment share its path
    try:
        for segment in duty.segments:
            if (id(segment.path), segment.command) not in known:
                known[id(segment.path), segment.command] = tabulate_work(damper, segment)
        return [known[id(segment.path), segment.command] for segment in duty.segments]
    except InputError as fault:
        raise InputError(
            place=f"duty {duty.text!r}",
            found=f"the card's law cannot be run there: {fault}",
            remedy="Keep to commands that the card was identified at",
        ) from fault


def loads_of(works: Sequence[LoopWork], drawing: DamperDrawing, duty: Duty) -> list[Load]:
    """Return what heats a damper, segment by segment: the work of its loop and its coil's heat.

    Raises
    ------
    InputError
        Forces that no piston of this size gives, a command in volts without ``coil.A_per_V``.
    """
    force = max(float(work.peak.max()) for work in works)
    pressure = force / drawing.piston_area
    if pressure > _HIGHEST_PA:
        raise InputError(
            place=drawing.name,
            found=f"the card's force of {force:.4g} N is a pressure of {1e-6 * pressure:.4g} MPa on the "
            f"piston's ring of {1e6 * drawing.piston_area:.4g} mm^2",
            expected=f"at most {1e-6 * _HIGHEST_PA:g} MPa",
            remedy="Name the drawing of the card's own damper; check its millimetres, and the card's newtons",
        )
    return [
        Load(segment.duration, work.power_at, _coil_heat(drawing, duty.command_unit, segment.command))
        for segment, work in zip(duty.segments, works, strict=True)
    ]


def build_network(drawing: DamperDrawing, model: Model = "network") -> ThermalNetwork:
    """Return the network of a drawing; the zones stand for the reduced finite elements where needed."""
    return lumped_network(drawing) if model == "lumped" else zone_network(drawing)


def _coil_heat(drawing: DamperDrawing, unit: str, command: float) -> float:
    """Return the coil's heat at 20 degC [W] for a command's root mean square."""
    coil = drawing.coil
    if unit == "A" or command == 0.0 or coil.resistance == 0.0:
        return command**2 * coil.resistance
    if coil.amperes_per_volt is None:
        raise InputError(
            place=drawing.name,
            found="the card's command is a voltage, and the coil's heat goes by its current",
            expected="coil.A_per_V, the amperes that the driver sends per volt of command",
        )
    return (command * coil.amperes_per_volt) ** 2 * coil.resistance


def _fade(
    works: Sequence[LoopWork], duty: Duty, fluid: FloatArray, time: FloatArray
) -> tuple[FloatArray, float | None]:
    """Return the peak force over time [N], and its fall at the end against 20 degC [%]."""
    ends = np.cumsum([segment.duration for segment in duty.segments])
    which = np.minimum(np.searchsorted(ends - 1e-9, time), len(works) - 1)
    peak = np.full(len(fluid), np.nan)
    for k, (work, segment) in enumerate(zip(works, duty.segments, strict=True)):
        here = which == k
        if segment.path is not None and here.any():
            peak[here] = work.peak_at(fluid[here])
    moving = np.flatnonzero(np.isfinite(peak))
    if not moving.size:
        return peak, None
    last = works[which[moving[-1]]]
    if np.ptp(last.peak) == 0.0:  # the card does not know temperature
        return peak, None
    cold = float(last.peak_at(REFERENCE_K))
    return peak, 100.0 * (1.0 - float(peak[moving[-1]]) / cold) if cold > 0.0 else None


def notes_of(card: ModelCard | Damper, duty: Duty) -> tuple[str, ...]:
    """Say what a reader of a rise should know about the card."""
    damper = card.damper if isinstance(card, ModelCard) else card
    notes = []
    if not damper.temperature_dependent:
        notes.append("the card does not depend on temperature: its force is held constant")
    elif damper.assumed:
        notes.append(
            f"the temperature laws of {', '.join(damper.assumed)} are assumed from a fluid, not identified"
        )
    if isinstance(card, ModelCard):
        notes += beyond_card(card, duty).values()
    return tuple(notes)


def beyond_card(card: ModelCard, duty: Duty) -> dict[str, str]:
    """Return a sentence for each quantity of the load cycle that leaves the range of the card's runs."""
    found = {}
    paths = [segment.path for segment in duty.segments if segment.path is not None]
    for name, unit, scale in (("displacement", "mm", 1e3), ("velocity", "mm/s", 1e3), ("command", "", 1.0)):
        low, high = getattr(card.envelope, name)
        values = [getattr(path, name) for path in paths]
        if not values:
            continue
        least, most = min(float(v.min()) for v in values), max(float(v.max()) for v in values)
        room = 1e-3 * max(high - low, abs(high))
        if least < low - room or most > high + room:
            shown = unit or duty.command_unit
            found[name] = (
                f"the duty's {name} runs from {scale * least:.4g} to {scale * most:.4g} {shown}; "
                f"the card was identified from {scale * low:.4g} to {scale * high:.4g} {shown}"
            )
    return found
