"""Limits of format detection: numbers of rows, lines, letters and names."""

from __future__ import annotations

import numpy as np
import pytest

from mrdamper.data.formats.groups import recordings_in
from mrdamper.data.formats.lines.blocks import Block, find_blocks
from mrdamper.data.formats.lines.header import (
    find_data,
    read_header,
)

# ------------------------------------------------------------------------------------------- rows


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        ([], (",", None)),
        (["1"], (",", None)),
        (["1;2"], (";", 0)),  # A single row must be the last line.
        (["1;2", "words"], (",", None)),
        (["1;words"], (",", None)),
        (["t;F", "1;2", "3;4", "words"], (";", 1)),
        (["1;2", "", "3;4"], (";", 2)),
        (["1;2", "3;4"], (";", 0)),
        (["t;F", "1;2", "# 3;4", "5;6", "7;8"], (";", 3)),
        (["s;1;2", "1;2;3", "4;5;6"], (";", 1)),  # A row that begins with a word is no sample.
        (["s;1;2", "N;2;3"], (";", 0)),
        (["word;1;2", "word;2;3"], (";", 0)),
        (["s;mm;1;2", "a;b;2;3", "a;b;4;5"], (";", 1)),  # Units, then settings.
        (["1,2,3,4"] * 3 + [""] + ["1;2", ""] * 10, (";", 4)),  # Ten short rows count.
        (["1,2,3,4"] * 3 + [""] + ["1;2", ""] * 9, (",", 0)),
        (["1 2;3 4"] * 12, (" ", 0)),  # its fields are "1 2" and "3 4", or two numbers and "2;3"
        (["1|2,3|4"] * 2, ("|", 0)),
    ],
)
def test_rows_begin_at_the_numbers(lines, found):
    assert find_data(lines) == found
    assert find_data(lines, found[0]) == found


@pytest.mark.parametrize(
    ("above", "row", "names", "said"),
    [
        (["a;b"], "1;2;", ("a", "b", ""), ()),  # a last column that is empty
        (["0.5 A;;", "t;x;F"], "1;2;3", ("t", "x", "F"), ("0.5 A",)),
        (["0.5 A;;1 A", "t;x;F"], "1;2;3", ("0.5 A: t", "0.5 A: x", "1 A: F"), ()),
        (["CH1: time", "CH2: force", "ch1;ch2;ch3;ch4"], "1;2;3;4", ("ch1", "ch2", "ch3", "ch4"),
         ("CH1: time", "CH2: force")),  # a legend of half of the columns
        (["CH1: t", "CH2: F", "CH3: x", "ch1;ch2;ch3;ch4"], "1;2;3;4", ("t", "F", "x", "ch4"),
         ("CH1: t", "CH2: F", "CH3: x")),
        (["# columns: time [s], force [N], x [mm]"], "1 2 3", ("time [s]", "force [N]", "x [mm]"), ()),
        (["# time force x"], "1 2 3", ("time", "force", "x"), ()),
        (["# names: time | force | x"], "1 2 3", ("time", "force", "x"), ()),
        (["Time (s) Force (N)"], "1 2", ("Time (s)", "Force (N)"), ()),
        (["Time in s   Force in N"], "1 2", ("Time in s", "Force in N"), ()),
        (["Sequence;Force;Increment", "s;N;0.005"], "1;2;3", ("Sequence [s]", "Force [N]", "Increment"),
         ("Increment: 0.005 s",)),
        (["Title", "t;x;F", "", "Data:"], "1;2;3", ("t", "x", "F"), ("Title", "Data:")),
        (["t;x;F", "words here"], "1;2;3", ("column 1", "column 2", "column 3"), ("t x F", "words here")),
        (["-;mm;", "t;x;F"], "1;2;3", ("t [-]", "x [mm]", "F"), ()),
        (["s;mm;N", "mm;N;A"], "1;2;3", ("s [mm]", "mm [N]", "N [A]"), ()),  # the units are the lower ones
        (["t;x;F", "s;word;other"], "1;2;3", ("s", "word", "other"), ("t x F",)),
        (["Names: t;x;F", "Units: s;mm;N"], "1;2;3", ("t [s]", "x [mm]", "F [N]"), ()),
        (["Names: t;x;F"], "1;2;3", ("Names: t", "x", "F"), ()),
        (["Note: 5", "Current_A=0.5", "Gain : 2.5", "t;x;F"], "1;2;3", ("t", "x", "F"),
         ("Note: 5", "Current_A: 0.5 A", "Gain: 2.5")),
        ([";;"], "1;2;3", ("column 1", "column 2", "column 3"), ()),
    ],
)  # fmt: skip
def test_lines_above_rows_name_the_columns(above, row, names, said):
    found = read_header([*above, *[row] * 12], len(above), " " if ";" not in row else ";")
    assert (found.names, found.said) == (names, said)
    assert found.named == (names[0] != "column 1")


