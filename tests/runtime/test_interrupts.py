"""Ctrl-C, SIGTERM and SIGHUP: one line, exit code 4, nothing half-written.

The long test interrupts at random moments; ``MRDAMPER_INTERRUPTS`` is another number of times.
"""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mrdamper.jobs.sweep.results import CHECKPOINT
from mrdamper.runtime.outputs import atomic_output
from mrdamper.runtime.signals import Interrupted, heed_interrupts, interrupt_ends_all, on_interrupt
from mrdamper.virtual_rig.campaign import Campaign
from tests.support.kills import (
    IDENTIFY,
    MARK,
    SINK,
    Nursery,
    has_more,
    kill_after,
    kill_after_cpu,
    kill_when,
    left_behind,
    of_any_folder,
    orphans,
    rows,
    wait_for,
    written,
)
from tests.support.rigs import command
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
SEARCH = ("fit", "runs", "--law", "dahl", "--temperature", "none", "--starts", 2000)
GOES_ON = "the same command with --resume goes on"


def one_line(said: str) -> str:
    """Return what was said about the end."""
    assert "Traceback" not in said, said
    lines = [line for line in said.splitlines() if line.startswith("mrdamper: ")]
    assert len(lines) == 1, said
    return lines[0]


@pytest.mark.parametrize("number", [INT, TERM, HUP])
def test_a_search_ends_in_one_line_and_goes_on_later(
    nursery: Nursery, tmp_path: Path, number: signal.Signals
):
    out, progress = tmp_path / "out", tmp_path / "out.progress"
    code = nursery.run(*SINK, "--out", out, kill=kill_when(has_more(progress, 2), number))
    assert code == 4
    nothing = (
        "mrdamper: interrupted before there was a result; nothing was written; what was finished is kept"
    )
    assert one_line(nursery.said) == f"{nothing}: {GOES_ON}"
    assert written(out) is None
    assert left_behind(tmp_path) == ["out.progress"]
    assert rows(progress) > 2


@pytest.mark.nightly
def test_repeated_signal_keeps_best_so_far(nursery: Nursery, tmp_path: Path):
    """Two signals at once, as ``timeout`` sends them, count as one. A fit keeps the best so far."""
    out = tmp_path / "out"
    end = kill_after_cpu(2.0, TERM, TERM)
    assert nursery.run(*SEARCH, "--out", out, kill=end) == 4
    assert one_line(nursery.said).endswith("best so far, marked as cancelled")
    assert "cancelled" in json.loads((out / "card.json").read_text(encoding="utf-8"))["notes"]
    assert not left_behind(tmp_path)


@pytest.mark.nightly
def test_a_second_interrupt_is_for_good(nursery: Nursery, tmp_path: Path):
    """It comes before the best so far is written, or after: what is said is what is there."""
    out = tmp_path / "out"
    end = kill_after_cpu(2.0, INT, INT, apart_s=0.25)
    assert nursery.run(*SEARCH, "--out", out, kill=end) == 4
    before = "interrupted before there was a result; nothing was written"
    after = f"interrupted; what was finished is in {out}"
    at_the_end = "best so far, marked as cancelled"
    said = one_line(nursery.said)
    assert said.endswith(before if written(out) is None else (after, at_the_end))
    assert not left_behind(tmp_path)


