"""Headers, blocks and limits of texts and waveforms, written here from their parts and taken apart again."""

from __future__ import annotations

import itertools
import struct
import zipfile
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mrdamper.data.formats.waveforms.uff import read_uff
from openpyxl import Workbook

from mrdamper.data.formats.excel import read_workbook
from mrdamper.data.formats.lines.encodings import encoding_of
from mrdamper.data.formats.lines.header import find_data, read_header
from mrdamper.data.formats.logger import read_logger
from mrdamper.data.formats.lvm import read_lvm
from mrdamper.data.formats.mts import read_mts
from mrdamper.data.formats.signals import find_signal, unit_of_field
from mrdamper.data.formats.table import (
    MOST_SAMPLES,
    FileOptions,
    Layout,
    as_column,
    parts_of,
    plain_names,
    require_held,
    require_room,
)
from mrdamper.data.formats.text import read_text
from mrdamper.data.formats.timestamps import Timestamps
from mrdamper.errors import InputError
from tests.support.examples import examples

# ------------------------------------------------------------------------------------------- headers

NAMES = {"Time": "s", "Force": "kN", "Position": "mm", "Current": "A", "Head": "degC"}
TITLES = ["Report", "MR-7", "Operator:", "(third)"]


@dataclass(frozen=True)
class Text:
    """The lines of a text, and what they say."""

    lines: list[str]
    delimiter: str
    first: int  # row
    names: tuple[str, ...]
    said: tuple[str, ...]


@st.composite
def texts(draw: st.DrawFn) -> Text:
    """Draw titles, names, and units in, under or above the names; comment signs, quotes and empty lines."""
    delimiter = draw(st.sampled_from("\t;,| "))
    names = draw(st.lists(st.sampled_from(sorted(NAMES)), min_size=2, max_size=5, unique=True))
    units = [NAMES[name] for name in names]
    said = draw(st.lists(st.sampled_from(TITLES), max_size=3, unique=True))
    where = draw(st.sampled_from(["none", "in", "under", "above", "under in brackets"]))
    sign = draw(st.sampled_from(["", "# ", "% ", "// ", "## "]))
    quote = draw(st.sampled_from(["", '"']))

    def line(cells):
        return sign + delimiter.join(f"{quote}{cell}{quote}" for cell in cells)

    rows_of = {
        "none": [names],
        "in": [[f"{name}_{unit}" for name, unit in zip(names, units, strict=True)]],
        "under": [names, units],
        "above": [units, names],
        "under in brackets": [names, [f"[{unit}]" for unit in units]],
    }[where]
    above = [*said, *[""] * draw(st.integers(0, 1)), *map(line, rows_of), *[""] * draw(st.integers(0, 2))]
    rows = [delimiter.join(f"{0.5 * k + c:.3f}" for c in range(len(names))) for k in range(12)]
    expected = (
        rows_of[0] if where in {"none", "in"} else [f"{n} [{u}]" for n, u in zip(names, units, strict=True)]
    )
    return Text([*above, *rows], delimiter, len(above), tuple(expected), tuple(said))


@given(texts())
@examples(200)
def test_names_units_and_titles_come_back_wherever_they_stand(text):
    assert find_data(text.lines) == (text.delimiter, text.first)
    assert find_data(text.lines, text.delimiter) == (text.delimiter, text.first)
    header = read_header(text.lines, text.first, text.delimiter)
    assert (header.names, header.said, header.named) == (text.names, text.said, True)


@pytest.mark.parametrize("delimiter", ["\t", ";", ",", "|"])
def test_a_row_of_commands_above_the_names_holds_for_the_columns_up_to_the_next(delimiter):
    lines = [
        delimiter.join(cells)
        for cells in (["", "0.5 A", "", "1 A", ""], ["t [s]", "x [mm]", "F [N]", "x [mm]", "F [N]"])
    ]
    rows = [delimiter.join(f"{k + c}.5" for c in range(5)) for k in range(12)]
    assert read_header([*lines, *rows], 2, delimiter).names == (
        "t [s]", "0.5 A: x [mm]", "0.5 A: F [N]", "1 A: x [mm]", "1 A: F [N]"
    )  # fmt: skip


