"""Bad inputs end in their own message and exit code 3: no traceback, no hang, nothing half-written.

Through the real command line, in this process. ``check`` says the same of what cannot be read, and calls what
can be read but not fitted a fault.
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
from tests.acceptance.bad_inputs import CASES, GOOD, Case, cases, write_good_run
from tests.support.tracked import a_damper, write_a_card

pytestmark = pytest.mark.system

_MOST_CPU_s = 2.0
_HANGS_s = 60


@pytest.fixture(scope="module", autouse=True)
def _loaded():
    """Load the libraries of the formats once: their import is not the input's fault."""
    for module in ("asammdf", "h5py", "nptdms", "openpyxl", "polars", "pint", "python_calamine", "scipy.io"):
        pytest.importorskip(module)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_good_run(tmp_path / "good.csv")
    write_a_card(tmp_path / "card.json", a_damper(temperature_dependent=False))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def _awake():
    """End a test that waits for ever (on a pipe, say)."""

    def ring(*_):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(_HANGS_s)
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


def test_the_corpus_is_large_and_every_case_has_its_name():
    assert len(CASES) >= 60
    assert len({case.name for case in CASES}) == len(CASES)


def test_the_page_on_trust_says_how_many_there_are():
    page = (Path(__file__).parents[2] / "docs/trust.md").read_text(encoding="utf-8")
    assert f"| tried | {len(CASES)} |" in page


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_bad_input_ends_in_its_own_message(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    before = names_in(folder)
    code, out, err, spent = run(monkeypatch, capfd, *arguments, "--json")
    assert code == 3, err
    assert out == "" or list(json.loads(out)) == ["questions"]  # what the file leaves open, as check has it
    assert err.startswith("mrdamper: ")
    assert re.search(case.message, err), err
    assert "Traceback" not in err
    assert "panicked" not in err
    assert "internal fault" not in err
    assert len(err) < 4000
    assert names_in(folder) == before
    assert spent < _MOST_CPU_s


UNREADABLE = {
    "empty", "pipe", "gigabytes of zeros", "a run, then zeros", "UTF-16", "CR line ends", "web page",
    "no unit",
    "unit of something else", "no force", "Parquet, cut", "MAT, cut", "HDF5, cut", "MDF, cut", "logger, cut",
    "Excel, bomb", "MTS, no rows", "map is a pipe", "map with an unknown key",
}  # fmt: skip
FAULTY = {
    "NaN", "infinity", "outlier", "jump", "time twice", "time goes back", "gap", "mixed rates", "few samples",
    "at rest", "dead load cell", "force turned", "wrong unit, metres", "wrong unit, newtons", "cut in a row",
}  # fmt: skip


def _checked(arguments: list[object]) -> list[object]:
    return ["check", *(a for a in arguments[1:] if a != "--one-command")]


@pytest.mark.parametrize("case", cases(UNREADABLE), ids=lambda case: case.name)
def test_check_says_the_same_of_what_cannot_be_read(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    before = names_in(folder)
    code, out, err, _ = run(monkeypatch, capfd, *_checked(arguments), "--json")
    assert code == 3, err
    if out:  # what can be answered is asked
        asked = json.loads(out)
        assert asked["questions"]
        assert (asked["runs"], asked["usable"]) == ([], False)
    else:
        assert names_in(folder) == before
    assert re.search(case.message, err)


@pytest.mark.parametrize("case", cases(FAULTY), ids=lambda case: case.name)
def test_check_calls_what_cannot_be_fitted_a_fault(case: Case, folder, monkeypatch, capfd):
    arguments = case.make(folder)
    code, out, err, _ = run(monkeypatch, capfd, *_checked(arguments))
    assert code == 5, err
    assert "fault" in out
    assert "not to be fitted as they are" in out
    assert err == ""


def test_the_good_run_is_good(folder, monkeypatch, capfd):
    """Else every case above would prove nothing."""
    code, out, _, _ = run(monkeypatch, capfd, "check", "good.csv")
    assert code == 0
    assert "can be fitted" in out
    assert GOOD.startswith("time_s,")
