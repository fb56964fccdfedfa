"""Questions that files leave open, asked in the terminal; elsewhere ``--answer`` answers them."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

import click


def answers_to(asking: object, given: Mapping[str, Any], *, as_json: bool) -> tuple[str, ...]:
    """Return the user's answers to the questions of a result or an error, as ``--answer`` takes them.

    None are asked of a script, or by a command that takes no answers; an empty line leaves a question open,
    and one that was answered before is not asked again.
    """
    questions = getattr(asking, "questions", ())
    if as_json or "answer" not in given or not (sys.stdin.isatty() and sys.stderr.isatty()):
        return ()
    before = {text.partition("=")[0] for text in given["answer"] or ()}
    answers: dict[str, str] = {}
    for question in questions:
        if question.key in before or question.key in answers:
            continue
        choices = f" ({', '.join(question.candidates[:8])})" if question.candidates else ""
        text = f"{question.file}: {question.text}\n{question.role}, {question.topic}{choices}"
        value = click.prompt(text, default="", show_default=False, err=True)
        if value.strip():
            answers[question.key] = value.strip()
    return tuple(f"{key}={value}" for key, value in answers.items())


def print_questions(asking: object) -> None:
    """Print the questions of an error on standard output, as ``check --json`` has them, if there are any."""
    questions = [dict(each.to_dict()) for each in getattr(asking, "questions", ())]
    if questions:
        click.echo(json.dumps({"questions": questions}, ensure_ascii=False))
