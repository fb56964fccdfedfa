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

import mrdamper
from mrdamper.errors import InputError
from mrdamper.jobs.options import ExportOptions
from mrdamper.registry import JOBS
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.measurement import measure
from mrdamper.rig.plant import PRESETS
from tests.support.kills import left_behind, written
from tests.support.tracked import write_a_card

pytestmark = pytest.mark.system

SMALL = Campaign(
    motions=("sine5mm1Hz",), currents_A=(0.0, 1.0, 2.0), temperatures_degC=(20.0,), steps=None, duration_s=2.0
)
FAULTS: tuple[Callable[[str], BaseException], ...] = (
    lambda path: OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path),
    lambda path: PermissionError(errno.EACCES, os.strerror(errno.EACCES), path),
    lambda _: MemoryError(),
)
MOST = 200  # writes of a job
LONG = [
    pytest.param(name, marks=pytest.mark.nightly)
    for name in ("check", "compare", "heat", "identify", "export")
]


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
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Callable[[Path], object]]:
    """Return what writes the files of jobs that have run, by the job's name."""
    folder = tmp_path_factory.mktemp("failures")
    card = folder / "card.json"
    write_a_card(card)
    runs = [run for run, _ in measure(PRESETS["nominal"], SMALL)]
    made = {
        "check": mrdamper.check(runs),
        "predict": mrdamper.predict(card, runs),
        "compare": mrdamper.compare(card, card),
        "heat": mrdamper.heat(card, "paper", duty="sine:15mm:1Hz:2A:60s"),
        "identify": mrdamper.fit(runs, "dahl", temperature="none"),
    }
    saves: dict[str, Callable[[Path], object]] = {
        name: partial(JOBS[name].save, result) for name, result in made.items()
    }

    def export(out: Path) -> object:
        return JOBS["export"].perform({"card": card}, ExportOptions(verify=False), outputs={"c": out})

    return {**saves, "export": export}


@pytest.mark.parametrize("old", [False, True], ids=["new folder", "folder with older files"])
@pytest.mark.parametrize("name", ["predict", *LONG])
def test_each_write_fails_once_and_nothing_half_written_is_left(
    name: str, old: bool, results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    save = results[name]
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
        if left_behind(place):  # a set that is whole, and is moved by the next job
            assert "next job there moves them" in said or "MemoryError" in said, said
            save(out)
            assert (written(out), left_behind(place)) == (reference, [])
        elif "MemoryError" in said:  # the set was whole, and was moved
            assert written(out) in (before, reference)
        else:
            assert written(out) == (before if said else reference), said
    assert failed >= 4
