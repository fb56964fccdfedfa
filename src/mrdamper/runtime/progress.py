"""Progress of a job. All jobs pass an object of the same type to the callback function ``on_progress``.

A job may call the function at any rate. The function itself limits the rate of displaying or storing. If the
function raises an exception, the job ends.
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
    total : total number of units of work, at least ``done``; None while the number is unknown
    text : name of the unit that was finished last, or a short sentence; may be empty
    detail : additional state of a type that depends on the job, such as the state of a search; usually None
    """

    done: int = 0
    total: int | None = None
    text: str = ""
    detail: object | None = None

    @property
    def fraction(self) -> float | None:
        """Finished fraction of the work, 0 to 1; None while the total is unknown."""
        if self.total is None:
            return None
        return min(self.done / self.total, 1.0) if self.total > 0 else 1.0


Progress = Callable[[ProgressUpdate], None]
"""Callback function that receives the state of a job."""


def silent(_update: ProgressUpdate) -> None:
    """Do nothing. This function is the default of ``on_progress`` in every job."""
