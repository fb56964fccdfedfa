"""Documents next to files of runs supply missing data, such as currents, or lead to a question."""

from __future__ import annotations

import gzip
import json
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from mrdamper.data.proposal.documents import rejected_in
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.readers import read_each, read_runs
from mrdamper.data.words.signs import signs_in
from tests.data.test_laboratories import CURRENTS, RUNS, assert_read, groups
from tests.data.test_unseen_layouts import BARE, FULL, NAMES, bare, columns, full, table, write
from tests.support.pace import taken

WARM_K = 303.15
UNITS = {"t": "s", "x": "mm", "F": "N"}
NAMED = "t,x,F\n"
Writer = Callable[[Path], None]


def runs(folder: Path, head: str = NAMED) -> None:
    """Write time, displacement and force of each run after ``head``, which states no units or is empty."""
    for name, run in zip(NAMES, RUNS, strict=True):
        write(folder, f"{name}.csv", head + table(*columns(run)[:3]))


def beside(suffix: str, text: Callable[[float], str], head: str = NAMED) -> Writer:
    """Return a function that writes the runs, and one document for each run."""

    def writer(folder: Path) -> None:
        runs(folder, head)
        for name, current in zip(NAMES, CURRENTS, strict=True):
            write(folder, f"{name}{suffix}", text(current))

    return writer


def about(name: str, text: str, head: str = NAMED) -> Writer:
    """Return a function that writes the runs, and one document that describes all runs."""

    def writer(folder: Path) -> None:
        runs(folder, head)
        write(folder, name, text)

    return writer


def each(text: str, numbers: Iterable[object] = (1, 2, 3)) -> str:
    """Fill in ``text`` for each run: n is the name of the run, i the current, k an item of ``numbers``."""
    return "".join(text % {"n": n, "i": i, "k": k} for n, i, k in zip(NAMES, CURRENTS, numbers, strict=True))


def workbook(folder: Path) -> None:
    from openpyxl import Workbook

    bare(folder)
    book = Workbook()
    for row in (["Matrix"], ["File", *NAMES], ["励磁电流/A", *CURRENTS], ["阻尼器温度/℃", 30, 30, 30]):
        book.active.append(row)
    book.save(folder / "plan.xlsx")


