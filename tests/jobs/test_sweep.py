"""Sweeps: the same results wherever they run, whoever dies, and however often they are taken up again."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

import mrdamper
from mrdamper.errors import InputError
from mrdamper.jobs.options import RigOptions, SweepOptions
from mrdamper.jobs.sweep import executors
from mrdamper.jobs.sweep.executors import run_on_processes
from mrdamper.jobs.sweep.plan import Plan, Task, read_plan
from mrdamper.jobs.sweep.plan_files import files_of_plan, texts_of_plan
from mrdamper.jobs.sweep.results import CHECKPOINT, Store
from mrdamper.jobs.sweep.sweep import SweepResult, SweptTask, decisive
from mrdamper.jobs.sweep.sweep import sweep as run_sweep
from mrdamper.jobs.sweep.tasks import run_task
from mrdamper.registry import JOBS
from mrdamper.runtime.worker import Answer, WorkerEndedError, WorkerOptions
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.plant import PRESETS
from tests.support.tracked import write_a_card

pytestmark = pytest.mark.system

TOLERANCE = """
kind = "tolerance"
seed = 7
[tolerance]
card = "card.json"
spread_percent = 10
draws = 5
targets = ["sine-900N-1Hz"]
temperatures_degC = [60]
"""
SMALL = Campaign(
    motions=("sine5mm1Hz", "nonperiodic"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 120.0),
    held_out_temperatures_degC=(),
    held_out_motions=(),
)


def sweep(plan: Path, out: Path, *, resume: bool = False, **options: Any) -> dict[str, Any]:
    """Run the job from this process; return its answer."""
    return JOBS["sweep"].perform({"plan": plan}, SweepOptions(**options), out=out, resume=resume)[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("sweep")
    write_a_card(place / "card.json")
    (place / "tolerance.toml").write_text(TOLERANCE, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def reference(folder: Path) -> bytes:
    """Return what one process gives, without interruption."""
    sweep(folder / "tolerance.toml", folder / "one", workers=1)
    return (folder / "one" / "sweep.json").read_bytes()


def children() -> set[int]:
    """Return the worker processes of this one."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                line = (entry / "cmdline").read_bytes()
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except (OSError, IndexError):
                continue
            if parent == os.getpid() and b"mrdamper.runtime" in line:
                found.add(int(entry.name))
    return found


def kill_workers_until(done: threading.Event, killed: list[int]) -> None:
    while not done.wait(0.9):
        for process in sorted(children())[:1]:
            os.kill(process, signal.SIGKILL)
            killed.append(process)
            if len(killed) == 3:
                return


@pytest.mark.nightly
def test_two_processes_give_what_one_gives(folder: Path, reference: bytes):
    sweep(folder / "tolerance.toml", folder / "two", workers=2)
    assert (folder / "two" / "sweep.json").read_bytes() == reference


@pytest.mark.nightly
def test_killed_workers_cost_no_result(folder: Path, reference: bytes):
    done, killed = threading.Event(), list[int]()
    killer = threading.Thread(target=kill_workers_until, args=(done, killed))
    killer.start()
    try:
        sweep(folder / "tolerance.toml", folder / "killed", workers=2)
    finally:
        done.set()
        killer.join()
    assert killed
    assert (folder / "killed" / "sweep.json").read_bytes() == reference


def test_a_sweep_replaces_no_card_that_its_plan_names(folder: Path, tmp_path: Path):
    card = tmp_path / "out" / "sweep.json"  # a file that a sweep writes
    card.parent.mkdir()
    shutil.copy(folder / "card.json", card)
    plan = (folder / "tolerance.toml").read_text(encoding="utf-8")
    there = plan.replace("card.json", "out/sweep.json").replace("draws = 5", "draws = 1")
    (tmp_path / "plan.toml").write_text(there, encoding="utf-8")
    before = card.read_bytes()
    with pytest.raises(InputError, match=r"would replace .*sweep\.json, which this job reads"):
        sweep(tmp_path / "plan.toml", tmp_path / "out", workers=1)
    assert card.read_bytes() == before


@pytest.mark.nightly
def test_a_sweep_that_was_killed_is_taken_up_where_it_ended(folder: Path, reference: bytes):
    out = folder / "resumed"
    code = (
        "from pathlib import Path; from mrdamper.registry import JOBS\n"
        "from mrdamper.jobs.options import SweepOptions\n"
        "if __name__ == '__main__':\n"
        f"    JOBS['sweep'].perform({{'plan': {str(folder / 'tolerance.toml')!r}}}, SweepOptions(workers=1),"
        f"        out=Path({str(out)!r}), resume=False)\n"
    )
    script = folder / "run.py"
    script.write_text(code, encoding="utf-8")
    process = subprocess.Popen([sys.executable, str(script)], start_new_session=True)
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        rows = (out / CHECKPOINT).read_bytes().count(b"\n") if (out / CHECKPOINT).exists() else 0
        if rows >= 3:
            break
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    answer = sweep(folder / "tolerance.toml", out, workers=1, resume=True)
    assert 2 <= answer["taken_up"] <= 5
    assert (out / "sweep.json").read_bytes() == reference


