"""Run commands of ``mrdamper`` in tests, and a law in Python for them."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import warnings
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from mrdamper.cli import main

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


def command(*arguments: object) -> list[str]:
    code = "from mrdamper.cli import main; main()"
    return [sys.executable, "-c", code, *map(str, arguments)]


def mrdamper(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, which is faster than a new process (``command``)."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with ExitStack() as stack:
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setattr(sys, "argv", ["mrdamper", *map(str, arguments)])
        patch.setattr(sys, "unraisablehook", sys.unraisablehook)
        for name in ("COLUMNS", "LINES"):
            patch.delenv(name, raising=False)
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("default")
        # The command replaces the signal handlers, so they are restored at the end.
        for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
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
    """Return the JSON object that a command printed. Standard output must contain nothing else."""
    assert run.returncode == 0, run.stderr
    lines = run.stdout.strip().splitlines()
    assert len(lines) == 1
    answer = json.loads(lines[0])
    assert isinstance(answer, dict)
    return answer
