"""Search of folders for files that may contain runs.

The search includes subfolders because their names may state conditions. It skips hidden files, notes, and
folders with results of this program.
"""

from __future__ import annotations

import bz2
import glob
import gzip
import lzma
import re
import shutil
import tarfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import IO, Any

from mrdamper.data.formats.excel import ZIP_SIGNATURE
from mrdamper.data.formats.lines.cells import is_number
from mrdamper.data.formats.lines.encodings import read_lines
from mrdamper.data.formats.lines.header import DELIMITERS, find_data, holds_samples
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.text import read_text
from mrdamper.data.tables import FORMATS, HEAD_BYTES
from mrdamper.errors import InputError
from mrdamper.files import PathLike, is_file, is_folder, is_there

_JOBS = tuple("card check compare cycles derate heat heatsink summary sweep verification".split())  # noqa: SIM905
_RESULTS = frozenset(f"{name}.{kind}" for name in _JOBS for kind in ("json", "html")) | {
    *("report.html", "sweep.html", "track.html", "track.json")
}
GENERIC_SUFFIXES = frozenset({".json", ".jsonl"})
"""Suffixes of formats that programs also use for other data than runs."""
_OF_ANYTHING = frozenset({".txt", ".bin", ".raw"})  # The content of these files shows if they are runs.
_NO_RUNS = frozenset(
    f".{end}"
    for end in (
        *("bak", "tmp", "old", "orig", "swp", "md", "rst", "html", "htm", "xml", "svg", "tex", "py", "m"),
        *("ini", "cfg", "toml", "yaml", "yml", "c", "h", "ipynb", "pdf", "png", "jpg", "jpeg"),
        *("docx", "doc", "pptx", "ppt", "odt", "odp", "vsdx"),
    )
)
_COMPRESSIONS: Mapping[bytes, Any] = MappingProxyType({b"\x1f\x8b": gzip, b"BZh": bz2, b"\xfd7zXZ": lzma})
_ARCHIVES = (ZIP_SIGNATURE, *_COMPRESSIONS)
_DAMAGES = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, tarfile.TarError),
    *(EOFError, OSError, RuntimeError, NotImplementedError),
)


def find_files(paths: Sequence[PathLike], space: Path | None = None) -> list[Path]:
    """Return the files named by paths, folders and patterns, in the given order.

    Archives are unpacked into the folder ``space`` if it is given. There, the subfolders have the names of
    the folders in the archive's path. Documents in a searched folder that contains an archive, directly or in
    a subfolder, are copied to these subfolders. A file that is given twice is returned once.
    """
    files: dict[Path, Path] = {}
    if not paths:
        raise InputError(found="no paths given", expected="files, folders or patterns")
    for given in paths:
        path = Path(given)
        found, expected = "no such file or folder, and no file matches this pattern", ""
        if is_folder(path):
            inside, found = list(_files_below(path)), "no runs in this folder"
            expected = ", ".join(sorted(format_suffixes()))
        elif is_there(path):
            inside = [path]
        else:
            fitting = map(Path, glob.glob(str(given), recursive=True))  # noqa: PTH207
            inside = sorted(file for file in fitting if file.is_file())
        if not inside:
            raise InputError(place=path, found=found, expected=expected)
        for file in inside:
            files.setdefault(file.resolve(), file)
    unpacked: list[Path] = []
    for file in files.values():
        if space is None or not _is_archive(file):
            unpacked.append(file)
            continue
        root = next((path for path in map(Path, paths) if path in file.parents), None)
        copy_of_root = space.joinpath(*(root or file.parent).absolute().parts[1:][-2:])
        unpacked += _unpack(file, copy_of_root / file.parent.relative_to(root or file.parent))
        folders = (folder for folder in file.parents if root in {folder, *folder.parents})
        for document in (each for folder in folders for each in folder.iterdir() if is_small_file(each)):
            copy = copy_of_root / document.relative_to(root or file.parent)
            if not _is_archive(document) and not copy.exists():
                with suppress(OSError):  # An unreadable document is not copied.
                    shutil.copy(document, copy)
    return unpacked


def _unpack(file: Path, folder: Path) -> list[Path]:
    """Return the files of an archive, which are unpacked into a folder."""
    room = SETTINGS.archive_unpacked_max_bytes
    try:
        for name, member in _members(file):
            target = folder.joinpath(*(part for part in PurePosixPath(name).parts if part not in {"..", "/"}))
            target.parent.mkdir(parents=True, exist_ok=True)
            with member, target.open("wb") as stream:
                while piece := member.read(1 << 20):
                    room -= stream.write(piece)
                    if room < 0:
                        found = f"unpacks to more than {SETTINGS.archive_unpacked_max_bytes >> 20} MB"
                        raise InputError(place=file, found=found, remedy="Unpack it first")
    except _DAMAGES as error:
        found = "the archive is damaged, encrypted, or of an unknown kind"
        raise InputError(place=file, found=found, remedy="Unpack it first") from error
    single = folder / file.stem
    return [single] if single.is_file() else list(_files_below(folder / file.name))


