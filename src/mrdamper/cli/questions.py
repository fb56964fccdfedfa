"""Questions about input files, such as an unknown unit. The user answers at a prompt or by ``--answer``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

import click


def answer_questions(source: object, given: Mapping[str, Any], *, as_json: bool) -> tuple[str, ...]:
    """Prompt for answers to the open questions; return the answers in the syntax of ``--answer``.

    If the command runs in a script or has no option ``--answer``, there is no prompt. An empty line leaves a
    question open. A question that has been answered is not repeated. With ``--json``, the questions of an
    exception are printed in the format of ``check --json``.

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
