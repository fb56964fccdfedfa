"""Options of the jobs ``rig``, ``demo`` and ``sweep``."""

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
        Option(
            "Use fewer and shorter runs.", label="fewer and shorter runs", page=OnPage(group="", begins=True)
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepOptions:
    """Options of ``sweep``."""

    samples: Annotated[
        int | None,
        Option(
            "Test the controllers of the card on this number of random dampers.",
            metavar="NUMBER",
            least=1,
            most=100_000,
            page=TOP,
            default_help="no random dampers",
            label="Random dampers",
        ),
    ] = None
    spread_percent: Annotated[
        float,
        Option(
            "Limit the deviation of random parameters from the nominal ones, in percent.",
            flag="-",
            unit="%",
            least=0.0,
            most=30.0,
            page=TOP,
            label="Spread of random dampers",
        ),
    ] = 10.0
    seed: Annotated[
        int, Option("Use this seed of the random number generator.", flag="-", least=0, most=10_000_000)
    ] = 0
    workers: Annotated[
        int | None,
        Option(
            "Use this number of processes on this computer.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=TOP,
            default_help="all cores",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            "Run the tasks on the workers of the Dask scheduler at this address.",
            metavar="tcp://HOST:PORT",
            local=True,
        ),
    ] = None
