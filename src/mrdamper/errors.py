"""Exceptions, each with the exit code of the command line.

    MrdamperError                     1  base class, which is never raised itself
    ├── InputError                    3  invalid data, file, unit or option
    │   ├── EnvelopeError             3  a value outside the valid range of a law or correlation
    │   ├── MissingExtraError         3  an optional library is not installed
    │   └── UsageError                2  options that exclude each other, or a missing option
    ├── ConvergenceError              4  a fit or solve that did not reach its tolerance
    └── CheckError                    5  a result did not pass its own check

An error contains the place, the found value, the expected value and the remedy as plain text. Messages use
the names that options and commands have on the command line. Any other ``Exception`` is an internal error
(exit code 1). Invalid input never causes an internal error.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import PurePath
from typing import ClassVar, Self

_PART_NAMES = ("place", "found", "expected", "remedy")
_LINE_LENGTH_MAX = 4000
_LINE_COUNT_MAX = 200
_SHOWN_FAULTS_MAX = 8  # faults in one message


class MrdamperError(Exception):
    """Base of all errors that mrdamper raises on purpose.

    Parameters
    ----------
    found, expected : the actual and the expected value
    place : file, run or field with the fault
    remedy : action of the user, as a sentence, or as a clause if it starts with a small letter
    faults : several errors that are reported together; the other arguments are then empty

    The message consists of place, found, expected and remedy, in this order. Each of several faults has its
    own line. Very long texts are cut.
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
        super().__init__(self._message())

    def _message(self) -> str:
        if self.faults:
            return "\n".join(_first([f"{fault}" for fault in self.faults], _SHOWN_FAULTS_MAX, "like these"))
        message = f"{self.place}: {self.found}" if self.place else self.found
        message += f"; expected {self.expected}" if self.expected else ""
        mark = "; " if self.remedy[:1].islower() else ". "
        return f"{message}{mark}{self.remedy}" if self.remedy else message

    def move_to(self, place: str) -> None:
        """Change the place, because only the caller has the path of a file that was passed as a value."""
        self.place = place
        self.args = (self._message(),)

    def prepend_place(self, place: str | PurePath) -> Self:
        """Return this error with a place in front of its place, such as the file in front of the field.

        The place is not repeated if the error's place already begins with it.
        """
        moved = copy.copy(self)
        moved.faults = tuple(fault.prepend_place(place) for fault in self.faults)
        if self.place != str(place) and not self.place.startswith(f"{place}: "):
            moved.move_to(f"{place}: {self.place}" if self.place else str(place))
        return moved

    def renamed(self, name: str, other: str) -> Self:
        """Return this error with every occurrence of a file name replaced."""
        parts = {part: getattr(self, part).replace(name, other) for part in _PART_NAMES}
        return type(self)(**parts, faults=[fault.renamed(name, other) for fault in self.faults])

    def __str__(self) -> str:
        return _shorten(self.args[0])

    def __format__(self, form: str) -> str:
        """Return the complete message, for use inside another message."""
        return format(self.args[0], form)

    def parts(self) -> dict[str, str]:
        """Return the non-empty values of place, found, expected and remedy."""
        if self.faults:
            return {"found": str(self)}
        parts = {name: getattr(self, name) for name in _PART_NAMES}
        return {name: _shorten(text) for name, text in parts.items() if text}


def _first(lines: Sequence[str], most: int, words: str) -> list[str]:
    """Return the first lines, and one line with the number of omitted lines."""
    return [*lines[:most], *([f"... and {len(lines) - most} more {words}"] if len(lines) > most else [])]


def _shorten(text: str) -> str:
    """Return a text with a limited number of lines. The middle of very long lines is cut."""
    half = _LINE_LENGTH_MAX // 2
    lines = [
        line
        if len(line) <= _LINE_LENGTH_MAX
        else f"{line[:half]} ... ({len(line) - 2 * half} characters left out) ... {line[-half:]}"
        for line in text.split("\n")
    ]
    return "\n".join(_first(lines, _LINE_COUNT_MAX, "lines"))


class InputError(MrdamperError, ValueError):
    """Invalid data, file, unit or option."""

    exit_code: ClassVar[int] = 3


class EnvelopeError(InputError):
    """A value outside the valid range of a law or correlation."""


class EnvelopeWarning(UserWarning):
    """A model card or a fluid is used outside its identified range. The value is still returned.

    ``warnings.warn`` issues the warning once per use, with value and range.
    """


class MissingExtraError(InputError):
    """An optional library is not installed; the message names the install command."""

    @classmethod
    def for_package(cls, what: str, package: str, extra: str) -> Self:
        """Return the error for a ``package`` that is not installed.

        ``what`` names the function that requires it, such as "the genetic algorithm". ``extra`` is the
        optional part of mrdamper that installs it.
        """
        return cls(f"{package} is not installed", place=what, remedy=f"pip install 'mrdamper[{extra}]'")


class UsageError(InputError):
    """Options that exclude each other, or a missing option. The error is raised before files are read."""

    exit_code: ClassVar[int] = 2


class ConvergenceError(MrdamperError):
    """A fit or solution that did not reach its tolerance; the message states the reached accuracy."""

    exit_code: ClassVar[int] = 4


class CheckError(MrdamperError):
    """A result did not pass its own check; the message states the deviation."""

    exit_code: ClassVar[int] = 5
