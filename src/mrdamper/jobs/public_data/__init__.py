"""The jobs ``data list`` and ``data fetch``: published measurements of dampers.

``fetch`` downloads a data set into a cache and checks the SHA-256 of each file. If the environment variable
``MRDAMPER_DATA`` is set, ``fetch`` copies the files from that folder and downloads nothing. The catalogue
contains only files with known hashes.

The channel maps that read the files are copies of the maps in the examples, because the examples are not
installed with the program. A test checks that the copies are equal.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import urllib.request
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from mrdamper.errors import InputError
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent
from mrdamper.schema import unknown_name

MAPS = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """A file of a public repository."""

    path: str  # path in the repository
    sha256: str

    @property
    def name(self) -> str:
        return self.path.rsplit("/", 1)[-1]


@dataclass(frozen=True, slots=True)
class DataSet:
    """A public data set: source, licence, and files at a fixed commit."""

    name: str
    title: str
    licence: str
    doi: str  # "" if there is no DOI
    repository: str  # owner/name on GitHub
    commit: str
    channels: str  # file name of the channel map (TOML) for these files, in the folder of this module
    notes: str
    files: tuple[RemoteFile, ...]

    def url(self, file: RemoteFile) -> str:
        """Return the download address of a file at the fixed commit."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{quote(file.path)}"


_UTFSM = "Cap7_ModeloMR/BoucWen Ajuste 2/Preprocesamiento-sinusoidales/Datos_crudos"

DATA_SETS: tuple[DataSet, ...] = (
    DataSet(
        name="utfsm",
        title="MR damper on an MTS press, Universidad Tecnica Federico Santa Maria, Chile, 2022",
        licence="MIT",
        doi="",
        repository="DanielMaurelE/vRTHS_AMBC_MRdamper",
        commit="08753ffd7abd5b19053f7e79149c3a68f49bf73c",
        channels="utfsm_logger.toml",
        notes="Logger text at 1 kHz, sines at 0, 0.25, 0.5, 0.75 and 1 A one after the other in the file.",
        files=(
            RemoteFile(
                f"{_UTFSM}/ME5mm3Hz.txt", "b7a896cd893b99806dd473e9ab49ed3ebab487afe0e86171ba80f07928de6e92"
            ),
        ),
    ),
    DataSet(
        name="utfpr",
        title="LORD MR damper on a shaking table, UTFPR Labcontrol, Brazil, 2020",
        licence="MIT",
        doi="10.5281/zenodo.4445334",
        repository="labcontrol-data/mr-damper",
        commit="e42439f08b227bb08e9923ee2736bedf2f4fe59a",
        channels="utfpr_mat.toml",
        notes="MAT v5 at 100 Hz; the files do not hold the voltage (3.212 V in the two listed here).",
        files=(
            RemoteFile(
                "data/ensaio.A.1.mat", "491b7bb96f9206f98a1428eec3fe7031d6de96151bd035aff5f8a1353488fdf1"
            ),
            RemoteFile(
                "data/ensaio.A.3.mat", "9dda2f2c490afc9577b5266508359e6e44ae9bfaea81a33195c2b05adc31b14d"
            ),
        ),
    ),
)


def list_sets() -> tuple[DataSet, ...]:
    """Return the public data sets of the catalogue."""
    return DATA_SETS


def fetch(name: str, *, folder: Path | None = None) -> Path:
    """Download the missing files of a data set; return the folder with the files.

    Parameters
    ----------
    name : name of the set in the catalogue
    folder : target folder; by default a folder with the name of the set in the user's cache

    Raises
    ------
    InputError
        If the set does not exist, there is no connection, or the hash of a file is wrong.
    """
    chosen = next((known for known in DATA_SETS if known.name == name), None)
    if chosen is None:
        names = [known.name for known in DATA_SETS]
        raise unknown_name(f"no data set {name!r}", name, names)
    target = folder if folder is not None else _cache() / chosen.name
    target.mkdir(parents=True, exist_ok=True)
    mirror = os.environ.get("MRDAMPER_DATA", "")
    kept = 0
    for file in chosen.files:
        here = target / file.name
        if not (here.is_file() and _sha256(here) == file.sha256):
            source = _find_in(Path(mirror), chosen, file) if mirror else _download(chosen, file)
            if source is None:
                continue
            _check(chosen, file, source)
            _place(source, here)
        kept += 1
    if not kept:
        looked = ", ".join(file.name for file in chosen.files)
        raise InputError(
            found=f"MRDAMPER_DATA={mirror} holds no file of {name!r}", expected=f"any of: {looked}"
        )
    return target


