"""Draws beside a card: what follows from them, and to which card they belong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.errors import InputError
from mrdamper.models.card_draws import DRAWS_FILE, CardDraws, draws_of, read_draws, write_draws
from mrdamper.models.card_schema import read_card, write_card
from tests.models.test_card import CARD

NAMES = ("yield_force.gain", "command_lag_s")
DRAWS = CardDraws(NAMES, np.column_stack([600.0 + np.arange(101.0), 1e-3 * np.arange(101.0)]))


@pytest.mark.parametrize(("most", "rows"), [(1, [0]), (2, [0, 100]), (5, [0, 25, 50, 75, 100])])
def test_fewer_dampers_than_draws_are_taken_evenly_from_first_to_last(most, rows):
    """The rest of each is as of the card's."""
    dampers = DRAWS.dampers(CARD.damper, most)
    assert [each.parameters["yield_force.gain"] for each in dampers] == [600.0 + row for row in rows]
    assert [each.command_lag_s for each in dampers] == pytest.approx([1e-3 * row for row in rows])
    assert {each.parameters["rho.rate"] for each in dampers} == {CARD.damper.parameters["rho.rate"]}


def test_no_draw_is_taken_twice():
    assert len(DRAWS.dampers(CARD.damper, 500)) == len(DRAWS) == 101


def test_an_interval_holds_nine_of_ten_draws():
    assert DRAWS.percentiles == {
        "yield_force.gain": pytest.approx((605.0, 695.0)), "command_lag_s": pytest.approx((0.005, 0.095)),
    }  # fmt: skip
    low, high = DRAWS.interval(
        CARD.damper, lambda damper: np.array([damper.parameters["yield_force.gain"], 1.0]), most=101
    )
    assert (low.tolist(), high.tolist()) == ([605.0, 1.0], [695.0, 1.0])


def test_draws_come_back_for_their_card_alone(tmp_path):
    write_card(CARD, tmp_path / "card.json")
    card = read_card(tmp_path / "card.json")
    with pytest.raises(InputError, match="is not there"):
        draws_of(card, 3)
    write_draws(DRAWS, card.damper, tmp_path / DRAWS_FILE)
    assert read_draws(tmp_path, card.damper).names == NAMES
    assert draws_of(card, 101) == DRAWS.dampers(card.damper, 101)
    assert draws_of(CARD, 0) == ()
    with pytest.raises(InputError, match="not read from a file"):
        draws_of(CARD, 3)
    other = CARD.damper.with_parameters({"rho.rate": CARD.damper.parameters["rho.rate"] * (1.0 + 1e-8)})
    with pytest.raises(InputError, match="draws are of another card"):
        read_draws(tmp_path, other)
    assert len(read_draws(tmp_path, replace(CARD.damper))) == 101


@pytest.mark.parametrize(
    "values",
    [np.ones((3, 1)), np.ones((3, 3)), np.ones(2), np.empty((0, 2)), np.array([[1.0, np.nan]])],
    ids=["narrow", "wide", "a row", "none", "not a number"],
)
def test_draws_of_another_shape_or_without_a_value_are_refused(tmp_path, values):
    write_draws(CardDraws(NAMES, values), CARD.damper, tmp_path / DRAWS_FILE)
    with pytest.raises(InputError, match=r"expected \(draws, 2\), finite"):
        read_draws(tmp_path, CARD.damper)


def test_a_file_that_holds_no_draws_is_refused(tmp_path):
    np.save(tmp_path / "one.npy", np.ones(3))
    for content in (b"", b"PK\x03\x04 cut", b"no archive", (tmp_path / "one.npy").read_bytes()):
        (tmp_path / DRAWS_FILE).write_bytes(content)
        with pytest.raises(InputError, match="cannot be read"):
            read_draws(tmp_path, CARD.damper)
