"""Further layouts of laboratories (headers, lists, archives, cells) are read without a channel map."""

from __future__ import annotations

import gzip
import io
import json
import tarfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.proposal.questions import AskingError, parse_answers
from mrdamper.data.readers import read_each, read_runs
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from tests.data.test_laboratories import CURRENTS, RUNS, N, assert_read

FULL = "time_s,displacement_mm,force_N,current_A\n"
BARE = "time_s,displacement_mm,force_N\n"
NAMES = ("run_01", "run_02", "run_03")


def columns(run: RigRun) -> tuple[np.ndarray, ...]:
    return run.time, 1e3 * run.displacement, run.force, run.command


def table(*values: np.ndarray, sign: str = ",", form: str = "%.6f") -> str:
    return "".join(sign.join(form % v for v in row) + "\n" for row in zip(*values, strict=True))


def write(folder: Path, name: str, text: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")


def each(text: Callable[[RigRun], str], name: str = "run_{}.csv") -> Callable[[Path], None]:
    """Return a writer that writes one file for each run."""

    def writer(folder: Path) -> None:
        for k, run in enumerate(RUNS):
            write(folder, name.format(k), text(run))

    return writer


def bare(folder: Path) -> None:
    """Write three runs whose files do not state the current."""
    for name, run in zip(NAMES, RUNS, strict=True):
        write(folder, f"{name}.csv", BARE + table(*columns(run)[:3]))


def full(folder: Path) -> None:
    for name, run in zip(NAMES, RUNS, strict=True):
        write(folder, f"{name}.csv", FULL + table(*columns(run)))


def listed(name: str, text: Callable[[str, float], str], head: str = "") -> Callable[[Path], None]:
    """Return a function that writes the runs without current, and a document with a text for each run."""

    def writer(folder: Path) -> None:
        bare(folder)
        write(folder, name, head + "".join(map(text, NAMES, CURRENTS)))

    return writer


def counts(run: RigRun) -> str:
    head = "Rate [Hz];200\n\nNo;Name;Unit;Factor;Offset\n"
    head += "1;Stroke;mm;1e-6;0.0\n2;Load;N;0.001;100\n3;Coil;A;0.05;0\n\n"
    _, x, f, i = columns(run)
    return head + table(x / 1e-6, (f - 100.0) / 0.001, i / 0.05, sign=";", form="%.0f")


def german(value: float) -> str:
    return f"{value:,.4f}".translate(str.maketrans(",.", ".,"))


def archive(folder: Path) -> None:
    with zipfile.ZipFile(folder / "day.zip", "w", zipfile.ZIP_DEFLATED) as file:
        for name, run in zip(NAMES, RUNS, strict=True):
            file.writestr(f"tests/{name}.csv", FULL + table(*columns(run)))


def packed(folder: Path) -> None:
    for run, current in zip(RUNS, CURRENTS, strict=True):
        text = BARE + table(*columns(run)[:3])
        (folder / f"run_{current}A.csv.gz").write_bytes(gzip.compress(text.encode()))


def tape(folder: Path) -> None:
    with tarfile.open(folder / "day.tar.xz", "w:xz") as file:
        for name, run in zip(NAMES, RUNS, strict=True):
            text = (FULL + table(*columns(run))).encode()
            member = tarfile.TarInfo(f"{name}.csv")
            member.size = len(text)
            file.addfile(member, io.BytesIO(text))


def units_in_a_document(folder: Path) -> None:
    for name, run in zip(NAMES, RUNS, strict=True):
        write(folder, f"{name}.csv", "t,pos,cell,coil\n" + table(*columns(run)))
    write(folder, "README.txt", "Columns: t in s, pos in mm, cell in N and coil [A].\n")


def one_table_of_all_runs(folder: Path) -> None:
    rows = [f"{k},{line}\n" for k, run in enumerate(RUNS) for line in long(run).splitlines()[1:]]
    write(folder, "all.csv", "run,timestamp_ms,tag,value,unit\n" + "".join(rows))


def mat4(folder: Path) -> None:
    from scipy.io import savemat

    for k, run in enumerate(RUNS):
        names = ("time_s", "rod_position_mm", "rod_force_N", "coil_A")
        values = (*columns(run)[:3], run.command[:1])
        savemat(folder / f"{k}.mat", dict(zip(names, values, strict=True)), format="4")


def files_of_channels_named_by_current(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        t, *values = columns(run)
        for name, unit, value in zip(("displacement", "force"), ("mm", "N"), values, strict=False):
            write(
                folder, f"{k}x_{run.command[0]:.2f}A_{name}.csv", f"time_s,{name}_{unit}\n" + table(t, value)
            )


def a_folder_for_each_run(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        t, *values = columns(run)
        for name, head, value in zip(("lvdt", "cell"), ("Stroke (mm)", "Load (N)"), values, strict=False):
            write(folder, f"{run.command[0]} A {k}/{name}.csv", f"Time (s),{head}\n" + table(t, value))


def files_without_time(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        _, *values = columns(run)
        for head, value in zip(("displacement [mm]", "force [N]", "current [A]"), values, strict=True):
            text = f"Sample rate: 200 Hz\n{head}\n" + table(value)
            write(folder, f"{k}_{head.split()[0]}.txt", text)


def runs_in_folders(folder: Path) -> None:
    lines = (f"Run {k},{current},30\n" for k, current in enumerate(CURRENTS))
    write(folder, "day/list.csv", "Run,Coil (A),Oil (°C)\n" + "".join(lines))
    for k, run in enumerate(RUNS):
        write(folder, f"day/Run {k}/daq.txt", BARE + table(*columns(run)[:3]))


def listed_channel_files(folder: Path) -> None:
    write(folder, "list.csv", "run;oil [°C]\n" + "".join(f"D{k}_a;30\n" for k in range(len(RUNS))))
    for k, run in enumerate(RUNS):
        for head, values in zip(("pos [mm]", "load [N]", "coil [A]"), columns(run)[1:], strict=True):
            text = f"ts_ms;{head}\n" + table(1e3 * run.time, values, sign=";")
            write(folder, f"D{k}_a_{head.split()[0]}.csv", text)


def sheets(folder: Path, *, listed: bool) -> None:
    """Write a workbook with a sheet for each run, and the list of the runs on a sheet or in a file."""
    from openpyxl import Workbook

    book = Workbook()
    lines = [["No.", "Table", "Coil", "Oil"], ["", "", "A", "°C"]]
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        sheet = book.create_sheet(f"Test {7 - k}")
        sheet.append(["Time [s]", "Stroke [mm]", "Load [N]"])
        for row in zip(*columns(run)[:3], strict=True):
            sheet.append([float(value) for value in row])
        lines.append([f"{k + 1}", sheet.title, f"{current}", "30"])
    for line in lines:
        book["Sheet"].append(line if listed else ["no list"])
    book.save(folder / "day.xlsx")
    if not listed:
        write(folder, "list.csv", "".join(";".join(line) + "\n" for line in lines))


def results_by_number(folder: Path) -> None:
    """Write a sheet of results, whose rows have the numbers of the sheets with the samples."""
    from openpyxl import Workbook

    book = Workbook()
    book["Sheet"].append(["Legend", "Specimen", "Coil current", "Oil temperature", "Fmax"])
    book["Sheet"].append([None, "No.", "A", "°C", "N"])
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True), 1):
        book["Sheet"].append([None, k, current, 30, 100 * k])
        sheet = book.create_sheet(f"Specimen {k}")
        for row in (["Time [s]", "Stroke [mm]", "Load [N]"], *zip(*columns(run)[:3], strict=True)):
            sheet.append([*row])
    book.save(folder / "day.xlsx")


def channel_files_with_steps(folder: Path) -> None:
    """Write a file for each channel with its own time step; the temperature has three samples."""
    for k, run in enumerate(RUNS):
        _, *values = columns(run)
        for name, unit, step, own in zip(
            ("Weg", "Kraft", "Strom", "Temp"),
            ("mm", "N", "A", "°C"),
            ("0,005", "0,005", "0,01", "1"),
            (*values[:2], values[2][::2], np.full(3, 30.0)),
            strict=True,
        ):
            head = (
                f"Kanal: {name}\ny-Einheit: {unit}\nx-Einheit: s\nx0: 0\ndx: {step}\nAnzahl Werte: {len(own)}"
            )
            write(folder, f"Versuch_{k}/{name}.asc", f"{head}\n\n{table(own).replace('.', ',')}")


def filtered_and_driven(folder: Path) -> None:
    """Write vectors without units. The document states a sampling rate, a filter, and a driver."""
    from scipy.io import savemat

    lines = (
        *("Sampled at 200 Hz after a 50 Hz anti-aliasing filter.", "D  damper displacement (mm)"),
        *("F  damper force (N)", "Y  voltage to the current driver (V); the driver delivers 0.5 A per volt"),
    )
    write(folder, "readme.txt", "\n".join(lines))
    for k, run in enumerate(RUNS):
        _, x, force, current = columns(run)
        savemat(folder / f"ran{k}v.mat", {"D": x, "F": force, "Y": current / 0.5}, format="4")


def clocked(run: RigRun, head: str, part: Callable[[float], str]) -> str:
    """Return a text with a list of channels, times in whole seconds, and blanks between sign and number."""
    channels = "CH,Signal,Range,Span\nCH1,Stroke,10V,- 50,mm\nCH2,Load,5V,+ 5000,N\nCH3,Coil,1V,+ 5,A\nData\n"
    rows = (
        f"2026/03/12 10:21:{10 + int(t + 1e-9)},{part(t)}"
        + ",".join(f"{'+-'[int(v < 0)]}   {abs(v):.6f}" for v in row)
        for t, *row in zip(*columns(run), strict=True)
    )
    return channels + head + "\n".join(rows) + "\n"


def blocks_on_a_sheet(folder: Path, notes: Sequence[str] = ()) -> None:
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    book.create_sheet("Notes").append(notes)
    for run, current in zip(RUNS, CURRENTS, strict=True):
        sheet.append([f"Coil current {current} A"])
        sheet.append(["Time [s]", "Stroke [mm]", "Force [N]"])
        for row in zip(*columns(run)[:3], strict=True):
            sheet.append([float(value) for value in row])
        sheet.append([])
    book.save(folder / "day.xlsx")


def long(run: RigRun) -> str:
    names = (("rod_position", "mm"), ("Force", "N"), ("coil", "A"))
    return "timestamp_ms,tag,value,unit\n" + "".join(
        f"{1e3 * t:.3f},{name},{value:.6f},{unit}\n"
        for t, *values in zip(*columns(run), strict=True)
        for (name, unit), value in zip(names, values, strict=True)
    )


def long_with_unit_and_run(folder: Path) -> None:
    """Write all runs as one long table, with a temperature at a lower rate."""
    rows = []
    for k, run in enumerate(RUNS):
        t, *signals = columns(run)
        for name, unit, values in zip(("stroke", "load", "current"), ("mm", "N", "A"), signals, strict=True):
            rows += [f"r{k},{name},{unit},{a:.6f},{b:.6f}\n" for a, b in zip(t, values, strict=True)]
        rows += [f"r{k},oil_temperature,degC,{a:.6f},30\n" for a in (t[0], *t[::50], t[-1])[1:]]
    write(folder, "all.csv", "run,signal,unit,time_s,value\n" + "".join(rows))


def bystanders(folder: Path) -> None:
    full(folder)
    write(
        folder, "results.csv", "cycle,Fmax_N,energy_J\n" + "".join(f"{k},{900 + k},33\n" for k in range(60))
    )
    write(folder, "events.log", "2026-11-02 10:00:00 start pump\n2026-11-02 10:01:00 run 1\n")
    write(folder, "supply.csv", "Time (s),Current (A)\n" + table(np.arange(60.0), 0.75 + 0.0 * np.arange(60)))
    head = "Time [s],Cycle,Force max [N],Force min [N],Temperature [°C]\n"
    write(folder, "cycles.csv", head + table(*np.ones((5, 1)) * np.arange(60.0)))
    write(folder, "heater.log", table(*np.ones((3, 1)) * np.arange(60.0), sign=" "))
    write(
        folder,
        "gas.csv",
        "Time (s),Pressure (bar),Gas force (N)\n" + table(*np.ones((3, 1)) * np.arange(60.0)),
    )
    write(folder, "notes.md", "# Notes\n\nforce cell changed\n")
    write(
        folder,
        "curve.csv",
        "Velocity [m/s],Force up [N],Force down [N]\n" + table(*np.ones((3, 1)) * np.arange(40)),
    )


LAYOUTS: dict[str, Callable[[Path], None]] = {
    "keys_above_their_values": each(
        lambda run: (
            '"INTERVAL",\n5.000E-03\n"HORZ_UNITS","s"\n"VERT_UNITS","s","mm","N","A"\n'
            '"SIGNAL",\n"TIME","STROKE","LOAD","COIL"\n"DATA"\n' + table(*columns(run), form="%+.8E")
        )
    ),
    "row_for_each_property": each(
        lambda run: (
            '"descriptor","Stroke, rod","Load","Coil"\n"VUnit","mm","N","A"\n"SampleRate",200.0,200.0,200.0\n'
            '"HResolution",5.0E-03,5.0E-03,5.0E-03\n"HUnit","s","s","s"\n"values"\n'
            + "".join("," + line + "\n" for line in table(*columns(run)[1:]).splitlines())
        )
    ),
    "counts_with_factors": each(counts),
    "numbered_keys": each(
        lambda run: (
            "# dt = 0.005 s\n# ch1.name = Displacement\n# ch1.unit = mm\n# ch2.name = Force\n"
            "# ch2.unit = kN\n# ch3.name = Current\n# ch3.unit = mA\n"
            + table(
                *(s * v for s, v in zip((1, 1e-3, 1e3), columns(run)[1:], strict=True)),
                sign="\t",
                form="%.9g",
            )
        )
    ),
    "names_with_the_separator": each(
        lambda run: (
            '"Time, elapsed [s]", "Displacement, LVDT [mm]", "Force, cell [N]", "Current, coil [A]"\n'
            + table(*columns(run))
        )
    ),
    "table_in_markdown": listed(
        "README.md",
        lambda name, i: f"| {name}.csv | {i} |\n",
        "# Day\n\n| File | Coil current (A) |\n|---|---|\n",
    ),
    "dictionary": listed(
        "meta.json", lambda name, i: f'"{name}": {{"current": "{i} A"}}' + (",}"[name == NAMES[-1]]), "{"
    ),
    "lines_of_notes": listed("protocol.txt", lambda name, i: f"{name}.csv  coil {i} A, sine\n", "Protocol\n"),
    "list_in_yaml": listed(
        "runs.yaml", lambda name, i: f"  - file: {name}.csv\n    coil_current_A: {i}\n", "runs:\n"
    ),
    "numbers_in_sentences": listed(
        "protocol.txt", lambda name, i: f"Run {int(name[-2:])}: coil {i} A, 2 Hz\n", "Force cell zeroed.\n"
    ),
    "sections_of_settings": listed(
        "tests.ini", lambda name, i: f"[{name}]\nfrequency_Hz = 2\ncoil_current_A = {i}\n\n"
    ),
    "numbers_of_runs": listed(
        "list.csv",
        lambda name, i: f"{int(name[-2:])};{i};\n".replace(".", ","),
        "Test no.;Current [A];Remark\n",
    ),
    "long": each(long),
    "seconds_since_1970": each(
        lambda run: FULL.replace("time", "epoch") + table(1.7e9 + run.time, *columns(run)[1:])
    ),
    "one_table_of_all_runs": one_table_of_all_runs,
    "units_in_a_document": units_in_a_document,
    "step_in_a_row_of_the_channel": each(
        lambda run: (
            "Nr;Name;Unit;Factor;Interval [s]\n1;Stroke;mm;1;0.005\n2;Load;N;1;0.005\n3;Coil;A;1;0.005\n\n"
            + table(*columns(run)[1:], sign=";")
        )
    ),
    "files_of_channels_named_by_current": files_of_channels_named_by_current,
    "folders_of_channels": a_folder_for_each_run,
    "files_of_one_column": files_without_time,
    "blocks_on_a_sheet": blocks_on_a_sheet,
    "time_for_each": each(
        lambda run: (
            "Time [s],Stroke [mm],Time [s],Force [N],Time [s],Current [A]\n"
            + table(*(v for value in columns(run)[1:] for v in (run.time, value)))
        )
    ),
    "archive": archive,
    "tape": tape,
    "packed": packed,
    "mat4": mat4,
    "rate_of_filter_and_gain_of_driver": filtered_and_driven,
    "log": each(lambda run: FULL + table(*columns(run)), "run_{}.log"),
    "other_ending": each(lambda run: FULL + table(*columns(run)), "test.{:0>3}"),
    "thousands_in_quotes": each(
        lambda run: (
            FULL
            + "".join(f'{t:.6f},{x:.6f},"{f:,.4f}",{i}\n' for t, x, f, i in zip(*columns(run), strict=True))
        )
    ),
    "thousands_with_points": each(
        lambda run: (
            FULL.replace(",", ";")
            + "".join(
                f"{t:.6f};{x:.6f};".replace(".", ",") + f"{german(f)};" + f"{i}\n".replace(".", ",")
                for t, x, f, i in zip(*columns(run), strict=True)
            )
        )
    ),
    "decimal_commas_in_quotes": each(
        lambda run: (
            FULL
            + "".join(
                ",".join(f'"{v:.6f}"'.replace(".", ",") for v in row) + "\n"
                for row in zip(*columns(run), strict=True)
            )
        )
    ),
    "colon_before_milliseconds": each(
        lambda run: (
            "Time;displacement_mm;force_N;current_A\n"
            + "".join(
                f"10:15:{int(t + 1e-9):02d}:{round(1e3 * t) % 1000:03d};{x:.6f};{f:.6f};{i}\n"
                for t, x, f, i in zip(*columns(run), strict=True)
            )
        )
    ),
    "per_cent_of_a_range": each(
        lambda run: (
            "Stroke: 100 % = 50 mm\nRange force: 5 kN\nCurrent: 100 % = 2 A\n"
            "time [s];Stroke (%);force [%];current [%]\n"
            + table(run.time, 2e3 * run.displacement, run.force / 50, 50 * run.command, sign=";", form="%.9f")
        )
    ),
    "as_many_entries_as_columns": each(
        lambda run: (
            "Origin Time,0.000,s\nEnd Time,3.000,s\nStart Distance,0,m\nEnd Distance,0,m\n"
            "Current: 100 % = 2 A\n\nTime,Stroke,Load,Current\ns,mm,N,%\n\n"
            + table(*columns(run)[:3], 50 * run.command)
        )
    ),
    "repeated_last_sample": each(
        lambda run: FULL + table(*columns(run)) + table(*(values[-1:] for values in columns(run)))
    ),
    "bystanders": bystanders,
    "signs_apart_with_milliseconds": each(
        lambda run: clocked(run, "Date,ms,CH1,CH2,CH3\n,,mm,N,A\n", lambda t: f"{round(1e3 * t) % 1000},")
    ),
    "coarse_clock_with_interval": each(
        lambda run: clocked(run, "Sampling interval,5ms\nDate,CH1,CH2,CH3\n,mm,N,A\n", lambda _: "")
    ),
    "waves": each(
        lambda run: (
            "IGOR\nWAVES/D\tpos0\tload0\nBEGIN\n"
            + "".join("\t" + line + "\n" for line in table(*columns(run)[1:3], sign="\t").splitlines())
            + 'END\nX SetScale/P x 0,5,"ms", pos0; SetScale y 0,0,"mm", pos0\n'
            + f'X SetScale y 0,0,"N", load0\nX Note pos0, "Coil {run.command[0]:.3E} A"\n'
        ),
        "run{}.itx",
    ),
}
WARM: dict[str, Callable[[Path], None]] = {
    "row_of_name_unit_and_value": each(
        lambda run: (
            f"Oil temp;°C;30\nA;{run.command[0]:g};Coil current\n"
            + "".join(
                ";".join([*names, *(f"{v:.6f}" for v in values)]) + "\n"
                for names, *values in zip(
                    (("Time", "s"), ("Stroke", "mm"), ("Load", "N")),
                    *zip(*columns(run)[:3], strict=True),
                    strict=True,
                )
            )
        )
    ),
    "temperature_above_blocks": lambda folder: write(
        folder,
        "day.txt",
        "# Sine 5 mm, oil 30 degC\n"
        + "\n\n".join(
            f"# I = {run.command[0]:.2E} A\n# t/s  x/mm  F/N\n{table(*columns(run)[:3], sign=' ')}"
            for run in RUNS
        ),
    ),
    "blocks_with_a_row_for_each_channel": lambda folder: write(
        folder,
        "day.txt",
        "# rows of a block: t [s], x [mm], F [N]\n"
        + "\n".join(
            f"# test {k}: coil {run.command[0]} A, oil 30 °C\n"
            + "".join(
                "\t".join([name, *(f"{value:.6f}" for value in values)]) + "\n"
                for name, values in zip("txF", columns(run), strict=False)
            )
            for k, run in enumerate(RUNS, 1)
        ),
    ),
    "description_of_labview": each(
        lambda run: (
            "LabVIEW Measurement\t\nSeparator\tTab\nDescription\tcoil 4, oil 30 degC\n***End_of_Header***\t\n"
            f"Channels\t2\nCoil current\tA\t{run.command[0]:g}\nY_Unit_Label\tmm\tN\nDelta_X\t0.005\t0.005\n"
            "***End_of_Header***\nX_Value\tStroke\tLoad\n"
            + "".join("\t" + line + "\n" for line in table(*columns(run)[1:3], sign="\t").splitlines())
        ),
        "run{}.lvm",
    ),
    "list_on_a_sheet": lambda folder: sheets(folder, listed=True),
    "list_of_sheets_in_a_file": lambda folder: sheets(folder, listed=False),
    "results_with_numbers_of_sheets": results_by_number,
    "entry_on_a_sheet_of_notes": lambda folder: blocks_on_a_sheet(folder, ["Oil temperature", "30 °C"]),
    "channel_files_with_steps": channel_files_with_steps,
    "list_of_folders": runs_in_folders,
    "list_of_channel_files": listed_channel_files,
    "long_table_with_units_and_runs": long_with_unit_and_run,
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_further_laboratory_layout_is_read(tmp_path, layout):
    LAYOUTS[layout](tmp_path)
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize("layout", WARM)
def test_stated_temperature_is_read(tmp_path, layout):
    WARM[layout](tmp_path)
    assert_read(read_runs(tmp_path), warm=303.15)


@pytest.mark.parametrize(
    "notes",
    [["Temperature [°C]", "30", "60"], ["The temperature rose to 60 °C"], ["Max temperature", "60 °C"]],
)
def test_temperature_of_unknown_run_is_not_used(tmp_path, notes):
    blocks_on_a_sheet(tmp_path, notes)
    assert_read(read_runs(tmp_path))


def test_settings_file_supplies_current_of_run(tmp_path):
    """The current is in a JSON file with the name of the run, or in a text file next to a single run."""
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        write(tmp_path, f"a/run_{k}.csv", BARE + table(*columns(run)[:3]))
        write(tmp_path, f"a/run_{k}.json", json.dumps({"damper": "D7", "current_A": current}))
        write(tmp_path, f"b{k}/data.csv", BARE + table(*columns(run)[:3]))
        write(tmp_path, f"b{k}/settings.txt", f"operator: me\ncoil current = {current} A\n")
    runs = read_runs(tmp_path)
    assert sorted(float(run.command[0]) for run in runs) == [i for i in CURRENTS for _ in range(2)]


@pytest.mark.parametrize(
    "text",
    ["Run 1: 0.25 A, run 2: 0.5 A", "All tests: limit 2 A", "Coil supply: type 400, 5 A", "First test 2 A"],
)
def test_ambiguous_sentence_states_no_current(tmp_path, text):
    """A sentence that names several runs, a limit or a rating does not give the current of a run."""
    bare(tmp_path)
    write(tmp_path, "notes.txt", f"{text}\n")
    with pytest.raises(AskingError, match="no current or voltage"):
        read_runs(tmp_path)


LISTS = {"list.md": "| File | Current (A) |\n|---|---|\n| {} | 1.5 |\n", "plan.txt": "{}: coil 500 mA\n"}


@pytest.mark.parametrize(("name", "lists"), [("run_0.5A.csv", ["list.md"]), ("run_1.csv", [*LISTS])])
def test_contradictory_currents_require_answer(tmp_path, name, lists):
    """The question states each current and the document or file name that states this current."""
    write(tmp_path, name, BARE + table(*columns(RUNS[0])[:3]))
    for each_list in lists:
        write(tmp_path, each_list, LISTS[each_list].format(name))
    with pytest.raises(AskingError, match=r"document 'list\.md' .* says 1\.5 A") as fault:
        read_runs(tmp_path)
    assert {*fault.value.questions[0].candidates} == {"0.5 A", "1.5 A"}
    assert len(lists) == 1 or "document 'plan.txt'" in str(fault.value)


@pytest.mark.parametrize("name", ["RUN.OUT", "run.log", "run.json"])
def test_run_without_current_leads_to_question(tmp_path, name):
    """A file with motion and force is a run, whatever its suffix. Other files are ignored."""
    full(tmp_path)
    write(
        tmp_path,
        "pump.DTA",
        "Pt Time (s) Pressure (bar)\n" + table(*np.ones((3, 1)) * np.arange(60), sign=" "),
    )
    t, x, f, _ = columns(RUNS[1])
    as_json = json.dumps({"time_s": [*t], "displacement_mm": [*x], "force_N": [*f]})
    write(tmp_path, name, as_json if "json" in name else "millis,stroke_mm,load_N\n" + table(1e3 * t, x, f))
    with pytest.raises(AskingError, match="no current or voltage") as fault:
        read_runs(tmp_path)
    assert [question.file for question in fault.value.questions] == [name]


def test_table_of_peaks_is_no_run(tmp_path):
    """The displacement columns ``Smax`` and ``Smin`` are constant."""
    full(tmp_path)
    rows = "".join(f"{k},{250 + k},-250,14.{k % 7},-14\n" for k in range(40))
    write(
        tmp_path,
        "trend.csv",
        f"Count [cycles],Force Maximum [N],Force Minimum [N],Stroke Maximum [mm],Stroke Minimum [mm]\n{rows}",
    )
    rows = "".join(f"{k},{250 + k},-250,14,-14\n" for k in range(4))
    write(tmp_path, "peaks.csv", f"Cycle,Fmax [N],Fmin [N],Smax [mm],Smin [mm]\n{rows}")
    assert_read(read_runs(tmp_path))


def test_message_for_folder_without_runs_states_reason(tmp_path):
    write(
        tmp_path,
        "pump.DTA",
        "Pt Time (s) Pressure (bar)\n" + table(*np.ones((3, 1)) * np.arange(60), sign=" "),
    )
    write(tmp_path, "list.csv", "file,current [A]\npump.DTA,1.5\n")
    with pytest.raises(InputError, match=r"pump\.DTA: no displacement column"):
        read_runs(tmp_path)


def test_ambiguous_scale_factor_leads_to_question(tmp_path):
    """Samples with decimals may be raw or already scaled, so the user must decide."""
    run = RUNS[1]
    head = "Channel name;Time;Stroke;Load;Coil\nUnit;s;mm;N;A\nScale factor;1;0.5;1;1\n"
    _, x, f, i = columns(run)
    rows = "".join(";" + line + "\n" for line in table(run.time, x / 0.5, f, i, sign=";").splitlines())
    write(tmp_path, "run.csv", head + rows)
    with pytest.raises(AskingError) as fault:
        read_runs(tmp_path)
    assert [(each.key, each.candidates) for each in fault.value.questions] == [
        ("displacement.scale", ("1 mm", "0.5 mm"))
    ]
    (read,) = read_runs(tmp_path, answers=parse_answers(["displacement.scale=0.5 mm"]))
    assert np.allclose(read.displacement, run.displacement, atol=2e-9)


def test_rows_of_minimum_and_maximum_are_rejected(tmp_path):
    """An oscilloscope may save the minimum and the maximum at one time in two rows."""
    run = RUNS[1]
    rows = [
        row for t, x, f, i in zip(*columns(run), strict=True) for row in ((t, x, f - 1, i), (t, x, f + 1, i))
    ]
    write(tmp_path, "run.csv", FULL + table(*np.array(rows).T))
    with pytest.raises(InputError, match="time does not increase"):
        read_runs(tmp_path)


def test_source_of_archived_run_names_archive(tmp_path):
    archive(tmp_path)
    assert all("day.zip/tests/run_0" in run.source for run in read_runs(tmp_path))
    (tmp_path / "day.zip").write_bytes((tmp_path / "day.zip").read_bytes()[:5000])
    with pytest.raises(InputError, match="damaged"):
        read_each(tmp_path)


def test_question_names_sheet_and_path_in_archive(tmp_path):
    """In the archive, the files of all folders have the same name. Therefore answers contain the folder."""
    sheets(tmp_path, listed=False)
    with pytest.raises(AskingError, match=r"day\.xlsx, sheet 'Test 7': no current"):
        read_runs(tmp_path / "day.xlsx")
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as file:
        for k, run in enumerate(RUNS):
            file.writestr(f"Run {k}/daq.txt", BARE + table(*columns(run)[:3]))
    with pytest.raises(AskingError, match="no current") as fault:
        read_runs(tmp_path / "all.zip")
    places = [question.file for question in fault.value.questions]
    assert places == [f"{tmp_path.parent.name}/{tmp_path.name}/all.zip/Run {k}/daq.txt" for k in range(3)]
    answers = parse_answers([f"Run {k}/*:current.value={i} A" for k, i in enumerate(CURRENTS)])
    assert_read(read_runs(tmp_path / "all.zip", answers=answers))


def test_unrelated_files_are_listed(tmp_path):
    bystanders(tmp_path)
    found = {finding.run for finding in read_each(tmp_path).findings if finding.kind == "no_run"}
    assert found == {"results.csv", "gas.csv", "supply.csv", "curve.csv", "cycles.csv", "heater.log"}
    assert len(read_runs(tmp_path)) == len(RUNS)
    assert len(RUNS[0]) == N
