"""Long records: time and memory of ``mrdamper cycles`` over the rows of a Parquet file, and how exact it is.

The file is a sine of 200 samples a cycle beside a spring; its force fades from cycle to cycle, and the
energy of each is known in closed form, sampling included. Each size runs in a process of its own. The
exponent is that of the last two decades; ``full`` adds 1e8 rows (a GB of disk for a while).
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from bench.growth import MOST_EXPONENT, exponent
from bench.measure import Asked, Row, cpu_clock

__all__ = ["run"]

SIZES, FULL = (1_000_000, 10_000_000), 100_000_000
MOST_MEMORY_MB = 1500.0
MOST_ERROR = 1e-12  # of a cycle's energy
_CYCLE, _FORCE_N, _STROKE_mm, _FADE = 200, 900.0, 10.0, 1e-7
_ANGLE = 2.0 * math.pi / _CYCLE


def run(*, full: bool = False) -> list[Row]:
    """Return time, memory and error by the number of rows."""
    sizes = (*SIZES, *((FULL,) if full else ()))
    with tempfile.TemporaryDirectory(prefix="mrdamper-") as place:
        found = [_measured(Path(place), rows) for rows in sizes]
    rows = [
        Row(
            f"{size:,} rows",
            each["cpu_s"],
            1e9 * each["cpu_s"] / size,
            accuracy=f"largest memory {each['memory_MB']:,.0f} MB; energy of a cycle to {each['error']:.1e}",
            group="cycles of a record, streamed from Parquet",
            wall_s=each["wall_s"],
        )
        for size, each in zip(sizes, found, strict=True)
    ]
    asked = (
        Asked("largest memory", MOST_MEMORY_MB, max(each["memory_MB"] for each in found), "MB"),
        Asked(
            "exponent of the CPU time over rows",
            MOST_EXPONENT,
            exponent([float(size) for size in sizes], [each["cpu_s"] for each in found]),
            "-",
        ),
        Asked("worst relative error of a cycle's energy", MOST_ERROR, max(e["error"] for e in found), "-"),
    )
    rows[-1] = replace(rows[-1], asked=asked)
    return rows


def _measured(place: Path, rows: int) -> dict[str, float]:
    record, out = place / "record.parquet", place / "out"
    _write(record, rows)
    done = subprocess.run(
        [sys.executable, "-m", "bench.stream", str(record), str(out)],
        capture_output=True,
        text=True,
        check=False,
    )
    record.unlink()
    if done.returncode:
        raise RuntimeError(f"stream: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    found: dict[str, float] = json.loads(done.stdout)
    table = pl.read_csv(out / "cycles.csv", columns=["row", "energy_J"])
    number = (table["row"].to_numpy() + _CYCLE // 4) // _CYCLE
    force = _FORCE_N * (1.0 - _FADE * number)
    known = force * 1e-3 * _STROKE_mm * 0.5 * _CYCLE * math.sin(_ANGLE)
    if len(table) != rows // _CYCLE - 1:
        raise RuntimeError(f"stream: {len(table)} cycles in {rows} rows; expected {rows // _CYCLE - 1}")
    return found | {"error": float(np.abs(table["energy_J"].to_numpy() / known - 1.0).max())}


def _write(place: Path, rows: int) -> None:
    """Write the record, row group by row group."""
    number = pl.col("number").cast(pl.Float64)
    phase = (pl.col("number") % _CYCLE).cast(pl.Float64) * _ANGLE
    # cycles begin at the lower turning point, where the damper's force is nought
    force = _FORCE_N * (1.0 - _FADE * ((pl.col("number") + _CYCLE // 4) // _CYCLE).cast(pl.Float64))
    pl.LazyFrame().select(number=pl.int_range(rows)).select(
        time_s=number * 2e-3,
        displacement_mm=_STROKE_mm * phase.sin(),
        force_N=force * phase.cos() + 500.0 * phase.sin(),
        current_A=pl.lit(1.5),
        temperature_degC=20.0 + number * 1e-7,
    ).sink_parquet(place)


def _job(record: Path, out: Path) -> dict[str, float]:
    from mrdamper.app.cycles_job import cycles

    start = time.perf_counter()
    cycles(record, out=out)
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    memory = sum(resource.getrusage(each).ru_maxrss for each in who) / 1024.0
    return {"cpu_s": cpu_clock(), "wall_s": time.perf_counter() - start, "memory_MB": memory}


if __name__ == "__main__":
    print(json.dumps(_job(Path(sys.argv[1]), Path(sys.argv[2]))))
