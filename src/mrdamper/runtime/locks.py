"""Locks on files and folders: they end with their process, however that ends, and are never left behind."""

from __future__ import annotations

from typing import Any

fcntl: Any
msvcrt: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None
try:
    import msvcrt
except ImportError:  # everywhere else
    msvcrt = None


def lock(handle: int) -> bool | None:
    """Take the lock of an open file or folder for this process.

    Return True if this process has it now; None if system or disk do not support locks.
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
