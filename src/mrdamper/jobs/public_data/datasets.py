"""The jobs ``data list`` and ``data fetch``: list and download public data sets.

The channel maps that read the files are copies of the maps in the examples, because the examples are not
installed with the program. A test checks that the copies are equal.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mrdamper.jobs.public_data.catalog import DataSet, fetch, list_sets
from mrdamper.results import JobResult
from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

MAPS = Path(__file__).parent


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
        """All files in the folder, sorted by name."""
        return sorted(self.folder.iterdir())

    @property
    def runs(self) -> list[Path]:
        """The files of the set that are present in the folder."""
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
