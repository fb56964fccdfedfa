"""The jobs as Python functions, and what their results can do: made from the registry.

>>> import mrdamper
>>> hot = mrdamper.heat("card.json", "paper", ambient_degC=35.0)  # doctest: +SKIP
>>> hot.plot(), hot.save("out"), hot.to_frame()  # doctest: +SKIP

A job's inputs come first, as paths or as the objects themselves; its options are keywords. Results are plain
values; ``summary``, ``plot``, ``save`` and ``to_frame`` are bound to their classes here, so that no job knows
how it is shown.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrdamper.errors import InputError
from mrdamper.registry import JOBS, Input, Job, load
from mrdamper.schema import did_you_mean

if TYPE_CHECKING:
    import polars
    from matplotlib.figure import Figure

__all__ = ["bind_result", "function_of", "public_names"]


def public_names() -> dict[str, Job]:
    """Return the jobs by their names in Python."""
    return {name: job for job in JOBS.values() for name in (job.attribute, *job.aliases)}


def function_of(job: Job) -> Callable[..., Any]:
    """Return a job as a function of its inputs and options, with its documentation and signature."""

    def call(*inputs: Any, on_progress: Any = None, **given: Any) -> Any:  # noqa: ANN401 - as the signature says
        return _call(job, inputs, given, on_progress)

    call.__name__ = call.__qualname__ = job.attribute
    call.__module__ = "mrdamper"
    call.__doc__ = _documentation(job)
    vars(call)["__signature__"] = _signature(job)
    bind_result(job)
    return call


def _call(job: Job, inputs: tuple[Any, ...], given: dict[str, Any], on_progress: Any) -> Any:  # noqa: ANN401
    known = [*job.given_names, *(field.name for field in job.fields), *(each.name for each in job.outputs)]
    for name in given:
        if name not in known:
            raise TypeError(f"mrdamper.{job.attribute}: no option {name!r}; {did_you_mean(name, known)}")
    names = [each.name for each in job.inputs]
    if len(inputs) > len(names):
        raise InputError(
            f"{len(inputs)} inputs were given",
            place=f"mrdamper.{job.attribute}",
            expected=f"at most {len(names)}",
        )
    named = dict(zip(names, inputs, strict=False))
    named |= {name: given.pop(name) for name in names if name in given}
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
    if outputs:
        return job.perform(named, job.options_from(given), outputs=outputs, on_progress=on_progress)[0]
    return job(named, job.options_from(given), on_progress)


def _signature(job: Job) -> inspect.Signature:
    kind = inspect.Parameter
    first = [
        kind(each.name, kind.POSITIONAL_OR_KEYWORD, default=_default_of(each))
        for each in sorted(job.inputs, key=lambda each: not each.required)
    ]
    rest = [
        kind(field.name, kind.KEYWORD_ONLY, default=kind.empty if field.required else field.default)
        for field in (*job.reading, *job.fields)
    ]
    rest += [kind(each.name, kind.KEYWORD_ONLY, default=None) for each in job.outputs]
    return inspect.Signature([*first, *rest, kind("on_progress", kind.KEYWORD_ONLY, default=None)])


def _default_of(each: Input) -> Any:  # noqa: ANN401 - a text, None, or that there is none
    return inspect.Parameter.empty if each.required else each.default


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
    kind: Any = load(job.result)
    if "summary" in vars(kind):
        return
    title = kind.__name__

    def summary(self: object) -> str:
        """Return a few lines that answer the question."""
        return "\n".join(job.reported.summary(self))

    def __repr__(self: object) -> str:  # noqa: N807 - bound as one
        return f"<{title}>\n" + "\n".join(summary(self).splitlines()[:8])

    def _repr_html_(self: object) -> str:
        return f"<pre>{escape(summary(self))}</pre>{_svg(job, self)}"

    def plot(self: object) -> Figure:
        """Return the picture that answers the question, as a Matplotlib figure."""
        return _figure(job, self)

    def save(self: object, folder: str | Path) -> dict[str, Any]:
        """Write the result's files into a folder, all or none; return the answer, with their paths."""
        return job.save(self, Path(folder))

    def to_frame(self: object) -> polars.DataFrame:
        """Return the result as a table."""
        import polars

        rows = job.reported.rows
        if rows is None:
            raise InputError("has no rows", place=title, expected="one of its fields")
        return polars.DataFrame(list(rows(self)))

    for each in (summary, __repr__, _repr_html_, plot, save, to_frame):
        setattr(kind, each.__name__, each)


def _figure(job: Job, result: object) -> Figure:
    draw = job.reported.figure
    if draw is None:
        raise InputError(
            "has no picture", place=type(result).__name__, expected="summary(), save() or to_frame()"
        )
    from mrdamper.report.figures.style import drawing_style

    with drawing_style():
        return draw(result)


def _svg(job: Job, result: object) -> str:
    if job.reported.figure is None:
        return ""
    from mrdamper.report.figures.style import drawing_style, svg_of

    with drawing_style():
        return svg_of(_figure(job, result), job.name)
