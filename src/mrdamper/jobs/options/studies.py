"""What jobs that make runs or run other jobs can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from mrdamper.jobs.options.reading import DRAW, TOP, Seed
from mrdamper.schema import OnPage, Option


@dataclass(frozen=True, slots=True, kw_only=True)
class RigOptions:
    """Options of ``rig``."""

    draw: Annotated[int | None, DRAW] = None
    seed: Seed = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoOptions:
    """Options of ``demo``."""

    quick: Annotated[
        bool,
        Option("Fewer and shorter runs.", label="fewer and shorter runs", page=OnPage(group="", begins=True)),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    samples: Annotated[
        int | None,
        Option(
            "Number of random dampers that the card's controller is tried on.",
            metavar="NUMBER",
            least=1,
            most=100_000,
            page=TOP,
            default_help="no random dampers",
            label="Random dampers to track",
        ),
    ] = None
    spread_percent: Annotated[
        float,
        Option(
            "Largest deviation of a random damper's parameters from the nominal ones.",
            flag="-",
            unit="%",
            least=0.0,
            most=30.0,
            page=TOP,
            label="Spread of random dampers",
        ),
    ] = 10.0
    seed: Annotated[
        int, Option("Seed of the random number generator.", flag="-", least=0, most=10_000_000)
    ] = 0
    workers: Annotated[
        int | None,
        Option(
            "Number of processes of this machine.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=TOP,
            default_help="one for each core",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            "Address of a Dask scheduler; its workers run the tasks.", metavar="tcp://HOST:PORT", local=True
        ),
    ] = None
