"""Draws of a card's parameters: equally likely dampers, from which every prediction's interval follows.

They are kept beside the card (``posterior.npz``: names, units, values), which stays the best fit. A file
belongs to the card with the same fingerprint of runs and the same best values.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError, command, option
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper

DRAWS_FILE = "posterior.npz"
"""Its name in the folder of the card."""

PROBABILITY = 0.9
"""Of every interval that is taken from draws: from their 5th to their 95th percentile."""


@dataclass(frozen=True, slots=True, eq=False)
class CardDraws:
    """Parameters of equally likely dampers."""

    names: tuple[str, ...]
    values: FloatArray  # shape (draws, parameters), SI

    def __len__(self) -> int:
        return len(self.values)

    def dampers(self, damper: Damper, most: int) -> tuple[Damper, ...]:
        """Return at most so many of the dampers, evenly over the draws; the rest is as of ``damper``."""
        at = np.unique(np.linspace(0, len(self) - 1, min(most, len(self))).round().astype(np.intp))
        rows = self.values[at].tolist()
        return tuple(damper.with_parameters(dict(zip(self.names, row, strict=True))) for row in rows)

    def interval(
        self, damper: Damper, of: Callable[[Damper], FloatArray], most: int = 100
    ) -> tuple[FloatArray, FloatArray]:
        """Return the 5th and 95th percentile, element by element, of what follows from a damper."""
        return percentile_ends(np.stack([of(each) for each in self.dampers(damper, most)]))

    @property
    def standard_deviation(self) -> dict[str, float]:
        """The standard deviation of each parameter."""
        return dict(zip(self.names, np.std(self.values, axis=0, ddof=1).tolist(), strict=True))

    @property
    def percentiles(self) -> dict[str, tuple[float, float]]:
        """The 5th and 95th percentile of each parameter."""
        low, high = percentile_ends(self.values)
        return {name: (float(a), float(b)) for name, a, b in zip(self.names, low, high, strict=True)}


def percentile_ends(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the 5th and 95th percentile over the first axis, shape (draws, ...)."""
    tail = 50.0 * (1.0 - PROBABILITY)
    low, high = np.percentile(values, [tail, 100.0 - tail], axis=0)
    return np.asarray(low), np.asarray(high)


def draws_of(card: ModelCard, most: int) -> tuple[Damper, ...]:
    """Return at most so many equally likely dampers, from the draws beside a card; none where 0 are asked.

    Raises
    ------
    InputError
        The card was not read from a file, no draws lie beside it, or they are those of another card.
    """
    if not most:
        return ()
    if not card.file:
        raise InputError(
            "no posterior draws: it was not read from a file",
            place="card",
            expected=f"the card.json of a folder with {DRAWS_FILE}",
            remedy="Save it, and read it again",
        )
    return read_draws(Path(card.file).parent, card.damper).dampers(card.damper, most)


def write_draws(draws: CardDraws, damper: Damper, path: str | Path) -> None:
    """Write draws of a damper's parameters."""
    units = [damper.units.get(name, "s") for name in draws.names]
    with Path(path).open("wb") as file:
        np.savez_compressed(
            file,
            names=np.array(draws.names),
            units=np.array(units),
            values=draws.values,
            of=np.array(_digest(damper)),
        )


def read_draws(folder: str | Path, damper: Damper) -> CardDraws:
    """Return the draws in a card's folder.

    Raises
    ------
    InputError
        There is no file of draws, it cannot be read, or its draws are those of another card.
    """
    path = Path(folder) / DRAWS_FILE
    remedy = f"Identify again: {command('fit')} {option('posterior', '1000')}"
    if not path.is_file():
        raise InputError(
            "is not there", place=str(path), expected="posterior draws beside the card", remedy=remedy
        )
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            names = tuple(map(str, found["names"]))
            values, of = np.array(found["values"], dtype=np.float64), str(found["of"])
    except (OSError, TypeError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(
            f"cannot be read: {error}",
            place=str(path),
            expected="draws as identify writes them",
            remedy=remedy,
        ) from error
    if values.ndim != 2 or values.shape[1] != len(names) or not np.isfinite(values).all() or not len(values):
        raise InputError(
            f"values have shape {values.shape}",
            place=str(path),
            expected=f"(draws, {len(names)}), finite",
            remedy=remedy,
        )
    if of != _digest(damper):
        raise InputError(
            f"its draws are of another card ({of[:12]})",
            place=str(path),
            expected=f"draws of the card beside it ({_digest(damper)[:12]})",
            remedy=remedy,
        )
    return CardDraws(names, values)


def _digest(damper: Damper) -> str:
    """Return what tells a damper from another one: a hash of its law and of its parameters' ten digits."""
    told = [damper.law.name, *(f"{name} {value:.9e}" for name, value in damper.parameters_and_lag.items())]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()