@pytest.mark.parametrize(("rows", "taken"), [(2, False), (9, False), (10, True), (11, True)])
@pytest.mark.parametrize("delimiter", [";", "\t", ","])
def test_fewer_than_ten_rows_above_the_samples_are_a_table_of_results(rows, taken, delimiter):
    results = [delimiter.join(["1", f"{k}"]) for k in range(rows)]
    samples = [delimiter.join([f"{k}", "2", "3"]) for k in range(10)]
    lines = [delimiter.join(["peak", "mean"]), *results, "Samples", delimiter.join("txF"), *samples]
    assert find_data(lines) == (delimiter, 1 if taken else rows + 3)
    assert find_data(lines[: rows + 1])[1] == 1  # where nothing else is there


def test_a_legend_names_columns_that_say_nothing_themselves():
    rows = [f"{k};{k}.5;7" for k in range(12)]
    legend = ["CH1: time [s]", "CH-2 = force [N]", "CH3 -> current [A]"]
    found = read_header([*legend, "ch 1;ch 2;ch 3", *rows], 4, ";")
    assert found.names == ("time [s]", "force [N]", "current [A]")
    assert len(found.said) == 3
    short = read_header([legend[0], "ch 1;ch 2;ch 3", *rows], 2, ";")
    assert short.names == ("ch 1", "ch 2", "ch 3")  # of one column in three it is none


def test_a_table_of_one_row_above_the_samples_is_settings():
    lines = [
        "Coil current;Oil",
        "A;degC",
        "0.5;40",
        "",
        "Time;Force",
        "s;N",
        *(f"{k};{k}.5" for k in range(12)),
    ]
    found = read_header(lines, 6, ";")
    assert found.names == ("Time [s]", "Force [N]")
    assert {"Coil current: 0.5 A", "Oil: 40 degC"} <= set(found.said)


def test_no_row_of_names_is_told():
    found = read_header(["Damper 7", *(f"{k};{k}.5" for k in range(12))], 1, ";")
    assert (found.names, found.named, found.said) == (("column 1", "column 2"), False, ("Damper 7",))


# ------------------------------------------------------------------------------------------- texts


def test_rows_begin_within_four_hundred_lines(tmp_path):
    rows = "".join(f"{k};{k}.5\n" for k in range(12))
    for above, found in ((386, 388), (397, 399), (398, None)):
        (tmp_path / "run.csv").write_text("note\n" * above + "t;x\n\n" + rows)
        book = Workbook()
        for line in ["note"] * (above + 2):
            book["Sheet"].append([line])
        for k in range(12):
            book["Sheet"].append([k, k + 0.5])
        book.save(tmp_path / "run.xlsx")
        with nullcontext() if found else pytest.raises(InputError, match="no sheet with rows of numbers"):
            assert read_workbook(tmp_path / "run.xlsx", FileOptions()).rows == 12
        if found is None:
            with pytest.raises(InputError, match="no rows of numbers in the first 400 lines"):
                read_text(tmp_path / "run.csv", FileOptions())
        else:
            table = read_text(tmp_path / "run.csv", FileOptions())
            assert (table.layout.header_lines, table.rows) == (found, 12)


