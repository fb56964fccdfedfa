"""Growth: how the cost of a job follows its size beyond what is fixed, and what memory it takes.

Rows of a file, runs of a campaign. Each size is run in a
process of its own, one after another, so that its largest memory is known.

A fixed cost flattens any total: it is fitted apart. What is held against a limit is the marginal cost, the
CPU time of a further sample between the last two sizes over that between the two before. ``full`` adds 1e8
rows of a file and the fit of 1000 runs.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import mrdamper
from bench.measure import Asked, Row, Timing, timed
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.population import Ensemble
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.settings import FitSettings
from mrdamper.identify.templates import template
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import open_drive, simulate

__all__ = ["line", "marginal", "run", "write_record"]

MOST_MARGINAL = 1.25
MOST_MEMORY_MB = 1500.0  # of 1e8 rows
LONG_S = 2.0  # a job that takes longer is timed once
MOST_BYTES = 10.0  # of memory, a further row
MOTION = Sine(0.010, 2.0)


@dataclass(frozen=True, slots=True)
class Kind:
    """What grows: its title, its sizes, those that ``full`` adds, and the file that it is read from."""

    title: str
    sizes: tuple[int, ...]
    more: tuple[int, ...] = ()
    file: str = ""


def _of_file(title: str, file: str) -> Kind:
    return Kind(title, (1_000_000, 4_000_000, 10_000_000), (100_000_000,), file)


KINDS = {
    "rows": _of_file("rows of a Parquet file, energy of every cycle", "record.parquet"),
    "lines": _of_file("rows of a CSV file, energy of every cycle", "record.csv"),
    "runs": Kind("samples of runs of 1,000, prepared and scored by 16 candidates", (10, 100, 1000)),
    "fitted": Kind("samples of runs of 1,000, variable projection from one start", (30, 100, 300), (1000,)),
}


def run(*, full: bool = False) -> list[Row]:
    """Return time and memory by size, and the marginal cost of each kind."""
    rows: list[Row] = []
    for name, kind in KINDS.items():
        found = [_in_a_process(name, size) for size in (*kind.sizes, *(kind.more if full else ()))]
        for each in found:
            timing = Timing(tuple(each["cpu"]), tuple(each["wall"]))
            memory = f"largest memory {each['memory_MB']:,.0f} MB"
            ns = 1e9 * timing.cpu_s / each["samples"]
            rows.append(Row(f"{name} {each['size']:,}", timing, ns, accuracy=memory, group=kind.title))
        work, cpu = [each["samples"] for each in found], [median(each["cpu"]) for each in found]
        (fixed, slope), further = line(work, cpu), marginal(work, cpu)
        said = f"{rows[-1].accuracy}; fixed {1e3 * fixed:.3g} ms, then {1e9 * slope:.3g} ns a sample"
        figure = f"marginal cost of a sample of {name}, over the size before"
        asked = Asked(figure, MOST_MARGINAL, further[-1] / further[-2], "x")
        rows[-1] = replace(rows[-1], accuracy=said, asked=(asked, *_memory_asked(name, found)))
    return rows


def line(sizes: Sequence[float], spent: Sequence[float]) -> tuple[float, float]:
    """Return the fixed time and that of a further unit of size, by least squares of the relative misfit."""
    n, t = np.asarray(sizes, dtype=np.float64), np.asarray(spent)
    fixed, slope = np.linalg.lstsq(np.column_stack([1.0 / t, n / t]), np.ones(len(n)), rcond=None)[0]
    return float(fixed), float(slope)


def marginal(sizes: Sequence[float], spent: Sequence[float]) -> list[float]:
    """Return the time of a further unit of size between each two sizes: what is fixed does not count."""
    return [(t - s) / (n - m) for (m, s), (n, t) in pairwise(zip(sizes, spent, strict=True))]


def _memory_asked(name: str, found: Sequence[dict[str, Any]]) -> tuple[Asked, ...]:
    """Return what is asked of the memory of a job that reads in batches: it does not grow with the file."""
    if not KINDS[name].file:
        return ()
    (early, least), (late, most) = ((each["size"], each["memory_MB"]) for each in (found[-2], found[-1]))
    flat = Asked(
        f"memory of a further one of {name}", MOST_BYTES, 1e6 * (most - least) / (late - early), "bytes"
    )
    return flat, Asked(f"memory of {late:,} {name}", MOST_MEMORY_MB, most, "MB")


# ------------------------------------------------------------------------------------ in a process of its own


def _in_a_process(kind: str, size: int) -> dict[str, Any]:
    if not KINDS[kind].file:
        return _told([kind, str(size)])
    with tempfile.TemporaryDirectory(prefix="mrdamper-growth-") as folder:
        file = str(Path(folder) / KINDS[kind].file)
        _told(["write", str(size), file])
        return _told([kind, str(size), file])


def _told(words: Sequence[str]) -> dict[str, Any]:
    """Run this module as a program; return what it prints."""
    command = [sys.executable, "-m", "bench.growth", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        fault = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(f"growth: {' '.join(words)}: {fault}")
    found: dict[str, Any] = json.loads(done.stdout or "{}")
    return found


def _measure(kind: str, size: int, *files: Path) -> dict[str, Any]:
    job, samples = MAKERS[kind](size, *files)
    begin = time.process_time()
    job()
    each = timed({kind: job}, repeats=5 if time.process_time() - begin < LONG_S else 1)[kind]
    # The largest of this process and, where a file is decoded by another, of that one beside it.
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)[: 2 if files else 1]
    memory = sum(resource.getrusage(who).ru_maxrss for who in both) / 1024.0
    return {"size": size, "samples": samples, "cpu": each.cpu, "wall": each.wall, "memory_MB": memory}


Made = tuple[Callable[[], object], int]


def _damper() -> Damper:
    values = {"viscosity": 600.0, "yield_force": 500.0, "rho": 1500.0, "kappa": -0.4, "n": 1.6}
    return Damper(LAWS["bouc-wen"], {name: Constant(value) for name, value in values.items()})


def _rows(size: int, file: Path) -> Made:
    def job() -> None:
        found = len(mrdamper.cycles(file).cycles)
        expected = size / 500  # samples of a period
        if not expected - 3 <= found <= expected:
            raise RuntimeError(f"{found} cycles were found, of {expected:g}")

    return job, size


def write_record(size: int, place: Path) -> None:
    """Write a file of so many rows, from one part that is repeated."""
    import polars as pl

    part = place.with_name("part.parquet")
    path = drive(MOTION, duration=999.999, rate_Hz=1000.0, command=1.5)
    force = simulate(_damper(), path)
    columns = {"displacement_mm": 1e3 * path.displacement, "force_N": force, "current_A": path.command}
    pl.DataFrame(columns).write_parquet(part)
    whole = pl.scan_parquet([part] * (size // len(path))).with_row_index("row")
    time_s = (pl.col("row") * 1e-3).alias("time_s")
    rows = whole.select(time_s, *columns)
    if place.suffix == ".csv":
        rows.sink_csv(place, float_precision=6)
    else:
        rows.sink_parquet(place, row_group_size=1 << 18)


def _campaign(size: int) -> list[PreparedRun]:
    """Return runs of 2 s at 500 Hz: three currents, motions that differ, 2 % noise."""
    damper = Damper(
        LAWS["bouc-wen"],
        {
            "viscosity": Polynomial((600.0, 300.0)),
            "stiffness": Constant(700.0),
            "yield_force": Polynomial((60.0, 500.0)),
            "rho": Constant(1500.0),
            "kappa": Constant(-0.4),
            "n": Constant(1.6),
        },
    )
    rng, runs = np.random.default_rng(3), []
    for index in range(size):
        command = float(index % 3)
        motion = Sine(rng.uniform(0.004, 0.012), rng.uniform(1.0, 3.0))
        path = drive(motion, duration=1.998, rate_Hz=500.0, command=command)
        force = simulate(damper, open_drive(path))
        force = force + 0.02 * float(np.std(force)) * rng.standard_normal(len(force))
        time_s = np.arange(len(force), dtype=np.float64) / 500.0
        runs.append(
            prepare_run(
                RigRun(f"run_{index:04d}", time_s, path.displacement, force, path.command, "A", path.velocity)
            )
        )
    return runs


def _runs(size: int) -> Made:
    runs = _campaign(max(size, 3))[:size]
    damper, free = template("bouc-wen", _campaign(3))
    problem = FitProblem(damper, free, tuple(runs), settings=FitSettings(rate_Hz=500.0))
    unit = np.random.default_rng(0).uniform(0.4, 0.6, (16, len(free)))
    return lambda: Ensemble(problem).costs(unit), 16 * 1_000 * size


def _fitted(size: int) -> Made:
    runs = _campaign(size)
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, tuple(runs), settings=FitSettings(rate_Hz=500.0))
    return partial(fit_variable_projection, problem, starts=1), 1_000 * size


MAKERS: dict[str, Callable[..., Made]] = {
    "rows": _rows,
    "lines": _rows,
    "runs": _runs,
    "fitted": _fitted,
}

if __name__ == "__main__" and sys.argv[1] == "write":
    write_record(int(sys.argv[2]), Path(sys.argv[3]))
elif __name__ == "__main__":
    print(json.dumps(_measure(sys.argv[1], int(sys.argv[2]), *map(Path, sys.argv[3:]))))
