"""Interrupts: SIGTERM and SIGHUP end a command like Ctrl-C, with a KeyboardInterrupt.

SIGTERM is sent by the scheduler of a cluster, by ``timeout``, or when a service stops. SIGHUP is sent when a
terminal is closed. A signal that was disabled when the program started stays disabled (``nohup``). Programs
that use this package as a library keep their own signal handling.

An interrupted fit returns the best result so far. This is useful for the final fit of a card. It is not
useful for the fits of a model selection, because an incomplete fit must not be compared with complete fits.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_SIGNALS = [signal.Signals[n] for n in ("SIGINT", "SIGTERM", "SIGHUP") if n in signal.Signals.__members__]


class Interrupted(BaseException):
    """An interrupt that discards partial results. Fits do not catch this exception."""


def heed_interrupts() -> None:
    """Raise KeyboardInterrupt at SIGTERM and SIGHUP from now on, like at Ctrl-C."""
    for each in _SIGNALS:
        if signal.getsignal(each) is signal.SIG_DFL:
            signal.signal(each, signal.default_int_handler)


def interrupts_end_at_once() -> None:
    """Let the next interrupt end the program silently, because all work is finished."""
    for each in _heeded():
        signal.signal(each, signal.SIG_DFL)


@contextmanager
def on_interrupt(act: Callable[[], None]) -> Iterator[None]:
    """Call ``act`` at interrupts in a ``with`` statement (only in the main thread)."""
    with _handled_by(lambda _number: act()):
        yield


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Delay an interrupt until the ``with`` statement ends.

    Otherwise a library in the ``with`` statement can lose the KeyboardInterrupt.
    """
    received: list[int] = []
    try:
        with _handled_by(received.append):
            yield
    finally:
        for number in received[:1]:
            signal.raise_signal(number)


@contextmanager
def interrupt_ends_all() -> Iterator[None]:
    """Raise ``Interrupted`` at interrupts in a ``with`` statement."""

    def stop() -> None:
        raise Interrupted

    with on_interrupt(stop):
        yield


@contextmanager
def _handled_by(handle: Callable[[int], None]) -> Iterator[None]:
    """Call ``handle`` with the signal number at interrupts in a ``with`` statement."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, lambda number, _frame: handle(number)) for each in _heeded()}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _heeded() -> list[signal.Signals]:
    """Return the signals that have a Python handler; disabled signals are omitted."""
    return [each for each in _SIGNALS if callable(signal.getsignal(each))]