@pytest.mark.parametrize("rows", [9, 10])
@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize("below", [0, 1, 2])
def test_blocks_of_ten_rows_follow_each_other_and_shorter_ones_are_none(tmp_path, rows, header, below):
    """Each with its own names where it has some, else with those of the one before."""
    first = [f"{k};{k}.5" for k in range(12)]
    second = [f"{k};{2 * k}.25" for k in range(rows)]
    lines = ["t [s];x [mm]", *first, "Run 2", *(["t [s];F [N]"] if header else []), *second]
    lines += ["End of the record", "Good bye"][:below]
    (tmp_path / "run.csv").write_text("\n".join([*lines, ""]))
    table = read_text(tmp_path / "run.csv", FileOptions())
    assert table.columns["x [mm]"].tolist() == [k + 0.5 for k in range(12)]
    assert len(table.following) == (rows > 9)
    notes = " ".join(table.layout.notes)
    assert ("2 blocks of rows" in notes) == (rows > 9)
    said = {0: "", 1: "1 line of words below the rows", 2: "2 lines of words below the rows"}[below]
    assert said in notes
    for other in table.following:
        name = "F [N]" if header else "x [mm]"
        assert other.names == ("t [s]", name)
        assert other.columns[name].tolist() == [2 * k + 0.25 for k in range(rows)]
        assert "Run 2" in other.said
        assert other.layout.header_lines == 14 + header


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("last", [True, False])
def test_a_mark_of_utf8_line_ends_and_a_last_line_without_one_cost_no_sample(tmp_path, ends, marked, last):
    rows = ["t;x", *(f"{k};{k}.5" for k in range(12))]
    content = ends.join(rows) + (ends if last else "")
    (tmp_path / "run.csv").write_bytes((b"\xef\xbb\xbf" if marked else b"") + content.encode())
    table = read_text(tmp_path / "run.csv", FileOptions())
    assert table.names == ("t", "x")
    assert table.columns["x"].tolist() == [k + 0.5 for k in range(12)]


@pytest.mark.parametrize(("letters", "allowed"), [(30, True), (31, False)])
def test_one_character_in_twenty_may_be_beyond_ascii(tmp_path, letters, allowed):
    content = (b"\xfc " * letters).ljust(600, b"1")
    if allowed:
        assert encoding_of(tmp_path / "run.csv", content) == "cp1252"
    else:
        with pytest.raises(InputError, match="byte 0 is not UTF-8"):
            encoding_of(tmp_path / "run.csv", content)


# ------------------------------------------------------------------------------------------- times of day

WALL = datetime(2026, 11, 23, 18, 0, 0)


@pytest.mark.parametrize(("back_s", "midnight"), [(43_199.0, False), (43_200.0, False), (43_201.0, True)])
def test_a_time_that_falls_by_more_than_half_a_day_has_passed_midnight(back_s, midnight):
    cells: list[str | None] = [each.strftime("%H:%M:%S") for each in (WALL, WALL - timedelta(seconds=back_s))]
    assert Timestamps().seconds(cells).tolist() == [0.0, 86_400.0 * midnight - back_s]


@given(st.lists(st.integers(0, 86_399), min_size=1, max_size=8), st.integers(0, 400))
def test_dates_count_days_in_every_order_of_their_parts(moments, days):
    at = [datetime.combine(date(2025, 1, 1), time()) + timedelta(days=days * k, seconds=s)
          for k, s in enumerate(moments)]  # fmt: skip
    for form in ("%Y-%m-%d %H:%M:%S", "%Y.%m.%d %H:%M:%S", "%d.%m.%Y %I:%M:%S %p"):
        found = Timestamps().seconds([each.strftime(form) for each in at])
        assert found.tolist() == [(each - at[0]).total_seconds() for each in at]


@pytest.mark.parametrize(
    ("cell", "seconds"),
    [("23:59:60", 86_400.0), ("23:59:61", None), ("24:00:00", None), ("00:60:00", None), ("00:59:00", 3540.0),
     ("00:00:00.123456789", 0.123456789), ("0:00:07,5 am", 7.5), ("12:00:01 am", 1.0),
     ("12:00:01 pM", 43_201.0)],
)  # fmt: skip
def test_a_minute_has_up_to_sixty_one_seconds_and_a_day_no_hour_of_its_own_at_the_end(cell, seconds):
    found = Timestamps().seconds(["00:00:00", cell])[1]
    assert np.isnan(found) if seconds is None else found == pytest.approx(seconds, abs=1e-9)


