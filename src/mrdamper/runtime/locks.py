"""Locks on files and folders: they end with their process, however that ends, and are never left behind."""

from __future__ import annotations

__all__ = ["lock"]


def lock(handle: int) -> bool | None:
    """Take the lock of an open file or folder for this process.

    Return whether this process has it now; None where the system or the disk knows no locks.
    """
    try:
        import fcntl
    except ImportError:  # not on this system
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks
        return None
    return True
