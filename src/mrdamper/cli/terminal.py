"""Terminal: progress on standard error, tables on standard output, and questions about input files.

Questions are open if a file lacks information such as a unit. The user answers at a prompt or by
``--answer``.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click
from rich.console import Console
from rich.live import Live
from rich.text import Text

from mrdamper.runtime.progress import Progress, ProgressUpdate, silent

REFRESH_INTERVAL_MIN_S = 0.1  # More frequent updates would be too much for a terminal on a slow network.
FILE_WIDTH = 110  # width of tables if the output is a file, which has no window width [characters]


def answer_questions(source: object, given: Mapping[str, Any], *, as_json: bool) -> tuple[str, ...]:
    """Ask the user for missing information about input files (units, columns, ...).

    Return the answers in the syntax of the option ``--answer``. If the command runs in a script or has no
    such option, there is no prompt. If the user enters an empty line, the question has no answer. An answered
    question is not repeated. With ``--json``, the questions of an exception are printed in the format of
    ``check --json``.

    Parameters
    ----------
    source : a result or an exception, with or without an attribute ``questions``
    given : values of the command's options, by name
    """
    questions = getattr(source, "questions", ())
    if as_json and questions and isinstance(source, Exception):
        listed = [dict(question.to_dict()) for question in questions]
        click.echo(json.dumps({"questions": listed}, ensure_ascii=False))
    if as_json or "answer" not in given or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return ()
    answered = {text.partition("=")[0] for text in given["answer"] or ()}
    answers: dict[str, str] = {}
    for question in questions:
        if question.key in answered or question.key in answers:
            continue
        choices = f" ({', '.join(question.candidates[:8])})" if question.candidates else ""
        text = f"{question.file}: {question.text}\n{question.role}, {question.topic}{choices}"
        value = click.prompt(text, default="", show_default=False, err=True)
        if value.strip():
            answers[question.key] = value.strip()
    return tuple(f"{key}={value}" for key, value in answers.items())


@contextmanager
def progress_line(word: str = "run", *, ctrl_c: str) -> Iterator[Progress]:
    """Provide a function that displays the progress of a job, in a ``with`` statement.

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
