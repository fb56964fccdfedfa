"""Parquet: columns that are read when asked for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.table import (
    FileOptions,
    Layout,
    OnUse,
    Table,
    Texts,
    as_column,
    decoding,
    require_room,
    whole_columns,
)

_REMEDY = "write it again"


def is_parquet(head: bytes) -> bool:
    """Tell whether the first bytes are those of a Parquet file."""
    return head.startswith(b"PAR1")


def read_parquet(path: Path, _options: FileOptions) -> Table:
    """Return the columns of a Parquet file; a column of times is in seconds from its first."""
    import polars as pl

    with decoding(path, "Parquet file", _REMEDY):
        file = pl.scan_parquet(path, glob=False)  # read_parquet_schema would take "run[1]" for "run1"
        schema = file.collect_schema()
        rows = int(file.select(pl.len()).collect().item())
    times = [name for name, dtype in schema.items() if dtype in (pl.Datetime, pl.Duration)]
    numbers = [name for name, dtype in schema.items() if dtype.is_numeric() or name in times]
    words = [name for name, dtype in schema.items() if dtype == pl.String]
    require_room(rows, path, next(iter(numbers), ""))
    return Table(
        names=tuple(name for name in schema if name in numbers or name in words),
        columns=whole_columns(numbers, partial(_rows, path)),
        texts=OnUse({name: partial(_words, path, name) for name in words}),
        layout=Layout("Parquet file"),
        rows=rows if numbers else 0,
        units=dict.fromkeys(times, "s"),
        read_rows=partial(_rows, path),
    )


def _words(path: Path, name: str) -> Texts:
    import polars as pl

    with decoding(path, "Parquet file", _REMEDY):
        return pl.read_parquet(path, columns=[name], glob=False)[name].to_list()


def _rows(path: Path, names: Sequence[str], start: int, count: int) -> list[FloatArray]:
    """Return some rows of columns of numbers; times count from the first row of the file."""
    import polars as pl

    with decoding(path, "Parquet file", _REMEDY):
        part = pl.scan_parquet(path, glob=False).select(names).slice(start, count).collect()
        columns = []
        for name in names:
            column = part[name]
            if not column.dtype.is_numeric():
                first = pl.scan_parquet(path, glob=False).select(name).head(1).collect()[name]
                column = pl.concat([first, column])
                columns.append(as_column(column.to_numpy())[0][1:])
            else:
                columns.append(as_column(column.cast(pl.Float64).fill_null(float("nan")).to_numpy())[0])
        return columns
