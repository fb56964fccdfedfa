"""What jobs read and write: kinds of things, and the inputs and outputs of a row.

Readers are named as text (``"mrdamper.models.card_schema:read_card"``), so that the table loads nothing.
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
    """A kind of thing that jobs read: from a path, or given as the object itself."""

    metavar: str
    read: str = ""  # module:function, from a path or a preset's name; empty: the job takes it as it is given
    choices: str = ""  # the group of presets in jobs.choices that may be named instead of a file
    place: str = "inputs"  # of the work folder, where the server looks for it
    also: str = ""  # another place whose things may be named
    files: str = ".toml"  # suffix of those that people write
    looks: tuple[str, ...] = ()  # what the server takes for one (``web.inputs``)
    many: bool = False  # several paths, which ``read`` takes at once, as it takes the objects themselves
    options: str = ""  # module:class: options of reading, which ``read`` takes by keyword

    @property
    def fields(self) -> tuple[Field, ...]:
        """The options of reading."""
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
    """One thing that a job reads."""

    name: str  # the job's argument
    kind: str  # a key of KINDS
    help: str = ""
    flag: str = ""  # on the command line; empty: a positional argument; "-": given in Python only
    key: str = ""  # of answers and requests, where it is not the name
    default: str | None = None  # a preset or text; None beside required=False: nothing
    required: bool = True
    default_help: str = ""  # what it means where nothing is given
    label: str = ""  # beside its field on a page
    group: str = ""  # the heading that it stands under there
    begins: Any = None  # what is shown there at first, where that is not the default
    in_answer: bool | None = None  # whether the answer begins with its path; None: where it is required and
    # one file

    @property
    def named_in_answer(self) -> bool:
        if self.in_answer is None:
            return self.required and not KINDS[self.kind].many
        return self.in_answer

    @property
    def told(self) -> str:
        """The key in answers and requests."""
        return self.key or self.name

    def read(self, given: Any, reading: Mapping[str, Any] = NOTHING) -> Any:  # noqa: ANN401
        """Return the thing that was named; one that is given as itself is passed on.

        Parameters
        ----------
        given : a path, a preset's name, or the thing itself; of many, a list of these
        reading : options of reading, by name; others are ignored, missing ones have their defaults
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
    """One thing that a job writes to a place of its own: ``WrittenFile.output`` has its name."""

    name: str
    metavar: str  # FILE, or DIR for a folder
    help: str

    @property
    def flag(self) -> str:
        return f"--{self.name.replace('_', '-')}"
