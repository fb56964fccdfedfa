"""What jobs on control can be told: riding, tracking, exporting."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import (
    DRAW,
    TOP,
    Controller,
    Jobs,
    Posterior,
    Supply,
    coil_resistance,
    duration,
    surroundings,
)
from mrdamper.schema import OnPage, Option


def _sensor(text: str, unit: str, flag: str, *, above: float | None = None, most: float = 10.0) -> Option:
    """Return an option for what a vehicle's sensor adds to what it measures."""
    least = 0.0 if above is None else None
    return Option(text, unit=unit, flag=flag, least=least, above=above, most=most)


DemandName = Literal["skyhook", "groundhook", "hybrid", "acceleration-driven", "linear-quadratic"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CarOptions:
    """The car that asks its damper for a force, and its sensors."""

    damping_N_s_m: Annotated[
        float,
        Option(
            "Of every demand but the regulator's.",
            unit="N s/m",
            above=0.0,
            most=1e6,
            flag="--damping",
        ),
    ] = 2500.0
    body_kg: Annotated[float, Option("Of the body above the wheel.", unit="kg", above=0.0, most=1e5)] = 320.0
    wheel_kg: Annotated[float, Option("Of the wheel.", unit="kg", above=0.0, most=1e4)] = 40.0
    spring_N_m: Annotated[float, Option("Stiffness of the spring.", unit="N/m", above=0.0, most=1e7)] = 20e3
    tyre_N_m: Annotated[float, Option("Stiffness of the tyre.", unit="N/m", above=0.0, most=1e8)] = 200e3
    mount_N_m: Annotated[
        float | None,
        Option(
            "Stiffness of the top mount between rod and body.",
            unit="N/m",
            above=0.0,
            most=1e9,
            default_help="rigid",
        ),
    ] = None
    wheel_accelerometer: Annotated[bool, Option("The observer reads an accelerometer at the wheel, too.")] = (
        False
    )
    body_noise_m_s2: Annotated[
        float, _sensor("Noise of the body's accelerometer, rms.", "m/s2", "--body-noise", above=0.0)
    ] = 0.05
    body_bias_m_s2: Annotated[float, _sensor("Bias of the body's accelerometer.", "m/s2", "--body-bias")] = (
        0.2
    )
    wheel_noise_m_s2: Annotated[
        float, _sensor("Noise of the wheel's accelerometer, rms.", "m/s2", "--wheel-noise", above=0.0)
    ] = 0.5
    wheel_bias_m_s2: Annotated[
        float, _sensor("Bias of the wheel's accelerometer.", "m/s2", "--wheel-bias")
    ] = 0.5
    stroke_noise_m: Annotated[
        float,
        _sensor("Noise of the damper's stroke sensor, rms.", "m", "--stroke-noise", above=0.0, most=0.05),
    ] = 10e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class RideOptions(CarOptions):
    """Options of ``ride``."""

    mount_damping_N_s_m: Annotated[
        float,
        Option("Damping of the top mount.", unit="N s/m", least=0.0, most=1e6, flag="--mount-damping"),
    ] = 0.0
    stroke_bias_m: Annotated[
        float, _sensor("Bias of the damper's stroke sensor.", "m", "--stroke-bias", most=0.05)
    ] = 0.0
    controller: Controller = "recommended"
    demand: Annotated[DemandName, Option("The force that is asked of the damper.")] = "linear-quadratic"
    states: Annotated[
        Literal["true", "estimated"],
        Option("The demand has the car's true states, or an observer's, from accelerometers and stroke."),
    ] = "true"
    road_class: Annotated[
        Literal["A", "B", "C", "D", "E", "F", "G", "H", "bump", "pothole", "step"],
        Option("Class of ISO 8608, A (smooth) to H, or one obstacle on a flat road.", flag="--road"),
    ] = "C"
    obstacle_height_m: Annotated[
        float, Option("Height of bump and step, depth of a pothole.", unit="m", above=0.0, most=1.0)
    ] = 0.06
    obstacle_length_m: Annotated[
        float, Option("Of the obstacle along the road.", unit="m", above=0.0, most=100.0)
    ] = 2.0
    speed_m_s: Annotated[float, Option("Of the car.", unit="m/s", above=0.0, most=100.0)] = 20.0
    duration_s: Annotated[
        float,
        duration("Of the ride that is scored; its first 2 s are not.", "--duration", above=2.0, most=600.0),
    ] = 20.0
    warm_up_s: Annotated[
        float,
        duration(
            "Drive on for so long while the damper warms; 0: not at all.",
            "--warm-up",
            least=0.0,
            most=14400.0,
        ),
    ] = 1800.0
    temperature_degC: Annotated[
        float, Option("Of the damper during the scored ride.", unit="degC", least=-50.0, most=200.0)
    ] = 20.0
    ambient_degC: Annotated[float, surroundings("Air around the damper, where its warming begins.")] = 20.0
    housing_J_K: Annotated[
        float, Option("Heat capacity of the damper without its fluid.", unit="J/K", above=0.0, most=1e6)
    ] = 950.0
    cooling_W_K: Annotated[
        float, Option("Heat that the housing gives to the air, per kelvin.", unit="W/K", least=0.0, most=1e3)
    ] = 2.0
    coil_resistance_ohm: Annotated[float, coil_resistance()] = 5.0
    stroke_m: Annotated[float, Option("From rest to either end stop.", unit="m", above=0.0, most=1.0)] = 0.08
    stop_N_m: Annotated[float, Option("Stiffness of the end stops.", unit="N/m", above=0.0, most=1e7)] = 300e3
    seed: Annotated[int, Option("Of road and sensors.", least=0, below=2**31)] = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackConditions:
    """At what a loop is tracked."""

    temperatures_degC: Annotated[
        tuple[float, ...],
        Option(
            "Of fluid and coil (may be repeated).",
            flag="--temperature",
            metavar="DEGC",
            unit="degC",
            label="Temperatures of fluid and coil",
            page=OnPage(group="Temperatures", begins=(20.0, 60.0)),
            default_help="20, 60, 100, 123",
            most_items=20,
        ),
    ] = ()
    rate_Hz: Annotated[
        float,
        Option(
            "Sampling.", flag="--rate", metavar="HZ", unit="Hz", label="Sampling", least=100.0, most=5000.0
        ),
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
    draw: Annotated[int | None, DRAW] = None
    seed: Annotated[
        int, Option("Of the sensors' noise; the next one is run as well.", least=0, below=2**31)
    ] = 1
    supply_V: Supply = None
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
class ExportOptions(CarOptions):
    """Options of ``export``; the car's are those of the step that ``demand`` adds."""

    demand: Annotated[
        DemandName | None,
        Option(
            "Add a step from a vehicle's readings to the command: an observer, this demand, the controller.",
            default_help="no such step",
        ),
    ] = None
    what: Annotated[
        tuple[Literal["c", "fmu", "table", "matlab", "report"], ...],
        Option(
            "C99 source, an FMU, a force map (CSV), a folder for MATLAB, a report (HTML).",
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
                    "report on the proof",
                ),
                begins=("c", "fmu", "report"),
            ),
        ),
    ] = ("c", "fmu", "table")
    fmi: Annotated[
        Literal["2.0", "3.0"],
        Option("Version of the FMU.", label="FMU", page=OnPage(group="", titles=("FMI 2.0", "FMI 3.0"))),
    ] = "3.0"
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
    supply_V: Supply = None
    name: Annotated[
        str,
        Option("Prefix of every name in the code.", metavar="IDENT", label="Prefix of names", page=TOP),
    ] = "damper"
    verify: Annotated[
        bool, Option("Write the C folder without compiling and comparing it.", flag="--no-verify", local=True)
    ] = True
