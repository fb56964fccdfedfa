"""A full disk, a folder that cannot be written to, a file that may not grow: one message, nothing changed."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from mrdamper.errors import InputError
from mrdamper.runtime.outputs import atomic_output
from tests.support.kills import Nursery, left_behind, written
from tests.support.rigs import command
from tests.support.tracked import write_a_card

pytestmark = pytest.mark.system

COMMANDS: dict[str, tuple[str, ...]] = {
    "rig": ("rig", "--campaign", "campaign.toml"),
    "check": ("check", "runs"),
    "fit": ("fit", "runs", "--law", "dahl", "--temperature", "none", "--leave-out", "current"),
    "evaluate": ("evaluate", "card.json", "runs"),
    "compare": ("compare", "card.json", "card.json"),
    "fluid": ("fluid", "fluid.csv"),
    "heat": ("heat", "card.json", "--damper", "paper", "--duty", "sine:15mm:1Hz:2A:300s"),
    "heatsink": ("heatsink", "card.json", "--damper", "paper", "--network-only", "--front", "2",
             "--duty", "sine:15mm:1Hz:2A:300s"),
    "track": ("track", "card.json", "--target", "sine-900N-1Hz", "--temperature", "20",
              "--controller", "paper"),
    "export c": ("export", "card.json", "--no-verify"),
    "export table": ("export", "card.json"),
    "sweep": ("sweep", "sinks.toml", "--workers", "1"),
}  # fmt: skip
FLUID = "temperature_degC,viscosity_mPas\n" + "".join(
    f"{t},{112.0 * 0.985 ** (t - 20):.4f}\n" for t in range(20, 101, 10)
)


@pytest.fixture(scope="module", autouse=True)
def _fluid(nursery: Nursery) -> None:
    (nursery.folder / "fluid.csv").write_text(FLUID, encoding="utf-8")


def asked(name: str, out: Path) -> tuple[str, ...]:
    """Return a command that writes to a folder."""
    option = {"export c": "--c", "export table": "--table"}.get(name, "--out")
    return (*COMMANDS[name], option, str(out / "map.csv" if name == "export table" else out))


def run(nursery: Nursery, name: str, out: Path, *, limit: int | None = None, more: str = "--json") -> int:
    if name == "sweep":  # starts processes of its own, which import what the nursery is
        done = subprocess.run(
            ["prlimit", f"--fsize={limit or 'unlimited'}", *command(*asked(name, out), more)],
            cwd=nursery.folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        (nursery.folder / "said.txt").write_text(done.stderr, encoding="utf-8")
        return done.returncode
    return nursery.run(*asked(name, out), more, limit=limit)


def check_one_message(nursery: Nursery, place: Path) -> None:
    said = nursery.said
    assert "Traceback" not in said, said
    lines = [line for line in said.splitlines() if line.startswith("mrdamper: ")]
    assert len(lines) == 1, said
    assert str(place) in lines[0]


@contextmanager
def disk(place: Path, *options: str) -> Iterator[Path]:
    """Mount a small disk of its own."""
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


def marked(names: Iterable[str], *slow: str) -> list[Any]:
    """Return names as parameters, slow ones for the long suite."""
    return [pytest.param(name, marks=[pytest.mark.nightly] if name in slow else []) for name in names]


@pytest.mark.parametrize("name", marked(COMMANDS, "heat", "sweep"))
def test_a_file_that_may_not_grow(nursery: Nursery, tmp_path: Path, name: str):
    """``ulimit -f``: what stood there stands there still, and nothing else does."""
    out = tmp_path / "out"
    out.mkdir()
    for old in ("card.json", "map.csv", "errors.csv", "mine.txt"):
        (out / old).write_text('"old"', encoding="utf-8")
    before = written(out)
    assert run(nursery, name, out, limit=600) == 3
    check_one_message(nursery, out)
    if name == "sweep":  # its folder is its checkpoint's: one that has just begun
        shutil.rmtree(out / "cards", ignore_errors=True)
        (out / "sweep.jsonl").unlink(missing_ok=True)
    assert written(out) == before
    assert [left for left in left_behind(tmp_path) if not left.endswith(".progress")] == []


@pytest.mark.parametrize(
    "name", marked(["rig", "fit", "heatsink", "export c", "sweep"], "fit", "heatsink", "sweep")
)
def test_a_full_disk(nursery: Nursery, tmp_path: Path, name: str):
    """The message names the place and what is free; with more room the same command goes to its end."""
    with disk(tmp_path / "disk", "-o", "size=48k") as small:
        (small / "ballast").write_bytes(bytes(36_000))
        assert run(nursery, name, small / "out") == 3
        check_one_message(nursery, small)
        assert "full" in nursery.said or "No space" in nursery.said
        assert "ake room" in nursery.said
        if name != "sweep":
            assert not (small / "out").exists()
        assert [left for left in left_behind(small) if not left.endswith(".progress")] == []
        subprocess.run(["mount", "-o", "remount,size=50m", str(small)], check=True)
        resumed = "--resume" if name in {"heatsink", "sweep"} else "--json"
        assert run(nursery, name, small / "out", more=resumed) == 0, nursery.said
        assert left_behind(small) == []


def test_a_card_on_a_full_disk_is_told_of_by_the_job_s_place(tmp_path: Path):
    """What writes a card has words of its own; the hidden folder that they name is nothing to a user."""
    with disk(tmp_path / "disk", "-o", "size=16k") as small:
        (small / "ballast").write_bytes(bytes(12_000))
        said = r"the disk is full .* nothing was changed"
        with pytest.raises(InputError, match=said) as refused, atomic_output(small / "out") as beside:
            write_a_card(beside / "card.json")
        assert str(refused.value).startswith(f"{small / 'out'}: ")
        assert ".mrdamper-" not in str(refused.value)
        assert left_behind(small) == []


@pytest.mark.parametrize("name", marked(COMMANDS, "sweep"))
def test_a_folder_that_cannot_be_written_to(nursery: Nursery, tmp_path: Path, name: str):
    if os.geteuid() == 0:  # whom permissions do not stop
        with disk(tmp_path / "disk", "-o", "ro") as closed:
            assert run(nursery, name, closed / "out") == 3
            check_one_message(nursery, closed)
        return
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    try:
        assert run(nursery, name, closed / "out") == 3
        check_one_message(nursery, closed)
    finally:
        closed.chmod(0o755)


@pytest.mark.parametrize("arguments", [("data", "list"), ("--help",)])
def test_standard_output_on_a_full_disk(arguments: tuple[str, ...]):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            command(*arguments), stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 3
    assert "standard output" in done.stderr
    assert "the disk is full" in done.stderr
    assert len(done.stderr.splitlines()) == 1
