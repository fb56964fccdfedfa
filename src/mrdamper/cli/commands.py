"""Commands of the registry's jobs: arguments, options, help and output.

This module imports only click. A job's libraries are loaded when the job starts.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import click

from mrdamper.errors import InputError, UsageError
from mrdamper.registry import Job
from mrdamper.schema import Field, Json

GROUPS = {
    "Data": ("data", "check", "cycles"),
    "Model": ("fit", "evaluate", "simulate", "compare", "fluid"),
    "Temperature": ("heat", "derate", "heatsink"),
    "Control": ("track", "export"),
    "Tools": ("rig", "sweep", "serve", "demo"),
}
"""Groups of commands with their commands, in the order of the help."""

EXAMPLES = {
    "check": ("lab", "lab --answer force.unit=kN --out findings"),
    "fit": ("lab --hold-out '*_060C_*' --out card", "lab --law double-bouc-wen --posterior 1000 --out card"),
    "evaluate": ("card.json lab/new_*.csv", "card.json lab --out errors"),
    "simulate": ("card.json sine:10mm:1Hz:1A:2s", "card.json lab/run_7.csv --out simulation"),
    "compare": ("new/card.json worn/card.json", "new/card.json worn/card.json --out comparison"),
    "cycles": ("endurance.csv", "endurance.csv --least-stroke-mm 2 --out cycles"),
    "heat": ("card.json --damper paper", "card.json --damper paper --duty sine:15mm:1Hz:2A:600s --out heat"),
    "derate": ("card.json --damper paper", "card.json --damper mine.toml --quantity stroke --out limits"),
    "heatsink": (
        "card.json --damper paper --network-only",
        "card.json --damper mine.toml --mass-g 300 --out sink",
    ),
    "fluid": ("viscosity.csv yield.csv --out fluid", "viscosity.csv --like lord-mrf-132dg --out fluid"),
    "track": (
        "card.json --target sine-900N-1Hz --out track",
        "card.json --controller recommended --temperature 60",
    ),
    "export": ("card.json --c c", "card.json --fmu damper.fmu --precision double --content model"),
    "rig": ("--out runs", "--preset stiff --campaign short --seed 3 --out runs"),
    "data list": ("", "--json"),
    "data fetch": ("utfsm", "utfsm --out runs"),
    "demo": ("", "--quick --out demo"),
    "sweep": ("labs/* --out fits", "--card card.json --samples 200 --out tolerance"),
    "serve": ("--open", "--folder work --port 9000"),
}
"""Arguments of two example calls of each command."""

EXIT_CODES = (
    ("0", "The command is complete."),
    ("1", "An internal error occurred. Please report it."),
    ("2", "An option or argument is invalid."),
    ("3", "The input is invalid, for example a file cannot be read."),
    ("4", "The command was interrupted or did not converge."),
    ("5", "A check failed: a run has a fault, or the exported code differs from the model."),
)

_STARTED_S = time.monotonic()
_PATH = click.Path(path_type=Path)
_UNIT_METAVARS = {"%": "PERCENT", "": "NUMBER"}  # All other units are written in capital letters.
SUMMARY_LENGTH_MAX = 60  # A line of the command list has 80 characters, including the command name.


def print_message(message: str) -> None:
    """Print a message on standard error."""
    click.echo(f"mrdamper: {message}", err=True)


def _run(job: Job, *, as_json: bool, out: Path | None = None, resume: bool = False, **values: Any) -> int:  # noqa: ANN401 - checked by click
    """Run a job with the values from the command line, print the result, and return the exit code."""
    from mrdamper.cli.terminal import answer_questions, open_console, progress_line

    given = {each.name: values.pop(each.name, None) for each in (*job.inputs, *job.reading)}
    outputs = {each.name: path for each in job.outputs if (path := values.pop(each.name)) is not None}
    if job.outputs and not outputs and not job.files_help:
        flags = [f"{output.flag} {output.option.metavar}" for output in job.outputs]
        raise click.UsageError(f"No output is given. Use {', '.join(flags[:-1])} or {flags[-1]}.")
    options = job.options_type(**{name: value for name, value in values.items() if value is not None})
    while True:
        source: object
        try:
            with progress_line(job.progress_word, ctrl_c=job.ctrl_c or "writes no files") as progress:
                result, answer = job.perform(
                    given, options, out=out, outputs=outputs, on_progress=progress, resume=resume
                )
            source = result
        except UsageError as error:
            raise click.UsageError(str(error)) from error
        except InputError as error:
            source = error
        answers = answer_questions(source, given, as_json=as_json)
        if not answers:
            break
        given["answer"] = (*(given.get("answer") or ()), *answers)
    if isinstance(source, InputError):
        raise source
    report = job.reported
    if as_json:
        click.echo(json.dumps(answer, ensure_ascii=False, allow_nan=False))
    else:
        console = open_console()
        report.show(result, console)
        first, *others = report.closing(result, answer) or [""]
        if first:
            first = f"{first.removesuffix('.')} ({time.monotonic() - _STARTED_S:.1f} s)."
            console.print("\n".join([first, *others]), markup=False, soft_wrap=True)
    outcome = report.outcome(result)
    for message in outcome.messages:
        print_message(message)
    return outcome.exit_code


class GroupedCommands(click.Group):
    """The top-level command, whose help lists the commands by group."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        width = max(map(len, self.commands))
        for title, names in GROUPS.items():
            with formatter.section(title):
                summaries = {
                    name: self.commands[name].get_short_help_str(SUMMARY_LENGTH_MAX) for name in names
                }
                formatter.write_dl([(name.ljust(width), text) for name, text in summaries.items()])


