"""A full disk, a read-only folder or a file size limit gives one message, and no file changes."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.kills import Nursery, left_behind, written
from tests.support.rigs import command
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

COMMANDS: dict[str, tuple[str, ...]] = {
    "rig": ("rig", "--campaign", "campaign.toml"),
    "fit": ("fit", "runs", "--law", "dahl", "--temperature", "none"),
    "evaluate": ("evaluate", "card.json", "runs"),
    "export c": ("export", "card.json"),
    "export table": ("export", "card.json"),
}


def run(nursery: Nursery, name: str, out: Path, *, limit: int | None = None) -> int:
    option = {"export c": "--c", "export table": "--table"}.get(name, "--out")
    place = out / "map.csv" if name == "export table" else out
    return nursery.run(*COMMANDS[name], option, place, limit=limit)


def check_one_message(nursery: Nursery, place: Path) -> None:
    said = nursery.said
    assert "Traceback" not in said, said
    lines = [line for line in said.splitlines() if line.startswith("mrdamper: ")]
    assert len(lines) == 1, said
    assert str(place) in lines[0]


@contextmanager
def disk(place: Path, *options: str) -> Iterator[Path]:
    """Mount a small temporary disk at a path for a ``with`` block."""
    place.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", *options, "tmpfs", str(place)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip("needs the right to mount a small disk")
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("name", one_by_day(COMMANDS))
def test_file_size_limit_changes_no_file(nursery: Nursery, tmp_path: Path, name: str):
    """Older files stay unchanged if the size limit of files (``ulimit -f``) is exceeded."""
    out = tmp_path / "out"
    out.mkdir()
    for old in ("card.json", "map.csv", "errors.csv", "mine.txt"):
        (out / old).write_text('"old"', encoding="utf-8")
    before = written(out)
    assert run(nursery, name, out, limit=600) == 3
    check_one_message(nursery, out)
    assert written(out) == before
    assert not left_behind(tmp_path)


@pytest.mark.parametrize("name", one_by_day(["rig", "fit", "export c"]))
def test_full_disk_gives_one_message(nursery: Nursery, tmp_path: Path, name: str):
    """The message names the folder. The same command succeeds after space has been freed."""
    with disk(tmp_path / "disk", "-o", "size=48k") as small:
        (small / "ballast").write_bytes(bytes(36_000))
        assert run(nursery, name, small / "out") == 3
        check_one_message(nursery, small)
        assert not (small / "out").exists()
        assert not left_behind(small)
        subprocess.run(["mount", "-o", "remount,size=50m", str(small)], check=True)
        assert run(nursery, name, small / "out") == 0, nursery.said
        assert not left_behind(small)


def test_read_only_folder_gives_one_message(nursery: Nursery, tmp_path: Path):
    """The superuser ignores permissions, so the test then uses a read-only disk."""
    if os.geteuid() == 0:
        with disk(tmp_path / "disk", "-o", "ro") as closed:
            assert run(nursery, "evaluate", closed / "out") == 3
            check_one_message(nursery, closed)
        return
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    try:
        assert run(nursery, "evaluate", closed / "out") == 3
        check_one_message(nursery, closed)
    finally:
        closed.chmod(0o755)


def test_full_standard_output_gives_one_message():
    """An error is reported if the output cannot be written to standard output."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            command("data", "list"), stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 3
    assert "the disk is full" in done.stderr
    assert len(done.stderr.splitlines()) == 1
