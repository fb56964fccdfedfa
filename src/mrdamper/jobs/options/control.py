"""Options of the jobs ``track``, ``simulate`` and ``export``."""

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
    """Temperatures and sample rate of force tracking."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Simulate the damper at this temperature, in degC. Repeatable.",
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
        Option(
            "Run the controllers at this sample rate, in Hz.", flag="-", unit="Hz", least=100.0, most=5000.0
        ),
    ] = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions(TrackConditions):
    """Options of ``track``."""

    controllers: Annotated[
        tuple[str, ...],
        Option(
            "Test this controller: recommended, recommended-causal, paper, ... Repeatable.",
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
        Option("Use this seed and the next one for the sensor noise.", flag="-", least=0, below=2**31),
    ] = 1
    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulateOptions:
    """Options of ``simulate``."""

    temperature_degC: Annotated[
        float,
        Option(
            "Use this fluid temperature, in degC, if the motion has none.",
            unit="degC",
            least=-60.0,
            most=200.0,
        ),
    ] = 20.0
    rate_Hz: Annotated[
        float,
        Option(
            "Sample the motion at this rate, in Hz, if it is given as text.", unit="Hz", above=0.0, most=1e5
        ),
    ] = 1000.0
    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of ``export``."""

    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab"], ...],
        Option(
            "Write C99 source code, an FMU, a force map (CSV), or a folder for MATLAB.",
            flag="-",
            least_items=1,
            label="Files",
            page=OnPage(
                group="Files",
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
            "Export the model of the damper, its force controller, or both.",
            label="Content",
            page=OnPage(group="", titles=("the model", "the controller", "model and controller")),
        ),
    ] = "both"
    precision: Annotated[
        Literal["float", "double"],
        Option(
            "Use this floating-point type in the code.",
            label="Number type",
            page=OnPage(group="", titles=("float (32 bit)", "double (64 bit)")),
        ),
    ] = "float"
    period_s: Annotated[
        float,
        Option(
            "Call the code with this period, such as 1ms or 500us.",
            unit="s",
            above=0.0,
            most=1.0,
            flag="--step",
            metavar="TIME",
            page=TOP,
        ),
    ] = 1e-3
    controller: Controller = "recommended"
    name: Annotated[
        str,
        Option(
            "Put this prefix before all names in the code.",
            metavar="IDENT",
            label="Prefix of names",
            page=TOP,
        ),
    ] = "damper"