def test_a_column_of_times_may_have_empty_cells_and_nothing_else():
    found = Timestamps.in_texts([" 10:00:00 ", None, "", "10:00:02"])
    assert found is not None
    assert np.array_equal(found, [0.0, np.nan, np.nan, 2.0], equal_nan=True)
    assert Timestamps.in_texts(["10:00:00", "pause"]) is None
    assert Timestamps.in_texts(["pause", None]) is None
    assert Timestamps.in_texts(["", None]) is None


# ------------------------------------------------------------------------------------------ pieces, groups


@pytest.mark.parametrize(
    ("pause", "parts"), [(1.0, ()), (1.49, ()), (1.5, (0, 4)), (9.0, (0, 4)), (0.0, (0, 4)), (-2.0, (0, 4))]
)
def test_a_piece_goes_on_where_its_time_does_by_less_than_one_and_a_half_steps(pause, parts):
    clock = np.array([0.0, 1.0, 2.0, 3.0])
    assert parts_of(np.concatenate([clock, 3.0 + pause + clock]), [0, 4, 8]) == parts
    assert parts_of(None, [0, 4, 8]) == (0, 4)
    assert parts_of(clock, [0, 4]) == ()


# ------------------------------------------------------------------------------------------- universal files

CODES = {5: "temperature", 8: "displacement", 9: "force", 11: "velocity", 13: "force", 99: "channel"}


def data_set(values, order="", *, code=13, label="NONE", unit="N", title="NONE", clock="s", kind=1, form=2,
             start=2.0, step="2.50000D-01"):  # fmt: skip
    """Return a data set 58 over even times, as text or as bytes of single precision."""
    head = [title, "NONE", "Damper 7", "NONE", "  ", f"{kind:5d}{'':75s}"]
    head.append(
        f"{form:10d}{len(values):10d}{1:10d}  {start:13.5E}"[:30] + f"{start:13.5E}{step:>13s}{0.0:13.5E}"
    )
    rows = ((17, "Time", clock), (code, label, unit), (0, "NONE", "NONE"), (0, "NONE", "NONE"))
    head += [f"{n:10d}    0    0    0 {name:20s} {units:20s}" for n, name, units in rows]
    if order:
        data = struct.pack(f"{order}{len(values)}f", *values)
        number = f"   58b{1 + (order == '>'):6d}{2:6d}{11:12d}{len(data):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    else:
        number = "    58"
        cells = [f"{value:13.5E}" for value in values]
        data = "\n".join("".join(cells[k : k + 6]) for k in range(0, len(cells), 6)).encode() + b"\n"
    return "\n".join(["    -1", number, *head, ""]).encode() + data + b"\n    -1\n"


@pytest.mark.parametrize("order", ["", "<", ">"])
def test_a_universal_file_is_its_functions_of_time_and_nothing_else(tmp_path, order):
    """Numbers fill their width, so that no blank stands between them; labels and units fill theirs."""
    values = [[-1.25 * k - c for k in range(11)] for c in range(4)]
    label, unit = "a label of 20 letter", "a unit of 20 letters"
    other = b"    -1\n   151\nprogram\n-1.0 -1\n    -1\n"
    content = other + b"".join(
        (
            data_set(values[0], order),
            data_set([9.0, 9.0], order, kind=12),  # a spectrum
            data_set(values[1], order, code=8, label=label, unit=unit),
            other,
            data_set(values[2], order, code=5, unit="NONE", clock="NONE", start=0.0, step="5.0E-01"),
            data_set(values[3], order),  # the next recording
        )
    )
    (tmp_path / "run.unv").write_bytes(content)
    table = read_uff(tmp_path / "run.unv", FileOptions())
    assert table.names == ("time", "force", label, "time (2)", "temperature")
    for name, expected in zip(("force", label, "temperature"), values, strict=False):
        assert table.columns[name].tolist() == expected
    assert table.columns["time"].tolist() == [2.0 + 0.25 * k for k in range(11)]
    assert table.columns["time (2)"].tolist() == [0.5 * k for k in range(11)]
    assert table.units == {"time": "s", "force": "N", label: unit, "time (2)": "s"}
    assert table.clocks == {"time": 0, "force": 0, label: 0, "time (2)": 1, "temperature": 1}
    assert (table.said, table.rows) == (("Damper 7",), 11)
    (following,) = table.following
    assert following.columns["force"].tolist() == values[3]


