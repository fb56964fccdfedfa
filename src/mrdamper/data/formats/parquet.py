"""Parquet files, read by Polars."""

from __future__ import annotations

from pathlib import Path

from mrdamper.data.formats.table import FileOptions, Layout, Table, as_column, load_extra


def read_parquet(path: Path, _options: FileOptions) -> Table:
    """Return the columns of a Parquet file. Times are in seconds from the first time."""
    pl = load_extra("polars", "polars", "Parquet files")
    file = pl.scan_parquet(path, glob=False)  # read_parquet_schema would read "run[1]" as "run1".
    schema = file.collect_schema()
    times = [name for name, dtype in schema.items() if dtype in (pl.Datetime, pl.Duration)]
    plain = [name for name, dtype in schema.items() if dtype.is_numeric()]
    words = [name for name, dtype in schema.items() if dtype == pl.String]
    frame = file.select(pl.col(plain).cast(pl.Float64), pl.col(times + words)).collect()
    return Table(
        names=tuple(name for name in schema if name in frame.columns),
        columns={name: as_column(frame[name].to_numpy())[0] for name in plain + times},
        texts={name: frame[name].to_list() for name in words},
        layout=Layout("Parquet file"),
        rows=frame.height if plain or times else 0,
        units=dict.fromkeys(times, "s"),
    )
