"""Options of the jobs ``check``, ``fit``, ``evaluate`` and ``cycles``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from mrdamper.jobs.options.reading import TOP, Jobs, Posterior
from mrdamper.schema import OnPage, Option


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions:
    """Options of ``check``."""

    deep: Annotated[
        bool,
        Option(
            "Fit one model to all runs, and report runs that are inconsistent with the others.",
            label="compare all runs with one model",
        ),
    ] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """Options of ``evaluate``."""

    posterior: Posterior = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FitOptions:
    """Options of ``fit``."""

    only: Annotated[
        tuple[str, ...],
        Option(
            "Use only runs whose names match this pattern. Repeatable.",
            metavar="GLOB",
            label="Use only these runs",
            default_help="all",
            most_items=20_000,
            page=OnPage(offers="runs"),
        ),
    ] = ()
    hold_out: Annotated[
        tuple[str, ...],
        Option(
            "Exclude runs whose names match this pattern, and use them as a test. Repeatable.",
            metavar="GLOB",
            label="Hold out",
            most_items=20_000,
            page=OnPage(group="Hold out", offers="runs"),
        ),
    ] = ()
    posterior: Annotated[
        int,
        Option(
            "Compute this number of posterior samples, for 90 % intervals of parameters and forces.",
            least=0,
            most=100_000,
            metavar="NUMBER",
            label="Posterior samples",
        ),
    ] = 0
    one_command: Annotated[
        bool,
        Option(
            "Accept runs with a single current. The model is then valid only for this current.",
            label="accept runs with a single current",
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
            "Add a term to the model: friction, mass, viscosity, thinning or gas. The model chain also has "
            "orifice, bristles, spread, stribeck, memory, position, curvature, stiffness, asymmetry, "
            "flow-asymmetry, gas-volume, leak, play and follow. Use none for a model without terms. "
            "Repeatable.",
            flag="--term",
            metavar="NAME",
            default_help="friction, and thinning if the runs have several temperatures",
            label="Terms",
        ),
    ] = None
    temperature: Annotated[
        Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"],
        Option(
            "Use this temperature dependence of the parameters. The choice auto is arrhenius if the runs "
            "have several temperatures.",
            label="Temperature dependence",
            page=TOP,
        ),
    ] = "auto"
    jobs: Jobs = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CyclesOptions:
    """Options of ``cycles``."""

    least_stroke_mm: Annotated[
        float | None,
        Option(
            "Ignore cycles with a smaller stroke, in mm.",
            unit="mm",
            above=0.0,
            below=1e6,
            metavar="MM",
            page=TOP,
            default_help="5 % of the displacement range",
        ),
    ] = None
