"""Call the job functions for requests to the server.

A request contains names of files. This module replaces them by paths in the work folder and computes nothing.
The command line calls the same job functions.
"""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX
from mrdamper.jobs.previews.choices import choices, run_formats
from mrdamper.runtime.progress import Progress
from mrdamper.schema import Field, Json
from mrdamper.web.schemas import ORDER_JOBS
from mrdamper.web.workspace import NotThereError, WorkFolder


def do(
    kind: str, options: Json, folder: WorkFolder, out: Path, progress: Progress, *, resume: bool = False
) -> Json:
    """Run a job, write its files, and return the values that the page displays.

    The files are written to the folder ``out``. Cards are written to ``cards/`` and simulated runs to
    ``runs/`` of the work folder. If ``resume`` is True, a sweep continues after its finished tasks.
    """
    job = ORDER_JOBS[kind]
    inputs = [each for each in (*job.inputs, *job.reading) if each.key in options]
    chosen = {each.name: options[each.name] for each in job.fields if each.name in options}
    if job.out == "card":
        out = folder.new(folder.cards, options["card"])
    result, answer = job.perform(
        {each.name: _located(folder, each, options[each.key]) for each in inputs},
        job.options_from(chosen),
        out=folder.runs if job.out == "runs" else out,
        on_progress=progress,
        resume=resume,
    )
    root = json.dumps(f"{folder.root}{os.sep}")[1:-1]  # Paths in answers are relative to the folder.
    shown = json.loads(json.dumps(job.reported.for_page(result)).replace(root, ""))
    return {**answer, **shown, **(_packed(out, options["name"]) if kind == "export" else {})}


def _located(folder: WorkFolder, field: Field, value: Any) -> Any:  # noqa: ANN401 - a path, a name, or several
    """Return the value of a job input; names of files in the work folder become paths."""
    option = field.option
    if option.places == ("runs",):
        return _runs(folder, value) if field.required or value is not None else None
    if value is None or not option.places:
        return value
    if field.many:
        return tuple(_path_or_preset(folder, field, name) for name in value) or None
    return _path_or_preset(folder, field, value)


def _runs(folder: WorkFolder, names: list[str] | None) -> list[Path]:
    """Return the paths of run files by their names; with None, the paths of all run files."""
    if names is not None:
        return [folder.run_file(name) for name in names]
    found = folder.run_files(tuple(run_formats()))
    if not found:
        raise InputError(
            "no runs in the folder", remedy=f"add files first (and their {MAP_SUFFIX} to the same folder)"
        )
    return found


def _path_or_preset(folder: WorkFolder, field: Field, name: str) -> str:
    """Return the path of a named file; presets and texts of load cycles are unchanged."""
    option = field.option
    presets: Any = choices().get(option.offers, ())
    is_duty = option.word == "duty"
    if name in presets or (is_duty and not name.lower().endswith(".csv") and name.count(":") >= 2):
        return name
    finders = {
        "inputs": folder.input,
        "cards": folder.card,
        "records": folder.record,
        "runs": folder.run_file,
        "maps": folder.channel_map,
    }
    for place in option.places[:-1]:
        with suppress(NotThereError):
            return str(finders[place](name))
    try:
        return str(finders[option.places[-1]](name))
    except NotThereError as fault:
        if not (presets or is_duty):
            raise
        known = "such as sine:15mm:1Hz:2A:1800s" if is_duty else f"one of: {', '.join(presets)}"
        found = f"neither an input in the folder nor {known}"
        raise InputError(place=f"{option.word} {name!r}", found=found) from fault


def _packed(out: Path, name: str) -> Json:
    """Create ZIP archives of exported folders; return the platforms of the FMU."""
    for folder in filter(Path.is_dir, (out / f"{name}_c", out / f"{name}_matlab")):
        shutil.make_archive(str(folder), "zip", out, folder.name)
    if not (fmu := out / f"{name}.fmu").exists():
        return {}
    with zipfile.ZipFile(fmu) as archive:
        parts = [path.split("/") for path in archive.namelist()]
    return {"fmu_platforms": sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2})}
