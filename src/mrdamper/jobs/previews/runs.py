"""Preview of a file with measurements: its columns, their interpretation, and faults of the runs.

The preview helps the user to map channels. If the runs of a file are not readable, the columns are returned
with the reason. No file is written.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.finding import severity_rank
from mrdamper.data.formats.table import Table
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.readers import map_beside, read_file
from mrdamper.data.records import Recording
from mrdamper.data.tables import read_tables
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import MAP_SUFFIX, read_toml
from mrdamper.jobs.public_data import MAPS
from mrdamper.quantities import ZERO_CELSIUS_K, to_si
from mrdamper.schema import Json, finite_or_none

if TYPE_CHECKING:  # ``data.prepare`` loads slowly, and ``glance`` does not need ``data.prepare``.
    from mrdamper.data.prepare import PreparedRun

# Max number of points in a preview, and max number of samples from which the points are chosen.
_LOOP_POINT_COUNT, _LOOP_SAMPLES_MAX = 800, 4000
_TEXTS = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")


def look(path: Path, given: Mapping[str, Any] | None = None) -> Json:
    """Return the content of a file, and the runs in it according to a channel map.

    Parameters
    ----------
    given : channel map; None: the map next to the file, if there is one

    Raises
    ------
    InputError
        If the channel map is invalid.
    """
    view, read = look_into(path, given)
    if read is None:
        return vars(view)
    described = [run_row(read, recording) for recording in read.recordings[:200]]
    view.runs = [{**row, "file": path.name} for row, _ in described]
    view.checked = sum(map(len, read.recordings)) <= 200_000  # Larger files are not diagnosed immediately.
    if view.checked:
        view.findings = [
            finding
            for recording, (_, prepared) in zip(read.recordings, described, strict=False)
            for finding in _findings(read, recording, prepared)
        ]
    return vars(view)


def glance(path: Path, given: Mapping[str, Any] | None = None) -> Json | None:
    """Return a preview of the first lines of a large file, in the format of ``look``.

    Return None if the file is small or not a text. Then use ``look``. ``head_share`` is the fraction of the
    file that was read. ``rows`` is None because the number of rows is unknown. The preview contains no runs,
    because a test can continue after the first lines. Therefore a channel map that splits the file into tests
    can fail on the first lines, and its errors are not reported.
    """
    glance_bytes = 1 << 18  # bytes that ``glance`` reads from the beginning of a file
    glance_file_min_bytes = 1 << 21  # ``glance`` applies only to files of this size [bytes] and larger ones.
    size = path.stat().st_size
    if size < glance_file_min_bytes or path.suffix.lower() not in _TEXTS:
        return None
    with path.open("rb") as file:
        head = file.read(glance_bytes)
    if b"\x00" in head or b"\n" not in head:  # The file is binary or encoded in UTF-16.
        return None
    head = head[: head.rfind(b"\n") + 1]
    document = _document_beside(path) if given is None else dict(given)
    with tempfile.TemporaryDirectory(prefix="mrdamper-") as beside:
        place = Path(beside) / path.name
        place.write_bytes(head)
        view, read = look_into(place, document or {})
    if not view.columns:
        return None
    if read is not None or (document or {}).get("segments"):
        view.error = None
    return vars(view) | {"bytes": size, "rows": None, "map": document, "head_share": len(head) / size}


@dataclass(kw_only=True)
class FileView:
    """Preview of a file, with the fields that a web page displays."""

    name: str
    bytes: int
    map: Json | None
    understood: str | None = None
    rows: int | None = None
    columns: list[Json] = field(default_factory=list)
    more_columns: int = 0
    step_s: float | None = None
    runs: list[Json] = field(default_factory=list)
    findings: list[Json] = field(default_factory=list)
    checked: bool = False
    error: str | None = None
    questions: list[Json] = field(default_factory=list)
    offers: list[Json] = field(default_factory=list)


def look_into(path: Path, given: Mapping[str, Any] | None = None) -> tuple[FileView, RigFile | None]:
    """Return the preview of a file, and the content that was read.

    If no run is readable, None replaces the content, and ``error`` of the preview has the reason.
    """
    most_columns = 64
    document = _document_beside(path) if given is None else dict(given)
    chosen = ChannelMap.from_dict(document or {}, "channel map")
    view = FileView(name=path.name, bytes=path.stat().st_size, map=document)
    read: RigFile | None = None
    try:
        tables = read_tables(path, chosen.file)
        table = tables[0]
        view.understood, view.rows, view.step_s = table.layout.in_words(), table.rows, table.step_s
        roles = {}
        try:
            read = runs_in(tables, chosen, path)
            roles = {column.name: column.role for column in read.columns}
        except InputError as fault:
            view.error = _short(str(fault), path)
            asked = fault.questions if isinstance(fault, AskingError) else ()
            view.questions = [dict(question.to_dict()) for question in asked]
            view.offers = [] if document else _offers(tables, path)
        view.columns = [
            _column(table, k, name, roles.get(name)) for k, name in enumerate(table.names[:most_columns])
        ]
        view.more_columns = max(0, len(table.names) - most_columns)
    except InputError as fault:
        view.error = _short(str(fault), path)
    return view, read


def _offers(tables: Sequence[Table], path: Path) -> list[Json]:
    """Return channel maps (of the package or the same folder) that can read a file."""
    most_offers = 20  # max number of channel maps of other files that are tried
    known = (*sorted(MAPS.glob("*.toml")), *sorted(path.parent.glob(f"*{MAP_SUFFIX}"))[:most_offers])
    offers: list[Json] = []
    for place in known:
        try:
            document = read_toml(place, "channel map")
            read = runs_in(tables, ChannelMap.from_dict(document, place.name), path)
        except (InputError, OSError):
            continue
        if all(document != offer["map"] for offer in offers):
            name = place.name.removesuffix(MAP_SUFFIX).removesuffix(".toml")
            offers.append({"name": name, "map": document, "runs": len(read.recordings)})
    return offers


def findings_in(path: Path) -> Json:
    """Return a list of findings for each run in a file. The diagnosis of very long runs takes minutes."""
    try:
        read = read_file(path)
    except InputError:
        return {"findings": []}
    return {"findings": [_findings(read, run) for run in read.recordings]}


def _findings(read: RigFile, run: Recording, prepared: PreparedRun | None = None) -> list[Json]:
    """Return the findings about a run from reading its file and from its diagnosis, worst first."""
    from mrdamper.data.diagnosis.diagnose import diagnose

    found = [*diagnose(run, prepared), *(each for each in read.findings if each.run == run.name)]
    return [dict(each.to_dict()) for each in sorted(found, key=severity_rank)]


def run_row(read: RigFile, recording: Recording) -> tuple[Json, PreparedRun | None]:
    """Return the main values of a run for a table, and the prepared run (None if the run is invalid)."""
    from mrdamper.data.prepare import prepare_run

    prepared, error = None, None
    try:
        prepared = prepare_run(recording.checked())
    except InputError as fault:
        error = str(fault)
    time, command, warm = recording.time, recording.command, recording.temperature
    steps = np.diff(time)
    step = float(np.median(steps)) if len(steps) and np.isfinite(steps).all() else 0.0
    held = None if prepared is None else prepared.run.constant_command
    degrees = None if warm is None else warm - ZERO_CELSIUS_K
    row: Json = {
        "name": recording.name,
        "motion": "" if prepared is None else prepared.motion,
        "command": held,
        "command_unit": recording.command_unit,
        "command_range": _ends(command),
        "current_A": held if recording.command_unit == "A" else None,
        "temperature_degC": None
        if degrees is None or not len(degrees)
        else finite_or_none(float(np.mean(degrees))),
        "temperature_range_degC": None if degrees is None else _ends(degrees),
        "samples": len(recording),
        "rate_Hz": 1.0 / step if step > 0.0 else None,
        "duration_s": finite_or_none(float(time[-1] - time[0])) if len(time) else None,
        "stroke_mm": None if len(recording.displacement) == 0 else _span(recording.displacement * 1e3),
        "peak_velocity_mm_s": None
        if prepared is None
        else 1e3 * float(np.abs(prepared.trajectory.velocity).max()),
        "force_range_N": _ends(recording.force),
        "cycle": None if prepared is None else _last_cycle(prepared),
        "inferred": [each.in_words() for each in read.inferred if each.run == recording.name],
        "usable": error is None,
        "error": error,
    }
    return row, prepared


def _last_cycle(prepared: PreparedRun) -> Json | None:
    """Return forces, energy and equivalent damping of the last complete cycle; None if there is none."""
    from mrdamper.data.cycles import cycles

    found = cycles(prepared)
    if not len(found):
        return None
    period, amplitude, energy = found.period_s[-1], found.amplitude_m[-1], float(found.energy_J[-1])
    return {
        "highest_force_N": float(found.highest_force_N[-1]),
        "lowest_force_N": float(found.lowest_force_N[-1]),
        "energy_J": energy,
        "damping_Ns_m": energy / (math.pi * (2.0 * math.pi / period) * amplitude**2),
    }


def _document_beside(path: Path) -> dict[str, Any] | None:
    beside = map_beside(path)
    return None if beside is None else read_toml(beside, "channel map")


def _column(table: Table, k: int, name: str, role: str | None) -> Json:
    value_count = 12  # number of displayed values of a column
    cell_max_chars = 120  # max number of displayed characters of a cell
    said = parse_header(name)
    column: Json = {
        "index": k + 1,
        "name": name[:cell_max_chars],
        "unit": table.units.get(name, ""),
        "role": role,
        "guess": None if said is None else {"role": said[0], "unit": _unit(said, table, name)},
    }
    if name in table.texts:
        cells = [None if cell is None else cell[:cell_max_chars] for cell in table.texts[name][:value_count]]
        return column | {
            "kind": "text",
            "first": cells,
            "least": None,
            "most": None,
            "sample": None,
        }
    values = table.columns[name]
    low_high = _ends(values) or [None, None]
    return column | {
        "kind": "number",
        "first": [finite_or_none(value) for value in values[:value_count].tolist()],
        "least": low_high[0],
        "most": low_high[1],
        "sample": _sample(values),
    }


def _unit(said: tuple[str, str], table: Table, name: str) -> str:
    unit = said[1] or table.units.get(name, "")
    try:
        to_si(0.0, unit, said[0])
    except MrdamperError:
        return ""
    return unit


def _sample(values: FloatArray) -> list[float | None]:
    """Return samples from the middle of a column, with equal indices for all columns."""
    begin = max(0, (len(values) - _LOOP_SAMPLES_MAX) // 2)
    part = values[begin : begin + _LOOP_SAMPLES_MAX]
    return [finite_or_none(float(value)) for value in part[:: max(1, len(part) // _LOOP_POINT_COUNT)]]


def _ends(values: FloatArray) -> list[float | None] | None:
    known = values[np.isfinite(values)]
    return [float(known.min()), float(known.max())] if len(known) else None


def _span(values: FloatArray) -> float | None:
    return finite_or_none(float(np.max(values) - np.min(values)))


def _short(message: str, path: Path) -> str:
    """Return a message with the name of the file, without its folder."""
    return message.replace(str(path), path.name)
