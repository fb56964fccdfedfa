"""Posterior samples of a model card's parameters, for intervals of predictions.

The samples are stored in the folder of the card, in ``posterior.npz`` (names, units, values). The card itself
contains the best fit. To detect samples of a different card, ``posterior.npz`` also contains a hash of the
card's hysteresis law and parameters.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.models.card import ModelCard
from mrdamper.models.damper import Damper

DRAWS_FILE = "posterior.npz"
"""Name of the file with the posterior samples, in the folder of the card."""

INTERVAL_PROBABILITY = 0.9
"""Probability of every interval from posterior samples. The ends are the 5th and the 95th percentile."""


@dataclass(frozen=True, slots=True, eq=False)
class CardDraws:
    """Posterior samples of the parameters of a damper, with equal weights."""

    names: tuple[str, ...]
    values: FloatArray  # shape (samples, parameters), SI

    def __len__(self) -> int:
        return len(self.values)

    def dampers(self, damper: Damper, most: int) -> tuple[Damper, ...]:
        """Return copies of ``damper`` with the parameters of at most ``most`` samples."""
        rows = np.unique(np.linspace(0, len(self) - 1, min(most, len(self))).round().astype(np.intp))
        return tuple(
            damper.with_parameters(dict(zip(self.names, row, strict=True)))
            for row in self.values[rows].tolist()
        )

    @property
    def standard_deviation(self) -> dict[str, float]:
        """Return the standard deviation of each parameter by name."""
        return dict(zip(self.names, np.std(self.values, axis=0, ddof=1).tolist(), strict=True))

    @property
    def percentiles(self) -> dict[str, tuple[float, float]]:
        """Return the 5th and 95th percentile of each parameter by name."""
        low, high = percentile_ends(self.values)
        return {name: (float(a), float(b)) for name, a, b in zip(self.names, low, high, strict=True)}


def percentile_ends(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the 5th and 95th percentile over the first axis, shape (samples, ...)."""
    tail = 50.0 * (1.0 - INTERVAL_PROBABILITY)
    low, high = np.percentile(values, [tail, 100.0 - tail], axis=0)
    return np.asarray(low), np.asarray(high)


def draws_of(card: ModelCard, most: int) -> tuple[Damper, ...]:
    """Return at most ``most`` dampers from the posterior samples of a card; empty if ``most`` is 0.

    Raises
    ------
    InputError
        If the card was not read from a file, or ``read_draws`` fails.
    """
    if not most:
        return ()
    if not card.file:
        raise InputError(
            "no posterior samples, because it was not read from a file",
            place="card",
            expected=f"the card.json of a folder with {DRAWS_FILE}",
            remedy="Save it, and read it again",
        )
    return read_draws(Path(card.file).parent, card.damper).dampers(card.damper, most)


def write_draws(draws: CardDraws, damper: Damper, path: str | Path) -> None:
    """Write posterior samples of the parameters of a damper to a file."""
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
    """Read the posterior samples that are stored in the folder of a card.

    Raises
    ------
    InputError
        If the file is missing or invalid, or its samples belong to a different card.
    """
    path = Path(folder) / DRAWS_FILE
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            draws = CardDraws(
                tuple(map(str, stored["names"])), np.asarray(stored["values"], dtype=np.float64)
            )
            digest = str(stored["of"])
        if (
            not len(draws)
            or draws.values.shape[1:] != (len(draws.names),)
            or not np.isfinite(draws.values).all()
        ):
            raise ValueError(f"values have shape {draws.values.shape}, or are not finite")
        if digest != _digest(damper):
            raise ValueError("its samples belong to another card")
    except (OSError, TypeError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(
            f"no posterior samples of this card: {error}",
            place=str(path),
            expected="the file that was written with the card",
            remedy="Fit again: mrdamper fit --posterior 1000",
        ) from error
    return draws


def _digest(damper: Damper) -> str:
    lines = [damper.law.name, *(f"{name} {value:.9e}" for name, value in damper.parameters_and_lag.items())]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
