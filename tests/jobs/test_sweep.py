"""Sweeps give the same results with any number of workers, with killed workers, and after a resume."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest

import mrdamper
from mrdamper.errors import InputError, UsageError
from mrdamper.jobs.options import RigOptions, SweepOptions
from mrdamper.jobs.sweep import tasks
from mrdamper.jobs.sweep.plan import Plan, Task, make_plan
from mrdamper.jobs.sweep.store import RESULTS_FILE, open_store
from mrdamper.jobs.sweep.tasks import run_on_processes
from mrdamper.registry import JOBS
from mrdamper.thermal.duty import read_duty
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.plant import PRESETS
from tests.support.cards import write_card_of

pytestmark = pytest.mark.system

SAMPLES = 3
SEED = 7
DUTY = "sine:15mm:1Hz:2A:600s"
SMALL = Campaign(
    motions=("sine5mm1Hz", "nonperiodic"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 120.0),
    held_out_temperatures_degC=(),
    held_out_motions=(),
)


def sweep(card: Path, out: Path, *, samples: int = SAMPLES, resume: bool = False, **options: Any) -> Any:
    """Run a sweep of random dampers in this process and return its answer."""
    asked = SweepOptions(samples=samples, **{"seed": SEED, **options})
    return JOBS["sweep"].perform({"card": card}, asked, out=out, resume=resume)[1]


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sweep") / "card.json"
    write_card_of(place)
    return place


@pytest.fixture(scope="module")
def reference(card: Path) -> bytes:
    """Return the result file of a sweep that one process computes without interruption."""
    sweep(card, card.parent / "one", workers=1)
    return (card.parent / "one" / "sweep.json").read_bytes()


@pytest.mark.nightly
def test_sweep_with_two_workers_gives_same_result(card: Path, tmp_path: Path, reference: bytes):
    """The results do not depend on the number of workers."""
    sweep(card, tmp_path / "two", workers=2)
    assert (tmp_path / "two" / "sweep.json").read_bytes() == reference


@pytest.mark.nightly
def test_killed_sweep_workers_lose_no_result(card: Path, tmp_path: Path, reference: bytes):
    """A task whose worker is killed is run again."""
    done, killed = threading.Event(), list[int]()

    def kill() -> None:
        while not done.wait(0.9) and len(killed) < 2:
            for process in active_children()[:1]:
                process.kill()
                killed.append(process.pid or 0)

    killer = threading.Thread(target=kill)
    killer.start()
    try:
        sweep(card, tmp_path / "killed", workers=2)
    finally:
        done.set()
        killer.join()
    assert killed
    assert (tmp_path / "killed" / "sweep.json").read_bytes() == reference


@pytest.mark.nightly
def test_killed_sweep_is_resumed(card: Path, tmp_path: Path, reference: bytes):
    """The resumed sweep uses the results that were stored before it was killed."""
    out = tmp_path / "resumed"
    code = (
        "from pathlib import Path; from mrdamper.registry import JOBS\n"
        "from mrdamper.jobs.options import SweepOptions\n"
        f"JOBS['sweep'].perform({{'card': {str(card)!r}}},"
        f"    SweepOptions(samples={SAMPLES}, seed={SEED}, workers=1), out=Path({str(out)!r}))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)
    until = time.monotonic() + 120.0
    while time.monotonic() < until:
        if (out / RESULTS_FILE).exists() and (out / RESULTS_FILE).read_bytes().count(b"\n") >= 2:
            break
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    answer = sweep(card, out, workers=1, resume=True)
    assert 1 <= answer["resumed"] <= SAMPLES
    assert (out / "sweep.json").read_bytes() == reference


@pytest.mark.nightly
def test_incomplete_result_line_is_recomputed(card: Path, tmp_path: Path, reference: bytes):
    """Complete lines of the result file are used, an incomplete line is computed again."""
    out = tmp_path / "torn"
    out.mkdir()
    lines = (card.parent / "one" / RESULTS_FILE).read_bytes().splitlines(keepends=True)
    (out / RESULTS_FILE).write_bytes(b"".join(lines[:3]) + lines[3][: len(lines[3]) // 2])
    answer = sweep(card, out, workers=1, resume=True)
    assert answer["resumed"] == 2
    assert (out / "sweep.json").read_bytes() == reference


def test_results_of_another_sweep_are_rejected(tmp_path: Path):
    """A folder with results can be used only with ``resume`` and for the same sweep."""
    head = {"kind": "samples", "seed": 1}
    with open_store(tmp_path, resume=False) as store:
        store.begin(head)
        store.add("a", {"figures": {}})
        with pytest.raises(InputError, match="another sweep is at work"), open_store(tmp_path, resume=True):
            pass
    with pytest.raises(InputError, match="holds results of a sweep"), open_store(tmp_path, resume=False):
        pass
    with open_store(tmp_path, resume=True) as store:
        store.begin(head)
        assert store.done == {"a": {"figures": {}}}
        with pytest.raises(InputError, match="different seed"):
            store.begin({**head, "seed": 2})


def test_sweep_does_not_overwrite_its_card(card: Path, tmp_path: Path):
    """The output folder may contain an input file, which is not replaced."""
    own = tmp_path / "out" / "sweep.json"  # The sweep would write its results to a file of this name.
    own.parent.mkdir()
    shutil.copy(card, own)
    with pytest.raises(InputError, match="which this job reads"):
        sweep(own, own.parent, samples=1, workers=1)
    assert own.read_bytes() == card.read_bytes()


@pytest.mark.nightly
def test_cluster_gives_same_sweep_result(card: Path, tmp_path: Path, reference: bytes):
    """No result is lost although a Dask worker is killed."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        before = next(iter(cluster.workers.values())).process.pid
        killer = threading.Timer(1.0, os.kill, (before, signal.SIGKILL))
        killer.start()
        sweep(card, tmp_path / "dask", scheduler=cluster.scheduler_address)
        killer.join()
    assert (tmp_path / "dask" / "sweep.json").read_bytes() == reference


