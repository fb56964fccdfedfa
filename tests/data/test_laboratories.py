"""Laboratory files in many layouts and languages are read without a channel map or lead to a question.

Each test writes a folder of files from one motion at three currents, so the true values are known.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from mrdamper.data.channels import ChannelMap
from mrdamper.data.diagnosis.campaign import compare
from mrdamper.data.formats.groups import attribute_lines
from mrdamper.data.proposal.questions import AskingError, parse_answers
from mrdamper.data.readers import read_file, read_runs
from mrdamper.data.records import Dataset, RigRun
from mrdamper.data.words.labels import Place, find_label, labels_in, rates_in, scales_in
from mrdamper.errors import InputError
from mrdamper.files import parse_toml
from mrdamper.jobs.channel_map import write_map
from mrdamper.jobs.inputs import read_files
from tests.data.rig_files import save_mat73
from tests.support.campaigns import make_run

CURRENTS = (0.0, 0.75, 1.5)
PLAIN = make_run(duration=2.0, rate_Hz=200.0)
N = len(PLAIN)
RUNS = tuple(
    replace(PLAIN, force=(0.2 + current) * PLAIN.force, command=np.full(N, current)) for current in CURRENTS
)


def number(value: float, comma: bool = False) -> str:
    text = f"{value:.6f}"
    return text.replace(".", ",") if comma else text


def rows(
    run: RigRun, scales: Sequence[float] = (1.0, 1e3, 1.0), sign: str = ";", *, comma: bool = False
) -> str:
    """Return time, displacement and force as lines of text, without the command."""
    columns = (run.time * scales[0], run.displacement * scales[1], run.force * scales[2])
    return "\n".join(sign.join(number(v, comma) for v in row) for row in zip(*columns, strict=True)) + "\n"


def assert_read(runs: Dataset, *, unit: str = "A", warm: float | None = None) -> None:
    """Check that each true run was read exactly once, with its current."""
    assert len(runs) == len(RUNS)
    for true in RUNS:
        (run,) = (each for each in runs if abs(float(np.median(each.command)) - true.command[0]) < 1e-3)
        assert run.command_unit == unit
        assert np.allclose(run.time - run.time[0], true.time, atol=2e-6)
        assert np.allclose(run.displacement, true.displacement, atol=2e-9)
        assert np.allclose(run.force, true.force, atol=2e-3)
        assert (run.temperature is None) == (warm is None)
        assert warm is None or abs(float(run.temperature[0]) - warm) < 0.01  # type: ignore[index]


def polish(folder: Path) -> None:
    """Write the current in milliamperes in the folder's name, and the force in kN with decimal commas."""
    for run, current in zip(RUNS, CURRENTS, strict=True):
        place = folder / f"próba {1e3 * current:.0f} mA"
        place.mkdir()
        text = "Czas [s];Przemieszczenie tłoka [mm];Siła [kN]\n" + rows(run, (1.0, 1e3, 1e-3), comma=True)
        (place / "seria.csv").write_text(text, encoding="utf-8")