@pytest.mark.nightly
def test_a_torn_line_is_done_again_and_whole_ones_are_not(folder: Path, reference: bytes):
    out = folder / "torn"
    out.mkdir()
    lines = (folder / "one" / CHECKPOINT).read_bytes().splitlines(keepends=True)
    (out / CHECKPOINT).write_bytes(b"".join(lines[:3]) + lines[3][: len(lines[3]) // 2])
    answer = sweep(folder / "tolerance.toml", out, workers=1, resume=True)
    assert answer["taken_up"] == 2
    assert (out / "sweep.json").read_bytes() == reference
    assert len((out / CHECKPOINT).read_bytes().splitlines()) == 6


def test_results_of_another_plan_are_not_taken(folder: Path, reference: bytes):
    assert reference
    other = folder / "other.toml"
    other.write_text(TOLERANCE.replace("seed = 7", "seed = 8"), encoding="utf-8")
    with pytest.raises(InputError, match=r"another run \(another plan, seed\)"):
        sweep(other, folder / "one", workers=1, resume=True)
    with pytest.raises(InputError, match="holds results of a sweep"):
        sweep(folder / "tolerance.toml", folder / "one", workers=1)


@pytest.mark.nightly
def test_a_cluster_that_loses_a_worker_gives_what_one_process_gives(folder: Path, reference: bytes):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        before = next(iter(cluster.workers.values())).process.pid
        killer = threading.Timer(1.0, os.kill, (before, signal.SIGKILL))
        killer.start()
        sweep(folder / "tolerance.toml", folder / "dask", scheduler=cluster.scheduler_address)
        killer.join()
    assert (folder / "dask" / "sweep.json").read_bytes() == reference


def known(cluster: Any) -> set[str]:
    """Return the workers that are up: one that is killed while it starts is given up by Dask."""
    return set(cluster.scheduler.workers)


def test_a_cluster_without_workers_is_one_message(folder: Path, monkeypatch: pytest.MonkeyPatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("mrdamper.jobs.sweep.executors._ALONE_S", 0.3)
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, dashboard_address=None, silence_logs=50
        ) as cluster,
        pytest.raises(InputError, match="has had no worker for"),
    ):
        sweep(folder / "tolerance.toml", folder / "alone", scheduler=cluster.scheduler_address)


@pytest.mark.release
def test_a_cluster_that_loses_a_worker_every_five_seconds_gives_what_one_process_gives(folder: Path):
    """One process, two processes and two Dask workers, one of them killed every 5 s: the same bytes."""
    pytest.importorskip("distributed")
    plan = folder / "many.toml"
    plan.write_text(TOLERANCE.replace("draws = 5", "draws = 40"), encoding="utf-8")
    for workers in (1, 2):
        sweep(plan, folder / f"many-{workers}", workers=workers)
    expected = (folder / "many-1" / "sweep.json").read_bytes()
    assert (folder / "many-2" / "sweep.json").read_bytes() == expected
    begun = time.monotonic()
    killed = sweep_while_workers_die(plan, folder / "many-dask")
    print(f"{killed} workers killed in {time.monotonic() - begun:.0f} s")
    assert killed >= 4
    assert (folder / "many-dask" / "sweep.json").read_bytes() == expected


def sweep_while_workers_die(plan: Path, out: Path) -> int:
    """Run a sweep on two Dask workers, the older one of them killed every 5 s; return how many died.

    On a machine that is so busy that a worker takes longer than that to come back, it is waited for.
    """
    import distributed

    done, killed = threading.Event(), list[int]()

    def kill_every_five_seconds() -> None:
        oldest_first: list[int] = []
        while not done.wait(5.0):
            up = [nanny for nanny in cluster.workers.values() if nanny.worker_address in known(cluster)]
            now = [nanny.process.pid for nanny in up]
            oldest_first = [pid for pid in oldest_first if pid in now]
            oldest_first += [pid for pid in now if pid not in oldest_first]
            if len(oldest_first) == 2:
                killed.append(oldest_first.pop(0))
                os.kill(killed[-1], signal.SIGKILL)

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        killer = threading.Thread(target=kill_every_five_seconds)
        killer.start()
        try:
            assert len(sweep(plan, out, scheduler=cluster.scheduler_address)["rows"]) == 40
        finally:
            done.set()
            killer.join()
    return len(killed)


def test_no_scheduler_is_one_message(folder: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mrdamper.jobs.sweep.executors._CONNECT_S", 0.5)
    with pytest.raises(InputError, match="no answer within"):
        sweep(folder / "tolerance.toml", folder / "none", scheduler="tcp://127.0.0.1:9")


@pytest.mark.nightly
def test_campaigns_are_identified_each_for_itself(folder: Path):
    """A file that is no run costs its own result and no other."""
    for seed in (1, 2):
        given = {"damper": PRESETS["nominal"], "campaign": SMALL}
        JOBS["rig"].perform(given, RigOptions(seed=seed), out=folder / f"lab-{seed}")
    (folder / "lab-3").mkdir()
    (folder / "lab-3" / "broken.csv").write_text("time_s,force_N\n0,1\n", encoding="utf-8")
    plan = folder / "identify.toml"
    plan.write_text('kind = "fit"\n[fit]\ncampaigns = ["lab-*"]\nlaw = "dahl"\n', encoding="utf-8")
    answer = sweep(plan, folder / "identified", workers=1)
    assert [row["name"] for row in answer["rows"]] == ["lab-1", "lab-2"]
    assert [row["name"] for row in answer["failed"]] == ["lab-3"]
    assert mrdamper.read_card(folder / "identified" / "cards" / "lab-1.json").damper.law.name == "dahl"
    assert json.loads((folder / "identified" / "sweep.json").read_text())["tasks"] == 3


@pytest.mark.nightly
def test_a_sink_sweep_names_dampers_and_duties(folder: Path):
    plan = folder / "sink.toml"
    plan.write_text(
        'kind = "heatsink"\n[heatsink]\ncard = "card.json"\nspan_mm = 30\nleast_thickness_mm = 2\n'
        'duties = ["sine:15mm:1Hz:2A:600s", "sine:5mm:1Hz:2A:600s"]\n',
        encoding="utf-8",
    )
    tasks = read_plan(plan).tasks
    assert [task.name for task in tasks] == ["paper-duty-1", "paper-duty-2"]
    results = [run_task(task.kind, task.seed, task.what)["figures"] for task in tasks]
    assert results[0]["bare_degC"] > results[1]["bare_degC"] > 20.0


def test_seeds_of_tasks_follow_from_the_plan_s(tmp_path: Path):
    def seeds(text: str) -> list[int]:
        (tmp_path / "plan.toml").write_text(text, encoding="utf-8")
        return [task.seed for task in read_plan(tmp_path / "plan.toml").tasks]

    first, again = seeds(TOLERANCE), seeds(TOLERANCE)
    other = seeds(TOLERANCE.replace("seed = 7", "seed = 8"))
    assert first == again
    assert len(set(first)) == len(first)
    assert not set(first) & set(other)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("kind = ", "kindly = "), "kind is missing"),
        (('"tolerance"', '"tolerence"'), "expected one of: fit, tolerance, heatsink"),
        (("[tolerance]", "[tolerances]"), "unknown key 'tolerances'"),
        (("spread_percent = 10", "spread_percent = 90"), "expected a number, 0 to 30"),
        (("draws = 5", "draws = 0"), "whole number"),
        (("draws = 5", "drawn = 5"), "has no key 'drawn'; did you mean draws"),
        (("sine-900N-1Hz", "sine-900N"), "sine-900N-1Hz"),
        (("[60]", "['a']"), "a number"),
        (("[60]", "[60]\n[heatsink]\ncard = 'c'"), r"the table \[heatsink\] is of another kind of sweep"),
        (('kind = "tolerance"', 'kind = "heatsink"'), r"the table \[tolerance\] is of another kind of sweep"),
        (
            ("[tolerance]", "[fit]\ncampaigns = 'a'\n[tolerance]"),
            r"the table \[fit\] is of another",
        ),
        (("draws = 5", "draws = 5\nseed = 3"), "expected it above the table, for all tasks"),
    ],
)
def test_a_plan_that_cannot_be_is_one_message(tmp_path: Path, change: tuple[str, str], said: str):
    assert change[0] in TOLERANCE
    path = tmp_path / "plan.toml"
    path.write_text(TOLERANCE.replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_plan(path)


def test_campaigns_and_drawings_of_a_plan_have_names_of_their_own(tmp_path: Path):
    """As many parents as tell them apart; what belongs to a rig's truth is no campaign."""
    for place in ("a/run.csv", "b/run.csv", "c.csv", "c.truth"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        (tmp_path / place).write_text("t,x\n", encoding="utf-8")
    plan, table = tmp_path / "plan.toml", 'kind = "{}"\n[{}]\n{}\n'
    plan.write_text(table.format("fit", "fit", 'campaigns = ["*/run.csv", "c*"]'), encoding="utf-8")
    tasks = read_plan(plan).tasks
    assert [task.name for task in tasks] == ["a-run", "b-run", "c"]
    assert [Path(str(task.what["path"])).name for task in tasks] == ["run.csv", "run.csv", "c.csv"]
    assert {tmp_path / "a/run.csv", tmp_path / "c.csv"} <= set(files_of_plan(plan))
    assert texts_of_plan(plan) == ["*/run.csv", "c*"]
    plan.write_text(table.format("fit", "fit", 'campaigns = "none*"'), encoding="utf-8")
    with pytest.raises(InputError, match=r"none\*: matches no campaign in"):
        read_plan(plan)
    keys = 'card = "c.csv"\ndampers = ["paper", "d.toml"]\nduties = ["sine:5mm:1Hz:1A:60s", "d.csv"]'
    plan.write_text(table.format("heatsink", "heatsink", keys), encoding="utf-8")
    assert texts_of_plan(plan) == ["c.csv", "d.toml", "d.csv"]  # no preset, and no motion in words


def test_figures_are_summed_up_over_the_tasks_that_have_them():
    plan = Plan("plan.toml", "heatsink", 0, tuple(Task(name, "heatsink", 1, {}) for name in "abcd"))
    figures: tuple[dict[str, float | None], ...] = (
        {"degC": 1.0, "gone": None},
        {"degC": 3.0},
        {},
        {"degC": None},
    )
    swept = [
        SweptTask(name, values, "broken" if name == "c" else "", None)
        for name, values in zip("abcd", figures, strict=True)
    ]
    result = SweepResult(plan, tuple(swept), 0)
    assert (result.names, result.cancelled) == (["degC", "gone"], False)
    assert [task.name for task in result.failed] == ["c"]
    assert set(result.summary) == {"degC"}
    degrees = result.summary["degC"]
    assert (degrees.count, degrees.least, degrees.median, degrees.most) == (2, 1.0, 2.0, 3.0)
    assert [degrees.p5, degrees.p95] == pytest.approx([1.1, 2.9])
    assert SweepResult(plan, tuple(swept[:2]), 0).cancelled
    with pytest.raises(InputError, match="expected one of the two"):
        run_sweep(plan, SweepOptions(workers=1, scheduler="tcp://127.0.0.1:9"))


def test_no_task_is_run_when_all_are_done(tmp_path: Path):
    plan = Plan("plan.toml", "tolerance", 0, (Task("a", "tolerance", 1, {}),))
    store = Store(tmp_path, decisive(plan, SweepOptions()), resume=False)
    store.add("a", {"figures": {}})
    store.close()
    again = Store(tmp_path, decisive(plan, SweepOptions()), resume=True)
    again.close()
    assert again.done == {"a": {"figures": {}}}
    assert list(run_on_processes([], 1)) == []


class Mortal:
    """A worker that dies at some questions, and answers the others."""

    deaths: dict[str, int]  # at a task, that are left

    def __init__(self, options: WorkerOptions) -> None:
        self.stopped = False

    def ask(self, question: dict[str, Any]) -> Answer:
        name = question["what"]["name"]
        if self.deaths.get(name, 0) > 0:
            self.deaths[name] -= 1
            raise WorkerEndedError(-9)
        return Answer({"figures": {"of": name}}, ())

    def kill(self) -> None: ...

    def stop(self) -> None:
        self.stopped = True


@pytest.mark.parametrize("workers", [1, 3])
@pytest.mark.parametrize(("deaths", "ends"), [({}, True), ({"a": 19, "c": 19}, True), ({"b": 20}, False)])
def test_a_task_is_given_to_another_worker_until_twenty_have_died_in_a_row(
    workers, deaths, ends, monkeypatch
):
    """Deaths count between two results: with one worker the tasks come one after the other."""
    if workers > 1 and len(deaths) > 1:
        deaths = {"a": 9, "c": 9}
    monkeypatch.setattr(Mortal, "deaths", dict(deaths), raising=False)
    monkeypatch.setattr(executors, "Worker", Mortal)
    tasks = [Task(name=name, kind="heatsink", seed=1, what={"name": name}) for name in "abcd"]
    if ends:
        done = list(run_on_processes(tasks, workers))
        assert sorted(task.name for task, _ in done) == list("abcd")
        assert all(result == {"figures": {"of": task.name}} for task, result in done)
    else:
        with pytest.raises(InputError, match="workers died 20 times in a row, the last at b"):
            list(run_on_processes([tasks[1]], workers))
