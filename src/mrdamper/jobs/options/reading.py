"""Options of reading runs and cards, and types that several jobs share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from mrdamper.schema import OnPage, Option

TOP = OnPage(group="")

DRAW = Option(
    "Another damper of the kind, its parameters drawn within 30 % (even seeds: to build laws; odd "
    "ones: to report).",
    metavar="SEED",
    least=0,
    below=2**31,
    default_help="the damper itself",
    label="Draw of another damper",
)
"""Of a virtual damper."""

Seed = Annotated[int, Option("Of every random draw.", least=0, below=2**31)]

Jobs = Annotated[
    int | None,
    Option(
        "Cores at work at a time; the result does not depend on it.",
        least=1,
        most=1024,
        metavar="NUMBER",
        default_help="all",
        local=True,
    ),
]
"""Of a job that gives its work to a pool (``runtime.pool``)."""


Posterior = Annotated[
    int,
    Option(
        "Follow so many of the posterior draws beside the card, for 90 % intervals; 0: none.",
        least=0,
        most=100_000,
        metavar="DRAWS",
        label="Posterior draws to follow",
    ),
]
"""Of a job that predicts from a card (``models.card_draws``)."""


Controller = Annotated[
    str,
    Option(
        "recommended, recommended-causal, paper, ...",
        metavar="NAME",
        label="Controller",
        page=OnPage(group="", offers="controllers"),
    ),
]


def coil_resistance(text: str = "Of the coil at 20 degC.") -> Option:
    """Return the option of the coil's resistance, up to a thousand ohm."""
    return Option(text, unit="ohm", flag="--coil-resistance", metavar="OHM", least=0.0, most=1e3)


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
        "What a file leaves open, such as force.unit=kN; topics: unit, column, scale, value, rate, part. "
        "For some files a pattern of their names and a colon before it.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to what files leave open",
        most_items=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapReading:
    """Options of reading one record."""

    channels: Channels = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading(MapReading):
    """Options of reading files of runs as they are."""

    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading(FilesReading):
    """Options of reading runs."""

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
