"""The two ways to a column's cells, by Python and by Polars, come to the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrdamper.data.formats import text as text_format
from mrdamper.data.formats.table import Layout
from mrdamper.data.formats.timestamps import Stamps
from mrdamper.data.readers import read_run
from tests.data.rig_files import WRITERS

ASKED = ("few", "many")
ODD = (
    "|  |0|-1.5|+2|3.|.5|.|-|+|e5|1e5|1E-3|1e|1e400|-1e-400|inf|-Inf|infinity|nan|NaN|-nan|NAN|1_0|0x1|1,5"
    "|1.234,5|1,234.5|1,2,3| 7 |\t8|5 mm|text|10:15:02|10:15:02.5|23:59:59|2026-11-21 10:00:00"
    "|\u0663|\u00bd|1\u00a0|+-1"
    "|--1|1.5.2|00012|1d5"
)
CELL = st.one_of(
    st.sampled_from(ODD.split("|")),
    st.text(alphabet="0123456789+-.eEinfaNI ,:x\u00b5", max_size=6),
)


def both(rows, delimiter, decimal, count, end="\n"):
    content = end.join(delimiter.join(row) for row in rows).encode()
    place = Path("run.csv")
    layout = Layout("delimited text", delimiter, decimal)
    made = [getattr(text_format, f"_{how}")(place, content, layout, count, 1) for how in ASKED]
    return [[each(k) for k in range(count)] for each in made]


@settings(max_examples=300)
@given(
    st.lists(st.lists(CELL, min_size=1, max_size=4), min_size=1, max_size=8),
    st.sampled_from(["\t", ";", ","]),
    st.sampled_from(["", ".", ","]),
    st.integers(2, 4),
    st.sampled_from(["\n", "\r\n"]),
)
def test_few_cells_and_many_are_the_same(rows, delimiter, decimal, count, end):
    rows = [[cell.replace(delimiter, "") for cell in row] for row in rows]
    for few, many in zip(*both(rows, delimiter, decimal, count, end), strict=True):
        assert few.texts() == many.texts()
        assert np.array_equal(few.numbers(), many.numbers(), equal_nan=True)
        assert (few.bad, few.filled, few.mostly_text) == (many.bad, many.filled, many.mostly_text)
        if few.bad:
            assert few.first_bad()[1] == many.first_bad()[1]
        held = few.hold_times(Stamps(), 0.5), many.hold_times(Stamps(), 0.5)
        assert held[0] == held[1]
        assert np.array_equal(few.numbers(), many.numbers(), equal_nan=True)
        assert (few.bad, few.mostly_text) == (many.bad, many.mostly_text)


def test_the_line_of_a_bad_cell_counts_lines_that_are_empty():
    rows = [["1", "2"], [""], ["3", "x"]]
    few, _ = both(rows, ";", ".", 2)
    assert few[1].first_bad() == (3, "x")


@pytest.mark.parametrize("name", ["run.csv", "semicolons.csv", "mts.dat"])
def test_a_run_is_the_same_however_few_bytes_are_few(tmp_path, monkeypatch, name):
    WRITERS[name](tmp_path / name)
    content = (tmp_path / name).read_bytes().replace(b"\n", b" \n", 40)  # not plain
    (tmp_path / name).write_bytes(content)
    runs = []
    for most in (0, 1 << 30):
        monkeypatch.setattr(text_format, "_FEW_BYTES", most)
        monkeypatch.setattr(text_format, "_SMALL_BYTES", 0)
        runs.append(read_run(tmp_path / name)[0])
    assert np.array_equal(runs[0].force, runs[1].force)
    assert np.array_equal(runs[0].time, runs[1].time)
    assert np.array_equal(runs[0].command, runs[1].command)
