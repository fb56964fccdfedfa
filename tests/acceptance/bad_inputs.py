"""A corpus of bad inputs: each makes its files in a folder and says what the command line should answer.

A case is a name, what writes the files and returns the arguments, and a pattern of the message. The folder
holds ``good.csv`` (a sound run) and ``card.json`` (a sound card) beside.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import pickle
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.data.rig_files import WRITERS, titled

__all__ = ["CASES", "Case", "cases", "write_good_run"]

GIGABYTES = 2 * 10**9
TOO_LONG = 300 * "x"  # for a file system
HEADER = "time_s,displacement_mm,force_kN,current_A"
CARD = Path(__file__).parents[1] / "models" / "card_version_1.json"

Arguments = list[object]


@dataclass(frozen=True)
class Case:
    """One bad input."""

    name: str
    make: Callable[[Path], Arguments]  # writes into the folder; the arguments of the command line
    message: str  # pattern


# ------------------------------------------------------------------------------------------- text


def columns() -> dict[str, np.ndarray]:
    return {name: np.array(values) for name, values in titled().items()}


def csv_of(given: dict[str, np.ndarray], header: str = HEADER) -> str:
    rows = (",".join(map(repr, row)) for row in zip(*(c.tolist() for c in given.values()), strict=True))
    return "\n".join([header, *rows]) + "\n"


def write_good_run(path: Path) -> None:
    path.write_text(csv_of(columns()), encoding="utf-8")


GOOD = csv_of(columns())


def identify(*paths: object) -> Arguments:
    return ["fit", *paths, "--out", "out", "--one-command"]


def raw(content: bytes, name: str = "bad.csv") -> Callable[[Path], Arguments]:
    """Return what writes these bytes to a file, to be identified."""

    def make(folder: Path) -> Arguments:
        (folder / name).write_bytes(content)
        return identify(name)

    return make


def text(content: str, name: str = "bad.csv") -> Callable[[Path], Arguments]:
    return raw(content.encode("utf-8"), name)


def spoilt(
    spoil: Callable[[dict[str, np.ndarray]], object], header: str = HEADER
) -> Callable[[Path], Arguments]:
    """Return what writes the good run with its columns altered."""

    def make(folder: Path) -> Arguments:
        given = columns()
        spoil(given)
        (folder / "bad.csv").write_text(csv_of(given, header), encoding="utf-8")
        return identify("bad.csv")

    return make


def put(role: str, at: int | slice, value: object) -> Callable[[dict[str, np.ndarray]], None]:
    def spoil(given: dict[str, np.ndarray]) -> None:
        name = next(name for name in given if name.startswith(role))
        given[name][at] = np.asarray(value)

    return spoil


def scale(role: str, factor: float, shift: float = 0.0) -> Callable[[dict[str, np.ndarray]], None]:
    def spoil(given: dict[str, np.ndarray]) -> None:
        name = next(name for name in given if name.startswith(role))
        given[name] = factor * given[name] + shift

    return spoil


def slower(given: dict[str, np.ndarray]) -> None:
    time = given["time_s"]
    given["time_s"] = np.where(time > 1.0, 1.0 + 3.0 * (time - 1.0), time)


def gap(given: dict[str, np.ndarray]) -> None:
    """Leave pieces too short to be runs."""
    for row in range(200, 260, 10):
        given["time_s"][row:] += 0.5


def header(line: str) -> Callable[[Path], Arguments]:
    return text(csv_of(columns(), line))


def sparse(start: bytes, name: str, size: int = GIGABYTES) -> Callable[[Path], Arguments]:
    """Return what makes a file of gigabytes that takes no room: a beginning, then nothing but zeros."""

    def make(folder: Path) -> Arguments:
        with (folder / name).open("wb") as stream:
            stream.write(start)
            stream.truncate(size)
        return identify(name)

    return make


def fifo(folder: Path) -> Arguments:
    os.mkfifo(folder / "pipe.csv")
    return identify("pipe.csv")


def loop(folder: Path) -> Arguments:
    (folder / "a.csv").symlink_to(folder / "b.csv")
    (folder / "b.csv").symlink_to(folder / "a.csv")
    return identify("a.csv")


def empty_folder(folder: Path) -> Arguments:
    (folder / "runs").mkdir()
    return identify("runs")


def folder_of_notes(folder: Path) -> Arguments:
    (folder / "runs").mkdir()
    (folder / "runs" / "notes.md").write_text("nothing to see")
    os.mkfifo(folder / "runs" / "pipe.csv")
    return identify("runs")


def twins(folder: Path) -> Arguments:
    """Write two files whose runs no folder tells apart."""
    for name in ("run.csv", "run.txt"):
        (folder / name).write_text(GOOD)
    return identify("run.csv", "run.txt")


def many_faults(folder: Path) -> Arguments:
    for k in range(12):
        (folder / f"bad{k:02d}.csv").write_text("")
    return identify("bad*.csv")


def commas() -> str:
    rows = (f"0,{5 * k:04d},{k % 9},1,{k % 7},0,0,5" for k in range(200))
    return "\n".join([HEADER, *rows]) + "\n"


# ------------------------------------------------------------------------------------------- binary


def cut(name: str, share: float) -> Callable[[Path], Arguments]:
    """Return what writes a file by its format's own library, and cuts it off."""

    def make(folder: Path) -> Arguments:
        WRITERS[name](folder / name)
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])
        return identify(name)

    return make


