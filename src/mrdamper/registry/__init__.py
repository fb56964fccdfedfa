"""The jobs, one row each: what they read, take, do, and how their results are shown.

Every face is made from these rows: commands and their help, the server's requests and forms, columns of
sweeps, the tables of options in the documentation, and ``mrdamper.heat(...)`` in Python. A new job is a
module in ``jobs``, one in ``report``, and a row here.

Rows name modules as text (``"mrdamper.jobs.heat:heat"``), so that reading the table loads nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from glob import has_magic
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mrdamper.errors import InputError, MrdamperError, option
from mrdamper.files import is_folder, is_there
from mrdamper.schema import Field, Json, fields_of, read_record

if TYPE_CHECKING:
    from mrdamper.report.base import Place, Report
    from mrdamper.runtime.checkpoint import Tell
    from mrdamper.runtime.progress import Progress

_NOTHING: Mapping[str, Any] = MappingProxyType({})

__all__ = ["JOBS", "KINDS", "Input", "Job", "Kind", "Output", "load"]


def load(name: str) -> Any:  # noqa: ANN401 - whatever has this name
    """Return the object that ``module:name`` names."""
    module, _, attribute = name.partition(":")
    return attrgetter(attribute)(import_module(module))


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
    "record": Kind("RECORD", "mrdamper.jobs.inputs:read_record", place="records", options=_RUNS),
    "law": Kind("LAW", choices="laws", place=""),
    "plan": Kind("FILE.toml", "mrdamper.jobs.sweep.plan:read_plan", looks=("sweep",)),
    "name": Kind("NAME", "builtins:str", place=""),
    "virtual damper": Kind("FILE", "mrdamper.rig.damper:read_damper", looks=("damper",)),
    "campaign": Kind(
        "PRESET|FILE", "mrdamper.rig.campaign:find_campaign", choices="campaigns", looks=("campaign",)
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
    "drawing": Kind(
        "FILE|paper", "mrdamper.thermal.drawing_file:read_drawing", choices="dampers", looks=("drawing",)
    ),
    "sink": Kind("FILE", "mrdamper.thermal.drawing_file:read_sink", looks=("sink", "drawing")),
    "duty": Kind("DUTY", "mrdamper.thermal.duty:read_duty", files=".csv", looks=("duty",)),
    "curve": Kind(
        "CURVE.csv", "mrdamper.thermal.estimation.measured_curve:read_curve", files=".csv", looks=("curve",)
    ),
    "thermal log": Kind(
        "RECORD.csv", "mrdamper.thermal.estimation.thermal_log:read_thermal_log", files=".csv"
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
class Output:
    """One thing that a job writes to a place of its own: ``WrittenFile.output`` has its name."""

    name: str
    metavar: str  # FILE, or DIR for a folder
    help: str

    @property
    def flag(self) -> str:
        return f"--{self.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One row: a job, with all that its faces are made from."""

    name: str
    help: str
    inputs: tuple[Input, ...]
    run: str  # module:function(inputs by name, options=, on_progress=) -> result
    result: str  # module:class
    report: str  # module:REPORT
    options: str = "mrdamper.jobs.options:NoOptions"  # module:class; without fields, ``run`` takes none
    files_help: str = ""  # what --out is for; empty: the job writes nothing
    out_required: bool = False
    out_default: str = ""
    outputs: tuple[Output, ...] = ()  # the options' ``what`` names those that are wanted
    check: str = ""  # module:function(given, options), before anything is read
    set_when_written: tuple[str, ...] = ()  # options that are None by default, and mean: with a folder
    progress_word: str = "run"  # of what the progress counts; empty: ``run`` takes no ``on_progress``
    checkpoint: str = (
        ""  # module:function(inputs by name, options=) -> all that decides the result; with it the
    )
    # job can be resumed, and ``run`` takes a ``checkpoint``
    keeper: str = "mrdamper.runtime.checkpoint:checkpointed"  # gives the checkpoint of a folder
    stream: str = ""  # the file that ``run`` writes as it goes, to its argument ``stream``
    ctrl_c: str = ""  # what an interrupt does, in a word or two, where the job does not simply end
    page: str = ""  # where the pages have it
    out: str = ""  # where the server lets it write: "card", "runs"; empty: a folder of the job's own
    python: str = ""  # its name in Python, where that is not its own: a room may have that
    aliases: tuple[str, ...] = ()  # its other names in Python

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
        return self._run(given, self._read(given, options), options, on_progress)

    def _read(self, given: Mapping[str, Any], options: Any) -> dict[str, Any]:  # noqa: ANN401
        """Return the things that the job works on, by name."""
        if self.check:
            load(self.check)(given, options)
        return {each.name: self._value(each, given) for each in self.inputs}

    def _value(self, each: Input, given: Mapping[str, Any]) -> Any:  # noqa: ANN401
        value = given.get(each.name)
        value = each.default if value is None else value
        return None if value is None else each.read(value, given)

    def _run(
        self,
        given: Mapping[str, Any],
        things: Mapping[str, Any],
        options: Any,  # noqa: ANN401
        on_progress: Progress | None,
        **more: Any,  # noqa: ANN401
    ) -> Any:  # noqa: ANN401
        """Run the job; a fault whose place is an input gets the path that was given for it."""
        if self.progress_word and on_progress is not None:
            more["on_progress"] = on_progress
        if self.fields:
            more["options"] = options
        try:
            return load(self.run)(**things, **more)
        except MrdamperError as fault:
            if isinstance(path := given.get(fault.place), str | Path):
                fault.move_to(str(path))
            raise

    def perform(
        self,
        given: Mapping[str, Any],
        options: Any = None,  # noqa: ANN401 - of the job's own type
        *,
        out: Path | None = None,
        outputs: Mapping[str, Path] = _NOTHING,
        on_progress: Progress | None = None,
        resume: bool | None = None,
        tell: Tell | None = None,
    ) -> tuple[Any, Json]:
        """Run the job and write its files, all or none; return (result, answer).

        Parameters
        ----------
        given : as ``__call__`` takes it
        options : None: the usual ones
        outputs : places of what has one of its own, by the output's name
        resume : go on with what the same job into the same folder had finished; False: begin anew, but keep
            what is finished; None: keep nothing
        tell : told what is done with an earlier run's progress
        """
        options = self.options_type() if options is None else options
        for name in self.set_when_written:
            if getattr(options, name) is None:
                options = replace(options, **{name: out is not None})
        if outputs:
            options = replace(options, what=tuple(outputs))
        reported = self.reported  # loaded now: what an interrupted job has found can be written at once
        things = self._read(given, options)
        head = self._head(given)
        if out is not None or outputs:
            places = self._places(out, outputs)
            return self._into(places, given, things, options, head, on_progress, resume=resume, tell=tell)
        if resume:
            raise InputError(
                f"{option('resume')} goes on with what is kept beside {option('out')}",
                expected=f"an {option('out')}",
            )
        result = self._run(given, things, options, on_progress)
        return result, {**head, **reported.answer(result)}

    def _into(
        self,
        folders: Mapping[str, Path],
        given: Mapping[str, Any],
        things: Mapping[str, Any],
        options: Any,  # noqa: ANN401
        head: Mapping[str, object],
        on_progress: Progress | None,
        *,
        resume: bool | None,
        tell: Tell | None,
    ) -> tuple[Any, Json]:
        """Run the job on things that are read, its files into their places; return (result, answer)."""
        from mrdamper.report.base import write_report

        more: dict[str, Any] = {}
        with ExitStack() as stack:
            if self.checkpoint and resume is not None:
                decisive = load(self.checkpoint)(**things, options=options)
                kept = load(self.keeper)(folders[""], decisive, resume=resume, tell=tell)
                more["checkpoint"] = stack.enter_context(kept)
            # The places first: one that cannot be written to is told before anything is made.
            places = stack.enter_context(self._staged(folders, _files_read(given)))
            with ExitStack() as open_files:
                if self.stream:
                    path = places[""].stage / self.stream
                    more["stream"] = open_files.enter_context(path.open("wb"))
                result = self._run(given, things, options, on_progress, **more)
            answer = write_report(self.reported, result, places, head)
            if "checkpoint" in more:
                more["checkpoint"].finished = self.reported.outcome(result).exit_code == 0
        return result, answer

    def _places(self, out: Path | None, outputs: Mapping[str, Path]) -> dict[str, Path]:
        """Return the places of all that is written: the folder under the empty name, others by theirs."""
        given = [path.absolute() for path in outputs.values()]
        for name, path in outputs.items():
            if given.count(path.absolute()) > 1:
                raise InputError(
                    f"{self.name}: {path} is to be two things at once; expected a place for each"
                )
            if name in self._files and is_folder(path):
                raise InputError(f"{path}: is a folder; expected the name of a file to write")
        if out is None:
            return dict(outputs)
        beside = {name: follow(out) for name, follow in self.reported.beside.items()}
        return {"": out, **beside, **outputs}

    @contextmanager
    def _staged(
        self, folders: Mapping[str, Path], inputs: Sequence[Path] = ()
    ) -> Iterator[Mapping[str, Place]]:
        """Give the places to write to; what was written there is moved to where it belongs at the end.

        None of ``inputs`` is replaced.
        """
        from mrdamper.report.base import Place
        from mrdamper.runtime.outputs import atomic_output, refuse_inputs

        refuse_inputs([path for name, path in folders.items() if name in self._files], inputs)

        with ExitStack() as stack:
            places = {}
            for name, path in folders.items():
                file = name in self._files
                stage = stack.enter_context(atomic_output(path.parent if file else path, inputs))
                places[name] = Place(stage / path.name if file else stage, path)
            yield places

    @property
    def _files(self) -> set[str]:
        """The outputs that are a file."""
        return {each.name for each in self.outputs if each.metavar != "DIR"}

    def page_answer(self, result: object) -> Json:
        """Return what a web page shows of a result beside its answer: curves, mostly."""
        return self.reported.for_page(result)

    def _head(self, given: Mapping[str, Any]) -> Json:
        """Return what an answer begins with: the files that were named, by key."""
        named = {each.told: given.get(each.name) for each in self.inputs if each.named_in_answer}
        one = {key: str(value) for key, value in named.items() if isinstance(value, str | Path)}
        many = {
            key: [str(each) for each in value if isinstance(each, str | Path)]
            for key, value in named.items()
            if isinstance(value, list | tuple)
        }
        return {**one, **many}

    def save(self, result: object, out: Path) -> Json:
        """Write a result's files into a folder, all or none; return the answer, with their paths."""
        from mrdamper.report.base import write_report

        with self._staged(self._places(out, {})) as places:
            return write_report(self.reported, result, places, _NOTHING)


