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
_MESSAGE_LENGTH_MAX = 20_000  # characters
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
        super().__init__(found)

    def __str__(self) -> str:
        return _shorten(f"{self}")

    def __format__(self, _: str) -> str:
        """Return the complete message, for use inside another message."""
        if self.faults:
            more = len(self.faults) - _SHOWN_FAULTS_MAX
            rest = [f"... and {more} more like these"] if more > 0 else []
            return "\n".join([*map(format, self.faults[:_SHOWN_FAULTS_MAX]), *rest])
        message = f"{self.place}: {self.found}" if self.place else self.found
        message += f"; expected {self.expected}" if self.expected else ""
        mark = "; " if self.remedy[:1].islower() else ". "
        return f"{message}{mark}{self.remedy}" if self.remedy else message

    def prepend_place(self, place: str | PurePath) -> Self:
        """Return a copy of the error with a more complete place, such as "file: field".

        If the place of the error already begins with ``place``, the place is not changed.
        """
        moved = copy.copy(self)
        moved.faults = tuple(fault.prepend_place(place) for fault in self.faults)
        if self.place != str(place) and not self.place.startswith(f"{place}: "):
            moved.place = f"{place}: {self.place}" if self.place else str(place)
        return moved

    def renamed(self, name: str, other: str) -> Self:
        """Return this error with every occurrence of a file name replaced."""
        parts = {part: getattr(self, part).replace(name, other) for part in _PART_NAMES}
        return type(self)(**parts, faults=[fault.renamed(name, other) for fault in self.faults])

    def parts(self) -> dict[str, str]:
        """Return the non-empty values of place, found, expected and remedy."""
        if self.faults:
            return {"found": str(self)}
        parts = {name: getattr(self, name) for name in _PART_NAMES}
        return {name: _shorten(text) for name, text in parts.items() if text}


def _shorten(text: str) -> str:
    """Return a text without the middle if it is very long."""
    half, omitted = _MESSAGE_LENGTH_MAX // 2, len(text) - _MESSAGE_LENGTH_MAX
    return f"{text[:half]} ... ({omitted} characters omitted) ... {text[-half:]}" if omitted > 0 else text


class InputError(MrdamperError, ValueError):
    """Invalid data, file, unit or option."""

    exit_code: ClassVar[int] = 3


class EnvelopeError(InputError):
    """A value outside the valid range of a law or correlation."""


class EnvelopeWarning(UserWarning):
    """A model card or a fluid is used outside its identified range. The value is still returned.

    The warning states value and range. Each use of the model outside the range causes one warning.
    """


class MissingExtraError(InputError):
    """An optional library is not installed; the message names the install command."""

    @classmethod
    def for_package(cls, what: str, package: str, extra: str) -> Self:
        """Return the error for a ``package`` that is not installed.

        ``what`` describes the feature that requires the package, such as "the genetic algorithm". ``extra``
        is the name in ``pip install mrdamper[extra]``, which installs the package.
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
