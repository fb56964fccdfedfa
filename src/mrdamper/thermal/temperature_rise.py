"""Simulate the temperature rise of a damper in a load cycle.

The inputs are the damper model of a model card and the geometry of the damper. The result contains
temperatures, loss of force, heat flows, and the energy balance. The mechanical power follows from simulated
force loops and depends on the fluid temperature (``dissipation``). The coil heat increases with the coil
resistance. Mechanical power and coil heat are the sources of a thermal model (``reduced``, ``network`` or
``lumped``). If the damper model ignores temperature, the force is constant and a note reports this.
Temperature limits apply to the hottest point of each part. The simulation stops when the mean fluid
temperature reaches its limit, because the force is unknown at higher temperatures.
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
from mrdamper.thermal.settings import SETTINGS

Model = Literal["reduced", "network", "lumped"]
"""Thermal model: reduced-order finite elements, three axial zones, or one node (reference paper, Eq. (8))."""


@dataclass(frozen=True, slots=True, eq=False)
class Rise:
    """Temperatures and heat flows of a damper in a load cycle, at each time step, shape (k,)."""

    time: FloatArray  # [s]
    fluid: FloatArray  # mean fluid temperature [K]
    coil: FloatArray  # mean coil temperature [K]
    wall: FloatArray  # mean temperature of tube and caps [K]
    mechanical_W: FloatArray  # mechanical power that heats the fluid
    coil_W: FloatArray  # heat of the coil
    paths_W: Mapping[str, FloatArray]  # heat loss of each path
    energy_J: Mapping[str, float]  # energies by name: see ``EnergyAccount.energy_J``
    energy_closure: float  # largest error of the energy balance, divided by the largest energy [-]
    peak_force_N: FloatArray  # peak force of a cycle; NaN at rest
    # Peak force after the load cycle is lower than at 20 degC by this percentage; None: at rest, or unknown.
    force_loss_percent: float | None
    hot: Mapping[Part, FloatArray]  # hottest point of gap, coil and seals [K]; in a network, mean of a node
    limits: tuple[LimitReached, ...]  # temperature limits of fluid, coil and seals
    model: Model
    correlations: Mapping[str, str]  # names of the heat-transfer correlations by surface
    notes: tuple[str, ...]
    heating: Heating | FieldHeating  # complete result of the thermal model
    field: ReducedModel | None  # ``field.field`` returns temperatures in the section; None for a network

    @property
    def input_J(self) -> float:
        """Return the total energy from motion and coil."""
        return self.energy_J["mechanical"] + self.energy_J["coil"]

    @property
    def limit_K(self) -> float:
        """Return the temperature limit of the hottest point of the fluid."""
        return self.limits[0].limit.kelvin

    @property
    def first_limit(self) -> LimitReached:
        """Return the limit that is reached first; if none is reached, the closest limit."""
        return min(
            self.limits,
            key=lambda each: (
                math.inf if each.time_s is None else each.time_s,
                each.limit.kelvin - each.hottest,
            ),
        )

    @property
    def time_to_limit_s(self) -> float | None:
        """Return the time at which the hottest point of the fluid reaches its limit; None: not reached."""
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
        """Return the mean fluid temperature at a time [K], by PCHIP interpolation.

        Raises
        ------
        InputError
            If the simulation stopped before this time.
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
    """Simulate the heating of a damper in a load cycle.

    Parameters
    ----------
    works : mean power and peak force versus temperature (``works_of``), for each segment of the load cycle
    model : ``reduced`` (reduced-order finite-element model with 22 unknowns), ``network`` (three axial zones,
            no hot spots), ``lumped`` (Eq. (8) of the reference paper)
    start_K : uniform initial temperature; None: ambient
    stop_at_limit : True: stop the simulation when the mean fluid temperature reaches its limit; False:
            continue, and report the limit in a note
    longest_step : maximum time step [s]
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
        does = "the curve ends there" if stop_at_limit else "later values are outside the range of the fluid"
        notes = (
            f"the mean fluid temperature reaches its limit, {limit - ZERO_CELSIUS_K:.4g} degC, after "
            f"{reached:.0f} s; {does}",
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
    """Return the reduced model (None for networks), and a function that simulates the heating.

    The argument of the function is the mean fluid temperature [K] at which the simulation stops.
    """
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
    """Tabulate mean power and peak force of a damper for each segment of a load cycle.

    Raises
    ------
    InputError
        If the units of load cycle and damper differ.
    """
    if duty.command_unit != damper.command_unit:
        raise InputError(
            place=f"duty {duty.text!r}",
            found=f"its command is in {duty.command_unit}, the card's in {damper.command_unit}",
            expected=f"the same unit, as in sine:15mm:1Hz:2{damper.command_unit}:1800s",
        )
    known: dict[tuple[int, float], LoopWork] = {}  # cache, because several segments can have the same path
    try:
        for segment in duty.segments:
            if (id(segment.path), segment.command) not in known:
                known[id(segment.path), segment.command] = tabulate_work(damper, segment)
        return [known[id(segment.path), segment.command] for segment in duty.segments]
    except InputError as fault:
        raise InputError(
            place=f"duty {duty.text!r}",
            found=f"the law of the card cannot be simulated there: {fault}",
            remedy="Use commands within the range of the card's runs",
        ) from fault


def loads_of(works: Sequence[LoopWork], drawing: DamperDrawing, duty: Duty) -> list[Load]:
    """Return the load (mechanical power and coil heat) of a damper for each segment of a load cycle.

    Raises
    ------
    InputError
        If the force is too large for the piston, or a command in volts lacks ``coil.A_per_V``.
    """
    force = max(float(work.peak.max()) for work in works)
    pressure = force / drawing.piston_area
    if pressure > SETTINGS.piston_pressure_max_Pa:
        raise InputError(
            place=drawing.name,
            found=f"the card's force of {force:.4g} N is a pressure of {1e-6 * pressure:.4g} MPa on the "
            f"piston's ring of {1e6 * drawing.piston_area:.4g} mm^2",
            expected=f"at most {1e-6 * SETTINGS.piston_pressure_max_Pa:g} MPa",
            remedy="Use the geometry file of this damper; check its millimetres, and the newtons of the card",
        )
    return [
        Load(segment.duration, work.power_at, _coil_heat(drawing, duty.command_unit, segment.command))
        for segment, work in zip(duty.segments, works, strict=True)
    ]


def build_network(drawing: DamperDrawing, model: Model = "network") -> ThermalNetwork:
    """Return the lumped network for ``lumped``, otherwise the zone network of a geometry."""
    return lumped_network(drawing) if model == "lumped" else zone_network(drawing)


def _coil_heat(drawing: DamperDrawing, unit: str, command: float) -> float:
    """Return the coil heat at 20 degC [W] for the root mean square of a command."""
    coil = drawing.coil
    if unit == "A" or command == 0.0 or coil.resistance == 0.0:
        return command**2 * coil.resistance
    if coil.amperes_per_volt is None:
        raise InputError(
            place=drawing.name,
            found="the card's command is a voltage, but the coil heat depends on the current",
            expected="coil.A_per_V, the current of the driver per volt of command",
        )
    return (command * coil.amperes_per_volt) ** 2 * coil.resistance


def _fade(
    works: Sequence[LoopWork], duty: Duty, fluid: FloatArray, time: FloatArray
) -> tuple[FloatArray, float | None]:
    """Return peak force versus time [N], and its final loss relative to 20 degC [%]."""
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
    if np.ptp(last.peak) == 0.0:  # The damper model ignores temperature.
        return peak, None
    cold = float(last.peak_at(REFERENCE_K))
    return peak, 100.0 * (1.0 - float(peak[moving[-1]]) / cold) if cold > 0.0 else None


def notes_of(card: ModelCard | Damper, duty: Duty) -> tuple[str, ...]:
    """Return notes that warn of assumptions and extrapolations of the damper model."""
    damper = card.damper if isinstance(card, ModelCard) else card
    notes = []
    if not damper.temperature_dependent:
        notes.append("the card does not depend on temperature: its force is held constant")
    elif damper.assumed:
        notes.append(
            f"the temperature laws of {', '.join(damper.assumed)} are assumed from a fluid, not identified"
        )
    if isinstance(card, ModelCard):
        notes += card_range_notes(card, duty).values()
    return tuple(notes)


def card_range_notes(card: ModelCard, duty: Duty) -> dict[str, str]:
    """Return sentences about the quantities for which the damper model extrapolates.

    The load cycle exceeds the range of the runs from which the model card was identified. The keys are the
    names of the quantities: displacement, velocity, command.
    """
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
