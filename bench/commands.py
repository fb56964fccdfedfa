"""Whole commands, as users wait for them: a fresh process each, on every core and on one.

A row is a command, what it may take, and by which clock. Ratios are to the CPU time of a fixed piece of work
that takes turns with the command: compare those, seconds are of one machine. Real runs are those of
``MRDAMPER_DATA``; the others are measured on the virtual rig first. ``full`` repeats five times and adds what
takes minutes, once each; ``only`` chooses rows by words of their titles.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from bench.growth import write_record
from bench.measure import Asked, Row, absent
from bench.startup import Process

__all__ = ["run"]

REPEATS, FULL_REPEATS = 2, 5
FIXED_WORK = "x = 0\nfor k in range(10**7): x += k * k"
REAL = "utfsm_sine_*.csv"


@dataclass(frozen=True, slots=True)
class Command:
    """One command: its words, in which names in braces are places, and what was asked of it.

    Attributes
    ----------
    cpu_s, wall_s : most by the CPU, or by the clock on a quiet machine; 0: nothing was asked
    cores : how many times as fast two cores must be as one; 0: it has no ``--jobs``
    megabytes : of the largest memory; 0: nothing was asked
    long : only with ``full``
    """

    title: str
    words: str
    cpu_s: float = 0.0
    wall_s: float = 0.0
    cores: float = 0.0
    megabytes: float = 0.0
    long: bool = False


COMMANDS = (
    Command("check, 20 real runs", "check {real}"),
    Command(
        "identify --law series-valve, 20 real runs",
        "identify {real} --law series-valve --out {out}",
        cpu_s=2.0,
    ),
    Command("identify, 20 real runs", "identify {real} --out {out}", wall_s=7.0, cores=1.7),
    Command(
        "identify --law double-bouc-wen, virtual runs",
        "identify {rig} --law double-bouc-wen --out {card}",
        cpu_s=4.0,
    ),
    Command("identify, virtual runs", "identify {rig} --out {out}", wall_s=30.0, cores=1.7, long=True),
    Command("track, all defaults", "track {card}/card.json --out {out}", cpu_s=3.0, cores=1.4),
    Command("sink, full", "sink {card}/card.json --damper paper --out {out}", wall_s=4.5, cores=1.4),
    Command("heat", "heat {card}/card.json --damper paper --out {out}"),
    Command("cycles, a CSV file of 1e6 rows", "cycles {million} --out {out}"),
    Command("cycles, a CSV file of 1e7 rows", "cycles {ten_million} --out {out}", megabytes=1500.0),
    Command(
        "cycles, a CSV file of 1e8 rows", "cycles {hundred_million} --out {out}", megabytes=1500.0, long=True
    ),
)
ROWS = {"million": 10**6, "ten_million": 10**7, "hundred_million": 10**8}


def run(*, full: bool = False, only: str = "") -> list[Row]:
    """Return what each command takes; a place that cannot be made is a gap in all rows that need it."""
    with tempfile.TemporaryDirectory(prefix="mrdamper-commands-") as name:
        places = _Places(Path(name))
        return [
            _row(each, places, 1 if each.long else FULL_REPEATS if full else REPEATS)
            if full or not each.long
            else absent(each.title, "not run: only with --full")
            for each in COMMANDS
            if only in each.title
        ]


class _Places:
    """Files that commands read, each made when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known = {"out": [str(folder / "out")], "card": [str(folder / "card")]}

    def words(self, command: Command, *more: str) -> list[str]:
        found: list[str] = []
        for word in command.words.split():
            name = word.partition("}")[0].removeprefix("{")
            found += [word.replace(f"{{{name}}}", path) for path in self._of(name)] if "{" in word else [word]
        return [*found, *more]

    def _of(self, name: str) -> list[str]:
        if name not in self._known:
            self._known[name] = self._made(name)
        return self._known[name]

    def _made(self, name: str) -> list[str]:
        if name == "real":
            given = os.environ.get("MRDAMPER_DATA", "")
            return [str(each) for each in sorted(Path(given).rglob(REAL))] if given else []
        if name in ROWS:
            file = self._folder / f"{name}.csv"
            write_record(ROWS[name], file)
            return [str(file)]
        runs = self._folder / "runs"
        if not runs.is_dir():
            Process.of(["rig", "--out", str(runs)]).start()
        return [str(runs)] if name == "rig" else [str(each) for each in sorted(runs.glob("*.csv"))[:12]]


def _row(command: Command, places: _Places, repeats: int) -> Row:
    """Time a command on every core, and on one in turns where it has ``--jobs``."""
    if "{real}" in command.words and not any(".csv" in word for word in places.words(command)):
        return absent(command.title, "MRDAMPER_DATA does not name the folder of real runs")
    every, fixed = Process.of(places.words(command)), Process([sys.executable, "-c", FIXED_WORK])
    one = Process.of(places.words(command, "--jobs", "1")) if command.cores else None
    if not command.long:
        replace(every, cpu=[], wall=[]).start()  # it may compile Python's files
    for _ in range(repeats):
        for process in (fixed, every, *([one] if one else ())):
            process.start()
            if process.fault:
                return absent(command.title, process.fault)
    timing, said = every.timing, f"largest memory {every.most_megabytes:,.0f} MB"
    limits = (
        ("CPU", command.cpu_s, timing.cpu_s, "s"),
        ("by the clock", command.wall_s, timing.wall_s, "s"),
        ("largest memory", command.megabytes, every.most_megabytes, "MB"),
    )
    asked = [
        Asked(f"{command.title}, {what}", most, found, unit) for what, most, found, unit in limits if most
    ]
    if one is not None:
        gains = [alone / both for alone, both in zip(one.wall, every.wall, strict=True)]
        figure = f"{command.title}, every core against one, by the clock"
        asked.append(Asked(figure, command.cores, median(gains), "x", at_least=True))
        said += f"; every core {min(gains):.2f} to {max(gains):.2f} x as fast as one"
    return Row(command.title, timing, ratios=timing.over(fixed.timing), accuracy=said, asked=tuple(asked))
