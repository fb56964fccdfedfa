"""Each write of a job fails once, for want of room, permission or memory: no half of it is left.

Failures are injected by an audit hook, so that whatever opens, makes or moves a file below the watched folder
fails, in whichever library it is.
"""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from mrdamper.errors import InputError
from mrdamper.jobs.options import (
    DerateOptions,
    ExportOptions,
    FitOptions,
    HeatsinkOptions,
    SweepOptions,
    TrackOptions,
)
from mrdamper.registry import JOBS
from tests.support.kills import left_behind, written
from tests.support.tracked import write_a_card

pytestmark = pytest.mark.system

CAMPAIGN = """
motions = ["sine5mm1Hz"]
currents_A = [0.0, 1.0, 2.0]
temperatures_degC = [20.0]
duration_s = 2.0
"""
FAULTS: tuple[Callable[[str], BaseException], ...] = (
    lambda path: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path),
    lambda path: PermissionError(errno.EACCES, os.strerror(errno.EACCES), path),
    lambda _: MemoryError(),
)
MOST = 200  # writes of a job
VISCOSITY = "temperature_degC,viscosity_mPas\n" + "".join(
    f"{t},{112 * 0.985 ** (t - 20):.4f}\n" for t in range(20, 101, 10)
)
PLAN = """
kind = "heatsink"
[heatsink]
card = "card.json"
duties = ["sine:15mm:1Hz:2A:60s"]
"""
NO_FILES = {"cite", "data list", "data fetch"}  # the last has a cache of its own (``test_catalog``)
DEMO = {"demo"}  # its files are those of the jobs that it runs
DUTY = "sine:15mm:1Hz:2A:60s"
QUICK = ["evaluate"]
EXPORTS = {f"export {each.name}" for each in JOBS["export"].outputs}
LONG = {*JOBS, *EXPORTS} - {*QUICK, "export"} - NO_FILES - DEMO
HOURS = {"heatsink", "sweep"}  # run again for each of their writes: a checkpoint is among them
NAMES = [
    *QUICK,
    *(pytest.param(each, marks=getattr(pytest.mark, "release" if each in HOURS else "nightly"))
      for each in sorted(LONG)),
]  # fmt: skip


@dataclass(slots=True)
class _Watch:
    """The writes below a folder: which of them fails, and how."""

    folder: str = ""
    fails: int = -1
    fault: Callable[[str], BaseException] = FAULTS[0]
    seen: int = 0
    failed: str = ""  # the one that failed

    def note(self, path: object) -> None:
        """Count a write; raise what this one fails with."""
        if not self.folder or not isinstance(path, str | bytes | os.PathLike):
            return
        name = os.fsdecode(path)
        if not name.startswith(self.folder):
            return
        self.seen += 1
        if self.seen - 1 == self.fails:
            self.failed = name
            raise self.fault(name)


_WATCH = _Watch()


def _hook(event: str, arguments: tuple[Any, ...], *, watch: _Watch = _WATCH) -> None:
    opened = event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if opened or event == "os.mkdir":
        watch.note(arguments[0])
    elif event == "os.rename":
        watch.note(arguments[1])


sys.addaudithook(_hook)