@pytest.mark.parametrize("code", CODES)
def test_a_universal_function_without_a_name_has_that_of_its_title_or_quantity(tmp_path, code):
    for title, label, name in (
        ("NONE", "NONE", CODES[code]),
        ("Rod", "NONE", "Rod"),
        ("Rod", "Load", "Load"),
    ):
        (tmp_path / "run.unv").write_bytes(data_set([1.0], code=code, title=title, label=label))
        table = read_uff(tmp_path / "run.unv", FileOptions())
        assert table.names == ("time", name)
        assert table.columns[name].tolist() == [1.0]


@pytest.mark.parametrize("order", ["", "<"])
def test_a_universal_file_is_refused_wherever_it_is_cut(tmp_path, order):
    whole = data_set([1.0, -2.0, 3.0], order)
    end = len(whole) - len(b"\n    -1\n")
    for stop in range(20, end):
        (tmp_path / "run.unv").write_bytes(whole[:stop])
        with pytest.raises(InputError):
            read_uff(tmp_path / "run.unv", FileOptions())
    for damaged in (whole.replace(b"         3", b"        -3"), whole.replace(b"         3", b"         x"),
                    data_set([])):  # fmt: skip
        (tmp_path / "run.unv").write_bytes(damaged)
        with pytest.raises(InputError):
            read_uff(tmp_path / "run.unv", FileOptions())


# ------------------------------------------------------------------------------------------- workbooks


@given(
    above=st.integers(0, 3), left=st.integers(0, 2), words=st.integers(0, 2), units=st.booleans(),
    empty=st.sets(st.integers(1, 10), max_size=3), comma=st.booleans(),
)  # fmt: skip
@examples(15)
def test_a_sheet_is_its_table_wherever_it_stands(tmp_path_factory, above, left, words, units, empty, comma):
    """Titles above, empty columns and rows, units under the names, words below, numbers as texts."""
    path = tmp_path_factory.getbasetemp() / "spelled.xlsx"
    book = Workbook()
    notes = book.active
    assert notes is not None
    notes.append(["About", "this test"])
    sheet = book.create_sheet("Rig")
    rows = [[0.5 * k, 10.0 * k + 0.5, "valve open" if k % 2 else "valve shut"] for k in range(12)]
    named = ["Time", "Force", "State"] if units else ["Time [s]", "Force [N]", "State"]
    head: list[list[str | None]] = [["Title"] for _ in range(above)]
    head += [[*named], *([["s", "N", None]] if units else [])]
    for line in head:
        sheet.append([*[None] * left, *line])
    for k, row in enumerate(rows):
        if k in empty:
            sheet.append([])
        sheet.append([*[None] * left, row[0], f"{row[1]}".replace(".", ",") if comma else row[1], row[2]])
    for _ in range(words):
        sheet.append([*[None] * left, "end of test"])
    book.save(path)
    table = read_workbook(path, FileOptions())
    assert table.columns["Time [s]"].tolist() == [row[0] for row in rows]
    assert table.columns["Force [N]"].tolist() == [row[1] for row in rows]
    (state,) = table.texts.values()
    assert list(state) == [row[2] for row in rows]
    assert (table.rows, table.title, table.layout.part) == (12, "Rig", "Rig")
    expected = {0: (), 1: ("1 row of words below the numbers",), 2: ("2 rows of words below the numbers",)}
    assert table.layout.notes == expected[words]


