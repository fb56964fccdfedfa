"""What a long search has already paid for: finished pieces of its work, by name.

A search that is given a ledger asks it before each piece of work and tells it after; a run that was killed
goes on from what was told, and comes to the same numbers as one that was not. This is the protocol; the file
that outlives a kill is the business of ``app``.

What is kept is plain data (numbers, words, lists and mappings of them) that comes back exactly as it was
given: a float keeps all its digits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from mrdamper.identify.problem import move
from mrdamper.models.damper import LAG, Damper

__all__ = ["Ledger", "NoLedger", "Section", "damper_of", "numbers_of"]


class Ledger(Protocol):
    """Finished pieces of work by key; whoever keeps one chooses keys that no other piece of the run has."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return what was kept under ``key``, or None when that piece is still to be done."""

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        """Keep a finished piece; it outlives the process when this returns."""


class NoLedger:
    """Remembers nothing: every piece is done."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return None

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        return None


class Section:
    """A part of a ledger under a name: ``start-0`` of a fit without run a is not that of the whole."""

    def __init__(self, ledger: Ledger | None, name: str) -> None:
        self._ledger = NoLedger() if ledger is None else ledger
        self._name = name

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return self._ledger.recall(f"{self._name}/{key}")

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        self._ledger.keep(f"{self._name}/{key}", value)


def numbers_of(damper: Damper) -> dict[str, float]:
    """Return every number of a damper by its flat name, the command lag among them."""
    return {**damper.numbers, LAG: damper.command_lag_s}


def damper_of(template: Damper, numbers: Mapping[str, float]) -> Damper:
    """Return the template with all numbers replaced."""
    return move(template, dict(numbers))
