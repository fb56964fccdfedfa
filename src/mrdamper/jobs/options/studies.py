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

    workers: Annotated[
        int | None,
        Option(
            "Processes of this machine.",
            metavar="NUMBER",
            least=1,
            most=1024,
            page=TOP,
            default_help="its cores",
            label="Processes",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option("A Dask scheduler, whose workers do the tasks.", metavar="tcp://HOST:PORT", local=True),
    ] = None
