"""The jobs, one row each: what they read, take, do, and how their results are shown.

Every face is made from these rows: commands and their help, the server's requests and forms, columns of
sweeps, the tables of options in the documentation, and ``mrdamper.heat(...)`` in Python. A new job is a
module in ``jobs``, one in ``report``, and a row here.

Rows name modules as text (``"mrdamper.jobs.heat:heat"``), so that reading the table loads nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mrdamper.schema import Field, Json, fields_of, read_record

if TYPE_CHECKING:
    from mrdamper.report.base import Report
    from mrdamper.runtime.progress import Progress

_NO_HEAD: Mapping[str, object] = MappingProxyType({})

__all__ = ["JOBS", "KINDS", "Input", "Job", "Kind", "find_job", "load"]


def load(name: str) -> Any:  # noqa: ANN401 - whatever has this name
    """Return the object that ``module:name`` names."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of thing that jobs read: from a path, or given as the object itself."""

    metavar: str
    read: str  # module:function, from a path or a preset's name
    choices: str = ""  # the group of presets in jobs.choices that may be named instead of a file
    place: str = "inputs"  # of the work folder, where the server looks for it


KINDS: Mapping[str, Kind] = {
    "card": Kind("CARD", "mrdamper.models.card_schema:read_card", place="cards"),
    "drawing": Kind("FILE|paper", "mrdamper.thermal.drawing_file:read_drawing", choices="dampers"),
    "sink": Kind("FILE", "mrdamper.thermal.drawing_file:read_sink"),
    "duty": Kind("DUTY", "mrdamper.thermal.duty:read_duty"),
    "curve": Kind("CURVE.csv", "mrdamper.thermal.estimation.measured_curve:read_curve"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """One thing that a job reads."""

    name: str  # the job's argument
    kind: str  # a key of KINDS
    help: str = ""
    flag: str = ""  # on the command line; empty: a positional argument
    key: str = ""  # of answers and requests, where it is not the name
    default: str | None = None  # a preset or text; None beside required=False: nothing
    required: bool = True
    label: str = ""  # beside its field on a page

    @property
    def told(self) -> str:
        """The key in answers and requests."""
        return self.key or self.name

    def read(self, given: Any) -> Any:  # noqa: ANN401 - a path, a preset's name, or the thing itself
        """Return the thing that was named; one that is given as itself is passed on."""
        return load(KINDS[self.kind].read)(given) if isinstance(given, str | Path) else given


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One row: a job, with all that its faces are made from."""

    name: str
    help: str
    inputs: tuple[Input, ...]
    options: str  # module:class
    run: str  # module:function(**inputs, options=..., on_progress=...) -> result
    result: str  # module:class
    report: str  # module:REPORT
    files_help: str = ""  # what --out is for; empty: the job writes nothing
    out_required: bool = False
    set_when_written: tuple[str, ...] = ()  # options that are None by default, and mean: with a folder
    progress_word: str = "run"  # of what the progress counts
    page: str = ""  # where the pages have it
    python: str = ""  # its name in Python, where a room has the job's

    @property
    def attribute(self) -> str:
        return self.python or self.name

    @property
    def options_type(self) -> type:
        found: type = load(self.options)
        return found

    @property
    def fields(self) -> tuple[Field, ...]:
        """The options' fields."""
        return fields_of(self.options_type)

    @property
    def reported(self) -> Report[Any]:
        found: Report[Any] = load(self.report)
        return found

    def options_from(self, given: Mapping[str, Any]) -> Any:  # noqa: ANN401 - the job's options
        """Return checked options.

        Raises
        ------
        InputError
            With a line for each fault.
        """
        return read_record(self.options_type, given, self.name)

    def __call__(self, given: Mapping[str, Any], options: Any, on_progress: Progress | None = None) -> Any:  # noqa: ANN401
        """Read what is named in ``given``, run the job, return its result.

        Parameters
        ----------
        given : path, preset or object of each input, by name; inputs that are not required may be missing
        options : of the job's own type
        """
        found = {each.name: self._value(each, given) for each in self.inputs}
        progress = {} if on_progress is None else {"on_progress": on_progress}
        return load(self.run)(**found, options=options, **progress)

    def _value(self, each: Input, given: Mapping[str, Any]) -> Any:  # noqa: ANN401
        value = given.get(each.name)
        value = each.default if value is None else value
        return None if value is None else each.read(value)

    def perform(
        self,
        given: Mapping[str, Any],
        options: Any,  # noqa: ANN401 - of the job's own type
        *,
        out: Path | None = None,
        on_progress: Progress | None = None,
    ) -> tuple[Any, Json]:
        """Run the job and write its files, all or none; return (result, answer)."""
        for name in self.set_when_written:
            if getattr(options, name) is None:
                options = replace(options, **{name: out is not None})
        result = self(given, options, on_progress)
        named = {each.told: given.get(each.name) for each in self.inputs if each.required}
        head = {key: str(value) for key, value in named.items() if isinstance(value, str | Path)}
        return result, self.write(result, out, head)

    def write(self, result: object, out: Path | None, head: Mapping[str, object] = _NO_HEAD) -> Json:
        """Write a result's files into a folder, all or none; return the answer, with their paths.

        Parameters
        ----------
        head : what the answer begins with: the inputs' names
        """
        if out is None:
            return {**head, **self.reported.answer(result)}
        from mrdamper.report.base import write_report
        from mrdamper.runtime.outputs import atomic_output

        with atomic_output(out) as beside:
            return write_report(self.reported, result, beside, out, head)


CARD = Input(name="card", kind="card", help="The model card.")
DRAWING = Input(
    name="drawing",
    kind="drawing",
    flag="--damper",
    key="damper",
    help="The drawing of the damper (TOML), or the paper's.",
    label="Drawing",
)
DUTY = Input(
    name="duty",
    kind="duty",
    flag="--duty",
    default="sine:15mm:1Hz:2A:1800s",
    required=False,
    help="MOTION:COMMAND:DURATION, or a CSV of time, motion and command.",
)

_ROWS = (
    Job(
        name="heat",
        help="Tell how hot a damper gets under a duty, how soon, and where the heat goes.",
        inputs=(
            CARD,
            DRAWING,
            DUTY,
            Input(
                name="sink",
                kind="sink",
                flag="--sink",
                required=False,
                help="A heat sink (TOML table [sink]) in place of the drawing's.",
            ),
            Input(
                name="calibrate",
                kind="curve",
                flag="--calibrate",
                required=False,
                help="A curve measured under this duty (time_s and fluid_degC, body_degC or coil_degC): it "
                "corrects the drawing and narrows the interval.",
            ),
        ),
        options="mrdamper.jobs.options:HeatOptions",
        run="mrdamper.jobs.heat:heat",
        result="mrdamper.jobs.heat:HeatResult",
        report="mrdamper.report.heat:REPORT",
        files_help="For heat.html, heat.json, heat.csv.",
        set_when_written=("by_field",),
        progress_word="step",
        page="the page Heating",
    ),
    Job(
        name="forecast",
        help="Tell from ten minutes of its curve how hot a damper will get, without drawing or card.",
        inputs=(
            Input(
                name="curve",
                kind="curve",
                help="Measured from the duty's start on: time_s and fluid_degC, body_degC or coil_degC.",
            ),
        ),
        options="mrdamper.jobs.options:ForecastOptions",
        run="mrdamper.jobs.forecast:forecast",
        result="mrdamper.jobs.forecast:ForecastResult",
        report="mrdamper.report.forecast:REPORT",
        files_help="For forecast.svg, forecast.json, forecast.csv.",
        progress_word="step",
    ),
)

JOBS: Mapping[str, Job] = {row.name: row for row in _ROWS}
"""The jobs by name, in the order of the help."""


def find_job(name: str) -> Job:
    """Return the job of a name."""
    return JOBS[name]