def damaged(name: str, at: float) -> Callable[[Path], Arguments]:
    """Return what writes a file by its format's own library, and overwrites 64 bytes of it."""

    def make(folder: Path) -> Arguments:
        WRITERS[name](folder / name)
        content = bytearray((folder / name).read_bytes())
        k = int(at * len(content))
        content[k : k + 64] = bytes(range(190, 254))
        (folder / name).write_bytes(bytes(content))
        return identify(name)

    return make


HEAD = 24  # bytes by which every format is told


def headed(name: str, change: Callable[[bytes], bytes]) -> Callable[[Path], Arguments]:
    """Return what writes a file by its format's own library, and changes it."""

    def make(folder: Path) -> Arguments:
        WRITERS[name](folder / name)
        (folder / name).write_bytes(change((folder / name).read_bytes()))
        return identify(name)

    return make


def without_head(content: bytes) -> bytes:
    return bytes(HEAD) + content[HEAD:]


def nothing_but_head(content: bytes) -> bytes:
    return content[:HEAD] + bytes(37 * k * k % 251 for k in range(3000))


def empty_files(folder: Path) -> Arguments:
    for name in WRITERS:
        (folder / f"empty_{name}").write_bytes(b"")
    return identify("empty_*")


def parquet_without_rows(folder: Path) -> Arguments:
    import polars as pl

    pl.DataFrame({name: [] for name in titled()}, schema=dict.fromkeys(titled(), pl.Float64)).write_parquet(
        folder / "bad.parquet"
    )
    return identify("bad.parquet")


def mat_of_words(folder: Path) -> Arguments:
    from scipy.io import savemat

    savemat(folder / "bad.mat", {"remark": "oil changed"})
    return identify("bad.mat")


def hdf5_of_promises(folder: Path) -> Arguments:
    import h5py

    with h5py.File(folder / "bad.h5", "w") as file:
        for name in titled():
            file.create_dataset(name, shape=(10**12,), chunks=(1 << 20,), dtype="f8")
    return identify("bad.h5")


def hdf5_linked(folder: Path) -> Arguments:
    import h5py

    with h5py.File(folder / "bad.h5", "w") as file:
        for name, values in titled().items():
            if not name.startswith("force"):
                file[name] = values
        file["force_kN"] = h5py.ExternalLink("/etc/passwd", "/force_kN")
    return identify("bad.h5")


FORMS = "http://schemas.openxmlformats.org"
MAIN = f"{FORMS}/spreadsheetml/2006/main"
LINKS = f"{FORMS}/officeDocument/2006/relationships"
KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
SHEET = f'<worksheet xmlns="{MAIN}"><sheetData>@</sheetData></worksheet>'


def relation(kind: str, target: str) -> str:
    inner = f'<Relationship Id="rId1" Type="{LINKS}/{kind}" Target="{target}"/>'
    return f'<Relationships xmlns="{FORMS}/package/2006/relationships">{inner}</Relationships>'


BOOK = {
    "[Content_Types].xml": f'<Types xmlns="{FORMS}/package/2006/content-types">'
    '<Default Extension="xml" ContentType="application/xml"/>'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    f'<Override PartName="/xl/workbook.xml" ContentType="{KIND}.sheet.main+xml"/>'
    f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{KIND}.worksheet+xml"/></Types>',
    "_rels/.rels": relation("officeDocument", "xl/workbook.xml"),
    "xl/workbook.xml": f'<workbook xmlns="{MAIN}" xmlns:r="{LINKS}"><sheets>'
    '<sheet name="Data" sheetId="1" r:id="rId1"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": relation("worksheet", "worksheets/sheet1.xml"),
}


