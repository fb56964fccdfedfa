"""Start-up: CPU of a fresh process, the bare interpreter's taken off an import; NumPy and SciPy beside it.

``evaluate`` is the whole command on a small card and a run of 1,000 samples: interpreter, libraries, reading,
preparing, scoring, printing.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from bench.cards import write_plain
from bench.measure import Asked, Row, Timing, absent

__all__ = ["Process", "run"]

REPEATS = 5
MOST_MS = {"import mrdamper": 30.0, "mrdamper --help": 200.0, "mrdamper evaluate, a small card": 500.0}
COMMAND = "import sys; sys.argv[0] = 'mrdamper'; from mrdamper.cli import main; main()"
BARE = "python -c pass"
_COMPILES = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


@dataclass(slots=True)
class Process:
    """A process to start; what it is measured by."""

    command: list[str]
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    fault: str = ""
    most_megabytes: float = 0.0  # of its memory

    @classmethod
    def of(cls, words: list[str]) -> Process:
        """Return the process of a command of ours."""
        return cls([sys.executable, "-c", COMMAND, *words])

    @property
    def timing(self) -> Timing:
        """Its turns so far."""
        return Timing(tuple(self.cpu), tuple(self.wall))

    def start(self) -> None:
        """Run it once and keep its times."""
        begin = time.perf_counter()
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=said, env=_COMPILES)
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            wall = time.perf_counter() - begin
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
        if process.returncode:
            self.fault = (lines or ["no message"])[-1]
            return
        self.cpu.append(used.ru_utime + used.ru_stime)
        self.wall.append(wall)
        self.most_megabytes = max(self.most_megabytes, used.ru_maxrss / 1024.0)


def run(*, full: bool = False) -> list[Row]:
    """Return CPU of starting, the processes taking turns; ``full`` doubles the turns."""
    with tempfile.TemporaryDirectory() as name:
        card, measured = _small(Path(name))
        jobs = {
            BARE: Process([sys.executable, "-c", "pass"]),
            "mrdamper --help": Process.of(["--help"]),
            "mrdamper evaluate, a small card": Process.of(["evaluate", str(card), str(measured)]),
        }
        for library in ("mrdamper", "numpy", "scipy.integrate"):
            jobs[f"import {library}"] = Process([sys.executable, "-c", f"import {library}"])
        for _ in range((2 if full else 1) * REPEATS + 1):
            for job in jobs.values():
                job.start()
    for job in jobs.values():  # the first turn finds nothing in the system's cache
        job.cpu, job.wall = job.cpu[1:], job.wall[1:]
    bare = jobs[BARE].timing
    return [_row(title, job, bare) for title, job in jobs.items()]


def _row(title: str, job: Process, bare: Timing) -> Row:
    if job.fault:
        return absent(title, job.fault)
    timing = job.timing
    ratios = timing.over(bare)
    if title.startswith("import"):
        cpu = tuple(mine - nothing for mine, nothing in zip(timing.cpu, bare.cpu, strict=True))
        timing = replace(timing, cpu=cpu)
    most = MOST_MS.get(title)
    asked = () if most is None else (Asked(f"{title}, CPU", most, 1e3 * timing.cpu_s, "ms"),)
    return Row(title, timing, ratios=ratios, asked=asked)


def _small(folder: Path) -> tuple[Path, Path]:
    """Write a small card and a run of 2 s at 500 Hz; return the two files."""
    card = write_plain(folder)
    t = np.arange(1000) / 500.0
    speed = 0.01 * 4.0 * np.pi * np.cos(4.0 * np.pi * t)
    noise = np.random.default_rng(0).standard_normal((2, len(t)))
    columns = [t, 10.0 * np.sin(4.0 * np.pi * t) + 0.005 * noise[0]]
    columns += [500.0 * np.tanh(speed / 0.01) + 900.0 * speed + 3.0 * noise[1], np.ones_like(t)]
    head = "time_s,displacement_mm,force_N,current_A"
    np.savetxt(folder / "run.csv", np.column_stack(columns), "%.6f", ",", header=head, comments="")
    return card, folder / "run.csv"
