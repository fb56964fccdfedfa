"""Draws of a card's parameters: equally likely dampers, from which every prediction's interval follows.

They are kept beside the card (``posterior.npz``: names, units, values), which stays the best fit. A file
belongs to the card with the same fingerprint of runs and the same best values.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper

__all__ = ["DRAWS_FILE", "CardDraws", "read_draws", "write_draws"]

DRAWS_FILE = "posterior.npz"
"""Its name in the folder of the card."""

_LOW, _HIGH = 5.0, 95.0  # percentiles of an interval of 90 %


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
        values = np.stack([of(each) for each in self.dampers(damper, most)])
        low, high = np.percentile(values, [_LOW, _HIGH], axis=0)
        return low, high

    @property
    def percentiles(self) -> dict[str, tuple[float, float]]:
        """The 5th and 95th percentile of each parameter."""
        low, high = np.percentile(self.values, [_LOW, _HIGH], axis=0)
        return {name: (float(a), float(b)) for name, a, b in zip(self.names, low, high, strict=True)}


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


def read_draws(folder: str | Path, damper: Damper) -> CardDraws | None:
    """Return the draws in a card's folder; None where there are none, or those of another card.

    Raises
    ------
    InputError
        The file is not one of draws.
    """
    path = Path(folder) / DRAWS_FILE
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as found:
            names = tuple(map(str, found["names"]))
            values, of = np.array(found["values"], dtype=np.float64), str(found["of"])
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"cannot be read: {error}", place=str(path), expected="draws as identify writes them"
        ) from error
    if values.ndim != 2 or values.shape[1] != len(names) or not np.isfinite(values).all() or not len(values):
        raise InputError(
            f"values have shape {values.shape}", place=str(path), expected=f"(draws, {len(names)})"
        )
    return CardDraws(names, values) if of == _digest(damper) else None


def _digest(damper: Damper) -> str:
    """Return what tells a damper from another one: a hash of its law and of its parameters' ten digits."""
    told = [damper.law.name, *(f"{name} {value:.9e}" for name, value in damper.parameters_and_lag.items())]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()
