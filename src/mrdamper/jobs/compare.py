"""The job ``compare``: two dampers, or one before and after."""

from __future__ import annotations

from pathlib import Path

from mrdamper.models.card import ModelCard
from mrdamper.models.comparison import Comparison, compare_cards


def compare(first: ModelCard, second: ModelCard) -> Comparison:
    """Compare two cards inside their common envelope; differences are second minus first.

    Raises
    ------
    InputError
        The commands are in different units, or there is no common envelope.
    """
    return compare_cards(first, second, names=_names(first.file, second.file))


def _names(*files: str) -> tuple[str, str]:
    """Return the names of the cards: that of the file, or of its folder if the file is called card."""
    paths = [Path(file) for file in files]
    first, second = (path.absolute().parent.name if path.stem == "card" else path.stem for path in paths)
    return (first, second) if first != second and first and second else ("first", "second")