class HelpfulCommand(click.Command):
    """A command with examples and exit codes at the end of the help."""

    example_name = ""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        name = self.example_name or self.name or ""
        with formatter.section("Examples"):
            for arguments in EXAMPLES[name]:
                formatter.write(f"{'':{formatter.current_indent}}mrdamper {name} {arguments}".rstrip() + "\n")
        with formatter.section("Exit codes"):
            formatter.write_dl(EXIT_CODES)


class JobCommand(HelpfulCommand):
    """The command of a job. Its parameters are built on first use; the list of commands needs none."""

    def __init__(self, job: Job) -> None:
        super().__init__(job.name.split()[-1], help=job.help, callback=partial(_run, job))
        self.example_name = job.name
        self._job = job

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        self.params = self.params or list(parameters_of(self._job))
        return super().get_params(ctx)


def parameters_of(job: Job) -> Iterator[click.Parameter]:
    """Generate the arguments and options of a job: inputs, output paths, options of the job, ``--json``."""
    paths = (*job.inputs, *job.reading, *job.outputs)
    yield from (_parameter(field) for field in paths if field.option.flag != "-")
    if job.files_help:
        default = _default(Path(job.out_default) if job.out_default else None)
        help_text, required = job.files_help, job.out_required
        yield click.Option(["--out"], type=_PATH, metavar="DIR", help=help_text, required=required, **default)
    yield from (_parameter(field) for field in job.fields if field.option.flag != "-")
    if job.checkpoint:
        text = "Continue an interrupted run of the same command. Complete tasks are not repeated."
        yield click.Option(["--resume"], is_flag=True, help=text)
    text = "Print the result as one JSON object and nothing else."
    yield click.Option(["--json", "as_json"], is_flag=True, help=text)


def _default(value: object) -> dict[str, Any]:
    """Return click's arguments for a default. An explicit None would mark the option as required."""
    return {} if value is None else {"default": value, "show_default": True}


def _parameter(field: Field) -> click.Parameter:
    """Return the argument or option of a field. The placeholder of a number is its unit."""
    option, names, help_text = field.option, [field.flag, field.name], field.help
    if field.type is bool:
        # A flag sets the opposite of the default: if an option is on by default, the flag turns it off.
        return click.Option(names, is_flag=True, flag_value=not field.default, default=None, help=help_text)
    unit = _UNIT_METAVARS.get(option.unit, option.unit.upper()) if field.item in (int, float) else None
    common: Json = {"type": _type(field), "required": field.required, "metavar": option.metavar or unit}
    if option.argument:
        return click.Argument([field.name], nargs=-1 if field.many else 1, **common)
    default = None if field.many or field.required else field.default
    if default is None and not field.required:
        shown = option.default_help or (", ".join(map(str, field.default or ())) if field.many else "")
        help_text += f"  [default: {shown}]" if shown else ""
    if option.metavar == "TIME":
        default = f"{1e3 * field.default:g}ms"
    callback = (lambda _, __, values: values or None) if field.many else None
    common |= {"help": help_text, "multiple": field.many, "callback": callback}
    return click.Option(names, **common, **_default(default))


def _time(text: str) -> float:
    """Convert a text such as 1ms, 500us or 0.001s to seconds."""
    from mrdamper.excitation import measure

    try:
        return measure(text, "time")
    except InputError as error:
        expected = "a number and a unit, such as 1ms, 500us or 0.001s"
        raise click.BadParameter(f"{text!r} is not a time; expected {expected}") from error


def _number_type(field: Field) -> Callable[[str], float]:
    """Return a function that converts text to a number and reports range and unit if the number is wrong."""
    option = field.item_option
    words = [field.item_words, option.range_words if field.many else ""]
    expected = f"{', '.join(filter(None, words))}. {field.option.remedy}".removesuffix(". ")

    def number(text: str) -> float:
        try:
            value: float = field.item(text)
        except ValueError:
            value = math.nan
        if not option.holds(value):
            raise click.BadParameter(f"{text!r}; expected {expected}")
        return value

    return number


def _type(field: Field) -> click.ParamType[Any] | Callable[[str], float]:
    """Return the click type, or the function, that converts and checks the value of a field."""
    option = field.item_option
    if option.metavar == "TIME":
        return _time
    if field.choices and option.among is None:
        return click.Choice(field.choices)
    if field.item in (int, float):
        return _number_type(field)
    return _PATH if field.item is Path else click.STRING
