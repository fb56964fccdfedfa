"""Documents that contradict the files, files of other quantities, and headings of a series."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from mrdamper.data.proposal.questions import AskingError, parse_answers
from mrdamper.data.readers import read_each, read_runs
from tests.data.test_laboratories import CURRENTS, RUNS, assert_read
from tests.data.test_unseen_layouts import BARE, FULL, NAMES, bare, columns, full, table, write

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


@pytest.mark.parametrize(
    "lines",
    [
        ("1 V = 500 N", "1 V = 400 N"),
        ("", "Load cell 500 N/V\nForce: 400 N/V"),
        ("1 V entspricht 500 N", "Force: 400 N je Volt"),
        ("1 volt corresponde a 500 N", "Force: 4000 N / 10 V (400 N)"),
    ],
)
def test_contradictory_scales_are_a_question(tmp_path, lines):
    for name, run in zip(NAMES, RUNS, strict=True):
        t, x, f, i = columns(run)
        head = f"Force: {lines[0]}\ntime [s],displacement [mm],Force [V],current [A]\n"
        write(tmp_path, f"{name}.csv", head + table(t, x, f / 500.0, i))
    write(tmp_path, "readme.txt", lines[1])
    with pytest.raises(AskingError, match=r"is stated several times: .*500 N.*400 N"):
        read_runs(tmp_path)


def rows(*steps: float) -> str:
    return table(*(step * np.arange(1.0, 201.0) for step in steps))


BYSTANDERS = {
    "impedance": "FREQ[Hz]\tLs[H]\tRs[Ohm]\n" + rows(10.0, -1e-4, 1e-2).replace(",", "\t"),
    "bare_impedance": "Frequency,Ls,Rs\n" + rows(10.0, -1e-4, 1e-2),
    "frequency_response": "Frequency (Hz),Stroke (mm),Phase (deg)\n" + rows(0.1, -1e-2, 1e-2),
    "acceleration": "Time (s),Acceleration X (g),Acceleration Z (g)\n" + rows(0.002, 0.1, 0.2),
    "korean_acceleration": "시간(s),가속도 X(m/s²),가속도 Z(m/s²)\n" + rows(0.002, 0.1, 0.2),
    "chinese_acceleration": "时间(s),加速度(g)\n" + rows(0.002, 0.1),
    "flow_curve": "Shear Rate [1/s];Shear Stress [Pa];Viscosity [Pas]\n"
    + rows(1.0, 2.0, 3.0).replace(",", ";"),
    "magnet": "Coil current (A),Flux density (mT)\n" + rows(0.1, 30.0),
    "supply": "Time (s),U (V),I (A)\n" + rows(1.0, 0.1, 0.01),
}


@pytest.mark.parametrize("name", BYSTANDERS)
@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_file_of_other_quantity_is_listed(tmp_path, name, suffix):
    full(tmp_path)
    write(tmp_path, name + suffix, BYSTANDERS[name])
    assert_read(read_runs(tmp_path))
    found = [each.run for each in read_each(tmp_path).findings if each.kind == "no_run"]
    assert found == [name + suffix]


@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("run_04", "time_s,displacement_mm,force_N"),
        ("run_04", "time_s,A0,A1"),
        ("run_04", "time_s,force_N,oil_C"),
        ("run_04", "a,b,c"),
        ("other", "time_s,displacement_mm,load"),
        ("other", "time_s,displacement_mm,A1"),
        ("other", "a,b,c"),
        ("other", "t,stroke,pressure [bar]"),
    ],
)
def test_run_with_unclear_column_is_a_question(tmp_path, name, head):
    full(tmp_path)
    write(tmp_path, f"{name}.csv", f"{head}\n" + table(*columns(RUNS[0])[:3]))
    with pytest.raises(AskingError, match=name):
        read_runs(tmp_path)


@pytest.mark.parametrize(
    "sampling", [{"interval": 4, "unit": "ms"}, {"rate": 0.25, "unit": "kHz"}, {"rate_Hz": 250}]
)
def test_sampling_in_a_structure_of_json(tmp_path, sampling):
    for name, run in zip(NAMES, RUNS, strict=True):
        _, x, f, i = (values[:400].tolist() for values in columns(run))
        channels = {"displacement_mm": x, "force_N": f, "current_A": i}
        write(tmp_path, f"{name}.json", json.dumps({"sampling": sampling, "channels": channels}))
    assert all(np.allclose(np.diff(run.time), 0.004) for run in read_runs(tmp_path))


@pytest.mark.parametrize(
    ("head", "column", "kelvin"),
    [
        ("# unix time in s\nepoch damper_degC hall_degC", 1, 295.15),
        ("epoch_ms oil_degC count", 1e3, 295.15),
        ("unix tank_degC pump_A", 1, None),
    ],
)
def test_unix_log_joins_runs_with_offset_from_utc(tmp_path, head, column, kelvin):
    """14:12:30 at +02:00 is 12:12:30 UTC. The tank of the pump is not the damper."""
    for k, (name, run) in enumerate(zip(NAMES, RUNS, strict=True)):
        start = f"# started 2023-05-04T14:{12 + 10 * k}:30+02:00\n"
        write(tmp_path, f"{name}.csv", start + FULL + table(*columns(run)))
    lines = (f"{(1683202000 + 20 * k) * column:.0f} 22.0 {k % 7}\n" for k in range(300))
    write(tmp_path, "w1.log", f"{head}\n" + "".join(lines))
    assert {
        None if run.temperature is None else round(run.temperature[0], 2) for run in read_runs(tmp_path)
    } == {kelvin}


MATRIX = "Motion;0 A;0.75 A;1.5 A\nsine 10 mm;%s;%s;%s\n"


@pytest.mark.parametrize(
    "text",
    [
        MATRIX % (1, 2, 3),
        MATRIX % NAMES,
        "Coil [A];record\n0;1\n0.75;2\n1.5;3\n",
        "Coil [A];0;0.75;1.5\nsine 10 mm;1;2;3\n",
        "Numbers of the records\n\nCoil;sine 10 mm;sine 20 mm\n0 A;1;\n0.75 A;;2\n1.5 A;3;\n",
    ],
)
def test_matrix_of_record_numbers_states_currents(tmp_path, text):
    bare(tmp_path)
    write(tmp_path, "matrix.csv", text)
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize("cells", [(1, 2, 2), (3, 3, 3), (1, 2, 7), (1, 2, "")])
def test_matrix_of_other_numbers_is_a_question(tmp_path, cells):
    """The cells may be the numbers of cycles."""
    bare(tmp_path)
    write(tmp_path, "matrix.csv", MATRIX % cells)
    with pytest.raises(AskingError, match="no current"):
        read_runs(tmp_path)


def test_merged_cells_state_several_runs(tmp_path):
    """The first value is in merged cells of the first two runs, which have the same current."""
    from openpyxl import Workbook

    for k, run in enumerate((*RUNS, RUNS[0])):
        write(tmp_path, f"run_{k:02}.csv", BARE + table(*columns(run)[:3]))
    book = Workbook()
    cells = [("0 A", "run_00"), (None, "run_03"), ("0.75 A", "run_01"), ("1.5 A", "run_02")]
    for row in [("Coil", "Run"), *cells]:
        book.active.append((None, *row))
    book.active.merge_cells("B2:B3")
    book.save(tmp_path / "plan.xlsx")
    currents = {run.name: run.constant_command for run in read_runs(tmp_path)}
    assert currents == {"run_00": 0.0, "run_01": 0.75, "run_02": 1.5, "run_03": 0.0}


@pytest.mark.parametrize(
    "script",
    [
        "# file, coil current in A, oil temperature in degC\nRUNS = [\n    %s,\n    %s,\n    %s,\n]\n",
        "RUNS = [\n  # file, current [A], oil [degC]\n %s,\n %s,  # repeated\n %s,\n]\nfor a in RUNS\n",
    ],
)
def test_script_comment_names_columns_of_rows(tmp_path, script):
    bare(tmp_path)
    rows_of_runs = tuple(f'("{name}.csv", {i}, 30.0)' for name, i in zip(NAMES, CURRENTS, strict=True))
    write(tmp_path, "plot.py", script % rows_of_runs)
    assert_read(read_runs(tmp_path), warm=303.15)


def test_script_comment_states_units_of_keys(tmp_path):
    bare(tmp_path)
    pairs = zip(NAMES, CURRENTS, strict=True)
    entries = "".join(f'    {{"file": "{name}.csv", "coil": {1e3 * i}}},\n' for name, i in pairs)
    write(tmp_path, "plot.py", f"# coil in mA\nRUNS = [\n{entries}]\n")
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize(
    "comment", ["file, current, oil", "file, current in A", "current in A or mA, T in K"]
)
def test_script_rows_without_units_lead_to_question(tmp_path, comment):
    bare(tmp_path)
    rows_of_runs = "".join(f'("{n}.csv", {i}, 30.0), ' for n, i in zip(NAMES, CURRENTS, strict=True))
    write(tmp_path, "plot.py", f"# {comment}\nRUNS = [{rows_of_runs}]\n")
    with pytest.raises(AskingError, match="no current"):
        read_runs(tmp_path)