def french(folder: Path) -> None:
    """Write sample rate, current and temperature above the table. Its time column has no unit."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        head = f"Essai;{k}\nFréquence d'échantillonnage;200 Hz\nIntensité;{number(current, comma=True)} A\n"
        head += "Température huile;40 °C\nCourant max;3 A\n"
        text = head + "temps;course (mm);effort (N)\n" + rows(run, (1e3, 1e3, 1.0), comma=True)
        (folder / f"essai{k}.txt").write_bytes(text.encode("cp1252"))


def japanese(folder: Path) -> None:
    """Write Shift JIS text in an unusual order of columns, with the set point of the current."""
    for k, run in enumerate(RUNS):
        lines = ["試験,減衰器", "電流指令[A],荷重[N],変位[mm],時間[s],電流[A]"]
        table = zip(run.force, 1e3 * run.displacement, run.time, run.command, strict=True)
        lines += [f"9.9,{f:.6f},{x:.6f},{t:.6f},{i:.6f}" for f, x, t, i in table]
        (folder / f"{k}.csv").write_bytes(("\r\n".join(lines) + "\r\n").encode("cp932"))


def blocks(folder: Path) -> None:
    """Write one file: a table of results, a table with its own header for each run, and text at the end."""
    text = "Summary\nCycle\tFmax (N)\n1\t900\n2\t901\n\n"
    for run, current in zip(RUNS, CURRENTS, strict=True):
        text += f"Sweep at {current} A\nElapsed (s)\tLVDT (mm)\tLoad cell (N)\n{rows(run, sign=chr(9))}\n"
    (folder / "sweeps.txt").write_text(text + "End of test\nPeak\t900\n", encoding="utf-16")


def comments(folder: Path) -> None:
    """Write one file whose runs are separated by comments. The time of each run begins at zero."""
    text = "# t [s], stroke [mm], load [N]\n"
    text += "".join(f"# coil {i} A\n{rows(run, sign=',')}" for run, i in zip(RUNS, CURRENTS, strict=True))
    (folder / "log.csv").write_text(text, encoding="utf-8")


def wide(folder: Path) -> None:
    """Write one force column per current, with the current above the name of the column."""
    lines = ["Damper 7;;;;", ";;0 A;0,75 A;1,5 A", "Zeit;Weg;Kraft;Kraft;Kraft", "s;mm;N;N;N"]
    for k in range(N):
        cells = [RUNS[0].time[k], 1e3 * RUNS[0].displacement[k], *(run.force[k] for run in RUNS)]
        lines.append(";".join(number(float(v), comma=True) for v in cells))
    (folder / "wide.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def sheets(folder: Path) -> None:
    """Write one sheet per current, with results above and words below the samples."""
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["No", "Fmax"])
    for run, current in zip(RUNS, CURRENTS, strict=True):
        sheet = book.create_sheet(f"I={current} A")
        for row in (["time", "stroke", "force"], ["s", "mm", "kN"]):
            sheet.append(row)
        for t, x, f in zip(run.time, run.displacement, run.force, strict=True):
            sheet.append([float(t), 1e3 * float(x), 1e-3 * float(f)])
        sheet.append(["maximum", None, 1.0])
    book.save(folder / "book.xlsx")


def polish_sheets(folder: Path) -> None:
    """Write workbooks with numbers as texts with decimal commas. The current is above the column names."""
    from openpyxl import Workbook

    for run, current in zip(RUNS, CURRENTS, strict=True):
        book = Workbook()
        for row in (
            ["Badanie", "", "7"],
            [f"Prąd: {current} A"],
            ["Czas", "Ruch", "Siła"],
            ["[s]", "[mm]", "[N]"],
        ):
            book.active.append(row)
        for values in zip(run.time, 1e3 * run.displacement, run.force, strict=True):
            book.active.append([number(float(value), comma=True) for value in values])
        book.save(folder / f"badanie {CURRENTS.index(current)}.xlsx")
        (folder / f"~$badanie {CURRENTS.index(current)}.xlsx").write_bytes(b"lock")


def russian(folder: Path) -> None:
    """Write Windows-1251 text with units in Cyrillic letters after commas."""
    for k, run in enumerate(RUNS):
        text = "Стенд 2\nТемпература масла: 40 °С\nВремя, с;Ход, мм;Усилие, кН;Ток, мА\n"
        cells = np.column_stack([run.time, 1e3 * run.displacement, 1e-3 * run.force, 1e3 * run.command])
        text += "".join(";".join(number(float(v), comma=True) for v in row) + "\n" for row in cells)
        (folder / f"опыт{k}.csv").write_bytes(text.encode("cp1251"))


def italian(folder: Path) -> None:
    """Write text with vertical bars between the columns."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        text = f"Prova {k}\nCorrente: {current} A\nTempo (ms)|Corsa (mm)|Forza (daN)\n"
        (folder / f"prova{k}.txt").write_text(
            text + rows(run, (1e3, 1e3, 0.1), "|", comma=True), encoding="utf-8"
        )


