"""A worker: whatever a question does to its process costs that question, and leaves no process behind."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mrdamper.errors import EnvelopeError
from mrdamper.runtime.async_worker import AsyncWorker
from mrdamper.runtime.worker import (
    Worker,
    WorkerEndedError,
    WorkerFaultError,
    WorkerLateError,
    WorkerOptions,
)
from tests.support.kills import alive

pytestmark = pytest.mark.system

HANDLERS = """
import errno, os, signal, subprocess, sys, time
from mrdamper.errors import EnvelopeError
from mrdamper.runtime.worker_process import Reply, supervisor_is_gone

def start_child():
    return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]).pid

def interrupted(place):
    try:
        time.sleep(60)
    except KeyboardInterrupt:
        open(place, "w").write(f"gone: {supervisor_is_gone()}")

def refuse(*fault):
    raise {"envelope": EnvelopeError, "os": OSError, "fault": RuntimeError}[fault[0]](*fault[1:])

ACTS = {
    "echo": lambda value: value,
    "print": lambda: (print("no answer", flush=True), os.write(1, b"{}\\n"))[1],
    "crash": lambda: os.abort(),
    "sleep": lambda: time.sleep(60),
    "loop": lambda: [None for _ in iter(int, 1)],
    "fill": lambda size: len(bytearray(size)),
    "child": start_child,
    "nice": lambda: os.nice(0),
    "interrupted": interrupted,
    "refuse": refuse,
}

def handler():
    return lambda question: Reply({"value": ACTS[question["act"]](*question.get("with", ()))})

def with_parts():
    return lambda question: Reply({}, [memoryview(bytes([k]) * n) for k, n in enumerate(question["sizes"])])
