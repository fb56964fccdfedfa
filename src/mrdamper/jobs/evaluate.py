"""The job ``evaluate``: a card's error on runs. It loads nothing that fits, so that it answers at once."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mrdamper.data.prepare import Preparation
from mrdamper.data.records import Dataset
from mrdamper.errors import EnvelopeWarning
from mrdamper.identify import evaluate as scoring
from mrdamper.identify.scores import RunError
from mrdamper.jobs.intervals import CoefficientInterval, ForceInterval, coefficient_intervals, force_interval
from mrdamper.jobs.options import EvaluateOptions
from mrdamper.models.card import SPLITS, ModelCard
from mrdamper.models.card_draws import draws_of
from mrdamper.models.damper import Damper
from mrdamper.models.force_band import ForceBand
from mrdamper.results import JobResult
from mrdamper.runtime.pool import Pool

if TYPE_CHECKING:
    from mrdamper.identify.fit import Identification

_USUAL = EvaluateOptions()


@dataclass(frozen=True, slots=True, repr=False)
class EvaluateResult(JobResult):
    """The errors of a model on runs; it is the sequence of them, too."""

    _job = "evaluate"
    law: str
    errors: tuple[RunError, ...]
    notes: tuple[str, ...]  # where the runs leave what the card was identified on
    promised: Mapping[str, Mapping[str, float | int | None]]  # by the card, of its splits
    band: ForceBand | None = None  # that the card promises for new runs
    forces: tuple[ForceInterval, ...] = ()  # of every run, where posterior draws are followed
    coefficients: tuple[CoefficientInterval, ...] = ()
    command_unit: str = ""

    def __iter__(self) -> Iterator[RunError]:
        return iter(self.errors)

    def __len__(self) -> int:
        return len(self.errors)

    def __getitem__(self, k: int) -> RunError:
        return self.errors[k]


def evaluate(
    card: ModelCard | Damper | Identification,
    runs: Dataset,
    preparation: Preparation | None = None,
    options: EvaluateOptions = _USUAL,
) -> EvaluateResult:
    """Score a model on runs, prepared as the card says.

    Parameters
    ----------
    card : a card; also a damper alone, or a fit
    preparation : how the runs are prepared, in place of what the card says

    Raises
    ------
    InputError
        The runs cannot be prepared, or lack what the model needs; there are no posterior draws of this card.
    """
    posterior = draws_of(card, options.posterior) if isinstance(card, ModelCard) else ()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        errors = scoring.evaluate(card, runs, preparation=preparation)
    notes = tuple(f"{each.message!s}" for each in caught if issubclass(each.category, EnvelopeWarning))
    damper = card if isinstance(card, Damper) else card.damper
    promised = {}
    if isinstance(card, ModelCard):
        promised = {split: card.evidence.errors(split) for split in SPLITS}
    if not isinstance(card, ModelCard):
        return EvaluateResult(damper.law.name, errors, notes, promised)
    found = EvaluateResult(damper.law.name, errors, notes, promised, card.force_band)
    if not posterior:
        return found
    prepared = scoring.prepare_for(card, runs, preparation)
    forces = Pool().map(lambda run: force_interval(damper, posterior, run), prepared)
    return replace(
        found,
        forces=tuple(forces),
        coefficients=coefficient_intervals(damper, posterior, card.envelope.command),
        command_unit=damper.command_unit,
    )
