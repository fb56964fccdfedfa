"""Interrupts: Ctrl-C, and what is asked of a program in other ways to end now.

For the command line SIGTERM (a cluster's scheduler, ``timeout``, a service that is stopped) and SIGHUP (a
terminal that is closed) are what Ctrl-C is: a KeyboardInterrupt. What was switched off for the program when
it was started stays off (``nohup``). A program that uses this as a library keeps its own ways.

An interrupt is raised where the program happens to be, and where that is a finalizer, Python drops it with a
traceback: it is made again a moment later.

A fit that is interrupted returns the best it has. That is right for the fit that a card is made of, and wrong
for the fits that only judge it: a table of half-finished ones would be believed.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

Act = Callable[[], None]

_SIGNALS = [signal.Signals[n] for n in ("SIGINT", "SIGTERM", "SIGHUP") if n in signal.Signals.__members__]
_ONE_S = 0.2  # two within this are one: ``timeout`` sends its signal twice, a key that is held down repeats
_AGAIN_S = 0.01  # until a dropped one is made again


@dataclass(slots=True)
class _Heard:
    """The last interrupt."""

    at_s: float = -_ONE_S
    number: int = signal.SIGINT


_LAST = _Heard()


class Interrupted(BaseException):
    """An interrupt, where nothing half-finished may be kept; no fit catches it."""


def heed_interrupts() -> None:
    """Make SIGTERM and SIGHUP what Ctrl-C is, for the rest of the program."""
    for each in _SIGNALS:
        if signal.getsignal(each) in {signal.SIG_DFL, signal.default_int_handler}:
            signal.signal(each, _heard(_raise))
    usual = sys.unraisablehook

    def hook(dropped: sys.UnraisableHookArgs) -> None:
        if not issubclass(dropped.exc_type, (KeyboardInterrupt, Interrupted)):
            usual(dropped)
            return
        try:
            _interrupt_again()
        except (KeyboardInterrupt, Interrupted):  # it came before this was left
            _interrupt_again()

    sys.unraisablehook = hook


def interrupts_end_at_once() -> None:
    """End the program without a word at the next interrupt: all is done, and nothing is left to tidy up."""
    for each in _heeded():
        signal.signal(each, signal.SIG_DFL)


@contextmanager
def on_interrupt(act: Act) -> Iterator[None]:
    """Call ``act`` at an interrupt inside the block (signals reach the main thread only)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {each: signal.signal(each, _heard(act)) for each in _heeded()}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextmanager
def interrupt_ends_all() -> Iterator[None]:
    """Turn an interrupt inside the block into ``Interrupted``."""

    def stop() -> None:
        raise Interrupted

    with on_interrupt(stop):
        yield


def _heeded() -> list[signal.Signals]:
    """Return the signals that are neither switched off nor left to the system."""
    return [each for each in _SIGNALS if callable(signal.getsignal(each))]


def _heard(act: Act) -> Callable[[int, FrameType | None], None]:
    def heard(number: int, _frame: FrameType | None) -> None:
        since, _LAST.at_s, _LAST.number = time.monotonic() - _LAST.at_s, time.monotonic(), number
        if signal.Signals(number).name == "SIGHUP":
            _leave_dead_terminal()
        if since >= _ONE_S:
            act()

    return heard


def _raise() -> None:
    raise KeyboardInterrupt


def _interrupt_again() -> None:
    """Make the last interrupt again, as soon as what dropped it has come to its end."""

    def again() -> None:
        _LAST.at_s = -_ONE_S
        _thread.interrupt_main(signal.Signals(_LAST.number))

    timer = threading.Timer(_AGAIN_S, again)
    timer.daemon = True
    timer.start()


def _leave_dead_terminal() -> None:
    """Say nothing more to a terminal that is gone: each word would be a fault."""
    for said in (1, 2):
        try:
            os.write(said, b"")
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), said)
