"""What a process may take: memory, processor time, priority; all of it where the system has no limits."""

from __future__ import annotations

import math
import os
from typing import Any

resource: Any
try:
    import resource
except ImportError:  # Windows
    resource = None

_MOST_SHARE = 0.75  # of the machine's memory

ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment in which linear algebra starts no threads of its own."""


def keep_libraries_to_one_thread() -> None:
    """Let linear algebra that is loaded from now on use the calling thread only, unless the user chose.

    Its products are small here: threads would mostly wait for each other, in loops, beside a pool's own.
    """
    for name, count in ONE_THREAD.items():
        os.environ.setdefault(name, count)


def lower_priority(steps: int) -> None:
    """Add to this process's niceness, 0 to 19."""
    if hasattr(os, "nice"):
        os.nice(steps)


def leave_no_core() -> None:
    """Write no image of the memory when this process crashes."""
    if resource is not None:
        _limit(resource.RLIMIT_CORE, 0)


def limit_memory(most: int) -> None:
    """Bound the memory for data [bytes], at three quarters of the machine's."""
    if resource is not None:
        machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        _limit(resource.RLIMIT_DATA, int(min(most, _MOST_SHARE * machine)))


def limit_processor(seconds: float | None) -> None:
    """Bound the processor time that this process may take from now on, on each of its processors."""
    if resource is None:
        return
    if seconds is None:
        resource.setrlimit(resource.RLIMIT_CPU, (resource.getrlimit(resource.RLIMIT_CPU)[1],) * 2)
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    _limit(
        resource.RLIMIT_CPU,
        math.ceil(used.ru_utime + used.ru_stime + seconds * (os.cpu_count() or 1)) + 1,
    )


def _limit(kind: int, most: int) -> None:
    _, hard = resource.getrlimit(kind)
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))
