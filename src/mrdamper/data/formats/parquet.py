"""Parquet files. The columns are read on use."""

from __future__ import annotations

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
    load_extra,
    require_room,
)


def read_parquet(path: Path, _options: FileOptions) -> Table:
    """Return the columns of a Parquet file. Times are in seconds from the first time."""
    pl = load_extra("polars", "polars", "Parquet files")
    file = pl.scan_parquet(path, glob=False)  # read_parquet_schema would read "run[1]" as "run1".
    schema = file.collect_schema()
    rows = int(file.select(pl.len()).collect().item())
    times = [name for name, dtype in schema.items() if dtype in (pl.Datetime, pl.Duration)]
    numbers = [name for name, dtype in schema.items() if dtype.is_numeric() or name in times]
    words = [name for name, dtype in schema.items() if dtype == pl.String]
    require_room(rows, path, next(iter(numbers), ""))
    return Table(
        names=tuple(name for name in schema if name in numbers or name in words),
        columns=OnUse({name: partial(_numbers, path, name) for name in numbers}),
        texts=OnUse({name: partial(_words, path, name) for name in words}),
        layout=Layout("Parquet file"),
        rows=rows if numbers else 0,
        units=dict.fromkeys(times, "s"),
    )


def _words(path: Path, name: str) -> Texts:
    import polars as pl

    return pl.read_parquet(path, columns=[name], glob=False)[name].to_list()


def _numbers(path: Path, name: str) -> FloatArray:
    import polars as pl

    column = pl.read_parquet(path, columns=[name], glob=False)[name]
    if column.dtype.is_numeric():
        column = column.cast(pl.Float64).fill_null(float("nan"))
    return as_column(column.to_numpy())[0]
