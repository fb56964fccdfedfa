"""What is exported: one value that holds everything the templates print and nothing that they compute.

A ``Target`` is a card, the real-time model and the force controller made from it, and the choices of the
export: number type, sampling period, name. C folder, FMU and the check of both are made from it alone.
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
from mrdamper.thermal.compact.model import CompactModel

Content = Literal["model", "controller", "both"]
Precision = Literal["float", "double"]

CONTENTS: tuple[Content, ...] = ("model", "controller", "both")
PRECISIONS: tuple[Precision, ...] = ("float", "double")

_STEPS_s = (50e-6, 10e-3)  # for which the motion filter is made; what the card's lags allow is checked beside
_C_WORDS = (
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum",
    "extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict", "return",
    "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void",
    "volatile", "while", "asm", "main", "bool", "class", "namespace", "template", "new", "delete", "this",
    "public", "private", "try",
)  # fmt: skip
_KERNEL_FILES = ("controller", "kernel", "track", "mrd")  # names that begin so are the kernel's own


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A card made ready for a target. ``model`` or ``controller`` is None where the content leaves it out."""

    name: str  # a C identifier; prefix of every name, and of the files
    card: ModelCard
    content: Content
    precision: Precision
    period_s: float
    model: RealtimeDamper | None
    controller: ForceController | None
    heating: Heating  # what tells a frozen thermometer, and where it is from
    fingerprint: str  # of the card: its content_sha256
    thermal: CompactModel | None = None  # what gives the temperatures, where a drawing is known

    @property
    def single(self) -> bool:
        """Whether the target computes in single precision."""
        return self.precision == "float"

    @property
    def law(self) -> str:
        """The law's name."""
        return self.card.damper.law.name

    @property
    def command_unit(self) -> str:
        """Unit of the command: A or V."""
        return self.card.damper.command_unit

    @property
    def amperes(self) -> float:
        """Amperes in the coil by a unit of the command; 0: not known."""
        return 1.0 if self.command_unit == "A" else self.heating.amperes_per_volt or 0.0

    @property
    def rate_Hz(self) -> float:
        """Steps a second."""
        return 1.0 / self.period_s

    @property
    def parts(self) -> dict[str, RealtimeDamper | ForceController]:
        """What is exported, by the name that it has in C: model, controller."""
        both = {"model": self.model, "controller": self.controller}
        return {name: part for name, part in both.items() if part is not None}

    @property
    def largest(self) -> float:
        """Largest command [A or V]."""
        return self.any_part.largest

    @property
    def any_part(self) -> RealtimeDamper | ForceController:
        """Return one of the parts, for what both have."""
        return next(iter(self.parts.values()))

    @property
    def compile_options(self) -> Mapping[str, int]:
        """Compile-time options of the C code: laws and methods that it contains."""
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
    """Return a card made ready for a target.

    Parameters
    ----------
    content : model (motion, command, temperature -> force), controller (wanted force -> command), or both
    precision : the target's number type, float or double
    period_s : time between two steps [s]
    controller : which of ``control.controllers.NAMES``
    name : a C identifier, the prefix of every name in the code
    largest : largest command [A or V]; None: the card's
    heating : heat capacity and loss, which tell a frozen thermometer; None: those of the paper's damper

    Raises
    ------
    InputError
        A choice that is not there; a name that C does not take; a law without a real-time form; a step that
        is too long for the card's lags, or so short that the commands under way do not fit.
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
            expected="a C identifier of at most 40 letters, digits and _, which C and the kernel do not use",
            remedy="Pass another --name, such as front_left",
        )


def _check_step(period_s: float) -> None:
    low, high = _STEPS_s
    if not low <= period_s <= high:
        raise InputError(
            found=f"step is {1e3 * period_s:g} ms",
            expected=f"{1e3 * low:g} to {1e3 * high:g} ms, for which the motion filter is made",
            remedy="Use another --step",
        )
