"""The jobs, one row each: what they read, take, do, and how their results are shown.

Every face is made from these rows: commands and their help, the server's requests and forms, columns of
sweeps, the tables of options in the documentation, and ``mrdamper.heat(...)`` in Python. A new job is a
module in ``jobs``, one in ``report``, and a row here.

Rows name modules as text (``"mrdamper.jobs.heat:heat"``), so that reading the table loads nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mrdamper.errors import InputError, option
from mrdamper.schema import Field, Json, fields_of, read_record

if TYPE_CHECKING:
    from mrdamper.report.base import Report
    from mrdamper.runtime.checkpoint import Tell
    from mrdamper.runtime.progress import Progress

_NOTHING: Mapping[str, Any] = MappingProxyType({})

__all__ = ["JOBS", "KINDS", "Input", "Job", "Kind", "find_job", "load"]


def load(name: str) -> Any:  # noqa: ANN401 - whatever has this name
    """Return the object that ``module:name`` names."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of thing that jobs read: from a path, or given as the object itself."""

    metavar: str
    read: str = ""  # module:function, from a path or a preset's name; empty: the job takes it as it is given
    choices: str = ""  # the group of presets in jobs.choices that may be named instead of a file
    place: str = "inputs"  # of the work folder, where the server looks for it
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
    "record": Kind("RECORD", "mrdamper.jobs.inputs:read_record", place="records", options=_RUNS),
    "law": Kind("LAW"),
    "fluid": Kind("PRESET|FILE", "mrdamper.models.fluids.fluid_file:find_fluid", choices="fluids"),
    "preparation": Kind(""),
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
    flag: str = ""  # on the command line; empty: a positional argument; "-": given in Python only
    key: str = ""  # of answers and requests, where it is not the name
    default: str | None = None  # a preset or text; None beside required=False: nothing
    required: bool = True
    label: str = ""  # beside its field on a page
    in_answer: bool = True  # whether the answer begins with its path, where it is required and one file

    @property
    def named_in_answer(self) -> bool:
        return self.in_answer and self.required and not KINDS[self.kind].many

    @property
    def told(self) -> str:
        """The key in answers and requests."""
        return self.key or self.name

    def read(self, given: Any, reading: Mapping[str, Any] = _NOTHING) -> Any:  # noqa: ANN401
        """Return the thing that was named; one that is given as itself is passed on.

        Parameters
        ----------
        given : a path, a preset's name, or the thing itself; of many, a list of these
        reading : options of reading, by name; others are ignored, missing ones have their defaults
        """
        kind = KINDS[self.kind]
        if not kind.read or not (kind.many or isinstance(given, str | Path)):
            return given
        return load(kind.read)(
            given, **{each.name: reading.get(each.name, each.default) for each in kind.fields}
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One row: a job, with all that its faces are made from."""

    name: str
    help: str
    inputs: tuple[Input, ...]
    run: str  # module:function(**inputs, options=..., on_progress=...) -> result
    result: str  # module:class
    report: str  # module:REPORT
    options: str = "mrdamper.jobs.options:NoOptions"  # module:class; without fields, ``run`` takes none
    files_help: str = ""  # what --out is for; empty: the job writes nothing
    out_required: bool = False
    set_when_written: tuple[str, ...] = ()  # options that are None by default, and mean: with a folder
    progress_word: str = "run"  # of what the progress counts; empty: ``run`` takes no ``on_progress``
    checkpoint: str = ""  # module:function(**inputs, options=...) -> all that decides the result; with it the
    # job can be resumed, and ``run`` takes a ``checkpoint``
    stream: str = ""  # the file that ``run`` writes as it goes, to its argument ``stream``
    ctrl_c: str = ""  # what an interrupt does, in a word or two, where the job does not simply end
    page: str = ""  # where the pages have it
    aliases: tuple[str, ...] = ()  # its other names in Python

    @property
    def options_type(self) -> type:
        found: type = load(self.options)
        return found

    @property
    def fields(self) -> tuple[Field, ...]:
        """The options' fields."""
        return fields_of(self.options_type)

    @property
    def reading(self) -> tuple[Field, ...]:
        """The options of reading the inputs, each once."""
        found = [field for each in self.inputs for field in KINDS[each.kind].fields]
        return tuple({field.name: field for field in found}.values())

    @property
    def given_names(self) -> tuple[str, ...]:
        """Names of all that ``perform`` takes beside the options: inputs, and options of reading them."""
        return (*(each.name for each in self.inputs), *(field.name for field in self.reading))

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

    def reading_from(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return checked options of reading, by name; raise ``InputError`` with a line for each fault."""
        checked: dict[str, Any] = {}
        for kind in dict.fromkeys(KINDS[each.kind].options for each in self.inputs):
            if kind:
                names = [each.name for each in fields_of(load(kind))]
                record = read_record(load(kind), {k: v for k, v in given.items() if k in names}, self.name)
                checked |= {name: getattr(record, name) for name in names}
        return checked

    def __call__(self, given: Mapping[str, Any], options: Any, on_progress: Progress | None = None) -> Any:  # noqa: ANN401
        """Read what is named in ``given``, run the job, return its result.

        Parameters
        ----------
        given : path, preset or object of each input, by name, and options of reading; inputs that are not
            required may be missing
        options : of the job's own type
        """
        return self._run(self._read(given), options, on_progress)

    def _read(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the things that the job works on, by name."""
        return {each.name: self._value(each, given) for each in self.inputs}

    def _value(self, each: Input, given: Mapping[str, Any]) -> Any:  # noqa: ANN401
        value = given.get(each.name)
        value = each.default if value is None else value
        return None if value is None else each.read(value, given)

    def _run(self, things: Mapping[str, Any], options: Any, on_progress: Progress | None, **more: Any) -> Any:  # noqa: ANN401
        if self.progress_word and on_progress is not None:
            more["on_progress"] = on_progress
        if self.fields:
            more["options"] = options
        return load(self.run)(**things, **more)

    def perform(
        self,
        given: Mapping[str, Any],
        options: Any = None,  # noqa: ANN401 - of the job's own type
        *,
        out: Path | None = None,
        on_progress: Progress | None = None,
        resume: bool | None = None,
        tell: Tell | None = None,
    ) -> tuple[Any, Json]:
        """Run the job and write its files, all or none; return (result, answer).

        Parameters
        ----------
        given : as ``__call__`` takes it
        options : None: the usual ones
        resume : go on with what the same job into the same folder had finished; False: begin anew, but keep
            what is finished; None: keep nothing
        tell : told what is done with an earlier run's progress
        """
        options = self.options_type() if options is None else options
        for name in self.set_when_written:
            if getattr(options, name) is None:
                options = replace(options, **{name: out is not None})
        reported = self.reported  # loaded now: what an interrupted job has found can be written at once
        things = self._read(given)
        head = self._head(given)
        if out is not None:
            kept = resume if self.checkpoint else None
            return self._into(out, things, options, head, on_progress, resume=kept, tell=tell)
        if resume:
            raise InputError(
                f"{option('resume')} goes on with what is kept beside {option('out')}",
                expected=f"an {option('out')}",
            )
        result = self._run(things, options, on_progress)
        return result, {**head, **reported.answer(result)}

    def _into(
        self,
        out: Path,
        things: Mapping[str, Any],
        options: Any,  # noqa: ANN401
        head: Mapping[str, object],
        on_progress: Progress | None,
        *,
        resume: bool | None,
        tell: Tell | None,
    ) -> tuple[Any, Json]:
        """Run the job on things that are read, its files into a folder; return (result, answer)."""
        from mrdamper.report.base import write_report
        from mrdamper.runtime.checkpoint import checkpointed
        from mrdamper.runtime.outputs import atomic_output

        decisive = {} if resume is None else load(self.checkpoint)(**things, options=options)
        more: dict[str, Any] = {}
        with checkpointed(out, decisive, resume=resume, tell=tell) as kept:
            if kept is not None:
                more["checkpoint"] = kept
            with atomic_output(out) as beside:
                with ExitStack() as open_files:
                    if self.stream:
                        more["stream"] = open_files.enter_context((beside / self.stream).open("wb"))
                    result = self._run(things, options, on_progress, **more)
                answer = write_report(self.reported, result, beside, out, head)
            if kept is not None:
                kept.finished = self.reported.outcome(result).exit_code == 0
        return result, answer

    def _head(self, given: Mapping[str, Any]) -> dict[str, str]:
        """Return what an answer begins with: the files that were named, by key."""
        named = {each.told: given.get(each.name) for each in self.inputs if each.named_in_answer}
        return {key: str(value) for key, value in named.items() if isinstance(value, str | Path)}

    def save(self, result: object, out: Path) -> Json:
        """Write a result's files into a folder, all or none; return the answer, with their paths."""
        from mrdamper.report.base import write_report
        from mrdamper.runtime.outputs import atomic_output

        with atomic_output(out) as beside:
            return write_report(self.reported, result, beside, out, _NOTHING)


CARD = Input(name="card", kind="card", help="The model card.")
CARD_OF_ANY_LAW = Input(name="card", kind="card of any law", help="The model card.")
RUNS = Input(name="runs", kind="runs", help="Files, folders or patterns of runs.")
PREPARATION = Input(
    name="preparation",
    kind="preparation",
    flag="-",
    required=False,
    help="How runs are prepared; None: as the job does by itself.",
)
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
        name="check",
        help="""Tell what is wrong with runs before they are fitted, and how their files were understood.

        PATH: files, folders or patterns of runs. Exit code 5 when a run has a fault.
        """,
        inputs=(Input(name="files", kind="files", help="Files, folders or patterns of runs."),),
        run="mrdamper.jobs.check:check",
        result="mrdamper.jobs.check:CheckResult",
        report="mrdamper.report.check:REPORT",
        files_help="For check.html, check.json, findings.csv.",
        page="the page Runs",
    ),
    Job(
        name="identify",
        help="""Fit one hysteresis law to measured runs over all currents and temperatures at once.

        PATH: files, folders or patterns of runs.
        """,
        inputs=(
            RUNS,
            Input(
                name="law",
                kind="law",
                flag="--law",
                required=False,
                help="series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating, spencer, lugre, dahl, "
                "bingham, tanh; auto; or file.py:Class.  [default: series-valve; double-bouc-wen for "
                "tempered runs]",
                label="Law",
            ),
            Input(
                name="fluid",
                kind="fluid",
                flag="--fluid",
                required=False,
                help="Take temperature laws from a fluid (paper, lord-mrf-132dg, a file), marked as assumed.",
                label="Fluid, where runs do not tell",
            ),
            PREPARATION,
        ),
        options="mrdamper.jobs.options:FitOptions",
        run="mrdamper.jobs.identify:identify",
        result="mrdamper.jobs.identify:IdentifyResult",
        report="mrdamper.report.identify:REPORT",
        files_help="For card.json, report.html, errors.csv.",
        out_required=True,
        progress_word="start",
        checkpoint="mrdamper.jobs.identify:decisive",
        ctrl_c="keeps the best",
        page="the page Identify",
        aliases=("fit",),
    ),
    Job(
        name="predict",
        help="Score a model card on runs that it has not seen.",
        inputs=(CARD_OF_ANY_LAW, RUNS, PREPARATION),
        run="mrdamper.jobs.predict:predict",
        result="mrdamper.jobs.predict:PredictResult",
        report="mrdamper.report.predict:REPORT",
        files_help="Write errors.csv there.",
        progress_word="",
        page="the page Cards",
    ),
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
