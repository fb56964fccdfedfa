"""Targets: binary formats. Decoders of compiled libraries are asked in a process of their own, as for users.

``tdms`` runs the reader in this process, where its branches are seen. Excel, HDF5, MAT, MDF and Parquet,
whose libraries a damaged file can crash, go through the door that a user's file goes through: whatever the
library does to its process, one message comes back.
"""

from __future__ import annotations

import io
import zipfile
from functools import cache

from fuzz.contract import promised, require, sound_table, taking, written
from fuzz.seeds import workbook
from mrdamper.data.formats.tdms import read_tdms
from mrdamper.data.tables import read_table

__all__ = ["excel_sheet", "isolated", "tdms"]


tdms = taking("input.tdms", read_tdms)


def excel_sheet(content: bytes) -> None:
    """The one sheet of a workbook: the archive is sound, its XML is what the bytes say."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_STORED) as archive:
        for name, part in _parts().items():
            archive.writestr(name, content if name.startswith("xl/worksheets/") else part)
    isolated(b"PK", made.getvalue())


@cache
def _parts() -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(workbook())) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def isolated(start: bytes, content: bytes) -> None:
    """A format that begins with ``start``, through the door; numbers of a crash are asked for as well."""
    path = written("input.bin", start + content[len(start) :])
    with promised("input.bin"):
        table = read_table(path)
        require(table.rows > 1, "a table of one row")
        sound_table(table)