def write_ods(path: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> None:
    """Write OpenDocument sheets with 1020 empty cells after each row, as spreadsheet programs save them."""
    name = "urn:oasis:names:tc:opendocument:xmlns"
    tables = "".join(
        f'<table:table table:name="{title}">'
        + "".join(
            "<table:table-row>"
            + "".join(
                f'<table:table-cell office:value-type="float" office:value="{cell}"/>'
                if isinstance(cell, float)
                else '<table:table-cell office:value-type="string">'
                f"<text:p>{cell}</text:p></table:table-cell>"
                for cell in row
            )
            + '<table:table-cell table:number-columns-repeated="1020"/></table:table-row>'
            for row in rows
        )
        + "</table:table>"
        for title, rows in sheets.items()
    )
    spaces = " ".join(f'xmlns:{kind}="{name}:{kind}:1.0"' for kind in ("office", "table", "text"))
    text = (
        f"<office:document-content {spaces}><office:body><office:spreadsheet>{tables}"
        "</office:spreadsheet></office:body></office:document-content>"
    )
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        file.writestr("META-INF/manifest.xml", "<manifest/>")
        file.writestr("content.xml", text)


def open_document(folder: Path) -> None:
    bare(folder)
    head: Sequence[Sequence[str]] = [["Laboratory"], [], ["Test", "Current (A)", "Oil (°C)", "Remark"]]
    rows = [[name, f"{current}", "30"] for name, current in zip(NAMES, CURRENTS, strict=True)]
    write_ods(folder / "plan.ods", {"Plan": [*head, *rows]})


def open_document_with_samples(folder: Path) -> None:
    sheets: dict[str, Sequence[Sequence[object]]] = {"plots": []}
    sheets["Plan"] = [["Sheet", "Oil (°C)"], *([f"{current} A", 30.0] for current in CURRENTS)]
    for current, run in zip(CURRENTS, RUNS, strict=True):
        sheets[f"{current} A"] = [BARE.strip().split(","), *np.column_stack(columns(run)[:3]).tolist()]
    write_ods(folder / "day.ods", sheets)


def protocols(folder: Path) -> None:
    for k, (run, current) in enumerate(zip(RUNS, CURRENTS, strict=True)):
        write(folder, f"měření {k}/záznam.csv", BARE + table(*columns(run)[:3]))
        write(folder, f"měření {k}/zápis.txt", f"Proud cívkou: {current} A\nTeplota tlumiče: 30 °C\n")
        write(folder, f"měření {k}/špičky.csv", "Cyklus;Fmax [N];Fmin [N]\n1;900;-900\n2;901;-901\n")


def archived(folder: Path) -> None:
    bare(folder)
    with zipfile.ZipFile(folder / "day.zip", "w") as file:
        for name in NAMES:
            file.write(folder / f"{name}.csv", f"raw/{name}.csv")
            (folder / f"{name}.csv").unlink()
    write(folder, "README.md", "| File | I (A) | T (°C) |\n|--|--|--|\n" + each("| %(n)s | %(i)s | 30 |\n"))


def archived_with_list(folder: Path) -> None:
    archived(folder)
    (folder / "README.md").unlink()
    write(folder, "list.csv", "No,File,I (A),T (°C)\n" + each("%(k)s,%(n)s,%(i)s,30\n") + "\nCoil: 3 ohm\n")


def specimens(folder: Path) -> None:
    """Write runs in a subfolder, and a list of specimens with a remark above the subfolder."""
    from openpyxl import Workbook

    for k, run in enumerate(RUNS, 1):
        write(folder, f"raw/Probe_{k}.csv", BARE + table(*columns(run)[:3]))
    write(folder, "raw/summary.csv", "Probe;Fmax [N]\n1;900\n2;901\n3;902\n")
    book = Workbook()
    rows = [[k, i, 30] for k, i in enumerate(CURRENTS, 1)]
    for row in (["Prüfliste"], [], ["Probe", "Strom [A]", "Öl [°C]"], *rows, [], ["Netzgerät geprüft"]):
        book.active.append(row)
    book.save(folder / "Liste.xlsx")


def codes(folder: Path) -> None:
    for k, run in enumerate(RUNS):
        write(folder, f"MR_I{k}_T1.csv", BARE + table(*columns(run)[:3]))
    rows = "".join(f"| `I{k}` | coil current {i} A |\n" for k, i in enumerate(CURRENTS))
    write(folder, "MR_I0_T2.csv", BARE + table(*columns(RUNS[0])[:3]))
    write(folder, "README.md", f"| code | meaning |\n|--|--|\n{rows}| T1 | oil 30 °C |\n| T2 | oil 50 °C |\n")


CURRENT_LIST = ", ".join(map(str, CURRENTS))
CHANNELS = [
    {"name": name, "unit": unit} for name, unit in zip(("time", "pos", "load"), UNITS.values(), strict=True)
]
DOCUMENTS: dict[str, Writer] = {
    "json_with_values_and_units": beside(
        "_meta.json",
        lambda i: json.dumps(
            {
                "conditions": {
                    "coil": {"value": 1e3 * i, "unit": "mA"},
                    "oil temperature": {"value": 303.15, "unit": "K"},
                },
                "limits": {"current": {"value": 9, "unit": "A"}},
                "columns": {name: {"unit": unit} for name, unit in UNITS.items()},
            }
        ),
    ),
    "json_with_channels_of_a_text_without_header": beside(
        ".csv.json", lambda i: json.dumps({"channels": CHANNELS, "current_A": i, "oil_degC": 30}), head=""
    ),
    "json_with_lists": about(
        "tests.json",
        json.dumps(
            {
                "names": [*UNITS],
                "units": [*UNITS.values()],
                "file": [f"{name}.csv" for name in NAMES],
                "current_A": CURRENTS,
                "oil_degC": [30, 30, 30],
            }
        ),
        head="",
    ),
    "yaml": about(
        "setup.yaml",
        "columns:\n- {name: t, unit: s}\n- {name: x, unit: mm}\n- {name: F, unit: N}\nruns:\n"
        + each("  - coil_current: %(i)s A\n    oil: 30 °C\n    file: %(n)s.csv\n"),
    ),
    "yaml_with_numbers": about(
        "setup.yml",
        "units:\n  t: s\n  x: mm\n  F: N\nruns:\n" + each("  %(k)s: {current_A: %(i)s, oil_degC: 30}\n"),
    ),
    "ini": about(
        "rig.ini",
        "[channel1]\nname=time\nunit=s\n[channel2]\nname=stroke\nunit=mm\n[channel3]\nname=load\nunit=N\n"
        + each("[%(n)s]\ncurrent = %(i)s ; A\noil = 30 ; degC\n"),
        head="",
    ),
    "toml": about(
        "rig.toml",
        'columns = {t = "s", x = "mm", F = "N"}\n'
        + each('[[run]]\nfile = "%(n)s.csv"\ncoil = %(i)s # A\noil = 30 # degC\n'),
    ),
    "python": about(
        "load.py",
        "# columns: 1 time [s], 2 stroke [mm], 3 force [N]\n"
        + "CURRENT_A = {\n"
        + each("    '%(n)s.csv': %(i)s,\n")
        + "}\nI_max = 9  # A\nOIL_degC = {\n"
        + each("    '%(n)s.csv': 30,\n")
        + "}\n"
        + "for f in FILES:\n    t, x, F = np.loadtxt(f).T\n",
        head="",
    ),
    "matlab_structures": about(
        "data.m",
        "cols = {'t','x','F'}; units = {'s','mm','N'};\n"
        + each("v(%(k)s).file = '%(n)s.csv'; v(%(k)s).I = %(i)s; %% A\nv(%(k)s).T_oil = 30; %% degC\n"),
        head="",
    ),
    "comment_with_list_of_columns": about(
        "evaluate.m",
        "% each line holds the time [s], displacement [mm], force [N]\n"
        + each("r(%(k)s).file = '%(n)s.csv'; r(%(k)s).I = %(i)s; r(%(k)s).T = 30;  %% A, degC, sine\n"),
        head="",
    ),
    "explained_names": about(
        "vars.txt",
        "c1    time of day, s\nc2 = stroke, mm, rod out positive\n- `c3`: force in N (pull positive)\n"
        + each("%(n)s  coil current %(i)s A, oil temperature 30 °C\n"),
        head="c1,c2,c3\n",
    ),
    "specimens_in_a_workbook_with_remark": specimens,
    "workbook_with_a_column_for_each_run": workbook,
    "open_document": open_document,
    "protocol_in_each_folder": protocols,
    "document_next_to_an_archive": archived,
    "list_with_a_note_next_to_an_archive": archived_with_list,
    "sentences_about_a_supplied_coil": about(
        "verbale.txt", each("%(n)s  bobina alimentata, corrente %(i)s A; temperatura olio 30 °C\n"), head=BARE
    ),
    "blanks_between_cells": about(
        "protokol.txt",
        "Protokol\n\nsoubor    proud (A)   teplota (°C)\n" + each("%(n)s    %(i)s    30\n"),
        head=BARE,
    ),
}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_document_supplies_current_and_temperature(tmp_path, document):
    DOCUMENTS[document](tmp_path)
    assert_read(read_runs(tmp_path), warm=WARM_K)


def test_codes_in_names_are_explained_by_document(tmp_path):
    codes(tmp_path)
    read = {run.name: run for run in read_runs(tmp_path).runs}
    assert [read[f"MR_I{k}_T1"].constant_command for k in range(3)] == [*CURRENTS]
    assert read["MR_I0_T2"].constant_command == CURRENTS[0]
    assert {run.temperature if run.temperature is None else run.temperature[0] for run in read.values()} == {
        WARM_K,
        WARM_K + 20.0,
    }


def described(text: str, *, head: str = "", across: bool = False, scales: Sequence[float] = (1, 1)) -> Writer:
    """Return a function that writes runs with and without a column of times, and a text on their columns.

    ``head`` is the header of the columns. ``across`` writes a row for each channel, without times.
    """

    def writer(folder: Path) -> None:
        for run, current in zip(RUNS, CURRENTS, strict=True):
            t, x, f, i = columns(run)
            values = [x / scales[0], f / scales[1], i]
            rows = table(*np.transpose(values), sign="\t") if across else table(t, *values, sign="\t")
            write(folder, f"test_{current:.2f}A.txt".replace(".", ",", 1), head.replace(",", "\t") + rows)
        (folder / "readme.txt").write_text(text, encoding="cp1250" if "łoczyska" in text else "utf-8")

    return writer


LIST = (
    "1 time (sec)\n2  table acceleration (g)\n3  stroke (mm), + elongation\n4  force (N), + tension\n"
    "5  coil current (A)\n6 mark\n"
)


def other_quantities(folder: Path, text: str = LIST) -> None:
    """Write columns without header, with an acceleration and a mark, and a list of the columns."""
    for run, current in zip(RUNS, CURRENTS, strict=True):
        t, x, f, i = columns(run)
        write(
            folder,
            f"test_{current:.2f}A.txt".replace(".", ",", 1),
            table(t, 0.0 * t, x, f, i, 0.0 * t, sign=" "),
        )
    write(folder, "readme.txt", f"ASCII, columns:\n{text}{OIL}")


OIL = "Oil: 0,0 A - 30 °C; 0,75 A - 30 °C; 1,5 A - 30 °C\n"
NO_NAMES = "CH1,CH2,CH3,CH4\n"
EXPLAINED: dict[str, Writer] = {
    "polish_rows": described(
        "Częstotliwość próbkowania 200 Hz\n wiersz 1 - przemieszczenie tłoczyska [mm]\n wiersz 2 - siła [N]\n"
        " wiersz 3 - natężenie prądu w cewce [A]\n" + OIL,
        across=True,
    ),
    "ordinal_numbers": described(
        "1. row: stroke, mm\n2. row: force, N\n3. row: coil, A\n200 Hz sampling\n" + OIL, across=True
    ),
    "chinese_rows": described(
        "采样频率 200 Hz\n第1行：位移（mm），第2行：力（N）\n第3行：电流（A）\n" + OIL, across=True
    ),
    "rows_from_zero": described(
        "Abtastrate 200 Hz\nZeile 0 = Weg, 10 mm/V\nZeile 1 = Kraft [V], 500 N/V\nZeile 2 = Strom [A]\n"
        + OIL,
        across=True,
        scales=(10, 500),
    ),
    "sentence": described(
        "Column 1 is the time in s, column 2 is the stroke in mm, column 3 is the load in N and column 4 the"
        " current in A.\n" + OIL
    ),
    "numbered_quantities_without_role": other_quantities,
    "list_with_other_units_in_a_line": lambda folder: other_quantities(
        folder, "time (s), acceleration (g), stroke (mm), force (N), coil current (A), mark (-)\n"
    ),
    "table_of_columns": described(
        "| 1 | time | s |\n| 2 | stroke | mm |\n| 3 | load | N |\n| 4 | coil current | A |\n" + OIL
    ),
    "per_cent_of_columns": described(
        "1: time [s]\n2: stroke in %, 100 % = 50 mm\n3: force in % of range, 100 % = 5 kN\n4: coil [A]\n"
        + OIL,
        scales=(0.5, 50),
    ),
    "per_cent_of_channels": described(
        "CH1: time, s\nCH2: curso em % do fundo de escala, 100 % = 50 mm\nCH3: força em %, 100 % = 5 kN\n"
        "CH4: current, A\n" + OIL,
        head=NO_NAMES,
        scales=(0.5, 50),
    ),
    "per_cent_in_one_line": described(
        "Curso e forca em % do fundo de escala (50 mm e 5 kN)\n" + OIL,
        head="Tempo [s],Curso [%],Forca [%],Corrente [A]\n",
        scales=(0.5, 50),
    ),
    "per_cent_with_both_ends": described(
        "Weg: -100 % = -50 mm, +100 % = +50 mm\nKraft: 0 % = 0 kN, 100 % = 5 kN\n" + OIL,
        head="Zeit [s],Weg [% v. E.],Kraft [% v. E.],Strom [A]\n",
        scales=(0.5, 50),
    ),
}


@pytest.mark.parametrize("text", EXPLAINED)
def test_columns_explained_in_a_text_are_read(tmp_path, text):
    """The text states quantities and scales of numbered rows or columns, and temperatures by current."""
    EXPLAINED[text](tmp_path)
    assert_read(read_runs(tmp_path), warm=WARM_K)


CODEBOOK = [
    *(("tt", "time since the start", "s"), ("xd", "piston displacement, positive in extension", "mm")),
    *(
        ("xs", "set point of the displacement", "mm"),
        ("fd", "damper force", "N"),
        ("ic", "coil current", "A"),
    ),
]


def explained_by(name: str, text: str) -> Writer:
    """Return a function that writes all runs in one table, and the meaning of its columns in a document."""

    def writer(folder: Path) -> None:
        write(folder, "damper.csv", "".join(",".join(map(str, row)) + "\n" for row in stacked()))
        write(folder, name, text)

    return writer


def stacked() -> list[list[object]]:
    """Return the rows of a table of all runs, in which time increases from run to run."""
    rows: list[list[object]] = [["id", *(name for name, *_ in CODEBOOK)]]
    for k, run in enumerate(RUNS, 1):
        t, x, f, i = columns(run)
        rows += [[k, *cells] for cells in np.column_stack((t + 9 * k, x, 1.1 * x, f, i)).tolist()]
    return rows


def codebook_in_workbook(folder: Path) -> None:
    from openpyxl import Workbook

    book = Workbook()
    for sheet, rows in ((book.active, stacked()), (book.create_sheet("Codebook"), CODEBOOK)):
        for row in rows:
            sheet.append(row)
    book.save(folder / "damper.xlsx")


CODEBOOKS: dict[str, Writer] = {
    "commas": explained_by(
        "codebook.csv",
        "variable,description,unit\nid,run,\n" + "".join(f'{n},"{text}",{u}\n' for n, text, u in CODEBOOK),
    ),
    "number_type_and_range": explained_by(
        "codebook.csv",
        "no,name,type,unit,min,max,meaning\n"
        + "".join(f'{k},{n},real,{u},-9,9.5,"{text}"\n' for k, (n, text, u) in enumerate(CODEBOOK, 2)),
    ),
    "markdown": explained_by("README.md", "".join(f"| `{n}` | {text} | {u} |\n" for n, text, u in CODEBOOK)),
    "json": explained_by(
        "datapackage.json",
        json.dumps({"fields": [{"name": n, "description": text, "unit": u} for n, text, u in CODEBOOK]}),
    ),
    "workbook": codebook_in_workbook,
}


@pytest.mark.parametrize("document", CODEBOOKS)
def test_codebook_explains_columns_of_all_runs(tmp_path, document):
    """The set point has the unit of the measured displacement. The number of the run separates the runs."""
    CODEBOOKS[document](tmp_path)
    assert_read(read_runs(tmp_path))


UNCLEAR: dict[str, Writer] = {
    "limits": about("rig.json", json.dumps({"limit": {"current": {"value": 2, "unit": "A"}}}), BARE),
    "supply": about("rig.yaml", "supply:\n  voltage: 24 V\n  current: 5 A\n", BARE),
    "constant_of_a_script": about("plot.m", "I = 1.5; % A\nload run_01.csv\n", BARE),
    "list_of_other_length": about("plot.m", "I = [0 0.5 1 1.5]; % A\n", BARE),
    "scaled_list": about("plot.m", "I = [0 0.5 1]*2; % A\n", BARE),
    "list_without_unit": about("plot.py", "I = [0, 0.5, 1]\n", BARE),
    "list_without_files": about("plan.yaml", "currents_A: [0, 0.5, 1.0]\n", BARE),
    "files_of_another_day": about("list.csv", "No,File,I [A]\n" + each("%(k)s,old_0%(k)s.csv,%(i)s\n"), BARE),
    "two_currents": beside(
        ".json", lambda i: json.dumps({"start_current_A": i, "end_current_A": i + 1}), BARE
    ),
    "contradictory_columns": about(
        "a.m",
        "% time (s), disp (mm), force (N)\n% time (s), disp (m), force (N)\n"
        + each("%% %(n)s.csv: %(i)s A\n"),
        "",
    ),
    "contradictory_names": about("a.txt", "x  stroke, mm\nx  stroke, m\n" + each("%(n)s  %(i)s A\n")),
    "columns_of_another_file": about(
        "a.txt", "sum.dat: time (s), disp (mm), force (N)\n" + each("%(n)s  %(i)s A\n"), ""
    ),
    "numbers_with_two_meanings": about(
        "a.txt", "1: time [s]\n2: disp [mm]\n3: force [N]\n3: force [kN]\n" + each("%(n)s  %(i)s A\n"), ""
    ),
    "range_from_minus_to_plus": described(
        "Weg: range -25..25 mm\nKraft: range 5 kN\n", head="t [s],Weg [%],Kraft [%],I [A]\n"
    ),
    "missing_unit": beside(".json", lambda i: json.dumps({"current_A": i, "units": {"t": "s", "x": "mm"}})),
}


@pytest.mark.parametrize("document", UNCLEAR)
def test_unclear_document_leads_to_question(tmp_path, document):
    """Limits, constants in scripts and lists of other runs do not give the currents of the runs."""
    UNCLEAR[document](tmp_path)
    with pytest.raises(AskingError):
        read_runs(tmp_path)


@pytest.mark.parametrize("source", ["header", "sidecar", "list"])
def test_stated_current_must_agree_with_measured_current(tmp_path, source):
    """The question names the current that the text states, and the measured current."""
    head = "Coil current: 0.4 A\n\n" if source == "header" else ""
    for name, run in zip(NAMES, RUNS, strict=True):
        write(tmp_path, f"{name}.csv", head + FULL + table(*columns(run)))
        if source == "sidecar":
            write(tmp_path, f"{name}.json", json.dumps({"coil": {"value": 400, "unit": "mA"}}))
    if source == "list":
        write(tmp_path, "list.csv", "file;current [A]\n" + each("%(n)s;0.4\n"))
    with pytest.raises(AskingError, match=r"says 0\.4 A, and the current measured is 0\.75 A"):
        read_runs(tmp_path)


def test_contradictory_temperatures_are_reported(tmp_path):
    full(tmp_path)
    for number, warm in enumerate((30, 40)):
        write(tmp_path, f"list{number}.csv", "file;oil [°C]\n" + each(f"%(n)s;{warm}\n"))
    read = read_each(tmp_path)
    found = [each for each in read.findings if each.kind == "contradictory_temperatures"]
    assert {each.run for each in found} == {*NAMES}
    assert "30 degC" in found[0].found
    assert "40 degC" in found[0].found
    assert all(run.temperature is None for run in read.runs)


DAY = datetime(2022, 9, 14, 9, 0, 0)
STARTS = [DAY + timedelta(minutes=11 * k + 12, seconds=30) for k in range(3)]
LISTS = {
    "moment": ("file,start,current [A]", lambda s: f"{s:%Y-%m-%d %H:%M:%S},"),
    "date_and_clock": ("Datei;Datum;Uhrzeit;Strom [A]", lambda s: f"{s:%d.%m.%Y;%H:%M:%S};"),
    "minutes": ("Datei;Datum;Uhrzeit;Strom [A]", lambda s: f"{s:%d.%m.%Y;%H:%M};"),
    "date_in_the_title": ("Messprotokoll vom 14.09.2022\n\nDatei;Beginn;Strom [A]", lambda s: f"{s:%H:%M};"),
    "american": ("Test,Date,Time,Current (A)", lambda s: f"{s:%m/%d/%Y,%I:%M:%S %p},"),
}


@pytest.mark.parametrize("layout", LISTS)
def test_listed_start_times_select_temperatures_from_log(tmp_path, layout):
    """The log contains the temperatures of damper and hall. Date and time of day are in two columns."""
    head, cells = LISTS[layout]
    sign = ";" if ";" in head else ","
    bare(tmp_path)
    rows = zip(NAMES, STARTS, CURRENTS, strict=True)
    write(tmp_path, "list.csv", f"{head}\n" + "".join(f"{n}{sign}{cells(s)}{i}\n" for n, s, i in rows))
    times = [DAY + timedelta(seconds=30 * k) for k in range(120)]
    lines = (f"{t:%d.%m.%Y;%H:%M:%S};{22 + 0.1 * k:.2f};20.4\n" for k, t in enumerate(times))
    write(tmp_path, "recorder.csv", "Date;Time;Damper [°C];Hall [°C]\n" + "".join(lines))
    kelvin = [run.temperature for run in read_runs(tmp_path)]
    assert all(each is not None for each in kelvin)
    assert np.allclose([each[0] for each in kelvin if each is not None], [297.65, 299.85, 302.05], atol=0.15)


@pytest.mark.parametrize(
    ("line", "signs"),
    [
        ("compression positive", (-1, -1)),
        ("Zug positiv, ausfahren negativ", (-1, 1)),
        ("Stroke positive in extension, load cell positive in compression.", (1, -1)),
        ("Vorzeichen: Einfedern und Druckkraft positiv", (-1, -1)),
        ("COMPRESSION IS POSITIVE FOR STROKE AND FORCE", (-1, -1)),
        ("Corsa positiva in estensione, forza positiva in trazione", (1, 1)),
        ("przemieszczenie dodatnie = wysuwanie (rozciąganie), siła dodatnia = ściskanie", (1, -1)),
        ("stroke (rod out) positive, load positive when pushing (compression)", (1, -1)),
        ("damper force, kN (compression positive)", (None, -1)),
        ("Peak compression: 300 N, positive peak 200 N", (None, None)),
        ("LVDT 5 mm/V (plus = rod moves out), load cell 500 N/V (plus = pushed together)", (1, -1)),
        ("wire [mm] (+ = rod pulled out), load cell [N] (tension -, compression +)", (1, -1)),
        ("Polarity + compresses damper", (-1, -1)),
        ("Weg + = ausgefahren, Kraft: Druck = plus", (1, -1)),
        ("damper force (kgf), + tension", (None, 1)),
        ("load cell -ve in tension", (None, -1)),
        ("0.5 A + compression test at +/-10 kN, rebound -", (None, None)),
        ("x = 0 at mid stroke, start = + 5 mm, push the button", (None, None)),
        ("Compression tests 1-3, tension tests 4-6: + 0.5 A", (None, None)),
    ],
)
def test_positive_direction_is_read_from_text(line, signs):
    found = signs_in([line])
    assert (found.get("displacement"), found.get("force")) == signs


@pytest.mark.parametrize(
    ("line", "signs"),
    [
        ("Stroke positive in extension, load cell positive in compression", (1, -1)),
        ("Load cell: compression positive", (-1, -1)),
        ("Load cell: compression positive", (1, -1)),
        ("Compression positive", (-1, -1)),
    ],
)
def test_stated_direction_reverses_channels(tmp_path, line, signs):
    """A force that resists extension is positive. A sign that is not stated follows from the dissipation."""
    for name, run in zip(NAMES, RUNS, strict=True):
        t, x, f, i = columns(run)
        write(tmp_path, f"{name}.csv", f"{line}\n{FULL}" + table(t, signs[0] * x, signs[1] * f, i))
    assert_read(read_runs(tmp_path))


def test_contradictory_direction_is_not_applied(tmp_path):
    """A damper with the stated directions would create energy."""
    for name, run in zip(NAMES, RUNS, strict=True):
        write(
            tmp_path,
            f"{name}.csv",
            f"Load compression positive, stroke extension positive\n{FULL}" + table(*columns(run)),
        )
    assert_read(read_runs(tmp_path))


def long_table(folder: Path) -> None:
    """Write one row per sample and channel of all runs, and the list of the runs."""
    text = "".join(
        f"r{k},{t:.4f},{name},{value:.6f},{unit}\n"
        for k, run in enumerate(RUNS)
        for row in zip(*columns(run)[:3], strict=True)
        for t, name, value, unit in ((row[0], "displacement", row[1], "mm"), (row[0], "force", row[2], "N"))
    )
    write(folder, "all.csv", "run,time_s,channel,value,unit\n" + text)
    write(folder, "runs.csv", "run,current_A,oil_degC\n" + each("r%(k)s,%(i)s,30\n", range(3)))


def wide_table(folder: Path, name: str = "list.csv", head: str = "", row: str = "%(k)s,%(i)s,30\n") -> None:
    """Write one table with a column for the number of the run, and the list of the runs."""
    numbers = [np.full(len(run.time), k) for k, run in enumerate(RUNS, 1)]
    text = "".join(table(number, *columns(run)[:3]) for number, run in zip(numbers, RUNS, strict=True))
    write(folder, "all.csv", "run no,time_s,displacement_mm,force_N\n" + text)
    write(folder, name, (head or "run,current_A,oil_degC\n") + each(row))


def coded(text: str, names: Iterable[str] = ("MR3-A1", "MR3-B1", "MR3-C2")) -> Writer:
    """Return a function that writes files with codes in their names, and their explanation."""

    def writer(folder: Path) -> None:
        for name, run in zip(names, RUNS, strict=True):
            write(folder, f"{name}.csv", BARE + table(*columns(run)[:3]))
        write(folder, "README.txt", f"{text}\nOil temperature 30 °C for all files.\n")

    return writer


def packed(suffix: str) -> Writer:
    """Return a function that writes archives in a subfolder, and a document in the folder above."""

    def writer(folder: Path) -> None:
        (folder / "data").mkdir()
        for name, run in zip(NAMES, RUNS, strict=True):
            text = (BARE + table(*columns(run)[:3])).encode()
            (folder / f"data/{name}.csv.gz").write_bytes(gzip.compress(text))
        rows = [
            {"file": f"data/{name}.csv{suffix}", "coil_current_A": i, "oil_degC": 30}
            for name, i in zip(NAMES, CURRENTS, strict=True)
        ]
        write(folder, "metadata.json", json.dumps({"sampling_rate_Hz": 200, "experiments": rows}))

    return writer


STORED: dict[str, Writer] = {
    "list_of_runs_in_a_long_table": long_table,
    "list_of_runs_by_number": wide_table,
    "table_of_runs_in_readme_of_one_file": partial(
        wide_table,
        name="README.md",
        head="All runs on bench 2.\n\n| run | coil current | oil |\n|---|---|---|\n",
        row="| %(k)s | %(i)s A | 30 °C |\n",
    ),
    "temperature_of_all_runs": about(
        "LEIAME.md", "Óleo a 30 °C em todos os ensaios\n" + each("%(n)s: %(i)s A\n"), BARE
    ),
    "entries_of_runs_in_one_line": about(
        "leeme.txt",
        "Temperatura: "
        + each("ensayo %(k)s: 30 °C; ")
        + "\nCorriente: "
        + each("ensayo %(k)s = %(i)s A, ")
        + "\n",
        BARE,
    ),
    "letters_in_names": coded("Current: A = 0 A, B = 0.75 A, C = 1.5 A\n1 = sine, 2 = sine"),
    "letters_in_separate_lines": coded(
        "Code of the current:\n - L: 0 A\n - M: 0,75 A\n - H: 1,5 A", ("D_L7", "D_M7", "D_H7")
    ),
    "open_document_with_samples": open_document_with_samples,
    "archives_in_a_subfolder": packed(".gz"),
    "unpacked_names_of_archives": packed(""),
    "values_after_names_in_a_line": about(
        "readme.txt", f"Coil: {each('%(n)s %(i)s A, ')}\nOil at the start: {each('%(n)s = 30 degC; ')}", BARE
    ),
    "rows_without_header": about("protocol.txt", each("%(n)s   oil 30 °C   coil %(i)s A\n"), BARE),
}


@pytest.mark.parametrize("document", STORED)
def test_document_describes_runs_of_any_storage(tmp_path, document):
    STORED[document](tmp_path)
    assert_read(read_runs(tmp_path), warm=WARM_K)


UNEXPLAINED = {
    "steps_of_a_test": coded("Step 1 = 0 A, step 2 = 1 A", ("run_1", "run_2", "run_3")),
    "missing_code": coded("A = 0 A, B = 0.75 A"),
    "single_name_in_a_line": about("readme.txt", "Coil: sine 1 A"),
    "two_places": coded("A = 0 A, B = 0.75 A", ("A_B_1", "B_A_2", "A_A_3")),
}


@pytest.mark.parametrize("names", UNEXPLAINED)
def test_unclear_codes_in_names_lead_to_question(tmp_path, names):
    UNEXPLAINED[names](tmp_path)
    with pytest.raises(AskingError):
        read_runs(tmp_path)


NUMBERS = {"pot": {"stroke_mm": 60.0, "zero_pct": 50.0}, "cell": {"tare": 8123, "counts_per_newton": 4.125}}
STROKE = "x = (pot_pct - zero_pct)/100*stroke_mm"
IN_TEXT = f"The position = 50 % is the middle. `{STROKE}`, `F = (hx711 - tare)/counts_per_newton`."


def counts(folder: Path, formulas: str) -> None:
    """Write per cent of a stroke and counts of a load cell, with their formulas and numbers in documents."""
    for current, run in zip(CURRENTS, RUNS, strict=True):
        raw = table(1e6 * run.time, run.displacement / 0.06 * 100.0 + 50.0, run.force * 4.125 + 8123.0)
        write(folder, f"logs/run_{current}A.csv", "micros,pot_pct,hx711\n" + raw)
    write(folder, "calib.json", json.dumps(NUMBERS))
    write(folder, "README.md", formulas)


def test_formulas_of_documents_convert_counts(tmp_path):
    counts(tmp_path, IN_TEXT)
    assert_read(read_runs(tmp_path))


@pytest.mark.parametrize(
    "formulas",
    [
        IN_TEXT.replace(")/counts", ")*counts"),
        IN_TEXT.replace("/100", "/1000"),
        IN_TEXT.replace("tare)", "offset)"),
        f"{IN_TEXT} {STROKE.replace('zero_pct', '0')}",
    ],
    ids=["dimension", "literal", "unknown_number", "two_formulas"],
)
def test_unclear_formulas_lead_to_question(tmp_path, formulas):
    counts(tmp_path, formulas)
    with pytest.raises(AskingError):
        read_runs(tmp_path)


def loaded_by(name: str, text: str) -> Writer:
    """Return a function that writes volts without header, with 10 mm/V and 200 N/V, and a script."""

    def writer(folder: Path) -> None:
        for k, run in enumerate(RUNS, 1):
            t, x, f, _ = columns(run)
            write(folder, f"a{k}.txt", table(t, x / 10.0, f / 200.0, sign=" ", form="%.9f"))
        write(folder, name, text)

    return writer


def octave(folder: Path) -> None:
    """Write texts of Octave with a matrix and a number, and a script that states the order of the columns."""
    for k, run in enumerate(RUNS, 1):
        t, x, f, _ = columns(run)
        head = "# Created by Octave 6.4\n# name: fs\n# type: scalar\n200\n\n\n# name: M\n# type: matrix\n"
        write(folder, f"a{k}.txt", f"{head}# rows: {len(t)}\n# columns: 3\n{table(f, t, x, sign=' ')}\n\n")
    script = f"% M = [F t x]   t in s, x in mm (out = +), F in N (pull = +)\nI = [{CURRENT_LIST}];  % A\n"
    write(folder, "plot.m", f"{script}for k = 1:3\n    load(sprintf('a%d.txt', k)); title(I(k))\nend\n")


MATLAB = (
    f"kx = 10;  % LVDT, mm/V\nI = [{CURRENT_LIST}];  % coil current, A\nfor k = 1:3\n"
    "    d = load(sprintf('a%d.txt', k));\n    t = d(:,1);  % time, s\n    x = kx.*d(:,2);  % stroke, mm\n"
    "    F = 0.2*d(:,3);  % force, kN\n    plot(x, F); title(I(k))\nend\n"
)
PYTHON = (
    "CURRENT_A = {"
    + ", ".join(f"'a{k}.txt': {i}" for k, i in enumerate(CURRENTS, 1))
    + "}\nfor file in CURRENT_A:\n    a = np.loadtxt(file)\n    t_s = a[:, 0]\n    x_mm = a[:, 1] * 1e1\n"
    "    force = -a[:, 2] * -200  # N\n"
)
LOADED = {
    "matlab": loaded_by("evaluate.m", MATLAB),
    "r": loaded_by(
        "evaluate.R",
        f"I_A <- c({CURRENT_LIST})\nfor (k in 1:3) {{\n  d <- read.table(sprintf('a%d.txt', k))\n"
        "  t_s <- d[,1]\n  x_mm <- 10*d[,2]\n  F_N <- d[, 3]*200\n  print(I_A[k])\n}\n",
    ),
    "python": loaded_by("load.py", PYTHON),
    "octave": octave,
}


@pytest.mark.parametrize("script", LOADED)
def test_script_assigns_columns_without_names(tmp_path, script):
    LOADED[script](tmp_path)
    assert_read(read_runs(tmp_path))


UNCLEAR_SCRIPTS = {
    "function": MATLAB.replace("kx.*", "gain(2)*"),
    "power": MATLAB.replace("kx.*d(:,2)", "d(:,2)*10^2"),
    "other_columns": MATLAB.replace("t = d(:,1);", "t = (0:999)/fs;").replace("(:,2)", "(:,1)"),
    "missing_unit": MATLAB.replace("stroke, mm", "stroke"),
    "other_index": MATLAB.replace("I(k)", "I(4-k)"),
}


@pytest.mark.parametrize("script", UNCLEAR_SCRIPTS)
def test_unclear_script_leads_to_question(tmp_path, script):
    loaded_by("evaluate.m", UNCLEAR_SCRIPTS[script])(tmp_path)
    with pytest.raises(AskingError):
        read_runs(tmp_path)


BYSTANDERS = {
    "calibration.csv": "mass_kg,adc_counts\n" + "".join(f"{k},{900 * k + 7}\n" for k in range(6)),
    "results.csv": "run,peak_N,energy_J\n" + "".join(f"{k},{400 * k},{3 * k}\n" for k in range(1, 12)),
    "damaged.txt": "notes \x8d\xff\xe9 1\n",
}


@pytest.mark.parametrize("name", BYSTANDERS)
def test_table_without_channels_is_listed_not_read(tmp_path, name):
    full(tmp_path)
    (tmp_path / name).write_bytes(BYSTANDERS[name].encode("latin-1"))
    runs = read_runs(tmp_path)
    assert_read(runs)
    assert [finding.run for finding in runs.findings if finding.kind == "no_run"] == [name]


def test_remarks_on_samples_are_read_quickly(tmp_path):
    """The words of a column with a remark on each sample are not compared with each other."""
    count = 10_000
    time = 0.005 * np.arange(count)
    rows = table(time, 10.0 * np.sin(time), 400.0 * np.cos(time), np.full(count, 0.75)).splitlines()
    write(
        tmp_path,
        "run.csv",
        FULL.strip() + ",remark\n" + "".join(f"{row},a{k}\n" for k, row in enumerate(rows)),
    )
    assert taken(lambda: read_runs(tmp_path)) < 5.0


REJECTIONS: dict[str, str] = {
    "list": "Runs 1 and 2 are good. Run 3 was aborted.",
    "row": "run;remark\n1;ok\n2;ok\n3;ungültig, Anschlag berührt\n",
    "column": "run;valid\n1;yes\n2;yes\n3;no\n",
    "blanks": "essai  courant  remarque\n1      0 A      rien\n2      0,75 A   rien\n"
    "3      1,5 A    RATÉ : vérin en butée, capteur déplacé\n",
    "without damper": "file,motion,remark\n{0}.csv,sine,\n{1}.csv,sine,\n"
    "{2}.csv,sine,friction of 10 mm stroke - damper NOT fitted\n",
    "name": "{2}: spoiled, repeated as {1}",
    "quoted": "Do not use `{2}.csv`!",
    "replaced": "Run 3: discarded\nRun 2: repeat of 1, which was aborted\n",
}


@pytest.mark.parametrize("notes", REJECTIONS.values(), ids=REJECTIONS)
def test_spoiled_run_is_listed_not_read(tmp_path, notes):
    full(tmp_path)
    write(tmp_path, "notes.txt", notes.format(*NAMES))
    runs = read_runs(tmp_path)
    assert [run.name for run in runs.runs] == [*NAMES[:2]]
    (finding,) = (finding for finding in runs.findings if finding.kind == "no_run")
    assert (finding.run, finding.severity) == (f"{NAMES[2]}.csv", "warning")


@pytest.mark.parametrize(
    "notes",
    [
        "Run 3: first cycle discarded\nRun 2: temperature invalid",
        "Run 3 repeats run 2, which was spoiled",
        "`sim` contains the force of our model for run_03, not a measurement.",
        "All runs are invalid",
        "run;valid;aborted\n1;yes;no\n2;yes;no\n3;yes;no\n",
    ],
)
def test_run_with_unusable_part_is_read(tmp_path, notes):
    full(tmp_path)
    write(tmp_path, "notes.txt", notes)
    assert_read(read_runs(tmp_path))


def test_discarded_folder_is_listed_not_read(tmp_path):
    full(tmp_path)
    full(tmp_path / "old")
    write(tmp_path, "readme.md", "`old/`: pretest with a saturated amplifier - do not use.")
    runs = read_runs(tmp_path)
    assert_read(runs)
    assert sum(finding.kind == "no_run" for finding in runs.findings) == len(NAMES)


SENTENCES: dict[str, set[int]] = {
    "run_2 was aborted, pump failure": {2},
    "run_2: damper not fitted (rig friction)": {2},
    "run_2: damper not mounted in the oven": set(),
    "Discarded: run_2 and run_3": {2, 3},
    "Do not use run_2.": {2},
    "ne pas utiliser run_2": {2},
    "Runs 2 and 3 are unusable": {2, 3},
    "run_3 比較用（MRダンパではない）": {3},
    "Rig friction: run_2, Dämpfer ausgebaut": {2},
    "run_2: no damper fitted": {2},
    "run_2: damper removed and refitted": set(),
    "The heater was not used in run_2.": set(),
    "After an aborted attempt run_2 was recorded.": set(),
    "The calibration is invalid before run_3": set(),
    "run_3: oil not invalid": set(),
    "run_2: the heater was not used": set(),
    "run_3 電流は 0.5 A ではない": set(),
    "Discarded samples at the start of run_2 (1 s)": set(),
}


@pytest.mark.parametrize("sentence", SENTENCES)
def test_only_rejected_runs_are_left_out(sentence):
    """A sentence rejects a run only if the run is its subject, or the object of an instruction."""
    files = [Path(f"/lab/run_{number}.csv") for number in range(1, 6)]
    rejected = rejected_in(Path("/lab/notes.txt"), [sentence], files, is_run=False)
    assert {*rejected} == {files[number - 1] for number in SENTENCES[sentence]}


def test_groups_without_measurement_are_listed(tmp_path):
    """An attribute or a document calls groups of the same channels spoiled or no measurement."""
    import h5py

    groups(tmp_path)
    with h5py.File(tmp_path / "tests.h5", "a") as file:
        for name in ("zero_check", "warm_up", "test 9"):
            file.copy("campaign/test 1", f"campaign/{name}")
        file["campaign/test 9"].attrs["comment"] = "amplifier saturated at 400 N, discarded"
    write(tmp_path, "README.md", "Damper 3. `zero_check` and `warm_up` are kept for the record only.")
    runs = read_runs(tmp_path)
    assert_read(runs, warm=313.15)
    listed = {finding.run.split("/")[-1] for finding in runs.findings if finding.kind == "no_run"}
    assert listed == {"zero_check", "warm_up", "test 9"}
