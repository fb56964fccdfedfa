"""The job ``evaluate``: compute the error of a model card on runs.

Modules for fits are not imported, so that the job starts fast.
"""

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
    """The errors of a model on runs, force intervals and notes. The object is a sequence of the errors."""

    _job = "evaluate"
    law: str
    errors: tuple[RunError, ...]
    notes: tuple[str, ...]  # statements about runs that are outside the envelope of the card
    promised: Mapping[str, Mapping[str, float | int | None]]  # errors that are stored in the card, by split
    band: ForceBand | None = None  # expected error of new runs, from the card
    forces: tuple[ForceInterval, ...] = ()  # 90 % interval of every run; empty without posterior samples
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
    """Prepare runs as stated in the card, and compute the errors of a model on them.

    Parameters
    ----------
    card : model card, damper or fit
    preparation : preparation of the runs instead of the preparation in the card

    Raises
    ------
    InputError
        If the runs are invalid or lack a channel that the model needs, or if requested posterior samples are
        missing.
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
