"""Runs and files for the tests of this room: short simulated runs, and ways of spoiling a file."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mrdamper.arrays import FloatArray
from mrdamper.cli import main
from mrdamper.data.records import RigRun
from mrdamper.excitation import Sine
from tests.oracles.spencer_damper import Campaign, measure

SHORT = Campaign(
    (("sine5mm1Hz", Sine(5e-3, 1.0)), ("sine10mm2Hz", Sine(10e-3, 2.0))),
    voltages=(0.0, 0.75, 1.5),
    duration_s=2.6,
)

PYTHON_LAW = '''
"""A law of a user's own: Maxwell-like viscous force behind a spring."""
from mrdamper.models.laws import Coefficient

class Relaxing:
    """A damper with one relaxing state."""
    name = "relaxing"
    coefficients = (
        Coefficient("strength", "N", "force of the state", True, 0.0, 5e3),
        Coefficient("length", "m", "motion over which the state turns", False, 1e-4, 1e-2),
    )
    def rate(self, state, displacement, velocity, values):
        return (velocity - abs(velocity) * state) / values["length"]
    def force(self, state, displacement, velocity, values):
        return values["strength"] * state
'''


@cache
def short_runs() -> tuple[RigRun, ...]:
    return measure(SHORT, seed=1)


def columns_of(run: RigRun) -> dict[str, FloatArray]:
    """Return a run's columns, every second sample, under headers that speak for themselves."""
    chosen = {
        "time_s": run.time,
        "displacement_m": run.displacement,
        "force_N": run.force,
        "voltage_V": run.command,
    }
    return {name: np.array(values[::2]) for name, values in chosen.items()}


def write_csv(path: Path, columns: Mapping[str, FloatArray]) -> Path:
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path


def write_runs(folder: Path, runs: Sequence[RigRun]) -> list[Path]:
    folder.mkdir(exist_ok=True)
    return [write_csv(folder / f"{run.name}.csv", columns_of(run)) for run in runs]


def command(*arguments: object) -> list[str]:
    code = "from mrdamper.cli import main; main()"
    return [sys.executable, "-c", code, *map(str, arguments)]


def mrdamper(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, whose libraries are loaded; ``command`` is for a process of its own."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setattr(sys, "argv", ["mrdamper", *map(str, arguments)])
        patch.setattr(sys, "unraisablehook", sys.unraisablehook)
        for name in ("COLUMNS", "LINES"):
            patch.delenv(name, raising=False)
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("default")
        for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # a command takes them for its process
            stack.callback(signal.signal, each, signal.getsignal(each))
        if cwd is not None:
            stack.enter_context(chdir(cwd))
        stack.enter_context(redirect_stdout(out))
        stack.enter_context(redirect_stderr(err))
        try:
            main()
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
    return subprocess.CompletedProcess([*map(str, arguments)], status, out.getvalue(), err.getvalue())


def answer_of(run: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Return the JSON object on standard output; it must be all that is there."""
    assert run.returncode == 0, run.stderr
    lines = run.stdout.strip().splitlines()
    assert len(lines) == 1
    answer = json.loads(lines[0])
    assert isinstance(answer, dict)
    return answer
