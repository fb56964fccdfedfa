"""The configuration of a controller, declared once and by parts.

Each part is a frozen dataclass whose fields have a type, a unit and a text. The kernel's struct is written
from them (``python -m mrdamper.control.config`` prints ``core/kernel/controller_config.h``), the binding
fills it by name, and an export prints it by name. SI and kelvin; "current" is the command, in volts where the
card's is.

A ``Mode`` is something that a configuration switches on. The extension asks the configuration at every step;
an exported controller is compiled for its own (``modes_of``), so that its code holds no other.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_type_hints


class Doc(NamedTuple):
    """What stands beside a field: its unit and its meaning."""

    unit: str
    text: str


class InverseMethod(IntEnum):
    """From what the command is found."""

    NONE = 0  # feedback alone
    MODEL = 1  # the model with its hysteresis at the applied current, or a bank of such models
    STATIC = 2  # the model with its hysteresis settled
    PREDICTIVE = 3  # moves of the command over the horizon in which it is felt


class FeedbackKind(IntEnum):
    """What is made of a measured force."""

    NONE = 0
    PI = 1
    ON_OFF = 2  # all or nothing by the sign of the force error


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """Sampling, and the range of the tables."""

    period: Annotated[float, Doc("s", "sampling period")]
    largest: Annotated[float, Doc("A", "current of the tables' last column; the first is 0")]
    coldest: Annotated[float, Doc("K", "lowest temperature of the tables")]
    warmest: Annotated[float, Doc("K", "highest temperature of the tables")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """The damper's law."""

    series: Annotated[bool, Doc("", "the series valve law")]
    chain: Annotated[bool, Doc("", "the chain law")]
    elements: Annotated[int, Doc("", "hysteretic elements: 0 (force follows the sign of velocity), 1, 2")]
    saturating: Annotated[bool, Doc("", "the second yield force saturates with speed, on the first element")]
    shared_rho: Annotated[bool, Doc("", "rho is the same at all currents: a bank's models share one state")]
    unloaded: Annotated[float, Doc("-", "travel of the universal curve from w = -1 to 0")]
    substeps: Annotated[int, Doc("", "series valve and chain: steps in a period")]
    strides: Annotated[int, Doc("", "series valve: steps to the preview")]
    horizon: Annotated[float, Doc("s", "series valve: time in which its spring is taken to the wanted force")]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFilter:
    """Gains of the filter that estimates the motion from the displacement."""

    gain_x: Annotated[float, Doc("-", "of the displacement")]
    gain_v: Annotated[float, Doc("1/s", "of the velocity")]
    gain_a: Annotated[float, Doc("1/s2", "of the acceleration")]
    held: Annotated[bool, Doc("", "readings are held for several periods: one that repeats is none")]
    swing_share: Annotated[float, Doc("-", "of a period in the means that tell how it swings; 0: none")]
    settle_samples: Annotated[int, Doc("", "periods in which the filter finds the motion")]
    most_swing: Annotated[float, Doc("1/s2", "largest ratio of mean a^2 and mean v^2")]
    speed_noise: Annotated[float, Doc("m2/s2", "what the sensor's noise leaves in v^2")]
    bend_noise: Annotated[float, Doc("m2/s4", "... and in a^2")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceFilter:
    """Gains of the filter that extrapolates a wanted force which is not known ahead."""

    gain_f: Annotated[float, Doc("-", "of the force")]
    gain_rate: Annotated[float, Doc("1/s", "of its rate")]
    gain_bend: Annotated[float, Doc("1/s2", "of its second derivative")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """Dead time, two lags and magnetic play between command and force."""

    no_lag: Annotated[bool, Doc("", "hysteresis is advanced with the command as if there were no lags")]
    dead_samples: Annotated[int, Doc("", "dead time: whole periods")]
    dead_part: Annotated[float, Doc("-", "... and the part of one")]
    rise: Annotated[float, Doc("-", "what a period leaves of the first lag's gap, command above it")]
    fall: Annotated[float, Doc("-", "... and below it")]
    second: Annotated[float, Doc("-", "what a period leaves of the second lag's gap")]
    rise_couple: Annotated[float, Doc("-", "share of the first gap that is in the second after a period")]
    fall_couple: Annotated[float, Doc("-", "... command below it")]
    second_ramp: Annotated[float, Doc("-", "share of a ramp of the first lag that the second is late")]
    wheel: Annotated[float, Doc("-", "period over the free-wheeling current's time; 0: driver pulls down")]
    bend: Annotated[float, Doc("1/A", "flux is I / (1 + bend I)")]
    second_ahead: Annotated[float, Doc("-", "the same from the last sample of the dead time to the preview")]
    rise_couple_ahead: Annotated[float, Doc("-", "... command above the first lag")]
    fall_couple_ahead: Annotated[float, Doc("-", "... and below it")]
    second_ramp_ahead: Annotated[float, Doc("-", "... of a ramp")]
    wheel_ahead: Annotated[float, Doc("-", "... that time over the free-wheeling current's")]
    rise_answer: Annotated[float, Doc("-", "share of a command given now that has passed at the preview")]
    fall_answer: Annotated[float, Doc("-", "... command below the first lag")]
    play: Annotated[float, Doc("A", "half width of the magnetic play behind the lags")]
    play_share: Annotated[float, Doc("-", "share of the field that has it, below 1")]
    wide_play: Annotated[float, Doc("A", "half width of a second, wider play; 0: there is one alone")]
    wide_share: Annotated[float, Doc("-", "share of the field that has it")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Inverse:
    """How the command for a wanted force is found."""

    method: Annotated[InverseMethod, Doc("", "from what the command is found")]
    models: Annotated[int, Doc("", "1: at the applied current; a bank of so many at constant currents")]
    preview: Annotated[float, Doc("s", "the force is set for so much later")]
    compensation: Annotated[float, Doc("-", "share of the lags' remaining gap that the command makes up for")]
    margin: Annotated[
        float, Doc("A", "reversal clamp: most above the static answer; any negative value: none")
    ]
    lead: Annotated[float, Doc("-", "lead compensation: gain of the filtered derivative; 0: none")]
    lead_keep: Annotated[float, Doc("-", "... what a period leaves of its filter's gap")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """The horizon over which the law is stepped, and how the command is moved there."""

    steps: Annotated[int, Doc("", "steps of the horizon, behind the dead time")]
    samples: Annotated[
        int, Doc("", "periods that a prediction is spread over; its command comes in the last")
    ]
    together: Annotated[int, Doc("", "periods of the dead time that are one step of the law")]
    step: Annotated[float, Doc("s", "length of a step of the horizon")]
    stretch: Annotated[int, Doc("", "... times this from the fourth on")]
    dead: Annotated[float, Doc("s", "time from now to the begin of the horizon")]
    fade: Annotated[float, Doc("-", "weight of a step's error over that of the step before")]
    calm: Annotated[float, Doc("N/A", "force error that is worth a move of the command")]
    rise: Annotated[float, Doc("-", "what a step leaves of the first lag's gap, command above it")]
    fall: Annotated[float, Doc("-", "... and below it")]
    second: Annotated[float, Doc("-", "what a step leaves of the second lag's gap")]
    rise_couple: Annotated[float, Doc("-", "share of the first gap that is in the second after a step")]
    fall_couple: Annotated[float, Doc("-", "... command below it")]
    second_ramp: Annotated[float, Doc("-", "share of a ramp of the first lag that the second is late")]
    wheel: Annotated[float, Doc("-", "step over the free-wheeling current's time; 0: driver pulls down")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feedback:
    """Feedback of a measured force."""

    kind: Annotated[FeedbackKind, Doc("", "what is made of a measured force")]
    gain: Annotated[float, Doc("A/N", "of the force error")]
    rate: Annotated[float, Doc("A/(N s)", "of its integral")]
    full_speed: Annotated[
        float, Doc("m/s", "speed from which the feedback is fully there, and gains are learnt")
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Learning:
    """What a measured force teaches."""

    observe: Annotated[
        float, Doc("-", "share of the force error that an observer takes on in a period; 0: none")
    ]
    forget: Annotated[float, Doc("-", "forgetting of the learnt gains; 0: none are learnt")]
    error_variance: Annotated[float, Doc("N2", "of the model's force")]
    gain_variance: Annotated[float, Doc("-", "of the gains before anything is learnt")]
    offset_share: Annotated[
        float, Doc("-", "share of the force error in the means of a constant force; 0: none is learnt")
    ]
    offset_samples: Annotated[int, Doc("", "samples moving each way before it is believed")]
    offset_error: Annotated[float, Doc("N", "that of the sensor itself: so much of it is left alone")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """The data's envelope; outside it a flag is raised."""

    low_x: Annotated[float, Doc("m", "lowest displacement")]
    high_x: Annotated[float, Doc("m", "highest displacement")]
    high_v: Annotated[float, Doc("m/s", "highest speed")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """When a displacement or a velocity is not believed."""

    far_x: Annotated[float, Doc("m", "a displacement further out is a fault")]
    far_v: Annotated[float, Doc("m/s", "a velocity beyond is a fault")]
    frozen_samples: Annotated[int, Doc("", "equal readings that make a fault")]
    frozen_speed: Annotated[float, Doc("m/s", "... where the damper moved at least as fast before")]
    coast_samples: Annotated[int, Doc("", "samples without displacement before the fall-back")]
    back_samples: Annotated[int, Doc("", "samples with it again before the fall-back ends")]
    fall_back: Annotated[float, Doc("A", "command when the motion is not known")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermometer:
    """When a temperature is not believed."""

    cold_limit: Annotated[float, Doc("K", "a temperature below is a fault")]
    hot_limit: Annotated[float, Doc("K", "a temperature above is a fault")]
    jump: Annotated[float, Doc("K", "a reading further from what is believed is a fault")]
    slew: Annotated[float, Doc("K", "what is believed moves at most so much in a period")]
    keep: Annotated[float, Doc("-", "what a period leaves of the gap between belief and reading")]
    hold_samples: Annotated[int, Doc("", "samples that a belief lasts without a good temperature")]
    recover_samples: Annotated[
        int, Doc("", "steady samples after which a reading that had jumped is believed")
    ]
    nominal: Annotated[float, Doc("K", "temperature to fall back to")]
    coil_gap: Annotated[float, Doc("K", "a temperature further from the coil's is a fault")]
    coil_samples: Annotated[int, Doc("", "samples after which a coil far from what is believed is believed")]
    held: Annotated[float, Doc("K", "temperature to use whatever is read; 0: read it")]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatBalance:
    """The damper as one body, which tells a frozen thermometer."""

    capacity: Annotated[float, Doc("J/K", "heat that warms the damper by a kelvin; 0: nobody looks")]
    loss: Annotated[float, Doc("W/K", "what it loses to its surroundings")]
    loss_margin: Annotated[float, Doc("-", "... and at most so many times that")]
    ambient: Annotated[float, Doc("K", "temperature of the surroundings")]
    coil_heat: Annotated[float, Doc("W/A2", "heat of the coil over the applied current squared")]
    frozen_rise: Annotated[float, Doc("K", "one reading while the damper warms by more than this is a fault")]
    extrapolate: Annotated[
        bool, Doc("", "a frozen temperature goes on by the energy put in; else a flag only")
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Config:
    """All parts of a controller's configuration."""

    axes: Axes
    law: Law
    motion: MotionFilter
    reference: ReferenceFilter
    actuation: Actuation
    inverse: Inverse
    prediction: Prediction
    feedback: Feedback
    learning: Learning
    envelope: Envelope
    faults: Faults
    thermometer: Thermometer
    heating: HeatBalance


@dataclass(frozen=True, slots=True)
class Field:
    """One value of a configuration."""

    part: str
    name: str
    type: type
    doc: Doc

    def of(self, config: Config) -> float:
        """Return the value in a configuration."""
        value: float = getattr(getattr(config, self.part), self.name)
        return value


@cache
def config_fields() -> tuple[Field, ...]:
    """Return every value that there is, in the order of the kernel's struct."""
    return tuple(
        Field(part, name, *get_args(hint))
        for part, kind in get_type_hints(Config).items()
        for name, hint in get_type_hints(kind, include_extras=True).items()
    )


# -------------------------------------------------------------------------------------------------- modes

_COMPARISONS = {"==": operator.eq, "!=": operator.ne, ">": operator.gt, ">=": operator.ge}


@dataclass(frozen=True, slots=True)
class Mode:
    """Something that a configuration may switch on: where one value compares with a number."""

    name: str
    part: str
    field: str
    comparison: Literal["==", "!=", ">", ">="]
    value: int
    text: str
    of_model: bool = False  # whether the real-time model has it as well

    def is_on(self, config: Config) -> bool:
        """Return whether a configuration switches it on."""
        found = getattr(getattr(config, self.part), self.field)
        return bool(_COMPARISONS[self.comparison](found, self.value))


MODES = (
    Mode("SERIES", "law", "series", "!=", 0, "series valve law", of_model=True),
    Mode("CHAIN", "law", "chain", "!=", 0, "chain law", of_model=True),
    Mode("MEMORYLESS", "law", "elements", "==", 0, "law without hysteresis", of_model=True),
    Mode("SATURATING", "law", "saturating", "!=", 0, "yield force that saturates with speed", of_model=True),
    Mode("SHARED_RHO", "law", "shared_rho", "!=", 0, "one rho at all currents", of_model=True),
    Mode("SWING", "motion", "swing_share", ">", 0, "jerk by how the motion swings"),
    Mode("NO_LAG", "actuation", "no_lag", "!=", 0, "no lags between command and force", of_model=True),
    Mode("WHEEL", "actuation", "wheel", ">", 0, "driver that cannot pull the current down", of_model=True),
    Mode("SATURATION", "actuation", "bend", ">", 0, "iron that saturates", of_model=True),
    Mode("PLAY", "actuation", "play", ">", 0, "magnetic play", of_model=True),
    Mode("WIDE_PLAY", "actuation", "wide_play", ">", 0, "a second, wider magnetic play", of_model=True),
    Mode("BANK", "inverse", "models", ">", 1, "bank of models at constant currents", of_model=True),
    Mode("INVERSE", "inverse", "method", "!=", InverseMethod.NONE, "inverse of the model"),
    Mode("STATIC", "inverse", "method", "==", InverseMethod.STATIC, "inverse of the settled model"),
    Mode("PREDICTIVE", "inverse", "method", "==", InverseMethod.PREDICTIVE, "command by prediction"),
    Mode("PREVIEW", "inverse", "preview", ">", 0, "force set for later"),
    Mode("COMPENSATION", "inverse", "compensation", ">", 0, "compensation of the lags' remaining gap"),
    Mode("CLAMP", "inverse", "margin", ">=", 0, "reversal clamp"),
    Mode("LEAD", "inverse", "lead", ">", 0, "lead compensation"),
    Mode("FEEDBACK", "feedback", "kind", "!=", FeedbackKind.NONE, "feedback of a measured force"),
    Mode("ON_OFF", "feedback", "kind", "==", FeedbackKind.ON_OFF, "all or nothing by the force error"),
    Mode("OBSERVER", "learning", "observe", ">", 0, "disturbance observer"),
    Mode("ADAPTIVE", "learning", "forget", ">", 0, "learnt gains"),
    Mode("OFFSET", "learning", "offset_share", ">", 0, "learnt constant force"),
    Mode(
        "HELD_TEMPERATURE", "thermometer", "held", ">", 0, "one temperature, whatever is read", of_model=True
    ),
    Mode("HEATING", "heating", "capacity", ">", 0, "look for a frozen thermometer", of_model=True),
    Mode("EXTRAPOLATION", "heating", "extrapolate", "!=", 0, "frozen temperature carried on", of_model=True),
)
"""What a controller may be compiled with or without; the macros are ``MRD_WITH_`` and these names."""


def modes_of(
    model: Config | None, controller: Config | None, *, tuned: Iterable[str] = ()
) -> Mapping[str, str]:
    """Return what each mode's macro is in code that holds these parts: never, always, or asked at a step.

    ``tuned`` names values that may change after compilation, as ``part.field``.
    """
    asked = set(tuned)

    def state(mode: Mode) -> str:
        has_it = controller is None or mode.of_model
        found = {mode.is_on(each) for each in (controller, model if has_it else None) if each}
        if len(found) > 1 or f"{mode.part}.{mode.field}" in asked:
            return "MRD_ASKED"
        return "MRD_ALWAYS" if found == {True} else "MRD_NEVER"

    return {f"MRD_WITH_{mode.name}": state(mode) for mode in MODES}


# ------------------------------------------------------------------------------------------ the C header

_C_TYPES = {float: "mrd_real", int: "int32_t", bool: "bool"}
_HEADER_TOP = """/* The configuration of a controller, by parts, and the modes that it may be compiled with.
 *
 * Written from control/config.py (`python -m mrdamper.control.config`); not meant to be edited. Values are
 * in SI and kelvin; "A" is the unit of the command, volts where the card's is.
 */
#ifndef MRD_CONTROLLER_CONFIG_H
#define MRD_CONTROLLER_CONFIG_H
"""


def header_text() -> str:
    """Return ``controller_config.h``."""
    lines = [_HEADER_TOP, *_enums(), *_structs(), *_value_list(), *_modes(), "#endif"]
    return "\n".join(lines) + "\n"


def _c_type(kind: type) -> str:
    return _C_TYPES.get(kind) or f"mrd_{_snake(kind.__name__)}"


def _snake(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).lstrip("_")


def _enums() -> Iterator[str]:
    kinds = dict.fromkeys(each.type for each in config_fields() if issubclass(each.type, IntEnum))
    for kind in kinds:
        label = _snake(kind.__name__).upper()
        names = ", ".join(f"MRD_{label}_{each.name} = {each.value}" for each in kind)
        yield f"typedef enum {_c_type(kind)} {{ {names} }} {_c_type(kind)};\n"


def _structs() -> Iterator[str]:
    for part, kind in get_type_hints(Config).items():
        yield f"/* {kind.__doc__} */\ntypedef struct {{"
        for each in config_fields():
            if each.part == part:
                unit = f" [{each.doc.unit}]" if each.doc.unit else ""
                yield f"    {_c_type(each.type)} {each.name}; /* {each.doc.text}{unit} */"
        yield f"}} mrd_config_{part};\n"
    yield "/* The parts: members of mrd_track. */\n#define MRD_CONFIG_PARTS(X) \\"
    yield _rows(f"X({each.name})" for each in fields(Config))


def _value_list() -> Iterator[str]:
    yield "/* Every value: part, name, type. */\n#define MRD_CONFIG_VALUES(X) \\"
    yield _rows(f"X({each.part}, {each.name}, {_c_type(each.type)})" for each in config_fields())


def _rows(entries: Iterable[str]) -> str:
    return " \\\n".join(f"    {each}" for each in entries) + "\n"


def _modes() -> Iterator[str]:
    yield "/* A mode is left out of the code, always there, or there where the configuration says so. */"
    yield "#define MRD_NEVER 0\n#define MRD_ALWAYS 1\n#define MRD_ASKED 2\n"
    for mode in MODES:
        macro = f"MRD_WITH_{mode.name}"
        yield f"#ifndef {macro}\n#define {macro} MRD_ASKED /* {mode.text} */\n#endif"
    yield ""
    kinds: dict[tuple[str, str], Any] = {(each.part, each.name): each.type for each in config_fields()}
    for mode in MODES:
        kind = kinds[mode.part, mode.field]
        member = f"p->{mode.field}"
        if kind is bool:
            test = member
        elif kind is float:
            test = f"{member} {mode.comparison} (mrd_real){mode.value}"
        elif kind is int:
            test = f"{member} {mode.comparison} {mode.value}"
        else:
            test = f"{member} {mode.comparison} MRD_{_snake(kind.__name__).upper()}_{kind(mode.value).name}"
        macro, name = f"MRD_WITH_{mode.name}", mode.name.lower()
        yield f"static inline bool mrd_has_{name}(const mrd_config_{mode.part} *p)\n{{"
        yield "    (void)p;"
        yield f"    return ({macro} == MRD_ASKED) ? ({test}) : ({macro} == MRD_ALWAYS);\n}}"
    yield ""


if __name__ == "__main__":
    print(header_text(), end="")
