"""Tables: what a rig's file holds, column by column, before anybody says what the columns mean.

One module per family of formats in ``formats``; a new format is one module and one line in ``FORMATS``.
Which column is the force is the business of ``channels``; runs are made in ``readers``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.excel import is_workbook
from mrdamper.data.formats.hdf5 import is_hdf5
from mrdamper.data.formats.logger import is_logger, read_logger
from mrdamper.data.formats.lvm import is_lvm, read_lvm
from mrdamper.data.formats.mat import is_mat
from mrdamper.data.formats.mdf import is_mdf
from mrdamper.data.formats.mts import is_mts, read_mts
from mrdamper.data.formats.objects import is_json, is_npz, read_json, read_npz
from mrdamper.data.formats.parquet import is_parquet
from mrdamper.data.formats.sandbox import sandboxed
from mrdamper.data.formats.table import FileOptions, Format, Layout, ReadRows, Rows, Table
from mrdamper.data.formats.tdms import is_tdms, read_tdms
from mrdamper.data.formats.text import is_text, open_text, read_text
from mrdamper.data.formats.waveforms.catman import is_catman, read_catman
from mrdamper.data.formats.waveforms.famos import is_famos, read_famos
from mrdamper.data.formats.waveforms.uff import is_uff, read_uff
from mrdamper.errors import InputError
from mrdamper.files import require_file

__all__ = [
    "FORMATS",
    "HEAD_BYTES",
    "FileOptions",
    "Format",
    "Layout",
    "NoTableError",
    "Rows",
    "Table",
    "open_rows",
    "read_table",
    "read_tables",
]

_READ_EXCEL = sandboxed("excel", "python-calamine", "Excel files", "python_calamine")
_READ_HDF5 = sandboxed("hdf5", "h5py", "HDF5 files and MAT files of version 7.3")
_READ_MAT = sandboxed("mat", "scipy", "MAT files")
_READ_MDF = sandboxed("mdf", "asammdf", "MDF files")
_READ_PARQUET = sandboxed("parquet", "polars", "Parquet files")

# The first that recognises a file reads it.
FORMATS: tuple[Format, ...] = (
    Format("Parquet", (".parquet", ".pq"), is_parquet, _READ_PARQUET),
    Format("MAT", (".mat",), is_mat, _READ_MAT),
    Format("HDF5 and MAT v7.3", (".h5", ".hdf5", ".hdf"), is_hdf5, _READ_HDF5),
    Format("TDMS", (".tdms",), is_tdms, read_tdms),
    Format("MDF", (".mf4", ".mdf"), is_mdf, _READ_MDF),
    Format("NumPy archive", (".npz",), is_npz, read_npz),
    Format("Excel", (".xlsx", ".xlsm"), is_workbook, _READ_EXCEL),
    Format("LabVIEW text", (".lvm",), is_lvm, read_lvm),
    Format("logger text", (".txt",), is_logger, read_logger),
    Format("MTS 793 text", (".txt", ".dat"), is_mts, read_mts),
    Format("imc FAMOS", (".raw", ".dat"), is_famos, read_famos),
    Format("HBM catman", (".bin",), is_catman, read_catman),
    Format("universal file", (".unv", ".uff"), is_uff, read_uff),
    Format("JSON", (".json", ".jsonl"), is_json, read_json),
    Format("delimited text", (".csv", ".tsv", ".txt", ".dat", ".asc", ".prn", ".tra"), is_text, read_text),
)

_MOST_WHOLE = 20_000_000  # rows of a format that cannot be read in parts
_BYTES_OF_ROW = 400  # that preparing, fitting and scoring a run takes
_USUAL_MEMORY = 16 << 30  # where the system does not tell
HEAD_BYTES = 1 << 16
_TEXTS = (read_lvm, read_logger, read_mts, read_text)

# What is often given instead, and what to do about it.
_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"\x1f\x8b", "a gzip archive: unpack it first"),
    (b"7z\xbc\xaf", "a 7-Zip archive: unpack it first"),
    (b"Rar!", "a RAR archive: unpack it first"),
    (b"\xd0\xcf\x11\xe0", "an old Excel file (.xls): save it as .xlsx"),
    (b"%PDF", "a PDF: export the run as CSV"),
    (b"\x93NUMPY", "a single array of NumPy: save named ones with numpy.savez"),
    (b"\x80\x04", "a Python pickle, which is never opened: export the run as CSV or Parquet"),
    (b"\x80\x05", "a Python pickle, which is never opened: export the run as CSV or Parquet"),
)


class NoTableError(InputError):
    """A file that is whole and holds no columns of numbers: notes beside the runs, or their settings."""


def read_tables(path: Path, options: FileOptions | None = None) -> tuple[Table, ...]:
    """Return the tables in a file: its blocks, sheets, groups; one where ``options.part`` names it."""
    chosen = options or FileOptions()
    first = read_table(path, chosen)
    others = [read_table(path, replace(chosen, part=part)) for part in first.more]
    return tuple(table for each in (first, *others) for table in (each, *each.following))


def read_table(path: Path, options: FileOptions | None = None) -> Table:
    """Return the first table in a file, its format recognised by its content.

    One of more rows than memory holds the work on is refused before its columns are read.
    """
    with _reading(path):
        known = _recognised(path)
        if known.read in _TEXTS:
            require_memory(path, _about(path), "about ")
        table = known.read(path, options or FileOptions())
    require_memory(path, table.rows)
    return _with_numbers(table, path, table.rows)


def _rows_of(table: Table) -> ReadRows:
    """Return how rows of a table that was read whole are given."""
    return lambda names, row, count: [table.columns[name][row : row + count] for name in names]


def open_rows(path: Path, options: FileOptions | None = None) -> Rows:
    """Return a file whose rows are read a few at a time, where its format can; it is recognised as above.

    A format that cannot is read whole, up to 2e7 rows.
    """
    with _reading(path):
        known = _recognised(path)
        if known.read is read_text:
            text = open_text(path, options or FileOptions())
            _with_numbers(text.table, path, max((len(c) for c in text.table.columns.values()), default=0))
            return text
        table = known.read(path, options or FileOptions())
        _with_numbers(table, path, table.rows)
    if table.read_rows is None and table.rows > _MOST_WHOLE:
        raise InputError(
            place=path,
            found=f"a {table.layout.format} of {table.rows:.3g} rows is read whole",
            expected=f"at most {_MOST_WHOLE:.0e} rows in this format",
            remedy="Export it as Parquet, HDF5 or CSV, which are read in parts",
        )

    def read(names: Sequence[str], start: int, count: int) -> Iterator[list[FloatArray]]:
        read_rows = table.read_rows or _rows_of(table)
        for row in range(start, table.rows, count):
            with _reading(path):
                part = read_rows(names, row, count)
            if len({len(column) for column in part}) > 1:
                raise InputError(
                    place=path,
                    found="the columns differ in length",
                    expected="one value of each per row",
                )
            if not len(part[0]):
                return
            yield part

    return Rows(table, read)


def require_memory(path: Path, rows: int, how: str = "") -> None:
    """Refuse a file of more rows than can be worked on at once in this machine's memory."""
    memory = memory_bytes()
    most = memory // _BYTES_OF_ROW
    if rows > most:
        raise InputError(
            place=path,
            found=f"has {how}{rows:,} rows, too many for memory at once",
            expected=f"at most {most:,} in {memory / 1e9:.3g} GB",
            remedy=(
                "Count its cycles with: mrdamper cycles (with --model CARD a card goes along), which "
                "reads it in parts; or cut the file"
            ),
        )


