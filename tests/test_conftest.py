"""A test that lacks a tool or the real runs skips visibly, and fails where tools are required."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

LACKING = """
import pytest

def test_of_a_program(tool):
    tool("no-such-program")

def test_of_real_runs(real_data):
    pass

@pytest.mark.tool
def test_that_skips_by_itself():
    pytest.skip("no such library")

def test_that_skips_for_another_reason():
    pytest.skip("not on this platform")
"""


def outcome(folder: Path, **environment: str) -> str:
    """Return the output of pytest on tests that lack what they need."""
    shutil.copy(Path(__file__).with_name("conftest.py"), folder)
    (folder / "test_lacking.py").write_text(LACKING, encoding="utf-8")
    marks = "".join(f"    {each}\n" for each in ("tool", "data", "system", "tier_fast", "tier_system"))
    (folder / "pytest.ini").write_text(f"[pytest]\nmarkers =\n{marks}", encoding="utf-8")
    kept = {name: value for name, value in os.environ.items() if not re.match(r"MRDAMPER_|PYTEST_", name)}
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-ra", "-p", "no:cacheprovider", "-p", "no:xdist"],
        cwd=folder,
        env=kept | environment,
        capture_output=True,
        text=True,
        check=False,
    ).stdout


@pytest.mark.system
def test_without_the_tools_the_tests_skip_and_say_why(tmp_path):
    printed = outcome(tmp_path)
    assert "4 skipped in" in printed
    assert "the program 'no-such-program' is not installed" in printed
    assert "MRDAMPER_DATA does not name the folder of real runs" in printed


@pytest.mark.nightly
@pytest.mark.parametrize("folder", ["", "nowhere"])
def test_where_tools_are_required_a_skip_for_want_of_one_is_a_failure(tmp_path, folder):
    printed = outcome(tmp_path, MRDAMPER_REQUIRE_TOOLS="1", MRDAMPER_DATA=folder)
    assert re.search(r"3 failed, 1 skipped in|2 failed, 1 skipped, 1 error in", printed)
