"""Public data into a folder of runs: each file with its channel map beside it, ready to be fitted.

The catalogue and the download are ``mrdamper data``'s. The maps are those of the examples, which are not
installed with the program; a test holds the copies here to them.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from mrdamper.data.catalog import fetch, list_sets
from mrdamper.errors import InputError
from mrdamper.runtime.outputs import atomic_output
from mrdamper.schema import Json

__all__ = ["MAPS", "catalogue", "data_fetch", "data_list", "fetch_into"]

MAPS = Path(__file__).parent

Report = Callable[[int, int, str], None]


def catalogue() -> list[Json]:
    """Return the public data sets in words, with the names of their files."""
    return [
        {
            "name": each.name,
            "title": each.title,
            "notes": each.notes,
            "licence": each.licence,
            "doi": each.doi or None,
            "repository": each.repository,
            "commit": each.commit,
            "files": [file.name for file in each.files],
        }
        for each in list_sets()
    ]


def fetch_into(runs: Path, name: str, map_suffix: str, *, report: Report | None = None) -> Json:
    """Fetch a public data set and put its files into ``runs``, all of them or none.

    Parameters
    ----------
    map_suffix : what the name of a file's channel map ends with

    Raises
    ------
    InputError
        No such set, no connection, or a file that is not the one pinned.
    """
    if report is not None:
        report(0, 1, f"fetching {name}")
    try:
        lies = Path(str(data_fetch(name)["folder"]))
    except InputError as fault:
        if isinstance(fault.__cause__, OSError):  # of requests, too
            raise InputError(
                f"{name}: nothing was fetched: the server's machine has no connection to github.com, where "
                "this set lies. Connect it and try again; or start the server with MRDAMPER_DATA set to a "
                "folder that holds the files; or download them elsewhere and drop them on the page Runs"
            ) from fault
        raise
    chosen = next(each for each in list_sets() if each.name == name)
    found = [file.name for file in chosen.files if (lies / file.name).is_file()]
    with atomic_output(runs) as beside:
        for file in found:
            shutil.copyfile(lies / file, beside / file)
            shutil.copyfile(MAPS / chosen.channels, beside / f"{file}{map_suffix}")
    missing = [file.name for file in chosen.files if file.name not in found]
    return {
        "name": name,
        "title": chosen.title,
        "licence": chosen.licence,
        "doi": chosen.doi or None,
        "repository": chosen.repository,
        "commit": chosen.commit,
        "runs": found,
        "notes": [chosen.notes, *([f"not there: {', '.join(missing)}"] if missing else [])],
    }


def data_list() -> list[Json]:
    """Return the public data sets that can be fetched."""
    return [
        {
            "name": each.name,
            "title": each.title,
            "files": len(each.files),
            "licence": each.licence,
            "doi": each.doi or None,
            "repository": each.repository,
            "commit": each.commit,
            "channels": each.channels,
            "notes": each.notes,
        }
        for each in list_sets()
    ]


def data_fetch(name: str) -> Json:
    """Fetch a public data set (or find it in the local mirror ``MRDAMPER_DATA``) and say where it lies."""
    folder = fetch(name)
    return {"name": name, "folder": str(folder), "files": [str(path) for path in sorted(folder.iterdir())]}
