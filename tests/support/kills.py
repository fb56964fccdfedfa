"""Kill running commands and find the files and processes that remain.

A ``Nursery`` loads the program once and forks a child process for each command. A kill then interrupts the
work of the command and not its imports. All processes of a command have an environment variable with the
same random value, so that remaining processes are found.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mrdamper.jobs.sweep.store import RESULTS_FILE

MARK = "MRDAMPER_TEST_MARK"

CAMPAIGN = """
motions = ["sine5mm1Hz", "nonperiodic"]
currents_A = [0.0, 1.0, 2.0]
temperatures_degC = [20.0, 60.0, 100.0]
duration_s = 3.0
held_out_temperatures_degC = []
held_out_motions = []
"""
SWEEP = ("sweep", "--card", "card.json", "--samples", 3, "--workers", 1)
IDENTIFY = ("fit", "runs", "--law", "dahl", "--temperature", "none")
SINK = ("heatsink", "card.json", "--damper", "paper", "--network-only", "--duty", "sine:15mm:1Hz:2A:600s")

_NURSERY = """
import json, os, resource, sys, traceback
import mrdamper.jobs.fit, mrdamper.jobs.thermal.heatsink, mrdamper.jobs.rig, mrdamper.paper.demo
import mrdamper.cli.terminal, mrdamper.report.identification.page, mrdamper.report.thermal.heatsink
from mrdamper.cli import main
print("ready", flush=True)
for line in sys.stdin:
    asked = json.loads(line)
    child = os.fork()
    if child == 0:
        os.setsid()
        out = os.open(asked["said"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(out, 2)
        if asked["limit"] is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (asked["limit"],) * 2)
        sys.argv = ["mrdamper", *asked["arguments"]]
        try:
            main()
        except SystemExit as end:
            sys.stdout.flush()
            os._exit(end.code or 0)
        except BaseException:
            traceback.print_exc()
        os._exit(9)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class Nursery:
    """Run commands in forked child processes of one process, which has loaded the program."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.mark = folder, uuid.uuid4().hex
        self._said = folder / "said.txt"
        self._process = subprocess.Popen(
            [sys.executable, "-c", _NURSERY],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=folder,
            text=True,
            env={
                **os.environ,
                MARK: self.mark,
                "OPENBLAS_NUM_THREADS": "1",
                "MPLBACKEND": "Agg",
            },
        )
        assert self._line() == "ready"

    def __enter__(self) -> Nursery:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(60)
        self._process.stdout.close()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def said(self) -> str:
        return self._said.read_text(errors="replace")

    def run(
        self,
        *arguments: object,
        kill: Callable[[int], None] | None = None,
        limit: int | None = None,
    ) -> int:
        """Run a command and return its exit code.

        ``kill`` is called with the process ID of the command and may end the process. ``limit`` is the
        maximum size of a file that the command may write [bytes].
        """
        asked = {"arguments": list(map(str, arguments)), "said": str(self._said), "limit": limit}
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asked) + "\n")
        self._process.stdin.flush()
        child = int(self._line())
        if kill is not None:
            kill(child)
        return int(self._line())

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()


def kill_after(seconds: float, how: signal.Signals = signal.SIGKILL) -> Callable[[int], None]:
    """Return a function that ends a process after a time, unless the process has ended itself."""

    def kill(process: int) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until and alive(process):
            time.sleep(0.002)
        send(process, how)

    return kill


def kill_when(ready: Callable[[], bool], *how: signal.Signals, apart_s: float = 0.0) -> Callable[[int], None]:
    """Return a function that sends signals at intervals of ``apart_s`` once ``ready`` is True."""

    def kill(process: int) -> None:
        wait_for(ready, process)
        for number in how or (signal.SIGKILL,):
            send(process, number)
            time.sleep(apart_s)

    return kill


def wait_for(ready: Callable[[], bool], process: int, seconds: float = 120.0) -> None:
    """Wait until ``ready`` is True or the process has ended."""
    until = time.monotonic() + seconds
    while not ready() and time.monotonic() < until and alive(process):
        time.sleep(0.001)


def kill_after_cpu(seconds: float, *how: signal.Signals, apart_s: float = 0.0) -> Callable[[int], None]:
    """Return a function that ends a process after a CPU time, which does not depend on the machine load."""

    def kill(process: int) -> None:
        wait_for_cpu(process, seconds)
        kill_when(lambda: True, *how, apart_s=apart_s)(process)

    return kill


def wait_for_cpu(process: int, seconds: float) -> None:
    """Wait until a process has used some CPU time, or has ended."""

    def spent() -> bool:
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            return True
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK") > seconds

    wait_for(spent, process)


def send(process: int, number: signal.Signals) -> None:
    assert process > 1, "0 and below are groups of processes"
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, number)


def alive(process: int) -> bool:
    """Return True if a process is running. A zombie process is not running."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] not in "ZX"
    except OSError:
        return False


def marked(mark: str, but: int = 0) -> list[int]:
    """Return the IDs of processes whose environment variable has the value ``mark``, except ``but``."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) not in (but, os.getpid()):
            try:
                environment = (entry / "environ").read_bytes()
            except OSError:
                continue
            if f"{MARK}={mark}".encode() in environment and alive(int(entry.name)):
                found.append(int(entry.name))
    return found


def orphans(mark: str, but: int = 0, patience_s: float = 10.0) -> list[int]:
    """Return the processes with this mark that are still running after ``patience_s``."""
    until = time.monotonic() + patience_s
    while found := marked(mark, but):
        if time.monotonic() > until:
            return found
        time.sleep(0.05)
    return []


def written(out: Path) -> dict[str, str] | None:
    """Return the text of each output file without CPU times and dates, or None if there are no files.

    The progress file of a sweep is ignored because with two workers the order of its lines varies.
    """
    found = {
        path.relative_to(out).as_posix(): _plain(path)
        for path in sorted(out.rglob("*"))
        if path.is_file()
        and path.name != RESULTS_FILE
        and not any(part.startswith(".mrdamper-") for part in path.relative_to(out).parts)
    }
    return found or None


def of_any_folder(files: dict[str, str] | None, out: Path) -> dict[str, str]:
    """Return the content of written files without the name of their folder."""
    assert files is not None
    return {name: text.replace(str(out), "OUT") for name, text in files.items()}


def rows(path: Path) -> int:
    """Return the number of complete lines of a file, or 0 if the file does not exist."""
    return path.read_bytes().count(b"\n") if path.exists() else 0


def has_more(path: Path, count: int) -> Callable[[], bool]:
    """Return a function that returns True if a file has more than ``count`` lines."""
    return lambda: rows(path) > count


def left_behind(folder: Path) -> list[str]:
    """Return the hidden folders and progress files that remain in a folder."""
    found = [*folder.rglob(".mrdamper-*"), *folder.rglob("*.progress")]
    return [path.relative_to(folder).as_posix() for path in found]


def _plain(path: Path) -> str:
    raw = path.read_bytes()
    if path.suffix == ".json":
        return json.dumps(_timeless(json.loads(raw)))
    if path.suffix in {".fmu", ".mat", ".png"}:
        return f"{len(raw) > 0}"  # The files contain dates, so that their contents are not compared.
    text = raw.decode("utf-8", "replace")
    if path.suffix == ".html":
        assert text.rstrip().endswith("</html>"), f"{path}: cut off"
    text = re.sub(r"\d[\d.,]*(?:e-?\d+)? ?(?:s|ms|min)\b", "TIME", text)
    return re.sub(r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d)?)?", "DATE", text)


def _timeless(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {
            key: _timeless(each)
            for key, each in value.items()
            if "cpu" not in key and key not in {"created", "date", "seconds", "duration_wall_s"}
        }
    return [_timeless(each) for each in value] if isinstance(value, list) else value