def memory_bytes() -> int:
    """Return the memory that this process may have: the machine's, or its control group's."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # no such system
        memory = _USUAL_MEMORY
    with suppress(OSError, ValueError):  # "max": none
        memory = min(memory, int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    return memory


def _about(path: Path) -> int:
    """Return the rows of a text, by the length of its first lines."""
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    return path.stat().st_size * head.count(b"\n") // max(len(head), 1)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(place=path, found=f"cannot read the file ({error.strerror})") from error
    except MemoryError as error:
        raise InputError(place=path, found="needs more memory than there is; split the file") from error


def _with_numbers(table: Table, path: Path, rows: int) -> Table:
    if not table.columns or rows < 2:
        raise NoTableError(
            place=path, found="no columns of numbers found", expected="a header and rows of numbers"
        )
    return table


def _recognised(path: Path) -> Format:
    if require_file(path) == 0:
        raise InputError(place=path, found="the file is empty", expected="columns of numbers")
    with path.open("rb") as stream:
        head = stream.read(4096)
    if not head.strip() and len(head) < 4096:
        raise InputError(place=path, found="the file is empty", expected="columns of numbers")
    return _format_of(path, head[:512])


def _format_of(path: Path, head: bytes) -> Format:
    for start, said in _OTHERS:
        if head.startswith(start):
            raise InputError(place=path, found=f"is {said}")
    for known in FORMATS:
        if known.recognises(head):
            return known
    names = ", ".join(known.name for known in FORMATS)
    raise InputError(place=path, found=f"not a format that is read here ({names}); export the run as CSV")
