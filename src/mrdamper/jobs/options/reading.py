"""Options of reading runs and cards, and types that several jobs share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from mrdamper.schema import OnPage, Option

__all__ = ["TOP", "Answers", "Channels", "FilesReading", "LawReading", "NoOptions", "RunsReading", "Seed"]

Seed = Annotated[int, Option("Of every random draw.", least=0, below=2**31)]


Channels = Annotated[
    Path | None,
    Option(
        "Channel map (TOML) for headers that do not speak.",
        metavar="FILE",
        default_help="the one beside it, else its headers",
        label="Channel map",
        page=OnPage(
            group="", places=("inputs", "maps"), files=".toml", looks=("channels",), word="channel map"
        ),
    ),
]


Answers = Annotated[
    tuple[str, ...],
    Option(
        "What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate. For some "
        "files a pattern of their names and a colon before it.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to what files leave open",
        most_items=100,
    ),
]


TOP = OnPage(group="")


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading:
    """Options of reading files of runs as they are."""

    channels: Channels = None
    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading:
    """Options of reading runs, or one long record."""

    channels: Channels = None
    answer: Answers = ()
    flip_force: Annotated[
        bool,
        Option(
            "Turn the sign of the force (compression-positive load cells).",
            label="turn the sign of the force",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LawReading:
    """Options of reading a card that may be of a user's own law."""

    law: Annotated[
        str | None,
        Option(
            "The user's own law, for a card that was identified with one.",
            metavar="FILE.py:CLASS",
            local=True,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """Of a job that has none but those of reading."""
