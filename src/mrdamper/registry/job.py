"""Rows of the registry: read the inputs of a job, check its options, run it, and write all files or none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from glob import has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.files import is_folder, is_there
from mrdamper.registry.kinds import KINDS, NOTHING, read_input
from mrdamper.results import load
from mrdamper.schema import Field, Json, fields_of, read_record

if TYPE_CHECKING:
    from mrdamper.report.base import Place, Report
    from mrdamper.runtime.progress import Progress

_CLASS = "mrdamper.jobs.options:class_of"


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """Declaration of a job. All interfaces are generated from it."""

    name: str
    help: str
    run: str  # module:function(inputs by name, options=, on_progress=) -> result
    report: str  # module:REPORT
    files_help: str = ""  # Help of --out; empty if the job writes no folder.
    out_required: bool = False
    out_default: str = ""
    progress_word: str = "run"  # Unit of progress; empty if ``run`` has no ``on_progress``.
    checkpoint: str = ""  # module:function(folder, resume=) that opens the argument ``checkpoint`` of ``run``
    ctrl_c: str = ""  # Effect of an interrupt if the job does not end.
    out: str = ""  # Output folder on the server: "card" or "runs"; empty for a new folder.
    python: str = ""  # Name of the Python function if it differs from the name.

    @property
    def attribute(self) -> str:
        return self.python or self.name

    @property
    def inputs(self) -> tuple[Field, ...]:
        return fields_of(load(_CLASS)(self.name, "Inputs"))

    @property
    def options_type(self) -> type:
        result: type = load(_CLASS)(self.name, "Options")
        return result

    @property
    def fields(self) -> tuple[Field, ...]:
        """Return the options; without any, ``run`` has no argument ``options``."""
        return fields_of(self.options_type)

    @property
    def outputs(self) -> tuple[Field, ...]:
        """Return the outputs with their own paths. The option ``what`` holds the requested names."""
        return fields_of(load(_CLASS)(self.name, "Outputs"))

    @property
    def reading(self) -> tuple[Field, ...]:
        """Return the options for reading the inputs, each once."""
        result = [field for each in self.inputs for field in KINDS[each.option.kind].fields]
        return tuple({field.name: field for field in result}.values())

    @property
    def given_names(self) -> tuple[str, ...]:
        """Return the names of the inputs and of the options for reading."""
        return (*(each.name for each in self.inputs), *(field.name for field in self.reading))

    @property
    def reported(self) -> Report[Any]:
        result: Report[Any] = load(self.report)
        return result

    def options_from(self, given: Mapping[str, Any]) -> Any:  # noqa: ANN401 - the job's options
        """Return checked options.

        Raises
        ------
        InputError
            If an option is invalid; one line for each fault.
        """
        return read_record(self.options_type, given, self.name)

    def reading_from(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return checked options for reading, by name; raise ``InputError`` with a line for each fault."""
        checked: dict[str, Any] = {}
        for kind in dict.fromkeys(KINDS[each.option.kind].options for each in self.inputs):
            if kind:
                names = [each.name for each in fields_of(load(kind))]
                record = read_record(load(kind), {k: v for k, v in given.items() if k in names}, self.name)
                checked |= {name: getattr(record, name) for name in names}
        return checked

    def __call__(self, given: Mapping[str, Any], options: Any, on_progress: Progress | None = None) -> Any:  # noqa: ANN401
        """Read the inputs, run the job and return its result.

        Parameters
        ----------
        given : path, preset or object of each input, by name, and options for reading; optional inputs can
            be missing
        options : options of the job
        """
        return self._run(given, self._read(given), options, on_progress)

    def call(self, given: dict[str, Any]) -> Any:  # noqa: ANN401 - the result of the job
        """Run the job with the arguments of its Python function.

        Raises
        ------
        InputError
            An input is None, or an option is invalid.
        """
        missing = [each.name for each in self.inputs if each.required and given[each.name] is None]
        if missing:
            place = f"mrdamper.{self.attribute}"
            raise InputError(f"{', '.join(missing)} is None", place=place, expected="a path or an object")
        options = self.options_from({field.name: given[field.name] for field in self.fields})
        reading = self.reading_from({field.name: given[field.name] for field in self.reading})
        things = {each.name: given[each.name] for each in self.inputs} | reading
        progress = given.get("on_progress")
        outputs = {each.name: Path(given[each.name]) for each in self.outputs if given[each.name]}
        if outputs:
            return self.perform(things, options, outputs=outputs, on_progress=progress)[0]
        return self(things, options, progress)

    def _read(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return the inputs by name."""
        things: dict[str, Any] = {}
        for each in self.inputs:
            value = given.get(each.name)
            value = each.default if value is None and not each.required else value
            things[each.name] = None if value is None else read_input(each, value, given)
        return things

    def _run(
        self,
        given: Mapping[str, Any],
        things: Mapping[str, Any],
        options: Any,  # noqa: ANN401
        on_progress: Progress | None,
        **more: Any,  # noqa: ANN401
    ) -> Any:  # noqa: ANN401
        """Run the job; an error about an input gets the path of the input."""
        if self.progress_word and on_progress is not None:
            more |= {"on_progress": on_progress}
        if self.fields:
            more |= {"options": options}
        try:
            return load(self.run)(**things, **more)
        except MrdamperError as fault:
            name, *parts = fault.place.split(": ")
            if isinstance(path := given.get(name), str | Path):
                fault.move_to(": ".join([str(path), *parts]))
            raise

    def perform(
        self,
        given: Mapping[str, Any],
        options: Any = None,  # noqa: ANN401 - of the job's own type
        *,
        out: Path | None = None,
        outputs: Mapping[str, Path] = NOTHING,
        on_progress: Progress | None = None,
        resume: bool = False,
    ) -> tuple[Any, Json]:
        """Run the job and write its files, all or none; return (result, answer).

        Parameters
        ----------
        given : the same as in ``__call__``
        options : None selects the default options
        outputs : paths of single outputs, by name
        resume : continue with the finished parts of the same job in the same folder
        """
        from mrdamper.report.base import write_report

        options = self.options_type() if options is None else options
        if outputs and any(field.name == "what" for field in self.fields):
            options = replace(options, what=tuple(outputs))
        # Import the report before the job, because an interrupted job has no time for imports.
        reported = self.reported
        things = self._read(given)
        if out is None and not outputs:
            result = self._run(given, things, options, on_progress)
            return result, {**self._head(given), **reported.answer(result)}
        folders = self._places(out, outputs)
        more: dict[str, Any] = {}
        with ExitStack() as stack:
            if self.checkpoint:
                store = stack.enter_context(load(self.checkpoint)(folders[""], resume=resume))
                more = {"checkpoint": store}
            # A path that is not writable is reported before the computation.
            places = stack.enter_context(self._staged(folders, _files_read(given)))
            result = self._run(given, things, options, on_progress, **more)
            answer = write_report(reported, result, places, self._head(given))
        return result, answer

    def _places(self, out: Path | None, outputs: Mapping[str, Path]) -> dict[str, Path]:
        """Return the paths of all outputs by name. The name of the folder is empty."""
        given = [path.absolute() for path in outputs.values()]
        for name, path in outputs.items():
            if given.count(path.absolute()) > 1:
                raise InputError(
                    f"{path} is to be two things at once", place=self.name, expected="a place for each"
                )
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
        """Yield temporary paths; the files are moved to their final paths at the end.

        The files ``inputs`` are never replaced.
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
        """Return the first keys of an answer: the paths of the inputs."""
        named = {}
        for each in self.inputs:
            single = each.required and not each.many
            if single if each.option.in_answer is None else each.option.in_answer:
                named[each.key] = given.get(each.name)
        one = {key: str(value) for key, value in named.items() if isinstance(value, str | Path)}
        many = {
            key: [str(each) for each in value if isinstance(each, str | Path)]
            for key, value in named.items()
            if isinstance(value, list | tuple)
        }
        return {**one, **many}

    def save(self, result: object, out: str | Path) -> Json:
        """Write all files of a result into a folder, or no file; return the answer."""
        from mrdamper.report.base import write_report

        with self._staged(self._places(Path(out), NOTHING)) as places:
            return write_report(self.reported, result, places, NOTHING)


def _files_read(given: Mapping[str, Any]) -> list[Path]:
    """Return the files of the inputs of a job, including the files of folders and patterns."""
    parts = [value if isinstance(value, list | tuple) else [value] for value in given.values()]
    paths = [Path(each) for part in parts for each in part if isinstance(each, str | Path)]
    files = [path for path in paths if is_there(path) and not is_folder(path)]
    for path in set(paths) - set(files):
        if is_folder(path) or has_magic(str(path)):
            with suppress(InputError):  # The folder contains no runs.
                files += load("mrdamper.data.proposal.folders:find_files")([path])
    return files