def side_by_side(folder: Path) -> None:
    """Write all runs side by side, each with its own time column and its current above the names."""
    lines = [";".join(f"{current} A;;" for current in CURRENTS), "t;s;F;t;s;F;t;s;F", "s;mm;N;s;mm;N;s;mm;N"]
    tables = [rows(run).splitlines() for run in RUNS]
    lines += [";".join(row) for row in zip(*tables, strict=True)]
    (folder / "tutte.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def columns_apart(folder: Path) -> None:
    """Write a sheet named by its temperature, with runs side by side and an empty column between them."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.title = "40 °C"
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        columns = (run.time, 1e3 * run.displacement, run.force)
        lines = [(f"I = {current} A",), ("Zeit s", "Weg mm", "Kraft N"), *zip(*columns, strict=True)]
        for row, values in enumerate(lines, 1):
            for column, value in enumerate(values, 4 * k + 1):
                sheet.cell(row, column, value if isinstance(value, str) else float(value))
    book.save(folder / "all.xlsx")


def listed_in_a_comment(folder: Path) -> None:
    """Write SI values separated by blanks. Comments state column names, current and temperature [K]."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        head = ["Machine: Instron 8874", f"Coil current = {1e3 * current:g} mA", "Oil temperature = 313.15 K"]
        head.append("columns: time [s], displacement [m], force [N]")
        columns = np.column_stack([run.time, run.displacement, run.force])
        np.savetxt(folder / f"test{k}.txt", columns, "%.9g", header="\n".join(head))


def structure_with_its_rate(folder: Path) -> None:
    """Write a structure of signals that also contains the sample rate as a number."""
    for k, run in enumerate(RUNS):
        signals = {"disp_mm": 1e3 * run.displacement, "force_kN": 1e-3 * run.force, "current_A": run.command}
        savemat(folder / f"rec{k}.mat", {"rec": {"fs_Hz": 200.0, **signals, "note": "MR damper"}})


def korean(folder: Path) -> None:
    """Write Korean code-page text with the unit of time as a word, and oil and housing temperatures."""
    names = "시간(초),변위(mm),하중(N),전류(A),오일 온도(℃),하우징 온도(℃)\n"
    for k, run in enumerate(RUNS):
        warm = np.full(N, 40.0)
        columns = (run.time, 1e3 * run.displacement, run.force, run.command, warm, warm - 8.0)
        lines = [",".join(number(value) for value in row) for row in zip(*columns, strict=True)]
        (folder / f"test{k}.csv").write_bytes((names + "\n".join(lines) + "\n").encode("cp949"))


def pounds_and_clamp(folder: Path) -> None:
    """Write minutes, mils and pounds-force. The current is the voltage of a current clamp with 100 mV/A."""
    names = "Current clamp: 100 mV/A\nElapsed Time (min),Position (mils),Load (lbs),Current clamp (V)\n"
    for k, run in enumerate(RUNS):
        columns = (
            run.time / 60.0,
            run.displacement / 2.54e-5,
            run.force / 4.4482216152605,
            0.1 * run.command,
        )
        lines = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
        (folder / f"test{k}.prn").write_text(names + "\n".join(lines) + "\n", encoding="ascii")


def oscilloscope(folder: Path) -> None:
    """Write sample numbers. The time step is in the row of units; the file name states the current."""
    for run, current in zip(RUNS, CURRENTS, strict=True):
        lines = ["X,CH1,CH2,Start,Increment", "Sequence,mm,N,0.000000e+00,5.000000e-03"]
        table = zip(1e3 * run.displacement, run.force, strict=True)
        lines += [f"{k},{x:.6f},{force:.6f},," for k, (x, force) in enumerate(table)]
        (folder / f"scope_{current}A_40degC.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


def loop_counter(folder: Path) -> None:
    """Write the milliseconds of a microcontroller, and a second time that restarts in each cycle."""
    for k, run in enumerate(RUNS):
        columns = (1e3 * run.time, run.time % 0.5, 1e3 * run.displacement, run.force, 1e3 * run.command)
        table = [",".join(number(value) for value in row) for row in zip(*columns, strict=True)]
        lines = ["boot: 0x13", "sensor ready", "millis,cycle time (s),pos_mm,load_N,I_mA", *table]
        (folder / f"log{k}.txt").write_text("\n".join(lines) + "\n", encoding="ascii")


def results_above(folder: Path) -> None:
    """Write a table with one row of settings and their units above the samples."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        head = f'"Results"\n,"Coil current","Oil"\n,"(A)","(°C)"\n1,"{current}","40"\n\n"Raw Data"\n'
        head += "Time,Extension,Load\n(s),(mm),(N)\n"
        (folder / f"specimen_{k}.csv").write_text(head + rows(run, sign=","), encoding="utf-8")


def names_and_units_listed(folder: Path) -> None:
    """Write names and units of the columns in labelled lines, and a line that marks the first sample."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        head = f"Current: {current} A\nNames: Time;Stroke;Force\nUnits: s;mm;N\nData:\n"
        (folder / f"run_{k}.asc").write_text(head + rows(run), encoding="ascii")


def german_mts(folder: Path) -> None:
    """Write Windows-1252 text with umlauts in the names and degree signs in the units."""
    for k, run in enumerate(RUNS):
        head = "MTS793|MPT|DEU|1|2|,|.|:|1|0|0|A\n\nDatenerfassung\t\tZeit:\t2,0\tSek.\n"
        head += "Laufzeit\tWeg\tKraft\tSpulenstrom\tÖltemperatur\ns\tmm\tN\tA\t°C\n"
        columns = (run.time, 1e3 * run.displacement, run.force, run.command, np.full(N, 40.0))
        table = ["\t".join(number(value, comma=True) for value in row) for row in zip(*columns, strict=True)]
        (folder / f"mts{k}.txt").write_bytes((head + "\n".join(table) + "\n").encode("cp1252"))


def objects(folder: Path) -> None:
    """Write one run with a JSON object per sample, the others as JSON signals, and an unrelated JSON file."""
    first, *others = RUNS
    table = zip(first.time, 1e3 * first.displacement, first.force, first.command, strict=True)
    lines = [json.dumps(dict(zip(("t_s", "x_mm", "F_N", "I_A"), row, strict=True))) for row in table]
    (folder / "rows.jsonl").write_text("\n".join(lines))
    for k, run in enumerate(others):
        made = (
            ("Time", "s", run.time),
            ("Stroke", "mm", 1e3 * run.displacement),
            ("Load", "N", run.force),
            ("Coil current", "A", run.command),
        )
        signals = [{"name": name, "unit": unit, "values": [*values]} for name, unit, values in made]
        (folder / f"signals{k}.json").write_text(json.dumps({"rig": 7, "signals": signals}))
    (folder / "notes.json").write_text(json.dumps({"operator": "A", "stroke_mm": 50}))


def groups(folder: Path) -> None:
    """Write one HDF5 group per current. The current is an attribute whose name contains its unit."""
    import h5py

    with h5py.File(folder / "tests.h5", "w") as file:
        for k, run in enumerate(RUNS):
            group = file.create_group(f"campaign/test {k}")
            group.attrs["coil_current_mA"] = 1e3 * CURRENTS[k]
            group.attrs["oil temperature"] = "40 °C"
            for name, unit, values in (
                ("t", "s", run.time),
                ("LVDT", "mm", 1e3 * run.displacement),
                ("cell", "N", run.force),
            ):
                group.create_dataset(name, data=values).attrs[("unit", "unite", "Einheit")[k]] = unit


def waveforms(folder: Path) -> None:
    """Write TDMS groups without a time column. The channels state their time step."""
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(folder / "rig.tdms")) as writer:
        for run, current in zip(RUNS, CURRENTS, strict=True):
            made = [("hub", "mm", 1e3 * run.displacement), ("cell", "N", run.force)]
            step = {"wf_increment": 0.005}
            writer.write_segment(
                [
                    ChannelObject(f"{current:g} A", name, values, properties={**step, "unit_string": unit})
                    for name, unit, values in made
                ]
            )


def universal(folder: Path) -> None:
    """Write one universal file (text of fixed width) that contains all runs as functions of time."""
    for run, current in zip(RUNS, CURRENTS, strict=True):
        text = ""
        for name, unit, values in (
            ("Displacement", "mm", 1e3 * run.displacement),
            ("Force", "N", run.force),
            ("Current", "A", run.command),
        ):
            head = [name, "Damper", "today", "NONE", "NONE", "    1" + 75 * " "]
            head.append(f"{4:10d}{N:10d}{1:10d}{0.0:13.5E}{0.005:13.5E}{0.0:13.5E}")
            for code, label, of in (
                (17, "Time", "s"),
                (8, name, unit),
                (0, "NONE", "NONE"),
                (0, "NONE", "NONE"),
            ):
                head.append(f"{code:10d}    0    0    0 {label:20s} {of:20s}")
            data = [f"{value:20.11E}" for value in values]
            lines = ["".join(data[k : k + 4]) for k in range(0, N, 4)]
            text += "\n".join(["    -1", "    58", *head, *lines, "    -1", ""])
        (folder / f"run {current:g}.unv").write_text(text, encoding="ascii")


def indexed(folder: Path) -> None:
    """Write numbered runs, a list of these runs with current and temperature, and a table of results."""
    for k, run in enumerate(RUNS):
        text = "time_s;displacement_mm;force_N\n" + rows(run)
        (folder / f"run_{k}.csv").write_text(text, encoding="utf-8")
    lines = [f"run_{k},{1e3 * current},40,{2 + k}\n" for k, current in enumerate(CURRENTS)]
    (folder / "list.csv").write_text("run,current_mA,temperature_degC,amplitude_mm\n" + "".join(lines))
    results = "number,peak force (N),energy (J)\n1,900,3\n2,901,4\n"
    (folder / "results.csv").write_text(results, encoding="utf-8")


def slow_cells(folder: Path) -> None:
    """Write current and temperature only in every tenth row of the table."""
    for k, run in enumerate(RUNS):
        cells = [f";{run.command[0]};40" if row % 10 == 0 else ";;" for row in range(N)]
        text = "".join(f"{a}{b}\n" for a, b in zip(rows(run).splitlines(), cells, strict=True))
        head = "Time (s);Stroke (mm);Load (N);Current (A);Oil (°C)\n"
        (folder / f"{k}.csv").write_text(head + text, encoding="utf-8")


def slow_clock(folder: Path) -> None:
    """Write current and temperature with their own time column, which has fewer rows."""
    for k, run in enumerate(RUNS):
        slow = [f";{0.25 * row};{run.command[0]};40" if row < 9 else ";;;" for row in range(N)]
        text = "".join(f"{a}{b}\n" for a, b in zip(rows(run).splitlines(), slow, strict=True))
        head = "Time fast (s);Stroke (mm);Load (N);Time slow (s);Current (A);Oil (°C)\n"
        (folder / f"{k}.csv").write_text(head + text, encoding="utf-8")


def legend(folder: Path) -> None:
    """Write numbered columns below a list of their names and units, and below settings with units."""
    for k, run in enumerate(RUNS):
        head = f"[Setup]\nCoil_current_A={run.command[0]}\nOilTemp_C=40\nFs_Hz=200\n[Channels]\n"
        head += "CH0: LVDT displacement, mm\nCH1: load cell force, N\n[Data]\nCH0;CH1\n"
        text = "".join(line.split(";", 1)[1] + "\n" for line in rows(run).splitlines())
        (folder / f"{k}.dat").write_text(head + text, encoding="utf-8")


def periods_in_structures(folder: Path) -> None:
    """Write a MAT v7.3 array of structures with a sampling period, explained in a document."""
    kind = [(name, object) for name in ("Ts", "disp", "force", "current")]
    fields = [(1.0 / 200.0, run.displacement, 1e-3 * run.force, run.command[0]) for run in RUNS]
    save_mat73(folder / "tests.mat", {"tests": np.array(fields, dtype=kind)})
    units = "| `disp` | stroke | m |\n| `force` | load cell | kN |\n| `current` | coil current | A |\n"
    (folder / "README.md").write_text(f"| field | meaning | unit |\n|---|---|---|\n{units}")


def listed_units_and_model(folder: Path) -> None:
    """Write HDF5 groups with channels in rows, units in an attribute, and the force of a model beside."""
    import h5py

    with h5py.File(folder / "tests.h5", "w") as file:
        for k, run in enumerate(RUNS):
            group = file.create_group(f"sine/run_{k}")
            group.attrs["coil_current_A"] = CURRENTS[k]
            attributes = group.create_dataset(
                "data", data=[run.time, 1e3 * run.displacement, run.force]
            ).attrs
            attributes["units"], attributes["channels"] = ["s", "mm", "N"], ["time", "displacement", "force"]
    (folder / "bouc_wen.csv").write_text("time_s,displacement_mm,force_model_N\n" + rows(RUNS[0], sign=","))


def numbered_channels(folder: Path) -> None:
    """Write channels by number with a line that explains them, and a list of tests in columns of blanks."""
    for k, run in enumerate(RUNS, 1):
        head = "TEST NO  1\n VOIE 1 COURSE (mm)   VOIE 2 EFFORT (daN)\n TEMPS (s)    VOIE 1    VOIE 2\n"
        lines = rows(run, (1.0, 1e3, 0.1), "   ").replace("\n", "\n ")
        (folder / f"ESSAI0{k}.LOG").write_text(f"{head} {lines.rstrip()}\n")
    cells = "".join(f"{k}       {number(i, comma=True)} A     40,0 °C\n" for k, i in enumerate(CURRENTS, 1))
    text = "Essai   Courant bobine   Température\n" + cells
    (folder / "fiche.txt").write_text(text, encoding="latin-1")


LABORATORIES: dict[Callable[[Path], None], float | None] = {
    polish: None,
    french: 313.15,
    japanese: None,
    blocks: None,
    comments: None,
    wide: None,
    sheets: None,
    groups: 313.15,
    waveforms: None,
    universal: None,
    polish_sheets: None,
    russian: 313.15,
    italian: None,
    side_by_side: None,
    columns_apart: 313.15,
    korean: 313.15,
    oscilloscope: 313.15,
    loop_counter: None,
    results_above: 313.15,
    names_and_units_listed: None,
    german_mts: 313.15,
    objects: None,
    pounds_and_clamp: None,
    listed_in_a_comment: 313.15,
    structure_with_its_rate: None,
    indexed: 313.15,
    slow_cells: 313.15,
    slow_clock: 313.15,
    legend: 313.15,
    periods_in_structures: None,
    listed_units_and_model: None,
    numbered_channels: 313.15,
}


@pytest.mark.parametrize(
    "write",
    LABORATORIES,
    ids=lambda write: write.__name__,
)
def test_laboratory_file_is_read_without_map(tmp_path, write):
    write(tmp_path)
    assert_read(read_runs(tmp_path), warm=LABORATORIES[write])


@pytest.mark.parametrize(
    ("head", "package"), [(b"|CF,2,1,1;", "imctermite"), (b"\x91\x13" + bytes(30), "apread")]
)
def test_famos_and_catman_message_names_converter(tmp_path, head, package):
    file = tmp_path / "run.dat"
    file.write_bytes(head)
    with pytest.raises(InputError, match=package):
        read_runs(file)


def test_truncated_tdms_file_is_reported(tmp_path):
    waveforms(tmp_path)
    file = tmp_path / "rig.tdms"
    content = file.read_bytes()
    for size in (60, len(content) // 4):
        file.write_bytes(content[:size])
        try:
            (file_read,) = read_files([file]).files
            said = file_read[1].layout.in_words()
        except InputError as fault:
            said = str(fault)
        assert "cut off" in said


@pytest.mark.parametrize(
    "write", [japanese, universal, french, side_by_side], ids=lambda write: write.__name__
)
def test_written_channel_map_reads_same_runs(tmp_path, write):
    write(tmp_path)
    files = read_files([tmp_path])
    chosen = ChannelMap.from_dict(parse_toml(write_map(files).text))
    again = read_runs(tmp_path, chosen)
    for run, other in zip(files.runs, again, strict=True):
        assert np.array_equal(run.force, other.force)
        assert np.array_equal(run.time, other.time)


def test_inferred_currents_state_their_source(tmp_path):
    polish(tmp_path)
    files = read_files([tmp_path])
    said = {each.value: each.source for _, file in files.files for each in file.inferred}
    assert said == {current: f"folder 'próba {1e3 * current:.0f} mA'" for current in CURRENTS}
    # Each file has the name seria.csv, so the run names contain the folder.
    assert len({run.name for run in files.runs}) == 3
    (_, file), *_ = files.files
    assert [column.source for column in file.columns] == ["header", "unit alone", "header"]


# -------------------------------------------------------------------------------------- questions to the user

COLUMNS = "t [s];x [mm];F [N];I [A]"


def one(tmp_path: Path, header: str, above: str = "", name: str = "run.csv") -> Path:
    run = RUNS[1]
    table = np.column_stack([run.time, 1e3 * run.displacement, run.force, run.command, 2.0 * run.force])
    count = header.count(";") + 1
    lines = "\n".join(";".join(f"{value:.6f}" for value in row[:count]) for row in table)
    (tmp_path / name).write_text(f"{above}{header}\n{lines}\n", encoding="utf-8")
    return tmp_path / name


@pytest.mark.parametrize(
    ("header", "above", "asked"),
    [
        ("t [s];x [mm];F;I [A]", "", {"force.unit"}),
        ("n;x [mm];F [N];I [A]", "Frequency: 1 Hz\n", {"time.rate"}),
        ("n;x [mm];F [N];I [A]", "Sample rate 200 Hz\nfs = 100 Hz\n", {"time.rate"}),
        ("t [s];x [mm];F1 [N];I [A];F2 [N]", "", {"force.column"}),
        ("t [s];x [mm];Force [V];I [A]", "", {"force.scale"}),
        ("t [s];x [mm];F [N];Current monitor [V]", "", {"current.scale"}),
        ("t [s];x [mm];F [N];CH4 [V]", "", {"current.column"}),
        ("t [s];x [mm];F [N];i_cmd", "", {"current.unit"}),
        ("timestamp;x [mm];F [N];I [A]", "", {"time.unit"}),
        ("t [s];x [mm];F [N];PWM (%)", "", {"current.scale"}),
        ("t [s];x [mm];F [N];Stellgröße Sollwert [%]", "", {"current.scale"}),
        ("t [s];x [mm];F [N];relative humidity [%]", "", {"current.value"}),
        ("t [s];x [mm];F [N]", "Steps 0.5 A, 1.0 A\n", {"current.value"}),
        ("t [ms];x [mm];F [N];I [A]", "Sample rate: 200 Hz\n", {"time.unit"}),
    ],
)
def test_unknown_quantity_leads_to_question(tmp_path, header, above, asked):
    with pytest.raises(InputError) as fault:
        read_file(one(tmp_path, header, above))
    questions = getattr(fault.value, "questions", ())
    assert {question.key for question in questions} == asked
    assert all(question.file == "run.csv" for question in questions)


@pytest.mark.parametrize(
    ("header", "answers"),
    [
        ("t;x;F;I", ["time.unit=s", "displacement.unit=mm", "force.unit=N", "run*:current.unit=A"]),
        ("t [s];x [mm];F1 [N];I [A];F2 [N]", ["force.column=F1 [N]"]),
        ("t [s];x [mm];Force [V];I [A]", ["force.scale=1 N/V"]),
        ("t [s];x [mm];F [N];Current monitor [V]", ["current.scale=1000 mA/V"]),
        ("t [s];x [mm];F [N];PWM (%)", ["current.scale=100 A/100%"]),
        ("t [s];x [mm];F [N]", ["other*:current.value=9", "current.value=750 mA"]),
        ("t [s];x [mm];F [N];valve_cmd", ["current.column=valve_cmd", "current.unit=A"]),
    ],
)
def test_written_channel_map_contains_answers(tmp_path, header, answers):
    file = one(tmp_path, header)
    (recording,) = read_file(file, answers=parse_answers(answers)).recordings
    written = parse_toml(write_map(read_files([file], answer=answers)).text)
    (again,) = read_runs(file, ChannelMap.from_dict(written))
    assert np.array_equal(again.command, recording.command)
    assert np.array_equal(again.force, recording.force)
    assert np.allclose(recording.force, RUNS[1].force, atol=1e-5)
    assert np.allclose(recording.displacement, RUNS[1].displacement, atol=1e-8)
    assert np.allclose(recording.time, RUNS[1].time, atol=1e-6)
    assert np.allclose(recording.command, 0.75)


@pytest.mark.parametrize("name", ["velocity_5", "temperature_oil", "Temp (raw)", "speed raw"])
def test_optional_column_without_unit_is_skipped(tmp_path, name):
    read = read_file(one(tmp_path, f"{COLUMNS};{name}"))
    assert [each.role for each in read.columns] == ["time", "displacement", "force", "current"]
    assert any(repr(name) in note for note in read.layout.notes)


@pytest.mark.parametrize(
    ("name", "answers"),
    [("run.csv", ["current.value=1 A"]), ("run 1 A.csv", []), ("run.csv", ["voltage.value=5"])],
)
@pytest.mark.parametrize("header", ["i_cmd", "coil_current", "Current [A]"])
def test_constant_that_contradicts_column_is_rejected(tmp_path, name, answers, header):
    """A varying current in the file is not replaced by a constant current."""
    if header == "Current [A]" and answers != ["voltage.value=5"]:
        return
    run = RUNS[1]
    ramp = np.linspace(0.0, 2.0, len(run.time))
    lines = [
        f"{t:.4f};{1e3 * x:.6f};{f:.3f};{i:.4f}"
        for t, x, f, i in zip(run.time, run.displacement, run.force, ramp, strict=True)
    ]
    (tmp_path / name).write_text("\n".join([f"t [s];x [mm];F [N];{header}", *lines, ""]), encoding="utf-8")
    with pytest.raises(InputError, match=r"varies from 0 to 2|has no unit"):
        read_file(tmp_path / name, answers=parse_answers(answers))
    answers = [f"current.column={header}", "current.unit=A"]
    (recording,) = read_file(tmp_path / name, answers=parse_answers(answers)).recordings
    assert np.allclose(recording.command, ramp, atol=1e-4)


def test_contradictory_current_in_name_requires_answer(tmp_path):
    with pytest.raises(AskingError, match=r"says 2 A, and the current measured is 0\.75 A") as fault:
        read_file(one(tmp_path, COLUMNS, name="sine_2A.csv"))
    assert fault.value.questions[0].candidates == ("2 A", "0.75 A")


@pytest.mark.parametrize(
    ("header", "above", "gain"),
    [
        ("t [s];x [mm];Force (V);I [A]", "Force (V): 250 N/V\n", 250.0),
        ("t [s];x [mm];CH3 (V);I [A]", "CH3: 0.25 kN/V\n", 250.0),
        ("t [s];x [mm];CH3 (V);I [A]", "CH3 1 V = 250 N\n", 250.0),
        ("t [s];x [mm];Channel B (mV);I [A]", "B\tload cell\t250 N/V\n", 0.25),
    ],
)
def test_stated_sensor_scale_converts_volts(tmp_path, header, above, gain):
    (recording,) = read_file(one(tmp_path, header, above)).recordings
    assert np.allclose(recording.force, gain * RUNS[1].force, rtol=1e-5, atol=1e-3)


# ------------------------------------------------------------------------------ interpolation and integration


def spoilt(tmp_path: Path, change: Callable[[list[str]], object]) -> Path:
    file = one(tmp_path, COLUMNS)
    lines = file.read_text(encoding="utf-8").splitlines()
    change(lines)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("mark", ["", "NaN", "---", "#NV", "#N/D", "n/a", "-∞"])
def test_few_missing_samples_are_interpolated(tmp_path, mark):
    def change(lines: list[str]) -> None:
        cells = lines[100].split(";")
        lines[100] = ";".join([*cells[:2], mark, cells[3]])

    read = read_file(spoilt(tmp_path, change))
    clipped = [("clipped", "force", pytest.approx(100.0 / len(RUNS[1])))] if mark == "-∞" else []
    assert [(finding.kind, finding.channel, finding.size) for finding in read.findings] == [
        ("missing_filled", "force", 1.0),
        *clipped,
    ]
    (recording,) = read.recordings
    assert recording.force[99] == pytest.approx((RUNS[1].force[98] + RUNS[1].force[100]) / 2, abs=1e-5)


# ------------------------------------------------------------------------------- numbers in names and headers


@given(
    value=st.integers(0, 500).map(lambda n: n / 100),
    before=st.sampled_from(["", "MR_", "test 3, ", "1Hz_", "I", "I=", "(", "sine-"]),
    unit=st.sampled_from(["A", " A", "_A", "mA", " Amps"]),
    after=st.sampled_from(["", "_run2", ")", " 20C", ".", " (N)"]),
    sign=st.sampled_from(".,p"),
)
def test_current_in_name_requires_unit(value, before, unit, after, sign):
    number = f"{1e3 * value:g}" if unit == "mA" else f"{value:g}".replace(".", sign)
    assert labels_in(f"{before}{number}{unit}{after}", "current") == pytest.approx((value,))


@pytest.mark.parametrize(
    ("role", "text", "value"),
    [
        *(
            ("current", f"COIL CURRENT  {number} A", 0.25)
            for number in ("2.5D-01", "2.5E-1", ".25", "0.025e1")
        ),
        ("current", "Coil 2.5E+02 mA", 0.25),
        ("current", "COIL 0.25 AMPS", 0.25),
        *(
            ("temperature", f"OIL TEMP 3.0D+01 {unit}", 303.15)
            for unit in ("DEGC", "deg c", "°C", "c", "Celsius")
        ),
        ("temperature", "oil 86 degF", 303.15),
        ("temperature", "oil 30 ± 1 °C", 303.15),
        ("current", "coil 0.25+/-0.01 A", 0.25),
    ],
)
def test_values_with_exponents_or_unit_words_are_read(role, text, value):
    assert labels_in(text, role) == pytest.approx((value,))


@pytest.mark.parametrize(
    ("current", "oil"),
    [
        ("Virta_A", "Öljyn_lämpötila_C"),
        ("Ström_A", "Oljetemperatur_C"),
        ("Stroom_A", "Olietemperatuur_C"),
        ("Proud_A", "Teplota oleje_C"),
        ("Áram_A", "Olajhőmérséklet_C"),
        ("Akım_A", "Yağ sıcaklık_C"),
    ],
)
def test_attributes_state_conditions_in_languages(current, oil):
    places = [Place("header", line) for line in attribute_lines({current: 0.75, oil: 21.0})]
    found = [find_label(places, role) for role in ("current", "temperature")]
    assert [label and label.values for label in found] == [(0.75,), (294.15,)]


@pytest.mark.parametrize(
    "text",
    [
        "x 5.0E -01 A",
        "rev2A",
        "damperA_000",
        "0-1.5A",
        "0 to 2 A",
        "1 A/V",
        "2Ah",
        "3Aug",
        "T20C",
        "5 mm",
        "DCS-100A",
    ],
)
def test_unrelated_numbers_are_not_currents(text):
    assert labels_in(text, "current") == ()


@given(rate=st.sampled_from([50.0, 200.0, 1000.0, 2500.0]))
def test_sampling_rate_is_not_motion_frequency(rate):
    assert rates_in([f"Sample rate: {rate:g} Hz", f"Delta_X {1 / rate:g}"]) == (rate,)
    assert rates_in([f"Frequency: {rate:g} Hz", "Amplitude 10 mm"]) == ()
    assert scales_in(f"CH1 {rate:g} N/V") == ((rate, "N"),)
    for unit, in_a_second in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("µs", 1e6)):
        assert rates_in([f"Sample interval: {in_a_second / rate:g} {unit}"]) == (rate,)
    assert rates_in([f"Sample interval: {1e3 / rate:g}"]) == ()


# ----------------------------------------------------------------------------------------- delay of the force


def later(run: RigRun, delay_s: float, frequency: float) -> RigRun:
    """Return a run whose force lags the motion by 1 % of the period plus a constant delay."""
    turn = 2.0 * np.pi * frequency
    time = np.asarray(np.arange(800) * 0.0025, dtype=np.float64)
    lag = 0.01 / frequency + delay_s
    return RigRun(
        name=f"{frequency:g}_{delay_s:g}",
        time=time,
        displacement=0.01 * np.sin(turn * time),
        force=500.0 * np.tanh(20.0 * np.cos(turn * (time - lag))),
        command=np.zeros(len(time)),
        command_unit="A",
    )


@given(delay=st.floats(-0.02, 0.025))
def test_two_frequencies_separate_delay_from_compliance(delay):
    kinds = {finding.kind: finding for finding in compare([later(RUNS[0], delay, f) for f in (1.0, 3.0)])}
    sure = delay + 0.0025  # Delay that a fit quadratic in the period gives
    if abs(delay - 0.010) < 0.001 or abs(sure + 0.002) < 0.001:
        return
    assert set(kinds) == ({"force_late"} if delay > 0.010 else {"force_early"} if sure < -0.002 else set())
    for finding in kinds.values():
        assert finding.size == pytest.approx(delay if delay > 0.0 else sure, abs=1e-3)


@pytest.mark.parametrize(("spring_N_m", "friction_N"), [(0.0, 100.0), (3000.0, 150.0), (20000.0, 150.0)])
def test_no_delay_is_reported_for_undelayed_forces(spring_N_m, friction_N):
    """The force of a bristle of 400 N/mm, a shear-thinning viscous force and a gas spring has no delay."""
    runs = []
    for amplitude, frequency in itertools.product((0.005, 0.010), (0.5, 1.0, 2.0)):
        time = np.arange(0.0, 4.0 / frequency, 1e-4 / frequency)
        turn = 2.0 * np.pi * frequency
        x, v = amplitude * np.sin(turn * time), amplitude * turn * np.cos(turn * time)
        bristle = [0.0]
        for step in (4e5 * np.diff(x)).tolist():
            bristle.append(min(max(bristle[-1] + step, -friction_N), friction_N))
        force = np.array(bristle) + 1200.0 * np.sign(v) * np.abs(v) ** 0.8 + spring_N_m * x
        kept = slice(None, None, 50)
        runs.append(
            replace(PLAIN, name=f"{amplitude} {frequency}", time=time[kept], displacement=x[kept],
                    force=force[kept], command=np.zeros(len(time[kept])), velocity=None)
        )  # fmt: skip
    assert not {finding.kind for finding in compare(runs)} & {"force_early", "force_late"}
