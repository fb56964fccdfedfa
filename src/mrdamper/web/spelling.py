"""What the pages call options and commands, made from the jobs' declarations.

Messages name an option as ``--starts`` and a command as ``mrdamper evaluate``, marked (``errors.option``); on
a page they become the label of the field and the name of the page.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from mrdamper.registry import JOBS
from mrdamper.schema import Field
from mrdamper.web.forms import label_of
from mrdamper.web.schemas import order_kinds, request_fields

_OF_EVERY_JOB = {
    "channels": "Map channels",
    "out": "folder, as a new job has",
    "resume": "Resume",
}


@cache
def labels() -> Mapping[str, str]:
    """Return the words beside the fields, by the option of the command line."""
    return {**{name: label_of(field) for name, field in _fields().items()}, **_OF_EVERY_JOB}


@cache
def _fields() -> Mapping[str, Field]:
    found: dict[str, Field] = {}
    for kind in order_kinds():
        for field in request_fields(kind):
            found.setdefault(field.flag.removeprefix("--"), field)
    return found


def on_page(named: str) -> str:
    """Return what the pages call an option (``--method varpro``) or a command (``mrdamper heat``)."""
    if named.startswith("mrdamper "):
        job = JOBS.get(named.split()[1])
        return job.page if job is not None and job.page else named
    flag, _, value = named.removeprefix("--").partition(" ")
    if flag not in labels():
        return named
    shown = f"“{labels()[flag]}”"
    if not value.islower():
        return shown
    field = _fields().get(flag)
    titles = {} if field is None else dict(zip(field.choices, field.option.page.titles, strict=False))
    return f"{shown}: {titles.get(value, value)}"
