"""The command line: options in, one job called, its answer printed.

Only click is imported here; a job's libraries are loaded when it starts, so that help answers at once.
With ``--json`` standard output holds one JSON object and nothing else. Exit codes: 0 done, 1 internal fault,
2 usage, 3 bad data or units, 4 did not converge (or interrupted), 5 a check failed.
"""

from __future__ import annotations

import errno
import io
import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import click

from mrdamper.cli.commands import command_of, tell
from mrdamper.errors import MissingExtraError, MrdamperError
from mrdamper.registry import JOBS, Job
from mrdamper.runtime.signals import Interrupted, heed_interrupts, interrupts_end_at_once

__all__ = ["cli", "main"]

Answer = dict[str, Any]
Command = TypeVar("Command", bound=Callable[..., Any])

_INTERNAL, _UNREADABLE, _NOT_CONVERGED = 1, 3, 4
_INTERRUPTED = "interrupted before there was a result; nothing was written"


def main() -> NoReturn:
    """Run the command line; whatever goes wrong ends in one message and an exit code."""
    _open_closed_outputs()
    _keep_libraries_to_one_thread()
    try:
        heed_interrupts()
        answer = cli(standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as fault:
        fault.show()
        sys.exit(fault.exit_code)
    except (click.exceptions.Abort, KeyboardInterrupt, Interrupted) as end:
        _leave(_words_of(end), _NOT_CONVERGED)
    except MrdamperError as fault:
        _leave(str(fault), fault.exit_code)
    except BrokenPipeError:  # the reader of our output has left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as fault:  # the outermost door: nothing behind it
        if isinstance(fault, OSError):
            _leave_for_room(fault)
        if _is_of_memory(fault):
            _leave("this needs more memory than there is; read fewer or shorter runs at once", _UNREADABLE)
        if os.environ.get("MRDAMPER_DEBUG") == "1":
            raise
        said = f"{type(fault).__name__}: {fault}"
        _leave(
            f"internal fault: {said}\nThis is a fault of mrdamper; MRDAMPER_DEBUG=1 shows where", _INTERNAL
        )
    interrupts_end_at_once()
    sys.exit(answer if isinstance(answer, int) else 0)


def _keep_libraries_to_one_thread() -> None:
    """Use one thread in linear algebra unless the user chose: products are small, and cores have jobs."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _is_of_memory(fault: Exception) -> bool:
    """Tell whether a fault is a lack of memory: SciPy's solver of sparse systems says so in words."""
    return (
        isinstance(fault, MemoryError)
        or (isinstance(fault, OSError) and fault.errno == errno.ENOMEM)
        or "_MALLOC fails" in str(fault)
    )


def _words_of(end: BaseException) -> str:
    """Return what an interrupt left, with the notes of the one before it that it cut short."""
    from mrdamper.runtime.outputs import written

    places = ", ".join(dict.fromkeys(map(str, written())))
    notes: list[str] = []
    each: BaseException | None = end
    while each is not None:
        notes += [note for note in getattr(each, "__notes__", ()) if note not in notes]
        each = each.__cause__ or each.__context__
    return "; ".join((f"interrupted; what was finished is in {places}" if places else _INTERRUPTED, *notes))


def _open_closed_outputs() -> None:
    """Give a program that was started without standard output or error (``>&-``) one that leads nowhere.

    Their numbers are taken, so that no file of a job gets what a library writes there.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a file's name need not be UTF-8


def _leave_for_room(fault: OSError) -> None:
    """Leave when there is no room for what was to be written; return when it is another fault."""
    from mrdamper.runtime.outputs import no_room

    why = no_room(fault)
    if not why:
        return
    where = fault.filename
    if where is None:
        where = "standard output, or a temporary file"
        with suppress(OSError):  # else it fails once more when Python ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    _leave(f"{where}: {why}; make room there, or write elsewhere", _UNREADABLE)


def _leave(message: str, code: int) -> NoReturn:
    interrupts_end_at_once()
    tell(message)
    sys.exit(code)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="mrdamper")
def cli() -> None:
    """From a magnetorheological damper's rig files to a model card with honest errors."""


@cli.group()
def data() -> None:
    """Public data sets: what there is, and fetching it."""


@cli.command()
@click.option(
    "--port", type=click.IntRange(0, 65535), default=8765, show_default=True, help="0: any that is free."
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path(),
    metavar="DIR",
    help="Where runs, cards and results lie.  [default: here]",
)
@click.option("--open", "open_browser", is_flag=True, help="Open the page in the browser.")
@click.option(
    "--host", default="127.0.0.1", show_default=True, help="Address to listen on; others need a --token."
)
@click.option(
    "--token",
    metavar="TEXT",
    help="What a browser must know; 16 characters or more.  [default: the folder's]",
)
def serve(folder: Path, *, port: int, open_browser: bool, host: str, token: str | None) -> int:
    """Show runs, fit, heat, track and export in the browser; work stays in the folder, as files."""
    try:
        from mrdamper.web.server import serve as start
    except ImportError as fault:
        raise MissingExtraError.for_package("mrdamper serve", str(fault.name), "web") from fault

    def announce(address: str) -> None:
        click.echo(f"mrdamper: {folder.resolve()} at {address} (Ctrl-C stops it)", err=True)

    start(folder, port=port, host=host, token=token, open_browser=open_browser, announce=announce)
    return 0


def _show(job: Job, result: object, answer: Answer, as_json: bool) -> int:  # noqa: FBT001 - as all of them
    """Print what came of a job, as JSON or as its report has it for a terminal; return the exit code."""
    report = job.reported
    if as_json:
        click.echo(json.dumps(answer, ensure_ascii=False, allow_nan=False))
    else:
        from mrdamper.cli.terminal import open_console

        screen = open_console()
        report.show(result, screen)
        report.wrote(result, answer, screen)
    outcome = report.outcome(result)
    for each in outcome.said:
        tell(each)
    return outcome.exit_code


for _each in JOBS.values():
    *_group, _name = _each.name.split()
    (data if _group else cli).add_command(command_of(_each, _show))
