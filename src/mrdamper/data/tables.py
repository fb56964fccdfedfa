"""Tables: the numeric columns of a rig file, before quantities are assigned to the columns."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

from mrdamper.data.formats.excel import WORKBOOK_SIGNATURES, read_workbook
from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.lvm import read_lvm
from mrdamper.data.formats.mat import is_mat, read_mat, read_octave
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.objects import read_json, read_npz
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions, Format, NoTableError, Table
from mrdamper.data.formats.tdms import read_tdms
from mrdamper.data.formats.text import is_text, read_text
from mrdamper.data.formats.uff import read_uff
from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import require_file

# A text may begin with the byte order mark of UTF-8.
_LABVIEW = re.compile(rb"(?:\xef\xbb\xbf)?LabVIEW Measurement")
_WORKBOOK = re.compile(b"|".join(WORKBOOK_SIGNATURES))
_JSON = re.compile(rb"(?:\xef\xbb\xbf)?\s*(\{\s*[\"}]|\[\s*[\[{\"\d-])")  # The title "[Setup]" is not JSON.

# The first format that recognises the first bytes of a file reads it.
FORMATS: tuple[Format, ...] = (
    Format("Parquet", (".parquet", ".pq"), re.compile(rb"PAR1").match, read_parquet),
    Format("MAT", (".mat",), is_mat, read_mat),
    Format("HDF5", (".h5", ".hdf5", ".hdf"), re.compile(rb"\x89HDF|MATLAB 7\.3").match, read_hdf5),
    Format("TDMS", (".tdms",), re.compile(rb"TDSm").match, read_tdms),
    Format("MDF", (".mf4", ".mdf"), re.compile(rb"MDF     |UnFinMF ").match, read_mdf),
    Format("NumPy archive", (".npz",), re.compile(rb"(?s)PK\x03\x04.*\.npy").match, read_npz),
    Format("Excel", (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"), _WORKBOOK.match, read_workbook),
    Format("LabVIEW text", (".lvm",), _LABVIEW.match, read_lvm),
    Format("universal", (".unv", ".uff"), re.compile(rb"\s*-1\s*\r?\n\s*\d+").match, read_uff),
    Format("JSON", (".json", ".jsonl"), _JSON.match, read_json),
    Format("Octave", (), re.compile(rb"# Created by Octave|# name: \w+\r?\n# type: ").match, read_octave),
    Format("delimited text", (".csv", ".tsv", ".txt", ".dat", ".asc", ".prn", ".tra"), is_text, read_text),
)

HEAD_BYTES = 1 << 16

# Unsupported files that users often select by mistake, each with a remedy.
_UNSUPPORTED: tuple[tuple[bytes, str], ...] = (
    (b"7z\xbc\xaf", "a 7-Zip archive: unpack it first"),
    (b"Rar!", "a RAR archive: unpack it first"),
    (b"%PDF", "a PDF: export the run as CSV"),
    (b"\x93NUMPY", "a single array of NumPy: save named ones with numpy.savez"),
    (b"\x80[\x04\x05]", "a Python pickle, which is never opened: export the run as CSV or Parquet"),
    (rb"\|CF,", "an imc FAMOS file: convert it to CSV with imctermite (Python), or export it in FAMOS"),
    (b"[\x91-\xa5]\x13", "an HBM catman file: convert it to CSV with apread (Python), or export it as text"),
)


def read_tables(path: Path, options: FileOptions | None = None) -> tuple[Table, ...]:
    """Return the tables in a file (blocks, sheets or groups), or only those in the part ``options.part``."""
    chosen = options or FileOptions()
    first = read_table(path, chosen)
    others = [read_table(path, replace(chosen, part=part)) for part in first.more]
    return tuple(table for item in (first, *others) for table in (item, *item.following))


def read_table(path: Path, options: FileOptions | None = None) -> Table:
    """Return the first table in a file. Raise InputError if the file is unreadable or has no numbers."""
    try:
        known = _recognise_format(path)
        with nullcontext() if known.read in {read_lvm, read_text} else decoding(path, known.name):
            table = known.read(path, options or FileOptions())
    except OSError as error:
        raise InputError(place=path, found=f"cannot read the file ({error.strerror})") from error
    except MemoryError as error:
        found = "needs more memory than there is; split the file"
        raise InputError(place=path, found=found) from error
    if not table.columns or table.rows < 2:
        notes = f" ({'; '.join(table.layout.notes)})" if table.layout.notes else ""
        found = f"no columns of numbers found{notes}"
        raise NoTableError(place=path, found=found, expected="a header and rows of numbers")
    return table


@contextmanager
def decoding(path: Path, what: str) -> Iterator[None]:
    """Convert each exception of a library that decodes a binary file into one ``InputError``.

    The libraries raise undocumented exceptions on damaged bytes. Their messages and logs describe their own
    code and do not help the user. Interrupts pass.
    """
    logging.disable()  # npTDMS and asammdf log damaged bytes.
    try:
        yield
    except (MrdamperError, MemoryError):
        raise
    except BaseException as error:
        if isinstance(error.__context__, KeyboardInterrupt):  # A library hides Ctrl-C.
            raise error.__context__ from None
        # A panic of Polars is not an Exception.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        found = f"not a readable {what} file: it is damaged, cut off, or of an unknown version"
        raise InputError(place=path, found=found, remedy="Copy it again, or export the run as CSV") from error
    finally:
        logging.disable(logging.NOTSET)


def _recognise_format(path: Path) -> Format:
    require_file(path)
    with path.open("rb") as stream:
        head = stream.read(4096)
    if not head.strip() and len(head) < 4096:
        raise InputError(place=path, found="the file is empty", expected="columns of numbers")
    for start, description in _UNSUPPORTED:
        if re.match(start, head):
            raise InputError(place=path, found=f"is {description}")
    for known in FORMATS:
        if known.recognises(head[:512]):
            return known
    names = ", ".join(known.name for known in FORMATS)
    raise InputError(place=path, found=f"not a format that is read here ({names}); export the run as CSV")
