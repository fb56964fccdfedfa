"""Commands made from the rows of the registry: their arguments, options, help and output.

Only click is loaded with this module; a job's libraries are loaded when it starts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from mrdamper.cli.asking import answers_to, print_questions
from mrdamper.errors import InputError, UsageError, spelled
from mrdamper.registry import KINDS, Input, Job
from mrdamper.schema import Field

_FILE = click.Path(path_type=Path)


def tell(message: str) -> None:
    """Say something on standard error."""
    click.echo(f"mrdamper: {spelled(message)}", err=True)


def command_of(job: Job, finish: Callable[[Job, Any, dict[str, Any], bool], int]) -> click.Command:
    """Return the command of a job; ``finish`` prints what came of it and returns the exit code."""

    def run(*, as_json: bool, out: Path | None = None, resume: bool | None = None, **values: Any) -> int:  # noqa: ANN401 - click checks them
        from mrdamper.cli.terminal import on_progress

        given = {name: values.pop(name, None) for name in job.given_names}
        places = {each.name: values.pop(each.name) for each in job.outputs}
        outputs = {name: place for name, place in places.items() if place is not None}
        if job.outputs and not outputs and not job.files_help:
            ways = [f"{each.flag} {each.metavar}" for each in job.outputs]
            raise click.UsageError(f"nothing to write: give {', '.join(ways[:-1])} or {ways[-1]}")
        options = job.options_type(**{name: value for name, value in values.items() if value is not None})
        ctrl_c = job.ctrl_c or ("keeps what is finished for --resume" if job.checkpoint and out else "")
        while True:
            try:
                with on_progress(job.progress_word, ctrl_c=ctrl_c or "leaves nothing") as progress:
                    result, answer = job.perform(
                        given,
                        options,
                        out=out,
                        outputs=outputs,
                        on_progress=progress,
                        resume=resume,
                        on_note=tell,
                    )
            except UsageError as fault:
                raise click.UsageError(str(fault)) from fault
            except InputError as fault:
                more = answers_to(fault, given, as_json=as_json)
                if not more:
                    if as_json:
                        print_questions(fault)
                    raise
            else:
                more = answers_to(result, given, as_json=as_json)
                if not more:
                    break
            given["answer"] = (*(given.get("answer") or ()), *more)
        return finish(job, result, answer, as_json)

    return LateCommand(job, callback=run)


class LateCommand(click.Command):
    """A command whose parameters are made when they are asked for: a list of commands needs none."""

    def __init__(self, job: Job, callback: Callable[..., int]) -> None:
        super().__init__(job.name.split()[-1], help=job.help, callback=callback)
        self._job: Job | None = job

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        if self._job is not None:
            self.params, self._job = list(parameters_of(self._job)), None
        return super().get_params(ctx)

    def make_parser(self, ctx: click.Context) -> Any:  # noqa: ANN401 - click's own
        self.get_params(ctx)
        return super().make_parser(ctx)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        self.get_params(ctx)
        return super().parse_args(ctx, args)


def parameters_of(job: Job) -> Iterator[click.Parameter]:
    """Yield a job's arguments and options as click has them: inputs, the folder, its own options."""
    yield from (_input(each) for each in job.inputs if not each.flag)
    yield from (_input(each) for each in job.inputs if each.flag not in {"", "-"})
    yield from (_option(each) for each in job.reading)
    for each in job.outputs:
        yield click.Option([each.flag], type=_FILE, metavar=each.metavar, help=each.help)
    if job.files_help:
        usual = _default(Path(job.out_default) if job.out_default else None)
        help_text, required = job.files_help, job.out_required
        yield click.Option(["--out"], type=_FILE, metavar="DIR", help=help_text, required=required, **usual)
    yield from (_option(each) for each in job.fields if each.option.flag != "-")
    if job.checkpoint:
        text = "Go on with what a run of this same command had finished when it ended; it is in OUT.progress."
        yield click.Option(["--resume"], is_flag=True, help=text)
    text = "Print one JSON object on standard output, nothing else."
    yield click.Option(["--json", "as_json"], is_flag=True, help=text)


