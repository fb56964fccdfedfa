"""Exceptions, each with the exit code of the command line.

    MrdamperError                     1  base; a plain one is never raised
    ├── InputError                    3  data, a file, a unit or an option that cannot be used as given
    │   ├── EnvelopeError             3  a value outside the range in which a law or correlation holds
    │   ├── MissingExtraError         3  an optional library is not installed
    │   └── UsageError                2  options that exclude each other, or one that is missing
    ├── ConvergenceError              4  a fit or solve that did not reach its tolerance
    └── CheckError                    5  something was made and did not pass its own check

An error holds the place, the finding, the expectation and the remedy as plain text. Options and commands are
named as on the command line. A plain ``Exception`` that escapes from this package is an internal error (exit
code 1), never a way of reporting bad input.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, ClassVar, Self

_PARTS = ("place", "found", "expected", "remedy")
_LONGEST_LINE = 4000
_MOST_LINES = 200
_MOST_FAULTS = 8  # of many, in one message


class MrdamperError(Exception):
    """Base of all errors that mrdamper raises on purpose.

    Parameters
    ----------
    found, expected : the actual and the expected value
    place : the file, run or field where it was found
    remedy : what to do about it, as a sentence, or as a clause if it begins with a small letter
    faults : several errors in one; it then has no own parts

    The parts make one message: place, found, expected, remedy, in this order; of many faults each has a
    line. What was found stands in it as it is; a text of any size is cut, so that the rest can be read.
    """

    exit_code: ClassVar[int] = 1

    def __init__(
        self,
        found: str = "",
        *,
        place: str | PurePath = "",
        expected: str = "",
        remedy: str = "",
        faults: Sequence[MrdamperError] = (),
    ) -> None:
        self.place, self.found, self.expected, self.remedy = str(place), found, expected, remedy
        self.faults = tuple(faults)
        super().__init__(self._said())

    def _said(self) -> str:
        if self.faults:
            return _joined(self.faults)
        said = f"{self.place}: {self.found}" if self.place else self.found
        said += f"; expected {self.expected}" if self.expected else ""
        return said + f"{'; ' if self.remedy[:1].islower() else '. '}{self.remedy}" if self.remedy else said

    def move_to(self, place: str) -> None:
        """Change the place: who called knows the file of what was given as a value."""
        self.place = place
        self.args = (self._said(),)

    def at_place(self, place: str | PurePath) -> Self:
        """Return this error with a place before its own, once: the file before the field."""
        moved = copy.copy(self)
        moved.faults = tuple(fault.at_place(place) for fault in self.faults)
        if self.place != str(place) and not self.place.startswith(f"{place}: "):
            moved.move_to(f"{place}: {self.place}" if self.place else str(place))
        return moved

    def renamed(self, name: str, other: str) -> Self:
        """Return this error with every occurrence of a file name replaced."""
        moved = copy.copy(self)
        moved.faults = tuple(fault.renamed(name, other) for fault in self.faults)
        for part in _PARTS:
            setattr(moved, part, getattr(self, part).replace(name, other))
        moved.move_to(moved.place)
        return moved

    def __str__(self) -> str:
        return _shortened(self.args[0])

    def __format__(self, form: str) -> str:
        """Return the whole message as a part of another one."""
        return format(self.args[0], form)

    def parts(self) -> dict[str, str]:
        """Return place, found, expected and remedy, as far as the error has them."""
        if self.faults:
            return {"found": str(self)}
        parts = {name: getattr(self, name) for name in _PARTS}
        return {name: _shortened(text) for name, text in parts.items() if text}

    def to_json(self) -> dict[str, Any]:
        """Return kind, message and parts of the error and of its faults."""
        parts = [fault.parts() for fault in self.faults[:_MOST_FAULTS]]
        answer = {"kind": type(self).__name__, "message": str(self), **self.parts()}
        return {**answer, **({"faults": parts} if parts else {})}


def _joined(faults: Sequence[MrdamperError]) -> str:
    """Return a line for each of the first faults, and how many more there are."""
    lines = [f"{fault}" for fault in faults[:_MOST_FAULTS]]
    more = [f"... and {len(faults) - _MOST_FAULTS} more like these"] if len(faults) > _MOST_FAULTS else []
    return "\n".join([*lines, *more])


def _shortened(text: str) -> str:
    """Return a text without the end of too many lines, and without the middle of too long ones."""
    lines = text.split("\n")
    more = [f"... and {len(lines) - _MOST_LINES} more lines"] if len(lines) > _MOST_LINES else []
    return "\n".join([*map(_cut, lines[:_MOST_LINES]), *more])


def _cut(line: str) -> str:
    """Return a line with its middle shortened if it is very long; the remedy at its end remains."""
    half = _LONGEST_LINE // 2
    if len(line) <= _LONGEST_LINE:
        return line
    return f"{line[:half]} ... ({len(line) - 2 * half} characters left out) ... {line[-half:]}"


class InputError(MrdamperError, ValueError):
    """Data, a file, a unit or an option that cannot be used as given."""

    exit_code: ClassVar[int] = 3


class EnvelopeError(InputError):
    """A value outside the valid range of a law or correlation."""


class EnvelopeWarning(UserWarning):
    """A card or a fluid is used outside the range it was identified in; the value is given all the same.

    Issued once per use, with the numbers, by ``warnings.warn``.
    """


class MissingExtraError(InputError):
    """An optional library is not installed; the message names the install command."""

    @classmethod
    def for_package(cls, what: str, package: str, extra: str) -> Self:
        """Return the error that a package of one of our extras is missing, and ``what`` needs it."""
        return cls(f"{package} is not installed", place=what, remedy=f"pip install 'mrdamper[{extra}]'")


class UsageError(InputError):
    """Options that exclude each other, or one that is missing: told before anything is read."""

    exit_code: ClassVar[int] = 2


class ConvergenceError(MrdamperError):
    """A fit or solution that did not reach its tolerance; the message states the reached accuracy."""

    exit_code: ClassVar[int] = 4


class CheckError(MrdamperError):
    """A result did not pass its own check; the message states the deviation."""

    exit_code: ClassVar[int] = 5
