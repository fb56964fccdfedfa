"""The job ``evaluate``: what a card promised beside what it does, and what would mend a broken promise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.jobs.evaluate import evaluate, next_tests
from mrdamper.jobs.inputs import read_dataset, read_files
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.force_band import ForceBand
from mrdamper.models.simulate import simulate
from mrdamper.notes import Note
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.data.example_runs import make_run
from tests.data.rig_files import write_csv
from tests.support.tracked import write_a_card

BAND = ForceBand(
    share=0.9,
    factor=1.0,
    run_share=0.1,
    base_N=10.0,
    expected_nrmse_percent=4.0,
    worst_nrmse_percent=8.0,
    left_out="motions",
    folds=4,
)


@pytest.fixture(scope="module")
def card(tmp_path_factory) -> ModelCard:
    return read_card(write_a_card(tmp_path_factory.mktemp("evaluate") / "card.json"))


def run_of(card, amplitude=0.008, gain=1.0):
    """Return a run whose force is the card's, times a gain."""
    run = make_run(Sine(amplitude, 0.5), duration=6.0)
    run = replace(run, temperature=np.full(len(run), 40.0 + ZERO_CELSIUS_K))
    return replace(run, force=gain * simulate(card.damper, prepare_run(run).trajectory))


def test_a_card_promises_and_a_damper_does_not(card):
    run = run_of(card, gain=1.1)
    found, bare = evaluate(card, read_dataset([run])), evaluate(card.damper, read_dataset([run]))
    assert set(found.promised) == {"training", "held_out"}
    assert bare.promised == {}
    for each in (found, bare):
        assert (len(each), [error.name for error in each], each[0].name) == (1, ["run"], "run")
        assert each[0].nrmse_percent == pytest.approx(100.0 * 0.1 / 1.1, rel=0.1)
        assert each.notes == ()


def test_runs_beyond_the_envelope_and_cards_without_a_hash_are_told(card):
    far = evaluate(card, read_dataset([run_of(card, amplitude=0.02)]))
    assert [note.kind for note in far.notes if isinstance(note, Note)] == ["beyond_envelope"]
    old = evaluate(replace(card, upgraded_from=2), read_dataset([run_of(card)]))
    assert [note.kind for note in old.notes if isinstance(note, Note)] == ["not_signed"]
    assert "schema version 2" in str(old.notes[0])


@pytest.mark.parametrize(
    ("split", "nrmse", "inside", "broken"),
    [
        ("held_out", 8.1, 90.0, True), ("held_out", 8.0, 60.0, False), ("held_out", 1.0, 59.9, True),
        ("held_out", 1.0, None, True), ("training", 50.0, 0.0, False),
    ],
)  # fmt: skip
def test_a_new_run_that_breaks_the_promise_is_the_next_test(card, split, nrmse, inside, broken):
    """It errs by more than any that was left out, or the band holds less than three fifths of it."""
    (error,) = evaluate(card, read_dataset([run_of(card)]))
    worst = replace(error, name="worst", split=split, nrmse_percent=nrmse, in_band_percent=inside or 0.0)
    fair = replace(error, name="fair", split="held_out", nrmse_percent=0.5, in_band_percent=95.0)
    planned = [{"sentence": "a sine at 2 A"}, {"motion": "sine"}]
    said = next_tests([fair, worst], BAND, planned)
    assert len(said) == 1 + broken
    assert said[-1] == "a sine at 2 A"
    assert not broken or said[0].startswith("identify again with worst among the runs")
    assert next_tests([fair, worst], None, planned) == ("a sine at 2 A",)


def test_runs_are_taken_with_files_and_turned_together(card, tmp_path):
    write_csv(tmp_path / "file.csv")
    given = run_of(card)
    plain = read_dataset([given, tmp_path / "file.csv"])
    turned = read_dataset([given, tmp_path / "file.csv"], flip_force=True)
    assert plain.names == ("run", "file")
    for one, other in zip(plain, turned, strict=True):
        np.testing.assert_array_equal(other.force, -one.force)
    assert read_dataset(plain) is plain
    assert read_files([given]).runs == (given,)
    assert [run.name for run in read_files([given, tmp_path / "file.csv"]).runs] == ["run", "file"]
    for read in (read_dataset, read_files):
        with pytest.raises(InputError):
            read([])
