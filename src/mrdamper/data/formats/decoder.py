"""Reads files in a process of its own; ``sandbox`` asks, and ``runtime.worker`` says how the two talk.

Questions: ``{"open": path, "format": name, "options": {...}}`` gives what a table holds beside its columns,
``{"columns": names}`` their float64 values as parts, ``{"rows": names, "start": row, "count": rows}`` some
rows of columns as parts, ``{"text": name}`` the cells of a text column.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.excel import read_workbook
from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.mat import read_mat
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.errors import InputError
from mrdamper.runtime.worker_process import Handler, Reply
from mrdamper.schema import Json

READERS: Mapping[str, Callable[[Path, FileOptions], Table]] = MappingProxyType(
    {
        "excel": read_workbook,
        "hdf5": read_hdf5,
        "mat": read_mat,
        "mdf": read_mdf,
        "parquet": read_parquet,
    }
)


def leave_no_file() -> None:
    """Give no name to what libraries loaded from now on put aside: it goes with the process."""
    tempfile.NamedTemporaryFile = tempfile.TemporaryFile  # type: ignore[assignment]


def decoder() -> Handler:
    """Prepare this process; return what answers questions."""
    leave_no_file()
    os.environ["RUST_BACKTRACE"] = "0"  # which nobody would read, and takes a tenth of a second
    return Decoder()


class Decoder:
    """The last file that was opened."""

    def __init__(self) -> None:
        self._table: Table | None = None

    def __call__(self, question: Json) -> Reply:
        """Answer a question."""
        try:
            if "open" in question:
                reader = READERS[question["format"]]
                self._table = reader(Path(question["open"]), FileOptions(**question["options"]))
                return Reply(_beside_columns(self._table))
            assert self._table is not None, "a file is opened first"
            if "text" in question:
                return Reply({"cells": self._table.texts[question["text"]]})
            if "rows" in question:
                assert self._table.read_rows is not None, "this format is read whole"
                part = self._table.read_rows(question["rows"], question["start"], question["count"])
                if len({len(column) for column in part}) > 1:
                    raise InputError(
                        found="the columns differ in length", expected="one value of each per row"
                    )
                return Reply({}, list(map(_bytes, part)))
            return Reply({}, [_bytes(self._table.columns[name]) for name in question["columns"]])
        except OSError as fault:  # of the file, as its library tells it
            raise InputError(str(fault)) from fault
        except MemoryError as fault:
            raise InputError(
                place=f"{question.get('open', '')}", found="needs more memory than there is"
            ) from fault


def _beside_columns(table: Table) -> Json:
    return {
        "names": table.names,
        "texts": list(table.texts),
        "rows": table.rows,
        "units": dict(table.units),
        "clocks": dict(table.clocks),
        "stamps": sorted(table.stamps),
        "layout": table.layout.to_dict(),
        "by_rows": table.read_rows is not None,
        "step_s": table.step_s,
        "title": table.title,
        "said": list(table.said),
        "more": list(table.more),
    }


def _bytes(column: FloatArray) -> memoryview:
    return np.ascontiguousarray(column, dtype=np.float64).data.cast("B")
