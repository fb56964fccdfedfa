"""Cells of a text are what plain Python reads, and plain numbers are the same without Polars."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.formats import text as text_format
from mrdamper.data.formats.table import MISSING_MARKS, Layout
from mrdamper.data.readers import read_run
from tests.data.rig_files import WRITERS
from tests.support.examples import examples

FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|[+-]?(?:inf|infinity|nan)", re.IGNORECASE
)
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


LIBRARIES = ("polars", "none")  # that reads the cells: with none Python alone does


def read(rows, delimiter, decimal, count, end="\n", library="polars"):
    content = end.join(delimiter.join(row) for row in rows).encode()
    layout = Layout("delimited text", delimiter, decimal)
    with patch.object(text_format, "has_extra", lambda module: module == library):
        return list(text_format._parse_block(Path("run.csv"), content, layout, count, 1).values())


def number(cell, decimal):
    """Return a cell as a number, not a number where it is none; with decimal commas a point is none."""
    spelled = cell.replace(".", "?").replace(",", ".", 1) if decimal == "," else cell
    return float(spelled) if FLOAT.fullmatch(spelled) else float("nan")


@examples(60)
@given(
    st.lists(st.lists(CELL, min_size=1, max_size=4), min_size=1, max_size=8),
    st.sampled_from(["\t", ";", ","]),
    st.sampled_from(["", ".", ","]),
    st.integers(2, 4),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from(LIBRARIES),
)
def test_cells_are_what_stands_between_delimiters(rows, delimiter, decimal, count, end, library):
    rows = [[cell.replace(delimiter, "") for cell in row] for row in rows]
    kept = [row for row in rows if any(row[:count])]
    for k, cells in enumerate(read(rows, delimiter, decimal, count, end, library)):
        texts = [row[k].strip(' \t"') if k < len(row) and row[k] else None for row in kept]
        numbers = np.array([number(text, decimal) if text else np.nan for text in texts])
        bad = [
            text
            for text, value in zip(texts, numbers, strict=True)
            if text and text not in MISSING_MARKS and np.isnan(value) and text.lower().lstrip("+-") != "nan"
        ]
        assert cells.texts() == texts
        assert np.array_equal(cells.numbers(), numbers, equal_nan=True)
        assert (cells.bad, cells.filled) == (
            len(bad),
            sum(bool(text) and text not in MISSING_MARKS for text in texts),
        )
        assert cells.mostly_text == (len(bad) > 0.5 * cells.filled)
        if bad:
            assert cells.first_bad()[1] == bad[0][:40]


@pytest.mark.system
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_decimal_commas_do_not_need_polars(tmp_path, end):
    lines = [f"{0.001 * k:.3f};{k},5;{-k},25;0,5".replace(".", ",") for k in range(50)]
    path = tmp_path / "run.csv"
    path.write_bytes(end.join(["time_s;displacement_mm;force_N;current_A", *lines, ""]).encode())
    code = (
        "import sys; from pathlib import Path; from mrdamper.data.tables import read_table;"
        f"force = read_table(Path({str(path)!r})).columns['force_N'];"
        "print('polars' in sys.modules, *force[1:3])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.split() == ["False", "-1.25", "-2.25"]


@pytest.mark.parametrize(
    "name", [name for name in WRITERS if name.endswith((".csv", ".dat", ".txt", ".tsv"))]
)
def test_all_text_parsers_agree(tmp_path, monkeypatch, name):
    WRITERS[name](tmp_path / name)
    runs = []
    for most, library in ((0, "polars"), (1 << 30, "polars"), (0, "none")):
        monkeypatch.setattr(text_format, "_SMALL_BYTES", most)
        monkeypatch.setattr(text_format, "has_extra", lambda module, there=library: module == there)
        runs.append(read_run(tmp_path / name)[0])
    for run in runs[1:]:
        for channel in ("force", "time", "command"):
            assert np.array_equal(getattr(run, channel), getattr(runs[0], channel))
