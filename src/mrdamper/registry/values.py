"""What runs and cards can do at the public face, and how values show themselves; no room knows of it.

A card has a method for each job that begins with a card (``card.heat("paper", ambient_degC=35)``), made from
the registry; a fit has them, too, for the card that it makes.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from html import escape
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from mrdamper.data.records import Dataset, RigRun
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.registry import JOBS, Input, Job

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_LINES = 9
_LONGEST = 100  # characters of a line


def drawn(draw: Callable[[], Figure], label: str) -> Figure:
    """Return a figure, drawn in our style, that a notebook shows as it is."""
    from mrdamper.report.figures.style import drawing_style, svg_of

    with drawing_style():
        figure = draw()
        svg = svg_of(figure, label)
    vars(figure)["_repr_svg_"] = lambda: svg
    return figure


def shown_in_notebook(text: str, picture: Figure | None) -> str:
    """Return the HTML of a value: its lines, and its picture where it has one."""
    svg = "" if picture is None else vars(picture)["_repr_svg_"]()
    narrow = svg.replace("<svg", '<svg style="max-width: 100%; height: auto"', 1)
    return f"<pre>{escape(text)}</pre>{narrow}"


# ---------------------------------------------------------------------------------------- runs and cards


def bind_values(function_of: Callable[[Job], Any]) -> None:
    """Give runs and cards their pictures, and cards the jobs that begin with one; once.

    Parameters
    ----------
    function_of : returns a job as a function
    """
    if "plot" in vars(ModelCard):
        return
    for kind, plot in ((Dataset, _plot_runs), (RigRun, _plot_run), (ModelCard, _plot_card)):
        _bind(kind, plot=plot, _repr_html_=_html_of)
    _bind(ModelCard, summary=_summary_of_card, save=_save_card)
    bind_card_jobs(ModelCard, lambda card: card, function_of)
    shorten_reprs(ModelCard)


def bind_card_jobs(
    kind: type, card_of: Callable[[Any], ModelCard], function_of: Callable[[Job], Any]
) -> None:
    """Give a class a method for each job whose first input is a card."""
    for job in JOBS.values():
        if job.inputs and job.inputs[0].kind in {"card", "card of any law"}:
            _bind(kind, **{job.name: _method_of(job, card_of, function_of)})


def _method_of(
    job: Job, card_of: Callable[[Any], ModelCard], function_of: Callable[[Job], Any]
) -> Callable[..., Any]:
    def method(self: object, *inputs: Any, **given: Any) -> Any:  # noqa: ANN401 - as the job has them
        return function_of(job)(card_of(self), *inputs, **given)

    method.__name__ = method.__qualname__ = job.name
    first, *rest = signature_of(job).parameters.values()
    owner = first.replace(name="self", kind=first.POSITIONAL_ONLY, default=first.empty)
    vars(method)["__signature__"] = inspect.Signature([owner, *rest])
    method.__doc__ = f"{job.help.splitlines()[0]} As ``mrdamper.{job.attribute}``, of this card."
    return method


def signature_of(job: Job) -> inspect.Signature:
    """Return the signature of a job as a function: its inputs, its options, its outputs."""
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


def _bind(kind: type, **methods: Callable[..., Any]) -> None:
    for name, method in methods.items():
        setattr(kind, name, method)


def _html_of(value: Any) -> str:  # noqa: ANN401 - runs, or a card
    return shown_in_notebook(repr(value), value.plot())


def _plot_runs(runs: Dataset) -> Figure:
    """Return measured loops, force over displacement and over velocity, as a Matplotlib figure."""
    from mrdamper.report.figures.runs import measured_loops

    return drawn(lambda: measured_loops(tuple(runs)), "Measured loops")


def _plot_run(run: RigRun) -> Figure:
    """Return the measured loops of one run as a Matplotlib figure."""
    return _plot_runs(Dataset((run,)))


def _plot_card(card: ModelCard) -> Figure:
    """Return force over peak velocity at the card's commands and temperatures, as a Matplotlib figure."""
    from mrdamper.report.cards.picture import card_figure

    return drawn(lambda: card_figure(card), "Force over peak velocity")


def _summary_of_card(card: ModelCard) -> str:
    """Return the card's law, range and errors, a line each."""
    return repr(card)


def _save_card(card: ModelCard, path: str | Path) -> Path:
    """Write the card as JSON; the file appears whole or not at all."""
    write_card(card, path)
    return Path(path)


# ------------------------------------------------------------------------------------------------ reprs


def brief(value: Any) -> str:  # noqa: ANN401 - a dataclass
    """Return a dataclass in at most ten lines: arrays by shape and range, collections by their size."""
    fields = [each for each in dataclasses.fields(value) if each.repr]
    lines = [f"  {each.name} = {_short(getattr(value, each.name))}"[:_LONGEST] for each in fields]
    if len("".join(lines)) < _LONGEST:
        inside = ", ".join(line.strip().replace(" = ", "=", 1) for line in lines)
        return f"{type(value).__name__}({inside})"
    more = len(lines) - _MOST_LINES
    if more > 0:
        lines = [*lines[: _MOST_LINES - 1], f"  ... and {more + 1} more fields"]
    return "\n".join([f"<{type(value).__name__}>", *lines])


def _short(value: Any) -> str:  # noqa: ANN401 - of any field
    if isinstance(value, np.ndarray):
        ends = f", {value.min():.4g} to {value.max():.4g}" if value.size and value.dtype.kind in "fiu" else ""
        return f"array {value.shape}{ends}"
    if isinstance(value, str | int | float | NoneType):
        return repr(value).partition("\n")[0]
    if isinstance(value, Mapping):
        return f"{len(value)} entries: {', '.join(map(str, list(value)[:6]))}"
    if isinstance(value, tuple | list):
        if all(isinstance(each, str | int | float) for each in value) and len(value) <= 4:
            return repr(value)
        return f"{len(value)} x {type(value[0]).__name__}" if value else "()"
    return type(value).__name__ if dataclasses.is_dataclass(value) else repr(value).partition("\n")[0]


def shorten_reprs(kind: type) -> None:
    """Give a dataclass, and all that its fields' types name, a short ``repr`` in place of a generated one."""
    for each in _dataclasses_in(kind, set()):
        made = vars(each).get("__repr__")
        is_own = made is None or str(made.__module__).startswith("mrdamper.registry")
        if not is_own and vars(each)["__dataclass_params__"].repr:
            _bind(each, __repr__=brief)


def _dataclasses_in(kind: Any, seen: set[type]) -> Iterator[type]:  # noqa: ANN401 - a type or its parts
    if isinstance(kind, type) and kind.__module__.startswith("mrdamper.") and dataclasses.is_dataclass(kind):
        if kind in seen:
            return
        seen.add(kind)
        yield kind
        try:
            parts: Any = typing.get_type_hints(kind).values()
        except NameError:  # a type that is imported for type checkers alone
            return
    else:
        parts = typing.get_args(kind)
    for part in parts:
        yield from _dataclasses_in(part, seen)
