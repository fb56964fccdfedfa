"""Lines of text files are split into cells, and numbers in many notations are read."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.formats.lines.cells import cells_of_lines, number_in
from mrdamper.data.formats.table import Layout, is_missing
from tests.support.examples import examples

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


def read(rows, delimiter, decimal, count):
    lines = [delimiter.join(row) for row in rows]
    return cells_of_lines(lines, Layout("delimited text", delimiter, decimal), count, 1)


@examples(60)
@given(
    st.lists(st.lists(CELL, min_size=1, max_size=4), min_size=1, max_size=8),
    st.sampled_from(["\t", ";", ","]),
    st.sampled_from(["", ".", ","]),
    st.integers(2, 4),
)
def test_rows_are_split_at_delimiters(rows, delimiter, decimal, count):
    rows = [[cell.replace(delimiter, "") for cell in row] for row in rows]
    kept = [row for row in rows if any(cell.strip(' \t"') for cell in row[:count])]
    for k, cells in enumerate(read(rows, delimiter, decimal, count)):
        texts = [(row[k].strip(' \t"') or None) if k < len(row) else None for row in kept]
        numbers = [number_in(text, decimal) if text else None for text in texts]
        bad = [
            text
            for text, value in zip(texts, numbers, strict=True)
            if text and not is_missing(text) and value is None
        ]
        assert cells.texts == texts
        assert np.array_equal(cells.numbers, np.array(numbers, dtype=float), equal_nan=True)
        assert (cells.bad, cells.filled) == (
            len(bad),
            sum(not is_missing(text or "") for text in texts),
        )
        assert cells.mostly_text == (len(bad) > 0.5 * cells.filled)
        if bad:
            assert cells.first_bad()[1] == bad[0][:40]


@pytest.mark.parametrize(
    ("cell", "decimal", "number"),
    [
        ("1,234.5", ".", 1234.5),
        ("1.234,5", ",", 1234.5),
        ("-1'234'567.5", ".", -1234567.5),
        ("1,234,567", ".", 1234567.0),
        ("1,234", ".", None),  # The comma may be a decimal sign (1.234) or a thousands separator (1234).
        ("1.234", ",", None),
        ("12,34.5", ".", None),
        ("1.0D+02", ".", 100.0),
        ("3,5E-1", ",", 0.35),
        ("- 0.5", ".", -0.5),
        ("-", ".", None),
        (".", ".", None),
        ("1_0", ".", None),
        ("NaN", ",", float("nan")),
        ("-∞", ".", float("-inf")),
    ],
)
def test_number_spellings_are_read(cell, decimal, number):
    assert number_in(cell, decimal) == pytest.approx(number, nan_ok=True)
