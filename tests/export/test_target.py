"""Controllers on Cortex-M4F and M7 in QEMU: results, instruction counts, memory and static analysis.

The readings of ``hard_readings`` contain reversals, infeasible targets, temperature ramps and sensor faults.
"""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from importlib.resources import files

import pytest

from tests.export.board import (
    BOARDS,
    KERNEL,
    Replay,
    hash_of,
    on_board,
    on_host,
    sizes,
)
from tests.export.hard_readings import SHOWN, Shown, readings
from tests.support.tiers import one_by_day

pytestmark = pytest.mark.system

BARRED = [shown for shown in SHOWN if shown.most is not None]


def _name(shown: Shown) -> str:
    return f"{shown.controller}, {shown.damper}, {shown.optimised}"


@pytest.fixture
def boards(tool):
    for name in ("arm-none-eabi-gcc", "qemu-system-arm", "gcc"):
        tool(name)
    return BOARDS


def replayed(shown: Shown, board: str, samples: int) -> tuple[Replay, int]:
    """Run a controller on a board. Return its result, and the hash of the same outputs in Python."""
    controller = shown.made()
    told = readings(controller, samples)
    single = replace(controller, single=True)
    here = hash_of(*single.run(single.start(), told)[1:])
    return on_board(controller, told, BOARDS[board], flags=(shown.optimised,)), here


def meets_its_bars(shown: Shown, there: Replay) -> None:
    print(
        f"{shown.controller}, {shown.damper}, {shown.optimised}: mean {there.mean:.0f}, most {there.most:.0f}"
    )
    assert there.most <= (shown.most or 0)
    assert there.most <= 1.25 * there.mean
    assert there.outside == 0


@pytest.mark.parametrize("shown", one_by_day(BARRED[::-1]), ids=_name)
def test_instruction_count_of_controller_step_is_limited(boards, shown):
    """None of 5,000 steps needs more instructions than the stated limit or than 1.25 times the mean."""
    there, here = replayed(shown, "M4F", 5_000)
    meets_its_bars(shown, there)
    assert there.hash == here


@pytest.mark.release
@pytest.mark.parametrize("shown", BARRED, ids=_name)
@pytest.mark.parametrize("board", BOARDS)
def test_microcontroller_agrees_with_python_for_100000_steps(boards, shown, board):
    there, here = replayed(shown, board, 100_000)
    meets_its_bars(shown, there)
    assert there.hash == here


@pytest.mark.nightly
@pytest.mark.parametrize("shown", SHOWN, ids=_name)
def test_microcontroller_agrees_with_host(boards, shown):
    """x86-64, Cortex-M7 and the Python extension return identical outputs."""
    there, here = replayed(shown, "M7", 3000)
    told = readings(shown.made(), 3000)
    assert there.hash == here == on_host(shown.made(), told, flags=("-O1",)).hash
    assert there.outside == 0


@pytest.mark.parametrize("shown", one_by_day(SHOWN[::-1]), ids=_name)
def test_code_and_tables_fit_memory_limits(boards, shown):
    """Tables have at most 16 kB. Code and stack are within the limits of each controller."""
    held = sizes(shown.made(), boards["M4F"], flags=(shown.optimised,))
    print(
        f"{shown.controller}, {shown.damper}, {shown.optimised}: code {held.code}, tables {held.tables} bytes"
    )
    assert held.tables <= 16 * 1024
    assert held.code <= shown.most_code * 1024
    assert held.stack <= shown.most_stack


@pytest.mark.nightly
@pytest.mark.parametrize("single", [True, False])
def test_static_checker_finds_only_documented_deviations(tool, tmp_path, single):
    """The checker must also find every documented deviation, so that the list has no superfluous entry."""
    text = files("mrdamper.codegen").joinpath("misra.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^\| (\d+\.\d+) \|", text, re.MULTILINE))
    command = [
        tool("cppcheck"),
        "--addon=misra",
        "--std=c99",
        "--enable=style",
        "--template={id} {file}:{line}",
    ]
    done = subprocess.run(
        [*command, *(["-DMRD_SINGLE"] if single else []), KERNEL / "controller.c", KERNEL / "thermal.c"],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0
    found = {line for line in done.stderr.splitlines() if line and not line.startswith("nofile")}
    rules = {rule for line in found for rule in re.findall(r"^misra-c2012-(\d+\.\d+) ", line)}
    assert rules == listed, sorted(found)
    assert all(line.startswith("misra-c2012-") for line in found), sorted(found)
