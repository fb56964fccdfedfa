"""If a job fails to write a file (no space, permission or memory), no partial output remains.

An audit hook makes each write fail, one after the other. The hook covers every call that opens, creates or
moves a file in the watched folder, in every library.
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
from mrdamper.jobs.options import FitOptions
from mrdamper.registry import JOBS
from tests.support.cards import write_card_of
from tests.support.kills import left_behind, written

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
WRITES_MAX_COUNT = 200
NAMES = ["evaluate", *(pytest.param(each, marks=pytest.mark.nightly) for each in ("rig", "fit", "heat"))]


@dataclass(slots=True)
class _Watch:
    """Count the writes in a folder and make one of them fail."""

    folder: str = ""
    fails: int = -1
    fault: Callable[[str], BaseException] = FAULTS[0]
    seen: int = 0

    def note(self, path: object) -> None:
        """Count a write, and raise an error if it is the selected write."""
        if not self.folder or not isinstance(path, str | bytes | os.PathLike):
            return
        name = os.fsdecode(path)
        if not name.startswith(self.folder):
            return
        self.seen += 1
        if self.seen - 1 == self.fails:
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
def failing(folder: Path, number: int) -> Iterator[_Watch]:
    """Make write ``number`` in a folder fail. The kind of error depends on the number."""
    _WATCH.seen, _WATCH.fails, _WATCH.fault = 0, number, FAULTS[number % len(FAULTS)]
    _WATCH.folder = str(folder)
    try:
        yield _WATCH
    finally:
        _WATCH.folder = ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with runs and a card."""
    place = tmp_path_factory.mktemp("failures")
    write_card_of(place / "card.json")
    (place / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    JOBS["rig"].perform({"campaign": place / "campaign.toml"}, out=place / "runs")
    return place


def saver(name: str, folder: Path) -> Callable[[Path], object]:
    """Compute the result of a job and return a function that writes the files of this result."""
    card, runs = folder / "card.json", folder / "runs"
    asked: dict[str, tuple[dict[str, Any], Any]] = {
        "fit": ({"runs": [runs], "law": "dahl"}, FitOptions(temperature="none")),
        "evaluate": ({"card": card, "runs": [runs]}, None),
        "heat": ({"card": card, "drawing": "paper", "duty": "sine:15mm:1Hz:2A:60s"}, None),
        "rig": ({"campaign": folder / "campaign.toml"}, None),
    }
    given, options = asked[name]
    job = JOBS[name]
    return partial(job.save, job.perform(given, options)[0])


@pytest.mark.parametrize("old", [False, True], ids=["new folder", "older files"])
@pytest.mark.parametrize("name", NAMES)
def test_failed_write_leaves_no_partial_output(name: str, old: bool, folder: Path, tmp_path: Path):
    """The folder contains only old or only new files, at the latest after the next job."""
    save = saver(name, folder)
    place = tmp_path / "place"
    place.mkdir()
    save(place / "out")
    reference = written(place / "out")
    assert reference
    failed = 0
    for number in count():
        assert number < WRITES_MAX_COUNT
        shutil.rmtree(place)
        out = place / "out"
        for file in sorted(reference)[:2] if old else ():
            (out / file).parent.mkdir(parents=True, exist_ok=True)
            (out / file).write_text('"older"' if file.endswith("json") else "older</html>", encoding="utf-8")
        place.mkdir(exist_ok=True)
        before, said = written(out), ""
        with failing(place, number) as watch:
            try:
                save(out)
            except (InputError, MemoryError) as fault:
                said = f"{fault!r}"
                failed += 1
        if watch.seen <= number:
            assert written(out) == reference
            break
        if left_behind(place):  # The next job moves a complete set of files that has not been moved.
            save(out)
            assert (written(out), left_behind(place)) == (reference, [])
        elif "MemoryError" in said:  # The error may follow after all files have been moved.
            assert written(out) in (before, reference)
        else:
            assert written(out) == (before if said else reference), said
    assert failed >= 4
