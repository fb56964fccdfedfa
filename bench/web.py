"""The web app's server side: memory at rest, 2,000,000 samples on their way to the screen, a slider's curve.

The server runs as the command does, on a port of its own; times are by the wall clock, the client's share
included; what the browser makes of it, by ``bench.pages``.
"""

from __future__ import annotations

import json
import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from bench import pages
from bench.cards import write_plain
from bench.measure import Asked, Row

__all__ = ["run"]

_SAMPLES = 2_000_000
_CURVES = 60


def run() -> list[Row]:
    """Measure a server in a folder of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_run(folder / "long.csv")
        write_plain(folder / "cards" / "plain")
        code = "from mrdamper.cli import main; main()"
        begin = time.monotonic()
        server = subprocess.Popen(
            [sys.executable, "-c", code, "serve", "--port", "0", "--folder", name],
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert server.stderr is not None
            found = re.search(r"http://\S+", server.stderr.readline())
            assert found is not None
            site, _, token = found[0].partition("/?token=")
            urllib.request.install_opener(_knowing(token))
            _get(site + "/api/state")
            ready = time.monotonic() - begin
            time.sleep(2.0)
            return [
                *_rows(site, folder, server.pid),
                Row("ready after the command", accuracy=f"{ready:.2f} s"),
                *pages.rows(site, token, run="long", samples=_SAMPLES, card="plain"),
            ]
        finally:
            server.send_signal(signal.SIGINT)
            server.wait()


def _rows(site: str, folder: Path, pid: int) -> list[Row]:
    idle = _resident(pid)
    upload = _timed(lambda: _put(f"{site}/api/files/long.csv", folder / "long.csv"))
    read = _timed(lambda: _all_read(site))
    whole = [_timed(lambda: _get(f"{site}/api/runs/long/series")) for _ in range(5)]
    fewer = _timed(lambda: _get(f"{site}/api/runs/long/series?max=20000"))
    model = _timed(lambda: _get(f"{site}/api/runs/long/model?card=plain"))
    order: dict[str, Any] = {"card": "plain"}
    _get(f"{site}/api/heat/curve", order)

    def curve(changed: dict[str, float]) -> float:
        return _timed(lambda: _get(f"{site}/api/heat/curve", order | changed))

    curves = [curve({"ambient_degC": 10.0 + 0.5 * k}) for k in range(_CURVES)]
    duties = [curve({"frequency_Hz": 0.5 + 0.01 * k}) for k in range(_CURVES)]
    busy = sum(map(_resident, [pid, *_children(pid)]))
    slider, moved = (1e3 * float(np.quantile(times, 0.95)) for times in (curves, duties))
    seconds = statistics.median(whole)
    return [
        Row(
            "idle server",
            accuracy=f"{idle:.0f} MB resident; {busy:.0f} MB with the processes that stand by after this",
            asked=(Asked("memory of the idle server", 200.0, idle, "MB"),),
        ),
        Row("upload of 109 MB", accuracy=f"{upload:.2f} s"),
        Row("file read, prepared, kept", accuracy=f"{read:.2f} s after the upload"),
        Row(
            "2,000,000 samples, five channels",
            accuracy=f"{seconds:.2f} s for 40 MB",
            asked=(Asked("2,000,000 samples delivered", 3.0, seconds, "s"),),
        ),
        Row("20,000 of them, extremes kept", accuracy=f"{fewer:.2f} s"),
        Row("a card's force on 2,000,000 samples", accuracy=f"{model:.2f} s"),
        Row(
            "heating curve, surroundings changed",
            accuracy=f"{1e3 * statistics.median(curves):.1f} ms, 95 % below {slider:.1f} ms",
            asked=(Asked("heating curve after a slider", 100.0, slider, "ms"),),
        ),
        Row(
            "heating curve, duty changed",
            accuracy=f"{1e3 * statistics.median(duties):.1f} ms, 95 % below {moved:.1f} ms",
            asked=(Asked("heating curve of another duty", 100.0, moved, "ms"),),
        ),
    ]


def _knowing(token: str) -> urllib.request.OpenerDirector:
    """Return what opens addresses with the server's token."""
    opener = urllib.request.build_opener()
    opener.addheaders = [("authorization", f"Bearer {token}")]
    return opener


def _timed(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def _get(address: str, order: dict[str, Any] | None = None) -> bytes:
    """Ask until there is an answer."""
    while True:
        body = None if order is None else json.dumps(order).encode()
        with urllib.request.urlopen(urllib.request.Request(address, body)) as answer:
            content: bytes = answer.read()
            if answer.status != 202:
                return content
        time.sleep(json.loads(content)["retry_ms"] / 1e3)


def _put(address: str, path: Path) -> None:
    with path.open("rb") as file:
        headers = {"content-length": str(path.stat().st_size)}
        with urllib.request.urlopen(urllib.request.Request(address, file, headers, method="PUT")) as answer:
            answer.read()


def _all_read(site: str) -> None:
    while json.loads(_get(f"{site}/api/runs"))["reading"]:
        time.sleep(0.02)


def _resident(pid: int) -> float:
    """Return a process's resident memory [MB]."""
    with suppress(OSError):
        found = re.search(r"VmRSS:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(encoding="utf-8"))
        if found:
            return int(found[1]) / 1024.0
    return 0.0


def _children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
    return [int(each) for each in found]


def _write_run(path: Path) -> None:
    import polars as pl

    rng = np.random.default_rng(0)
    time_s = np.arange(_SAMPLES) * 1e-3
    speed = 62.8e-3 * np.cos(2.0 * np.pi * time_s)
    pl.DataFrame(
        {
            "time_s": time_s,
            "displacement_m": 0.01 * np.sin(2.0 * np.pi * time_s) + 1e-5 * rng.standard_normal(_SAMPLES),
            "force_N": 500.0 * np.tanh(speed / 0.01) + rng.standard_normal(_SAMPLES),
            "current_A": np.ones(_SAMPLES),
        }
    ).write_csv(path)


if os.name != "posix":
    raise SystemExit("bench/web.py looks into /proc")
