"""Files that independent libraries write, and small texts written by hand: each column as it was written."""

from __future__ import annotations

import json
from datetime import timedelta

import h5py
import numpy as np
import polars as pl
import pytest
from openpyxl import Workbook

from mrdamper.data.formats import excel, hdf5, objects, text
from mrdamper.data.formats.mdf import read_mdf
from mrdamper.data.formats.mts import read_mts
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions, Layout
from mrdamper.data.formats.text import parse_rows
from mrdamper.errors import InputError

WHOLE = FileOptions()


def columns(table) -> dict[str, list[float]]:
    return {name: table.columns[name].tolist() for name in table.columns}


# ------------------------------------------------------------------------------------------- arrays


def test_matrices_of_hdf5_are_columns_wherever_they_lie(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["rig/a/x"] = np.arange(12.0).reshape(6, 2)
        file["rig/b/x"] = -np.arange(12.0).reshape(2, 6)
        file["one"] = 7.0
        file["rig"].attrs["oil"], file["rig/b"].attrs["valve"], file["rig/a"].attrs["valve"] = "40", "b", "a"
    first = hdf5.read_hdf5(tmp_path / "run.h5", WHOLE)
    assert (first.names, first.more, first.title) == (("column 1 of x", "column 2 of x"), ("rig/b",), "rig/a")
    assert columns(first)["column 2 of x"] == [1.0, 3.0, 5.0, 7.0, 9.0, 11.0]
    other = hdf5.read_hdf5(tmp_path / "run.h5", FileOptions(part="rig/b"))
    assert columns(other)["column 2 of x"] == [-6.0, -7.0, -8.0, -9.0, -10.0, -11.0]
    assert hdf5.read_hdf5(tmp_path / "run.h5", FileOptions(part="rig/b")).said == ("oil: 40", "valve: b")
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["one"] = 7.0
        file["tall"], file["wide"] = np.zeros((64, 65)), np.zeros((65, 66))  # no table of channels
        file.create_dataset("nothing yet", (5000,), "f8")
        file.create_dataset("packed", data=np.zeros(50_000), compression="gzip")
    found = hdf5.read_hdf5(tmp_path / "run.h5", WHOLE)
    assert {name for name in found.names if "column" not in name} == {"one", "packed"}
    assert (found.rows, len(found.names), columns(found)["one"]) == (50_000, 66, [7.0])


@pytest.mark.parametrize(
    ("content", "found"),
    [
        ({"t": [0, 0.5, None], "F": [1, 2, 3]}, {"t": [0.0, 0.5, np.nan], "F": [1.0, 2.0, 3.0]}),
        ({"runs": [[1, 2], [3, 4, 5]]}, {"runs(1)": [1.0, 2.0], "runs(2)": [3.0, 4.0, 5.0]}),
        ({"a": {"b": {"c": {"d": {"e": {"f": {"g": {"h": {"F": [1, 2]}}}}}}}}}, {"F": [1.0, 2.0]}),
        ({"names": ["t", "F"], "words": "none", "empty": []}, {}),
    ],
)  # fmt: skip
def test_json_is_its_lists_of_numbers(tmp_path, content, found):
    (tmp_path / "run.json").write_text(json.dumps(content))
    table = objects.read_json(tmp_path / "run.json", WHOLE)
    assert list(table.columns) == list(found)
    for name, values in found.items():
        assert np.array_equal(table.columns[name], values, equal_nan=True)
    assert table.rows == max(map(len, found.values()), default=0)


# --------------------------------------------------------------------------------------- MDF, TDMS, Parquet


def test_groups_of_an_mdf_file_that_share_a_clock_or_one_name_are_one_table(tmp_path):
    from asammdf import MDF, Signal

    slow, fast = np.arange(3.0), 0.5 * np.arange(5.0)
    with MDF() as file:
        for clock, names in ((slow, "Fx"), (fast, "F"), (slow, "I"), (np.array([4.0]), "T")):
            file.append([Signal(clock + k, clock, name=name, unit="N") for k, name in enumerate(names)])
        file.save(tmp_path / "run.mf4")
    table = read_mdf(tmp_path / "run.mf4", WHOLE)
    assert table.more == ()
    kept = {name.split("/")[-1].split(" ")[0] for name in table.names}
    assert (kept, table.rows, len(table.names)) == ({"time", "F", "x", "I", "T"}, 5, 8)
    assert sorted(map(len, table.columns.values())) == [1, 1, 3, 3, 3, 3, 5, 5]
    assert [*table.columns["x"], *table.columns["T"]] == [1.0, 2.0, 3.0, 4.0]


def test_a_parquet_file_is_itself_whatever_its_name(tmp_path):
    for name in ("run[1].parquet", "run*.parquet", "run1.parquet"):
        pl.DataFrame({name: [1.0], "note": ["a"]}).write_parquet(tmp_path / name)
    for name in ("run[1].parquet", "run*.parquet"):
        table = read_parquet(tmp_path / name, WHOLE)
        assert (table.names, table.rows, columns(table)) == ((name, "note"), 1, {name: [1.0]})
        assert list(table.texts["note"]) == ["a"]
    pl.DataFrame({"note": ["a"]}).write_parquet(tmp_path / "words.parquet")
    assert read_parquet(tmp_path / "words.parquet", WHOLE).rows == 0


# ------------------------------------------------------------------------------------------- workbooks


def test_the_sheets_of_a_workbook_are_told_and_one_can_be_named(tmp_path):
    book = Workbook()
    for name, rows in (("Few", 9), ("First", 12), ("Words", 0), ("Second", 12), ("Third", 12)):
        sheet = book.create_sheet(name)
        sheet.append(["Force [N]", "Time [s]", "Force [N]", None])
        for k in range(rows):
            sheet.append([k + 0.5, timedelta(seconds=k), -k, k])
    book.save(tmp_path / "run.xlsx")
    table = excel.read_workbook(tmp_path / "run.xlsx", WHOLE)
    assert (table.title, table.more, table.layout.header_lines) == ("First", ("Second", "Third"), 1)
    assert table.names == ("Force [N]", "Time [s]", "Force [N] (3)", "column 4")
    assert columns(table)["Time [s]"] == list(range(12))
    assert excel.read_workbook(tmp_path / "run.xlsx", FileOptions(part="Few")).rows == 9
    with pytest.raises(InputError, match=r"no sheet 'Fourth'; the sheets are: 'Sheet', 'Few', 'First'"):
        excel.read_workbook(tmp_path / "run.xlsx", FileOptions(part="Fourth"))
    for cell, wanted in (("C9", "number"), ("B9", "time")):
        book["First"][cell], kept = "oops", book["First"][cell].value
        book.save(tmp_path / "run.xlsx")
        with pytest.raises(InputError, match=rf"row 9: column .* holds 'oops'; expected a {wanted}"):
            excel.read_workbook(tmp_path / "run.xlsx", WHOLE)
        book["First"][cell] = kept


# ------------------------------------------------------------------------------------------- texts


@pytest.mark.parametrize("polars", [True, False])
def test_a_later_block_is_read_as_the_first_was(tmp_path, monkeypatch, polars):
    if not polars:
        monkeypatch.setattr(text, "has_extra", lambda _: False)
    monkeypatch.setattr(text, "_BLOCK", 40)
    path = tmp_path / "run.csv"
    rows = [f"10:00:{k:02d};{k}.5;w{k};{k}" for k in range(12)]
    layout, names = Layout("text", ";", ".", 1), ("at", "F", "word", "x")
    path.write_text("\n".join([";".join(names), *rows, ""]))
    begin = len(";".join(names)) + 1
    table = parse_rows(path, begin, names, layout)
    assert table.columns["at"].tolist() == list(range(12))
    assert table.columns["F"].tolist() == [k + 0.5 for k in range(12)]
    assert table.texts["word"] == [f"w{k}" for k in range(12)]
    for cell, line, wanted in (("noon", 11, "time"), ("x.5", 12, "number")):
        wrong = list(rows)
        wrong[line - 2] = f"{cell};9.5;w9;9" if wanted == "time" else f"10:00:10;{cell};w10;10"
        path.write_text("\n".join([";".join(names), *wrong, ""]))
        with pytest.raises(InputError, match=rf"line {line}: .* holds '{cell}' \(1 such cells\).*a {wanted}"):
            parse_rows(path, begin, names, layout)


def test_acquisitions_of_an_mts_text_are_rows_between_lines_of_words(tmp_path):
    path = tmp_path / "run.dat"
    named = ["Time\tForce\tState", "s\tN\t"]
    lines = ["MTS793|MPT|ENU|1|2|.", "Data Acquisition\t1", *named, "0\t1\tup", "", "nan\t2\tup"]
    lines += ["Erfassung\t2", *named, ".5\t3\tdown", "1\t4\tup"]
    path.write_text("\n".join(lines))
    table = read_mts(path, WHOLE)
    assert table.columns["Force [N]"].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert table.texts["State"] == ["up", "up", "down", "up"]
    assert table.texts["acquisition"] == [lines[1], None, lines[7], None]
    for broken, fault in (
        ([*lines[:8], "Time\tForce\tValve", *lines[9:]], "line 10: the columns Time"),
        ([*lines[:10], "0\t3\t7", "1\t4\t8"], "line 10: column 'State' holds numbers in one"),
        (["MTS793|MPT|ENU|1|2", *lines[1:]], "line 1 is"),
        (lines[:4], "without a row of numbers"),
    ):
        path.write_text("\n".join(broken))
        with pytest.raises(InputError, match=fault):
            read_mts(path, WHOLE)
