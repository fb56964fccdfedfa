"""Connections that cannot starve the server: a deadline for each request's head, and a bounded number.

Whoever opens connections and says nothing, or says it letter by letter, is cut off; of too many that are open
the oldest that waits for a request is closed. What is logged of requests that are none is bounded, too.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_S = (
    10.0  # from a connection, or the first byte of another request on it, to the end of the request's head
)
MOST_OPEN = 200  # of one process; a browser has six
_MOST_LINES = 20  # of one message, in the log


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 as uvicorn has it, with a deadline and a bound."""

    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn's
        super().connection_made(transport)
        self._expect_head()
        ours = [each for each in self.connections if isinstance(each, BoundedProtocol)]
        still_open = [each for each in ours if not each.transport.is_closing()]
        if len(still_open) > MOST_OPEN:
            waiting = [each for each in still_open if each.waits]
            min(waiting, key=lambda each: each.waits_since, default=self).transport.abort()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if not self.waits:
            self._forget_deadline()
        elif self._deadline is None:
            self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        self._forget_deadline()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self.waits_since = self.loop.time()

    @property
    def waits(self) -> bool:
        """Whether no request is being answered."""
        cycle: Any = self.cycle
        return cycle is None or cycle.response_complete

    def _expect_head(self) -> None:
        self.waits_since = self.loop.time()
        self._deadline = self.loop.call_later(HEAD_S, self._cut_off)

    def _forget_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _cut_off(self) -> None:
        self._deadline = None
        if self.waits:
            self.transport.abort()


def bound_log() -> None:
    """Let each message of the server into the log some times, and no more."""
    counts: dict[str, int] = {}

    def few(record: logging.LogRecord) -> bool:
        said = str(record.msg)
        counts[said] = counts.get(said, 0) + 1
        return counts[said] <= _MOST_LINES

    for name in ("uvicorn.error", "asyncio"):
        logging.getLogger(name).addFilter(few)
