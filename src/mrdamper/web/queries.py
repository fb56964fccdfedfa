"""Queries: short computations for the pages, in processes that ``anyio.to_process`` starts, reuses and kills.

Measured files are parsed in these processes and in the processes of jobs, never in the server. Therefore a
query that takes too long or crashes its process does not affect the server. An answer is JSON. A query writes
the samples of runs for plots to the folder ``.cache``, and the server sends these files.
"""

from __future__ import annotations

import asyncio
import importlib
import os
import traceback
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import anyio
from anyio import BrokenWorkerProcess, to_process

from mrdamper.errors import InputError, MrdamperError
from mrdamper.registry import QUERIES
from mrdamper.web.workspace import FAULT, NoSpaceError, is_full

_QUERY_MAX_S = 120.0


class QueryLine:
    """A queue of queries, which are answered one after another."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    async def ask(self, name: str, arguments: Mapping[str, Any]) -> Any:  # noqa: ANN401 - any JSON
        """Return the answer of one of ``QUERIES``.

        Raise InputError if the query fails with an InputError, takes too long, or crashes.
        """
        async with self._turn:
            try:
                with anyio.fail_after(_QUERY_MAX_S):
                    return await to_process.run_sync(answer_query, name, arguments, cancellable=True)
            except TimeoutError as fault:
                raise InputError(f"took more than {_QUERY_MAX_S:g} s", remedy="Use a shorter file") from fault
            except (BrokenWorkerProcess, ProcessLookupError) as fault:  # The process died.
                raise InputError(
                    "could not be read: the reader stopped on it", remedy="The file is damaged, or too large"
                ) from fault


def answer_query(name: str, arguments: Mapping[str, Any]) -> Any:  # noqa: ANN401 - any JSON
    """Return the answer to a query; convert every exception to an error of the package."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    try:
        return find_function(name)(**arguments)
    except MemoryError as fault:
        raise InputError("needs more memory than there is", remedy="Use a shorter file") from fault
    except Exception as fault:
        if is_full(fault) or is_full(fault.__cause__ or fault):
            file = next((each.name for each in arguments.values() if isinstance(each, Path)), "the folder")
            raise NoSpaceError(f"the samples of {file} could not be stored") from fault
        if isinstance(fault, MrdamperError):
            raise
        traceback.print_exception(fault)
        raise InputError(FAULT) from fault


@cache
def find_function(name: str) -> Callable[..., object]:
    """Return the function of a query. A method is bound to an instance that is created once per process."""
    module, _, path = QUERIES[name].partition(":")
    found = importlib.import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
        if isinstance(found, type):
            found = found()
    assert callable(found)
    return found
