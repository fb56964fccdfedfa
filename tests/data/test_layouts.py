"""One table in every spelling of a format: bytes or text, either order of bytes, any encoding, any sign."""

from __future__ import annotations

import itertools
from contextlib import suppress
from datetime import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mrdamper.data.formats.waveforms.uff import is_uff, read_uff
from openpyxl import Workbook
from scipy.io import savemat

from mrdamper.data.formats.excel import read_workbook
from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.lines.encodings import encoding_of, open_text_bytes, utf16_of
from mrdamper.data.formats.lines.header import find_decimal
from mrdamper.data.formats.mat import read_mat
from mrdamper.data.formats.table import FileOptions
from mrdamper.errors import InputError

# ------------------------------------------------------------------------------------------- encodings

MARKS = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}


@given(
    text=st.text("0123456789.;\n", min_size=9, max_size=400),
    encoding=st.sampled_from(sorted(MARKS)),
    marked=st.booleans(),
)
def test_numbers_in_sixteen_bits_are_known_with_a_mark_and_without(tmp_path_factory, text, encoding, marked):
    path = tmp_path_factory.getbasetemp() / "wide.txt"
    path.write_bytes((MARKS[encoding] if marked else b"") + text.encode(encoding))
    assert utf16_of(path.read_bytes()) == ("utf-16" if marked else encoding)
    with open_text_bytes(path) as stream:
        assert stream.read().decode() == text
    assert (
        utf16_of(text.encode()) == utf16_of(text.encode("utf-32")) == utf16_of(text.encode("utf-32-le")) == ""
    )


def test_eight_characters_are_too_few_to_tell_sixteen_bits():
    assert [utf16_of(("1" * n).encode("utf-16-le")) for n in (8, 9)] == ["", "utf-16-le"]


@pytest.mark.parametrize(
    ("words", "written", "read"),
    [
        ("Weg für Prüfling", "cp1252", "cp1252"),
        ("Время;Сила", "cp1251", "cp1251"),
        ("Ток;Force", "cp1251", "cp1252"),  # one word alone may be of a Latin script
        ("时间;位移", "gb18030", "gb18030"),
        ("時間;荷重;変位", "cp932", "cp932"),
        ("시간;하중", "cp949", "cp949"),
        ("Zeit;Kraft µ°", "utf-8", "utf-8-sig"),
    ],
)
def test_the_encoding_of_a_header_is_told_by_its_words(tmp_path, words, written, read):
    content = (words + "\n" + "0.1;2.5\n" * 60).encode(written, "replace")
    assert encoding_of(tmp_path / "run.csv", content) == read


@given(st.lists(st.sampled_from(b"\x81\x8d\x8f\x90\x98\x9d\xc0\xfc"), max_size=4))
def test_a_text_can_be_read_in_the_encoding_that_is_told(letters):
    cells = b";".join(bytes([letter]) for letter in letters)
    content = "Время;Сила\n".encode("cp1251") + cells + b"\n" + b"0.1;2.5\n" * 60
    with suppress(InputError):
        content.decode(encoding_of(Path("run.csv"), content))


def test_a_text_of_control_characters_or_of_foreign_letters_throughout_is_refused(tmp_path):
    for content in (
        b"Weg f\xfcr\n\x01 1;2\n" * 9,
        b"\xfc \xe4 \xf6 \xdf 1\n" * 9,
        b"1;2\n" * 99 + b"\x81 \xfc\n",
    ):
        with pytest.raises(InputError, match="is not UTF-8 text"):
            encoding_of(tmp_path / "run.csv", content)


@pytest.mark.parametrize(
    ("rows", "sign"), [(["1,5;2", "3;4"], ","), (["1;2", "3.5;4,x"], "."), (["1;2", "a,b;3"], "")]
)
def test_the_decimal_sign_is_that_of_numbers_alone(tmp_path, rows, sign):
    assert find_decimal(tmp_path, rows, ";") == sign


