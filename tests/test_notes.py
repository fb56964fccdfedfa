"""Notes: data that reads as its words."""

from __future__ import annotations

import copy
import json
import pickle

from mrdamper.notes import Note, note_kinds

NOTE = Note(
    "limit_reached",
    "the limit, {limit_degC:.0f} degC, is reached after {after_s:.0f} s",
    limit_degC=130.0,
    after_s=61.4,
)


def test_a_note_reads_as_its_words_and_holds_its_figures():
    assert NOTE == "the limit, 130 degC, is reached after 61 s"
    assert (NOTE.kind, NOTE.fields["after_s"]) == ("limit_reached", 61.4)
    assert json.loads(json.dumps([NOTE])) == [str(NOTE)]


def test_it_comes_whole_out_of_another_process():
    for same in (pickle.loads(pickle.dumps(NOTE)), copy.deepcopy(NOTE)):
        assert (same, same.kind, same.fields) == (NOTE, NOTE.kind, NOTE.fields)


def test_plain_words_have_no_kind():
    assert note_kinds(["a word", NOTE]) == [{"kind": "limit_reached", "limit_degC": 130.0, "after_s": 61.4}]