def _files_read(given: Mapping[str, Any]) -> list[Path]:
    """Return the files that a job's inputs name, those of folders and patterns included."""
    parts = [value if isinstance(value, list | tuple) else [value] for value in given.values()]
    paths = [Path(each) for part in parts for each in part if isinstance(each, str | Path)]
    files = [path for path in paths if is_there(path) and not is_folder(path)]
    for path in set(paths) - set(files):
        if is_folder(path) or has_magic(str(path)):
            with suppress(InputError):  # a folder of something else
                files += load("mrdamper.data.readers:find_files")([path])
    return files


CARD = Input(name="card", kind="card", help="The model card.")
CARD_OF_ANY_LAW = Input(name="card", kind="card of any law", help="The model card.")
RUNS = Input(name="runs", kind="runs", help="Files, folders or patterns of runs.", label="Runs")
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
    default_help="paper",
    label="Damper's drawing",
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
        page="Check on the page Runs",
        help="""Tell what is wrong with runs before they are fitted, and how their files were understood.

        PATH: files, folders or patterns of runs. Exit code 5 when a run has a fault.
        """,
        inputs=(Input(name="files", kind="files", help="Files, folders or patterns of runs."),),
        run="mrdamper.jobs.check:check",
        result="mrdamper.jobs.check:CheckResult",
        report="mrdamper.report.check:REPORT",
        files_help="For check.html, check.json, findings.csv.",
    ),
    Job(
        name="map",
        python="channel_map",
        help="""Write the channel map by which files were read, to be corrected and kept.

        PATH: files, folders or patterns of runs. What differs from file to file stands in comments.
        """,
        inputs=(Input(name="files", kind="files", help="Files, folders or patterns of runs."),),
        run="mrdamper.jobs.channel_map:write_map",
        result="mrdamper.jobs.channel_map:WrittenMap",
        report="mrdamper.report.channel_map:REPORT",
        files_help="For channels.toml.",
        progress_word="",
    ),
    Job(
        name="identify",
        page="the page Identify",
        out="card",
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
                help="chain, series-valve, double-bouc-wen, bouc-wen, bouc-wen-saturating, spencer, lugre, "
                "dahl, bingham, tanh; auto (chosen by what is left out); or file.py:Class.",
                default_help="auto",
                label="Law",
            ),
            Input(
                name="fluid",
                kind="fluid",
                flag="--fluid",
                required=False,
                help="Take temperature laws from a fluid (paper, lord-mrf-132dg, a file), marked as assumed.",
                default_help="none",
                label="Fluid, where runs do not tell",
            ),
            PREPARATION,
        ),
        options="mrdamper.jobs.options:FitOptions",
        run="mrdamper.jobs.identify:identify",
        result="mrdamper.jobs.identify:IdentifyResult",
        report="mrdamper.report.identification.report:REPORT",
        files_help="For card.json, report.html, errors.csv.",
        out_required=True,
        progress_word="start",
        checkpoint="mrdamper.jobs.identify:decisive",
        ctrl_c="keeps the best",
        aliases=("fit",),
    ),
    Job(
        name="predict",
        page="Predict on the page Identify",
        help="Score a model card on runs that it has not seen.",
        inputs=(CARD_OF_ANY_LAW, RUNS, PREPARATION),
        run="mrdamper.jobs.predict:predict",
        result="mrdamper.jobs.predict:PredictResult",
        report="mrdamper.report.cards.predict:REPORT",
        files_help="Write errors.csv there.",
        progress_word="",
    ),
    Job(
        name="compare",
        help="""Compare two dampers, or one before and after: forces, energy, response, numbers.

        Differences are second minus first, inside what both were identified on.
        """,
        inputs=(
            Input(name="first", kind="card of any law", help="The card before.", in_answer=False),
            Input(name="second", kind="card of any law", help="The card after.", in_answer=False),
        ),
        run="mrdamper.jobs.compare:compare",
        result="mrdamper.models.comparison:Comparison",
        report="mrdamper.report.cards.compare:REPORT",
        files_help="For compare.html, compare.json.",
        progress_word="",
    ),
    Job(
        name="cycles",
        page="the page Cycles",
        help="Count the cycles of a record of any length: energy, peak forces, stiffness and temperature of "
        "each.",
        inputs=(
            Input(name="record", kind="record", help="The record's file."),
            Input(
                name="model",
                kind="card",
                flag="--model",
                required=False,
                help="A card, replayed over the record beside what was measured.",
                label="Card to replay beside it",
            ),
        ),
        options="mrdamper.jobs.options:CyclesOptions",
        run="mrdamper.jobs.cycles:cycles",
        result="mrdamper.jobs.cycles:CyclesResult",
        report="mrdamper.report.cycles:REPORT",
        files_help="For cycles.csv, cycles.html, summary.json.",
        progress_word="row",
        stream="cycles.csv",
        ctrl_c="keeps what was counted",
    ),
    Job(
        name="cite",
        help="Tell what to cite for a card: law, method, data and program, as text and BibTeX.",
        inputs=(CARD_OF_ANY_LAW,),
        run="mrdamper.jobs.cite:cite",
        result="mrdamper.jobs.cite:CiteResult",
        report="mrdamper.report.cards.cite:REPORT",
        progress_word="",
    ),
    Job(
        name="heat",
        page="the page Heating",
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
                default_help="the drawing's",
                label="Heat sink of the study",
                group="More",
            ),
            Input(
                name="calibrate",
                kind="curve",
                flag="--calibrate",
                required=False,
                help="A curve measured under this duty (time_s and fluid_degC, body_degC or coil_degC): it "
                "corrects the drawing and narrows the interval.",
                label="Measured curve, to calibrate by",
                group="More",
            ),
        ),
        options="mrdamper.jobs.options:HeatOptions",
        run="mrdamper.jobs.heat:heat",
        result="mrdamper.jobs.heat:HeatResult",
        report="mrdamper.report.heat:REPORT",
        files_help="For heat.html, heat.json, heat.csv.",
        set_when_written=("by_field",),
        progress_word="step",
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
    Job(
        name="observe",
        help="Tell the fluid's temperature from a record of coil or body, and the time left to its limit.",
        inputs=(
            Input(
                name="record",
                kind="thermal log",
                help="time_s, current_A, power_W (mechanical), and what was read: voltage_V or "
                "resistance_ohm of the coil, body_degC.",
            ),
            DRAWING,
        ),
        options="mrdamper.jobs.options:ObserveOptions",
        run="mrdamper.jobs.observe:observe",
        result="mrdamper.jobs.observe:ObserveResult",
        report="mrdamper.report.observe:REPORT",
        files_help="For observe.svg, observe.json, observe.csv.",
        progress_word="step",
    ),
    Job(
        name="fluid",
        help="Fit viscosity and yield-stress laws to rheometer tables.\n\nTABLE.csv: temperature_degC and "
        "viscosity_mPas, or field_mT (field_kA_m), temperature_degC and yield_stress_kPa.",
        inputs=(
            Input(
                name="tables",
                kind="rheometer table",
                in_answer=True,
                help="Rheometer tables.",
                label="Rheometer tables",
            ),
            Input(
                name="like",
                kind="fluid",
                flag="--like",
                default="paper",
                required=False,
                help="Fluid that gives what the tables do not hold: paper, lord-mrf-132dg, or a fluid.toml.",
                label="What they do not hold, from",
            ),
        ),
        options="mrdamper.jobs.options:FluidOptions",
        run="mrdamper.jobs.fluid:fluid",
        result="mrdamper.jobs.fluid:FluidResult",
        report="mrdamper.report.fluid:REPORT",
        files_help="For fluid.toml and fluid.svg.",
    ),
    Job(
        name="ride",
        help="Ride a quarter car on a card's damper, controlled and without current, and on an ideal one.",
        inputs=(CARD,),
        options="mrdamper.jobs.options:RideOptions",
        run="mrdamper.jobs.ride:ride",
        result="mrdamper.jobs.ride:RideResult",
        report="mrdamper.report.ride:REPORT",
        files_help="For ride.svg, ride.json, ride.csv, temperatures.csv.",
        progress_word="drive",
    ),
    Job(
        name="track",
        page="the page Tracking",
        help="Track forces on a virtual damper with controllers made from a card, without a force sensor.",
        inputs=(
            CARD,
            Input(
                name="plant",
                kind="plant",
                flag="--plant",
                default="nominal",
                required=False,
                help="The damper that is tracked: nominal, hard, stiff, ..., a virtual damper (TOML), or a "
                "card (JSON).",
                label="Damper to be controlled",
            ),
            Input(
                name="targets",
                kind="scenario",
                flag="--target",
                required=False,
                help="sine-900N-1Hz, sine-1100N-2Hz, non-periodic, or a scenario (may be repeated).",
                default_help="all",
                label="Targets",
                begins=("sine-900N-1Hz",),
            ),
            Input(
                name="unaware",
                kind="card",
                flag="--unaware",
                required=False,
                help="Identified at one temperature: adds recommended-unaware and paper-unaware.",
                label="Card that does not know temperature",
                group="More",
            ),
            Input(
                name="pooled",
                kind="card",
                flag="--pooled",
                required=False,
                help="Identified over all temperatures without knowing them: adds recommended-pooled.",
                label="Card pooled over temperatures",
                group="More",
            ),
        ),
        options="mrdamper.jobs.options:TrackOptions",
        run="mrdamper.jobs.track:track",
        result="mrdamper.jobs.track:TrackResult",
        report="mrdamper.report.track:REPORT",
        files_help="For track.html, track.json, track.csv.",
    ),
    Job(
        name="sink",
        page="the page Heat sink",
        help="Search annular-fin heat sinks: the coolest damper for the least mass, inside limits.",
        inputs=(CARD, DRAWING, DUTY),
        options="mrdamper.jobs.options:SinkOptions",
        run="mrdamper.jobs.sink:sink",
        result="mrdamper.jobs.sink:SinkResult",
        report="mrdamper.report.sink:REPORT",
        checkpoint="mrdamper.jobs.sink:decisive",
        files_help="For sink.html, sink.json, front.csv, best.toml.",
    ),
    Job(
        name="export",
        python="export_card",
        help="Export a card as C source, as FMU or as force map, proved against the model before it is "
        "written.",
        inputs=(
            CARD,
            Input(
                name="damper",
                kind="drawing",
                flag="--damper",
                required=False,
                help="The drawing (TOML), whose heat capacity tells a frozen thermometer.",
                default_help="the paper's",
                label="Drawing, for a frozen thermometer",
            ),
        ),
        options="mrdamper.jobs.options:ExportOptions",
        check="mrdamper.jobs.export:check_options",
        run="mrdamper.jobs.export:export",
        result="mrdamper.jobs.export:ExportResult",
        report="mrdamper.report.export:REPORT",
        outputs=(
            Output(name="c", metavar="DIR", help="Write C99 source there."),
            Output(name="fmu", metavar="FILE", help="Write a co-simulation FMU."),
            Output(name="table", metavar="FILE", help="Write a force map (CSV) for simulators."),
        ),
        progress_word="part",
    ),
    Job(
        name="rig",
        page="the virtual rig on the page Runs",
        out="runs",
        python="run_rig",
        help="Run a campaign of tests on the virtual rig: a damper whose physics is none of the laws.",
        inputs=(
            Input(
                name="damper",
                kind="virtual damper",
                flag="--damper",
                required=False,
                help="Own parameters (TOML: preset, and what differs from it).",
                default_help="the preset as it is",
                label="Own parameters of the damper",
            ),
            Input(
                name="campaign",
                kind="campaign",
                flag="--campaign",
                required=False,
                help="Motions, currents, temperatures, sensors (short, or TOML).",
                default_help="the damper's usual one",
                begins="short",
            ),
        ),
        options="mrdamper.jobs.options:RigOptions",
        check="mrdamper.jobs.rig:check_given",
        run="mrdamper.jobs.rig:rig",
        result="mrdamper.jobs.rig:RigResult",
        report="mrdamper.report.rig:REPORT",
        files_help="For the runs (CSV); the truth goes to DIR.truth beside it.",
        out_required=True,
    ),
    Job(
        name="data list",
        python="list_data",
        help="List the public data sets.",
        inputs=(),
        run="mrdamper.jobs.public_data.datasets:list_data",
        result="mrdamper.jobs.public_data.datasets:PublicData",
        report="mrdamper.report.datasets:LISTED",
        progress_word="",
    ),
    Job(
        name="data fetch",
        out="runs",
        python="fetch_data",
        help="Fetch a public data set and print where its files lie.",
        inputs=(Input(name="name", kind="name", help="Of the set, as the list has it."),),
        run="mrdamper.jobs.public_data.datasets:fetch_data",
        result="mrdamper.jobs.public_data.datasets:FetchedData",
        report="mrdamper.report.datasets:FETCHED",
        files_help="For the set's files, each with its channel map.",
        progress_word="set",
    ),
    Job(
        name="demo",
        help="Run every job on the virtual rig and compare with the paper (no measured data needed).",
        inputs=(),
        options="mrdamper.jobs.options:DemoOptions",
        run="mrdamper.paper.demo:demo",
        result="mrdamper.paper.demo:DemoResult",
        report="mrdamper.paper.report:REPORT",
        files_help="Where to.",
        out_default="build/demo",
        progress_word="step",
    ),
    Job(
        name="sweep",
        page="the page Sweeps",
        help="Run many jobs of one kind: campaigns to identify, a tolerance of tracking, heat sinks.",
        inputs=(Input(name="plan", kind="plan", in_answer=False, help="What to run (TOML)."),),
        options="mrdamper.jobs.options:SweepOptions",
        run="mrdamper.jobs.sweep.sweep:sweep",
        result="mrdamper.jobs.sweep.sweep:SweepResult",
        report="mrdamper.report.sweep:REPORT",
        checkpoint="mrdamper.jobs.sweep.sweep:decisive",
        keeper="mrdamper.jobs.sweep.results:open_store",
        files_help="For the results.",
        out_required=True,
        progress_word="task",
        ctrl_c="keeps the results",
    ),
)

JOBS: Mapping[str, Job] = {row.name: row for row in _ROWS}
"""The jobs by name, in the order of the help."""
