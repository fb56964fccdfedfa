"""What jobs on measured runs can be told: looking at them, fitting, counting cycles, fluids."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import TOP, Jobs, Posterior, Seed, coil_resistance
from mrdamper.schema import OnPage, Option


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Options of ``check``."""

    deep: Annotated[
        bool,
        Option(
            "Fit one law to all runs, and tell which of them do not belong to the others, and why.",
            label="test all runs together",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """Options of ``evaluate``."""

    posterior: Posterior = 0
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options of ``fit``."""

    method: Annotated[
        Literal["varpro", "genetic"],
        Option(
            "How to search.",
            label="Search",
            page=OnPage(titles=("variable projection", "genetic")),
        ),
    ] = "varpro"
    only: Annotated[
        tuple[str, ...],
        Option(
            "Runs to use; all others are left aside (by name; may be repeated).",
            metavar="GLOB",
            label="Use these runs alone",
            default_help="all",
            most_items=20_000,
            page=OnPage(offers="runs"),
        ),
    ] = ()
    hold_out: Annotated[
        tuple[str, ...],
        Option(
            "Runs that the fit must not see (by name; may be repeated).",
            metavar="GLOB",
            label="Hold out",
            most_items=20_000,
            page=OnPage(group="Hold out", offers="runs"),
        ),
    ] = ()
    seed: Seed = 0
    starts: Annotated[int, Option("Starts of the search (varpro); each draws many points.", least=1)] = 3
    leave_out: Annotated[
        tuple[Literal["run", "current", "motion", "temperature"], ...],
        Option(
            "Fit again without each run, current, motion or temperature in turn.",
            label="Fit again without each",
        ),
    ] = ()
    draws: Annotated[
        int,
        Option(
            "Fit again to runs drawn with replacement, so many times.",
            least=0,
            flag="--bootstrap",
            metavar="DRAWS",
            label="Bootstrap draws",
        ),
    ] = 0
    posterior: Annotated[
        int,
        Option(
            "Number of posterior samples, for 90 % intervals of parameters and predictions.",
            least=0,
            most=100_000,
            metavar="DRAWS",
            label="Posterior draws",
        ),
    ] = 0
    one_command: Annotated[
        bool,
        Option(
            "Accept runs at a single command; the model holds for it alone.",
            label="accept runs at one current only",
        ),
    ] = False
    terms: Annotated[
        tuple[
            Literal[
                "friction",
                "mass",
                "viscosity",
                "thinning",
                "gas",
                "orifice",
                "bristles",
                "spread",
                "stribeck",
                "memory",
                "position",
                "curvature",
                "stiffness",
                "asymmetry",
                "flow-asymmetry",
                "gas-volume",
                "leak",
                "play",
                "follow",
                "none",
            ],
            ...,
        ]
        | None,
        Option(
            "Add a term to the law (may be repeated). Every law takes friction, mass, viscosity, "
            "thinning and gas; the others are of the law chain.",
            flag="--term",
            default_help="friction, thinning for tempered runs",
            label="Parallel terms",
        ),
    ] = None
    temperature: Annotated[
        Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"],
        Option(
            "How coefficients follow temperature (auto: arrhenius where the runs have one; "
            "none: not at all).",
            label="Temperature",
            page=TOP,
        ),
    ] = "auto"
    coil_resistance_ohm: Annotated[
        float | None,
        replace(
            coil_resistance("Of the coil at 20 degC, for the card."),
            least=None,
            above=0.0,
            label="Coil resistance at 20 °C",
            default_help="not known",
        ),
    ] = None
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesOptions:
    """Options of ``cycles``."""

    least_stroke_mm: Annotated[
        float | None,
        Option(
            "A smaller to-and-fro is no cycle.",
            unit="mm",
            above=0.0,
            below=1e6,
            metavar="MM",
            page=TOP,
            default_help="5 % of the range of the first rows",
        ),
    ] = None
    batch_rows: Annotated[
        int | None,
        Option("Rows of a batch; what is found does not depend on it.", least=1, flag="-", local=True),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FluidOptions:
    """Options of ``fluid``."""

    particle_fraction: Annotated[
        float | None,
        Option(
            "Volume share of iron, which leads from mT to kA/m.",
            metavar="SHARE",
            label="Volume share of iron",
            above=0.0,
            below=1.0,
            default_help="that of the fluid it is like",
            page=TOP,
        ),
    ] = None