def _is_archive(file: Path) -> bool:
    return is_file(file) and _is_packed(_head(file)) and file.suffix.lower() not in format_suffixes()


def _is_packed(head: bytes) -> bool:
    return head.startswith(_ARCHIVES) or head[257:262] == b"ustar"


def own_name(file: Path) -> str:
    """Return the name of a file without suffix. In "test.001" and "TEST.R01", the number is not a suffix."""
    is_number = re.fullmatch(r"\.[A-Za-z]?\d+", file.suffix) and file.suffix.lower() not in format_suffixes()
    return file.name if is_number else file.stem


def is_small_file(path: Path) -> bool:
    """Return True if a path is a file whose size is the size of a document."""
    return path.is_file() and path.stat().st_size <= SETTINGS.document_max_bytes


def _members(file: Path) -> Iterator[tuple[str, IO[bytes]]]:
    """Generate (path that begins with the archive's name, open content) of each file in an archive."""
    opened = next((each for start, each in _COMPRESSIONS.items() if _head(file).startswith(start)), None)
    if tarfile.is_tarfile(file):
        with tarfile.open(file) as tape:
            inside = ((f"{file.name}/{each.name}", tape.extractfile(each)) for each in tape)
            yield from ((name, content) for name, content in inside if content)
    elif opened is not None:
        yield file.stem, opened.open(file)
    else:
        with zipfile.ZipFile(file) as archive:
            names = [name for name in archive.namelist() if not name.endswith("/")]
            yield from ((f"{file.name}/{name}", archive.open(name)) for name in names)


def distinct_names(names: Sequence[str], sources: Sequence[str]) -> list[str]:
    """Return the names of runs. Equal names from different folders get the folder's name as a prefix."""
    found = list(names)
    folders = [Path(source).parent for source in sources]
    for _ in range(SETTINGS.folder_depth_max):
        # A folder's name does not distinguish its own runs.
        apart = Counter(name for name, _ in {*zip(found, folders, strict=True)})
        for k, name in enumerate(found):
            if apart[name] > 1:
                found[k], folders[k] = f"{folders[k].name}_{name}", folders[k].parent
    return found


def format_suffixes() -> set[str]:
    """Return the suffixes of the supported formats."""
    return {suffix for known in FORMATS for suffix in known.suffixes}


def _files_below(folder: Path, depth: int = SETTINGS.folder_depth_max) -> Iterator[Path]:
    """Generate files that may contain runs: in the folder, then in its subfolders."""
    entries = sorted(each for each in folder.iterdir() if not each.name.startswith((".", "~$")))
    files = [file for file in entries if file.is_file() and file.name not in _RESULTS]
    # The endings of files with equal names may name their channels: m01.dsp, m01.frc.
    known = {"", *format_suffixes()}
    columns = [file for file in files if file.suffix.lower() not in known and _is_column(file)]
    often = Counter(file.stem for file in columns)
    yield from (file for file in files if (file in columns and often[file.stem] > 1) or _may_hold_runs(file))
    for inner in (each for each in entries if depth and each.is_dir() and not each.is_symlink()):
        if not any((inner / name).is_file() for name in _RESULTS):
            yield from _files_below(inner, depth - 1)


def _is_column(file: Path) -> bool:
    """Return True if a text consists of numbers in one column below lines of words."""
    if b"\0" in _head(file)[:512]:
        return False
    are_numbers = [is_number(line.strip()) for line in _lines(file) if line.strip()]
    return sum(are_numbers) > 1 and all(are_numbers[are_numbers.index(True) : -1])


def _may_hold_runs(file: Path) -> bool:
    """Return True if a file may contain measured runs, judged by its suffix and first bytes.

    Notes, model cards and files of other programs contain no runs. A file with an unknown suffix is accepted
    if the content has a known format or ten rows of numbers.
    """
    suffix = file.suffix.lower()
    if suffix in _NO_RUNS or file.name.endswith("~"):
        return False
    is_known = suffix in format_suffixes()
    if is_known and suffix not in {*_OF_ANYTHING, ".json"}:
        return True
    head = _head(file)
    if suffix == ".json":
        return b'"schema_version"' not in head[:512]
    formats = [known for known in FORMATS if known.recognises(head[:512])]
    if not formats or formats[0].read is not read_text:
        return bool(formats) or _is_packed(head) or (suffix == ".txt" and b"\0" in head)
    lines = _lines(file)
    if is_known and (len(head) == HEAD_BYTES or find_data(lines)[1] is not None):
        return True
    if is_known:
        return not any(line[:1].isalpha() for line in lines)
    return any(holds_samples(lines, delimiter) for delimiter in DELIMITERS)


def _head(file: Path) -> bytes:
    try:
        with file.open("rb") as stream:
            return stream.read(HEAD_BYTES)
    except OSError:  # An unreadable file is reported later.
        return b""


def _lines(file: Path) -> Sequence[str]:
    try:
        return read_lines(file, HEAD_BYTES).lines
    except (OSError, InputError):  # An unreadable file is reported later.
        return ()