def _input(each: Input) -> click.Parameter:
    kind_of = KINDS[each.kind]
    metavar = kind_of.metavar
    if kind_of.many and not each.flag:
        return click.Argument(
            [each.name], nargs=-1, type=click.STRING, required=each.required, metavar=metavar
        )
    if not each.flag:
        kind = _FILE if kind_of.read else str  # what nothing reads may be words, such as a motion
        return click.Argument([each.name], type=kind, required=each.required, metavar=metavar)
    kind = str if each.default is not None or not kind_of.read or kind_of.choices else _FILE
    usual = f"  [default: {each.default_help}]" if each.default_help and not each.required else ""
    return click.Option(
        [each.flag, each.name],
        type=kind,
        metavar=metavar,
        help=each.help + usual,
        required=each.required,
        multiple=kind_of.many,
        callback=(lambda _, __, values: values or None) if kind_of.many else None,
        **_default(each.default),
    )


def _default(value: object) -> dict[str, Any]:
    """Return how click is told a default: None, said as one, would stand for what is required."""
    return {} if value is None else {"default": value, "show_default": True}


def _option(field: Field) -> click.Option:
    said, option = field.option.help, field.option
    if field.type is bool:
        # an option that is on by default is named for turning it off
        return click.Option(
            [field.flag, field.name], is_flag=True, flag_value=not field.default, default=None, help=said
        )
    default = None if field.many or field.default is None else field.default
    if default is None and option.default_help:
        said += f"  [default: {option.default_help}]"
    if field.many:
        return click.Option(
            [field.flag, field.name],
            type=_type(field),
            multiple=True,
            help=said,
            metavar=option.metavar or None,
            callback=lambda _, __, values: values or None,
        )
    if option.metavar == "TIME":
        default = f"{1e3 * field.default:g}ms"
    return click.Option(
        [field.flag, field.name],
        type=_type(field),
        default=default,
        show_default=default is not None,
        help=said,
        metavar=option.metavar or None,
    )


class _Time(click.ParamType[float]):
    """A time such as 1ms, 500us or 0.001s, in seconds."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:  # noqa: ANN401 - click's own
        found = re.fullmatch(r"\s*(\d+\.?\d*(?:e-?\d+)?|\.\d+)\s*(us|ms|s)\s*", str(value), re.IGNORECASE)
        if found is None:
            self.fail(f"{value!r} is not a time; expected such as 1ms, 500us or 0.001s", param, ctx)
        return float(found[1]) * {"us": 1e-6, "ms": 1e-3, "s": 1.0}[found[2].lower()]


class _Number(click.FloatRange):
    """A number in a range; what is not is told in the words of the field, with its unit."""

    def __init__(self, field: Field, low: float | None, high: float | None) -> None:
        option = field.item_option
        super().__init__(low, high, min_open=option.least is None, max_open=option.most is None)
        words = [field.item_words, option.range_words if field.many else ""]
        self._words = f"{', '.join(filter(None, words))}. {field.option.remedy}".removesuffix(". ")

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:  # noqa: ANN401 - click's own
        try:
            return super().convert(float(value), param, ctx)
        except (ValueError, click.BadParameter):
            self.fail(f"{value!r}; expected {self._words}", param, ctx)


def _type(field: Field) -> click.ParamType[Any]:
    """Return what click checks a value by."""
    item, option = field.item, field.item_option
    if option.metavar == "TIME":
        return _Time()
    if field.choices and option.among is None:
        return click.Choice(field.choices)
    low = option.above if option.least is None else option.least
    high = option.below if option.most is None else option.most
    if item is int:
        top = None if high is None else int(high) - (option.most is None)
        return (
            click.INT
            if low is None and top is None
            else click.IntRange(None if low is None else int(low), top)
        )
    if item is float:
        if low is None and high is None:
            return click.FLOAT
        return _Number(field, low, high)
    return _FILE if item is Path else click.STRING