def test_what_an_archive_without_a_workbook_is_said_to_be(tmp_path):
    for member, said in (("content.xml", "OpenDocument"), ("run.csv", "ZIP archive without a workbook")):
        with zipfile.ZipFile(tmp_path / "run.xlsx", "w") as archive:
            archive.writestr(member, "1")
        with pytest.raises(InputError, match=said):
            read_workbook(tmp_path / "run.xlsx", FileOptions())


# ------------------------------------------------------------------------------------------- tables


@given(st.lists(st.lists(st.sampled_from("ab"), min_size=1, max_size=3), max_size=7))
def test_channels_keep_names_of_their_own_short_where_they_can_be(paths):
    names = plain_names(paths)
    assert len(set(names)) == len(names) == len(paths)
    ends, whole = [path[-1] for path in paths], ["/".join(path) for path in paths]
    for k, name in enumerate(names):
        again = whole[:k].count(whole[k])
        if ends.count(ends[k]) == 1:
            assert name == ends[k]
        elif not again:
            assert name.removesuffix(" (2)") == whole[k]
    assert plain_names([("a",)] * 4) == ["a", "a (2)", "a (3)", "a (4)"]


def test_more_samples_than_a_file_can_unpack_to_are_refused(tmp_path):
    path = tmp_path / "run.bin"
    path.write_bytes(bytes(10))
    require_held(1290, 8, path, "force")  # 10 bytes x 1032
    require_held(0, 8, path, "force")
    for samples, size in ((1291, 8), (10_321, 1), (-1, 8)):
        with pytest.raises(InputError, match=f"'force' states {samples} samples of {size} bytes"):
            require_held(samples, size, path, "force")
    require_room(MOST_SAMPLES, path, "force")
    with pytest.raises(InputError, match="states 400000001 samples"):
        require_room(MOST_SAMPLES + 1, path, "force")


def test_moments_and_durations_are_seconds_and_numbers_are_numbers():
    moments = np.array(["2026-11-23T00:00:01.5", "2026-11-23T00:00:04"], "datetime64[ms]")
    for values, seconds in (
        (moments, [0.0, 2.5]),
        (moments - moments[0] + np.timedelta64(7, "s"), [7.0, 9.5]),
    ):
        column, unit = as_column(values)
        assert (column.tolist(), unit) == (seconds, "s")
    column, unit = as_column(np.array([[1, 2], [3, 4]], np.int16))
    assert (column.tolist(), unit) == ([1.0, 2.0, 3.0, 4.0], "")
    assert column.dtype == np.float64


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        (Layout("text", ";", ",", 1), "text, separated by semicolon, decimal comma, 1 header line"),
        (Layout("text", " ", ".", 0), "text, separated by blanks, decimal point, 0 header lines"),
        (Layout("text", "|", "", 2, notes=("a note",)), "text, separated by '|', 2 header lines, a note"),
        (Layout("book", part="Rig"), "book, part 'Rig'"),
    ],
)
def test_a_layout_is_told_in_words(layout, words):
    assert layout.in_words() == words


@pytest.mark.parametrize(
    "given_options", [{"delimiter": "x"}, {"decimal": ";"}, {"delimiter": ",", "decimal": ","}]
)
def test_a_channel_map_asks_for_signs_that_texts_have(given_options):
    with pytest.raises(InputError):
        FileOptions(**given_options)
    assert FileOptions(delimiter=",", decimal=".").delimiter == ","