@pytest.mark.nightly
@pytest.mark.parametrize("number", one_by_day([INT, TERM, HUP]))
def test_a_sweep_takes_its_workers_with_it(nursery: Nursery, tmp_path: Path, number: signal.Signals):
    """A terminal sends its signal to all of them: no worker keeps half a fit, and none has a word to say."""
    out, mark = tmp_path / "out", f"interrupted-{os.getpid()}-{number}"
    process = subprocess.Popen(
        command("sweep", nursery.folder / "tolerance.toml", "--out", out, "--workers", 1),
        env={**os.environ, MARK: mark}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    wait_for(has_more(out / CHECKPOINT, 1), process.pid)  # its worker is at work
    os.killpg(process.pid, number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 4, said
    assert one_line(said) == f"mrdamper: interrupted: the results so far are kept; {GOES_ON}"
    assert not orphans(mark)


IN_A_TERMINAL = """
import os, sys, time
from mrdamper.runtime.signals import heed_interrupts
heed_interrupts()
try:
    print("ready", flush=True)
    time.sleep(60.0)
except KeyboardInterrupt:
    print("to a terminal that is gone", flush=True)
    print("and its other half", file=sys.stderr, flush=True)
    os._exit(4)
"""


def test_a_closed_terminal_is_not_spoken_to():
    child, terminal = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", IN_A_TERMINAL])
    assert b"ready" in os.read(terminal, 100)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 4


def test_what_was_switched_off_stays_off():
    code = (
        "import signal\n"
        "from mrdamper.runtime.signals import heed_interrupts, on_interrupt\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "heed_interrupts()\n"
        "with on_interrupt(print):\n"
        "    print(signal.getsignal(signal.SIGHUP).name, callable(signal.getsignal(signal.SIGTERM)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["SIG_IGN", "True"]


IN_A_FINALIZER = """
import os, signal, sys, time, weakref
from mrdamper.runtime.signals import Interrupted, heed_interrupts, interrupt_ends_all
heed_interrupts()

def interrupted(*_):
    os.kill(os.getpid(), int(sys.argv[1]))
    for _ in range(1000):
        pass

class Plain:
    pass

class Final:
    __del__ = interrupted

def wait():
    thing = Final() if sys.argv[2] == "del" else Plain()
    watched = weakref.ref(thing, interrupted) if sys.argv[2] == "weakref" else None
    del thing
    for _ in range(6000):
        time.sleep(0.01)

try:
    if sys.argv[3] == "all":
        with interrupt_ends_all():
            wait()
    wait()
except (KeyboardInterrupt, Interrupted) as interrupt:
    print(type(interrupt).__name__)
"""


@pytest.mark.parametrize("number", [INT, TERM, HUP])
@pytest.mark.parametrize("where", ["del", "weakref"])
@pytest.mark.parametrize(("ends", "raised"), [("here", "KeyboardInterrupt"), ("all", "Interrupted")])
def test_an_interrupt_in_a_finalizer_is_not_lost(number: signal.Signals, where: str, ends: str, raised: str):
    """Python can only drop what is raised there, and says so in a traceback."""
    begun = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", IN_A_FINALIZER, str(int(number)), where, ends],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert (done.stdout.split(), done.stderr) == ([raised], "")
    assert time.monotonic() - begun < 50.0  # the wait is of sixty


def test_other_faults_in_a_finalizer_are_told_as_ever():
    code = (
        "from mrdamper.runtime.signals import heed_interrupts\n"
        "heed_interrupts()\n"
        "class Thing:\n"
        "    def __del__(self):\n"
        "        raise ValueError('a fault')\n"
        "Thing()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "ValueError: a fault" in done.stderr


@pytest.fixture
def heeded(monkeypatch: pytest.MonkeyPatch):
    """Let this process take interrupts as the command line does."""
    before = {number: signal.getsignal(number) for number in (INT, TERM, HUP)}
    monkeypatch.setattr("mrdamper.runtime.signals._LAST.at_s", -1.0)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    heed_interrupts()
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize("number", [INT, TERM, HUP])
def test_files_that_are_being_moved_are_moved_to_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
):
    replace, moves = Path.replace, list[Path]()

    def interrupted(self: Path, target: Path) -> Path:
        moves.append(target)
        if len(moves) == 2:
            signal.raise_signal(number)
        return replace(self, target)

    with atomic_output(tmp_path / "out") as beside:
        for k in range(4):
            (beside / str(k)).write_text("old")
    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), atomic_output(tmp_path / "out") as beside:  # noqa: PT012
        for k in range(4):
            (beside / str(k)).write_text("new")
    assert [path.read_text() for path in sorted((tmp_path / "out").iterdir())] == ["new"] * 4
    assert not left_behind(tmp_path)


def test_files_that_cannot_all_be_moved_are_moved_by_the_next_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The rest stays where it is until then: half of an old set and half of a new one is no result."""
    replace, moves = Path.replace, list[Path]()

    def failing(self: Path, target: Path) -> Path:
        moves.append(target)
        if len(moves) == 2:
            raise OSError(5, "Input/output error")
        return replace(self, target)

    out = tmp_path / "out"
    out.mkdir()
    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(Exception, match=r"some files are in their place"), atomic_output(out) as beside:  # noqa: PT012
        for k in range(4):
            (beside / str(k)).write_text("new")
    assert len(list(out.glob("?"))) == 1
    with atomic_output(out) as beside:
        (beside / "more").write_text("new")
    assert len(list(out.glob("?"))) == 4
    assert not left_behind(tmp_path)


@pytest.mark.usefixtures("heeded")
def test_an_interrupt_is_what_the_innermost_block_makes_of_it(monkeypatch: pytest.MonkeyPatch):
    heard: list[str] = []
    monkeypatch.setattr("mrdamper.runtime.signals._ONE_S", 0.0)
    with on_interrupt(lambda: heard.append("outer")):
        with on_interrupt(lambda: heard.append("inner")):
            signal.raise_signal(TERM)
        signal.raise_signal(HUP)
        with pytest.raises(Interrupted), interrupt_ends_all():
            signal.raise_signal(INT)
    assert heard == ["inner", "outer"]
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(TERM)


@pytest.mark.usefixtures("heeded")
def test_a_demonstration_makes_no_claims_from_half_a_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A fit that is interrupted returns its best so far; here nobody would be told."""
    from mrdamper.paper import demo as demo_job
    from mrdamper.registry import JOBS

    def identify(*_: object, **__: object) -> None:
        signal.raise_signal(INT)

    monkeypatch.setattr(demo_job, "rig", lambda *_, **__: SimpleNamespace(campaign=Campaign()))
    monkeypatch.setattr(demo_job, "_read_back", lambda *_: ())
    monkeypatch.setattr(demo_job, "fit", identify)
    with pytest.raises(Interrupted):
        JOBS["demo"].perform({}, out=tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.release
def test_interrupts_at_random_moments_cost_nothing(nursery: Nursery, tmp_path: Path):
    """Files of an interrupted fit are marked as the best so far. The next run writes the whole result."""
    times = int(os.environ.get("MRDAMPER_INTERRUPTS", "40"))
    random, counts = np.random.default_rng(1), Counter[str]()
    jobs: dict[str, tuple[object, ...]] = {
        "fit": IDENTIFY,
        "heatsink": (*SINK, "--resume"),
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
            assert "best so far" in nursery.said
        assert nursery.run(*jobs[name], "--out", out) == 0, nursery.said
        assert of_any_folder(written(out), out) == wholes[name]
        assert not left_behind(tmp_path)
    print(json.dumps(counts, indent=1))
    assert not orphans(nursery.mark, nursery.pid)
