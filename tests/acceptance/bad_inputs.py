"""Invalid inputs for ``test_bad_inputs.py``, each with a pattern of the expected message.

The working directory of each test also contains ``good.csv`` (a valid run) and ``card.json`` (a valid card).
"""

from __future__ import annotations

import gc
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

from mrdamper.models.card_schema import card_text, signed
from tests.data.rig_files import WRITERS, titled
from tests.support.cards import DAMPERS, card_of

__all__ = ["CASES", "Case", "cases", "write_good_run"]

GIGABYTES = 2 * 10**9
EVALUATE = ("evaluate", "bad.json", "good.csv", "--out", "out")
HEADER = "time_s,displacement_mm,force_kN,current_A"

Arguments = list[object]


@dataclass(frozen=True)
class Case:
    """Invalid input with a pattern of the message that the command line must print."""

    name: str
    # This function writes the files and returns the command-line arguments.
    make: Callable[[Path], Arguments]
    message: str  # Regular expression that the printed message must match.


# ------------------------------------------------------------------------------------- text files


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
    def make(folder: Path) -> Arguments:
        (folder / name).write_bytes(content)
        return identify(name)

    return make


def text(content: str, name: str = "bad.csv") -> Callable[[Path], Arguments]:
    return raw(content.encode("utf-8"), name)


def spoilt(
    spoil: Callable[[dict[str, np.ndarray]], object], header: str = HEADER
) -> Callable[[Path], Arguments]:
    """Return a function that changes columns of the valid run and writes the run to ``bad.csv``."""

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


def edit(role: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict[str, np.ndarray]], None]:
    def spoil(given: dict[str, np.ndarray]) -> None:
        name = next(name for name in given if name.startswith(role))
        given[name] = change(given[name])

    return spoil


def header(line: str) -> Callable[[Path], Arguments]:
    return text(csv_of(columns(), line))


def sparse(start: bytes, name: str, size: int = GIGABYTES) -> Callable[[Path], Arguments]:
    """Return a function that writes a sparse file of several gigabytes: a valid beginning, then zeros."""

    def make(folder: Path) -> Arguments:
        with (folder / name).open("wb") as stream:
            stream.write(start)
            stream.truncate(size)
        return identify(name)

    return make


def twins(folder: Path) -> Arguments:
    """Write two files with different suffixes whose runs have the same name."""
    for name in ("run.csv", "run.txt"):
        (folder / name).write_text(GOOD)
    return identify("run.csv", "run.txt")


# ------------------------------------------------------------------------------------- binary files


SIGNATURE_BYTES = 24  # The format of a file is detected from its first bytes.


def damaged(name: str, change: Callable[[bytes], bytes]) -> Callable[[Path], Arguments]:
    """Return a function that writes a valid file with the library of its format and then damages it."""

    def make(folder: Path) -> Arguments:
        WRITERS[name](folder / name)
        (folder / name).write_bytes(change((folder / name).read_bytes()))
        return identify(name)

    return make


def cut(name: str, fraction: float) -> Callable[[Path], Arguments]:
    return damaged(name, lambda content: content[: int(fraction * len(content))])


def without_signature(content: bytes) -> bytes:
    return bytes(SIGNATURE_BYTES) + content[SIGNATURE_BYTES:]


def signature_alone(content: bytes) -> bytes:
    return content[:SIGNATURE_BYTES] + bytes(37 * k * k % 251 for k in range(3000))


def pipe(name: str, *arguments: object) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        os.mkfifo(folder / name)
        return [*arguments]

    return make


