"""The input of an export: one object that contains all values for the templates.

A ``Target`` contains a card, the card's real-time model and force controller, and the options of the export
(number type, sampling period, name). The C folder, the FMU and the verification depend only on the target.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, cast

from mrdamper.control.config import compile_options
from mrdamper.control.controllers import ForceController, check_name, controllers_for
from mrdamper.control.realtime import RealtimeDamper, realtime_model
from mrdamper.control.tables.heating import Heating
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import card_sha256
from mrdamper.schema import unknown_name
from mrdamper.thermal.compact import CompactModel

Content = Literal["model", "controller", "both"]
Precision = Literal["float", "double"]

CONTENTS: tuple[Content, ...] = ("model", "controller", "both")
PRECISIONS: tuple[Precision, ...] = ("float", "double")

_C_WORDS = (
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum",
    "extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return",
    "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void",
    "volatile", "while", "asm", "main", "bool", "class", "namespace", "template", "new", "delete", "this",
    "public", "private", "try",
)  # fmt: skip
_KERNEL_FILES = ("controller", "kernel", "track", "mrd")  # Names in the kernel begin with these words.


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Input of an export; ``model`` or ``controller`` is None unless it is exported."""

    name: str  # C identifier with which all names and file names of the code begin
    card: ModelCard
    content: Content
    precision: Precision
    period_s: float
    model: RealtimeDamper | None
    controller: ForceController | None
    heating: Heating  # heat balance for the detection of a stuck temperature sensor
    fingerprint: str  # hash of the card
    thermal: CompactModel | None = None  # thermal model; None if there is no geometry file

    @property
    def single(self) -> bool:
        """Return True if the code uses single precision (float)."""
        return self.precision == "float"

    @property
    def law(self) -> str:
        return self.card.damper.law.name

    @property
    def command_unit(self) -> str:
        return self.card.damper.command_unit

    @property
    def amperes(self) -> float:
        """Return the coil current divided by the command [A/A or A/V]; 0 if unknown."""
        return 1.0 if self.command_unit == "A" else self.heating.amperes_per_volt or 0.0

    @property
    def rate_Hz(self) -> float:
        """Return the sampling rate of the code."""
        return 1.0 / self.period_s

    @property
    def parts(self) -> dict[str, RealtimeDamper | ForceController]:
        """Return the exported parts by name: ``model`` and ``controller``."""
        both = {"model": self.model, "controller": self.controller}
        return {name: part for name, part in both.items() if part is not None}

    @property
    def largest(self) -> float:
        """Return the largest command of model and controller [A or V]."""
        return self.any_part.largest

    @property
    def any_part(self) -> RealtimeDamper | ForceController:
        """Return the model if it is exported, otherwise the controller."""
        return next(iter(self.parts.values()))

    @property
    def compile_options(self) -> Mapping[str, int]:
        """Return the compile-time options, which select hysteresis laws and controllers."""
        return compile_options(*(part.config for part in self.parts.values()))


def target_of(
    card: ModelCard,
    *,
    content: str = "both",
    precision: str = "float",
    period_s: float = 1e-3,
    controller: str = "recommended",
    name: str = "damper",
    largest: float | None = None,
    heating: Heating | None = None,
) -> Target:
    """Return the input of an export: a card with its real-time model, controller and options.

    Parameters
    ----------
    content : ``model`` (computes the force from motion, command and temperature), ``controller`` (computes
        the command from the wanted force), or ``both``
    precision : number type of the code, ``float`` or ``double``
    period_s : time between two steps [s]
    controller : name of the controller, one of ``control.controllers.NAMES``
    name : C identifier that is the prefix of every name in the code
    largest : largest command [A or V]; None: from the card
    heating : heat balance for the detection of a stuck thermometer; None: heat balance of the damper in the
        reference paper

    Raises
    ------
    InputError
        If an option or the name is invalid, or the hysteresis law has no real-time model. Also if the period
        is too long for the lags of the damper, or too short for the memory of past commands.
    """
    for what, found, choices in (("content", content, CONTENTS), ("precision", precision, PRECISIONS)):
        if found not in choices:
            raise InputError(
                place="export", found=f"{what} is {found!r}", expected=f"one of {', '.join(choices)}"
            )
    _check_name(name)
    _check_step(period_s)
    single, heating = precision == "float", heating or Heating.paper()
    made: ForceController | None = None
    model: RealtimeDamper | None = None
    if content != "controller":
        model = realtime_model(card, period_s=period_s, largest=largest, heating=heating, single=single)
    if content != "model":
        every = controllers_for(card, period_s=period_s, largest=largest, heating=heating)
        check_name(controller, card.damper.law.name)
        if controller not in every:
            raise unknown_name(f"there is no controller {controller!r}", controller, every)
        made = replace(every[controller], single=single)
    return Target(
        name=name,
        card=card,
        content=cast(Content, content),
        precision=cast(Precision, precision),
        period_s=period_s,
        model=model,
        controller=made,
        heating=heating,
        fingerprint=card_sha256(card),
    )


def _check_name(name: str) -> None:
    is_identifier = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{,39}", name) is not None
    if not is_identifier or name.lower() in _C_WORDS or name.lower().startswith(_KERNEL_FILES):
        raise InputError(
            found=f"name is {name!r}",
            expected="a C identifier of up to 40 letters, digits and _ that is not a word of C or the kernel",
            remedy="Pass another --name, such as front_left",
        )


def _check_step(period_s: float) -> None:
    step_range_s = (50e-6, 10e-3)  # range of sampling periods for which the motion filter is designed
    low, high = step_range_s
    if not low <= period_s <= high:
        raise InputError(
            found=f"step is {1e3 * period_s:g} ms",
            expected=f"{1e3 * low:g} to {1e3 * high:g} ms (range of the motion filter)",
            remedy="Use another --step",
        )
