"""Locks on files and folders: they end with their process, however that ends, and are never left behind."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["lock"]


def _module_or_none(name: str) -> Any:  # noqa: ANN401 - a module of one system
    try:
        return import_module(name)
    except ImportError:
        return None


fcntl, msvcrt = _module_or_none("fcntl"), _module_or_none("msvcrt")


def lock(handle: int) -> bool | None:
    """Take the lock of an open file or folder for this process.

    Return whether this process has it now; None where the system or the disk knows no locks.
    """
    try:
        if fcntl is not None:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        elif msvcrt is not None:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            return None
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks; of msvcrt: another process has it
        return None if fcntl is not None else False
    return True