"""


@pytest.fixture(autouse=True)
def _importable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "acts.py").write_text(HANDLERS, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))


@pytest.fixture
def worker() -> Iterator[Worker]:
    found = Worker(WorkerOptions(handler="acts:handler"))
    yield found
    found.stop()


def ask(worker: Worker, act: str, *values: object, deadline_s: float | None = 30.0) -> object:
    return worker.ask({"act": act, "with": values}, deadline_s=deadline_s).value["value"]


def gone(pid: int, seconds: float = 10.0) -> bool:
    until = time.monotonic() + seconds
    while alive(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return not alive(pid)


def test_one_process_answers_one_question_after_another(worker: Worker):
    assert worker.pid is None
    assert ask(worker, "echo", {"a": [1, None, 2.5]}) == {"a": [1, None, 2.5]}
    first = worker.pid
    assert ask(worker, "echo", "é") == "é"
    assert worker.pid == first


def test_parts_come_as_they_were_sent():
    worker, sizes = Worker(WorkerOptions(handler="acts:with_parts")), (3, 0, 1 << 20, 5)
    parts = worker.ask({"sizes": sizes}).parts
    assert [bytes(part) for part in parts] == [bytes([k]) * n for k, n in enumerate(sizes)]
    assert [bytes(part) for part in worker.ask({"sizes": [1]}).parts] == [b"\x00"]
    worker.stop()


def test_what_a_library_prints_is_no_answer(worker: Worker, capfd: pytest.CaptureFixture[str]):
    ask(worker, "print")
    assert ask(worker, "echo", 1) == 1
    assert "no answer" in capfd.readouterr().err


def test_a_crash_costs_its_question_and_the_next_one_starts_another_process(worker: Worker, tmp_path: Path):
    ask(worker, "echo", 1)
    first = worker.pid
    with pytest.raises(WorkerEndedError) as caught:
        ask(worker, "crash")
    assert caught.value.returncode == -signal.SIGABRT
    assert ask(worker, "echo", 2) == 2
    assert worker.pid != first
    assert not list(Path.cwd().glob("core*"))


@pytest.mark.parametrize("act", ["sleep", "loop"])
def test_a_question_that_takes_too_long_is_ended(worker: Worker, act: str):
    ask(worker, "echo", 1)
    first = worker.pid
    assert first is not None
    with pytest.raises(WorkerLateError, match=r"0\.3 s"):
        ask(worker, act, deadline_s=0.3)
    assert gone(first)
    assert ask(worker, "echo", 2) == 2


def test_a_process_that_does_not_even_listen_is_late(worker: Worker):
    ask(worker, "echo", 1)
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGSTOP)
    with pytest.raises(WorkerLateError):
        ask(worker, "echo", "x" * 1_000_000, deadline_s=0.3)


def test_a_process_takes_no_more_memory_than_it_may():
    worker = Worker(WorkerOptions(handler="acts:handler", memory_bytes=100 << 20))
    with pytest.raises(MemoryError):
        ask(worker, "fill", 200 << 20)
    assert ask(worker, "fill", 1 << 20) == 1 << 20
    worker.stop()


def test_niceness_is_added():
    worker = Worker(WorkerOptions(handler="acts:handler", nice=3))
    assert ask(worker, "nice") == min(os.nice(0) + 3, 19)
    worker.stop()


def test_an_error_is_the_one_that_was_raised(worker: Worker):
    with pytest.raises(EnvelopeError, match=r"^too far$"):
        ask(worker, "refuse", "envelope", "too far")
    with pytest.raises(OSError, match="full") as caught:
        ask(worker, "refuse", "os", errno.ENOSPC, "full")
    assert caught.value.errno == errno.ENOSPC
    with pytest.raises(WorkerFaultError, match="RuntimeError: ours"):
        ask(worker, "refuse", "fault", "ours")


def test_stop_ends_what_the_process_has_started(worker: Worker):
    child = ask(worker, "child")
    assert isinstance(child, int)
    assert alive(child)
    worker.stop()
    assert gone(child)


def test_a_waiting_question_ends_when_another_thread_stops_the_worker(worker: Worker):
    ask(worker, "echo", 1)
    stopper = threading.Timer(0.2, worker.stop)
    stopper.start()
    with pytest.raises(WorkerEndedError):
        ask(worker, "sleep")
    stopper.join()
    assert worker.pid is None


def test_an_interrupted_question_is_not_answered_to_the_next_one(worker: Worker):
    """Ctrl-C while an answer is awaited: what comes later must not be taken for another answer."""
    ask(worker, "echo", 1)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        ask(worker, "sleep")
    assert ask(worker, "echo", 2) == 2


@pytest.mark.parametrize("act", ["sleep", "loop"])
def test_a_process_at_work_ends_with_its_supervisor(act: str, tmp_path: Path):
    code = f"""
from mrdamper.runtime.worker import Worker, WorkerOptions
worker = Worker(WorkerOptions(handler="acts:handler"))
print(worker.ask({{"act": "child"}}).value["value"], worker.pid, flush=True)
worker.ask({{"act": "{act}"}})
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as supervisor:
        assert supervisor.stdout is not None
        pids = [int(word) for word in supervisor.stdout.readline().split()]
        time.sleep(0.2)
        supervisor.kill()
    assert all(gone(pid) for pid in pids)


def test_a_question_with_grace_is_interrupted_when_the_supervisor_hangs_up(tmp_path: Path):
    worker = Worker(WorkerOptions(handler="acts:handler", grace_s=10.0))
    ask(worker, "echo", 1)
    hang_up = threading.Timer(0.3, worker.hang_up)
    hang_up.start()
    ask(worker, "interrupted", str(tmp_path / "said"))
    assert (tmp_path / "said").read_text() == "gone: True"
    worker.stop()


def test_a_coroutine_that_is_cancelled_leaves_a_worker_that_can_be_stopped():
    async def cancel() -> None:
        worker = AsyncWorker(WorkerOptions(handler="acts:handler"))
        assert await worker.ask({"act": "echo", "with": [1]}) == {"value": 1}
        asked, pid = asyncio.create_task(worker.ask({"act": "sleep"})), worker.pid
        await asyncio.sleep(0.2)
        asked.cancel()
        await worker.stop()
        assert pid is not None
        assert gone(pid)
        assert await worker.ask({"act": "echo", "with": [2]}) == {"value": 2}
        await worker.stop()

    asyncio.run(cancel())