def test_both_decimal_signs_are_refused_with_an_example_of_each(tmp_path):
    with pytest.raises(InputError, match=r"points and decimal commas \('2\.5' and '1,5'\)"):
        find_decimal(tmp_path, ["1;1,5", "2.5;3,5"], ";")


# ------------------------------------------------------------------------------------------- universal files

VALUES = np.array([0.0, -1.5, 1234.5, 3e-3, 7.0])
FULL = np.where(VALUES < 0.0, 1e-120, 1.0) * VALUES  # no blank before it, in a text
TIMES = np.array([2.0, 2.25, 2.5, 2.75, 3.0])


def universal(
    *, precise: bool, even: bool, order: str = "", name: str = "NONE", of: int = 13, points: int = 5
):
    """Return a universal file of one force, as text or as bytes in an order (``<`` or ``>``)."""
    form, width, kind = (4, 20, "f8") if precise else (2, 13, "f4")
    values = VALUES if order else FULL
    samples = values if even else np.ravel(np.column_stack([TIMES, values]))
    if order:
        data = samples.astype(order + kind).tobytes()
        number = f"   58b{1 + (order == '>'):6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    else:
        number = "    58"
        widths = itertools.cycle((13, 20) if precise and not even else (width,))
        cells = [f"{v:{w}.{w - 8}E}" for v, w in zip(samples, widths, strict=False)]
        data = "\n".join("".join(cells[k : k + 4]) for k in range(0, len(cells), 4)).encode() + b"\n"
    head = ["NONE", "Damper 7", "NONE", "today", "NONE", f"{1:5d}" + 75 * " "]
    head.append(f"{form:10d}{points:10d}{int(even):10d}{2.0:13.5E}{0.25:13.5E}{0.0:13.5E}")
    for code, label, unit in ((17, "Time", "s"), (of, name, "N"), (0, "NONE", "NONE"), (0, "NONE", "NONE")):
        head.append(f"{code:10d}    0    0    0 {label:20s} {unit:20s}")
    return "\n".join(["    -1", number, *head, ""]).encode() + data + b"\n    -1\n"


@pytest.mark.parametrize("precise", [True, False])
@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_function_of_time_is_the_same_as_text_and_as_bytes(tmp_path, precise, even, order):
    content = universal(precise=precise, even=even, order=order)
    path = tmp_path / "run.unv"
    path.write_bytes(content)
    assert is_uff(content[:20])
    if order and precise and not even:
        with pytest.raises(InputError, match="pairs of two precisions"):
            read_uff(path, FileOptions())
        return
    table = read_uff(path, FileOptions())
    force = next(name for name in table.names if "force" in name.lower())  # by its code: it has no name
    clock = next(name for name in table.names if name != force)
    np.testing.assert_allclose(table.columns[force], VALUES if order else FULL, rtol=1e-6)
    np.testing.assert_allclose(table.columns[clock], TIMES, rtol=1e-9)
    assert table.units[force] == "N"
    assert table.units[clock] == "s"
    assert {"Damper 7", "today"} <= set(table.said)


@pytest.mark.parametrize("order", ["", "<"])
def test_a_universal_file_that_ends_early_is_told(tmp_path, order):
    path = tmp_path / "run.unv"
    path.write_bytes(universal(precise=True, even=True, order=order, points=6))
    with pytest.raises(InputError, match="cut off"):
        read_uff(path, FileOptions())
    path.write_bytes(universal(precise=True, even=True, order=order, points=10**9))
    with pytest.raises(InputError):
        read_uff(path, FileOptions())


# ------------------------------------------------------------------------------------------- workbooks


def workbook(path, *rows):
    book = Workbook()
    sheet = book.active
    assert sheet is not None
    for row in (["t [s]", "F [N]", "x [mm]"], *rows):
        sheet.append(row)
    book.save(path)
    return path


ROWS = tuple([0.1 * k, 10.0 * k, float(k)] for k in range(6))


