"""What the pages call options and commands, made from the jobs' declarations.

Messages name an option as ``--starts`` and a command as ``mrdamper predict``, marked (``errors.option``); on
a page they become the label of the field and the name of the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache

from mrdamper.jobs import options
from mrdamper.registry import JOBS
from mrdamper.schema import fields_of

__all__ = ["labels", "on_page"]

_OF_EVERY_JOB = {
    "channels": "Map channels",
    "damper": "Drawing",
    "flip-force": "turn the sign of the force",
    "least-stroke-mm": "Least stroke",
    "model": "Model",
    "out": "folder, as a new job has",
    "resume": "Resume",
}
_VALUES = {"varpro": "variable projection", "cma": "CMA-ES"}


@cache
def labels() -> Mapping[str, str]:
    """Return the words beside the fields, by the option of the command line."""
    return {**_OF_EVERY_JOB, **dict(_declared())}


def _declared() -> Iterator[tuple[str, str]]:
    for name in options.__all__:
        for field in fields_of(getattr(options, name)):
            if field.option.label:
                flag = field.option.flag or f"--{field.name.replace('_', '-')}"
                yield flag.removeprefix("--"), field.option.label
    for job in JOBS.values():
        for each in job.inputs:
            if each.flag and each.label:
                yield each.flag.removeprefix("--"), each.label


def on_page(named: str) -> str:
    """Return what the pages call an option (``--method varpro``) or a command (``mrdamper heat``)."""
    if named.startswith("mrdamper "):
        job = JOBS.get(named.split()[1])
        return job.page if job is not None and job.page else named
    flag, _, value = named.removeprefix("--").partition(" ")
    if flag not in labels():
        return named
    shown = f"“{labels()[flag]}”"
    return f"{shown}: {_VALUES.get(value, value)}" if value.islower() else shown
