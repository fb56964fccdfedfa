"""Files that independent libraries write, and small texts written by hand: each column as it was written."""

from __future__ import annotations

import json
import zipfile
from contextlib import nullcontext
from datetime import timedelta
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest
from mrdamper.data.formats.decoder import READERS
from mrdamper.runtime.worker import WorkerEndedError
from nptdms import ChannelObject, TdmsWriter
from openpyxl import Workbook
from openpyxl.utils import get_column_letter

from mrdamper.data.formats import excel, hdf5, mat, objects, sandbox, text
from mrdamper.data.formats.logger import read_logger
from mrdamper.data.formats.lvm import read_lvm
from mrdamper.data.formats.mts import read_mts
from mrdamper.data.formats.parquet import read_parquet
from mrdamper.data.formats.table import FileOptions, Layout, distinct_names
from mrdamper.data.formats.tdms import read_tdms
from mrdamper.data.formats.text import open_text, parse_rows
from mrdamper.errors import InputError

WHOLE = FileOptions()
SQUARE = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])


def columns(table) -> dict[str, list[float]]:
    return {name: table.columns[name].tolist() for name in table.columns}


# ------------------------------------------------------------------------------------------- the decoder


class Crashing:
    """A worker whose processes end at the first question, so many of them."""

    def __init__(self, pid: int | None, crashes: int) -> None:
        self.pid, self.crashes, self.asked = pid, crashes, 0

    def ask(self, *_: object, **__: object) -> Any:
        self.asked += 1
        if self.asked <= self.crashes:
            self.pid = None
            raise WorkerEndedError(-11)
        return type("Answer", (), {"value": {"rows": 1}})()


@pytest.mark.parametrize(
    ("pid", "crashes", "asked", "read"),
    [(7, 0, 1, True), (7, 1, 2, True), (7, 2, 2, False), (None, 1, 1, False)],
)
def test_a_file_that_a_used_decoder_crashes_on_is_given_to_a_fresh_one(tmp_path, pid, crashes, asked, read):
    decoder, worker = sandbox._Decoder(), Crashing(pid, crashes)
    decoder.worker = worker  # type: ignore[assignment]
    with nullcontext() if read else pytest.raises(InputError, match="its decoder has crashed"):
        assert decoder.open(tmp_path, {}) == {"rows": 1}
    assert worker.asked == asked


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


def test_variables_are_columns_whatever_holds_them(tmp_path):
    """As NumPy, JSON and SciPy's MAT files have them."""
    deep: Any = {"F": np.arange(3.0)}
    for _ in range(9):
        deep = {"run": deep, "list": []}
    cell = np.empty(2, object)
    cell[:] = [np.arange(2.0), [np.arange(4.0)]]
    variables = {"m": SQUARE, "row": SQUARE[:1], "deep": deep, "cell": cell, "__x__": {"__y": 1.0}, "n": 4}
    variables |= {"s": {"Name": "two", "Data": SQUARE[:1, :2]}, "o": {"Name": "one", "Data": 3.0}}
    found = columns(mat.table_of_variables(variables, tmp_path, WHOLE, "MAT file"))
    assert [found[f"column {k} of m"] for k in (1, 2, 3)] == SQUARE.T.tolist()
    assert (found["row"], found["F"], found["n"]) == ([1.0, 2.0, 3.0], [0.0, 1.0, 2.0], [4.0])
    assert (found["cell(1)"], found["cell(2)(1)"]) == ([0.0, 1.0], [0.0, 1.0, 2.0, 3.0])
    assert (found["two"], found["Data"]) == ([1.0, 2.0], [3.0])
    wide = {"m": np.zeros((64, 65)), "n": np.zeros((65, 66))}
    assert len(mat.table_of_variables(wide, tmp_path, WHOLE, "MAT file").names) == 64


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


def test_an_archive_of_arrays_is_told_from_others(tmp_path):
    np.savez(tmp_path / "run.npz", F=np.arange(3.0))
    with zipfile.ZipFile(tmp_path / "run.zip", "w") as archive:
        archive.writestr("run.csv", "1")
    heads = [(tmp_path / name).read_bytes()[:512] for name in ("run.npz", "run.zip")]
    assert [*map(objects.is_npz, (*heads, b"about run.npy"))] == [True, False, False]


# --------------------------------------------------------------------------------------- MDF, TDMS, Parquet


