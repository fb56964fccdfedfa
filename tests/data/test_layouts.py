"""Variants of a file format (binary or text, byte orders, encodings) give the same table."""

from __future__ import annotations

import itertools

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.lines.encodings import encoding_of, read_lines, utf16_of
from mrdamper.data.formats.table import FileOptions
from mrdamper.data.formats.uff import read_uff
from mrdamper.data.tables import read_table
from mrdamper.errors import InputError

# ------------------------------------------------------------------------------------------- encodings

MARKS = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}


@given(
    text=st.text("0123456789.;\n", min_size=9, max_size=400),
    encoding=st.sampled_from(sorted(MARKS)),
    marked=st.booleans(),
)
def test_utf16_needs_no_byte_order_mark(tmp_path_factory, text, encoding, marked):
    path = tmp_path_factory.getbasetemp() / "wide.txt"
    path.write_bytes((MARKS[encoding] if marked else b"") + text.encode(encoding))
    assert utf16_of(path.read_bytes()) == ("utf-16" if marked else encoding)
    assert "\n".join(read_lines(path).lines) == text.removesuffix("\n")
    assert (
        utf16_of(text.encode()) == utf16_of(text.encode("utf-32")) == utf16_of(text.encode("utf-32-le")) == ""
    )


@pytest.mark.parametrize(
    ("words", "written", "read"),
    [
        ("Weg für Prüfling", "cp1252", "cp1252"),
        ("Время;Сила", "cp1251", "cp1251"),
        ("siła;Prąd", "cp1250", "cp1250"),
        ("Ток;Force", "cp1251", "cp1252"),  # One Cyrillic word is not enough to recognise cp1251.
        ("时间;位移", "gb18030", "gb18030"),
        ("時間;荷重;変位", "cp932", "cp932"),
        ("MRダンパ ±10 mm ｶﾞｽ", "cp932", "cp932"),
        ("①電流 0.5 A", "cp932", "cp932"),
        ("減震器試驗 " * 100, "gb18030", "gb18030"),
        ("시간;하중", "cp949", "cp949"),
        ("température élevée " * 100, "cp1252", "cp1252"),
        ("Zeit;Kraft µ°", "utf-8", "utf-8-sig"),
    ],
)
def test_text_encoding_is_recognised_by_words(words, written, read):
    content = (words + "\n" + "0.1;2.5\n" * 60).encode(written, "replace")
    assert encoding_of("run.csv", content) == read


# ------------------------------------------------------------------------------------------- universal files

VALUES = np.array([0.0, -1.5, 1234.5, 3e-3, 7.0])
# The second number fills its field completely, so that no blank separates the fields.
FULL = np.where(VALUES < 0.0, 1e-120, 1.0) * VALUES
TIMES = np.array([2.0, 2.25, 2.5, 2.75, 3.0])


def universal(
    *, precise: bool, even: bool, order: str = "", name: str = "NONE", of: int = 13, points: int = 5
):
    """Return a universal file with one force channel: text, or binary data of byte order ``<`` or ``>``."""
    form, width, kind = (4, 20, "f8") if precise else (2, 13, "f4")
    values = VALUES if order else FULL
    samples = values if even else np.ravel(np.column_stack([TIMES, values]))
    if order:
        data = samples.astype(order + kind).tobytes()
        number = f"    58b{1 + (order == '>'):6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
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
def test_universal_text_and_binary_files_agree(tmp_path, precise, even, order):
    content = universal(precise=precise, even=even, order=order)
    path = tmp_path / "run.unv"
    path.write_bytes(content)
    table = read_table(path)
    # The file has no channel name, only the code for a force.
    force = next(name for name in table.names if "force" in name.lower())
    clock = next(name for name in table.names if name != force)
    np.testing.assert_allclose(table.columns[force], VALUES if order else FULL, rtol=1e-6)
    np.testing.assert_allclose(table.columns[clock], TIMES, rtol=1e-9)
    assert table.units[force] == "N"
    assert table.units[clock] == "s"
    assert {"Damper 7", "today"} <= set(table.said)


@pytest.mark.parametrize("order", ["", "<"])
def test_truncated_universal_file_is_rejected(tmp_path, order):
    path = tmp_path / "run.unv"
    path.write_bytes(universal(precise=True, even=True, order=order, points=6))
    with pytest.raises(InputError, match="cut off"):
        read_uff(path, FileOptions())
    path.write_bytes(universal(precise=True, even=True, order=order, points=10**9))
    with pytest.raises(InputError):
        read_uff(path, FileOptions())


# ---------------------------------------------------------------------------------- HDF5 matrices and spectra


@pytest.mark.parametrize("across", [0, 1])
@pytest.mark.parametrize("key", ["columns", "column_names"])
@pytest.mark.parametrize("joined", [True, False])
def test_transposed_hdf5_matrix_gives_same_columns(tmp_path, across, key, joined):
    names = ["time", "force", "displacement"]
    matrix = np.arange(36.0).reshape(12, 3) ** 2
    with h5py.File(tmp_path / "run.h5", "w") as file:
        stored = file.create_dataset("run", data=matrix if across else matrix.T)
        stored.attrs[key] = ",".join(names) if joined else names
    table = read_hdf5(tmp_path / "run.h5", FileOptions())
    assert [each.split(".")[-1].split("/")[-1] for each in table.names] == names
    for name, values in zip(table.names, matrix.T, strict=True):
        np.testing.assert_array_equal(table.columns[name], values)


def test_spectra_in_universal_file_are_ignored(tmp_path):
    good = universal(precise=True, even=True)
    spectrum = good.replace(f"{1:5d}{75 * ' '}".encode(), f"{4:5d}{75 * ' '}".encode())
    other = b"    -1\n   151\nmodel\n    -1\n"
    path = tmp_path / "run.unv"
    path.write_bytes(other + spectrum + good + other)
    assert len(read_uff(path, FileOptions()).names) == 2
    path.write_bytes(other + spectrum)
    with pytest.raises(InputError, match="no functions of time"):
        read_uff(path, FileOptions())
