"""The command line: read the options, run one job, print its result.

This module imports only click. A job's libraries are loaded when the job starts, so that ``--help`` is fast.
With ``--json`` standard output contains one JSON object and nothing else.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import click

from mrdamper.cli.commands import GroupedCommands, HelpfulCommand, JobCommand, print_message
from mrdamper.errors import MissingExtraError, MrdamperError
from mrdamper.interrupts import Interrupted, heed_interrupts, interrupts_end_at_once
from mrdamper.registry import JOBS

__all__ = ["cli", "main"]

_EXIT_INTERNAL, _EXIT_INPUT, _EXIT_INTERRUPTED = 1, 3, 4


def main() -> NoReturn:
    """Run the command line. Every error causes one message and an exit code."""
    _replace_closed_streams()
    _limit_libraries_to_one_thread()
    try:
        heed_interrupts()
        exit_code = cli(standalone_mode=False)
        sys.stdout.flush()
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.exceptions.Abort, KeyboardInterrupt, Interrupted) as error:
        _exit(_interruption_message(error), _EXIT_INTERRUPTED)
    except MrdamperError as error:
        _exit(str(error), error.exit_code)
    except BrokenPipeError:  # The program that reads the output has ended.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as error:  # All expected errors are handled above.
        if message := _resource_message(error):
            _exit(message, _EXIT_INPUT)
        if os.environ.get("MRDAMPER_DEBUG") == "1":
            raise
        text = f"Internal error: {type(error).__name__}: {error}"
        _exit(f"{text}\nPlease report it. Set MRDAMPER_DEBUG=1 for a traceback.", _EXIT_INTERNAL)
    interrupts_end_at_once()
    sys.exit(exit_code if isinstance(exit_code, int) else 0)


def _limit_libraries_to_one_thread() -> None:
    """Use one thread for linear algebra by default: matrices are small and jobs use several processes."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def _interruption_message(error: BaseException) -> str:
    """Return the message after an interrupt: written files, and notes of exceptions."""
    from mrdamper.runtime.outputs import output_folders

    paths = ", ".join(dict.fromkeys(map(str, output_folders())))
    notes: list[str] = []
    cause: BaseException | None = error
    while cause is not None:
        notes += [note for note in getattr(cause, "__notes__", ()) if note not in notes]
        cause = cause.__cause__ or cause.__context__
    text = f"Interrupted. Complete files are in {paths}." if paths else "Interrupted. No files were written."
    return " ".join((text, *notes))


def _replace_closed_streams() -> None:
    """Replace a closed standard output or standard error (``>&-``) by the null device.

    Otherwise the next file that a job opens would get the file descriptor of the closed stream, and a library
    could write its output into this file.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # The name of a file may be invalid UTF-8.


def _resource_message(error: Exception) -> str:
    """Return a message about a full disk or lack of memory; empty if the error has a different cause."""
    from mrdamper.runtime.outputs import no_room

    # SciPy's sparse solver reports a lack of memory as text.
    is_memory = isinstance(error, MemoryError) or getattr(error, "errno", 0) == errno.ENOMEM
    if is_memory or "_MALLOC fails" in str(error):
        return "There is not enough memory. Read fewer or shorter runs at once."
    if not (isinstance(error, OSError) and (reason := no_room(error))):
        return ""
    path = error.filename
    if path is None:
        path = "standard output or a temporary file"
        with suppress(OSError):  # prevents a second error when Python flushes the stream at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return f"{path}: {reason}; free some space, or write to another folder"


def _exit(message: str, code: int) -> NoReturn:
    interrupts_end_at_once()
    print_message(message)
    sys.exit(code)


@click.group(
    cls=GroupedCommands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 80}
)
@click.version_option(package_name="mrdamper")
def cli() -> None:
    """Fit models of magnetorheological dampers to test data, and use them.

    A model is stored in a model card. From the card, mrdamper simulates forces and heating, designs force
    controllers and exports C code.
    """


@cli.group()
def data() -> None:
    """List or fetch public data sets."""


@cli.command(cls=HelpfulCommand)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    metavar="NUMBER",
    default=8765,
    show_default=True,
    help="Listen on this port. 0 selects a free one.",
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default=Path(),
    metavar="DIR",
    help="Use this folder for runs, cards and results.  [default: the current folder]",
)
@click.option("--open", "open_browser", is_flag=True, help="Open the page in the browser.")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Listen on this address. Any address but the default requires --token.",
)
@click.option(
    "--token",
    metavar="TEXT",
    help="Require this secret of 16 or more characters from the browser.  [default: a secret in the folder]",
)
def serve(folder: Path, *, port: int, open_browser: bool, host: str, token: str | None) -> int:
    """Start the web application for runs, fits and simulations.

    All inputs and results are files in one folder.
    """
    try:
        from mrdamper.web.server import serve as start
    except ImportError as error:
        raise MissingExtraError.for_package("mrdamper serve", str(error.name), "web") from error

    def announce(address: str) -> None:
        click.echo(f"mrdamper: {folder.resolve()} at {address} (Ctrl-C stops it)", err=True)

    start(folder, port=port, host=host, token=token, open_browser=open_browser, announce=announce)
    return 0


for _job in JOBS.values():
    (data if " " in _job.name else cli).add_command(JobCommand(_job))
