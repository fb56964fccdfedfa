"""A job never replaces an input file, even if the output path is a link to the input file."""

from __future__ import annotations

import os

import pytest

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import atomic_output


@pytest.mark.parametrize("link", [None, os.symlink, os.link], ids=["itself", "symlink", "hard link"])
def test_output_never_replaces_input_file(link, tmp_path):
    source = tmp_path / "card.json"
    source.write_text("kept", encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    if link is None:
        out = tmp_path
    else:
        link(source, out / "card.json")
    with pytest.raises(
        InputError, match=r"would replace .*card.json, which this job reads; nothing was changed"
    ):
        _write(out, source, ("another.txt", "card.json"))
    assert source.read_text(encoding="utf-8") == "kept"
    assert not (out / "another.txt").exists()
    _write(out, source, ("another.txt",))
    assert (out / "another.txt").read_text(encoding="utf-8") == "new"


def _write(out, source, names):
    with atomic_output(out, [source]) as stage:
        for name in names:
            (stage / name).write_text("new", encoding="utf-8")
