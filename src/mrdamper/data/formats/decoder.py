"""The process that decodes files whose libraries can crash; ``isolated`` starts it and asks.

Run as ``python -m mrdamper.data.formats.decoder``. Each question is a line of JSON on standard input, each
answer one on standard output: ``{"open": path, "format": name, "options": {...}}`` gives what a table holds
beside its columns, ``{"column": name}`` how many samples follow as float64 bytes, ``{"rows": names, "start":
row, "count": rows}`` how many of each column follow, ``{"text": name}`` the cells of a text column. An answer
with ``error`` is the message of an ``InputError``.

The process may not take more memory than ``_MOST_SHARE`` of the machine's, nor than ``_MOST_BYTES``: what a
small file unpacks to ends this process, not the user's others. Nor may it take more processor time for a
question than its ``seconds``: what loops for ever ends, even where nobody waits any more. It leaves no core,
and no temporary file.
"""

from __future__ import annotations

import json
import math
import os
import resource
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, NoReturn

import numpy as np

from mrdamper.data.formats.excel import read_workbook
from mrdamper.data.formats.hdf5 import read_hdf5
from mrdamper.data.formats.mat import read_mat
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.errors import InputError

__all__ = ["READERS", "hold_memory", "hold_time", "leave_no_file", "main", "serve"]

_MOST_BYTES = 12 << 30  # three times the longest column that is read
_MOST_SHARE = 0.75

READERS: Mapping[str, Callable[[Path, FileOptions], Table]] = MappingProxyType(
    {
        "excel": read_workbook,
        "hdf5": read_hdf5,
        "mat": read_mat,
        "mdf": read_mdf,
        "parquet": read_parquet,
    }
)


def hold_memory(most_bytes: float = _MOST_BYTES) -> None:
    """Bound the memory of this process; what asks for more gets an error, or ends it."""
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = int(min(most_bytes, _MOST_SHARE * machine))
    resource.setrlimit(
        resource.RLIMIT_DATA, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard)
    )


def hold_time(seconds: float) -> None:
    """Bound the processor time that this process may take from now on, on each of its processors."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    most = math.ceil(used.ru_utime + used.ru_stime + seconds * (os.cpu_count() or 1)) + 1
    resource.setrlimit(
        resource.RLIMIT_CPU, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard)
    )


def leave_no_file() -> None:
    """Give no name to what libraries loaded from now on put aside: it goes with the process."""
    tempfile.NamedTemporaryFile = tempfile.TemporaryFile  # type: ignore[assignment]


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer questions until they end."""
    table: Table | None = None
    for line in questions:
        question = json.loads(line)
        hold_time(question["seconds"])
        try:
            if "open" in question:
                reader = READERS[question["format"]]
                table = reader(Path(question["open"]), FileOptions(**question["options"]))
                _say(answers, _beside_columns(table))
            elif "text" in question and table is not None:
                _say(answers, {"cells": table.texts[question["text"]]})
            elif "rows" in question and table is not None and table.read_rows is not None:
                part = table.read_rows(question["rows"], question["start"], question["count"])
                if len({len(column) for column in part}) > 1:
                    raise InputError("the columns differ in length; expected one value of each per row")
                _say(answers, {"samples": len(part[0])})
                for column in part:
                    answers.write(np.ascontiguousarray(column, dtype=np.float64).data.cast("B"))
            elif table is not None:
                values = np.ascontiguousarray(table.columns[question["column"]], dtype=np.float64)
                _say(answers, {"samples": len(values)})
                answers.write(values.data.cast("B"))
        except (InputError, OSError) as error:
            _say(answers, {"error": str(error)})
        except MemoryError:
            _say(answers, {"error": f"{question.get('open', '')}: needs more memory than there is"})
        answers.flush()


def _beside_columns(table: Table) -> dict[str, Any]:
    return {
        "names": table.names,
        "texts": list(table.texts),
        "rows": table.rows,
        "units": dict(table.units),
        "clocks": dict(table.clocks),
        "stamps": sorted(table.stamps),
        "layout": table.layout.to_dict(),
        "by_rows": table.read_rows is not None,
    }


def _say(answers: IO[bytes], value: Mapping[str, Any]) -> None:
    answers.write(json.dumps(value).encode() + b"\n")


def main() -> NoReturn:
    """Serve standard input and output until the questions end."""
    hold_memory()
    leave_no_file()
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    os.environ["RUST_BACKTRACE"] = "0"  # which nobody would read, and takes a tenth of a second
    kept = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    serve(os.fdopen(0, "rb"), kept)
    kept.flush()
    os._exit(0)  # closing what is left may crash


if __name__ == "__main__":
    main()
