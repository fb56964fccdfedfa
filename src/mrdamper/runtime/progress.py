"""How far a job is: one type for all jobs, given to the caller's ``on_progress``.

A job reports as often as it likes; who shows or stores progress decides how often that is. A callback that
raises ends the job.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgressUpdate:
    """State of a job at one moment.

    Attributes
    ----------
    done : finished units of work (runs, tasks, iterations, rows), at least 0
    total : units of work in all, at least ``done``; None while that is not known
    text : name of the unit that was finished last, or a short sentence; may be empty
    detail : additional state with a type of the job, such as the state of a search; usually None
    """

    done: int = 0
    total: int | None = None
    text: str = ""
    detail: object | None = None

    @property
    def fraction(self) -> float | None:
        """Finished share of the work, 0 to 1; None while the total is not known."""
        if self.total is None:
            return None
        return min(self.done / self.total, 1.0) if self.total > 0 else 1.0


Progress = Callable[[ProgressUpdate], None]
"""Receives the state of a job; ``silent`` ignores it."""


def silent(_update: ProgressUpdate) -> None:
    """Ignore progress: the default of every job's ``on_progress``."""
