"""Errors a caller can act on, each with the exit code of the command line.

Messages say the place, what was found, what was expected and the remedy. A plain ``Exception`` that
escapes from this package is a fault of ours (exit code 1), never a way of reporting bad input.
"""

from __future__ import annotations

from typing import ClassVar

__all__ = [
    "CheckError",
    "ConvergenceError",
    "EnvelopeError",
    "EnvelopeWarning",
    "InputError",
    "MissingExtraError",
    "MrdamperError",
]


_LONGEST_LINE = 4000
_MOST_LINES = 200


class MrdamperError(Exception):
    """Base of all errors that mrdamper raises on purpose.

    What was found stands in the message as it is; one of any size is cut, so that the rest can be read.
    """

    exit_code: ClassVar[int] = 1

    def __str__(self) -> str:
        lines = super().__str__().split("\n")
        more = [f"... and {len(lines) - _MOST_LINES} more lines"] if len(lines) > _MOST_LINES else []
        return "\n".join([*map(_cut, lines[:_MOST_LINES]), *more])


def _cut(line: str) -> str:
    """Return a line with the middle of a very long one left out: the remedy stands at its end."""
    half = _LONGEST_LINE // 2
    if len(line) <= _LONGEST_LINE:
        return line
    return f"{line[:half]} ... ({len(line) - 2 * half} characters left out) ... {line[-half:]}"


class InputError(MrdamperError, ValueError):
    """Data, a file, a unit or an option that cannot be used as given."""

    exit_code: ClassVar[int] = 3


class EnvelopeError(InputError):
    """A value outside the range in which a law or correlation holds."""


class EnvelopeWarning(UserWarning):
    """A card or a fluid is used outside the range it was identified in; the value is given all the same.

    Issued once per use, with the numbers, by ``warnings.warn``.
    """


class MissingExtraError(InputError):
    """An optional library is not installed; the message names the install command."""


class ConvergenceError(MrdamperError):
    """A fit or solve that did not reach its tolerance; the message says how far it came."""

    exit_code: ClassVar[int] = 4


class CheckError(MrdamperError):
    """Something was made and did not pass its own check; the message says by how much."""

    exit_code: ClassVar[int] = 5