def empty_files(folder: Path) -> Arguments:
    for name in WRITERS:
        (folder / f"empty_{name}").write_bytes(b"")
    return identify("empty_*")


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
    """Return an XLSX workbook with one sheet. ``stated`` replaces the unpacked size in the ZIP directory."""
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
    """Return a function that writes a workbook that unpacks to 40 MB but states ``stated`` bytes."""

    def make(folder: Path) -> Arguments:
        row = b'<row r="1">' + b"<c><v>0</v></c>" * 4 + b"</row>"
        sheet = SHEET.encode().replace(b"@", row * (40_000_000 // len(row)))
        return raw(workbook(sheet, stated=stated), "bad.xlsx")(folder)

    return make


def entity(declared: str) -> bytes:
    """Return a workbook with the XML entity ``e``. Each row contains this entity as text and two numbers."""
    cells = '<c t="str"><v>&e;</v></c><c><v>1</v></c><c><v>2</v></c>'
    rows = "".join(f'<row r="{k}">{cells}</row>' for k in range(1, 9))
    return workbook(f"<!DOCTYPE s [{declared}]>{SHEET.replace('@', rows)}".encode())


LAUGHS = '<!ENTITY e0 "ha">' + "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9))


def mdf_formula(folder: Path) -> Arguments:
    from asammdf import MDF, Signal

    time, *others = titled().items()
    with MDF(version="4.10") as file:
        scaled: dict[str, object] = {"formula": "__import__('os').system('touch harm') + X"}
        for name, values in others:
            file.append([Signal(values, time[1], "", name, conversion=scaled)])
        file.save(folder / "bad.mf4", overwrite=True)
    return identify("bad.mf4")


# ------------------------------------------------------------------------------------------- channel maps


def channel_map(content: str | bytes | None) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        if content is not None:
            given = content.encode() if isinstance(content, str) else content
            (folder / "map.toml").write_bytes(given)
        return [*identify("good.csv"), "--channels", "map.toml"]

    return make


# ------------------------------------------------------------------------------------------- model cards


def card(change: Callable[[dict], object]) -> Callable[[Path], Arguments]:  # type: ignore[type-arg]
    def make(folder: Path) -> Arguments:
        document = json.loads(card_text(card_of(DAMPERS["bouc-wen"])))
        change(document)
        # Sign the changed card. Otherwise, the signature would be rejected before the changed entry is read.
        (folder / "bad.json").write_text(json.dumps(signed(document)))
        return [*EVALUATE]

    return make


def card_bytes(content: bytes) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        (folder / "bad.json").write_bytes(content)
        # Collect garbage now because finalizers would fail in the deep recursion that this card causes.
        gc.collect()
        return [*EVALUATE]

    return make


def negative_yield_force(document: dict) -> None:  # type: ignore[type-arg]
    for number in document["coefficients"]["yield_force"]["numbers"].values():
        number["value"] = -abs(number["value"]) - 1.0


def no_unit(document: dict) -> None:  # type: ignore[type-arg]
    document["coefficients"]["viscosity"]["unit"] = "N"


# ------------------------------------------------------------------------------------- other TOML files


def toml(content: str, *arguments: object) -> Callable[[Path], Arguments]:
    def make(folder: Path) -> Arguments:
        (folder / "bad.toml").write_text(content)
        return [*arguments, "--out", "out"]

    return make


HEAT = ("heat", "card.json", "--damper", "bad.toml")
MILLIMETRES_AS_METRES = HEADER.replace("displacement_mm", "displacement_m")


def objects_in_archive(folder: Path) -> Arguments:
    np.savez(folder / "bad.npz", force_N=np.array([{}] * 30, dtype=object), time_s=np.arange(30.0))
    return identify("bad.npz")


CASES: tuple[Case, ...] = (
    # Missing files and files that are not text
    Case("empty", raw(b""), r"bad\.csv: the file is empty"),
    Case("missing", lambda folder: identify("nowhere.csv"), r"nowhere\.csv: no such file or folder"),
    Case(
        "pipe", pipe("pipe.csv", *identify("pipe.csv")), r"pipe\.csv: is a pipe or a device; expected a file"
    ),
    Case("device", lambda folder: identify("/dev/zero"), r"/dev/zero: is a pipe or a device"),
    Case("gigabytes of zeros", sparse(b"", "bad.csv"), r"bad\.csv: not a format that is read here"),
    Case("a run, then gigabytes of zeros", sparse(GOOD.encode(), "bad.csv"), r"a text of more than 512 MB"),
    Case(
        "a run, then zeros", sparse(GOOD.encode(), "bad.csv", 1 << 20), r"holds zero bytes after about line"
    ),
    Case("same name twice", twins, r"run name 'run' is used more than once"),
    # Encodings
    Case("UTF-16", raw(GOOD.encode("utf-16") + b"\0"), r"the text is UTF-16 and damaged"),
    Case("web page", text("<!DOCTYPE html><html><body>Log in</body></html>\n" * 9), r"is a web page or XML"),
    # Columns and units
    Case("no force", header("time_s,displacement_mm,CH1,current_A"), r"no force column; the columns are"),
    Case(
        "no unit",
        header("time_s,displacement_mm,Force,current_A"),
        r"force has no unit \(column 'Force'\); expected a unit in the header",
    ),
    Case(
        "unit of something else",
        header(HEADER.replace("force_kN", "force_mm")),
        r"'mm' is not a unit of force",
    ),
    Case(
        "two forces",
        spoilt(
            lambda given: given.update(second=given[next(each for each in given if "force" in each)]),
            HEADER + ",force_N",
        ),
        r"'force_kN', 'force_N' all hold force",
    ),
    Case("wrong unit, metres", header(MILLIMETRES_AS_METRES), r"looks like mm read as m"),
    # Invalid values in columns
    Case("NaN", spoilt(put("force", slice(40, 50), np.nan)), r"force is nan at sample 40 \(10 such"),
    Case(
        "gap",
        spoilt(edit("time", lambda t: t + 0.5 * np.clip(np.arange(len(t)) // 10 - 19, 0, 6))),
        r"time has a gap of 0\.505 s after sample 199",
    ),
    Case("dead load cell", spoilt(edit("force", lambda f: 0.0 * f)), r"force never changes"),
    Case("one command", lambda folder: identify("good.csv")[:-1], r"(?s)one command.*--one-command"),
    Case("force turned", spoilt(edit("force", lambda f: -f)), r"force and velocity have opposite signs"),
    # Files and folders that contain no runs
    Case("pickle", raw(pickle.dumps({"force": [1.0]}), "bad.pkl"), r"a Python pickle, which is never opened"),
    # Binary formats
    Case("Parquet, cut", cut("run.parquet", 0.7), r"not a readable Parquet file"),
    Case("HDF5, cut", cut("run.h5", 0.5), r"not a readable HDF5 file"),
    Case("HDF5 of promises", hdf5_of_promises, r"no columns of numbers found"),
    Case("HDF5 that leads elsewhere", hdf5_linked, r"no force column"),
    Case(
        "TDMS, cut in its head",
        cut("run.tdms", 0.005),
        r"not a readable TDMS file|holds no sample: it is empty, or cut off",
    ),
    Case("MDF, cut", cut("run.mf4", 0.3), r"not a readable MDF file"),
    Case("NumPy archive of objects", objects_in_archive, r"skipped: force_N \(pickled objects\)"),
    Case("JSON, deep", raw(b'{"a":' * 9000, "bad.json"), r"not a readable JSON file"),
    Case("Excel, bomb", bomb(600_000_000), r"unpacks to more than 512 MB"),
    Case(
        "Excel, entities of entities",
        raw(entity(f'{LAUGHS}<!ENTITY e "&e9;">'), "bad.xlsx"),
        r"not a readable Excel file",
    ),
    Case(
        "Excel, another file as entity",
        raw(entity('<!ENTITY e SYSTEM "good.csv">'), "bad.xlsx"),
        r"not a readable Excel file",
    ),
    # Text files of data loggers
    Case("logger, cut", cut("logger.txt", 0.5), r"holds \d+ samples where its header states 401"),
    # One file of each format is empty, has no signature, or contains only its signature. The message does not
    # name the empty JSON file because such a file may belong to any program.
    Case("empty, every format", empty_files, rf"(?s)(is empty.*){{8}}and {len(WRITERS) - 9} more"),
    *(
        Case(
            f"{name}, without its head",
            damaged(name, without_signature),
            rf"{name}: not a format that is read",
        )
        for name in WRITERS
    ),
    *(
        Case(f"{name}, nothing but its head", damaged(name, signature_alone), rf"{name}: .*{said}")
        for name, said in (
            ("run.csv", "not a format that is read here"),
            ("mts.dat", "not a format that is read here"),
            ("logger.txt", "not a format that is read here"),
            ("v5.mat", "not a readable MAT file"),
            ("v73.mat", "not a readable HDF5 file"),
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
    # Channel maps
    Case("map missing", channel_map(None), r"map\.toml: cannot read the channel map"),
    Case("map is no TOML", channel_map("[channel\n"), r"map\.toml: not a TOML file"),
    Case(
        "map of a missing column",
        channel_map("[channel.force]\nname = 'CH7'\nunit = 'N'"),
        r"no column 'CH7'",
    ),
    Case(
        "map is a pipe",
        pipe("map.toml", *identify("good.csv"), "--channels", "map.toml"),
        r"map\.toml: is a pipe or a device",
    ),
    # Model cards
    Case("card of another schema", card(lambda d: d.update(schema_version=999)), r"schema_version.*999"),
    Case(
        "card, edited",
        card_bytes(card_text(card_of(DAMPERS["bouc-wen"])).replace("bouc-wen", "dahl").encode()),
        r"bad\.json: .*content_sha256.*edited",
    ),
    Case("card with a negative yield force", card(negative_yield_force), r"yield_force"),
    Case("card with a wrong unit", card(no_unit), r"viscosity"),
    Case("card nested too deep", card_bytes(b"[" * 100_000), r"bad\.json: not a card"),
    Case("card is a pipe", pipe("bad.json", *EVALUATE), r"bad\.json: is a pipe or a device"),
    # Other files that a user writes
    Case("drawing with an unknown table", toml("[bodyy]\nlength_mm = 1", *HEAT), r"bodyy"),
    Case("rheometer table is a run", lambda folder: ["fluid", "good.csv", "--out", "out"], r"good\.csv"),
    Case(
        "fluid with an unknown key",
        toml("densityy = 1", *identify("good.csv")[:-2], "--fluid", "bad.toml"),
        r"bad\.toml",
    ),
)


def cases(names: set[str]) -> list[Case]:
    """Return the cases with these names. Raise AssertionError if a name is not in ``CASES``."""
    assert names <= {case.name for case in CASES}
    return [case for case in CASES if case.name in names]
