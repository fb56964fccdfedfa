"""Queries in processes of their own, which ``anyio.to_process`` starts, reuses, limits and kills.

A query that takes too long or breaks its process affects that process only.
"""

from __future__ import annotations

import asyncio
from typing import Any

import anyio
from anyio import BrokenWorkerProcess, to_process

from mrdamper.errors import InputError
from mrdamper.web.query_worker import Query, answer_query

QUERY_MAX_S = 120.0


class WorkerClient:
    """Client that answers queries one after another in processes of the pool."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    async def ask(self, query: Query) -> Any:  # noqa: ANN401 - any JSON
        """Return the answer to a query.

        Raises
        ------
        InputError
            As the query's function raised it, or the process could not answer.
        NoSpaceError
            The disk is full.
        """
        async with self._turn:
            try:
                with anyio.fail_after(QUERY_MAX_S):
                    return await to_process.run_sync(answer_query, query, cancellable=True)
            except TimeoutError as fault:
                raise InputError(f"took more than {QUERY_MAX_S:g} s", remedy="Use a shorter file") from fault
            except (BrokenWorkerProcess, ProcessLookupError) as fault:  # The process died.
                raise InputError(
                    "could not be read: the reader stopped on it", remedy="The file is damaged, or too large"
                ) from fault
