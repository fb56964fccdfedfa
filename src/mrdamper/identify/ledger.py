"""What a long search has already paid for: finished pieces of its work, by name.

A search that is given a ledger asks it before each piece of work and tells it after; a run that was killed
goes on from what was told, and comes to the same numbers as one that was not. This is the protocol; the file
that outlives a kill is the business of ``app``.

What is kept is plain data (numbers, words, lists and mappings of them) that comes back exactly as it was
given: a float keeps all its digits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from mrdamper.identify.problem import Estimate, FitResult, Start, move
from mrdamper.models.damper import Damper
from mrdamper.models.simulate import LAG

__all__ = ["Ledger", "NoLedger", "Section", "damper_of", "keep_fit", "numbers_of", "recall_fit"]


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


def keep_fit(ledger: Ledger, key: str, template: Damper, result: FitResult) -> None:
    """Keep a fit that came to its end; one that was interrupted, or is no template with numbers, is not."""
    numbers = numbers_of(result.damper)
    if result.cancelled or damper_of(template, numbers) != result.damper:
        return
    ledger.keep(
        key,
        {
            "numbers": numbers,
            "method": result.method,
            "cost_percent": result.cost_percent,
            "estimates": [asdict(estimate) for estimate in result.estimates],
            "correlation": np.asarray(result.correlation).tolist(),
            "starts": [asdict(start) for start in result.starts],
            "offsets_N": dict(result.offsets_N),
            "history": list(result.history),
            "seed": result.seed,
            "cpu_s": result.cpu_s,
            "notes": list(result.notes),
        },
    )


def recall_fit(ledger: Ledger, key: str, template: Damper) -> FitResult | None:
    """Return a fit that was kept, or None."""
    found = ledger.recall(key)
    if found is None:
        return None
    count = len(found["estimates"])
    return FitResult(
        damper=damper_of(template, found["numbers"]),
        method=found["method"],
        cost_percent=found["cost_percent"],
        estimates=tuple(Estimate(**estimate) for estimate in found["estimates"]),
        correlation=np.array(found["correlation"], dtype=np.float64).reshape(count, count),
        starts=tuple(Start(**start) for start in found["starts"]),
        offsets_N=found["offsets_N"],
        history=tuple(found["history"]),
        seed=found["seed"],
        cpu_s=found["cpu_s"],
        cancelled=False,
        notes=tuple(found["notes"]),
    )
