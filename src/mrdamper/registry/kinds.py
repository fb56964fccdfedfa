"""Inputs and outputs of jobs, and the kinds of inputs.

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
    many: bool = False  # ``read`` gets a list of paths or objects.
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
    "runs": Kind("PATH...", "mrdamper.jobs.inputs:read_dataset", place="runs", many=True, options=_RUNS),
    "files": Kind(
        "PATH...",
        "mrdamper.jobs.inputs:read_files",
        place="runs",
        many=True,
        options="mrdamper.jobs.options:FilesReading",
    ),
    "record": Kind(
        "RECORD",
        "mrdamper.data.readers:read_file",
        place="records",
        options="mrdamper.jobs.options:MapReading",
    ),
    "law": Kind("LAW", choices="laws", place=""),
    "campaigns": Kind("PATH...", place="runs", many=True),
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
    "scenario": Kind(
        "NAME|FILE", "mrdamper.jobs.track:read_targets", choices="targets", many=True, looks=("scenario",)
    ),
    "rheometer table": Kind(
        "TABLE.csv...",
        "mrdamper.data.rheometer:read_rheometer_tables",
        many=True,
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
        many=True,
        looks=("drawing",),
    ),
    "sink": Kind("FILE", "mrdamper.thermal.drawing_file:read_sink", looks=("sink", "drawing")),
    "duty": Kind("DUTY", "mrdamper.thermal.duty:read_duty", files=".csv", looks=("duty",)),
    "motion": Kind("MOTION|RUN", place=""),
    "curve": Kind(
        "CURVE.csv", "mrdamper.thermal.estimation.measured_curve:read_curve", files=".csv", looks=("curve",)
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One input of a job."""

    name: str  # argument of the job
    kind: str  # a key of KINDS
    help: str = ""
    flag: str = ""  # option of the command line; empty: positional argument; "-": in Python only
    key: str = ""  # key in answers and requests if it differs from the name
    default: str | None = None  # preset or text; None with required=False: no value
    required: bool = True
    default_help: str = ""  # meaning of a missing value
    label: str = ""  # label in forms
    group: str = ""  # heading in forms
    begins: Any = None  # initial value in forms if it differs from the default
    in_answer: bool | None = None  # The answer contains the path. None: if the input is one required file.

    @property
    def named_in_answer(self) -> bool:
        if self.in_answer is None:
            return self.required and not KINDS[self.kind].many
        return self.in_answer

    @property
    def told(self) -> str:
        """Return the key in answers and requests."""
        return self.key or self.name

    def read(self, given: Any, reading: Mapping[str, Any] = NOTHING) -> Any:  # noqa: ANN401
        """Return the object of a path or preset. An object is returned unchanged.

        Parameters
        ----------
        given : path, name of a preset, or object; a list of these if the kind has ``many``
        reading : options for reading, by name; others are ignored, missing ones have their defaults
        """
        kind = KINDS[self.kind]
        if not kind.read or not (kind.many or isinstance(given, str | Path)):
            return given
        many = kind.many and isinstance(given, str | Path)
        return load(kind.read)(
            [given] if many else given,
            **{each.name: reading.get(each.name, each.default) for each in kind.fields},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """One output of a job with its own path. ``WrittenFile.output`` contains its name."""

    name: str
    metavar: str  # FILE, or DIR for a folder
    help: str

    @property
    def flag(self) -> str:
        return f"--{self.name.replace('_', '-')}"
