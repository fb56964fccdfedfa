"""A clock that steps back: nothing is timed by it, ordered by it or believed because of it."""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import mrdamper
from mrdamper.web.job_record import JobRecord, job_ids, new_id
from tests.support.rigs import short_runs, write_runs

SOURCE = Path(mrdamper.__file__).parent
CLOCKS = {"time.time", "time.time_ns", "datetime.now", "datetime.utcnow", "date.today"}
STAMPS = ("2031-01-01T00:00:00Z", "2026-06-01T00:00:00Z", "1970-01-01T00:00:00Z", "2026-05-31T23:59:59Z")


def wall_clocks(tree: ast.AST) -> Iterator[str]:
    """Yield what is asked of the clock on the wall."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            name = f"{node.value.id}.{node.attr}"
            if name in CLOCKS:
                yield name


def test_the_clock_on_the_wall_is_read_for_stamps_alone():
    """Durations are of the process or of a clock that never steps; one function reads the other one."""
    texts = {path: path.read_text(encoding="utf-8") for path in SOURCE.rglob("*.py")}
    found = {
        path.relative_to(SOURCE).as_posix(): list(wall_clocks(ast.parse(text)))
        for path, text in texts.items()
        if any(clock in text for clock in CLOCKS)
    }
    assert {name for name, clocks in found.items() if clocks} <= {"web/workspace.py"}


def test_jobs_stay_in_the_order_in_which_they_were_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    stamps = iter([stamp for stamp in STAMPS for _ in range(3)])
    monkeypatch.setattr("mrdamper.web.job_record.now", lambda: next(stamps))
    for _ in STAMPS:
        record = JobRecord(tmp_path, new_id(tmp_path, "check"))
        record.open("check", {}, None)
        record.begin()
        record.end("done")
    assert job_ids(tmp_path) == [f"check-{k:03d}" for k in (4, 3, 2, 1)]
    assert JobRecord(tmp_path, "check-003").shown()["ended_at"] == STAMPS[2]


@pytest.mark.parametrize("date", [0, -86_400, 4_102_444_800])
def test_runs_are_what_they_hold_and_not_when_they_were_written(tmp_path: Path, date: int):
    files = write_runs(tmp_path / "runs", short_runs()[:2])
    before = mrdamper.read_runs([tmp_path / "runs"])
    for file in files:
        os.utime(file, (date, date))
    after = mrdamper.read_runs([tmp_path / "runs"])
    assert after.fingerprint == before.fingerprint
    assert after.names == before.names
