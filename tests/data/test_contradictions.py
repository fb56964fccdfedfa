"""Documents that contradict the files, files of other quantities, and headings of a series."""

from __future__ import annotations

import re

import pytest

from mrdamper.data.proposal.questions import AskingError, parse_answers
from mrdamper.data.readers import read_runs
from tests.data.test_laboratories import RUNS, assert_read
from tests.data.test_unseen_layouts import FULL, NAMES, columns, full, table, write

RATE_Hz = 1.0 / float(RUNS[0].time[1] - RUNS[0].time[0])


@pytest.mark.parametrize(
    ("head", "document", "both"),
    [
        (f"Sample rate: {RATE_Hz:g} Hz\n", "All channels were sampled with 50 Hz.", f"{RATE_Hz:g} Hz, 50 Hz"),
        (f"Sampling interval: {1e3 / RATE_Hz:g} ms\n", "Abtastrate 50 Hz", f"{RATE_Hz:g} Hz, 50 Hz"),
        ("", f"Sampling rate 50 Hz\nData acquisition: rate {RATE_Hz:g} Hz", f"50 Hz, {RATE_Hz:g} Hz"),
    ],
)
def test_contradictory_sampling_rates_are_a_question(tmp_path, head, document, both):
    for name, run in zip(NAMES, RUNS, strict=True):
        _, *others = columns(run)
        write(tmp_path, f"{name}.csv", f"{head}\n" + FULL.split(",", 1)[1] + table(*others))
    write(tmp_path, "readme.txt", document)
    with pytest.raises(AskingError, match=re.escape(f"sampling rates differ: {both}")):
        read_runs(tmp_path)
    assert_read(read_runs(tmp_path, answers=parse_answers([f"time.rate={RATE_Hz:g}"])))


def test_equal_sampling_rates_are_no_question(tmp_path):
    """The document states the interval of the rate in the files, and the rate of another run."""
    for name, run in zip(NAMES, RUNS, strict=True):
        head = f"Sample rate: {RATE_Hz:g} Hz\n\n"
        write(tmp_path, f"{name}.csv", head + FULL.split(",", 1)[1] + table(*columns(run)[1:]))
    write(tmp_path, "readme.txt", f"Sampling interval {1e3 / RATE_Hz:g} ms, the last sampling rate was 50 Hz")
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize(
    "document",
    ["Units of the files: force in daN, displacement in mm, time in s.", "Columns: time [s], force [daN]"],
)
def test_unit_contradicts_document(tmp_path, document):
    full(tmp_path)
    write(tmp_path, "protocol.txt", f"Tests of damper 1\n{document}\n")
    with pytest.raises(AskingError, match="is in N, but a document states daN"):
        read_runs(tmp_path)
    assert_read(read_runs(tmp_path, answers=parse_answers(["force.unit=N"])))


@pytest.mark.parametrize(
    "document",
    [
        "file;stroke [m];force [kN]\n" + "".join(f"{name};0.02;0.4\n" for name in NAMES),
        "Units: force in newton, displacement in mm",
        "Range force: 5 kN\nPeak force: 0.4 kN\n",
    ],
)
def test_results_in_other_units_are_no_contradiction(tmp_path, document):
    full(tmp_path)
    write(tmp_path, "results.txt", document)
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize("lines", [("1 V = 500 N", "1 V = 400 N"), ("", "Load cell 500 N/V\nForce: 400 N/V")])
def test_contradictory_scales_are_a_question(tmp_path, lines):
    for name, run in zip(NAMES, RUNS, strict=True):
        t, x, f, i = columns(run)
        head = f"Force: {lines[0]}\ntime [s],displacement [mm],Force [V],current [A]\n"
        write(tmp_path, f"{name}.csv", head + table(t, x, f / 500.0, i))
    write(tmp_path, "readme.txt", lines[1])
    with pytest.raises(AskingError, match=r"is stated several times: .*500 N.*400 N"):
        read_runs(tmp_path)