# ------------------------------------------------------------------------------------------- blocks


def blocks_of(lines, delimiter=";"):
    """Return lines, rows and headers of the blocks below a first line, and the trailer."""
    content = "\n".join(["head", *lines]) + "\n"
    starts = np.cumsum([0, *(len(line) + 1 for line in ["head", *lines])]).tolist()
    blocks, trailer = find_blocks(content.encode(), starts[1], 1, delimiter, "utf-8")
    for each in blocks:
        assert isinstance(each, Block)
        assert starts[each.first_line] == each.start
        assert ["head", *lines][each.first_line] == each.first_row
    return [(b.first_line, starts.index(b.stop), b.rows, b.above) for b in blocks], trailer


@pytest.mark.parametrize(
    ("lines", "blocks", "trailer"),
    [
        (["1;2", "3;4"], [(1, 3, 2, ())], 0),
        (["1;2", "", ";", "3;4"], [(1, 5, 2, ())], 0),
        (["1;2", "end", "of it"], [(1, 2, 1, ())], 2),
        (["1;2", "# note", "3;4"], [(1, 2, 1, ()), (3, 4, 1, ("# note",))], 0),
        (["1;2", "t;F", "s;N", "3;4", "5;6"], [(1, 2, 1, ()), (4, 6, 2, ("t;F", "s;N"))], 0),
        (["1;2", "bad;4", "5;6", "7;8"], [(1, 5, 4, ())], 0),  # One cell is not a number.
        (["1;2", "bad;4", "worse;5", "7;8"], [(1, 5, 4, ())], 0),
        (["1;2", "3;bad", "5;6"], [(1, 4, 3, ())], 0),
        (["1;2", "mean;4", "sum;5"], [(1, 2, 1, ())], 2),  # Results follow the samples.
        (["1;2", "mean;4", "words", "1;2"], [(1, 2, 1, ()), (4, 5, 1, ("mean;4", "words"))], 0),
        (["1;2", "-;-", "NA;4", "5;6"], [(1, 5, 4, ())], 0),  # Missing values.
        (["1;2", "words;-", "5;6"], [(1, 2, 1, ()), (3, 4, 1, ("words;-",))], 0),
        (["1;2", "words", "name;5;6", "-;7;8", "9;1"],
         [(1, 2, 1, ()), (4, 6, 2, ("words", "name;5;6"))], 0),
        (["1;2", "words", "10:15:02;5;6"], [(1, 2, 1, ()), (3, 4, 1, ("words",))], 0),
        (["1;2", "words", "5", "6;7"], [(1, 2, 1, ()), (4, 5, 1, ("words", "5"))], 0),
        (["x;1;2", "x;3;4", "y;5;6"], [(1, 4, 3, ())], 0),
    ],
)  # fmt: skip
def test_lines_of_words_separate_blocks(lines, blocks, trailer):
    assert blocks_of(lines) == (blocks, trailer)


# ------------------------------------------------------------------------------------------- groups


@pytest.mark.parametrize(
    ("paths", "groups"),
    [
        ((), ()),
        (("t", "F"), ()),
        (("a/t", "a/F", "b/t", "b/F", "c"), ("a", "b")),
        (("a/t", "a/F", "b/t", "b/x"), ()),
        (("a", "a/x", "b", "b/x"), ()),
        (("m/a/t", "m/a/F", "m/b/t", "m/b/F", "m/c/t"), ("m/a", "m/b")),
        (("a/r/t", "a/r/F", "b/r/t", "b/r/F", "b/s/t", "b/s/F"), ("a", "b")),
    ],
)
def test_nested_paths_are_grouped_into_recordings(paths, groups):
    assert recordings_in([tuple(path.split("/")) for path in paths]) == groups
