"""Invalid inputs end with a message and exit code 3, without a traceback, a hang or partial files.

The tests run the command line in the process of pytest. ``check`` prints the same message as ``fit`` if a
file cannot be read. If a run can be read but not fitted, ``check`` reports a fault.
"""

from __future__ import annotations

import json
import re
import signal
import sys
import time
from pathlib import Path

import pytest

from mrdamper.cli import main
from tests.acceptance.bad_inputs import CASES, Case, cases, write_good_run
from tests.support.cards import write_card_of

pytestmark = pytest.mark.system

CPU_MAX_s = 2.0
HANG_s = 60


@pytest.fixture(scope="module", autouse=True)
def _loaded():
    """Import the libraries of the file formats once, because the limit of the CPU time excludes imports."""
    for module in (
        "asammdf",
        "h5py",
        "mrdamper.jobs.fit",
        "nptdms",
        "openpyxl",
        "polars",
        "python_calamine",
        "scipy.io",
    ):
        pytest.importorskip(module)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_good_run(tmp_path / "good.csv")
    write_card_of(tmp_path / "card.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def _awake():
    """Raise TimeoutError in a test that waits too long, for example for a pipe."""

    def ring(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(HANG_s)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def run(monkeypatch, capfd, *arguments):
    """Return exit code, standard output, standard error and CPU seconds of the command line."""
    monkeypatch.setattr(sys, "argv", ["mrdamper", *map(str, arguments)])
    began = time.process_time()
    with pytest.raises(SystemExit) as left:
        main()
    spent = time.process_time() - began
    out, err = capfd.readouterr()
    return left.value.code, out, err, spent


def names_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_invalid_input_gives_message_without_files(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    before = names_in(folder)
    code, out, err, spent = run(monkeypatch, capfd, *arguments, "--json")
    assert code == 3, err
    assert out == "" or list(json.loads(out)) == ["questions"]
    assert err.startswith("mrdamper: ")
    assert re.search(case.message, err), err
    assert "Traceback" not in err
    assert "panicked" not in err
    assert "Internal error" not in err
    assert not re.search(r"(^|[:\n] )([^:\n]+): \2: ", err)  # The message names a location only once.
    assert len(err) < 4000
    assert names_in(folder) == before
    assert spent < CPU_MAX_s


UNREADABLE = {
    "empty",
    "pipe",
    "a run, then zeros",
    "web page",
    "no unit",
    "HDF5, cut",
    "Excel, bomb",
    "map is a pipe",
}
FAULTY = {"NaN", "gap", "dead load cell", "force turned", "wrong unit, metres"}


def _checked(arguments: list[object]) -> list[object]:
    return ["check", *(a for a in arguments[1:] if a != "--one-command")]


@pytest.mark.parametrize("case", cases(UNREADABLE), ids=lambda case: case.name)
def test_check_reports_unreadable_file(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    before = names_in(folder)
    code, out, err, _ = run(monkeypatch, capfd, *_checked(arguments), "--json")
    assert code == 3, err
    if out:  # Standard output is empty unless ``check`` prints questions to the user as JSON.
        asked = json.loads(out)
        assert asked["questions"]
        assert (asked["runs"], asked["usable"]) == ([], False)
    else:
        assert names_in(folder) == before
    assert re.search(case.message, err)


@pytest.mark.parametrize("case", cases(FAULTY), ids=lambda case: case.name)
def test_check_reports_unfittable_run(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    code, out, err, _ = run(monkeypatch, capfd, *_checked(arguments))
    assert code == 5, err
    assert "fault" in out
    assert "cannot be fitted" in out
    assert "bad: bad: " not in out
    assert err == ""


def test_valid_run_has_no_fault(folder, monkeypatch, capfd):
    """The valid run has no fault, so the faults of the invalid cases are due to their changes."""
    code, out, _, _ = run(monkeypatch, capfd, "check", "good.csv")
    assert code == 0
    assert "can be fitted" in out
