"""Locks on files and folders. When a process ends for any reason, the operating system releases its locks."""

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
except ImportError:  # all systems except Windows
    msvcrt = None


def lock(handle: int) -> bool | None:
    """Lock an open file or folder for this process.

    Return True if this process has the lock now, False if another process has the lock, and None if the
    operating system or the disk does not support locks.
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
    except OSError:  # fcntl: the disk has no locks. msvcrt: another process has the lock.
        return None if fcntl is not None else False
    return True