@contextmanager
def failing(folder: Path, number: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[_Watch]:
    """Let one of the writes below a folder fail; each kind of fault takes its turn."""
    _WATCH.seen, _WATCH.fails, _WATCH.fault = 0, number, FAULTS[number % len(FAULTS)]
    flush = os.fsync

    def fsync(handle: int) -> None:
        _WATCH.note(f"{folder}/flushed")
        flush(handle)

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", fsync)
        _WATCH.folder = str(folder)
        try:
            yield _WATCH
        finally:
            _WATCH.folder = ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of inputs: runs, card, tables, plans."""
    place = tmp_path_factory.mktemp("failures")
    write_a_card(place / "card.json")
    (place / "fluid.csv").write_text(VISCOSITY, encoding="utf-8")
    (place / "plan.toml").write_text(PLAN, encoding="utf-8")
    (place / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    JOBS["rig"].perform({"campaign": place / "campaign.toml"}, out=place / "runs")
    return place


def saver(name: str, folder: Path) -> Callable[[Path], object]:
    """Return what writes a job's files: its result's, or where it writes as it goes, the job itself."""
    card, runs = folder / "card.json", folder / "runs"
    heated = {"card": card, "drawing": "paper", "duty": DUTY}
    work, _, kind = name.partition(" ")
    what: Any = (kind,)
    if work == "export":
        file = {"fmu": "it.fmu", "table": "map.csv", "report": "proof.html"}.get(kind, kind)
        made = JOBS[work]({"card": card}, ExportOptions(what=what, verify=kind != "c"))
        return lambda out: JOBS[work].save(made, outputs={kind: out / file})
    asked: dict[str, tuple[dict[str, Any], Any]] = {
        "check": ({"files": [runs]}, None),
        "fit": ({"runs": [runs], "law": "dahl"}, FitOptions(temperature="none")),
        "evaluate": ({"card": card, "runs": [runs]}, None),
        "simulate": ({"card": card, "motion": DUTY.replace("60s", "2s")}, None),
        "compare": ({"first": card, "second": card}, None),
        "cycles": ({"record": next(runs.glob("*.csv"))}, None),
        "heat": (heated, None),
        "derate": (heated, DerateOptions(ambient_degC=(20.0,), air_m_s=(0.0,), duration_min=())),
        "fluid": ({"tables": [folder / "fluid.csv"]}, None),
        "track": ({"card": card, "targets": ["sine-900N-1Hz"]},
                  TrackOptions(controllers=("paper",), temperatures_degC=(20.0,), jobs=1)),
        "heatsink": (heated, HeatsinkOptions(span_mm=30.0, least_thickness_mm=2.0, by_field=False,
                                              members=2)),
        "rig": ({"campaign": folder / "campaign.toml"}, None),
        "sweep": ({"plan": folder / "plan.toml"}, SweepOptions(workers=1)),
    }  # fmt: skip
    given, options = asked[name]
    job = JOBS[name]
    if job.stream or name in HOURS:
        return lambda out: job.perform(given, options, out=out, resume=True if job.checkpoint else None)
    return partial(job.save, job(given, job.options_type() if options is None else options))


@pytest.mark.parametrize("old", [False, True], ids=["new folder", "folder with older files"])
@pytest.mark.parametrize("name", NAMES)
def test_each_write_fails_once_and_nothing_half_written_is_left(
    name: str, old: bool, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    save = saver(name, folder)
    place = tmp_path / "place"
    place.mkdir()
    save(place / "out")
    reference = written(place / "out")
    assert reference
    failed = 0
    for number in count():
        assert number < MOST
        shutil.rmtree(place)
        out = place / "out"
        for file in sorted(reference)[:2] if old else ():
            (out / file).parent.mkdir(parents=True, exist_ok=True)
            (out / file).write_text('"older"' if file.endswith("json") else "older</html>", encoding="utf-8")
        place.mkdir(exist_ok=True)
        before, said = written(out), ""
        with failing(place, number, monkeypatch) as watch:
            try:
                save(out)
            except (InputError, MemoryError) as fault:
                said = f"{fault!r}"
                failed += 1
        if watch.seen <= number:
            assert written(out) == reference
            break
        if left_behind(place) or name == "sweep":  # the next job moves what is whole, goes on from progress
            ends = "next job there moves them" in said or "MemoryError" in said
            assert ends or name in HOURS, said
            save(out)
            assert (written(out), left_behind(place)) == (reference, [])
        elif "MemoryError" in said:  # the set was whole, and was moved
            assert written(out) in (before, reference)
        else:
            assert written(out) == (before if said else reference), said
    assert failed >= 4
