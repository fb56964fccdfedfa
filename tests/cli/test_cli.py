"""Use of the command line in scripts: JSON keys, exit codes and complete output files."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mrdamper.identify.search.variable_projection import SearchState
from mrdamper.jobs.options import FitOptions
from mrdamper.jobs.simulate import simulate
from mrdamper.models.card_schema import read_card
from mrdamper.registry import JOBS
from mrdamper.runtime.pool import usable_cores
from mrdamper.runtime.progress import ProgressUpdate
from tests.support.campaigns import columns_of, short_runs, write_csv, write_runs
from tests.support.rigs import PYTHON_LAW, answer_of, command, mrdamper

pytestmark = pytest.mark.system

ROW = {
    "name",
    "split",
    "rmse_N",
    "nrmse_percent",
    "nrmse_whole_percent",
    "nrmse_offset_free_percent",
    "command",
    "command_unit",
    "current_A",
    "temperature_degC",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("rig")
    write_runs(place / "runs", short_runs())
    (place / "law.py").write_text(PYTHON_LAW, encoding="utf-8")
    return place


def fit_into(out, folder):
    return ("fit", folder / "runs", "--out", out, "--law", "bouc-wen", "--hold-out", "*_0.75V_*")


@pytest.fixture(scope="module")
def identified(folder):
    """Run the command ``fit`` once; all tests of its result use this run."""
    return mrdamper(*fit_into(folder / "out", folder), "--json")


@pytest.fixture(scope="module")
def repeated(folder):
    """Run the command ``fit`` in a separate process; return the terminal output and the wall time [s]."""
    started = time.monotonic()
    arguments = command(*fit_into(folder / "again", folder))
    done = subprocess.run(arguments, capture_output=True, check=True, text=True)
    return done.stdout, time.monotonic() - started


def test_fit_json_has_documented_keys(identified, folder):
    answer = answer_of(identified)
    assert {"law", "method", "coefficients", "cpu_s", "card", "runs"} <= answer.keys()
    assert answer["law"] == "bouc-wen"
    assert answer["method"] == "varpro"
    assert Path(answer["card"]) == folder / "out" / "card.json"
    assert all(row.keys() >= ROW for row in answer["runs"])
    assert [row["split"] for row in answer["runs"]].count("held_out") == 2
    assert answer["runs"][0]["command_unit"] == "V"
    assert answer["runs"][0]["current_A"] is None
    assert 0.0 < answer["cpu_s"] < 20.0
    assert identified.stderr == ""


def test_last_output_line_states_wall_time(repeated):
    """The printed time excludes the start of the Python interpreter."""
    text, elapsed = repeated
    printed = float(re.findall(r"^Wrote .* \(([\d.]+) s\)\.$", text, re.MULTILINE)[0])
    assert 0.3 * elapsed <= printed <= elapsed + 0.1


def test_command_without_output_folder_prints_hint(folder, identified):
    run = mrdamper("evaluate", folder / "out" / "card.json", folder / "runs")
    assert "No files were written. Use --out DIR" in run.stdout


@pytest.mark.nightly
def test_linear_algebra_uses_one_thread():
    said = {"OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"}
    bare = {name: value for name, value in os.environ.items() if name not in said}
    code = """if True:
        from mrdamper.cli import main
        try:
            main()
        except SystemExit:
            import numpy
            from threadpoolctl import threadpool_info
            print(max(library["num_threads"] for library in threadpool_info()))
    """
    for more, threads in (({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, min(2, usable_cores()))):
        asked = [sys.executable, "-c", code, "data", "list"]
        told = subprocess.run(asked, env={**bare, **more}, capture_output=True, text=True, check=True).stdout
        assert int(told.split()[-1]) == threads


def test_commands_work_with_closed_streams_and_invalid_utf8(folder, tmp_path):
    place = tmp_path / "odd"
    place.mkdir()
    source = next((folder / "runs").glob("*.csv"))
    odd = os.path.join(os.fsencode(place), b"run\xff.csv")  # noqa: PTH118 - the bytes are not valid UTF-8
    with open(odd, "wb") as file:  # noqa: PTH123
        file.write(source.read_bytes())
    for closed in (">&-", "2>&-"):
        line = f'"$0" "$@" {closed}'
        done = subprocess.run(
            ["sh", "-c", line, *command("data", "list", "--json")], capture_output=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, b"")
    told = answer_of(mrdamper("check", ".", "--json", cwd=place))
    assert "run" in told["runs"][0]["name"]


def test_fit_writes_only_three_files(identified, folder):
    assert sorted(p.name for p in (folder / "out").iterdir()) == ["card.json", "errors.csv", "report.html"]
    assert list(folder.rglob(".*")) == []
    rows = (folder / "out" / "errors.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith(
        "name,split,rmse_N,nrmse_percent,nrmse_whole_percent,nrmse_offset_free_percent,command"
    )
    assert len(rows) == 1 + len(answer_of(identified)["runs"])


def test_evaluate_reproduces_errors_of_fit_runs(identified, folder):
    scored = answer_of(mrdamper("evaluate", folder / "out" / "card.json", folder / "runs", "--json"))
    given = {row["name"]: row for row in answer_of(identified)["runs"]}
    assert scored.keys() >= {"runs"}
    for row in scored["runs"]:
        assert row.keys() >= ROW
        assert row["split"] == given[row["name"]]["split"]
        assert row["rmse_N"] == pytest.approx(given[row["name"]]["rmse_N"], rel=1e-6)


def test_simulate_command_agrees_with_python(identified, folder):
    card = folder / "out" / "card.json"
    answer = answer_of(mrdamper("simulate", card, "sine:5mm:1Hz:1V:2s", "--json"))
    force = simulate(read_card(card), "sine:5mm:1Hz:1V:2s").force
    assert answer["force_N"] == pytest.approx([force.min(), force.max()], rel=1e-9)


def test_same_seed_gives_identical_output_files(identified, repeated, folder):
    for name in ("card.json", "report.html", "errors.csv"):
        assert (folder / "again" / name).read_bytes() == (folder / "out" / name).read_bytes()


def test_report_shows_every_run_and_parameter(repeated, folder):
    """The terminal shows the verdict and the table of errors. The report shows all runs and parameters."""
    text, _ = repeated
    assert text.startswith("Held-out runs: median error")
    assert "training" in text
    page = (folder / "again" / "report.html").read_text(encoding="utf-8")
    for path in (folder / "runs").iterdir():
        assert path.stem in page
    assert "yield_force" in page


# ------------------------------------------------------------------------ wrong usage and internal errors


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit",),
        ("fit", "x.csv"),
        ("fit", "x.csv", "--out", "o", "--temperature", "guess"),
        ("fit", "x.csv", "--out", "o", "--posterior", "-1"),
        ("heat", "card.json"),
        ("heatsink", "card.json"),
        ("unknown",),
    ],
)
def test_wrong_usage_gives_exit_code_2(arguments, tmp_path):
    run = mrdamper(*arguments, cwd=tmp_path)
    assert run.returncode == 2
    assert run.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_fit_and_check_print_same_questions_about_data(tmp_path):
    (tmp_path / "run.csv").write_text("t,x,F,I\n" + "".join(f"{k},{k % 7},{k % 5},1\n" for k in range(40)))
    fit = mrdamper("fit", tmp_path / "run.csv", "--out", tmp_path / "out", "--json")
    check = mrdamper("check", tmp_path / "run.csv", "--json")
    assert fit.returncode == 3
    assert json.loads(fit.stdout)["questions"] == json.loads(check.stdout)["questions"] != []


def test_internal_error_has_exit_code_1(monkeypatch, capsys, folder):
    from mrdamper import cli
    from mrdamper.registry import Job

    def broken(*_args, **_options):
        raise ZeroDivisionError("made for this test")

    monkeypatch.setattr(Job, "perform", broken)
    monkeypatch.setattr(sys, "argv", ["mrdamper", "evaluate", "card.json", "run.csv"])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 1
    said = capsys.readouterr().err
    assert "ZeroDivisionError: made for this test" in said
    assert "Traceback" not in said


def spoiled(folder, name, change, *, every=False):
    """Write the short runs to a folder, after ``change`` has modified the first run or every run."""
    place = folder / name
    place.mkdir()
    for number, run in enumerate(short_runs()):
        columns = columns_of(run)
        write_csv(place / f"{run.name}.csv", change(columns) if every or not number else columns)
    return place


def changed(key, how):
    return lambda columns: {name: how(values) if name == key else values for name, values in columns.items()}


def test_file_as_output_folder_is_rejected(folder, tmp_path):
    (tmp_path / "out").write_text("", encoding="utf-8")
    run = mrdamper("fit", folder / "runs", "--out", tmp_path / "out", "--law", "dahl")
    assert run.returncode == 3
    assert "is a file" in run.stderr


def test_unmatched_hold_out_pattern_is_rejected(folder, tmp_path):
    run = mrdamper("fit", folder / "runs", "--out", tmp_path / "out", "--hold-out", "chirp*")
    assert run.returncode == 3
    assert "chirp*" in run.stderr


@pytest.mark.nightly
def test_flip_force_option_corrects_sign_of_runs(tmp_path):
    place = spoiled(tmp_path, "runs", changed("force_N", lambda f: -f), every=True)
    arguments = ("fit", place, "--out", tmp_path / "out", "--law", "dahl", "--term", "none", "--json")
    assert mrdamper(*arguments).returncode == 3
    assert mrdamper(*arguments, "--flip-force").returncode == 0


def test_option_allows_fit_at_single_current(tmp_path, folder):
    runs = [str(path) for path in sorted((folder / "runs").glob("*_1.50V_*.csv"))]
    arguments = ("fit", *runs, "--out", tmp_path / "out", "--law", "dahl", "--term", "none", "--json")
    assert mrdamper(*arguments).returncode == 3
    assert mrdamper(*arguments, "--one-command").returncode == 0


# ----------------------------------------------------------------------------- Python laws and interrupts


@pytest.mark.nightly
def test_python_law_is_fitted_and_evaluated(folder):
    run = short_runs()[-1]
    # Simulating a law in Python is slow.
    short = {name: values[:400:4] for name, values in columns_of(run).items()}
    runs = [write_csv(folder / "short.csv", short)]
    law = f"{folder / 'law.py'}:Relaxing"
    answer = answer_of(
        mrdamper("fit", *runs, "--out", folder / "own", "--law", law, "--one-command", "--json")
    )
    assert answer["law"] == "relaxing"
    card = json.loads((folder / "own" / "card.json").read_text(encoding="utf-8"))
    assert card["python_law"] == law
    scored = answer_of(mrdamper("evaluate", folder / "own" / "card.json", *runs, "--law", law, "--json"))
    assert scored["runs"][0]["rmse_N"] == pytest.approx(answer["runs"][0]["rmse_N"], rel=1e-6)
    refused = mrdamper("evaluate", folder / "own" / "card.json", *runs)
    assert refused.returncode == 3


def test_interrupted_fit_writes_best_card(folder):
    """If the fit is interrupted in its first search step, card and report state the interruption."""

    def interrupt(update: ProgressUpdate) -> None:
        if isinstance(update.detail, SearchState):
            raise KeyboardInterrupt

    out = folder / "interrupted"
    given = {"runs": [folder / "runs"], "law": "dahl"}
    result, answer = JOBS["fit"].perform(given, FitOptions(), out=out, on_progress=interrupt)
    assert answer["cancelled"] is True
    assert JOBS["fit"].reported.outcome(result).exit_code == 4
    card = json.loads((out / "card.json").read_text(encoding="utf-8"))
    assert "interrupted" in card["notes"]["cancelled"]
    assert "interrupted" in (out / "report.html").read_text(encoding="utf-8")


def test_data_list_shows_licence_and_commit():
    sets = answer_of(mrdamper("data", "list", "--json"))["datasets"]
    assert {"utfsm", "utfpr"} <= {entry["name"] for entry in sets}
    assert all(entry["licence"] and len(entry["commit"]) == 40 for entry in sets)


def test_unknown_dataset_is_rejected():
    run = mrdamper("data", "fetch", "utsfm")
    assert run.returncode == 3
    assert "utfsm" in run.stderr


# --------------------------------------------------------------------------------------- real runs


@pytest.mark.nightly
def test_public_sine_runs_are_fitted_accurately(real_data, tmp_path):
    """The median error of 20 sines is at most 6.5 %, the largest error 17 % (with current: 8.5 %)."""
    runs = sorted((real_data / "dev").glob("utfsm_sine_*.csv"))
    answer = answer_of(mrdamper("fit", *runs, "--out", tmp_path / "out", "--json"))
    summary = answer["summary"]["training"]
    assert summary["median_nrmse_percent"] <= 6.5
    assert summary["worst_above_zero_nrmse_percent"] <= 8.5
    assert summary["worst_nrmse_percent"] <= 17.0
    assert (tmp_path / "out" / "report.html").stat().st_size < 3_000_000


def test_package_runs_as_module():
    """``python -m mrdamper`` prints the same message and returns the same exit code as ``mrdamper``."""
    done = subprocess.run(
        [sys.executable, "-m", "mrdamper", "evaluate"], capture_output=True, text=True, check=False
    )
    assert done.returncode == mrdamper("evaluate").returncode == 2
    assert done.stderr.splitlines()[-1] == mrdamper("evaluate").stderr.splitlines()[-1]
