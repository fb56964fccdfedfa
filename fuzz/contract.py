"""What a reader promises: one message of ours, or a sound value; nothing else, in bounded time and memory."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from mrdamper.data.formats.table import FileOptions, Table
from mrdamper.errors import InputError, MrdamperError

__all__ = [
    "BrokenPromiseError",
    "check_contract",
    "folder",
    "promised",
    "require",
    "sound_table",
    "taking",
    "written",
]

_LONGEST_MESSAGE = 200 * 4100
_MOST_READ = 1 << 16  # samples: a column that claims more is not read here, for the time it takes


class BrokenPromiseError(AssertionError):
    """A reader did what it says it never does."""


def require(kept: object, said: str) -> None:
    """Raise when a promise is not kept."""
    if not kept:
        raise BrokenPromiseError(said)


@contextmanager
def promised(place: str = "") -> Iterator[None]:
    """Let errors of ours pass when they say something, and say where; everything else is a finding."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # would stand between a user's lines
        try:
            yield
        except MrdamperError as error:
            said = str(error)
            require(0 < len(said) <= _LONGEST_MESSAGE, f"a message of {len(said)} characters: {said[:200]!r}")
            require("Traceback" not in said, f"a trace in a message: {said[:400]!r}")
            require(place in said, f"the message does not name {place}: {said[:200]!r}")


def check_contract() -> None:
    """Require that our errors pass when they say something and name the place, and that nothing else does."""
    for error, passes in (
        (InputError("a.csv: is empty; expected columns"), True),
        (InputError("is empty"), False),
        (InputError(""), False),
        (KeyError("force"), False),
    ):
        try:
            with promised("a.csv"):
                raise error
        except (BrokenPromiseError, KeyError):
            require(not passes, f"{error!r} should pass")
        else:
            require(passes, f"{error!r} should not pass")


@cache
def _room() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="mrdamper-fuzz-")


def folder() -> Path:
    """Return a folder of this process, which goes with it."""
    return Path(_room().name)


def written(name: str, content: bytes) -> Path:
    """Return the path of a file that holds ``content``."""
    path = folder() / name
    path.write_bytes(content)
    return path


def taking(name: str, read: Callable[[Path, FileOptions], Table]) -> Callable[[bytes], None]:
    """Return the target of one format's reader, given a file of that name."""

    def take(content: bytes) -> None:
        path = written(name, content)
        with promised(name):
            sound_table(read(path, FileOptions()))

    return take


def sound_table(table: Table) -> None:
    """Require that a table is one: distinct names, numbers in one dimension, no column longer than said."""
    require(len(set(table.names)) == len(table.names), f"names come twice: {table.names}")
    require(set(table.columns) | set(table.texts) <= set(table.names), "a column that has no name")
    require(not set(table.columns) & set(table.texts), "a column of numbers and text")
    require(table.layout.in_words(), "no words on the layout")
    if table.rows > _MOST_READ:
        return
    for name in table.columns:
        values = table.columns[name]
        require(isinstance(values, np.ndarray), f"{name} is no array")
        require(values.dtype == np.float64 and values.ndim == 1, f"{name}: {values.dtype}, {values.shape}")
        require(len(values) <= table.rows, f"{name} has {len(values)} samples of {table.rows}")
    for name in table.texts:
        require(all(cell is None or isinstance(cell, str) for cell in table.texts[name]), f"{name}: not text")
