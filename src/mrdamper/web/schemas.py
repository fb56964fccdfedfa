"""What may be asked of a job: its options by name, with their kinds, bounds and defaults.

Options name things in the folder (a card, a run's file, an input), never paths, and nothing that would be
run: a law in a Python file is for the command line alone.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from mrdamper.errors import InputError
from mrdamper.jobs.previews.choices import DUTY

__all__ = ["KINDS", "HeatCurve", "Mapping", "Order", "read_order", "told"]

Name = Annotated[str, Field(min_length=1, max_length=160, pattern=r"^[^/\\\x00-\x1f]+$")]
Word = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
Glob = Annotated[str, Field(min_length=1, max_length=200)]
DutyText = Annotated[str, Field(min_length=1, max_length=200)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]
Positive = Annotated[float, Field(gt=0.0, lt=1e6)]
Degrees = Annotated[float, Field(ge=-100.0, le=400.0)]
Files = Annotated[list[Name], Field(max_length=20_000)] | None


class Order(BaseModel):
    """Options of one kind of job."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)

    needs_runs: ClassVar[bool] = False


class Identify(Order):
    needs_runs = True
    card: Name
    files: Files = None
    law: Word | None = None
    method: Literal["varpro", "genetic", "cma"] = "varpro"
    starts: Annotated[int, Field(ge=1, le=100)] = 3
    seed: Seed = 0
    hold_out: Annotated[list[Glob], Field(max_length=20_000)] = []
    leave_out: list[Literal["run", "current", "motion", "temperature"]] = []
    session_offsets: bool = False
    one_command: bool = False
    terms: list[Literal["friction", "mass", "viscosity", "thinning"]] | None = None
    temperature: Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"] = "auto"
    fluid: Name | None = None
    coil_resistance_ohm: Positive | None = None
    profiled: bool = False
    draws: Annotated[int, Field(ge=0, le=10_000)] = 0
    flip_force: bool = False
    replace: bool = False


class Predict(Order):
    needs_runs = True
    card: Name
    files: Files = None
    flip_force: bool = False


class Check(Order):
    files: Files = None


class Compare(Order):
    first: Name
    second: Name


class Heat(Order):
    card: Name
    damper: Name = "paper"
    duty: DutyText = DUTY
    sink: Name | None = None
    with_sink: bool = True
    ambient_degC: Degrees | None = None
    air_m_s: Annotated[float, Field(ge=0.0, le=200.0)] | None = None
    past_limit: bool = False
    model: Literal["zones", "lumped", "reduced"] = "zones"
    start_degC: Degrees | None = None
    calibrate: Name | None = None
    by_field: bool = True


class Sink(Order):
    card: Name
    damper: Name = "paper"
    duty: DutyText = DUTY
    span_mm: Positive | None = None
    width_mm: Positive | None = None
    mass_g: Positive | None = None
    least_thickness_mm: Positive = 1.0
    least_gap_mm: Positive = 3.0
    materials: list[Word] = []
    emissivities: list[Annotated[float, Field(ge=0.0, le=1.0)]] = []
    correlation: Literal["channel", "vdi", "disc"] | None = None
    film_multiplier: Positive | None = None
    method: Literal["grid", "nsga2"] = "grid"
    members: Annotated[int, Field(ge=2, le=200)] = 12
    by_field: bool = True
    seed: Seed = 0


class Track(Order):
    card: Name
    plant: Name = "nominal"
    targets: Annotated[list[Name], Field(max_length=20)] = []
    temperatures_degC: Annotated[list[Degrees], Field(max_length=20)] = []
    controllers: Annotated[list[Word], Field(max_length=40)] = []
    seed: Seed = 1
    rate_Hz: Annotated[float, Field(ge=100.0, le=5000.0)] = 1000.0
    unaware: Name | None = None
    pooled: Name | None = None
    optimum: bool = False


