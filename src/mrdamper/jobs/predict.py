"""``mrdamper predict``: a card's error on runs. It loads nothing that fits, so that it answers at once."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from mrdamper.errors import EnvelopeWarning
from mrdamper.identify import predict as scoring
from mrdamper.jobs.inputs import read_dataset
from mrdamper.models.card_schema import read_card
from mrdamper.report import answers
from mrdamper.runtime.outputs import atomic_output, write_table
from mrdamper.schema import Json

__all__ = ["predict"]


def predict(
    card: Path,
    paths: Sequence[str | Path],
    *,
    channels: Path | None = None,
    law: str | None = None,
    out: Path | None = None,
    flip_force: bool = False,
) -> Json:
    """Score a card on runs, prepared as the card says; with ``out`` write errors.csv there.

    ``law`` is the ``file.py:Class`` of a user's own law, for a card that was identified with one.
    """
    own = None
    if law is not None:
        from mrdamper.identify.fit import resolve_law

        own = resolve_law(law)[0]
    model = read_card(card, python_law=own)
    dataset = read_dataset(paths, channels, flip_force=flip_force)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", EnvelopeWarning)
        errors = scoring.predict(model, dataset)
    answer: Json = {
        "card": str(card),
        "law": model.damper.law.name,
        "runs": [scoring.row(error) for error in errors],
        "summary": answers.summaries(errors),
        "by_temperature": answers.by_temperature(errors),
        "notes": [str(each.message) for each in caught if issubclass(each.category, EnvelopeWarning)],
    }
    if out is not None:
        with atomic_output(out) as beside:
            write_table(beside / "errors.csv", [scoring.row(error) for error in errors])
    return answer
