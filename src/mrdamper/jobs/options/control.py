"""Options of the jobs on control: tracking, simulating, exporting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import (
    TOP,
    Controller,
    Jobs,
    Posterior,
)
from mrdamper.schema import OnPage, Option


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackConditions:
    """At what a loop is tracked."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Temperature of the damper (may be repeated).",
            flag="--temperature",
            metavar="DEGC",
            unit="degC",
            label="Temperatures of the damper",
            page=OnPage(group="Temperatures", begins=(20.0, 60.0)),
            default_help="20, 60, 100, 123",
            most_items=20,
        ),
    ] = ()
    rate_Hz: Annotated[
        float,
        Option("Sampling of the controllers.", flag="-", unit="Hz", least=100.0, most=5000.0),
    ] = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions(TrackConditions):
    """Options of ``track``."""

    controllers: Annotated[
        tuple[str, ...],
        Option(
            "recommended, paper, ... (may be repeated).",
            flag="--controller",
            metavar="NAME",
            default_help="all",
            most_items=40,
            label="Controllers",
            page=OnPage(group="Controllers", offers="controllers", begins=("recommended", "paper")),
        ),
    ] = ()
    seed: Annotated[
        int,
        Option("Seed of the sensor noise; the next seed is run as well.", flag="-", least=0, below=2**31),
    ] = 1
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Options of ``simulate``."""

    temperature_degC: Annotated[
        float,
        Option("Of the fluid, where the motion does not tell it.", unit="degC", least=-60.0, most=200.0),
    ] = 20.0
    rate_Hz: Annotated[
        float, Option("Samples per second of a motion in words.", unit="Hz", above=0.0, most=1e5)
    ] = 1000.0
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(
            "C99 source, an FMU, a force map (CSV), a folder for MATLAB.",
            flag="-",
            least_items=1,
            label="Make",
            page=OnPage(
                group="Make",
                titles=(
                    "C99 source, as an archive",
                    "FMU for co-simulation",
                    "force map (CSV) for simulators",
                    "card and force map for MATLAB",
                ),
                begins=("c", "fmu"),
            ),
        ),
    ] = ("c", "fmu", "table")
    content: Annotated[
        Literal["model", "controller", "both"],
        Option(
            "The damper's model, its force controller, or both.",
            label="Holds",
            page=OnPage(group="", titles=("the model", "the controller", "model and controller")),
        ),
    ] = "both"
    precision: Annotated[
        Literal["float", "double"],
        Option(
            "The target's number type.",
            label="Numbers",
            page=OnPage(group="", titles=("float (32 bit)", "double (64 bit)")),
        ),
    ] = "float"
    period_s: Annotated[
        float,
        Option("Period.", unit="s", above=0.0, most=1.0, flag="--step", metavar="TIME", page=TOP),
    ] = 1e-3
    controller: Controller = "recommended"
    name: Annotated[
        str,
        Option("Prefix of every name in the code.", metavar="IDENT", label="Prefix of names", page=TOP),
    ] = "damper"
