"""Calls of the job functions: names in the folder are replaced by paths.

The command line calls the same job functions. Nothing is computed here.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError
from mrdamper.files import MAP_SUFFIX
from mrdamper.jobs.previews.choices import choices, run_formats
from mrdamper.registry import KINDS, Job
from mrdamper.runtime.progress import Progress, ProgressUpdate
from mrdamper.schema import Field, Json, finite_or_none
from mrdamper.web.schemas import job_of
from mrdamper.web.workspace import NotThereError, WorkFolder

Say = Callable[..., None]
"""Callback for progress, with the keywords done, of, text, and further values of a fit."""

_NOT_FETCHED = (
    "nothing was fetched: the server's machine has no connection to github.com. Connect "
    "it and try again; or start the server with MRDAMPER_DATA set to a folder that holds the files; or "
    "download them elsewhere and drop them on the page Data"
)


def do(kind: str, options: Json, folder: WorkFolder, out: Path, say: Say, *, resume: bool = False) -> Json:
    """Run a job, write its files into ``out`` (a card into its own folder), and return its answer.

    With ``resume`` a sweep continues after its finished tasks.
    """
    answer = _perform(job_of(kind), options, folder, out, say, resume=resume)
    exported = options["what"] if kind == "export" else ()
    for part in {"c", "matlab"} & set(exported):
        _zip(out / f"{options['name']}_{part}", out / f"{options['name']}_{part}.zip")
    if "fmu" in exported:
        answer |= {"fmu_platforms": _platforms(out / f"{options['name']}.fmu")}
    return answer


def _perform(job: Job, options: Json, folder: WorkFolder, out: Path, say: Say, *, resume: bool) -> Json:
    """Run a job of the registry."""
    given: dict[str, Any] = {
        each.name: _thing(folder, each, options) for each in job.inputs if each.option.flag != "-"
    }
    given |= {each.name: options[each.name] for each in job.reading if each.name in options}
    if given.get("channels") is not None:
        given["channels"] = folder.channel_map(options["channels"])
    chosen = {each.name: options[each.name] for each in job.fields if each.name in options}
    place = folder.runs if job.out == "runs" else out
    try:
        result, answer = job.perform(
            given,
            job.options_from(chosen),
            out=folder.new(folder.cards, options["card"]) if job.out == "card" else place,
            on_progress=_progress(say, job.progress_word),
            resume=resume,
        )
    except InputError as fault:
        if job.name != "data fetch" or not isinstance(fault.__cause__, OSError):
            raise
        raise InputError(place=options["name"], found=_NOT_FETCHED) from fault
    return {**answer, **_in_folder(folder, job.reported.for_page(result))}


def _in_folder(folder: WorkFolder, told: Json) -> Json:
    """Return an answer whose paths are relative to the folder."""
    root = json.dumps(f"{folder.root}{os.sep}")[1:-1]
    found: Json = json.loads(json.dumps(told).replace(root, ""))
    return found


def _thing(folder: WorkFolder, each: Field, options: Json) -> Any:  # noqa: ANN401 - a path, a name, or several
    """Return the path, name or names for an input of a job."""
    kind = KINDS[each.option.kind]
    if kind.place == "runs":
        is_wanted = each.required or options["files"] is not None
        return _runs(folder, options["files"]) if is_wanted else None
    value = options[each.key]
    if each.many and not kind.choices:
        return tuple(map(folder.input, value)) or None
    if each.many:
        return tuple(_preset_or_input(folder, name, kind.choices) for name in value) or None
    if value is None or each.option.kind in {"law", "name"}:
        return value
    if kind.choices and each.option.kind != "plant":
        return _preset_or_input(folder, value, kind.choices)
    finders: dict[str, Callable[[str], Any]] = {
        "duty": lambda name: _duty(folder, name),
        "plant": lambda name: _plant(folder, name),
        "cards": folder.card,
        "records": folder.record,
    }
    find = finders.get(each.option.kind) or finders.get(kind.place) or folder.input
    return find(value)


# ------------------------------------------------------------------------------------------- names to paths


def _runs(folder: WorkFolder, names: list[str] | None) -> list[Path]:
    """Return the run files of these names; None: all run files."""
    if names is not None:
        return [folder.run_file(name) for name in names]
    found = folder.run_files(tuple(run_formats()))
    if not found:
        raise InputError(
            "no runs in the folder", remedy=f"add files first (and their {MAP_SUFFIX} to the same folder)"
        )
    return found


def _preset_or_input(folder: WorkFolder, name: Any, group: str) -> Any:  # noqa: ANN401 - None or a text
    """Return the name of a preset, or the path of an input."""
    presets = choices()[group]
    if name is None or name in presets:  # type: ignore[operator]  # a list
        return name
    try:
        return str(folder.input(name))
    except NotThereError as fault:
        said = ", ".join(map(str, presets))  # type: ignore[call-overload]
        raise InputError(
            place=f"{name!r}", found=f"neither an input in the folder nor one of: {said}"
        ) from fault


def _plant(folder: WorkFolder, name: str) -> str:
    """Return the name of a preset, the path of a virtual damper (TOML), or the path of a card."""
    try:
        return str(_preset_or_input(folder, name, "plants"))
    except InputError:
        return str(folder.card(name))


def _duty(folder: WorkFolder, text: str) -> str:
    """Return the text of a load cycle, or the path of a table inside the folder."""
    if not text.lower().endswith(".csv") and len(text.split(":")) >= 3:
        return text
    try:
        return str(folder.input(text))
    except NotThereError as fault:
        raise InputError(
            place=f"duty {text!r}", found="neither an input in the folder nor such as sine:15mm:1Hz:2A:1800s"
        ) from fault


def _progress(say: Say, word: str) -> Progress:
    """Return the progress callback of a job; ``word`` names the counted items."""

    def on_progress(now: ProgressUpdate) -> None:
        state = asdict(now.detail) if is_dataclass(now.detail) and not isinstance(now.detail, type) else {}
        told: Json = {k: finite_or_none(v) if isinstance(v, float) else v for k, v in state.items()}
        text = now.text
        if word == "row":
            of = "" if now.total is None else f" of {now.total:,}"
            text = f"{now.done:,}{of} rows read, {text}"
        elif "iteration" in told:
            text = f"start {told['start'] + 1} of {told['starts']}, iteration {told['iteration']}"
        say(done=now.done, of=now.total or 0, text=text, **told)

    return on_progress


def _platforms(fmu: Path) -> list[str]:
    """Return the platforms of the binaries in an FMU, as FMI names them: linux64, win64."""
    with zipfile.ZipFile(fmu) as archive:
        parts = [name.split("/") for name in archive.namelist()]
    return sorted({part[1] for part in parts if part[0] == "binaries" and len(part) > 2})


def _zip(folder: Path, path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for each in sorted(folder.rglob("*")):
            if each.is_file():
                archive.write(each, Path(folder.name) / each.relative_to(folder))
