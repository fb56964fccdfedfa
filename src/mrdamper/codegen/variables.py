"""Define the variables of an FMU. The XML and the C code of the FMU are generated from this list.

The variables are inputs, outputs, flags, tunable parameters and constants. The value reference of a variable
is its index in the list. Start values are rounded to the number type of the code, so that they are equal in
the XML, in the C table, and in the results of a simulator.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Literal

import numpy as np

from mrdamper.codegen.c_code import flag_texts
from mrdamper.codegen.target import Target
from mrdamper.control.config import Config, FeedbackKind
from mrdamper.control.stepper import FAULTS, Flag
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.thermal.compact import PARTS, CompactModel
from mrdamper.thermal.drawing import AIR_MAX_M_S

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["independent", "input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "tunable", "constant"]


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as powers of SI base units, and its display unit: displayed = factor * value + offset."""

    base: Mapping[str, int]
    display: str = ""
    factor: float = 1.0
    offset: float = 0.0


UNITS: Mapping[str, Unit] = {
    "s": Unit({"s": 1}),
    "m": Unit({"m": 1}, "mm", 1000.0),
    "m/s": Unit({"m": 1, "s": -1}, "mm/s", 1000.0),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "K": Unit({"K": 1}, "degC", 1.0, -ZERO_CELSIUS_K),
    "A": Unit({"A": 1}),
    "V": Unit({"kg": 1, "m": 2, "s": -3, "A": -1}),
    "A/N": Unit({"A": 1, "kg": -1, "m": -1, "s": 2}),
    "V/N": Unit({"m": 1, "s": -1, "A": -1}),
    "A/(N.s)": Unit({"A": 1, "kg": -1, "m": -1, "s": 1}),
    "V/(N.s)": Unit({"m": 1, "s": -2, "A": -1}),
    "ohm": Unit({"kg": 1, "m": 2, "s": -3, "A": -2}),
    "1": Unit({}),
}
"""Units of the variables, by name of the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One variable of an FMU.

    ``place`` is the C struct member that a parameter sets. ``bits`` belongs to a Boolean output for flags.
    The output is True if one of the flags in ``bits`` is set.
    """

    name: str
    description: str
    kind: Kind
    causality: Causality
    variability: Variability
    unit: str = ""  # unit of a real variable; empty for other kinds
    start: float | None = None  # start value; None: the FMU computes the value
    low: float = -math.inf
    high: float = math.inf
    place: str = ""
    bits: int = 0

    @property
    def label(self) -> str:
        """Return the name of the C constant that contains the value reference of the variable."""
        return f"VR_{self.name.upper()}"


def tunable(
    name: str, unit: str, start: float, low: float, high: float, description: str, place: str
) -> Variable:
    """Return a real parameter that can change between time steps.

    ``place`` is the C struct member that stores the parameter.
    """
    return Variable(
        name=name, description=description, kind="real", causality="parameter", variability="tunable",
        unit=unit, start=start, low=low, high=high, place=place,
    )  # fmt: skip


_OUTSIDE = Flag.OUTSIDE_MOTION | Flag.OUTSIDE_TEMPERATURE
_OF_CONTROLLER = Flag.NO_TARGET | Flag.NO_FORCE | Flag.INFEASIBLE
_OF_MODEL = Flag.NO_CURRENT | Flag.NO_VELOCITY


def variables_of(target: Target) -> tuple[Variable, ...]:
    """Return the variables of the FMU of a target, in the order of their value references."""
    every = [
        Variable(
            name="time", description="time", kind="real", causality="independent", variability="continuous",
            unit="s",
        ),
        *_inputs(target),
        *_outputs(target),
        *_flags(target),
        *_parameters(target),
        *_constants(target),
    ]  # fmt: skip
    return tuple(_rounded(each) if target.precision == "float" else each for each in every)


def _input(name: str, unit: str, start: float, description: str) -> Variable:
    return Variable(
        name=name, description=description, kind="real", causality="input", variability="continuous",
        unit=unit, start=start,
    )  # fmt: skip


def _switch(name: str, description: str, start: bool) -> Variable:  # noqa: FBT001 - a start value
    return Variable(
        name=name, description=description, kind="boolean", causality="parameter", variability="tunable",
        start=float(start),
    )  # fmt: skip