@pytest.mark.parametrize("cell", [True, "apples", "12 apples", "1.2.3"])
@pytest.mark.parametrize("at", [1, 5])
def test_a_cell_that_is_no_number_is_named_by_its_row_and_column(tmp_path, cell, at):
    rows = [list(row) for row in ROWS]
    rows[at][1] = cell
    with pytest.raises(InputError) as refused:
        read_workbook(workbook(tmp_path / "run.xlsx", *rows), FileOptions())
    assert f"row {at + 2}" in str(refused.value)  # the header is row 1
    assert "'F [N]'" in str(refused.value) or "column 'F'" in str(refused.value)


def test_empty_rows_words_below_and_missing_marks_are_no_samples(tmp_path):
    rows = [*ROWS[:2], ["", "", ""], [0.2, "NaN", 2.0], [0.3, None, 3.0], ["end", "of", "test"]]
    table = read_workbook(workbook(tmp_path / "run.xlsx", *rows), FileOptions())
    force = next(values for name, values in table.columns.items() if "F" in name)
    assert table.rows == 4
    np.testing.assert_array_equal(np.isnan(force), [False, False, True, True])
    assert table.layout.notes == ("1 row of words below the numbers",)
    with pytest.raises(InputError, match="numbers go on below rows of words"):
        read_workbook(workbook(tmp_path / "on.xlsx", *rows, *ROWS[:2]), FileOptions())


def test_times_of_day_in_a_workbook_are_seconds_from_the_first(tmp_path):
    rows = [[time(10, 59, 59 - k), *row[1:]] for k, row in enumerate(ROWS)]
    table = read_workbook(workbook(tmp_path / "run.xlsx", *rows), FileOptions())
    (clock,) = table.stamps
    assert table.columns[clock].tolist() == [0.0, -1.0, -2.0, -3.0, -4.0, -5.0]


# ------------------------------------------------------------------------------------------- matrices


@pytest.mark.parametrize("across", [0, 1])
@pytest.mark.parametrize("key", ["columns", "column_names"])
@pytest.mark.parametrize("joined", [True, False])
def test_a_matrix_whose_columns_are_named_is_the_same_lying_and_standing(tmp_path, across, key, joined):
    names = ["time", "force", "displacement"]
    matrix = np.arange(36.0).reshape(12, 3) ** 2
    with h5py.File(tmp_path / "run.h5", "w") as file:
        stored = file.create_dataset("run", data=matrix if across else matrix.T)
        stored.attrs[key] = ",".join(names) if joined else names
    table = read_hdf5(tmp_path / "run.h5", FileOptions())
    assert [each.split(".")[-1].split("/")[-1] for each in table.names] == names
    for name, values in zip(table.names, matrix.T, strict=True):
        np.testing.assert_array_equal(table.columns[name], values)


def test_matrices_of_a_mat_file_lie_or_stand_at_any_depth_and_are_read_column_by_column(tmp_path):
    matrix = np.arange(24.0).reshape(12, 2)
    inside = {"m": matrix, "t": np.arange(12.0)}
    savemat(tmp_path / "run.mat", {"s": inside, "top": matrix.T, "note": "bench 3"})
    table = read_mat(tmp_path / "run.mat", FileOptions())
    expected = {
        "column 1 of m": matrix[:, 0], "column 2 of m": matrix[:, 1], "t": np.arange(12.0),
        "column 1 of top": matrix[:, 0], "column 2 of top": matrix[:, 1],
    }  # fmt: skip
    assert table.names == tuple(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(table.columns[name], values)
    assert "note: bench 3" in table.said


def test_other_functions_than_those_of_time_are_passed_over(tmp_path):
    good = universal(precise=True, even=True)
    spectrum = good.replace(f"{1:5d}{75 * ' '}".encode(), f"{4:5d}{75 * ' '}".encode())
    complex_ = good.replace(f"{4:10d}{5:10d}".encode(), f"{5:10d}{5:10d}".encode())
    other = b"    -1\n   151\nmodel\n    -1\n"
    path = tmp_path / "run.unv"
    path.write_bytes(other + spectrum + complex_ + good + other)
    assert len(read_uff(path, FileOptions()).names) == 2
    path.write_bytes(other + spectrum + complex_)
    with pytest.raises(InputError, match="no functions of time"):
        read_uff(path, FileOptions())
