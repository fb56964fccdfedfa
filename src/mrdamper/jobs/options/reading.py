"""Options for reading runs and cards, and options that several jobs share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from mrdamper.schema import OnPage, Option

TOP = OnPage(group="")

DRAW = Option(
    "Randomise the parameters of the damper within 30 % with this seed. Models are developed with even "
    "seeds, and results are reported with odd seeds.",
    metavar="SEED",
    least=0,
    below=2**31,
    default_help="not randomised",
    label="Seed of a randomised damper",
)
"""Seed of a randomised virtual damper."""

Seed = Annotated[int, Option("Use this seed of the random number generator.", least=0, below=2**31)]

Jobs = Annotated[
    int | None,
    Option(
        "Use this number of parallel processes. The result does not depend on it.",
        least=1,
        most=1024,
        metavar="NUMBER",
        default_help="all cores",
        local=True,
    ),
]
"""Number of processes of a job that uses ``runtime.pool``."""


Posterior = Annotated[
    int,
    Option(
        "Compute 90 % intervals with this number of posterior samples from the folder of the card.",
        least=0,
        most=100_000,
        metavar="NUMBER",
        label="Posterior samples",
    ),
]
"""Number of posterior samples in a simulation with a card (``models.card_draws``)."""


Controller = Annotated[
    str,
    Option(
        "Use this controller: recommended, recommended-causal, paper, ...",
        metavar="NAME",
        label="Controller",
        page=OnPage(group="", offers="controllers"),
    ),
]


def coil_resistance(text: str = "Use this coil resistance at 20 degC, in ohm.") -> Option:
    """Return the option of the coil resistance, 0 to 1000 ohm."""
    return Option(text, unit="ohm", flag="--coil-resistance", metavar="OHM", least=0.0, most=1e3)


Channels = Annotated[
    Path | None,
    Option(
        "Read columns with this channel map (TOML), which assigns them to quantities.",
        metavar="FILE",
        default_help="the map in the folder of the runs, or the headers",
        label="Channel map",
        page=OnPage(
            group="", places=("inputs", "maps"), files=".toml", looks=("channels",), word="channel map"
        ),
    ),
]


Answers = Annotated[
    tuple[str, ...],
    Option(
        "Answer a question that a file leaves open, for example force.unit=kN. Topics: unit, column, scale, "
        "value, rate, part. A pattern of names and a colon before it select files. Repeatable.",
        metavar="ROLE.TOPIC=VALUE",
        label="Answers to open questions",
        most_items=100,
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MapReading:
    """Options for reading one record."""

    channels: Channels = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FilesReading(MapReading):
    """Options for reading files of runs without conversion."""

    answer: Answers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunsReading(FilesReading):
    """Options for reading runs."""

    flip_force: Annotated[
        bool,
        Option(
            "Reverse the sign of the force, for load cells with positive compression.",
            label="reverse the sign of the force",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LawReading:
    """Options for reading a card that can have a hysteresis model of the user."""

    law: Annotated[
        str | None,
        Option(
            "Load this class, if the card was fitted with a hysteresis model of your own.",
            metavar="FILE.py:CLASS",
            local=True,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions:
    """Options of a job that has only options for reading."""
