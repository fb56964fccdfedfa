"""Posterior samples are stored in a file next to their card."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.models.card_draws import DRAWS_FILE, CardDraws, draws_of, read_draws, write_draws
from mrdamper.models.card_schema import read_card, write_card
from tests.models.test_card import CARD

NAMES = ("yield_force.gain", "command_lag_s")
DRAWS = CardDraws(NAMES, np.column_stack([600.0 + np.arange(101.0), 1e-3 * np.arange(101.0)]))


@pytest.mark.parametrize(("most", "rows"), [(2, [0, 100]), (5, [0, 25, 50, 75, 100]), (500, range(101))])
def test_posterior_dampers_are_evenly_spaced_samples(most, rows):
    """Each selected sample is used once. Parameters without samples keep the values of the card."""
    dampers = DRAWS.dampers(CARD.damper, most)
    assert [each.parameters["yield_force.gain"] for each in dampers] == [600.0 + row for row in rows]
    assert [each.command_lag_s for each in dampers] == pytest.approx([1e-3 * row for row in rows])
    assert {each.parameters["rho.rate"] for each in dampers} == {CARD.damper.parameters["rho.rate"]}


def test_posterior_samples_of_another_card_are_rejected(tmp_path):
    write_card(CARD, tmp_path / "card.json")
    card = read_card(tmp_path / "card.json")
    with pytest.raises(InputError, match="No such file"):
        draws_of(card, 3)
    write_draws(DRAWS, card.damper, tmp_path / DRAWS_FILE)
    assert draws_of(card, 101) == DRAWS.dampers(card.damper, 101)
    assert draws_of(CARD, 0) == ()
    with pytest.raises(InputError, match="not read from a file"):
        draws_of(CARD, 3)
    other = CARD.damper.with_parameters({"rho.rate": CARD.damper.parameters["rho.rate"] * (1.0 + 1e-8)})
    with pytest.raises(InputError, match="belong to another card"):
        read_draws(tmp_path, other)


@pytest.mark.parametrize("values", [np.ones((3, 1)), np.ones(2), np.empty((0, 2)), np.array([[1.0, np.nan]])])
def test_invalid_posterior_samples_are_rejected(tmp_path, values):
    write_draws(CardDraws(NAMES, values), CARD.damper, tmp_path / DRAWS_FILE)
    with pytest.raises(InputError, match="values have shape"):
        read_draws(tmp_path, CARD.damper)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut", b"no archive"])
def test_damaged_posterior_file_is_rejected(tmp_path, content):
    (tmp_path / DRAWS_FILE).write_bytes(content)
    with pytest.raises(InputError, match="no posterior samples of this card"):
        read_draws(tmp_path, CARD.damper)
