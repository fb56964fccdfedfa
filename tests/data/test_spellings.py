"""Text files and workbooks with random combinations of titles, names, units and notes are parsed."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from math import cos, sin
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from openpyxl import Workbook

from mrdamper.data.formats.excel import read_workbook, sheet_lines
from mrdamper.data.formats.lines.header import find_data, read_header
from mrdamper.data.formats.table import (
    FileOptions,
)
from mrdamper.data.formats.text import read_text
from mrdamper.data.readers import read_runs
from mrdamper.data.tables import read_table
from tests.support.examples import examples

# ------------------------------------------------------------------------------------------- headers

NAMES = {"Time": "s", "Force": "kN", "Position": "mm", "Current": "A", "Head": "degC"}
TITLES = ["Report", "MR-7", "Operator:", "(third)"]


@dataclass(frozen=True)
class Text:
    """Lines of a text file, and the expected result of parsing them."""

    lines: list[str]
    delimiter: str
    first: int  # Index of the first row of data
    names: tuple[str, ...]
    said: tuple[str, ...]


@st.composite
def texts(draw: st.DrawFn) -> Text:
    """Draw a text with random titles, column names, units, comment signs, quotes and empty lines."""
    delimiter = draw(st.sampled_from("\t;,| "))
    names = draw(st.lists(st.sampled_from(sorted(NAMES)), min_size=2, max_size=5, unique=True))
    units = [NAMES[name] for name in names]
    said = draw(st.lists(st.sampled_from(TITLES), max_size=3, unique=True))
    where = draw(st.sampled_from(["none", "in", "under", "above", "under in brackets"]))
    sign = draw(st.sampled_from(["", "# ", "% ", "// ", "## "]))
    quote = draw(st.sampled_from(["", '"']))

    def line(cells):
        return sign + delimiter.join(f"{quote}{cell}{quote}" for cell in cells)

    rows_of = {
        "none": [names],
        "in": [[f"{name}_{unit}" for name, unit in zip(names, units, strict=True)]],
        "under": [names, units],
        "above": [units, names],
        "under in brackets": [names, [f"[{unit}]" for unit in units]],
    }[where]
    above = [*said, *[""] * draw(st.integers(0, 1)), *map(line, rows_of), *[""] * draw(st.integers(0, 2))]
    rows = [delimiter.join(f"{0.5 * k + c:.3f}" for c in range(len(names))) for k in range(12)]
    expected = (
        rows_of[0] if where in {"none", "in"} else [f"{n} [{u}]" for n, u in zip(names, units, strict=True)]
    )
    return Text([*above, *rows], delimiter, len(above), tuple(expected), tuple(said))


@given(texts())
@examples(50)
def test_names_units_and_titles_are_parsed(text):
    assert find_data(text.lines) == (text.delimiter, text.first)
    assert find_data(text.lines, text.delimiter) == (text.delimiter, text.first)
    header = read_header(text.lines, text.first, text.delimiter)
    assert (header.names, header.said, header.named) == (text.names, text.said, True)


@pytest.mark.parametrize("delimiter", ["\t", ";", ",", "|"])
def test_currents_above_header_complete_column_names(delimiter):
    lines = [
        delimiter.join(cells)
        for cells in (["", "0.5 A", "", "1 A", ""], ["t [s]", "x [mm]", "F [N]", "x [mm]", "F [N]"])
    ]
    rows = [delimiter.join(f"{k + c}.5" for c in range(5)) for k in range(12)]
    assert read_header([*lines, *rows], 2, delimiter).names == (
        "t [s]", "0.5 A: x [mm]", "0.5 A: F [N]", "1 A: x [mm]", "1 A: F [N]"
    )  # fmt: skip


# ------------------------------------------------------------------------------------------- line ends


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("last", [True, False])
def test_line_endings_do_not_affect_samples(tmp_path, ends, marked, last):
    rows = ["t;x", *(f"{k};{k}.5" for k in range(12))]
    content = ends.join(rows) + (ends if last else "")
    (tmp_path / "run.csv").write_bytes((b"\xef\xbb\xbf" if marked else b"") + content.encode())
    table = read_text(tmp_path / "run.csv", FileOptions())
    assert table.names == ("t", "x")
    assert table.columns["x"].tolist() == [k + 0.5 for k in range(12)]


# ------------------------------------------------------------------------------------------- file names

SIGNS = " ,;.()[]{}+-_#&'!=@~%"


@given(folder=st.text(SIGNS, max_size=4), file=st.text(SIGNS, max_size=4), note=st.text(SIGNS, max_size=4))
@example(folder=",", file="", note="")
@examples(25)
def test_punctuation_in_names_does_not_affect_runs(folder, file, note):
    """Names of folders and files can contain any punctuation, as in "courant 0,5 A" or "run (2)"."""
    rows = "".join(f"{k / 100},{10.0 * sin(k / 9)},{90.0 * cos(k / 9)}\n" for k in range(120))
    with TemporaryDirectory() as space:
        inner = Path(space) / f"tests{folder}x"
        inner.mkdir()
        for name in ("run1", "run2"):
            (inner / f"{name}{file}.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}")
        (Path(space) / f"readme{note}.txt").write_text("Current 0.5 A in all runs.\n")
        assert [run.constant_command for run in read_runs(space)] == [0.5, 0.5]


# ------------------------------------------------------------------------------------------- workbooks


@given(
    above=st.integers(0, 3), left=st.integers(0, 2), words=st.integers(0, 2), units=st.booleans(),
    empty=st.sets(st.integers(1, 10), max_size=3), comma=st.booleans(),
)  # fmt: skip
@examples(15)
def test_table_is_found_anywhere_on_sheet(tmp_path_factory, above, left, words, units, empty, comma):
    """Titles are above the table, text below, and empty columns on the left. Rows may be empty."""
    path = tmp_path_factory.getbasetemp() / "spelled.xlsx"
    book = Workbook()
    notes = book.active
    assert notes is not None
    notes.append(["About", "this test"])
    sheet = book.create_sheet("Rig")
    rows = [[0.5 * k, 10.0 * k + 0.5, "valve open" if k % 2 else "valve shut"] for k in range(12)]
    named = ["Time", "Force", "State"] if units else ["Time [s]", "Force [N]", "State"]
    head: list[list[str | None]] = [["Title"] for _ in range(above)]
    head += [[*named], *([["s", "N", None]] if units else [])]
    for line in head:
        sheet.append([*[None] * left, *line])
    for k, row in enumerate(rows):
        if k in empty:
            sheet.append([])
        sheet.append([*[None] * left, row[0], f"{row[1]}".replace(".", ",") if comma else row[1], row[2]])
    for _ in range(words):
        sheet.append([*[None] * left, "end of test"])
    book.save(path)
    table = read_workbook(path, FileOptions())
    assert table.columns["Time [s]"].tolist() == [row[0] for row in rows]
    assert table.columns["Force [N]"].tolist() == [row[1] for row in rows]
    (state,) = table.texts.values()
    assert list(state) == [row[2] for row in rows]
    assert (table.rows, table.title, table.layout.part) == (12, "Rig", "Rig")
    expected = {0: (), 1: ("1 line of words below the rows",), 2: ("2 lines of words below the rows",)}
    assert table.layout.notes == expected[words]


# A workbook with the columns "time [s]" and "force [N]" (12 rows), written by xlwt; zlib and base 85.
XLS = (
    "c-rllOK1~87{|ZaWb;m%#J121H59Dc7DT*wX;%g9K@7DQ#agwG2&FZVSPv><we}<h!IQ5;p%+oAUVNZ}y$K2xJqUu3=&"
    ">h3!9$z%oB!_6wC<q+En4=!?0+ZU{N|CJ+1bat*+gOTQGJn?shvDjGK1tRiwWL?>PMV7-!x@X9Rs|ZuKp_p13ZvEot{V"
    "E`sEnP@h*}^54|(&L|=G6LZ>L5%VtumsNLv8uaJFcV;6LrBQdH&uafY7_&WFlkT2jn5t)FuF<TIaY1T+L@33d_A*~U4F"
    "_QH@L77j8Y@-@_Eobq?Yr<l6+La&d9sV~n8oUvjA|AJnOg5A69WGEc58xF2FjGX|)s^}x<;GVxE{Nklm&W}L@#~tGXq3"
    "$3nBe0SrWudS@le;9>^yD2oYbt9b!6~lCe?kqhZo=zxqLsT(>)=%Amaj#FS&rDnAj2a0jfeefokGh(fr+S@Avn08pjYB"
    "#iDI3?Hgrp$fQfM1Q(7WCkmHrGrR?U8MUrQx*lH5lah~3oi%o1?--aX$Zg_wwnHC`O=aoLoF1P$@U&t4tFeXC(;dZg)z"
    "cr1NowR<%>b8|+ZeTqR&n!&)H6dJg}n@XhS&YJBm}g$-FMTze^t=}g^*0ZtzYu&2%8tn_?O&<0I$K{fS07^KrS)~8j35"
    "@<3M`A_~7A`BE1fz7fiP%{oYnZ>JFq1G6dgeDAMOZTJ6qx;Autr9Y{aO82su{MFt$m0GRW-^p>n5gAQa6WYRiU7Ze$CA"
    "g%ur_Tzj`C^GCohC$X^{2fI`9LNZmTLGNU`;u(elJr;(9p5+>6(U!zT)A@P%9X1%DPcd{%Lh{VsHxkp5Pti+&I0cx_cO"
    "_wRTt%W8{rqzJ(T5Rp3YV@e`-k=sxGm@GU|Jw)In}NPeas)ehgJSfBB_Ll>eU<7mWY8OQ_QJOO^EVFSq{-0U6~?"
)


def test_workbook_of_excel_97_is_read(tmp_path):
    path = tmp_path / "run.xls"
    path.write_bytes(zlib.decompress(base64.b85decode(XLS)))
    table = read_table(path)
    assert table.columns["time [s]"].tolist() == [0.5 * k for k in range(12)]
    assert table.columns["force [N]"].tolist() == [10.0 * k + 0.5 for k in range(12)]


def test_merged_cells_outside_of_table_do_not_affect_lines(tmp_path):
    """A form may have merged, empty cells to the left of the table and below it."""
    book = Workbook()
    for k, row in enumerate((("run", "current"), ("run1", 0.5), ("run2", 0.5)), 3):
        for column, cell in enumerate(row, 3):
            book.active.cell(k, column, cell)
    book.active.merge_cells("A1:A8")
    book.active.merge_cells("D4:D5")
    book.active.merge_cells("F9:F12")
    book.save(tmp_path / "list.xlsx")
    lines = [line for line in sheet_lines(tmp_path / "list.xlsx") if line.strip()]
    assert lines == ["run\tcurrent", "run1\t0.5", "run2\t0.5"]
