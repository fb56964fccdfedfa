"""Checkpoints of a long search: finished pieces of its work, by name.

A search asks its checkpoint for each piece of work before doing it and keeps the piece afterwards; a search
that was killed goes on from there, to the same bits as one that was not. This is the protocol; the file that
outlives a kill is ``runtime``'s.

Pieces are plain data (numbers, texts, lists and mappings of them) that come back exactly as they were given:
a float keeps all its digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from typing import Any, Protocol

from mrdamper.runtime.pool import Item, Pool


class CheckpointStore(Protocol):
    """Finished pieces of work by key; keys are unique within a run."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the piece kept under ``key``, or None when it is still to be done."""

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        """Keep a finished piece; it outlives the process when this returns."""


class NoCheckpoint:
    """Keeps nothing: every piece of work is done."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return None

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        return None


class Scope:
    """A part of a checkpoint under a name: ``start-0`` of a fit without run a is not that of the whole."""

    def __init__(self, checkpoint: CheckpointStore | None, name: str) -> None:
        self._checkpoint = NoCheckpoint() if checkpoint is None else checkpoint
        self._name = name

    def recall(self, key: str) -> Mapping[str, Any] | None:
        return self._checkpoint.recall(f"{self._name}/{key}")

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        self._checkpoint.keep(f"{self._name}/{key}", value)


class Pieces:
    """Keeps pieces until they are kept in a checkpoint, from which it recalls: for another process."""

    def __init__(self, checkpoint: CheckpointStore) -> None:
        self._checkpoint: CheckpointStore | None = checkpoint
        self._kept: dict[str, Mapping[str, Any]] = {}

    def __getstate__(self) -> tuple[None, dict[str, Any]]:
        """Return the pieces alone: the checkpoint is not sent from process to process."""
        return None, {"_checkpoint": None, "_kept": self._kept}

    def recall(self, key: str) -> Mapping[str, Any] | None:
        if key in self._kept or self._checkpoint is None:
            return self._kept.get(key)
        return self._checkpoint.recall(key)

    def keep(self, key: str, value: Mapping[str, Any]) -> None:
        self._kept[key] = value

    def keep_in(self, checkpoint: CheckpointStore) -> None:
        """Keep the pieces, in the order in which they were done."""
        for key, value in self._kept.items():
            checkpoint.keep(key, value)


def kept_pieces(
    work: Callable[[Item], Mapping[str, Any]],
    items: Mapping[str, Item],
    checkpoint: CheckpointStore,
    pool: Pool,
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield key and piece of each item, in their order: as it was kept, or done by the pool and kept now."""
    kept = {key: piece for key in items if (piece := checkpoint.recall(key)) is not None}
    with closing(pool.map(work, [item for key, item in items.items() if key not in kept])) as fresh:
        for key in items:
            if key not in kept:
                kept[key] = next(fresh)
                checkpoint.keep(key, kept[key])
            yield key, kept[key]
