"""Plan the tasks of a sweep: fit campaigns, test controllers on random dampers, or search heat sinks.

Each task has its own seed, so that its result does not depend on the worker or on the order of execution.
"""

from __future__ import annotations

import glob
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mrdamper.errors import UsageError
from mrdamper.jobs.options import SweepOptions
from mrdamper.models.card import ModelCard
from mrdamper.models.card_schema import card_to_json
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import Duty

SweepKind = Literal["campaigns", "samples", "dampers"]


@dataclass(frozen=True, slots=True)
class Task:
    """One task of a sweep. The function of its ``kind`` is called with ``arguments``."""

    name: str
    kind: SweepKind
    seed: int
    arguments: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Plan:
    """Tasks of a sweep. ``fingerprint`` is a hash of all inputs that affect results."""

    kind: SweepKind
    seed: int
    tasks: tuple[Task, ...]
    fingerprint: str

    @property
    def head(self) -> dict[str, Any]:
        """Return the first line of the results file, which identifies the sweep."""
        return {
            "kind": self.kind,
            "seed": self.seed,
            "tasks": len(self.tasks),
            "fingerprint": self.fingerprint,
        }


def make_plan(
    campaigns: Sequence[str | Path] | None,
    card: ModelCard | None,
    dampers: Sequence[DamperDrawing] | None,
    duty: Duty,
    law: str | None,
    options: SweepOptions,
) -> Plan:
    """Return the tasks of a sweep over campaigns, random dampers (``options.samples``) or geometry files.

    Raises
    ------
    UsageError
        If not exactly one of the three kinds is given, or the card is missing.
    """
    kinds: list[SweepKind] = []
    kinds += ["campaigns"] if campaigns else []
    kinds += ["samples"] if options.samples is not None else []
    kinds += ["dampers"] if dampers else []
    if len(kinds) != 1:
        raise UsageError(
            f"{len(kinds)} kinds of sweep are given",
            expected="runs to fit (PATH...), random dampers (--samples), or geometry files (--damper)",
        )
    kind = kinds[0]
    common: dict[str, Any]
    told: dict[str, Any]
    named: list[tuple[str, dict[str, Any]]]
    if kind == "campaigns":
        named = [(name, {"path": path}) for name, path in _unique_names(_campaign_paths(campaigns or ()))]
        common, told = {"law": law}, {"law": law, "paths": [str(each["path"]) for _, each in named]}
    else:
        if card is None:
            raise UsageError("a sweep over dampers needs a card", remedy="Add --card")
        card_json = card_to_json(card)
        told = {"card": card_json}
        if kind == "samples":
            count = options.samples or 0
            named = [(f"sample-{k:0{len(str(count - 1))}d}", {}) for k in range(count)]
            common = {"card": card_json, "spread_percent": options.spread_percent}
            told |= {"spread_percent": options.spread_percent}
        else:
            named = [(each.name, {"drawing": each}) for each in dampers or ()]
            common = {"card": card_json, "duty": duty}
            told |= {"drawings": [repr(each) for each in dampers or ()], "duty": duty.text}
    seeds = np.random.SeedSequence(options.seed).generate_state(len(named))
    tasks = tuple(
        Task(name, kind, int(seed), common | own) for (name, own), seed in zip(named, seeds, strict=True)
    )
    digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()
    return Plan(kind, options.seed, tasks, digest)


def read_drawings(given: Sequence[str | Path | DamperDrawing]) -> list[DamperDrawing]:
    """Read the geometry of each damper from a file, preset name or geometry object."""
    return [each if isinstance(each, DamperDrawing) else read_drawing(each) for each in given]


def _campaign_paths(given: Sequence[str | Path]) -> list[str]:
    """Return the files and folders that match paths and patterns; folders with reference values are omitted.

    Raises
    ------
    UsageError
        If a path or pattern matches nothing.
    """
    paths: list[str] = []
    for each in given:
        found = [str(each)] if Path(each).exists() else sorted(glob.glob(str(each)))  # noqa: PTH207
        if not found:
            raise UsageError("matches no campaign", place=str(each), expected="a path or a pattern of one")
        paths += found
    return [path for path in dict.fromkeys(paths) if not path.endswith(".truth")]


def _unique_names(paths: list[str]) -> Iterator[tuple[str, str]]:
    """Generate (name, path) pairs; equal file names get a parent folder as a prefix."""
    for path in paths:
        parts = Path(path).parts
        for count in range(1, len(parts) + 1):
            name = "-".join(parts[-count:])
            if sum("-".join(Path(other).parts[-count:]) == name for other in paths) == 1:
                break
        yield name.removesuffix(".csv"), path
