"""Class ``Job``: read inputs, check options, run a job and write its output files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from glob import has_magic
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import is_folder, is_there
from mrdamper.results import load
from mrdamper.schema import Field, Json, class_fields_of, fields_of, read_record

if TYPE_CHECKING:
    from mrdamper.report.base import Place, Report
    from mrdamper.runtime.progress import Progress

_READING = "mrdamper.jobs.options:Reading"
_NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Declaration of a job. All interfaces of the job are generated from this declaration."""

    name: str
    help: str
    run: str  # job function, as ``module:function``; arguments: inputs by name, options, on_progress
    report: str  # object that writes the report, as ``module:REPORT``
    files_help: str = ""  # help text of the option --out; empty if the job writes no folder
    out_required: bool = False
    out_default: str = ""
    progress_word: str = ""  # unit of the progress count; empty if ``run`` has no ``on_progress``
    checkpoint: str = ""  # context manager with stored results of finished tasks, as ``module:function``
    ctrl_c: str = ""  # effect of Ctrl-C for the user; empty if Ctrl-C ends the job without files
    out: str = ""  # output folder on the server: "card", "runs", or empty for a new folder in results/

    @property
    def attribute(self) -> str:
        """Return the name of the job's Python function, such as ``fetch_data`` for ``data fetch``."""
        return "_".join(reversed(self.name.split()))

    @property
    def options_type(self) -> type:
        """Return the class with the inputs, outputs and options of the job."""
        result: type = load(f"mrdamper.jobs.options:{self.name.title().replace(' ', '')}Options")
        return result

    @property
    def inputs(self) -> tuple[Field, ...]:
        return tuple(each for each in class_fields_of(self.options_type) if not each.option.output)

    @property
    def outputs(self) -> tuple[Field, ...]:
        """Return the outputs for which the user gives separate paths, such as ``--fmu PATH``."""
        return tuple(each for each in class_fields_of(self.options_type) if each.option.output)

    @property
    def fields(self) -> tuple[Field, ...]:
        """Return the options. If a job has none, ``run`` has no argument ``options``."""
        return fields_of(self.options_type)

    @property
    def reading(self) -> tuple[Field, ...]:
        """Return the options that control how the inputs are read."""
        names = {name for each in self.inputs for name in each.option.reading}
        return tuple(each for each in fields_of(load(_READING)) if each.name in names)

    @property
    def reported(self) -> Report[Any]:
        result: Report[Any] = load(self.report)
        return result

    def options_from(self, given: Mapping[str, Any]) -> Any:  # noqa: ANN401 - the job's options
        """Return the checked options; one ``InputError`` lists all invalid options."""
        return read_record(self.options_type, given, self.name)

    def call(self, given: dict[str, Any]) -> Any:  # noqa: ANN401 - the result of the job
        """Check the arguments of the job's Python function, and run the job."""
        missing = [each.name for each in self.inputs if each.required and given[each.name] is None]
        if missing:
            place = f"mrdamper.{self.attribute}"
            raise InputError(f"{', '.join(missing)} is None", place=place, expected="a path or an object")
        options = self.options_from({field.name: given[field.name] for field in self.fields})
        things: dict[str, Any] = {each.name: given[each.name] for each in self.inputs}
        reading = {each.name: given[each.name] for each in self.reading}
        checked: Any = read_record(load(_READING), reading, self.name)
        things |= {name: getattr(checked, name) for name in reading}
        progress = given.get("on_progress")
        outputs = {each.name: Path(given[each.name]) for each in self.outputs if given[each.name]}
        if outputs:
            return self.perform(things, options, outputs=outputs, on_progress=progress)[0]
        with _limit_jobs(options):
            return self._run(things, self._read(things), options, progress)

    def _read(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the inputs by name; paths and preset names are replaced by objects."""
        things: dict[str, Any] = {}
        for each in self.inputs:
            value = given.get(each.name)
            value = each.default if value is None and not each.required else value
            is_text = isinstance(value, str | Path)
            if each.option.read and (is_text or (each.many and value is not None)):
                options = {
                    field.name: given.get(field.name, field.default)
                    for field in self.reading
                    if field.name in each.option.reading
                }
                value = load(each.option.read)([value] if each.many and is_text else value, **options)
            things[each.name] = value
        return things

    def _run(
        self,
        given: Mapping[str, Any],
        things: Mapping[str, Any],
        options: Any,  # noqa: ANN401
        on_progress: Progress | None,
        **more: Any,  # noqa: ANN401
    ) -> Any:  # noqa: ANN401
        """Run the job. If an error is about an input, add the path of the input to the error."""
        if self.progress_word and on_progress is not None:
            more |= {"on_progress": on_progress}
        if self.fields:
            more |= {"options": options}
        try:
            return load(self.run)(**things, **more)
        except MrdamperError as fault:
            name, *parts = fault.place.split(": ")
            if isinstance(path := given.get(name), str | Path):
                fault.place = ": ".join([str(path), *parts])
            raise

    def perform(
        self,
        given: Mapping[str, Any],
        options: Any = None,  # noqa: ANN401 - of the job's own type
        *,
        out: Path | None = None,
        outputs: Mapping[str, Path] = _NOTHING,
        on_progress: Progress | None = None,
        resume: bool = False,
    ) -> tuple[Any, Json]:
        """Run the job and write its files (all or none); return result and JSON answer.

        Parameters
        ----------
        given : value (path, preset name or object) of each input and of each option for reading, by name;
            optional inputs may be missing
        options : options of the job; None: the default options
        out : folder for all files; None: no folder is written
        outputs : paths of single outputs, by name
        resume : True: reuse the finished parts of an interrupted job of the same kind in the same folder
        """
        from mrdamper.report.base import write_report

        options = self.options_type() if options is None else options
        if outputs and any(field.name == "what" for field in self.fields):
            options = replace(options, what=tuple(outputs))
        # Import the report before the job, because an interrupted job has no time for imports.
        reported = self.reported
        more: dict[str, Any] = {}
        with ExitStack() as stack:
            stack.enter_context(_limit_jobs(options))
            things = self._read(given)
            folders = self._places(out, outputs)
            if self.checkpoint and out is not None:
                store = stack.enter_context(load(self.checkpoint)(folders[""], resume=resume))
                more = {"checkpoint": store}
            # The paths are prepared first, so that an unwritable path is reported before the computation.
            places = stack.enter_context(self._staged(folders, _files_read(given) if folders else ()))
            result = self._run(given, things, options, on_progress, **more)
            answer = write_report(reported, result, places, self._head(given))
        return result, answer

    def _places(self, out: Path | None, outputs: Mapping[str, Path]) -> dict[str, Path]:
        """Return the paths of all outputs by name; the name of the folder ``out`` is ""."""
        given = [path.absolute() for path in outputs.values()]
        for name, path in outputs.items():
            if given.count(path.absolute()) > 1:
                words = f"{path} is given for two outputs"
                raise InputError(words, place=self.name, expected="a different path for each output")
            if name in self._files and is_folder(path):
                raise InputError("is a folder", place=path, expected="the name of a file to write")
        if out is None:
            return dict(outputs)
        other_folders = {name: follow(out) for name, follow in self.reported.beside.items()}
        return {"": out, **other_folders, **outputs}

    @contextmanager
    def _staged(
        self, folders: Mapping[str, Path], inputs: Sequence[Path] = ()
    ) -> Iterator[Mapping[str, Place]]:
        """Provide a temporary path for each output, by name, in a ``with`` statement.

        After the ``with`` statement, the files are moved to their final paths. The files ``inputs`` are never
        replaced.
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
        """Return the names of the outputs that are files."""
        return {each.name for each in self.outputs if each.option.metavar != "DIR"}

    def _head(self, given: Mapping[str, Any]) -> Json:
        """Return the first entries of the JSON answer: the paths of the inputs."""
        head: Json = {}
        for each in self.inputs:
            value = given.get(each.name)
            values = value if isinstance(value, list | tuple) else (value,)
            paths = [str(path) for path in values if isinstance(path, str | Path)]
            if paths and each.required and each.option.places != ("runs",):
                head[each.key] = paths if each.many else paths[0]
        return head

    def save(self, result: object, out: str | Path) -> Json:
        """Write all files of a result into a folder, or no file; return the answer."""
        from mrdamper.report.base import write_report

        with self._staged(self._places(Path(out), _NOTHING)) as places:
            return write_report(self.reported, result, places, _NOTHING)


def _limit_jobs(options: object) -> AbstractContextManager[None]:
    """Return a context in which reading, run and report use at most the jobs of the option ``--jobs``."""
    limited: AbstractContextManager[None] = load("mrdamper.runtime.pool:limit_jobs")(
        getattr(options, "jobs", None)
    )
    return limited


def _files_read(given: Mapping[str, Any]) -> list[Path]:
    """Return all files that the inputs of a job refer to, including those in folders and patterns."""
    parts = [value if isinstance(value, list | tuple) else [value] for value in given.values()]
    paths = [Path(each) for part in parts for each in part if isinstance(each, str | Path)]
    files = [path for path in paths if is_there(path) and not is_folder(path)]
    for path in set(paths) - set(files):
        if is_folder(path) or has_magic(str(path)):
            with suppress(InputError):  # The folder contains no runs.
                files += load("mrdamper.data.proposal.folders:find_files")([path])
    return files
