"""Start-up: CPU of a fresh process, the bare interpreter's taken off an import; other libraries beside it.

``predict`` is the whole command on a small card and a run of 1,000 samples: interpreter, libraries, reading,
preparing, scoring, printing. The peers whose pins do not go with ours are started in an environment of their
own (``peers``), with the same interpreter; their share of it is taken off in the same way.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median, quantiles

import numpy as np

from bench import peers
from bench.cards import write_plain
from bench.measure import Asked, Row, absent

__all__ = ["COMMAND", "Process", "run"]

REPEATS = 7
OURS, BESIDE = "ours", "a user would import instead"
OTHERS = ("scipy.integrate", "jax", "numba", "diffrax")  # in our environment
MOST_S = {"import mrdamper": 0.030, "mrdamper --help": 0.200, "mrdamper predict, a small card": 0.500}
COMMAND = "import sys; sys.argv[0] = 'mrdamper'; from mrdamper.cli import main; main()"


@dataclass(slots=True)
class Process:
    """A process to start; what it is measured by."""

    command: list[str]
    bare: str = ""  # the job whose time is taken off
    group: str = OURS
    version: str = ""
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)
    fault: str = ""
    most_megabytes: float = 0.0  # of its memory

    @classmethod
    def of(cls, words: list[str]) -> Process:
        """Return the process of a command of ours."""
        return cls([sys.executable, "-c", COMMAND, *words])

    def start(self) -> None:
        """Run it once and keep its times."""
        begin = time.perf_counter()
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=said)
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
        jobs = _jobs(Path(name))
        for turn in range((2 if full else 1) * REPEATS + 1):
            for job in jobs.values():
                if not job.fault:
                    job.start()
            if not turn:  # the first one finds nothing in the system's cache
                for job in jobs.values():
                    job.cpu.clear()
                    job.wall.clear()
    return [
        absent(title, job.fault, job.group) if job.fault else _row(title, job, jobs)
        for title, job in jobs.items()
    ]


def _jobs(folder: Path) -> dict[str, Process]:
    here, theirs = sys.executable, str(peers.interpreter())
    card, measured = _small(folder)
    jobs = {
        "python -c pass": Process([here, "-c", "pass"]),
        "import mrdamper": Process([here, "-c", "import mrdamper"], "python -c pass"),
        "mrdamper --help": Process([here, "-c", COMMAND, "--help"]),
        "mrdamper predict, a small card": Process([here, "-c", COMMAND, "predict", str(card), str(measured)]),
        "import numpy": Process([here, "-c", "import numpy"], "python -c pass", BESIDE),
    }
    for name in OTHERS:
        jobs[f"import {name}"] = Process([here, "-c", f"import {name}"], "python -c pass", BESIDE)
    known, there = peers.versions(), peers.interpreter().is_file()
    if there:
        jobs[_BARE] = Process([theirs, "-c", "pass"], group=BESIDE)
    for name in (*peers.PEERS, _WORKS):
        job = Process([theirs, "-c", f"import {name}"], _BARE, BESIDE, known[name.partition(".")[0]])
        job.fault = "" if there else "no environment: python -m bench --peers makes it"
        jobs[f"import {name}"] = job
    return jobs


_BARE = "python -c pass, in the peers' environment"
_WORKS = "sysidentpy.model_structure_selection"  # the package itself loads next to nothing


def _row(title: str, job: Process, jobs: dict[str, Process]) -> Row:
    less = median(jobs[job.bare].cpu) if job.bare else 0.0
    cpu = median(job.cpu) - less
    low, _, high = quantiles(job.cpu, n=4, method="inclusive")
    most = MOST_S.get(title)
    return Row(
        title,
        cpu,
        ratio=median(job.cpu) / median(jobs["python -c pass"].cpu),
        accuracy=job.version and f"version {job.version}",
        bar="" if most is None else f"{1e3 * most:g} ms",
        asked=() if most is None else (Asked(f"{title}, CPU", 1e3 * most, 1e3 * cpu, "ms"),),
        group=job.group,
        wall_s=median(job.wall),
        spread=((low - less) / cpu, (high - less) / cpu) if cpu > 0.0 else None,
    )


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
