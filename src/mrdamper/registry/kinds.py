"""Kinds of the inputs of jobs.

Names of readers are text (``"mrdamper.models.card_schema:read_card"``), because the table loads no module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mrdamper.results import load
from mrdamper.schema import Field, fields_of

NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of input: a path or preset to read, or the object itself."""

    metavar: str
    read: str = ""  # module:function that reads a path or preset; empty: the job gets the value unchanged
    choices: str = ""  # group of presets in jobs.choices that are accepted instead of a file
    place: str = "inputs"  # subfolder of the work folder on the server
    also: str = ""  # second subfolder with selectable files
    files: str = ".toml"  # suffix of files that users write
    looks: tuple[str, ...] = ()  # file contents that the server accepts (``web.inputs``)
    group: str = ""  # heading in forms
    options: str = ""  # module:class of the options for reading, which are keyword arguments of ``read``

    @property
    def fields(self) -> tuple[Field, ...]:
        """Return the options for reading."""
        return fields_of(load(self.options)) if self.options else ()


_RUNS = "mrdamper.jobs.options:RunsReading"
_OWN_LAW = "mrdamper.jobs.options:LawReading"

KINDS: Mapping[str, Kind] = {
    "card": Kind("CARD", "mrdamper.models.card_schema:read_card", place="cards"),
    "card of any law": Kind("CARD", "mrdamper.jobs.inputs:read_card_of_law", place="cards", options=_OWN_LAW),
    "runs": Kind("PATH...", "mrdamper.jobs.inputs:read_dataset", place="runs", options=_RUNS),
    "files": Kind(
        "PATH...",
        "mrdamper.jobs.inputs:read_files",
        place="runs",
        options="mrdamper.jobs.options:FilesReading",
    ),
    "record": Kind(
        "RECORD",
        "mrdamper.data.readers:read_file",
        place="records",
        options="mrdamper.jobs.options:MapReading",
    ),
    "law": Kind("LAW", choices="laws", place=""),
    "campaigns": Kind("PATH...", place="runs"),
    "name": Kind("NAME", "builtins:str", place=""),
    "virtual damper": Kind(
        "PRESET|FILE", "mrdamper.virtual_rig.damper:find_damper", choices="plants", looks=("damper",)
    ),
    "campaign": Kind(
        "PRESET|FILE", "mrdamper.virtual_rig.campaign:find_campaign", choices="campaigns", looks=("campaign",)
    ),
    "plant": Kind(
        "PRESET|FILE|CARD",
        "mrdamper.jobs.track:read_plant",
        choices="plants",
        also="cards",
        looks=("damper",),
    ),
    "scenario": Kind("NAME|FILE", "mrdamper.jobs.track:read_targets", choices="targets", looks=("scenario",)),
    "rheometer table": Kind(
        "TABLE.csv...",
        "mrdamper.data.rheometer:read_rheometer_tables",
        files=".csv",
        looks=("rheometer",),
    ),
    "fluid": Kind(
        "PRESET|FILE", "mrdamper.models.fluids.fluid_file:find_fluid", choices="fluids", looks=("fluid",)
    ),
    "preparation": Kind(""),
    "settings": Kind(""),
    "drawing": Kind(
        "FILE|paper", "mrdamper.thermal.drawing_file:read_drawing", choices="dampers", looks=("drawing",)
    ),
    "drawings": Kind(
        "FILE|paper",
        "mrdamper.jobs.sweep.plan:read_drawings",
        choices="dampers",
        looks=("drawing",),
    ),
    "sink": Kind("FILE", "mrdamper.thermal.drawing_file:read_sink", group="More", looks=("sink", "drawing")),
    "duty": Kind("DUTY", "mrdamper.thermal.duty:read_duty", files=".csv", looks=("duty",)),
    "motion": Kind("MOTION|RUN", place=""),
    "curve": Kind(
        "CURVE.csv",
        "mrdamper.thermal.estimation.measured_curve:read_curve",
        group="More",
        files=".csv",
        looks=("curve",),
    ),
}


def read_input(field: Field, given: Any, reading: Mapping[str, Any] = NOTHING) -> Any:  # noqa: ANN401
    """Return the object of a path or preset. An object is returned unchanged.

    Parameters
    ----------
    given : path, name of a preset, or object; a list of these if the input has several values
    reading : options for reading, by name; others are ignored, missing ones have their defaults
    """
    kind = KINDS[field.option.kind]
    if not kind.read or not (field.many or isinstance(given, str | Path)):
        return given
    single = field.many and isinstance(given, str | Path)
    return load(kind.read)(
        [given] if single else given,
        **{each.name: reading.get(each.name, each.default) for each in kind.fields},
    )
