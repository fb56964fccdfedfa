"""kill -9 in the middle: what is there is whole or not there, a rerun ends, and it ends in the same files.

The long test kills 200 times at random moments; ``MRDAMPER_KILLS`` is another number of them,
``MRDAMPER_KILLS_SEED`` another course, ``MRDAMPER_KILLS_OUT`` a file for the counts.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.support.kills import (
    IDENTIFY,
    MARK,
    SINK,
    Nursery,
    has_more,
    kill_after,
    kill_when,
    left_behind,
    of_any_folder,
    orphans,
    rows,
    written,
)
from tests.support.rigs import command
from tests.web.served import served

pytestmark = pytest.mark.system


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("arguments", "kept", "other", "differs"),
    [
        pytest.param(SINK, (2,), ("--mass-g", 300), "options", id="sink-grid"),
    ],
)
def test_what_was_killed_goes_on_to_the_same_files(
    nursery: Nursery,
    tmp_path: Path,
    arguments: Sequence[object],
    kept: tuple[int, ...],
    other: tuple[object, ...],
    differs: str,
):
    """Killed again and again, each time with more finished, it ends in what an uninterrupted run wrote."""
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert nursery.run(*arguments, "--out", whole) == 0, nursery.said
    progress = tmp_path / "out.progress"
    for finished in kept:
        kill = kill_when(has_more(progress, finished))
        assert nursery.run(*arguments, "--out", out, "--resume", kill=kill) == -9
        assert written(out) is None
        assert rows(progress) > finished
    assert nursery.run(*arguments, *other, "--out", out, "--resume") == 3
    assert f"another run (another {differs})" in nursery.said
    assert nursery.run(*arguments, "--out", out, "--resume") == 0, nursery.said
    assert "going on from" in nursery.said
    assert "finished parts" in nursery.said
    assert of_any_folder(written(out), out) == of_any_folder(written(whole), whole)
    assert not left_behind(tmp_path)


KILLED_WHILE_MOVING = """
import os, pathlib, signal, sys
from mrdamper.runtime.outputs import atomic_output
moves, replace = [], pathlib.Path.replace
def counted(self, target):
    moves.append(target)
    if len(moves) == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return replace(self, target)
pathlib.Path.replace = counted
with atomic_output(pathlib.Path(sys.argv[1])) as beside:
    for k in range(5):
        (beside / f"{k}.txt").write_text("new")
