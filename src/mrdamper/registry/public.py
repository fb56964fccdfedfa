"""The jobs as Python functions, and what their results can do: made from the registry.

>>> import mrdamper
>>> hot = mrdamper.heat("card.json", "paper", ambient_degC=35.0)  # doctest: +SKIP
>>> hot.plot(), hot.save("out"), hot.to_frame()  # doctest: +SKIP

A job's inputs come first, as paths or as the objects themselves (runs also as frames with columns by name);
its options are keywords. Results are plain values; ``summary``, ``plot``, ``save`` and ``to_frame`` are bound
to their classes here, so that no job knows how it is shown.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrdamper.data.channels import ChannelMap
from mrdamper.data.frames import said_columns, speaks_of_column
from mrdamper.data.records import Dataset
from mrdamper.errors import InputError, MissingExtraError, UsageError
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import RunsReading
from mrdamper.quantities import QUANTITIES
from mrdamper.registry import Job
from mrdamper.registry.values import (
    bind_card_jobs,
    bind_values,
    drawn,
    shorten_reprs,
    shown_in_notebook,
    signature_of,
)
from mrdamper.schema import did_you_mean, fields_of, read_record

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

_OF_RUNS = ("runs", "files")


def bind_public() -> None:
    """Give runs and cards what they can do (``values``), whichever name of the package came first."""
    bind_values(function_of)


def function_of(job: Job) -> Callable[..., Any]:
    """Return a job as a function of its inputs and options, with its documentation and signature."""

    def call(*inputs: Any, on_progress: Any = None, **given: Any) -> Any:  # noqa: ANN401 - as the signature says
        return _call(job, inputs, given, on_progress)

    call.__name__ = call.__qualname__ = job.attribute
    call.__module__ = "mrdamper"
    call.__doc__ = _documentation(job)
    vars(call)["__signature__"] = signature_of(job)
    bind_values(function_of)
    bind_result(job)
    return call


def read(given: Any = None, /, **said: Any) -> Dataset:  # noqa: ANN401 - paths, runs, frames
    """Return runs: of files, folders and patterns; of frames of pandas or Polars; of arrays.

    Parameters
    ----------
    given : a path or frame, a list of them, or a mapping of names to frames; None: keywords hold the columns
    said : the options of reading runs (``channels``, ``answer``, ``flip_force``); and of each quantity, with
        its unit, the name of a column, the column itself, or one number: ``force_kN="Load"``,
        ``current_A=1.0``; or ``rate_Hz`` where there is no time

    Raises
    ------
    InputError
        A column is missing or has no unit, is not of one length, not finite, or time does not increase.
    """
    bind_values(function_of)
    known = [field.name for field in fields_of(RunsReading)]
    _require_known("read", said, known, of_runs=True)
    options = read_record(RunsReading, {key: said[key] for key in said if key in known}, "read")
    reading = {key: getattr(options, key) for key in known}
    given, chosen = said_columns(given, {key: said[key] for key in said if key not in known})
    reading["channels"] = _one_map(reading["channels"], chosen)
    return read_dataset([] if given is None else given, **reading)


def _signature_of_read() -> inspect.Signature:
    """Return what ``read`` takes: options of reading, each quantity (in SI here), and the rate."""
    kind = inspect.Parameter
    words = [f"{each.role}_{each.unit}".replace("/", "_") for each in QUANTITIES.values()]
    options = [kind(each.name, kind.KEYWORD_ONLY, default=each.default) for each in fields_of(RunsReading)]
    columns = [kind(word, kind.KEYWORD_ONLY, default=None) for word in (*words, "rate_Hz")]
    return inspect.Signature([kind("given", kind.POSITIONAL_ONLY, default=None), *options, *columns])


vars(read)["__signature__"] = _signature_of_read()


def _call(job: Job, inputs: tuple[Any, ...], given: dict[str, Any], on_progress: Any) -> Any:  # noqa: ANN401
    known = [*job.given_names, *(field.name for field in job.fields), *(each.name for each in job.outputs)]
    of_runs = next((each.name for each in job.inputs if each.kind in _OF_RUNS), "")
    _require_known(job.attribute, given, known, of_runs=bool(of_runs))
    said = {name: given.pop(name) for name in [*given] if name not in known}
    names = [each.name for each in job.inputs]
    if len(inputs) > len(names):
        raise InputError(
            f"{len(inputs)} inputs were given",
            place=f"mrdamper.{job.attribute}",
            expected=f"at most {len(names)}",
        )
    named = dict(zip(names, inputs, strict=False))
    named |= {name: given.pop(name) for name in names if name in given}
    chosen = None
    if said:
        named[of_runs], chosen = said_columns(named.get(of_runs), said)
    missing = [each.name for each in job.inputs if each.required and named.get(each.name) is None]
    if missing:
        raise InputError(
            f"{', '.join(missing)} is missing",
            place=f"mrdamper.{job.attribute}",
            expected="a path, or the thing",
        )
    reading = {field.name: given.pop(field.name) for field in job.reading if field.name in given}
    outputs = {each.name: Path(given.pop(each.name)) for each in job.outputs if given.get(each.name)}
    named |= job.reading_from(reading)
    if chosen is not None:
        named["channels"] = _one_map(named["channels"], chosen)
    if outputs:
        return job.perform(named, job.options_from(given), outputs=outputs, on_progress=on_progress)[0]
    return job(named, job.options_from(given), on_progress)


def _require_known(function: str, given: Mapping[str, Any], known: list[str], *, of_runs: bool) -> None:
    """Refuse a keyword that is no option, and says of no column where runs are read."""
    for name in given:
        if name not in known and not (of_runs and speaks_of_column(name)):
            raise TypeError(f"mrdamper.{function}: no option {name!r}; {did_you_mean(name, known)}")


def _one_map(channels: Path | None, chosen: ChannelMap | None) -> Path | ChannelMap | None:
    """Return the channel map that was given: as a file, or in keywords."""
    if channels is not None and chosen is not None:
        raise UsageError(
            "channels and keywords for columns exclude each other", remedy="say all in one of them"
        )
    return channels if chosen is None else chosen


def _documentation(job: Job) -> str:
    lines = [job.help, "", "Parameters", "----------"]
    lines += [f"{each.name} : {each.help or each.kind}" for each in job.inputs]
    for field in (*job.reading, *job.fields):
        unit = f" [{field.option.unit}]" if field.option.unit else ""
        lines.append(f"{field.name} : {field.option.help}{unit} Expected: {field.words}.")
    lines += [f"{each.name} : {each.metavar}. {each.help}" for each in job.outputs]
    return "\n".join([*lines, "on_progress : receives ``ProgressUpdate``"])


# ------------------------------------------------------------------------------------------- results


def bind_result(job: Job) -> None:
    """Give a job's result class what its report can do, once."""
    kind: Any = job.result_type
    if "summary" in vars(kind):
        return
    title = kind.__name__

    def summary(self: object) -> str:
        """Return a few lines that answer the question."""
        return "\n".join(job.reported.lines(self))

    def __repr__(self: object) -> str:  # noqa: N807 - bound as one
        return f"<{title}>\n" + "\n".join(summary(self).splitlines()[:8])

    def _repr_html_(self: object) -> str:
        return shown_in_notebook(summary(self), _drawn(job, self))

    def plot(self: object) -> Figure:
        """Return the picture that answers the question, as a Matplotlib figure."""
        return _figure(job, self)

    def save(self: object, folder: str | Path) -> dict[str, Any]:
        """Write the result's files into a folder, all or none; return the answer, with their paths."""
        return job.save(self, Path(folder))

    def to_frame(self: object) -> polars.DataFrame:
        """Return the result as a table."""
        try:
            import polars
        except ImportError as error:
            raise MissingExtraError.for_package("Results as tables", "polars", "rig-files") from error
        rows = job.reported.rows
        if rows is None:
            raise InputError("has no rows", place=title, expected="one of its fields")
        return polars.DataFrame(list(rows(self)))

    for each in (summary, __repr__, _repr_html_, plot, save, to_frame):
        setattr(kind, each.__name__, each)
    if hasattr(kind, "card"):
        bind_card_jobs(kind, lambda fit: fit.card(), function_of)
    shorten_reprs(kind)


def _figure(job: Job, result: object) -> Figure:
    if (figure := _drawn(job, result)) is None:
        raise InputError(
            "has no picture", place=type(result).__name__, expected="summary(), save() or to_frame()"
        )
    return figure


def _drawn(job: Job, result: object) -> Figure | None:
    if (draw := job.reported.figure) is None:
        return None
    from mrdamper.report.figures.style import drawing_style

    with drawing_style():
        figure = draw(result)
    return None if figure is None else drawn(lambda: figure, job.name)
