"""The job ``predict``: a card's error on runs. It loads nothing that fits, so that it answers at once."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.errors import EnvelopeWarning
from mrdamper.identify import predict as scoring
from mrdamper.identify.scores import RunError
from mrdamper.models.card import SPLITS, ModelCard
from mrdamper.models.damper import Damper

__all__ = ["PredictResult", "predict"]


@dataclass(frozen=True, slots=True)
class PredictResult:
    """The errors of a model on runs; it is the sequence of them, too."""

    law: str
    errors: tuple[RunError, ...]
    notes: tuple[str, ...]  # where the runs leave what the card was identified on
    promised: Mapping[str, Mapping[str, float | int | None]]  # by the card, of its splits

    def __iter__(self) -> Iterator[RunError]:
        return iter(self.errors)

    def __len__(self) -> int:
        return len(self.errors)

    def __getitem__(self, k: int) -> RunError:
        return self.errors[k]


def predict(
    card: ModelCard | Damper | scoring.FittedDamper, runs: Dataset, preparation: Preparation | None = None
) -> PredictResult:
    """Score a model on runs, prepared as the card says.

    Parameters
    ----------
    card : a card; also a damper alone, or a fit
    preparation : how the runs are prepared, in place of what the card says

    Raises
    ------
    InputError
        The runs cannot be prepared, or lack what the model needs.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        errors = scoring.predict(card, runs, preparation=preparation)
    notes = tuple(str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning))
    damper = card if isinstance(card, Damper) else card.damper
    promised = {}
    if isinstance(card, ModelCard):
        promised = {split: card.evidence.errors(split) for split in SPLITS}
        if card.upgraded_from is not None:
            notes += (
                f"the card was written in schema version {card.upgraded_from}, without a hash: only its "
                "excerpt vouches for its numbers; identify again to have one that is signed",
            )
    return PredictResult(damper.law.name, errors, notes, promised)
