"""Numbers that change with the items in a folder, so that pages detect changes by any program."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from pathlib import Path

from mrdamper.web.workspace import WorkFolder


class Changes:
    """Changes in the folder of a damper."""

    def __init__(self, folder: WorkFolder) -> None:
        self._places = {
            "files": folder.runs,
            "records": folder.records,
            "inputs": folder.inputs,
            "cards": folder.cards,
            "jobs": folder.results,
        }
        self._counts: Counter[str] = Counter()

    def publish(self, what: str) -> None:
        """Note that items of a kind have changed, such as a file that has been read."""
        self._counts[what] += 1

    def numbers(self) -> dict[str, str]:
        """Return a text for each kind of item that differs after a change."""
        return {what: f"{self._counts[what]}-{_signature(place):x}" for what, place in self._places.items()}


def _signature(place: Path) -> int:
    """Return a number that changes with the names and times in a folder."""
    found = []
    with suppress(OSError):
        for path in place.iterdir():
            # Files for resuming a job grow all the time.
            if not path.name.startswith(".") and path.suffix != ".progress":
                with suppress(OSError):
                    found.append((path.name, path.stat().st_mtime_ns))
    return hash(tuple(sorted(found)))
