"""The job ``evaluate`` returns the errors of a card on runs, next to the training errors of the card."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrdamper.data.prepare import prepare_run
from mrdamper.errors import InputError
from mrdamper.excitation import Sine
from mrdamper.jobs.evaluate import evaluate
from mrdamper.jobs.inputs import read_dataset, read_files
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import read_card
from mrdamper.models.simulate import simulate
from mrdamper.quantities import ZERO_CELSIUS_K
from tests.data.rig_files import write_csv
from tests.support.campaigns import make_run
from tests.support.cards import write_card_of


@pytest.fixture(scope="module")
def card(tmp_path_factory) -> ModelCard:
    return read_card(write_card_of(tmp_path_factory.mktemp("evaluate") / "card.json"))


def run_of(card, amplitude=0.008, gain=1.0):
    run = make_run(Sine(amplitude, 0.5), duration=6.0)
    run = replace(run, temperature=np.full(len(run), 40.0 + ZERO_CELSIUS_K))
    return replace(run, force=gain * simulate(card.damper, prepare_run(run).trajectory))


def test_evaluation_gives_known_error(card):
    run = run_of(card, gain=1.1)
    found, bare = evaluate(card, read_dataset([run])), evaluate(card.damper, read_dataset([run]))
    assert set(found.promised) == {"training", "held_out"}
    assert bare.promised == {}
    for each in (found, bare):
        assert (len(each), [error.name for error in each], each[0].name) == (1, ["run"], "run")
        assert each[0].nrmse_percent == pytest.approx(100.0 * 0.1 / 1.1, rel=0.1)
        assert each.notes == ()


def test_runs_outside_envelope_are_noted(card):
    far = evaluate(card, read_dataset([run_of(card, amplitude=0.02)]))
    (note,) = far.notes
    assert "displacement" in note


def test_flip_force_option_reverses_objects_and_files(card, tmp_path):
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