class Export(Order):
    card: Name
    what: Annotated[list[Literal["c", "fmu", "table"]], Field(min_length=1)] = ["c", "fmu", "table"]
    fmi: Literal["2.0", "3.0"] = "3.0"
    precision: Literal["float", "double"] = "float"
    period_s: Annotated[float, Field(gt=0.0, le=1.0)] = 1e-3
    content: Literal["model", "controller", "both"] = "both"
    controller: Word = "recommended"
    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,40}$")] = "damper"
    damper: Name | None = None
    verify: bool = True


class Rig(Order):
    preset: Word = "nominal"
    damper: Name | None = None
    campaign: Name = "short"
    seed: Seed = 0


class Fluid(Order):
    tables: Annotated[list[Name], Field(min_length=1, max_length=20)]
    like: Name = "paper"
    particle_fraction: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None


class Demo(Order):
    quick: bool = True
    seed: Seed = 0


class Cycles(Order):
    record: Name
    channels: Name | None = None
    least_stroke_mm: Positive | None = None
    model: Name | None = None
    flip_force: bool = False


class Sweep(Order):
    plan: Name
    workers: Annotated[int, Field(ge=1, le=64)] | None = None


class Fetch(Order):
    name: Word


KINDS: dict[str, type[Order]] = {
    "identify": Identify,
    "predict": Predict,
    "check": Check,
    "compare": Compare,
    "heat": Heat,
    "sink": Sink,
    "track": Track,
    "export": Export,
    "rig": Rig,
    "fluid": Fluid,
    "demo": Demo,
    "cycles": Cycles,
    "sweep": Sweep,
    "fetch": Fetch,
}


class Fins(Order):
    """A heat sink of a search, to be heated."""

    fins: Annotated[int, Field(ge=1, le=500)]
    width_mm: Positive
    thickness_mm: Positive
    pitch_mm: Positive
    material: Name
    emissivity: Annotated[float, Field(ge=0.0, le=1.0)]


class HeatCurve(Order):
    """A quick heating curve."""

    card: Name
    damper: Name = "paper"
    amplitude_mm: Annotated[float, Field(ge=0.0, le=1000.0)] = 15.0
    frequency_Hz: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    command: Annotated[float, Field(ge=-1000.0, le=1000.0)] = 2.0
    duty_share: Annotated[float, Field(ge=0.05, le=1.0)] = 1.0
    duration_s: Annotated[float, Field(ge=1.0, le=1e6)] = 1800.0
    ambient_degC: Degrees | None = None
    air_m_s: Annotated[float, Field(ge=0.0, le=200.0)] | None = None
    with_sink: bool = True
    fins: Fins | None = None
    past_limit: bool = False


class Mapping(Order):
    """A channel map for some files."""

    files: Annotated[list[Name], Field(min_length=1, max_length=500)]
    map: dict[str, Any] | None = None
    save: bool = False
    head: bool = False  # look at the beginning alone, where that tells something

    @model_validator(mode="after")
    def _shallow(self) -> Mapping:
        def depth(value: object) -> int:
            inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
            return 1 + max(map(depth, inner), default=0)

        if self.map is not None and depth(self.map) > 5:
            raise ValueError("map is nested too deep; expected the tables of a channel map")
        return self


def read_order(kind: object, options: object) -> Order:
    """Return the options of a job, or one ``InputError`` with all that is wrong with them."""
    if not isinstance(kind, str) or kind not in KINDS:
        raise InputError(f"kind is {str(kind)[:40]!r}; expected one of: {', '.join(KINDS)}")
    if not isinstance(options, dict):
        raise InputError(f"{kind}: options are {type(options).__name__}; expected an object")
    try:
        return KINDS[kind].model_validate(options)
    except ValidationError as fault:
        raise InputError(told(kind, fault)) from fault


def told(place: str, fault: ValidationError) -> str:
    """Return what is wrong, one line for each option."""
    lines = []
    for each in fault.errors(include_url=False, include_context=False)[:8]:
        where = ".".join(str(part)[:60] for part in each["loc"]) or "the whole"
        found = "" if each["type"] == "missing" else f" is {str(each['input'])[:60]!r}"
        lines.append(f"{place}: {where}{found}: {each['msg']}")
    return "\n".join(lines)
