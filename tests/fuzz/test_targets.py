"""Fuzzing in short: what once broke a promise, and some hundred new inputs for every target.

The long form, 1e6 executions of each, is marked ``long``; docs/trust.md has what came of it.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz import native
from fuzz.contract import BrokenPromiseError, promised
from fuzz.targets import CORPUS, TARGETS, kept_inputs
from mrdamper.errors import InputError

ROOT = Path(__file__).parents[2]
SHORT = 150  # executions of a target in Python
SHORT_C = 1000
LONG = 1_000_000


@pytest.fixture
def atheris(tool):
    """Skip (fail where tools are required) without atheris."""
    del tool  # asked for its mark: a skip for want of a tool is told apart by it
    if importlib.util.find_spec("atheris") is None:
        pytest.skip("atheris is not installed")


@pytest.fixture
def fuzzing_clang(tool, tmp_path):
    """Skip (fail where tools are required) without clang and the run time of its fuzzer and sanitizers."""
    compiler, probe = tool(native.COMPILER), tmp_path / "probe.c"
    probe.write_text("int LLVMFuzzerTestOneInput(const char *d, unsigned long n) { return d && n > 9; }\n")
    command = [compiler, "-fsanitize=fuzzer,address,undefined", probe, "-o", tmp_path / "probe"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"clang has no fuzzer's run time (libclang-rt-dev): {done.stderr.splitlines()[-1:]}")


def fuzz(names: list[str], runs: int, folder: Path) -> list[tuple[int, str]]:
    """Run targets in a folder of their own; return the executions of each, and what the engine said last."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "fuzz", *names, f"-runs={runs}", "-seed=1"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    kept = [folder / "build/fuzz" / f"{name}.log" for name in names]
    logs = [log.read_text(encoding="utf-8", errors="replace") if log.exists() else "" for log in kept]
    assert done.returncode == 0, done.stdout + done.stderr + "\n".join(log[-2000:] for log in logs)
    counts = [int(found) for found in re.findall(r"(\d+) executions", done.stdout)]
    return list(zip(counts, logs, strict=True))


# -------------------------------------------------------------------------------- without any engine


@pytest.mark.parametrize("name", TARGETS)
def test_sound_inputs_and_those_that_once_broke_a_promise_keep_it(name):
    for content in [*TARGETS[name].seeds(), *(path.read_bytes() for path in kept_inputs(name))]:
        TARGETS[name].take(content)


def test_the_page_on_trust_has_a_row_for_every_target():
    page = (ROOT / "docs/trust.md").read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(" `") for line in page.splitlines() if line.startswith("| `")}
    assert {*TARGETS, *native.TARGETS} <= rows


def test_every_kept_input_belongs_to_a_target_and_is_small():
    for path in CORPUS.rglob("*"):
        if path.is_file():
            assert path.parent.name in TARGETS or path.parent.name in native.TARGETS
            assert path.stat().st_size < 20_000


def test_the_contract_lets_our_errors_pass_and_nothing_else():
    def meet(error, place="a.csv"):
        with promised(place):
            raise error

    meet(InputError("a.csv: is empty; expected columns"))
    with pytest.raises(BrokenPromiseError, match="does not name"):
        meet(InputError("is empty"))
    with pytest.raises(BrokenPromiseError, match="0 characters"):
        meet(InputError(""), place="")
    with pytest.raises(KeyError):
        meet(KeyError("force"))


# ----------------------------------------------------------------------------------- with an engine


def test_a_short_search_breaks_no_promise(atheris, tmp_path):
    """All targets in one call, which imports once what they share."""
    for name, (count, log) in zip(TARGETS, fuzz([*TARGETS], SHORT, tmp_path), strict=True):
        assert count >= SHORT, name
        assert TARGETS[name].library or "Is the code instrumented for coverage" not in log, name


def test_a_short_search_in_c_is_silent_under_the_sanitizers(fuzzing_clang, tmp_path):
    for count, _ in fuzz(["laws", "tables", "exported-series", "exported-float"], SHORT_C, tmp_path):
        assert count >= SHORT_C


@pytest.mark.nightly
@pytest.mark.parametrize("name", TARGETS)
def test_a_million_inputs_break_no_promise(name, atheris, tmp_path):
    assert fuzz([name], LONG, tmp_path)[0][0] >= LONG


@pytest.mark.nightly
@pytest.mark.parametrize("name", native.TARGETS)
def test_a_million_inputs_in_c_are_silent_under_the_sanitizers(name, fuzzing_clang, tmp_path):
    assert fuzz([name], LONG, tmp_path)[0][0] >= LONG
