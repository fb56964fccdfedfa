"""Queries: short computations for the pages, in processes of their own.

Measured files are parsed there and in the processes of jobs, never in the server. An answer is JSON. Samples
of runs for plots are written to the folder ``.cache``, and the server sends these files.
"""

from __future__ import annotations

import importlib
import json
import os
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError, MrdamperError
from mrdamper.registry import QUERIES
from mrdamper.schema import Json
from mrdamper.web.workspace import FAULT, NoSpaceError, is_full


@dataclass(frozen=True, slots=True)
class Query:
    """A call of one of ``QUERIES`` by keyword: files, and values as JSON holds them."""

    name: str
    files: Mapping[str, Path] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)

    def to_dict(self) -> Json:
        """Return the JSON request."""
        files = {name: str(path) for name, path in self.files.items()}
        return {"name": self.name, "files": files, "values": dict(self.values)}

    @property
    def key(self) -> str:
        """Text that identifies the query."""
        return json.dumps(self.to_dict(), sort_keys=True)


def answer_query(query: Query) -> Any:  # noqa: ANN401 - any JSON
    """Return the answer to a query; convert every exception to an error of the package."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    try:
        return find_function(query.name)(**query.files, **query.values)
    except MemoryError as fault:
        raise InputError("needs more memory than there is", remedy="Use a shorter file") from fault
    except Exception as fault:
        if is_full(fault) or is_full(fault.__cause__ or fault):
            name = next((path.name for path in query.files.values()), "the folder")
            raise NoSpaceError(f"the samples of {name} could not be stored") from fault
        if isinstance(fault, MrdamperError):
            raise
        traceback.print_exception(fault)
        raise InputError(FAULT) from fault


@cache
def find_function(name: str) -> Callable[..., object]:
    """Return the function of a query; a method belongs to the only instance in this process."""
    module, _, path = QUERIES[name].partition(":")
    found = importlib.import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
        if isinstance(found, type):
            found = found()
    assert callable(found)
    return found
