"""Ctrl-C, SIGTERM and SIGHUP end a command with one message, exit code 4 and no partial files.

The release test interrupts at random moments; ``MRDAMPER_INTERRUPTS`` sets the number of interrupts.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import make_dataclass
from pathlib import Path

import numpy as np
import pytest

from mrdamper.interrupts import (
    Interrupted,
    heed_interrupts,
    hold_interrupts,
    interrupt_ends_all,
    on_interrupt,
)
from mrdamper.jobs.sweep.store import RESULTS_FILE
from mrdamper.runtime.outputs import atomic_output
from mrdamper.schema import read_record
from tests.support.kills import (
    IDENTIFY,
    MARK,
    SINK,
    SWEEP,
    Nursery,
    has_more,
    kill_after,
    kill_after_cpu,
    left_behind,
    of_any_folder,
    orphans,
    wait_for,
    written,
)
from tests.support.rigs import command
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
SEARCH = ("fit", "runs", "--law", "chain", "--temperature", "none")


def one_line(said: str) -> str:
    """Check that an interrupted command prints a single message, and return the message."""
    assert "Traceback" not in said, said
    lines = [line for line in said.splitlines() if line.startswith("mrdamper: ")]
    assert len(lines) == 1, said
    return lines[0]


@pytest.mark.parametrize("number", [INT, TERM, HUP])
def test_interrupted_heat_sink_search_writes_nothing(
    nursery: Nursery, tmp_path: Path, number: signal.Signals
):
    """An interrupted search for heat sinks has no result to write."""
    out = tmp_path / "out"
    assert nursery.run(*SINK, "--out", out, kill=kill_after_cpu(0.3, number)) == 4
    assert "No files were written" in one_line(nursery.said)
    assert written(out) is None
    assert not left_behind(tmp_path)


@pytest.mark.nightly
def test_interrupted_fit_writes_best_result(nursery: Nursery, tmp_path: Path):
    """The card of an interrupted fit is marked as cancelled."""
    out = tmp_path / "out"
    assert nursery.run(*SEARCH, "--out", out, kill=kill_after_cpu(2.0, TERM)) == 4
    assert one_line(nursery.said).endswith("best result so far and are marked as cancelled.")
    assert "cancelled" in json.loads((out / "card.json").read_text(encoding="utf-8"))["notes"]
    assert not left_behind(tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("number", one_by_day([INT, TERM, HUP]))
def test_interrupted_sweep_ends_its_workers(nursery: Nursery, tmp_path: Path, number: signal.Signals):
    """A terminal sends the signal to the command and to all workers. Only the command prints a message."""
    out, mark = tmp_path / "out", f"interrupted-{os.getpid()}-{number}"
    process = subprocess.Popen(
        command(*SWEEP, "--out", out), env={**os.environ, MARK: mark}, cwd=nursery.folder,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    wait_for(has_more(out / RESULTS_FILE, 1), process.pid)  # A worker has started its task.
    os.killpg(process.pid, number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 4, said
    assert "--resume goes on" in one_line(said)
    assert not orphans(mark)


def test_disabled_signal_stays_disabled():
    """The command ``nohup`` disables SIGHUP. The signal handlers of the package do not change that."""
    code = (
        "import signal\n"
        "from mrdamper.interrupts import heed_interrupts, on_interrupt\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "heed_interrupts()\n"
        "with on_interrupt(print):\n"
        "    print(signal.getsignal(signal.SIGHUP).name, callable(signal.getsignal(signal.SIGTERM)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["SIG_IGN", "True"]


@pytest.fixture
def signal_handlers():
    before = {number: signal.getsignal(number) for number in (INT, TERM, HUP)}
    heed_interrupts()
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("signal_handlers")
def test_innermost_interrupt_handler_handles_signal():
    """At the end of a ``with on_interrupt`` block, the previous signal handlers are restored."""
    seen: list[str] = []
    with on_interrupt(lambda: seen.append("outer")):
        with on_interrupt(lambda: seen.append("inner")):
            signal.raise_signal(TERM)
        signal.raise_signal(HUP)
        with pytest.raises(Interrupted), interrupt_ends_all():
            signal.raise_signal(INT)
    assert seen == ["inner", "outer"]
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(TERM)


@pytest.mark.usefixtures("signal_handlers")
@pytest.mark.parametrize("number", [INT, TERM, HUP])
def test_delayed_interrupt_is_raised_after_critical_section(number: signal.Signals):
    with pytest.raises(KeyboardInterrupt), hold_interrupts(), contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(number)


@pytest.mark.usefixtures("signal_handlers")
def test_interrupt_during_schema_build_is_raised(monkeypatch: pytest.MonkeyPatch):
    """Pydantic suppresses an interrupt while it builds a schema. The package must raise it again."""

    def build(_record: type) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(INT)

    monkeypatch.setattr("pydantic.TypeAdapter", build)
    with pytest.raises(KeyboardInterrupt):
        read_record(make_dataclass("Record", [("length", float)]), {}, "file")


@pytest.mark.usefixtures("signal_handlers")
def test_interrupted_job_finishes_move_of_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The output folder must not contain a mixture of old and new files."""
    replace, moves = Path.replace, list[Path]()

    def interrupted(self: Path, target: Path) -> Path:
        moves.append(target)
        if len(moves) == 2:
            signal.raise_signal(TERM)
        return replace(self, target)

    with atomic_output(tmp_path / "out") as stage:
        for k in range(4):
            (stage / str(k)).write_text("old")
    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), atomic_output(tmp_path / "out") as stage:  # noqa: PT012
        for k in range(4):
            (stage / str(k)).write_text("new")
    assert [path.read_text() for path in sorted((tmp_path / "out").iterdir())] == ["new"] * 4
    assert not left_behind(tmp_path)


