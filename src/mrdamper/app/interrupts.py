"""Ctrl-C outside the one fit whose best-so-far is worth keeping.

A fit that is interrupted returns the best it has. That is right for the fit that a card is made of, and wrong
for the fits that only judge it: a table of half-finished ones would be believed.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["Interrupted", "interrupt_ends_all"]


class Interrupted(BaseException):
    """Ctrl-C, where nothing half-finished may be kept; no fit catches it."""


@contextmanager
def interrupt_ends_all() -> Iterator[None]:
    """Turn Ctrl-C into ``Interrupted`` inside the block (signals reach the main thread only)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise Interrupted

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