def workbook(sheet: bytes, *, stated: int | None = None) -> bytes:
    """Return a workbook of one sheet; ``stated`` is the unpacked size that its directory claims."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in BOOK.items():
            archive.writestr(name, part)
        archive.writestr("xl/worksheets/sheet1.xml", sheet)
    content = stream.getvalue()
    if stated is not None:
        content = content.replace(struct.pack("<I", len(sheet)), struct.pack("<I", stated))
    return content


def bomb(stated: int) -> Callable[[Path], Arguments]:
    """Return what writes a workbook of 40 kB whose sheet unpacks to 40 MB, and states ``stated`` bytes."""

    def make(folder: Path) -> Arguments:
        row = b'<row r="1">' + b"<c><v>0</v></c>" * 4 + b"</row>"
        sheet = SHEET.encode().replace(b"@", row * (40_000_000 // len(row)))
        return raw(workbook(sheet, stated=stated), "bad.xlsx")(folder)

    return make


def far_cells() -> bytes:
    row = '<row r="1"><c r="A1"><v>1</v></c></row><row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'
    return workbook(SHEET.replace("@", row).encode())


def entity(declared: str) -> bytes:
    """Return a workbook whose sheet declares the entity ``e`` and uses it as a text beside two numbers."""
    cells = '<c t="str"><v>&e;</v></c><c><v>1</v></c><c><v>2</v></c>'
    rows = "".join(f'<row r="{k}">{cells}</row>' for k in range(1, 9))
    return workbook(f"<!DOCTYPE s [{declared}]>{SHEET.replace('@', rows)}".encode())


LAUGHS = '<!ENTITY e0 "ha">' + "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9))


def two_sheets(folder: Path) -> Arguments:
    from openpyxl import Workbook

    book = Workbook()
    for k in range(2):
        sheet = book.create_sheet(f"Run {k}")
        sheet.append([name.replace("_kN", "") if k else name for name in titled()])
        for row in zip(*(c.tolist() for c in titled().values()), strict=True):
            sheet.append(list(row))
    book.save(folder / "bad.xlsx")
    return identify("bad.xlsx")


def word_in_a_sheet(folder: Path) -> Arguments:
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(list(titled()))
    for k, row in enumerate(zip(*(c.tolist() for c in titled().values()), strict=True)):
        sheet.append([*row[:2], "#DIV/0" if k == 150 else row[2], row[3]])
    book.save(folder / "bad.xlsx")
    return identify("bad.xlsx")


def archive_with(name: str, other: str) -> Callable[[Path], Arguments]:
    def write(folder: Path) -> Arguments:
        with zipfile.ZipFile(folder / name, "w") as archive:
            archive.writestr(other, GOOD)
        return identify(name)

    return write


def mdf_formula(folder: Path) -> Arguments:
    from asammdf import MDF, Signal

    time, *others = titled().items()
    with MDF(version="4.10") as file:
        scaled: dict[str, object] = {"formula": "__import__('os').system('touch harm') + X"}
        for name, values in others:
            file.append([Signal(values, time[1], "", name, conversion=scaled)])
        file.save(folder / "bad.mf4", overwrite=True)
    return identify("bad.mf4")


def clocks(folder: Path) -> Arguments:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        for k, (name, values) in enumerate(titled().items()):
            if name != "time_s":
                file.append([Signal(values, np.arange(len(values)) * 0.005 + k, "", name)])
        file.save(folder / "bad.mf4", overwrite=True)
    return identify("bad.mf4")


# ------------------------------------------------------------------------------------------- loggers


def logger(change: Callable[[str], str]) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        WRITERS["logger.txt"](folder / "bad.txt")
        (folder / "bad.txt").write_text(change((folder / "bad.txt").read_text()))
        return identify("bad.txt")

    return make


def mts(change: Callable[[str], str]) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        WRITERS["mts.dat"](folder / "bad.dat")
        (folder / "bad.dat").write_text(change((folder / "bad.dat").read_text()))
        return identify("bad.dat")

    return make


def other_columns(given: str) -> str:
    rows = "\n".join(f"{k}.0\t1.0\t2.0" for k in range(20))
    return f"{given}Data Acquisition\nTime\tForce\tStrain\nSec\tN\tmm\n{rows}\n"


# ------------------------------------------------------------------------------------------- channel maps


def channel_map(content: str | bytes | None) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        if content is not None:
            given = content.encode() if isinstance(content, str) else content
            (folder / "map.toml").write_bytes(given)
        return [*identify("good.csv"), "--channels", "map.toml"]

    return make


def map_is_a_pipe(folder: Path) -> Arguments:
    os.mkfifo(folder / "map.toml")
    return [*identify("good.csv"), "--channels", "map.toml"]


def map_of_gigabytes(folder: Path) -> Arguments:
    sparse(b"[channel.force]\n", "map.toml")(folder)
    return [*identify("good.csv"), "--channels", "map.toml"]


# ------------------------------------------------------------------------------------------- cards


def card(change: Callable[[dict], object]) -> Callable[[Path], Arguments]:  # type: ignore[type-arg]
    def make(folder: Path) -> Arguments:
        document = json.loads(CARD.read_text(encoding="utf-8"))
        change(document)
        (folder / "bad.json").write_text(json.dumps(document))
        return ["evaluate", "bad.json", "good.csv", "--out", "out"]

    return make


def card_bytes(content: bytes) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        (folder / "bad.json").write_bytes(content)
        return ["evaluate", "bad.json", "good.csv", "--out", "out"]

    return make


def card_is_a_pipe(folder: Path) -> Arguments:
    os.mkfifo(folder / "bad.json")
    return ["evaluate", "bad.json", "good.csv", "--out", "out"]


def card_of_gigabytes(folder: Path) -> Arguments:
    sparse(b"{", "bad.json")(folder)
    return ["evaluate", "bad.json", "good.csv", "--out", "out"]


def negative_yield_force(document: dict) -> None:  # type: ignore[type-arg]
    for number in document["coefficients"]["yield_force"]["numbers"].values():
        number["value"] = -abs(number["value"]) - 1.0


def no_unit(document: dict) -> None:  # type: ignore[type-arg]
    document["coefficients"]["viscosity"]["unit"] = "N"


# ------------------------------------------------------------------------------------------- other TOML


def toml(content: str, *arguments: object) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        (folder / "bad.toml").write_text(content)
        return [*arguments, "--out", "out"]

    return make


def pipe_in(*arguments: object) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        os.mkfifo(folder / "bad.toml")
        return [*arguments, "--out", "out"]

    return make


HEAT = ("heat", "card.json", "--damper", "bad.toml")
MILLIMETRES_AS_METRES = HEADER.replace("displacement_mm", "displacement_m")


def objects_in_archive(folder: Path) -> Arguments:
    np.savez(folder / "bad.npz", force_N=np.array([{}] * 30, dtype=object), time_s=np.arange(30.0))
    return identify("bad.npz")


CASES: tuple[Case, ...] = (
    # text that is none, or is not there
    Case("empty", raw(b""), r"bad\.csv: the file is empty"),
    Case("blank lines", raw(b"\n \n\n"), r"bad\.csv: the file is empty"),
    Case("header only", text(HEADER + "\n"), r"no rows of numbers in the first 1 lines"),
    Case("prose", text("what a day\nit was\n" * 20), r"no rows of numbers in the first 40 lines"),
    Case("one column", text("force_N\n" + "1.0\n2.0\n" * 40), r"no rows of numbers"),
    Case("missing", lambda folder: identify("nowhere.csv"), r"nowhere\.csv: no such file or folder"),
    Case("pattern of nothing", lambda folder: identify("no*.csv"), r"no\*\.csv: the pattern matches no file"),
    Case("empty folder", empty_folder, r"runs: no runs in this folder; expected \.asc, \.bin, \.csv"),
    Case("folder of notes and a pipe", folder_of_notes, r"runs: no runs in this folder"),
    Case("pipe", fifo, r"pipe\.csv: is a pipe or a device; expected a file"),
    Case("device", lambda folder: identify("/dev/zero"), r"/dev/zero: is a pipe or a device"),
    Case(
        "name too long",
        lambda folder: identify(f"{TOO_LONG}.csv"),
        r"x\.csv: cannot be read: File name too long",
    ),
    Case(
        "name too long for what is written",
        lambda folder: ["fit", "good.csv", "--one-command", "--out", TOO_LONG],
        r"x: cannot write there: File name too long",
    ),
    Case(
        "duty too long for a name",
        lambda folder: ["heat", "card.json", "--damper", "paper", "--duty", TOO_LONG, "--out", "out"],
        r"duty 'x+': there are less than three parts",
    ),
    Case(
        "law in a file that is not there",
        lambda folder: [*identify("good.csv"), "--law", f"{TOO_LONG}.py:Law"],
        r"law 'x+\.py:Law': there is no file x+\.py",
    ),
    Case("link to itself", loop, r"a\.csv: no such file or folder"),
    Case("gigabytes of zeros", sparse(b"", "bad.csv"), r"bad\.csv: not a format that is read here"),
    Case("a run, then zeros", sparse(GOOD.encode(), "bad.csv"), r"holds zero bytes after about line"),
    Case("name of markup", text("", "[red]<b>$(x).csv"), r"\[red\]<b>\$\(x\)\.csv: the file is empty"),
    Case("same name twice", twins, r"run name 'run' is used more than once"),
    Case("many at once", many_faults, r"bad07\.csv.*\n\.\.\. and 4 more like these"),
    # encodings
    Case("UTF-16", raw(GOOD.encode("utf-16") + b"\0"), r"the text is UTF-16 and damaged"),
    Case("UTF-16 without a mark", raw(GOOD.encode("utf-16-le")[:-1]), r"the text is UTF-16 and damaged"),
    Case("UTF-32", raw(GOOD.encode("utf-32")), r"the text is UTF-16|not a format"),
    Case(
        "Shift JIS",
        raw(("# 変位 荷重\n" * 9 + GOOD[:60]).encode("shift-jis")),
        r"no columns of numbers found",
    ),
    Case("CR line ends", raw(GOOD.replace("\n", "\r").encode()), r"lines end in CR alone"),
    Case("no line end", raw(b"1,2," * 600_000), r"the first line has more than 1048576 bytes"),
    Case("noise", raw(np.random.default_rng(0).bytes(5000)), r"not a format that is read here|not UTF-8"),
    Case("web page", text("<!DOCTYPE html><html><body>Log in</body></html>\n" * 9), r"is a web page or XML"),
    # columns and units
    Case("markup in names", header("<script>,<b>x</b>,&amp;,current_A"), r"no displacement column.*<script>"),
    Case("no force", header("time_s,displacement_mm,CH1,current_A"), r"no force column; the columns are"),
    Case("no time", header("n,displacement_mm,force_kN,current_A"), r"no time column"),
    Case("no command", header("time_s,displacement_mm,force_kN,CH4"), r"no current or voltage"),
    Case(
        "no unit",
        header("time_s,displacement_mm,Force,current_A"),
        r"force has no unit; expected one in the header",
    ),
    Case(
        "unit of something else",
        header(HEADER.replace("force_kN", "force_mm")),
        r"'mm' is not a unit of force",
    ),
    Case("unit of mass", header(HEADER.replace("force_kN", "force_lb")), r"'lb' is not a unit of force.*lbf"),
    Case(
        "unknown unit",
        header(HEADER.replace("force_kN", "force_furlong")),
        r"'furlong' is not a unit of force",
    ),
    Case(
        "code for a unit",
        header(HEADER.replace("_kN", " [__import__('os').abort()]")),
        r"is not a unit of force",
    ),
    Case("endless unit", header(HEADER.replace("_kN", " [N**999999999]")), r"is not a unit of force"),
    Case("nested unit", header(HEADER.replace("_kN", " [" + "(" * 30 + "N]")), r"is not a unit of force"),
    Case(
        "two forces",
        header("force_N,displacement_mm,force_kN,current_A"),
        r"'force_N', 'force_kN' all hold force",
    ),
    Case("wrong unit, metres", header(MILLIMETRES_AS_METRES), r"looks like mm read as m"),
    Case(
        "wrong unit, newtons",
        spoilt(scale("force", 1e6)),
        r"force is .* N at sample 0.*expected -1e\+06 to 1e\+06",
    ),
    Case("commas for all", text(commas()), r"commas seem to separate both columns and decimals"),
    Case(
        "points and commas",
        text(GOOD.replace(",", ";").replace("0.5\n", "0,5\n", 3)),
        r"decimal points and decimal commas",
    ),
    # numbers
    Case("NaN", spoilt(put("force", slice(40, 50), np.nan)), r"force is nan at sample 40 \(10 such"),
    Case("infinity", spoilt(put("displacement", 3, np.inf)), r"displacement is inf at sample 3"),
    Case("empty cells", text(GOOD.replace(",0.5\n", ",\n", 5)), r"command is nan at sample 0"),
    Case(
        "word for a number",
        text(GOOD.replace("0.5\n", "over\n", 2)),
        r"line 2: column 'current_A' holds 'over'",
    ),
    Case("cut in a row", text(GOOD[:-30]), r"is nan at sample"),
    Case("outlier", spoilt(put("force", 77, 1e12)), r"force is 1e\+15 N at sample 77 \(1 such"),
    Case("jump", spoilt(put("displacement", slice(70, 72), 1500.0)), r"looks like a jump of the sensor"),
    Case("time twice", spoilt(put("time", 100, 0.495)), r"time goes from 0\.495 s to 0\.495 s at sample 100"),
    Case("time goes back", spoilt(put("time", slice(200, 204), np.arange(4) * 0.005)), r"mixed sampling"),
    Case("gap", spoilt(gap), r"time has a gap of 0\.505 s after sample 199"),
    Case(
        "mixed rates", spoilt(slower), r"mixed sampling: the time step is 0\.005 s at the start and 0\.015 s"
    ),
    Case(
        "few samples",
        text("".join(GOOD.splitlines(keepends=True)[:9])),
        r"has 8 samples; expected at least 16",
    ),
    Case("at rest", spoilt(scale("displacement", 0.0)), r"displacement never changes"),
    Case("dead load cell", spoilt(scale("force", 0.0)), r"force never changes"),
    Case("one stroke", text("".join(GOOD.splitlines(keepends=True)[:51])), r"reversal"),
    Case("one command", lambda folder: identify("good.csv")[:-1], r"(?s)one command.*--one-command"),
    Case("force turned", spoilt(scale("force", -1.0)), r"force and velocity have opposite signs"),
    # what is given instead of a run
    Case("gzip", raw(gzip.compress(GOOD.encode()), "bad.csv.gz"), r"is a gzip archive: unpack it first"),
    Case("old Excel", raw(b"\xd0\xcf\x11\xe0" + b"\0" * 600, "bad.xls"), r"is an old Excel file \(\.xls\)"),
    Case("pickle", raw(pickle.dumps({"force": [1.0]}), "bad.pkl"), r"a Python pickle, which is never opened"),
    Case("NumPy", raw(b"\x93NUMPY\x01\0v\0" + b" " * 200, "bad.npy"), r"is a single array of NumPy"),
    Case("PDF", raw(b"%PDF-1.7\n" + b"x" * 90, "bad.pdf"), r"is a PDF"),
    # binary formats
    Case("Parquet, cut", cut("run.parquet", 0.7), r"not a readable Parquet file"),
    Case(
        "Parquet, magic only",
        raw(b"PAR1" + b"\0" * 900 + b"PAR1", "bad.parquet"),
        r"not a readable Parquet file",
    ),
    Case("Parquet without rows", parquet_without_rows, r"no columns of numbers found"),
    Case("Parquet, gigabytes", sparse(b"PAR1", "bad.parquet"), r"not a readable Parquet file"),
    Case("MAT, cut", cut("v5.mat", 0.6), r"not a readable MAT file"),
    Case("MAT, damaged", damaged("v5.mat", 0.5), r"not a readable MAT file|no columns of numbers"),
    Case("MAT of words", mat_of_words, r"no columns of numbers found"),
    Case("MAT, gigabytes", sparse(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM", "bad.mat"), r"bad\.mat: "),
    Case("MAT 7.3, cut", cut("v73.mat", 0.6), r"not a readable MAT v7\.3 file"),
    Case("HDF5, cut", cut("run.h5", 0.5), r"not a readable HDF5 file"),
    Case("HDF5, gigabytes", sparse(b"\x89HDF\r\n\x1a\n", "bad.h5"), r"not a readable HDF5 file"),
    Case("HDF5 of promises", hdf5_of_promises, r"no columns of numbers found"),
    Case("HDF5 that leads elsewhere", hdf5_linked, r"no force column"),
    Case(
        "TDMS, cut in its head",
        cut("run.tdms", 0.005),
        r"not a readable TDMS file|holds no sample: it is empty, or cut off",
    ),
    Case(
        "TDMS, damaged head",
        damaged("run.tdms", 0.001),
        r"not a readable TDMS file|holds no sample: it is empty, or cut off",
    ),
    Case("TDMS, gigabytes", sparse(b"TDSm", "bad.tdms"), r"bad\.tdms: "),
    Case("MDF, cut", cut("run.mf4", 0.3), r"not a readable MDF file"),
    Case("MDF, magic only", raw(b"MDF     4.10    ".ljust(900, b"\0"), "bad.mf4"), r"bad\.mf4: "),
    Case("MDF, gigabytes", sparse(b"MDF     4.10    ", "bad.mf4"), r"bad\.mf4: "),
    Case("MDF of many clocks", clocks, r"has a clock of its own, from"),
    Case("Excel, cut", cut("run.xlsx", 0.6), r"not a readable Excel file"),
    Case("Excel, damaged", damaged("run.xlsx", 0.3), r"not a readable Excel file|no sheet"),
    Case("Excel, no workbook", archive_with("bad.xlsx", "run.csv"), r"is a ZIP archive without a workbook"),
    Case("NumPy archive", archive_with("bad.npz", "force.npy"), r"not a readable NumPy archive"),
    Case("NumPy archive of objects", objects_in_archive, r"not a readable NumPy archive \(Object arrays"),
    Case("JSON, cut", cut("run.json", 0.7), r"not a readable JSON file"),
    Case("JSON, deep", raw(b'{"a":' * 9000, "bad.json"), r"not a readable JSON file"),
    Case("JSON without runs", raw(b'{"a": [1, "b"]}', "bad.json"), r"no columns of numbers found"),
    Case("OpenDocument", archive_with("bad.ods", "content.xml"), r"bad\.ods: is an OpenDocument file"),
    Case("Excel, bomb", bomb(600_000_000), r"unpacks to more than 512 MB"),
    Case("Excel, bomb that denies it", bomb(900), r"unpacks to more than the 900 bytes"),
    Case("Excel, far cells", raw(far_cells(), "bad.xlsx"), r"spans 1048576 rows and 16384 columns"),
    Case(
        "Excel, entities of entities", raw(entity(f'{LAUGHS}<!ENTITY e "&e9;">'), "bad.xlsx"), r"entity `&e;`"
    ),
    Case(
        "Excel, another file as entity",
        raw(entity('<!ENTITY e SYSTEM "good.csv">'), "bad.xlsx"),
        r"entity `&e;`",
    ),
    Case("Excel, two sheets", two_sheets, r"force has no unit"),
    Case("Excel, a word", word_in_a_sheet, r"sheet 'Sheet', row 152: column 'force_kN' holds '#DIV/0'"),
    # loggers
    Case("logger, no size", logger(lambda t: t.replace("Header Size", "Header Length")), r"bad\.txt"),
    Case(
        "logger, no interval",
        logger(lambda t: t.replace("Sampling Interval", "Step")),
        r"the logger's header lacks",
    ),
    Case("logger, cut", logger(lambda t: t[: len(t) // 2]), r"holds \d+ samples where its header states 401"),
    Case(
        "logger, header only", logger(lambda t: "\n".join(t.splitlines()[:7])), r"no samples after a header"
    ),
    Case("MTS, first line", mts(lambda t: t.replace("|2|.|", "|9|.|")), r"line 1 is 'MTS793"),
    Case(
        "MTS, no rows",
        mts(lambda t: "\n".join(t.splitlines()[:5])),
        r"an MTS 793 text without a row of numbers",
    ),
    Case("MTS, other columns", mts(other_columns), r"are not those of the first acquisition"),
    Case("MTS, gigabytes", sparse(b"MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n", "bad.dat"), r"line 2: does not end"),
    # every format: nothing in it, another's head, its own head and nothing else
    Case("empty, every format", empty_files, rf"(?s)(is empty.*){{8}}and {len(WRITERS) - 8} more"),
    *(
        Case(f"{name}, without its head", headed(name, without_head), rf"{name}: not a format that is read")
        for name in WRITERS
    ),
    *(
        Case(f"{name}, nothing but its head", headed(name, nothing_but_head), rf"{name}: .*{said}")
        for name, said in (
            ("run.csv", "not a format that is read here"),
            ("mts.dat", "is not UTF-8 text"),
            ("logger.txt", "is not UTF-8 text"),
            ("v5.mat", "not a readable MAT file"),
            ("v73.mat", "not a readable MAT v7.3 file"),
            ("run.h5", "not a readable HDF5 file"),
            ("run.tdms", "the TDMS file holds no sample"),
            ("run.mf4", "not a readable MDF file"),
            ("run.parquet", "not a readable Parquet file"),
            ("run.xlsx", "not a readable Excel file"),
        )
    ),
    Case(
        "MDF, a formula",
        mdf_formula,
        r"bad\.mf4: channel 'displacement_mm' is scaled by the formula .*not run",
    ),
    # channel maps
    Case("map missing", channel_map(None), r"map\.toml: cannot read the channel map"),
    Case("map is no TOML", channel_map("[channel\n"), r"map\.toml: not a TOML file"),
    Case("map in Latin-1", channel_map(b"x = '\xe9'"), r"map\.toml: not a TOML file"),
    Case("map nested too deep", channel_map("x = " + "[" * 50_000), r"map\.toml: not a TOML file"),
    Case(
        "map with an unknown key",
        channel_map("[channel.force]\nscale = 2"),
        r"channel\.force has no key 'scale'; expected one of: name",
    ),
    Case(
        "map with an unknown role",
        channel_map("[channel.torque]\nname = 'a'"),
        r"channel has no key 'torque'",
    ),
    Case("map with a bad sign", channel_map("[channel.force]\nsign = 0"), r"sign is 0; expected 1 or -1"),
    Case(
        "map of a missing column",
        channel_map("[channel.force]\nname = 'CH7'\nunit = 'N'"),
        r"no column 'CH7'",
    ),
    Case(
        "map with a wrong unit", channel_map("[channel.force]\nunit = 'mm'"), r"'mm' is not a unit of force"
    ),
    Case(
        "map with too many tests",
        channel_map("[segments]\nsplit = 'x'\ncurrent_A = [0, 1]"),
        r"gives 2 commands",
    ),
    Case("map is a pipe", map_is_a_pipe, r"map\.toml: is a pipe or a device"),
    Case("map of gigabytes", map_of_gigabytes, r"map\.toml: has 2e\+03 MB; expected a channel map"),
    # cards
    Case(
        "card of a newer schema",
        card(lambda d: d.update(schema_version=999)),
        r"schema_version.*999|999.*newer|newer",
    ),
    Case("card with a negative yield force", card(negative_yield_force), r"yield_force"),
    Case("card with a wrong unit", card(no_unit), r"viscosity"),
    Case("card with an unknown law", card(lambda d: d.update(law="magic")), r"magic"),
    Case("card without coefficients", card(lambda d: d.pop("coefficients")), r"coefficients"),
    Case("card with an unknown key", card(lambda d: d.update(run_this="rm -rf /")), r"run_this"),
    Case("card, empty", card_bytes(b""), r"bad\.json: .*not a whole JSON file"),
    Case(
        "card, cut",
        card_bytes(CARD.read_bytes()[:900]),
        r"bad\.json: line \d+, column \d+.*not a whole JSON file",
    ),
    Case("card is a list", card_bytes(b"[1, 2]"), r"bad\.json"),
    Case("card nested too deep", card_bytes(b"[" * 100_000), r"bad\.json: not a card"),
    Case("card in UTF-16", card_bytes('{"a": 1}'.encode("utf-16")), r"bad\.json: not UTF-8 text"),
    Case("card is a pipe", card_is_a_pipe, r"bad\.json: is a pipe or a device"),
    Case("card of gigabytes", card_of_gigabytes, r"bad\.json: has 2e\+03 MB"),
    # other files that people write
    Case("drawing with an unknown table", toml("[bodyy]\nlength_mm = 1", *HEAT), r"bodyy"),
    Case("drawing is no TOML", toml("= =", *HEAT), r"bad\.toml: not a TOML file"),
    Case("drawing is a pipe", pipe_in(*HEAT), r"is a pipe or a device"),
    Case(
        "campaign with an unknown key",
        toml("motionz = []", "rig", "--campaign", "bad.toml"),
        "unknown key 'motionz'",
    ),
    Case("campaign is a pipe", pipe_in("rig", "--campaign", "bad.toml"), r"is a pipe or a device"),
    Case("damper with an unknown key", toml("viscosityy = 1", "rig", "--damper", "bad.toml"), r"viscosityy"),
    Case("damper is a pipe", pipe_in("rig", "--damper", "bad.toml"), r"is a pipe or a device"),
    Case("rheometer table is a run", lambda folder: ["fluid", "good.csv", "--out", "out"], r"good\.csv"),
    Case(
        "fluid with an unknown key",
        toml("densityy = 1", *identify("good.csv")[:-2], "--fluid", "bad.toml"),
        r"bad\.toml",
    ),
)


def cases(names: set[str]) -> list[Case]:
    """Return the cases of these names, of which none may be missing."""
    assert names <= {case.name for case in CASES}
    return [case for case in CASES if case.name in names]
