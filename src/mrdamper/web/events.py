"""Server-sent events: progress of a job, and changes in the folder."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from mrdamper.errors import InputError
from mrdamper.web.job_record import JobRecord
from mrdamper.web.workspace import WorkFolder

_LOOK_S = 0.2
_WATCH_S = 1.5
_BEAT_S = 15.0  # Interval of comments, because proxies close idle connections.
_MOST_WAITING = 64

Gone = Callable[[], bool]


def event(name: str, told: Mapping[str, Any], number: int | None = None) -> str:
    """Return the text of one event."""
    numbered = "" if number is None else f"id: {number}\n"
    said = json.dumps(told, allow_nan=False)
    return f"{numbered}event: {name}\ndata: {said}\n\n"


async def job_events(record: JobRecord, after: int, gone: Gone) -> AsyncIterator[str]:
    """Yield the progress of a job after line ``after``, then new progress, then its end."""
    place, line, rest, quiet = 0, 0, b"", 0.0
    while not gone():
        try:
            has_ended = record.read().has_ended
        except InputError:  # The job was deleted.
            return
        with suppress(OSError), (record.folder / "progress.jsonl").open("rb") as file:
            file.seek(place)
            found = file.read()
            place += len(found)
            *whole, rest = (rest + found).split(b"\n")
            for each in whole:
                line += 1
                if line <= after:
                    continue
                with suppress(ValueError):
                    told = json.loads(each)
                    yield event(told.pop("event"), told, line)
                quiet = 0.0
        if has_ended:
            yield event("end", record.shown())
            return
        await asyncio.sleep(_LOOK_S)
        quiet += _LOOK_S
        if quiet >= _BEAT_S:
            quiet = 0.0
            yield ": still here\n\n"


class EventBus:
    """Notification of all listeners about changes in the folder of a damper, also by other programs."""

    def __init__(self, folder: WorkFolder, name: str = "", beside: EventBus | None = None) -> None:
        """Create the bus of a damper; with ``beside`` it shares the listeners of another bus."""
        self._folder, self._name = folder, name
        self._watch: asyncio.Task[None] | None = None
        self.listeners: set[asyncio.Queue[tuple[str, str]]] = beside.listeners if beside else set()
        self.buses: list[EventBus] = beside.buses if beside else []
        self.buses.append(self)

    def leave(self) -> None:
        """Stop watching and leave the shared buses."""
        self.buses.remove(self)
        if self._watch is not None:
            self._watch.cancel()

    def publish(self, what: str) -> None:
        """Notify all listeners that items of a kind have changed."""
        for queue in self.listeners:
            if queue.qsize() < _MOST_WAITING:
                queue.put_nowait((self._name, what))

    async def listen(self, gone: Gone) -> AsyncIterator[str]:
        """Yield an event for each change, until ``gone`` returns True."""
        queue: asyncio.Queue[tuple[str, str]] = asyncio.Queue()
        self.listeners.add(queue)
        for bus in self.buses:
            bus.watch()
        try:
            yield event("changed", {"what": ["files", "records", "inputs", "cards", "jobs"]})
            quiet = 0.0
            while not gone():
                try:
                    async with asyncio.timeout(1.0):
                        heard = {await queue.get()}
                except TimeoutError:
                    quiet += 1.0
                    if quiet >= _BEAT_S:
                        quiet = 0.0
                        yield ": still here\n\n"
                    continue
                await asyncio.sleep(_LOOK_S)  # Several changes are sent as one event.
                while not queue.empty():
                    heard.add(queue.get_nowait())
                for name in sorted({damper for damper, _ in heard}):
                    what = sorted(each for damper, each in heard if damper == name)
                    yield event("changed", {"damper": name, "what": what})
        finally:
            self.listeners.discard(queue)

    def watch(self) -> None:
        """Start watching the folder if there are listeners."""
        if self.listeners and (self._watch is None or self._watch.done()):
            self._watch = asyncio.create_task(self._watching())

    async def _watching(self) -> None:
        """Watch the folder while there are listeners."""
        places = {
            "files": self._folder.runs,
            "records": self._folder.records,
            "inputs": self._folder.inputs,
            "cards": self._folder.cards,
            "jobs": self._folder.results,
        }
        before = {what: await asyncio.to_thread(_signature, place) for what, place in places.items()}
        while self.listeners:
            await asyncio.sleep(_WATCH_S)
            for what, place in places.items():
                now = await asyncio.to_thread(_signature, place)
                if now != before[what]:
                    before[what] = now
                    self.publish(what)


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
