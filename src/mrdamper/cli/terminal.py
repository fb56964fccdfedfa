"""What a person sees in the terminal: live progress on standard error, tables on standard output."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.text import Text

from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

Answer = Mapping[str, Any]

_LEAST_INTERVAL = 0.1  # between two updates of the progress line [s]


@contextmanager
def on_progress(word: str = "run", *, ctrl_c: str = "leaves nothing") -> Iterator[Progress]:
    """Give a function that shows how far a job is; it does nothing when standard error is no terminal."""
    if not sys.stderr.isatty():
        yield silent
        return
    shown = [0.0]
    with Live(Text(""), console=Console(stderr=True), transient=True, auto_refresh=False) as live:

        def show(update: ProgressUpdate) -> None:
            clock = time.monotonic()
            if clock - shown[0] >= _LEAST_INTERVAL:
                shown[0] = clock
                of = "" if update.total is None else f" of {update.total:,}"
                text = f"{word} {update.done + 1:,}{of}  {update.text}  (Ctrl-C {ctrl_c})"
                live.update(Text(text), refresh=True)

        yield show


def open_console() -> Console:
    """Return the console of standard output, wide enough for the tables when that is a file."""
    return Console(highlight=False, width=None if sys.stdout.isatty() else 110)