def _inputs(target: Target) -> Iterator[Variable]:
    command = _command_name(target)
    warm = target.any_part.config.thermometer.nominal
    if target.controller is not None:
        yield _input("wanted_force", "N", 0.0, "wanted force, positive against extension")
        if target.controller.preview_s > 0.0:
            yield _input(
                "wanted_force_ahead", "N", 0.0, "wanted force preview_time later; see use_wanted_force_ahead"
            )
    yield _input("displacement", "m", 0.0, "displacement of the damper, extension positive")
    if target.model is not None:
        yield _input("velocity", "m/s", 0.0, "velocity of the damper; see use_velocity")
    if target.content == "model":
        yield _input(command, target.command_unit, 0.0, "command to the damper")
    yield _input("temperature", "K", warm, "temperature of the fluid")
    if target.controller is not None and target.controller.needs_force:
        yield _input("force_reading", "N", 0.0, "measured force, for the feedback; see use_force_reading")
    if target.content == "both":
        yield _input(
            f"given_{command}", target.command_unit, 0.0, f"command to the damper; see use_given_{command}"
        )
    if target.thermal is not None:
        yield _input("air_temperature", "K", REFERENCE_K, "air around the damper")
        yield _input("air_speed", "m/s", target.thermal.air_speed, "speed of the air across the damper")
        description = "thermometer in the fluid; see use_thermometer_reading"
        yield _input("thermometer_reading", "K", REFERENCE_K, description)
        description = "measured resistance of the coil; see use_coil_resistance"
        yield _input("coil_resistance", "ohm", target.thermal.resistance, description)


def _outputs(target: Target) -> Iterator[Variable]:
    def output(name: str, unit: str, description: str) -> Variable:
        return Variable(
            name=name, description=description, kind="real", causality="output", variability="continuous",
            unit=unit,
        )  # fmt: skip

    command, unit = _command_name(target), target.command_unit
    if target.model is not None:
        yield output("force", "N", "force of the damper, positive against extension")
    if target.controller is not None:
        yield output(command, unit, "command to the damper, from 0 to the largest")
    if target.model is not None:
        yield output(f"applied_{command}", unit, "command behind delay, lags and magnetic hysteresis")
    if target.controller is not None:
        yield output("model_force", "N", "present force of the controller's model")
    if target.thermal is not None:
        yield output("fluid_temperature", "K", "mean fluid temperature of the thermal model")
        for part in PARTS:
            yield output(f"hottest_{part}_temperature", "K", f"hottest point of the {part}")
        yield output(
            "time_to_limit", "s", "until a part reaches its limit at the present load; 7200 or longer"
        )


def _flags(target: Target) -> Iterator[Variable]:
    def output(name: str, description: str, bits: int, kind: Kind = "boolean") -> Variable:
        return Variable(
            name=name,
            description=description,
            kind=kind,
            causality="output",
            variability="discrete",
            bits=bits,
        )

    yield output("flags", "all flags of the step, one bit each", 0, "integer")
    if target.thermal is not None:
        yield output("thermal_flags", "all flags of the thermal model, one bit each", 0, "integer")
    yield output("fault", "a reading was rejected or is missing", int(FAULTS))
    yield output("outside_envelope", "motion or temperature outside the identified range", int(_OUTSIDE))
    others = {"model": _OF_CONTROLLER, "controller": _OF_MODEL, "both": Flag(0)}[target.content]
    for each in flag_texts():
        if not each.value & others:
            name = each.name.removeprefix("MRD_")
            yield output(f"flag_{name.lower()}", each.text, each.value)


def _parameters(target: Target) -> Iterator[Variable]:
    command = _command_name(target)
    controller = target.controller
    if controller is not None and controller.preview_s > 0.0:
        yield _switch(
            "use_wanted_force_ahead",
            "the input wanted_force_ahead is known; otherwise extrapolated",
            start=False,
        )
    if target.model is not None:
        yield _switch("use_velocity", "the input velocity is known; otherwise estimated", start=False)
    if controller is not None and controller.needs_force:
        yield _switch("use_force_reading", "the input force_reading is known", start=True)
    if target.content == "both":
        yield _switch(
            f"use_given_{command}", f"given_{command} drives the damper, not the controller", start=False
        )
    if target.thermal is not None:
        description = "damper and controller use the thermal model's temperature; otherwise the input"
        yield _switch("use_thermal_model", description, start=False)
        yield _switch(
            "use_thermometer_reading", "thermometer_reading corrects the thermal model", start=False
        )
        yield _switch("use_coil_resistance", "coil_resistance corrects the thermal model", start=False)
    yield from _tunable_parameters(target)