def test_sweep_without_reachable_scheduler_is_rejected(
    card: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """An unreachable scheduler and a cluster without workers cause an error."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(tasks, "CONNECT_MAX_S", 0.5)
    monkeypatch.setattr(tasks, "WORKERS_WAIT_MAX_S", 0.3)
    with pytest.raises(InputError, match="no answer within"):
        sweep(card, tmp_path / "none", scheduler="tcp://127.0.0.1:9")
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, dashboard_address=None, silence_logs=50
        ) as cluster,
        pytest.raises(InputError, match="has had no worker for"),
    ):
        sweep(card, tmp_path / "alone", scheduler=cluster.scheduler_address)


@pytest.mark.nightly
def test_sweep_fits_each_campaign_separately(tmp_path: Path):
    """An invalid file affects only the result of its own campaign."""
    for seed in (1, 2):
        given = {"damper": PRESETS["nominal"], "campaign": SMALL}
        JOBS["rig"].perform(given, RigOptions(seed=seed), out=tmp_path / f"lab-{seed}")
    (tmp_path / "lab-3").mkdir()
    (tmp_path / "lab-3" / "broken.csv").write_text("time_s,force_N\n0,1\n", encoding="utf-8")
    campaigns = [str(tmp_path / "lab-*")]
    answer = JOBS["sweep"].perform(
        {"campaigns": campaigns, "law": "dahl"}, SweepOptions(workers=1), out=tmp_path / "out"
    )[1]
    assert [row["name"] for row in answer["rows"]] == ["lab-1", "lab-2"]
    assert [row["name"] for row in answer["failed"]] == ["lab-3"]
    assert mrdamper.read_card(tmp_path / "out" / "cards" / "lab-1.json").damper.law.name == "dahl"
    assert json.loads((tmp_path / "out" / "sweep.json").read_text())["tasks"] == 3


@pytest.mark.nightly
def test_sweep_searches_heat_sink_for_each_damper(card: Path):
    """The best heat sink of each damper cools the fluid."""
    found = mrdamper.sweep(card=card, dampers=["paper"], duty=DUTY, workers=1)
    (task,) = found.tasks
    assert task.name == found.plan.tasks[0].name
    bare_degC, best_degC = task.figures["bare_degC"], task.figures["best_degC"]
    assert bare_degC is not None
    assert best_degC is not None
    assert bare_degC > best_degC > 20.0


def plan_of(card: Path, **options: Any) -> Plan:
    return make_plan(None, mrdamper.read_card(card), None, read_duty(DUTY), None, SweepOptions(**options))


def test_sweep_tasks_have_reproducible_seeds(card: Path):
    """Each task has its own seed, which depends only on the seed of the sweep."""
    first, again, other = (
        [task.seed for task in plan_of(card, samples=5, seed=seed).tasks] for seed in (7, 7, 8)
    )
    assert first == again
    assert len(set(first)) == len(first)
    assert not set(first) & set(other)


def test_sweep_requires_exactly_one_kind_of_input(card: Path, tmp_path: Path):
    """Campaigns, random dampers and geometry files exclude each other."""
    duty = read_duty(DUTY)
    with pytest.raises(UsageError, match="0 kinds of sweep"):
        make_plan(None, None, None, duty, None, SweepOptions())
    with pytest.raises(UsageError, match="2 kinds of sweep"):
        make_plan([tmp_path], None, None, duty, None, SweepOptions(samples=1))
    with pytest.raises(UsageError, match="needs a card"):
        make_plan(None, None, None, duty, None, SweepOptions(samples=1))
    with pytest.raises(UsageError, match="matches no campaign"):
        make_plan([tmp_path / "none*"], None, None, duty, None, SweepOptions())


def test_swept_campaigns_have_unique_names(tmp_path: Path):
    """A campaign is named after its file, and its folder if file names repeat. ``c.truth`` is ignored."""
    for place in ("a/run.csv", "b/run.csv", "c.csv", "c.truth"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        (tmp_path / place).write_text("t,x\n", encoding="utf-8")
    given = [tmp_path / "*/run.csv", tmp_path / "c*"]
    plan = make_plan(given, None, None, read_duty(DUTY), None, SweepOptions())
    assert [task.name for task in plan.tasks] == ["a-run", "b-run", "c"]


def test_task_that_kills_workers_ends_sweep(monkeypatch: pytest.MonkeyPatch):
    """A task whose workers die is repeated only a limited number of times."""
    monkeypatch.setattr(tasks, "DEATHS_MAX", 3)
    monkeypatch.setattr(tasks, "run_task", _die)
    with pytest.raises(InputError, match="workers died 3 times"):
        list(run_on_processes([Task("a", "samples", 1, {})], 1))


def _die(_: Task) -> None:
    os.kill(os.getpid(), signal.SIGKILL)