"""


def test_files_that_were_being_moved_are_moved_by_the_next_job(tmp_path: Path):
    """Two of five have their place when the job is killed: they are a whole set again with the next job."""
    from mrdamper.runtime.outputs import atomic_output

    out = tmp_path / "out"
    out.mkdir()
    for k in range(5):
        (out / f"{k}.txt").write_text("old")
    done = subprocess.run([sys.executable, "-c", KILLED_WHILE_MOVING, str(out)], check=False)
    assert done.returncode == -9
    assert sorted(path.read_text() for path in out.glob("*.txt")) == ["new"] * 2 + ["old"] * 3
    with pytest.raises(ValueError, match="of no matter"), atomic_output(out):
        raise ValueError("of no matter")
    assert {path.read_text() for path in out.glob("*.txt")} == {"new"}
    assert not left_behind(tmp_path)


def test_what_a_killed_job_wrote_is_removed_and_what_a_living_one_writes_is_not(tmp_path: Path):
    from mrdamper.runtime.outputs import atomic_output, recover_staging

    code = (
        "import os, pathlib, signal, sys\n"
        "from mrdamper.runtime.outputs import atomic_output\n"
        "with atomic_output(pathlib.Path(sys.argv[1])) as beside:\n"
        "    (beside / 'half').write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    for _ in range(3):
        subprocess.run([sys.executable, "-c", code, str(tmp_path / "out")], check=False)
        assert len(left_behind(tmp_path)) == 1  # they do not pile up
    with atomic_output(tmp_path / "other") as beside:
        (beside / "mine.txt").write_text("mine")
        recover_staging(tmp_path)
        assert left_behind(tmp_path) == [str(beside.parent.relative_to(tmp_path))]
    assert (tmp_path / "other" / "mine.txt").read_text() == "mine"
    assert not (tmp_path / "out").exists()
    assert not left_behind(tmp_path)


def test_a_sweep_that_is_killed_leaves_no_process(nursery: Nursery, tmp_path: Path):
    """Its workers would wait for ever for a process that is no more."""
    out, mark = tmp_path / "out", f"sweep-{os.getpid()}"
    arguments = ("sweep", nursery.folder / "tolerance.toml", "--out", out, "--workers", 1)
    process = subprocess.Popen(command(*arguments), env={**os.environ, MARK: mark}, stdout=subprocess.DEVNULL)
    kill_when(has_more(out / "sweep.jsonl", 1))(process.pid)
    assert process.wait() == -9
    assert not orphans(mark)


# --------------------------------------------------------------------------------------- at random moments


class Soak:
    """Kills commands at random moments and counts what came of it."""

    def __init__(self, nursery: Nursery, seed: int) -> None:
        self.nursery, self.folder = nursery, nursery.folder
        self.random = np.random.default_rng(seed)
        self.counts: Counter[str] = Counter()
        self.faults: list[str] = []

    def run(
        self, name: str, arguments: Sequence[object], kills: int, *, older: Sequence[object] = ()
    ) -> None:
        """Kill a command so often; every third kill it may end, and must then have written the same."""
        place = self.folder / f"soak-{name}"
        begun = time.monotonic()
        whole = self._ended(place / "whole", arguments)
        span = time.monotonic() - begun
        old = self._ended(place / "old", older) if older else None
        out, done, tries = place / "out", 0, 0
        while done < kills:
            shutil.rmtree(out, ignore_errors=True)
            if old is not None and tries % 2:
                shutil.copytree(place / "old", out)
            tries += 1
            standing = written(out)
            for _ in range(3):
                moment = float(self.random.uniform(0.0, 1.05 * span))
                code = self._once((*arguments, "--out", out), moment)
                if code == 0:
                    break
                if code != -9:
                    self._fault("failed", f"{name}: exit code {code}: {self.nursery.said[-400:]}")
                    break
                done += 1
                self.counts[f"kills of {name}"] += 1
                self.counts["kills"] += 1
                found = written(out)
                if found not in (standing, None) and of_any_folder(found, out) != whole:
                    moved = any(place.rglob(".mrdamper-*/whole"))
                    self._fault("being moved" if moved else "half-written", f"{name} at {moment:.3f} s")
                if found is None and standing is not None:
                    self._fault("lost", f"{name}: what stood there is gone")
            code = self._once((*arguments, "--out", out), None)
            if code != 0 or of_any_folder(written(out), out) != whole:
                self._fault("lost", f"{name}: exit code {code}: {self.nursery.said[-400:]}")
            self.counts["reruns that ended"] += code == 0
            if left := left_behind(place):
                self._fault("left behind", f"{name}: {left}")
        if found_orphans := orphans(self.nursery.mark, self.nursery.pid):
            self._fault("orphans", f"{name}: {found_orphans}")
        self.said()

    def _once(self, arguments: Sequence[object], moment: float | None) -> int:
        if arguments[0] != "sweep":
            return self.nursery.run(*arguments, kill=None if moment is None else kill_after(moment))
        process = subprocess.Popen(
            command(*arguments),
            cwd=self.folder,
            env={**os.environ, MARK: self.nursery.mark, "OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        if moment is not None:
            kill_after(moment)(process.pid)
        return process.wait()

    def _ended(self, out: Path, arguments: Sequence[object]) -> dict[str, str]:
        code = self._once((*arguments, "--out", out), None)
        assert code == 0, self.nursery.said
        return of_any_folder(written(out), out)

    def _fault(self, kind: str, what: str) -> None:
        self.counts[kind] += 1
        self.faults.append(f"{kind}: {what}")

    def said(self) -> str:
        """Return the counts so far; a file holds them, too, where one is asked for."""
        text = json.dumps({"counts": dict(self.counts), "faults": self.faults}, indent=1)
        if place := os.environ.get("MRDAMPER_KILLS_OUT"):
            Path(place).write_text(text + "\n", encoding="utf-8")
        return text

    def serve(self, kills: int) -> None:
        """Kill servers whose job is at work; the next one finds it interrupted and does it again."""
        root = self.folder / "served"
        shutil.copytree(self.folder / "runs", root / "runs")
        for done in range(kills):
            with served(root) as client:
                client.read_all()
                job = client.job("fit", card="one", law="bouc-wen", replace=True)
                time.sleep(float(self.random.uniform(0.0, 6.0)))
                client.kill()
            self.counts["kills"] += 1
            self.counts["kills of serve"] += 1
            card = root / "cards" / "one" / "card.json"
            if card.exists():
                json.loads(card.read_text(encoding="utf-8"))
            until = time.monotonic() + 15.0
            while any(_at_work_in(root)) and time.monotonic() < until:
                time.sleep(0.1)
            if any(_at_work_in(root)):
                self._fault("orphans", f"serve {done}: {list(_at_work_in(root))}")
            with served(root) as client:
                state = client.get(f"/api/jobs/{job}")["state"]
                self.counts[f"served job found {state}"] += 1
                if state not in {"interrupted", "done"}:
                    self._fault("lost", f"serve {done}: {job} is {state}")
                client.read_all()
                again = client.job("fit", card="one", law="bouc-wen", replace=True)
                ended = client.ended(again, 120.0)["state"]
                self.counts["reruns that ended"] += ended == "done"
                if ended != "done":
                    self._fault("lost", f"serve {done}: asked again, it is {ended}")
            if left := left_behind(root):
                self._fault("left behind", f"serve {done}: {left}")


def _at_work_in(folder: Path) -> Iterator[int]:
    from tests.web.served import python_processes_of

    yield from python_processes_of(folder)


@pytest.mark.release
def test_kills_at_random_moments_cost_nothing(nursery: Nursery):
    """Nothing half-written, nothing lost, nothing left behind, no process left; every rerun ends the same."""
    kills = int(os.environ.get("MRDAMPER_KILLS", "200"))
    soak = Soak(nursery, int(os.environ.get("MRDAMPER_KILLS_SEED", "1")))

    def share(percent: int) -> int:
        return max(kills * percent // 100, 1)

    soak.run("rig", ("rig", "--campaign", "campaign.toml", "--seed", 4), share(20),
             older=("rig", "--campaign", "campaign.toml", "--seed", 5))  # fmt: skip
    soak.run("fit", IDENTIFY, share(35), older=("fit", "runs", "--law", "bingham"))
    soak.run("heatsink", (*SINK, "--resume"), share(25), older=(*SINK, "--mass-g", 300))
    soak.run("sweep", ("sweep", "tolerance.toml", "--workers", 2, "--resume"), share(7))
    soak.serve(share(6))
    soak.run("demo", ("demo", "--quick"), kills - soak.counts["kills"])
    print(soak.said())
    assert soak.counts["kills"] >= kills
    assert not [fault for fault in soak.faults if not fault.startswith("being moved")]