def _cache() -> Path:
    """Return the folder of this program in the cache folder of the user."""
    usual = {"darwin": "~/Library/Caches", "win32": os.environ.get("LOCALAPPDATA", "~/AppData/Local")}
    named = os.environ.get("XDG_CACHE_HOME") or usual.get(sys.platform, "~/.cache")
    return Path(named).expanduser() / "mrdamper"


def _find_in(mirror: Path, chosen: DataSet, file: RemoteFile) -> Path | None:
    """Return the path of a file in the folder ``mirror``; None if the file is missing.

    Tried locations: the path in the repository, the folder ``raw``, a folder of the data set, and ``mirror``.
    """
    for place in (file.path, f"raw/{file.name}", f"{chosen.name}/{file.name}", file.name):
        if (mirror / place).is_file():
            return mirror / place
    return None


def _download(chosen: DataSet, file: RemoteFile) -> Path:
    """Download a file into the cache; return its path. The caller checks the hash."""
    patience_s = 60.0  # maximum time without received data [s]
    url, place = chosen.url(file), _cache() / "downloads" / f"{file.sha256[:16]}-{file.name}"
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with urllib.request.urlopen(url, timeout=patience_s) as answer, place.open("wb") as kept:
            shutil.copyfileobj(answer, kept)
    except OSError as error:
        raise InputError(
            place=chosen.name,
            found=f"cannot download {url} ({error})",
            remedy="Check the connection, or name a folder that holds the files in MRDAMPER_DATA",
        ) from error
    return place


def _check(chosen: DataSet, file: RemoteFile, source: Path) -> None:
    found = _sha256(source)
    if found != file.sha256:
        raise InputError(
            place=source,
            found=(
                f"is not {file.name} of {chosen.name} at {chosen.commit[:8]}: SHA-256 {found[:12]}..., "
                f"expected {file.sha256[:12]}.... Delete it and fetch again"
            ),
        )


def _place(source: Path, here: Path) -> None:
    """Copy a file atomically: an interrupted copy leaves no incomplete file ``here``."""
    partial = here.with_name(f".{here.name}.partial")
    shutil.copyfile(source, partial)
    partial.replace(here)


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True, slots=True, repr=False)
class PublicData(JobResult):
    """The public data sets that are available for download."""

    _job = "data list"
    sets: tuple[DataSet, ...]


@dataclass(frozen=True, slots=True, repr=False)
class FetchedData(JobResult):
    """A public data set and the path of its files."""

    _job = "data fetch"
    data: DataSet
    folder: Path

    @property
    def files(self) -> list[Path]:
        """Return all files in the target folder, sorted by name."""
        return sorted(self.folder.iterdir())

    @property
    def runs(self) -> list[Path]:
        """Return the files of the data set that are present in the target folder."""
        return [self.folder / file.name for file in self.data.files if (self.folder / file.name).is_file()]

    @property
    def missing(self) -> list[str]:
        """Return the names of the files of the set that are missing in the folder."""
        return [file.name for file in self.data.files if not (self.folder / file.name).is_file()]

    @property
    def channels(self) -> Path:
        """Return the path of the channel map that reads the files of the set."""
        return MAPS / self.data.channels


def list_data() -> PublicData:
    """Return the public data sets."""
    return PublicData(tuple(list_sets()))


def fetch_data(name: str, *, on_progress: Progress = silent) -> FetchedData:
    """Download a public data set, or copy it from the local mirror ``MRDAMPER_DATA``.

    Raises
    ------
    InputError
        If the set does not exist, there is no connection, or the hash of a file is wrong.
    """
    on_progress(ProgressUpdate(total=1, text=f"fetching {name}"))
    folder = fetch(name)
    return FetchedData(next(each for each in list_sets() if each.name == name), folder)
