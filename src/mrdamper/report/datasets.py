"""Output of the commands ``data list`` and ``data fetch`` for public data sets."""

from __future__ import annotations

import shutil
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from mrdamper.files import MAP_SUFFIX
from mrdamper.jobs.public_data import FetchedData, PublicData
from mrdamper.report.base import Report, WrittenFile
from mrdamper.schema import Json


def _entries(found: PublicData) -> list[Json]:
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
        for each in found.sets
    ]


def _show_list(found: PublicData, console: Console) -> None:
    """Print the data sets, one paragraph each."""
    for entry in _entries(found):
        console.print(f"[bold]{escape(entry.pop('name'))}[/bold]")
        for key, value in entry.items():
            if value is not None:
                console.print(f"  {key}: {escape(str(value))}")


LISTED = Report(
    fields=lambda found: {"datasets": _entries(found)},
    show=_show_list,
    closing=lambda _, __: [],
    summary=lambda found: [f"{each.name}: {each.title}" for each in found.sets],
    rows=_entries,
)


def _fetched(found: FetchedData) -> Json:
    data = found.data
    more = [f"missing: {', '.join(found.missing)}"] if found.missing else []
    return {
        "name": data.name,
        "folder": str(found.folder),
        "files": [str(path) for path in found.files],
        "title": data.title,
        "licence": data.licence,
        "doi": data.doi or None,
        "repository": data.repository,
        "commit": data.commit,
        "runs": [path.name for path in found.runs],
        "notes": [data.notes, *more],
    }


def _show_fetched(found: FetchedData, console: Console) -> None:
    """Print the paths, one in each line, so that a script can read them."""
    for path in found.files:
        console.print(str(path), markup=False, soft_wrap=True)


def _write_runs(found: FetchedData, folder: Path) -> None:
    """Write each file with its channel map, so that ``fit`` can read it."""
    for path in found.runs:
        shutil.copyfile(path, folder / path.name)
        shutil.copyfile(found.channels, folder / f"{path.name}{MAP_SUFFIX}")


FETCHED = Report(
    fields=_fetched,
    show=_show_fetched,
    closing=lambda _, __: [],
    summary=lambda found: [f"{found.data.name}: {len(found.runs)} files in {found.folder}"],
    files=(WrittenFile(name="", write=_write_runs),),
)
