"""Terminal output: progress on standard error, tables on standard output."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.text import Text

from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

REFRESH_INTERVAL_MIN_S = 0.1  # More frequent updates would be too much for a terminal on a slow network.
FILE_WIDTH = 110  # width of tables if the output is a file, which has no window width [characters]


@contextmanager
def progress_line(word: str = "run", *, ctrl_c: str) -> Iterator[Progress]:
    """Generate one function that displays the progress of a job, for a with statement.

    If there is no terminal, the function does nothing.

    Parameters
    ----------
    word : unit of the progress count, such as "run"
    ctrl_c : effect of Ctrl-C, as a verb with an object, such as "writes no files"
    """
    if not sys.stderr.isatty():
        yield silent
        return
    refreshed_at = 0.0
    with Live(Text(""), console=Console(stderr=True), transient=True, auto_refresh=False) as live:

        def show(update: ProgressUpdate) -> None:
            nonlocal refreshed_at
            now = time.monotonic()
            if now - refreshed_at >= REFRESH_INTERVAL_MIN_S:
                refreshed_at = now
                total = "" if update.total is None else f" of {update.total:,}"
                text = f"{word} {update.done + 1:,}{total}  {update.text}  (Ctrl-C {ctrl_c})"
                live.update(Text(text), refresh=True)

        yield show


def open_console() -> Console:
    """Return the console of standard output."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else FILE_WIDTH)
