"""How much is read, and from how many lines, letters and names on something is what it seems."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from mrdamper.data.formats.waveforms import catman, channel
from mrdamper.data.formats.waveforms.famos import read_famos
from nptdms import ChannelObject, TdmsWriter

from mrdamper.data.formats import excel, hdf5, lvm, mat, mdf, mts, objects, sandbox, text
from mrdamper.data.formats.groups import attribute_lines, is_in_part, recordings_in, units_beside
from mrdamper.data.formats.lines import encodings, header
from mrdamper.data.formats.lines.blocks import Block, find_blocks
from mrdamper.data.formats.lines.header import (
    find_data,
    holds_samples,
    read_header,
    refuse_two_commas,
)
from mrdamper.data.formats.lvm import read_lvm
from mrdamper.data.formats.table import FileOptions, Layout
from mrdamper.data.formats.tdms import read_tdms
from mrdamper.data.formats.text import open_text, parse_rows, read_head, read_text
from mrdamper.errors import InputError

MB = 1 << 20


def test_no_bytes_are_a_text_and_nothing_else():
    for is_one in (catman.is_catman, excel.is_workbook, hdf5.is_hdf5, lvm.is_lvm, mat.is_mat, mdf.is_mdf,
                   mts.is_mts, objects.is_json, objects.is_npz):  # fmt: skip
        assert not is_one(b"")
    assert text.is_text(b"")


@pytest.mark.parametrize(
    ("identity", "begin", "comment", "is_one"),
    [
        (5009, 201, 0, True),
        (5029, 201, 200, True),
        (5008, 201, 0, False),
        (5030, 201, 0, False),
        (5009, 200, 0, False),
        (5009, 201, 201, False),
        (5009, 201, -1, False),
    ],
)
def test_a_catman_file_is_told_by_its_first_eight_bytes(identity, begin, comment, is_one):
    head = struct.pack("<hih", identity, begin, comment)
    assert catman.is_catman(head) == is_one
    assert not catman.is_catman(head[:7])


@pytest.mark.parametrize(("step", "known"), [("0.5", 0.5), ("0.0", None), ("-0.5", None), ("inf", None)])
def test_a_clock_that_is_not_written_has_a_step_above_nothing(tmp_path, step, known):
    path = tmp_path / "run.lvm"
    end = "***End_of_Header***\t"
    tags = f"Separator\tTab\nX_Columns\tNo\n{end}\n\nChannels\t2\nDelta_X\t{step}\n{end}\n"
    rows = "".join(f"\t{k}.5\t{k}\t\n" for k in range(12))
    path.write_text(f"LabVIEW Measurement\t\n{tags}X_Value\tForce\tShift\tComment\n{rows}")
    found = read_lvm(path, FileOptions())
    assert (found.step_s, found.rows) == (known, 12)
    assert found.names[:2] == ("Force", "Shift")


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"|CF,2,1,1;", "no channels of numbers"),
        (b"|CF,2,1,1", "was cut off"),
        (b"|CF,2,1,1;|CK,1,3", "was cut off"),
        (b"|CF,2,1,1;|CK,1,x,1;" + 99 * b" ", r"damaged FAMOS file \(at byte 10\)"),
        (b"|CF,2,1,1;|CK,x,3,1,1;" + 99 * b" ", r"damaged FAMOS file \(at byte 10\)"),
        (b"|CF,2,1,1;|CK,1,3,1,1|" + 99 * b" ", r"damaged FAMOS file \(at byte 10\)"),
        (b"|CF,2,1,2;", "samples in another byte order"),
    ],
)
def test_a_famos_key_has_a_name_a_version_and_a_length(tmp_path, content, fault):
    (tmp_path / "run.raw").write_bytes(content)
    with pytest.raises(InputError, match=fault):
        read_famos(tmp_path / "run.raw", FileOptions())


@pytest.mark.parametrize(("size", "seconds"), [(None, 60.0), (0, 60.0), (10**6, 61.0), (10**10, 600.0)])
def test_a_decoder_has_a_second_more_for_each_megabyte(tmp_path, size, seconds):
    path = tmp_path / "run.mat"
    if size is not None:
        with path.open("wb") as stream:
            stream.truncate(size)
    assert sandbox._deadline_s(path) == seconds


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_a_wide_text_and_a_waveform_are_held_whole_up_to_a_size(tmp_path, monkeypatch, encoding):
    path = tmp_path / "run.txt"
    path.write_bytes("t;F\n1;2\n3;4\n5;6\n".encode(encoding))
    size = path.stat().st_size
    for module in (encodings, channel):
        monkeypatch.setattr(module, "MOST_WHOLE", size)
    with encodings.open_text_bytes(path) as stream:
        assert stream.read() == b"t;F\n1;2\n3;4\n5;6\n"
    assert len(channel.read_bytes(path, "file")) == size
    for module in (encodings, channel):
        monkeypatch.setattr(module, "MOST_WHOLE", size - 1)
    with pytest.raises(InputError, match="UTF-16 of more than 0 MB"):
        encodings.open_text_bytes(path)
    with pytest.raises(InputError, match="a file of more than 0 MB"):
        channel.read_bytes(path, "file")


def test_a_text_is_looked_through_for_blocks_up_to_a_size(tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    rows = "".join(f"{k};{k}\n" for k in range(12))
    path.write_text(f"t [s];F [N]\n{rows}# below\nx [mm];F [N]\n{rows}")
    monkeypatch.setattr(text, "MOST_WHOLE", path.stat().st_size)
    assert len(read_text(path, FileOptions()).following) == 1
    monkeypatch.setattr(text, "MOST_WHOLE", path.stat().st_size - 1)
    with pytest.raises(InputError, match="column 't \\[s\\]' holds 'x \\[mm\\]'"):
        read_text(path, FileOptions())


# ------------------------------------------------------------------------------------------- letters


@pytest.mark.parametrize(
    ("zeros", "others", "found"), [(19, 0, "le"), (18, 0, ""), (20, 5, "le"), (20, 6, "")]
)
def test_nine_tenths_of_every_other_byte_are_zero_in_sixteen_bits(zeros, others, found):
    """Of twenty: letters of another page of Unicode have none, and zeros elsewhere are no text."""
    second = bytes([0] * zeros + [4] * (20 - zeros))
    first = bytes([0] * others + [65] * (20 - others))
    little = b"".join(bytes(pair) for pair in zip(first, second, strict=True))
    big = b"".join(bytes(pair) for pair in zip(second, first, strict=True))
    assert encodings.utf16_of(little) == (f"utf-16-{found}" if found else "")
    assert encodings.utf16_of(big) == ("utf-16-be" if found else "")


@pytest.mark.parametrize(
    ("letters", "encoding"), [("力", "cp1252"), ("力力", "gb18030"), ("力力力", "gb18030")]
)
def test_a_script_of_the_east_has_two_pairs_of_bytes(tmp_path, letters, encoding):
    content = (letters + "\n" + "1;2\n" * 60).encode("gb2312")
    assert encodings.encoding_of(tmp_path, content) == encoding


@pytest.mark.parametrize("letter", ["€", "ÿ"])
def test_letters_beyond_ascii_begin_at_128_and_end_at_255(tmp_path, letter):
    for count, fits in ((5, True), (6, False)):
        content = (f"{letter} " * count + "1" * (100 - 2 * count)).encode("cp1252")
        if fits:
            assert encodings.encoding_of(tmp_path, content) == "cp1252"
        else:
            with pytest.raises(InputError, match=f"byte 0 is not UTF-8 text \\(0x{content[0]:02x}\\)"):
                encodings.encoding_of(tmp_path, content)


# ------------------------------------------------------------------------------------------- rows


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        ([], (",", None)),
        (["1"], (",", None)),
        (["1;2"], (";", 0)),  # a row that stands alone is the last line
        (["1;2", "words"], (",", None)),
        (["1;words"], (",", None)),
        (["t;F", "1;2", "3;4", "words"], (";", 1)),
        (["1;2", "", "3;4"], (";", 2)),
        (["1;2", "3;4"], (";", 0)),
        (["t;F", "1;2", "# 3;4", "5;6", "7;8"], (";", 3)),
        (["s;1;2", "1;2;3", "4;5;6"], (";", 0)),
        (["s;1;2", "N;2;3"], (";", 0)),
        (["word;1;2", "word;2;3"], (";", 0)),
        (["s;mm;1;2", "a;b;2;3", "a;b;4;5"], (";", 1)),  # units, and settings behind them
        (["1,2,3,4"] * 3 + [""] + ["1;2", ""] * 10, (";", 4)),  # ten rows go before three longer ones
        (["1,2,3,4"] * 3 + [""] + ["1;2", ""] * 9, (",", 0)),
        (["1 2;3 4"] * 12, (" ", 0)),  # its fields are "1 2" and "3 4", or two numbers and "2;3"
        (["1|2,3|4"] * 2, ("|", 0)),
    ],
)
def test_rows_begin_where_two_lines_hold_two_numbers(lines, found):
    assert find_data(lines) == found
    assert find_data(lines, found[0]) == found


@pytest.mark.parametrize(("rows", "samples"), [(9, False), (10, True)])
def test_ten_rows_are_samples(rows, samples):
    assert holds_samples(["t;F", *["1;2", ""] * rows], ";") == samples


def test_what_stands_above_a_table_is_its_last_lines():
    rows = [f"{k};{k}" for k in range(12)]
    above = [f"line {k} {'x' * 400}" for k in range(70)]
    said = read_header([*above, "t;F", *rows], 71, ";").said
    assert (len(said), {len(each) for each in said}) == (64, {300})
    assert (said[0][:7], said[-1][:7]) == ("line 6 ", "line 69")
    assert (header._MOST_LINES, header._LONGEST_LINE) == (64, 300)


@pytest.mark.parametrize(
    ("above", "row", "names", "said"),
    [
        (["a;b"], "1;2;", ("a", "b", ""), ()),  # a last column that is empty
        (["0.5 A;;", "t;x;F"], "1;2;3", ("t", "x", "F"), ("0.5 A",)),
        (["0.5 A;;1 A", "t;x;F"], "1;2;3", ("0.5 A: t", "0.5 A: x", "1 A: F"), ()),
        (["CH1: time", "CH2: force", "ch1;ch2;ch3;ch4"], "1;2;3;4", ("ch1", "ch2", "ch3", "ch4"),
         ("CH1: time", "CH2: force")),  # a legend of half of the columns
        (["CH1: t", "CH2: F", "CH3: x", "ch1;ch2;ch3;ch4"], "1;2;3;4", ("t", "F", "x", "ch4"),
         ("CH1: t", "CH2: F", "CH3: x")),
        (["# columns: time [s], force [N], x [mm]"], "1 2 3", ("time [s]", "force [N]", "x [mm]"), ()),
        (["# time force x"], "1 2 3", ("time", "force", "x"), ()),
        (["# names: time | force | x"], "1 2 3", ("time", "force", "x"), ()),
        (["Time (s) Force (N)"], "1 2", ("Time (s)", "Force (N)"), ()),
        (["Time in s   Force in N"], "1 2", ("Time in s", "Force in N"), ()),
        (["Sequence;Force;Increment", "s;N;0.005"], "1;2;3", ("Sequence [s]", "Force [N]", "Increment"),
         ("Increment: 0.005 s",)),
        (["Title", "t;x;F", "", "Data:"], "1;2;3", ("t", "x", "F"), ("Title", "Data:")),
        (["t;x;F", "words here"], "1;2;3", ("column 1", "column 2", "column 3"), ("t x F", "words here")),
        (["-;mm;", "t;x;F"], "1;2;3", ("t [-]", "x [mm]", "F"), ()),
        (["s;mm;N", "mm;N;A"], "1;2;3", ("s [mm]", "mm [N]", "N [A]"), ()),  # the units are the lower ones
        (["t;x;F", "s;word;other"], "1;2;3", ("s", "word", "other"), ("t x F",)),
        (["Names: t;x;F", "Units: s;mm;N"], "1;2;3", ("t [s]", "x [mm]", "F [N]"), ()),
        (["Names: t;x;F"], "1;2;3", ("Names: t", "x", "F"), ()),
        (["Note: 5", "Current_A=0.5", "Gain : 2.5", "t;x;F"], "1;2;3", ("t", "x", "F"),
         ("Note: 5", "Current_A: 0.5 A", "Gain: 2.5")),
        ([";;"], "1;2;3", ("column 1", "column 2", "column 3"), ()),
    ],
)  # fmt: skip
def test_what_stands_above_the_rows_names_them(above, row, names, said):
    found = read_header([*above, *[row] * 12], len(above), " " if ";" not in row else ";")
    assert (found.names, found.said) == (names, said)
    assert found.named == (names[0] != "column 1")


def test_commas_between_columns_and_decimals_are_told_by_whole_numbers_beyond_the_names(tmp_path):
    refuse_two_commas(tmp_path, ["a,b,c,d", "1,2,3,4"], 1, ",")
    refuse_two_commas(tmp_path, ["a", "1,2,3,4"], 1, ",")  # a title
    refuse_two_commas(tmp_path, ["a,b", "1,2.5,3,4"], 1, ",")
    refuse_two_commas(tmp_path, ["a;b", "1;2;3;4"], 1, ";")
    refuse_two_commas(tmp_path, ["1,2", "1,2,3,4"], 1, ",")
    with pytest.raises(InputError, match="2 names and 4 fields in line 3: commas"):
        refuse_two_commas(tmp_path, ["a,b", "", "1,2,3,4"], 2, ",")
    refuse_two_commas(tmp_path, ["a;b", '"1,234";5'], 1, ";")
    with pytest.raises(InputError, match=r'columns and thousands \("-1,234\.5"\)'):
        refuse_two_commas(tmp_path, ["a,b", '"-1,234.5",2'], 1, ",")
    with pytest.raises(InputError, match="2 names and 3 fields in line 2: commas"):
        refuse_two_commas(tmp_path, ["a,b", "1,2,3"], 1, ",")


# ------------------------------------------------------------------------------------------- blocks


def blocks_of(lines, delimiter=";"):
    """Return lines, rows and headers of the blocks below a first line, and the trailer."""
    content = "\n".join(["head", *lines]) + "\n"
    starts = np.cumsum([0, *(len(line) + 1 for line in ["head", *lines])]).tolist()
    blocks, trailer = find_blocks(content.encode(), starts[1], 1, delimiter, "utf-8")
    for each in blocks:
        assert isinstance(each, Block)
        assert starts[each.first_line] == each.start
        assert ["head", *lines][each.first_line] == each.first_row
    return [(b.first_line, starts.index(b.stop), b.rows, b.above) for b in blocks], trailer


@pytest.mark.parametrize(
    ("lines", "blocks", "trailer"),
    [
        (["1;2", "3;4"], [(1, 3, 2, ())], 0),
        (["1;2", "", ";", "3;4"], [(1, 5, 2, ())], 0),
        (["1;2", "end", "of it"], [(1, 2, 1, ())], 2),
        (["1;2", "# note", "3;4"], [(1, 2, 1, ()), (3, 4, 1, ("# note",))], 0),
        (["1;2", "t;F", "s;N", "3;4", "5;6"], [(1, 2, 1, ()), (4, 6, 2, ("t;F", "s;N"))], 0),
        (["1;2", "bad;4", "5;6", "7;8"], [(1, 5, 4, ())], 0),  # a cell that is none among numbers
        (["1;2", "bad;4", "worse;5", "7;8"], [(1, 5, 4, ())], 0),
        (["1;2", "3;bad", "5;6"], [(1, 4, 3, ())], 0),
        (["1;2", "mean;4", "sum;5"], [(1, 2, 1, ())], 2),  # below the rows
        (["1;2", "mean;4", "words", "1;2"], [(1, 2, 1, ()), (4, 5, 1, ("mean;4", "words"))], 0),
        (["1;2", "-;-", "NA;4", "5;6"], [(1, 5, 4, ())], 0),  # no value
        (["1;2", "words;-", "5;6"], [(1, 2, 1, ()), (3, 4, 1, ("words;-",))], 0),
        (["1;2", "words", "name;5;6", "-;7;8", "9;1"],
         [(1, 2, 1, ()), (4, 6, 2, ("words", "name;5;6"))], 0),
        (["1;2", "words", "10:15:02;5;6"], [(1, 2, 1, ()), (3, 4, 1, ("words",))], 0),
        (["1;2", "words", "5", "6;7"], [(1, 2, 1, ()), (4, 5, 1, ("words", "5"))], 0),
        (["x;1;2", "x;3;4", "y;5;6"], [(1, 4, 3, ())], 0),
    ],
)  # fmt: skip
def test_lines_of_words_part_the_rows_of_a_text(lines, blocks, trailer):
    assert blocks_of(lines) == (blocks, trailer)


@pytest.mark.parametrize("polars", [True, False])
@pytest.mark.parametrize(("words", "numeric"), [(4, True), (5, True), (6, False)])
def test_a_column_is_numbers_where_half_of_its_filled_cells_are(
    tmp_path, monkeypatch, polars, words, numeric
):
    if not polars:
        monkeypatch.setattr(text, "has_extra", lambda _: False)
    path = tmp_path / "run.csv"
    cells = ["word" * 20] * words + ["1.5"] * (10 - words) + ["", "NA"]
    path.write_text("".join(f"{k};{cell}\n" for k, cell in enumerate(cells)))
    layout = Layout("text", ";", ".", 0)
    if not numeric:
        found = parse_rows(path, 0, ("a", "b"), layout)
        assert found.texts["b"][-2:] == [None, "NA"]
        assert found.rows == 12
        return
    with pytest.raises(InputError) as told:
        parse_rows(path, 0, ("a", "b"), layout)
    shown = ("word" * 20)[:40]
    assert f"line 1: column 'b' holds '{shown}' ({words} such cells); expected a number" in str(told.value)


@pytest.mark.parametrize("polars", [True, False])
@pytest.mark.parametrize(("times", "told"), [(4, None), (5, "a time"), (10, "")])
def test_a_column_is_times_where_half_of_its_cells_are(tmp_path, monkeypatch, polars, times, told):
    if not polars:
        monkeypatch.setattr(text, "has_extra", lambda _: False)
    path = tmp_path / "run.csv"
    cells = [f"10:00:0{k}" for k in range(times)] + ["never"] * (10 - times)
    path.write_text("".join(f"{cell};{k}\n" for k, cell in enumerate(cells)))
    if told:
        with pytest.raises(InputError, match=rf"line {times + 1}: .*'never' \({10 - times} such.*{told}"):
            parse_rows(path, 0, ("a", "b"), Layout("text", ";", ".", 0))
        return
    found = parse_rows(path, 0, ("a", "b"), Layout("text", ";", ".", 0))
    assert set(found.texts) == ({"a"} if told is None else set())
    if told == "":
        assert found.columns["a"].tolist() == list(range(10))
        assert (dict(found.units), set(found.stamps)) == ({"a": "s"}, {"a"})


def test_a_head_ends_at_its_last_whole_line(tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    monkeypatch.setattr(text, "_HEAD_BYTES", 12)
    for content, lines, starts in (
        (b"1;2\n3;4\n", ("1;2", "3;4"), (0, 4, 8)),
        (b"1;2\n3;4", ("1;2", "3;4"), (0, 4, 7)),
        (b"1;2\r\n3;4\r\n5;", ("1;2", "3;4"), (0, 5, 10)),  # as long as is looked at: what follows is unknown
        (b"1;2\r\n3;4\r\n5", ("1;2", "3;4", "5"), (0, 5, 10, 11)),
        (b"\xef\xbb\xbf1;2\n3;4\n", ("1;2", "3;4"), (3, 7, 11)),
    ):
        path.write_bytes(content)
        found = read_head(path)
        assert (found.lines, found.starts) == (lines, starts)
    path.write_bytes(b"1" * 12)
    with pytest.raises(InputError, match="the first line has more than 12 bytes"):
        read_head(path)
    path.write_bytes(b"1;2\r3;4\r")
    with pytest.raises(InputError, match="lines end in CR alone"):
        read_head(path)
    path.write_bytes(b"1;2\r")
    assert read_head(path).lines == ("1;2",)


# ------------------------------------------------------------------------------------------- machines


@pytest.mark.parametrize(("tags", "fits"), [(200, True), (201, False)])
def test_the_header_of_a_later_segment_has_two_hundred_lines(tmp_path, tags, fits):
    path = tmp_path / "run.lvm"
    end, rows = "***End_of_Header***\t", "X_Value\tForce\tComment\n0.0\t1.0\t\n0.5\t2.0\t\n"
    more = "".join(f"Tag{k}\t1\n" for k in range(tags - 1))
    first = f"LabVIEW Measurement\t\nSeparator\tTab\n{end}\n\nChannels\t1\n{end}\n{rows}"
    path.write_text(f"{first}Channels\t1\n{more}{end}\n{rows}")
    if fits:
        assert read_lvm(path, FileOptions()).rows == 4
    else:
        with pytest.raises(InputError, match=r"line 210: the header of a segment does not end"):
            read_lvm(path, FileOptions())


def test_a_later_segment_whose_clock_begins_anew_goes_on_at_its_time_of_day(tmp_path):
    path = tmp_path / "run.lvm"
    end, rows = "***End_of_Header***\t", "X_Value\tForce\tComment\n0.0\t1.0\t\n0.5\t2.0\t\n"

    def segment(clock):
        return f"Channels\t1\nDate\t2026/11/21\nTime\t{clock}\n{end}\n{rows}"

    first = f"LabVIEW Measurement\t\nSeparator\tTab\n{end}\n\n"
    path.write_text(first + segment("10:15:02.5") + segment("10:15:12") + segment("10:15:13.5000009999"))
    found = read_lvm(path, FileOptions())
    assert found.columns["time"].tolist() == pytest.approx([0.0, 0.5, 9.5, 10.0, 11.0, 11.5])
    assert (found.parts, found.rows, found.layout.notes) == ((0, 2, 4), 6, ("3 segments",))


def test_a_text_is_given_some_rows_at_a_time_with_its_words_and_clocks(tmp_path, monkeypatch):
    monkeypatch.setattr(text, "_BLOCK", 60)
    path = tmp_path / "run.csv"
    path.write_text("at;word;F;x\n" + "".join(f"10:00:{k:02d};up;{k}.5;{-k}\n" for k in range(20)))
    found = open_text(path, FileOptions())
    assert (found.table.names, dict(found.table.texts)) == (("at", "word", "F", "x"), {"word": []})
    assert (set(found.table.columns), found.table.rows) == ({"at", "F", "x"}, 0)
    assert (dict(found.table.units), set(found.table.stamps)) == ({"at": "s"}, {"at"})
    for start in (0, 1, 3, 4, 7, 19):
        parts = list(found.read(("x", "at"), start, 5))
        assert np.concatenate([part[0] for part in parts]).tolist() == [-k for k in range(start, 20)]
        assert np.concatenate([part[1] for part in parts]).tolist() == list(range(start, 20))
    assert len(list(found.read(("F",), 0, 5))) > 2


def test_groups_of_other_channels_have_no_title(tmp_path):
    path = tmp_path / "run.tdms"
    with TdmsWriter(path) as writer:
        names = (("a", "F"), ("b", "x"))
        writer.write_segment([ChannelObject(group, name, np.arange(3.0)) for group, name in names])
    assert (read_tdms(path, FileOptions()).names, read_tdms(path, FileOptions()).title) == (("F", "x"), "")
    assert (read_tdms(path, FileOptions(part="b")).names, read_tdms(path, FileOptions(part="b")).title) == (
        ("x",), "b"
    )  # fmt: skip


def test_values_of_a_decoder_are_not_written_to():
    values = sandbox._values(memoryview(np.arange(3.0).tobytes()))
    assert (values.tolist(), values.flags.writeable) == ([0.0, 1.0, 2.0], False)
    assert not sandbox._values(memoryview(bytearray(24))).flags.writeable


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (["mean", 1.0], True),  # the first column of numbers holds a word
        (["'7", 1.0], False),
        (["NA", "NA"], False),  # which say that there is no number
        (["NA", 2.0], False),
        (["", "x"], True),  # no column of numbers holds one
        (["7", "x"], False),
        ([None, "2,5"], False),
        ([None, None], True),
        ([1.0, "x"], False),
    ],
)
def test_a_row_of_words_below_a_sheet_s_numbers_is_told(row, words):
    assert excel._is_of_words(row, {0: None, 1: None}, ",") == words
    assert not excel._is_of_words(row, {}, ",")
    assert excel._is_of_words(["x", *row], {1: None, 2: None}, ",") == words


# ------------------------------------------------------------------------------------------- groups


def test_attributes_are_lines_with_the_units_beside_them():
    given = {
        "Coil current": 0.5,
        "Coil current_unit": "A",
        "Oil": b"40",
        "Oil_units": b"degC",
        "Current_A": "on",
        "Damper": "7",
        "Damper_unit": 3,
    }
    assert attribute_lines(given)[::2] == (
        "Coil current: 0.5 A", "Oil: 40 degC", "Current_A: on", "Damper_unit: 3"
    )  # fmt: skip
    many = attribute_lines({f"{k}": "x" * 300 for k in range(70)})
    assert (len(many), {len(each) for each in many}) == (64, {200})


@pytest.mark.parametrize(
    ("paths", "groups"),
    [
        ((), ()),
        (("t", "F"), ()),
        (("a/t", "a/F", "b/t", "b/F", "c"), ("a", "b")),
        (("a/t", "a/F", "b/t", "b/x"), ()),
        (("a", "a/x", "b", "b/x"), ()),
        (("m/a/t", "m/a/F", "m/b/t", "m/b/F", "m/c/t"), ("m/a", "m/b")),
        (("a/r/t", "a/r/F", "b/r/t", "b/r/F", "b/s/t", "b/s/F"), ("a", "b")),
    ],
)
def test_groups_are_alike_by_two_names(paths, groups):
    assert recordings_in([tuple(path.split("/")) for path in paths]) == groups


def test_a_channel_lies_in_its_groups_and_not_in_itself():
    path = ("a", "b", "c")
    parts = ("", "a", "b", "a/b", "c", "a/b/c", "b/c", "d")
    assert [is_in_part(path, part) for part in parts] == [True] * 4 + [False] * 4
    texts = {("Units", "F"): " kN ", ("notes", "t"): "ms", ("F_units",): "N"}
    assert units_beside(["F", "t"], texts, "") == {"F": "kN"}
    assert units_beside(["F", "t"], texts, "notes") == {}