def _tunable_parameters(target: Target) -> Iterator[Variable]:
    for part, source in target.parts.items():
        # A prefix distinguishes the parameters of model and controller if both are exported.
        owner = "" if target.content != "both" else "damper_" if part == "model" else "controller_"
        # An FMU with model and controller is used for simulation, where a constant temperature is no sensor
        # fault. Therefore the temperature is not extrapolated.
        config = source.config
        if target.content == "both":
            config = replace(config, heating=replace(config.heating, extrapolate=False))
        for each in _tunable(part, config, target.command_unit):
            yield replace(each, name=owner + each.name)
    if target.thermal is not None:
        yield from _thermal(target.thermal)


def _tunable(part: str, config: Config, unit: str) -> Iterator[Variable]:
    gain_max = 1e9  # upper limit of feedback gains, so large that it has no effect

    def number(name: str, of: str, unit: str, low: float, high: float, description: str) -> Variable:
        return tunable(name, unit, attrgetter(of)(config), low, high, description, f"{part}_data.{of}")

    largest, feedback = config.axes.largest, config.feedback
    coldest, hottest = config.thermometer.cold_limit, config.thermometer.hot_limit
    if part == "controller":
        description = "command while the motion is unknown"
        yield number("fall_back", "faults.fall_back", unit, 0.0, largest, description)
        if feedback.kind is FeedbackKind.PI:
            description = "gain of the force error"
            yield number("feedback_gain", "feedback.gain", f"{unit}/N", 0.0, gain_max, description)
            description = "gain of the integral of the force error"
            yield number("feedback_rate", "feedback.rate", f"{unit}/(N.s)", 0.0, gain_max, description)
    if config.heating.heat_capacity > 0.0:
        description = "temperature of the surroundings"
        yield number("ambient_temperature", "heating.ambient", "K", coldest, hottest, description)
        description = "a frozen temperature is extrapolated by the energy put in; otherwise only flagged"
        extrapolates = _switch("reckon_temperature", description, start=config.heating.extrapolate)
        yield replace(extrapolates, low=0.0, high=1.0, place=f"{part}_data.heating.extrapolate")
    description = "temperature that is used if none is known"
    yield number("nominal_temperature", "thermometer.nominal", "K", coldest, hottest, description)
    description = "temperature that replaces the readings; 0: readings are used"
    yield number("held_temperature", "thermometer.fixed", "K", 0.0, hottest, description)
    for what in ("yield", "viscous", "friction"):
        description = f"gain of the {what} force, 1 as identified"
        yield number(f"{what}_gain", f"gains.{what}_force", "1", 0.1, 10.0, description)


def _thermal(model: CompactModel) -> Iterator[Variable]:
    nominal = model.resistance
    named = {
        **{
            f"limit_{part}": ("K", float(limit), 233.15, 573.15, f"limit of the hottest point of the {part}")
            for part, limit in zip(PARTS, model.limits, strict=True)
        },
        "resistance": ("ohm", nominal, 0.1 * nominal, 10.0 * nominal, "resistance of the coil at 20 degC"),
        "air_speed": ("m/s", model.air_speed, 0.0, AIR_MAX_M_S, "air speed until a reading is available"),
    }
    for name, (unit, start, low, high, description) in named.items():
        yield tunable(f"thermal_{name}", unit, start, low, high, description, f"thermal_data.{name}")


def _constants(target: Target) -> Iterator[Variable]:
    def constant(name: str, unit: str, value: float, description: str) -> Variable:
        return Variable(
            name=name, description=description, kind="real", causality="local", variability="constant",
            unit=unit, start=value,
        )  # fmt: skip

    command = _command_name(target)
    yield constant("sample_time", "s", target.period_s, "internal step")
    if target.controller is not None and target.controller.preview_s > 0.0:
        description = "time of wanted_force_ahead minus time of wanted_force"
        yield constant("preview_time", "s", target.controller.preview_s, description)
    yield constant(f"largest_{command}", target.command_unit, target.largest, "largest command")


def _command_name(target: Target) -> str:
    return "voltage" if target.command_unit == "V" else "current"


def _rounded(variable: Variable) -> Variable:
    """Round start value and range of a parameter to single precision.

    The code stores parameters in single precision. All other variables are double and stay unchanged.
    """
    if not (variable.place and variable.start is not None):
        return variable

    def single(value: float) -> float:
        return float(np.float32(value)) if math.isfinite(value) else value

    return replace(
        variable, start=single(variable.start), low=single(variable.low), high=single(variable.high)
    )