@pytest.mark.parametrize(
    ("texts_of", "shapes", "found"),
    [
        ({"Name": " Force "}, {"Data": (9, 1)}, ("Force", "Data", "")),
        ({"label": "Force", "title": "Run", "Units": "kN"}, {"Values": (1, 9), "gain": (1, 1)},
         ("Force", "Values", "kN")),
        ({"Name": "Force"}, {"Data": (1, 1)}, None),  # one number is a setting
        ({"Name": "Force"}, {"Data": (9, 2)}, None),  # a matrix is a table
        ({"Name": "Force"}, {"Data": (9, 1), "time": (9, 1)}, None),  # and so are two columns
        ({"Name": "Force"}, {"Data": (9, 1), "time": (8, 1)}, ("Force", "Data", "")),
        ({"Name": ""}, {"Data": (9, 1)}, None),
        ({"Name": "Force"}, {"other": (9, 1)}, None),
    ],
)  # fmt: skip
def test_a_structure_is_one_signal_where_it_has_one_name_and_one_column(texts_of, shapes, found):
    signal = find_signal(texts_of, shapes)
    assert (None if signal is None else (signal.name, signal.field, signal.unit)) == found


def test_the_time_beside_signals_is_in_seconds():
    found = [unit_of_field(*each) for each in (("time", ["signals"]), ("time", []), ("force", ["signals"]))]
    assert found == ["s", "", ""]


# ------------------------------------------------------------------------------------------- MTS texts


CHANNELS = {"Running Time": "Sec", "Axial Force": "kN", "Axial Displacement": "mm"}
MTS_SIGNS = {"0": "  ", "1": ",", "2": "\t"}


def mts_text(*starts, order, sign):
    """Return acquisitions of 12 rows that begin at some times [s] and go on by half a second."""
    apart = MTS_SIGNS[sign]
    lines = [f"MTS793|MPT|ENU|1|{sign}|.|/|:|1|0|0|A"]
    for number, start in enumerate(starts):
        columns = {
            "Running Time": start + 0.5 * np.arange(12),
            "Axial Force": np.cos(np.arange(12)) + number,
            "Axial Displacement": np.arange(12) * (-1.0) ** number,
        }
        lines += ["", f"Data Acquisition: {number + 1}", apart.join(order)]
        lines += [apart.join(CHANNELS[name] for name in order)]
        lines += [apart.join(f"{columns[name][k]:.4f}" for name in order) for k in range(12)]
    return "\n".join([*lines, ""])


@pytest.mark.parametrize("sign", MTS_SIGNS)
@pytest.mark.parametrize("order", list(itertools.permutations(CHANNELS)))
@pytest.mark.parametrize(
    ("starts", "parts"),
    [((0.0, 6.0, 12.0), ()), ((0.0, 6.0, 3.0), (0, 24)), ((0.0, 0.0), (0, 12)), ((4.0,), ())],
)
def test_acquisitions_are_runs_where_their_time_does_not_go_on(tmp_path, order, starts, parts, sign):
    (tmp_path / "run.txt").write_text(mts_text(*starts, order=order, sign=sign))
    table = read_mts(tmp_path / "run.txt", FileOptions())
    assert (table.parts, table.rows) == (parts, 12 * len(starts))
    times = [t + 0.5 * k for t in starts for k in range(12)]
    assert table.columns["Running Time [Sec]"].tolist() == times
    if len(starts) == 1:
        assert "acquisition" not in table.texts
        return
    begun = {k: cell for k, cell in enumerate(table.texts["acquisition"]) if cell}
    assert begun == {12 * k: f"Data Acquisition: {k + 1}" for k in range(len(starts))}
    assert table.layout.notes == (f"{len(starts)} acquisitions",)


# ------------------------------------------------------------------------------------------- lines


def spoilt(lines, row, column, sign):
    """Return the lines with a word in a cell of a row of numbers."""
    cells = lines[row].split(sign)
    cells[column] = "apples"
    return [*lines[:row], sign.join(cells), *lines[row + 1 :]]


