"""Long records: time and memory of ``mrdamper cycles`` over the rows of a Parquet file, and how exact it is.

The file is a sine of 200 samples a cycle beside a spring; its force fades from cycle to cycle, and the
energy of each is known in closed form, sampling included. With a model (Bouc-Wen, its viscosity and yield
force by current and temperature) the energy of its first cycles is held against the whole run in memory, as
``predict`` has it. Each size runs in a process of its own. Starting up, the page and the like cost the same
whatever the size: that is measured in the same process on a record of ``FIXED`` rows, once from the start and
once again; the exponent of the CPU time over rows is given both as it is and without it. ``full`` adds 1e8
rows (3 GB of disk for a while).
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from bench.growth import MOST_EXPONENT, exponent
from bench.measure import Asked, Row, cpu_clock

__all__ = ["run"]

SIZES, FULL = (1_000_000, 10_000_000), 100_000_000
FIXED = 2_000
MOST_MEMORY_MB = 1500.0
MOST_ERROR = 1e-12  # of a cycle's energy
MOST_OFF = 1e-9  # of the model's, against the whole run
_WHOLE = 400_000  # rows of the run that is held in memory: more than one window of the replay
_CYCLE, _FORCE_N, _STROKE_mm, _FADE = 200, 900.0, 10.0, 1e-7
_STEP_s, _CURRENT_A, _WARMING_K = 2e-3, 1.5, 1e-7
_ANGLE = 2.0 * math.pi / _CYCLE

_SMALL = "small.parquet"

Found = dict[str, float]


def run(*, full: bool = False) -> list[Row]:
    """Return time, memory and error by the number of rows, without and with a model."""
    sizes = (*SIZES, *((FULL,) if full else ()))
    with tempfile.TemporaryDirectory(prefix="mrdamper-") as place:
        card = Path(place) / "card.json"
        _write_card(card)
        _in_a_process("write", str(Path(place) / _SMALL), str(FIXED))
        found = [_measured(Path(place), rows, card) for rows in sizes]
    return [
        *_rows("cycles of a record, streamed from Parquet", sizes, [each[0] for each in found], MOST_ERROR),
        *_rows("the same with a model replayed", sizes, [each[1] for each in found], MOST_OFF),
    ]


def _rows(group: str, sizes: Sequence[int], found: Sequence[Found], most: float) -> list[Row]:
    """Return a row for each size."""
    what = "energy of a cycle" if most == MOST_ERROR else "the model's energy of a cycle"
    rows = [
        Row(
            f"{size:,} rows",
            each["cpu_s"],
            1e9 * (each["cpu_s"] - each["fixed_s"]) / size,
            accuracy=f"largest memory {each['memory_MB']:,.0f} MB; {what} to {each['error']:.1e}; fixed cost "
            f"{each['fixed_s']:.2f} s, not in the time per row",
            group=group,
            wall_s=each["wall_s"],
        )
        for size, each in zip(sizes, found, strict=True)
    ]
    work = [float(size) for size in sizes]
    asked = (
        Asked("largest memory", MOST_MEMORY_MB, max(each["memory_MB"] for each in found), "MB"),
        Asked(
            "exponent of the CPU time over rows",
            MOST_EXPONENT,
            exponent(work, [each["cpu_s"] for each in found]),
            "-",
        ),
        Asked(
            "the same without the fixed cost",
            MOST_EXPONENT,
            exponent(work, [each["cpu_s"] - each["fixed_s"] for each in found]),
            "-",
        ),
        Asked(f"worst relative error of {what}", most, max(each["error"] for each in found), "-"),
    )
    return [*rows[:-1], replace(rows[-1], asked=asked)]


def _measured(place: Path, rows: int, card: Path) -> tuple[Found, Found]:
    """Return what a record of so many rows costs, without and with the model."""
    record = place / "record.parquet"
    _in_a_process("write", str(record), str(rows))  # whose memory is not to count
    plain, out = _job_in_a_process(record, place / "plain")
    table = pl.read_csv(out, columns=["row", "energy_J"])
    number = (table["row"].to_numpy() + _CYCLE // 4) // _CYCLE
    force = _FORCE_N * (1.0 - _FADE * number)
    known = force * 1e-3 * _STROKE_mm * 0.5 * _CYCLE * math.sin(_ANGLE)
    if len(table) != rows // _CYCLE - 1:
        raise RuntimeError(f"stream: {len(table)} cycles in {rows} rows; expected {rows // _CYCLE - 1}")
    plain["error"] = float(np.abs(table["energy_J"].to_numpy() / known - 1.0).max())
    with_model, out = _job_in_a_process(record, place / "model", card)
    energy = pl.read_csv(out, columns=["model_energy_J"])["model_energy_J"].to_numpy()
    with_model["error"] = _off(record, energy)
    record.unlink()
    return plain, with_model


def _job_in_a_process(record: Path, out: Path, *card: Path) -> tuple[Found, Path]:
    found: Found = json.loads(_in_a_process("job", *map(str, (record, out, *card))))
    return found, out / "cycles.csv"


def _in_a_process(*asked: str) -> str:
    """Return what this module prints when asked on the command line."""
    command = [sys.executable, "-m", "bench.stream", *asked]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"stream: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return done.stdout


def _off(record: Path, energy: np.ndarray) -> float:
    """Return by how much the model's energies are off those of the whole run, the first cycles of it."""
    from mrdamper.data.prepare import prepare_run
    from mrdamper.data.records import RigRun
    from mrdamper.models.card_schema import read_card
    from mrdamper.models.simulate import simulate

    head = pl.scan_parquet(record).head(_WHOLE).collect()
    time, x, force, warm = (
        head[name].to_numpy() for name in ("time_s", "displacement_mm", "force_N", "temperature_degC")
    )
    run = RigRun("head", time, 1e-3 * x, force, np.full(len(x), _CURRENT_A), "A", temperature=warm + 273.15)
    path = prepare_run(run).trajectory
    path = replace(path, temperature=run.temperature)  # it drifts by less than what is called a drift
    modelled = simulate(read_card(record.parent / "card.json").damper, path)
    lows = np.arange(3 * _CYCLE // 4, len(x) - 2 * _CYCLE, _CYCLE)  # the run's end is smoothed as an end
    known = []
    for low in lows[:-1].tolist():
        k = slice(low, low + _CYCLE + 1)
        moved, pulled = run.displacement[k], modelled[k]
        closing = 0.5 * (pulled[0] + pulled[-1]) * (moved[0] - moved[-1])
        known.append(np.trapezoid(pulled, moved) + closing)
    return float(np.abs(energy[: len(known)] / np.array(known) - 1.0).max())


def _write(place: Path, rows: int) -> None:
    """Write the record, row group by row group."""
    number = pl.col("number").cast(pl.Float64)
    phase = (pl.col("number") % _CYCLE).cast(pl.Float64) * _ANGLE
    # cycles begin at the lower turning point, where the damper's force is nought
    force = _FORCE_N * (1.0 - _FADE * ((pl.col("number") + _CYCLE // 4) // _CYCLE).cast(pl.Float64))
    pl.LazyFrame().select(number=pl.int_range(rows)).select(
        time_s=number * _STEP_s,
        displacement_mm=_STROKE_mm * phase.sin(),
        force_N=force * phase.cos() + 500.0 * phase.sin(),
        current_A=pl.lit(_CURRENT_A),
        temperature_degC=20.0 + number * _WARMING_K,
    ).sink_parquet(place)


def _write_card(place: Path) -> None:
    from mrdamper.models.card import Evidence, ModelCard, write_card
    from mrdamper.models.damper import Damper, OperatingEnvelope
    from mrdamper.models.dependence import Constant, Polynomial, TemperatureDependent
    from mrdamper.models.laws import LAWS
    from mrdamper.models.temperature import Arrhenius, Linear

    damper = Damper(
        LAWS["bouc-wen"],
        {
            "viscosity": TemperatureDependent(Polynomial((600.0, 300.0)), Arrhenius(1511.0)),
            "stiffness": Constant(700.0),
            "yield_force": TemperatureDependent(Polynomial((60.0, 500.0)), Linear(1.5e-3)),
            "rho": Constant(1500.0),
            "kappa": Constant(-0.4),
            "n": Constant(1.6),
        },
    )
    envelope = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.2, 0.2), (288.15, 398.15))
    one = {"name": "none", "split": "training", "rmse_N": 0.0, "nrmse_percent": 0.0}
    evidence = Evidence(runs=(one,), method="varpro", cost=0.0, dataset_fingerprint="")
    write_card(ModelCard(title="", damper=damper, envelope=envelope, evidence=evidence), place)


def _job(record: Path, out: Path, card: Path | None = None) -> Found:
    """Return what the record costs a process that does nothing else."""
    from mrdamper.data.formats.sandbox import stop
    from mrdamper.jobs.cycles import cycles

    spent = []
    for each in (record.with_name(_SMALL), record.with_name(_SMALL), record):
        start = time.perf_counter()
        cycles(each, model=card, out=out)
        stop()  # what the process that decodes has used counts once it has ended
        spent.append(cpu_clock())
    wall = time.perf_counter() - start
    memory = _own_peak() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
    fixed, again, whole = np.diff(spent, prepend=0.0).tolist()
    return {"cpu_s": fixed + whole - again, "fixed_s": fixed, "wall_s": wall, "memory_MB": memory}


def _own_peak() -> float:
    """Return the largest memory of this program alone: that of ``getrusage`` may be its parent's."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) / 1024.0
    raise RuntimeError("stream: the system does not tell a process's memory")


if __name__ == "__main__" and sys.argv[1] == "write":
    _write(Path(sys.argv[2]), int(sys.argv[3]))
elif __name__ == "__main__":
    print(json.dumps(_job(*map(Path, sys.argv[2:]))))