@pytest.mark.release
def test_random_interrupts_lose_no_files(nursery: Nursery, tmp_path: Path):
    """A command that is repeated after an interrupt writes the same files as an uninterrupted command."""
    times = int(os.environ.get("MRDAMPER_INTERRUPTS", "40"))
    random, counts = np.random.default_rng(1), Counter[str]()
    jobs: dict[str, tuple[object, ...]] = {
        "fit": IDENTIFY,
        "heatsink": SINK,
        "rig": ("rig", "--campaign", "campaign.toml"),
        "demo": ("demo", "--quick"),
    }
    wholes, spans = {}, {}
    for name, arguments in jobs.items():
        begun = time.monotonic()
        assert nursery.run(*arguments, "--out", tmp_path / name) == 0, nursery.said
        wholes[name] = of_any_folder(written(tmp_path / name), tmp_path / name)
        spans[name] = time.monotonic() - begun
    for k in range(times):
        name = ("fit", "heatsink", "fit", "rig", "heatsink", "fit", "heatsink", "demo")[k % 8]
        number, out = (INT, TERM, HUP)[k % 3], tmp_path / f"out-{k}"
        end = kill_after(float(random.uniform(0.0, spans[name])), number)
        code = nursery.run(*jobs[name], "--out", out, kill=end)
        counts[f"{name} {number.name} code {code}"] += 1
        assert "Traceback" not in nursery.said, nursery.said
        if code == 0:
            assert of_any_folder(written(out), out) == wholes[name]
            continue
        assert code in {4, -number}, nursery.said
        if written(out) is not None and code == 4:
            assert name == "fit"
            assert "best result so far" in nursery.said
        assert nursery.run(*jobs[name], "--out", out) == 0, nursery.said
        assert of_any_folder(written(out), out) == wholes[name]
        assert not left_behind(tmp_path)
    print(json.dumps(counts, indent=1))
    assert not orphans(nursery.mark, nursery.pid)