def test_groups_of_an_mdf_file_that_share_a_clock_or_one_name_are_one_table(tmp_path):
    from asammdf import MDF, Signal

    slow, fast = np.arange(3.0), 0.5 * np.arange(5.0)
    with MDF() as file:
        for clock, names in ((slow, "Fx"), (fast, "F"), (slow, "I"), (np.array([4.0]), "T")):
            file.append([Signal(clock + k, clock, name=name, unit="N") for k, name in enumerate(names)])
        file.save(tmp_path / "run.mf4")
    table = READERS["mdf"](tmp_path / "run.mf4", WHOLE)
    assert table.more == ()
    kept = {name.split("/")[-1].split(" ")[0] for name in table.names}
    assert (kept, table.rows, len(table.names)) == ({"time", "F", "x", "I", "T"}, 5, 8)
    assert sorted(map(len, table.columns.values())) == [1, 1, 3, 3, 3, 3, 5, 5]
    assert [*table.columns["x"], *table.columns["T"]] == [1.0, 2.0, 3.0, 4.0]


def test_a_recording_that_was_cut_off_is_what_all_channels_hold(tmp_path):
    path, channel = tmp_path / "run.tdms", np.arange(40.0)
    with TdmsWriter(path) as writer:
        for _ in range(2):
            writer.write_segment([ChannelObject("rig", "F", channel), ChannelObject("rig", "x", -channel)])
    whole = path.read_bytes()
    path.write_bytes(whole[:-8])
    table = read_tdms(path, WHOLE)
    assert (table.names, table.layout.notes) == (("F", "x"), ("cut off while recording",))
    assert np.array_equal(table.columns["F"][:40], channel)
    path.write_bytes(whole[: len(whole) // 2 - 8 * 41])  # before the first sample of x
    with pytest.raises(InputError, match="cut off before the first sample of"):
        read_tdms(path, WHOLE)


def test_a_parquet_file_is_itself_whatever_its_name(tmp_path):
    for name in ("run[1].parquet", "run*.parquet", "run1.parquet"):
        pl.DataFrame({name: [1.0], "note": ["a"]}).write_parquet(tmp_path / name)
    for name in ("run[1].parquet", "run*.parquet"):
        table = read_parquet(tmp_path / name, WHOLE)
        assert (table.names, table.rows, columns(table)) == ((name, "note"), 1, {name: [1.0]})
        assert list(table.texts["note"]) == ["a"]
        assert table.read_rows is not None
        assert table.read_rows([name], 0, 2)[0].tolist() == [1.0]
    pl.DataFrame({"note": ["a"]}).write_parquet(tmp_path / "words.parquet")
    assert read_parquet(tmp_path / "words.parquet", WHOLE).rows == 0


# ------------------------------------------------------------------------------------------- workbooks


def test_columns_of_a_sheet_are_counted_as_a_spreadsheet_does():
    for number in (1, 2, 26, 27, 52, 53, 702, 703, 16_384):
        for letters in (get_column_letter(number), get_column_letter(number).lower()):
            assert excel._column_number(letters.encode()) == number


@pytest.mark.parametrize("packing", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_a_sheet_is_counted_whole_however_it_is_packed_and_cut_in_pieces(tmp_path, monkeypatch, packing):
    cells = "".join(f'<c r="{get_column_letter(k)}{k}"/>' for k in (1, 700, 40, 26, 3)) + " " * 300
    path = tmp_path / "run.xlsx"
    with zipfile.ZipFile(path, "w", packing) as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        archive.writestr("xl/worksheets/sheet1.xml", cells)
        archive.writestr("xl/other.xml", cells.replace("700", "900"))
    for piece in (41, 50, 64, 1000):
        monkeypatch.setattr(excel, "_PIECE", piece)
        monkeypatch.setattr(excel, "_MOST_CELLS", 700 * 700)
        excel._require_harmless(path)
        monkeypatch.setattr(excel, "_MOST_CELLS", 700 * 700 - 1)
        with pytest.raises(InputError, match=r"xl/worksheets/sheet1.xml spans 700 rows and 700 columns"):
            excel._require_harmless(path)
    if packing == zipfile.ZIP_DEFLATED:
        size, less = len(cells).to_bytes(4, "little"), (len(cells) - 1).to_bytes(4, "little")
        path.write_bytes(path.read_bytes().replace(size, less))
        monkeypatch.setattr(excel, "_MOST_CELLS", 700 * 700)
        with pytest.raises(InputError, match=f"sheet1.xml unpacks to more than the {len(cells) - 1} bytes"):
            excel._require_harmless(path)


@pytest.mark.parametrize(
    ("cell", "parts", "unpacked", "fault"),
    [("AF1000000", 1999, 1 << 29, ""), ("C10666667", 2, 9999, "spans 10666667 rows and 3 columns"),
     ("A1", 2000, 9999, "holds 2001 parts"), ("A1", 2, (1 << 29) + 1, "unpacks to more than 512 MB")],
)  # fmt: skip
def test_a_workbook_is_no_larger_than_security_says(tmp_path, cell, parts, unpacked, fault):
    sheet = f'<c r="{cell}"/>'
    with zipfile.ZipFile(tmp_path / "run.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", bytes(7777))
        archive.writestr("xl/worksheets/sheet1.xml", sheet)
        for k in range(parts - 1):
            archive.writestr(f"xl/{k}", b"")
    stated = (unpacked - len(sheet)).to_bytes(4, "little")  # by the directory at its end
    content = (tmp_path / "run.xlsx").read_bytes()
    at = content.rindex((7777).to_bytes(4, "little"))
    (tmp_path / "run.xlsx").write_bytes(content[:at] + stated + content[at + 4 :])
    with pytest.raises(InputError, match=fault) if fault else nullcontext():
        excel._require_harmless(tmp_path / "run.xlsx")


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
        others = open_text(path, WHOLE).read(["x"], 0, 5)  # which nobody looks at
        assert np.concatenate([part[0] for part in others]).tolist() == list(range(12))


def test_columns_without_a_name_or_of_one_name_get_their_number():
    names = ("a", "column 2", "a (3)", "column 2 (4)", "a (5)")
    assert distinct_names(["a", "", "a", "column 2", "a"]) == [*names]


@pytest.mark.parametrize(
    ("size", "step", "count", "fault"),
    [(4, "0.5", 3, ""), (4, "0.5", 4, "3 samples where its header states 4"), (4, "0", 3, "no samples after"),
     (7, "0.5", 0, "no samples after"), (0, "0.5", 0, "no samples after"), (9, "0.5", 0, "header lacks")],
)  # fmt: skip
def test_a_logger_s_header_says_where_its_rows_begin(tmp_path, size, step, count, fault):
    path = tmp_path / "run.txt"
    head = f"Header Size: {size}\nSampling Interval: {step}\nSample Count: {count}\nF, x\n"
    path.write_text(head + "1,2\n3,4\n5,6\n")
    with pytest.raises(InputError, match=fault) if fault else nullcontext():
        table = read_logger(path, WHOLE)
        assert (columns(table), table.step_s) == ({"F": [1.0, 3.0, 5.0], "x": [2.0, 4.0, 6.0]}, 0.5)


@pytest.mark.parametrize(("start", "first"), [("", 0.0), ("X0\t2.5\n", 2.5)])
def test_segments_without_a_clock_count_their_steps(tmp_path, start, first):
    end, rows = "***End_of_Header***\t\n", "X_Value\tForce\tComment\n\t1.0\t\n\t2.0\t\n"
    segment = f"Channels\t1\nDate\t2026/11/23\nTime\t10:00:{{}}\n{start}Delta_X\t0.5\n{end}{rows}"
    path = tmp_path / "run.lvm"
    path.write_text(
        "LabVIEW Measurement\t\nX_Columns\tNo\n" + end + "\n" + segment.format("00") + segment.format("07")
    )
    table = read_lvm(path, WHOLE)
    assert columns(table)["time"] == [first, first + 0.5, first + 7.0, first + 7.5]
    assert (table.names[0], table.parts, table.step_s) == ("time", (0, 2), None)


@pytest.mark.parametrize(("later", "fault"), [(0.0, None), (1e-6, "its channels have clocks of their own")])
def test_the_clocks_of_channels_must_be_one(tmp_path, later, fault):
    path = tmp_path / "run.lvm"
    rows = "".join(f"{k}.0\t1.5\t{k + later}\t2.5\t\n" for k in range(3))
    end = "***End_of_Header***\t\n"
    path.write_text(f"LabVIEW Measurement\t\n{end}\n{end}X_Value\tF\tX_Value\tx\tComment\n{rows}")
    with pytest.raises(InputError, match=fault) if fault else nullcontext():
        found = columns(read_lvm(path, WHOLE))
        assert [found[name] for name in ("time", "F", "x")] == [[0.0, 1.0, 2.0], [1.5] * 3, [2.5] * 3]


@pytest.mark.parametrize("above", ["", "t;F\n"])
def test_a_wrong_cell_has_its_line_wherever_the_blocks_of_rows_lie(tmp_path, above):
    rows = [f"{k};{k}.5" for k in range(12)]
    (tmp_path / "run.csv").write_text(above + "\n".join([*rows, "# pause", *rows[:5], "5;oops", *rows[6:]]))
    with pytest.raises(InputError, match=f"line {19 + bool(above)}: column .* holds 'oops'"):
        text.read_text(tmp_path / "run.csv", WHOLE)


def test_names_may_be_more_or_fewer_than_the_fields_of_a_row(tmp_path):
    (tmp_path / "run.csv").write_text("1;2\n3;4\n")
    for names, found in (("abc", {"a": [1, 3], "b": [2, 4]}), ("a", {"a": [1, 3]})):
        table = parse_rows(tmp_path / "run.csv", 0, names, Layout("text", ";", ".", 0))
        assert {name: values for name, values in columns(table).items() if name != "c"} == found
        assert all(np.isnan(table.columns[name]).all() for name in table.names if name == "c")


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
