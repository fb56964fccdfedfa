"""Growth: how the cost of a job follows its size, as the exponent of CPU time, and what memory it takes.

Samples of one run, as a whole and in batches, rows of a Parquet file, candidates of an ensemble, runs of a
campaign, threads. Each size is run in a process of its own, one after another, so that its largest memory is
known; a size's CPU time is the median of its repeats there.

The exponent is the slope of log CPU time over log work by least squares. It is fitted twice, and the larger
is held against what was asked: over all sizes of at least ``LEAST_WORK`` samples, where a fixed cost flattens
it, and over the last two decades, where it hardly does. A fixed cost does not count in the marginal one, the
CPU time of a further sample between two sizes: that of the last two is held against that of the two before.
``full`` adds 1e8 samples of a run in one piece (some
5 GB), 1e8 rows of a file and the fit of 1000 runs.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import log
from pathlib import Path
from statistics import linear_regression

import numpy as np

import mrdamper
from bench.cards import card_of
from bench.measure import Asked, Row, timed
from bench.problem import Problem
from mrdamper import core
from mrdamper.data.formats.sandbox import stop
from mrdamper.data.prepare import PreparedRun, prepare_run
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine, drive
from mrdamper.identify.problem import FitProblem
from mrdamper.identify.search.variable_projection import fit_variable_projection
from mrdamper.identify.templates import template
from mrdamper.models.card_schema import write_card
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant, Polynomial
from mrdamper.models.laws import LAWS
from mrdamper.models.simulate import RunState, finish_run, open_drive, simulate, simulate_batch

__all__ = ["LEAST_WORK", "exponent", "marginal", "run", "write_record"]

MOST_EXPONENT, MOST_MARGINAL = 1.05, 1.25
LEAST_WORK = 1e4  # samples
MOST_MEMORY_MB = 1500.0  # of 1e8 rows
MOST_BYTES = 10.0  # of memory, a further row
BATCH = 262_000  # samples: whole periods of the motion below
MOTION = Sine(0.010, 2.0)
SIZES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {  # usual, and what `full` adds
    "samples": ((10_000, 100_000, 1_000_000, 10_000_000), (100_000_000,)),
    "batches": ((1_000_000, 10_000_000, 100_000_000), ()),
    "rows": ((1_000_000, 10_000_000), (100_000_000,)),
    "lines": ((1_000_000, 10_000_000), (100_000_000,)),
    "replayed": ((1_000_000, 10_000_000), (100_000_000,)),
    "candidates": ((1, 16, 256, 1024, 4096), ()),
    "runs": ((1, 10, 100, 1000), ()),
    "fitted": ((3, 30, 100), (1000,)),
    "threads": ((1, 2), ()),
}
OF_FILES = {"rows": "record.parquet", "lines": "record.csv", "replayed": "record.parquet"}
JOBS = {
    "samples": "samples of one run, force and squared error",
    "batches": f"samples of one run in batches of {BATCH:,} that carry the state on, force",
    "rows": "rows of a Parquet file, energy of every cycle",
    "lines": "rows of a CSV file, energy of every cycle",
    "replayed": "rows of a Parquet file with a model replayed",
    "candidates": "candidates, 2,000 samples each",
    "runs": "runs of 1,000 samples prepared and scored by 16 candidates",
    "fitted": "runs of 1,000 samples, variable projection from one start",
    "threads": "threads on 1024 candidates of 2,000 samples",
}


def run(*, full: bool = False) -> list[Row]:
    """Return time and memory by size, and the exponent of each."""
    rows = []
    for kind, (usual, more) in SIZES.items():
        found = [_in_a_process(kind, size) for size in (*usual, *(more if full else ()))]
        work = [float(each["samples"]) for each in found]
        cpu = [float(each["cpu_s"]) for each in found]
        for each in found:
            rows.append(
                Row(
                    f"{kind} {each['size']:,}",
                    each["cpu_s"],
                    1e9 * each["cpu_s"] / each["samples"],
                    each["cpu_s"] / cpu[0],
                    f"largest memory {each['memory_MB']:,.0f} MB",
                    group=JOBS[kind],
                    wall_s=each["wall_s"],
                    spread=(each["low"], each["high"]),
                )
            )
        if kind == "threads":  # as much work on more threads: what they cost, and what they give
            over = Asked("two threads, CPU time over one thread's", 1.15, cpu[1] / cpu[0], "x")
            gain = found[0]["wall_s"] / found[1]["wall_s"]
            said = f"{gain:.2f} x as fast by the clock, whatever else the machine does"
            rows[-1] = replace(rows[-1], accuracy=said, asked=(over,))
            continue
        over_all, steepest = exponent(work, cpu, LEAST_WORK), exponent(work, cpu, max(work) / 100.0)
        asked = Asked(f"exponent of the CPU time over {kind}", MOST_EXPONENT, max(over_all, steepest), "-")
        said = f"{rows[-1].accuracy}; exponent {over_all:.3f}, over the last two decades {steepest:.3f}"
        each = marginal(work, cpu)
        said += f"; marginal cost {1e9 * each[-1]:.3g} ns a sample"
        steady = (
            Asked(
                f"marginal cost of a sample of {kind}, over the size before",
                MOST_MARGINAL,
                each[-1] / each[-2],
                "x",
            )
            if len(each) > 1
            else None
        )
        figures = (asked, *((steady,) if steady else ()), *_memory_asked(kind, found))
        rows[-1] = replace(rows[-1], accuracy=said, asked=figures)
    return rows


def exponent(sizes: Sequence[float], spent: Sequence[float], least: float = LEAST_WORK) -> float:
    """Return the slope of log time over log size by least squares, for sizes of at least ``least``."""
    chosen = [(log(n), log(t)) for n, t in zip(sizes, spent, strict=True) if n >= least * (1.0 - 1e-9)]
    return float(linear_regression(*zip(*chosen, strict=True)).slope)


def marginal(sizes: Sequence[float], spent: Sequence[float]) -> list[float]:
    """Return the time of a further unit of size between each two sizes: what is fixed does not count."""
    return [(t - s) / (n - m) for (m, s), (n, t) in pairwise(zip(sizes, spent, strict=True))]


def _memory_asked(kind: str, found: Sequence[dict[str, float]]) -> tuple[Asked, ...]:
    """Return what is asked of the memory of a job that works in batches: that size does not matter to it."""
    if kind not in ("batches", *OF_FILES):
        return ()
    least, most = found[0]["memory_MB"], found[-1]["memory_MB"]
    flat = Asked(f"memory of the most {kind} over that of the least", 1.25, most / least, "x")
    figure = f"memory of {found[-1]['size']:,} {kind}"
    if kind == "lines":  # a decoder's arenas fill up in the first million rows
        more = 1e6 * (most - least) / (found[-1]["size"] - found[0]["size"])
        flat = Asked("memory of a further row of a CSV file", MOST_BYTES, more, "bytes")
    return flat, Asked(figure, MOST_MEMORY_MB, most, "MB")


# ------------------------------------------------------------------------------------ in a process of its own


def _in_a_process(kind: str, size: int) -> dict[str, float]:
    if kind not in OF_FILES:
        return _told([kind, str(size)])
    with tempfile.TemporaryDirectory(prefix="mrdamper-growth-") as folder:
        file = str(Path(folder) / OF_FILES[kind])
        _told(["write", str(size), file])
        return _told([kind, str(size), file])


def _told(words: Sequence[str]) -> dict[str, float]:
    """Run this module as a program; return what it prints."""
    command = [sys.executable, "-m", "bench.growth", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        fault = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise RuntimeError(f"growth: {' '.join(words)}: {fault}")
    found: dict[str, float] = json.loads(done.stdout or "{}")
    return found


def _measure(kind: str, size: int, *files: Path) -> dict[str, float]:
    job, samples = MAKERS[kind](size, *files)
    begin = time.process_time()
    job()
    once = time.process_time() - begin
    each = timed({kind: job}, repeats=max(1, min(15, int(1.0 / max(once, 1e-6)))))[kind]
    # The largest of this process and, where a file is decoded by another, of that one beside it.
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)[: 2 if kind in OF_FILES else 1]
    memory = sum(resource.getrusage(who).ru_maxrss for who in both) / 1024.0
    low, high = each.spread
    found = {"size": size, "samples": samples, "cpu_s": each.cpu_s, "wall_s": each.wall_s}
    return found | {"low": low, "high": high, "memory_MB": memory}


Made = tuple[Callable[[], object], int]


def _samples(size: int) -> Made:
    problem = Problem(candidates=1, samples=size)
    record, table, measured = problem.record, problem.coefficients, [np.zeros(size)]
    return partial(core.squared_errors, LAWS["bouc-wen"].kernel or 0, [record], measured, [0], table), size


def _damper() -> Damper:
    values = {"viscosity": 600.0, "yield_force": 500.0, "rho": 1500.0, "kappa": -0.4, "n": 1.6}
    return Damper(LAWS["bouc-wen"], {name: Constant(value) for name, value in values.items()})


def _batches(size: int) -> Made:
    """Make one run of the same whole periods again and again: its making is not what is timed."""
    batch = drive(MOTION, duration=(BATCH - 1) / 1000.0, rate_Hz=1000.0, command=1.0)
    count = -(-size // BATCH)

    def job() -> None:
        damper, state = _damper(), RunState()
        for _ in range(count):
            _, state = simulate_batch(damper, batch, state)
        _, state = finish_run(damper, state)
        if state.answered != count * BATCH:
            raise RuntimeError(f"{state.answered} of {count * BATCH} samples were answered")

    return job, count * BATCH


def _rows(size: int, file: Path, *, card: Path | None = None) -> Made:
    def job() -> None:
        found = mrdamper.cycles(file, card).cycles
        stop()  # what the process that decodes has used counts once it has ended
        expected = size / 500  # samples of a period
        if not expected - 3 <= found <= expected:
            raise RuntimeError(f"{found} cycles were found, of {expected:g}")

    return job, size


def _replayed(size: int, file: Path) -> Made:
    card = file.with_name("card.json")
    write_card(card_of(_damper()), card)
    return _rows(size, file, card=card)


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


def _candidates(size: int) -> Made:
    problem = Problem(candidates=size, samples=2_000)
    table, measured = problem.coefficients, [problem.measured]
    return partial(
        core.squared_errors, LAWS["bouc-wen"].kernel or 0, [problem.record], measured, [0], table
    ), 2_000 * size


def _threads(size: int) -> Made:
    problem = Problem(candidates=1024, samples=2_000)
    record, measured = problem.record, [problem.measured]
    parts = np.array_split(problem.coefficients, size)

    def job() -> None:
        with ThreadPoolExecutor(size) as pool:
            list(pool.map(lambda part: core.squared_errors(0, [record], measured, [0], part), parts))

    return job, 2_000 * 1024


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
                RigRun(
                    f"run_{index:04d}",
                    time_s,
                    path.displacement,
                    force,
                    path.command,
                    "A",
                    velocity=path.velocity,
                )
            )
        )
    return runs


def _runs(size: int) -> Made:
    from mrdamper.identify.search.population import Ensemble

    runs = _campaign(max(size, 3))[:size]
    damper, free = template("bouc-wen", _campaign(3))
    problem = FitProblem(damper, free, tuple(runs), rate_Hz=500.0)
    unit = np.random.default_rng(0).uniform(0.4, 0.6, (16, len(free)))
    return lambda: Ensemble(problem).costs(unit), 16 * 1_000 * size


def _fitted(size: int) -> Made:
    runs = _campaign(size)
    damper, free = template("bouc-wen", runs)
    problem = FitProblem(damper, free, tuple(runs), rate_Hz=500.0)
    return partial(fit_variable_projection, problem, starts=1), 1_000 * size


MAKERS: dict[str, Callable[..., Made]] = {
    "samples": _samples,
    "batches": _batches,
    "rows": _rows,
    "lines": _rows,
    "replayed": _replayed,
    "candidates": _candidates,
    "runs": _runs,
    "fitted": _fitted,
    "threads": _threads,
}

if __name__ == "__main__" and sys.argv[1] == "write":
    write_record(int(sys.argv[2]), Path(sys.argv[3]))
elif __name__ == "__main__":
    print(json.dumps(_measure(sys.argv[1], int(sys.argv[2]), *map(Path, sys.argv[3:]))))