NUMBERS = [[f"{0.5 * k:.3f}", f"{k + 0.25:.3f}", f"{100 - k:.3f}"] for k in range(12)]


def of_lines(kind, above):
    """Return the lines of a text, the lines before its first row, and its sign between cells."""
    rows = [",".join(cells) for cells in NUMBERS]
    tabbed = ["\t".join(cells) for cells in NUMBERS]
    head = [f"note {k}" for k in range(above)]
    if kind == "delimited":
        return [*head, "t [s],F [N],x [mm]", *rows], above + 1, ","
    if kind == "without a header":
        return rows, 0, ","
    if kind == "logger":
        stated = [
            f"Header Size: {above + 4}",
            "Sampling Interval: 0.5",
            *(f"Note: {k}" for k in range(above)),
        ]
        return [*stated, "Sample Count: 12", "t, F, x", *rows], above + 4, ","
    if kind == "mts":
        first = ["MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", "", *head]
        return (
            [*first, "Running Time\tAxial Force\tAxial Displacement", "Sec\tN\tmm", *tabbed],
            above + 4,
            "\t",
        )
    tags = [
        "LabVIEW Measurement",
        "Separator\tTab",
        *(f"Operator\t{k}" for k in range(above)),
        END_OF_HEADER,
        "",
    ]
    names = ["Channels\t2", "X_Dimension\tTime\tTime", END_OF_HEADER, "X_Value\tF [N]\tx [mm]"]
    return [*tags, *names, *tabbed], len(tags) + 4, "\t"


END_OF_HEADER = "***End_of_Header***"


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("above", [0, 1, 3])
@pytest.mark.parametrize("kind", ["delimited", "without a header", "logger", "mts", "lvm"])
@pytest.mark.parametrize(("row", "column"), [(1, 0), (1, 1), (2, 2), (11, 1)])
def test_a_cell_that_is_no_number_is_told_with_its_line_in_the_file(tmp_path, kind, above, ends, row, column):
    lines, first, sign = of_lines(kind, above)
    path = tmp_path / "run.txt"
    path.write_bytes((ends.join(lines) + ends).encode())
    read = READERS[kind]
    table = read(path, FileOptions())
    assert (table.layout.header_lines, table.rows) == (first, 12)
    assert [column.tolist() for column in table.columns.values()] == [
        [float(cells[k]) for cells in NUMBERS] for k in range(3)
    ]
    path.write_bytes((ends.join(spoilt(lines, first + row, column, sign)) + ends).encode())
    with pytest.raises(
        InputError, match=rf"line {first + row + 1}: column .* holds 'apples' \(1 such cells\)"
    ):
        read(path, FileOptions())


READERS = {"delimited": read_text, "without a header": read_text, "logger": read_logger, "mts": read_mts,
           "lvm": read_lvm}  # fmt: skip


def test_fields_of_a_universal_file_may_fill_their_width(tmp_path):
    """Whole numbers with leading noughts, numbers and names without a blank between."""
    values = [1.5, -2.5, 3.5]
    text = data_set(values, label="L" * 20, unit="U" * 20, clock="s").decode().split("\n")
    text[7] = f"{1:05d}" + 75 * "9"
    text[8] = f"{2:010d}{3:010d}{1:010d}{-2.0:13.6E}{-0.25:13.6E}{-9.0:13.6E}"
    text[9] = f"{17:010d}{9:05d}{9:05d}{9:05d} {'T' * 20} {'s':20s}99999"
    text[10] = f"{13:010d}{9:05d}{9:05d}{9:05d} {'L' * 20} {'U' * 20}99999"
    (tmp_path / "run.unv").write_text("\n".join(text))
    table = read_uff(tmp_path / "run.unv", FileOptions())
    assert table.columns["L" * 20].tolist() == values
    assert table.columns["time"].tolist() == [-2.0, -2.25, -2.5]
    assert table.units == {"time": "s", "L" * 20: "U" * 20}
