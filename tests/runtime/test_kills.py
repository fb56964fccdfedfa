"""After kill -9 at any moment, outputs are complete or absent, and a rerun writes the same files.

The release test kills 200 times at random moments; ``MRDAMPER_KILLS`` sets the number of kills,
``MRDAMPER_KILLS_SEED`` the seed.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from mrdamper.jobs.sweep.store import RESULTS_FILE
from mrdamper.runtime.outputs import atomic_output, recover_staging
from tests.support.kills import (
    IDENTIFY,
    MARK,
    SINK,
    SWEEP,
    Nursery,
    has_more,
    kill_after,
    kill_when,
    left_behind,
    of_any_folder,
    orphans,
    written,
)
from tests.support.rigs import command

pytestmark = pytest.mark.system

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
with atomic_output(pathlib.Path(sys.argv[1])) as stage:
    for k in range(5):
        (stage / f"{k}.txt").write_text("new")
"""
KILLED_WHILE_WRITING = """
import os, pathlib, signal, sys
from mrdamper.runtime.outputs import atomic_output
with atomic_output(pathlib.Path(sys.argv[1])) as stage:
    (stage / "half").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_next_job_moves_files_of_killed_job(tmp_path: Path):
    """A job is killed after moving two of five files. The next job with this output moves the others."""
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


def test_next_job_removes_unfinished_files(tmp_path: Path):
    """Unfinished files of a killed job are removed. Files of a running job are kept."""
    for _ in range(3):
        subprocess.run([sys.executable, "-c", KILLED_WHILE_WRITING, str(tmp_path / "out")], check=False)
        assert len(left_behind(tmp_path)) == 1  # Each job removes the files that the previous job has left.
    with atomic_output(tmp_path / "other") as stage:
        (stage / "mine.txt").write_text("mine")
        recover_staging(tmp_path)
        assert left_behind(tmp_path) == [str(stage.parent.relative_to(tmp_path))]
    assert (tmp_path / "other" / "mine.txt").read_text() == "mine"
    assert not (tmp_path / "out").exists()
    assert not left_behind(tmp_path)


def test_killed_sweep_leaves_no_process(nursery: Nursery, tmp_path: Path):
    """The worker processes end after their parent process has been killed."""
    out, mark = tmp_path / "out", f"sweep-{os.getpid()}"
    process = subprocess.Popen(
        command(*SWEEP, "--out", out), cwd=nursery.folder, env={**os.environ, MARK: mark},
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    kill_when(has_more(out / RESULTS_FILE, 1))(process.pid)
    assert process.wait() == -9
    assert not orphans(mark)


@pytest.mark.release
def test_random_kills_lose_no_files(nursery: Nursery):
    """No output is partial or lost, no process remains, and every rerun writes the same files."""
    kills = int(os.environ.get("MRDAMPER_KILLS", "200"))
    random = np.random.default_rng(int(os.environ.get("MRDAMPER_KILLS_SEED", "1")))
    jobs: dict[str, tuple[int, Sequence[object], Sequence[object]]] = {
        "rig": (20, ("rig", "--campaign", "campaign.toml", "--seed", 4),
                ("rig", "--campaign", "campaign.toml", "--seed", 5)),
        "fit": (40, IDENTIFY, ("fit", "runs", "--law", "bingham")),
        "heatsink": (25, SINK, (*SINK, "--mass-g", 300)),
        "sweep": (10, (*SWEEP, "--resume"), ()),
        "demo": (5, ("demo", "--quick"), ()),
    }  # fmt: skip
    counts: Counter[str] = Counter()
    for name, (percent, arguments, older) in jobs.items():
        _kill_at_random(nursery, random, counts, name, arguments, older, max(kills * percent // 100, 1))
    print(json.dumps(counts, indent=1))


def _kill_at_random(
    nursery: Nursery,
    random: np.random.Generator,
    counts: Counter[str],
    name: str,
    arguments: Sequence[object],
    older: Sequence[object],
    kills: int,
) -> None:
    """Kill a command at random moments, every other time in a folder with an older result."""
    place = nursery.folder / f"kills-{name}"
    begun = time.monotonic()
    assert nursery.run(*arguments, "--out", place / "whole") == 0, nursery.said
    span = time.monotonic() - begun
    whole = of_any_folder(written(place / "whole"), place / "whole")
    if older:
        assert nursery.run(*older, "--out", place / "old") == 0, nursery.said
    out, done, tries = place / "out", 0, 0
    while done < kills:
        shutil.rmtree(out, ignore_errors=True)
        if older and tries % 2:
            shutil.copytree(place / "old", out)
        tries += 1
        before = written(out)
        code = nursery.run(*arguments, "--out", out, kill=kill_after(float(random.uniform(0.0, 1.05 * span))))
        assert code in {0, -9}, nursery.said
        done += code == -9
        counts[f"{name}: exit code {code}"] += 1
        found = written(out)
        is_being_moved = any(place.rglob(".mrdamper-*/whole"))
        assert is_being_moved or found == before or of_any_folder(found, out) == whole
        assert nursery.run(*arguments, "--out", out) == 0, nursery.said
        assert of_any_folder(written(out), out) == whole
        assert not left_behind(place)
    assert not orphans(nursery.mark, nursery.pid)
