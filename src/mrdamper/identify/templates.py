"""Templates: how each law's coefficients depend on command and temperature, and how far a fit may look.

The bounds follow from the runs by stated rules (force, stroke, speed and command of the data), never
from one damper: they are wide on purpose, two to six decades. A coefficient that has no entry stays at
its default.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.temperature import (
    FluidFactors,
    Temperature,
    apply_fluid,
    apply_temperature,
    temperature_levels,
)
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial
from mrdamper.models.laws import HysteresisLaw, find_law

__all__ = ["HELD_BEYOND_K", "Scale", "command_levels", "scale_of", "template"]

HELD_BEYOND_K = 5.0
"""So far beyond the runs' temperatures [K] a damper follows them; further out it holds the edge value."""

Form = Literal["constant", "line", "polynomial", "exponential", "hill"]
_DEGREES = {"line": 1, "polynomial": 2}


@dataclass(frozen=True, slots=True)
class Scale:
    """The size of the data: what the search bounds are measured in."""

    force: float  # 99.5th percentile of |F| over all runs [N]
    stroke: float  # largest |x| [m]
    speed: float  # 99.5th percentile of |v| of the fastest run [m/s]
    acceleration: float  # 99.5th percentile of |a| of the liveliest run [m/s^2]
    command: float  # largest |command| [A or V]
    levels: int  # distinct commands; a command that varies counts as four
    temperatures: tuple[float, ...]  # distinct temperatures [K]; none when not all runs tell


def scale_of(runs: Sequence[PreparedRun]) -> Scale:
    """Return the size of the data."""
    constants = [run.run.constant_command for run in runs]
    varying = any(constant is None for constant in constants)
    return Scale(
        force=max(float(np.quantile(np.abs(run.force), 0.995)) for run in runs),
        stroke=max(float(np.abs(run.trajectory.displacement).max()) for run in runs),
        speed=max(float(np.quantile(np.abs(run.trajectory.velocity), 0.995)) for run in runs),
        acceleration=max(float(np.quantile(np.abs(run.trajectory.acceleration), 0.995)) for run in runs),
        command=max(float(np.abs(run.trajectory.command).max()) for run in runs) or 1.0,
        levels=max(4 if varying else 1, command_levels(runs)),
        temperatures=temperature_levels(runs),
    )


def command_levels(runs: Sequence[PreparedRun]) -> int:
    """Count the distinct constant commands of runs: those further apart than 3 % of the largest."""
    commands = sorted(c for run in runs if (c := run.run.constant_command) is not None)
    apart = 0.03 * max(map(abs, commands), default=0.0)
    return bool(commands) + sum(b - a > apart for a, b in pairwise(commands))


def template(
    law_name: str | HysteresisLaw,
    runs: Sequence[PreparedRun],
    *,
    one_command: bool = False,
    terms: Sequence[str] | None = None,
    temperature: Temperature = "auto",
    fluid: FluidFactors | None = None,
) -> tuple[Damper, tuple[FreeParameter, ...]]:
    """Return a law's damper with its usual dependence on command and temperature, and its free parameters.

    Three or more commands carry the usual forms (quadratic, exponential, Hill with a fixed exponent for
    exactly three); two carry straight lines; one carries constants, and must be asked for. Where a command
    varies over a run, the first-order lag [s] between command and force is free as well.

    ``terms`` adds parallel terms to any law: ``friction`` (Stribeck), ``mass``, ``viscosity``, ``thinning``
    (the viscous force is a power of velocity). None: what a tempered campaign asks for (friction and
    thinning, viscosity beside the series valve), nothing otherwise.

    ``temperature`` says how coefficients follow it (``tempering``); "auto" is "arrhenius" where the runs have
    a temperature, "none" leaves it out. With a ``fluid`` its laws are assumed instead.

    Raises
    ------
    InputError
        All runs at one command and ``one_command`` not set; runs whose commands have two units; runs at too
        few temperatures for the kind asked for.
    """
    law = find_law(law_name) if isinstance(law_name, str) else law_name
    units = {run.run.command_unit for run in runs}
    if len(units) != 1:
        raise InputError(
            f"the runs' commands have units {', '.join(sorted(units)) or 'none'}; one fit needs one unit "
            "(map the channel to current or to voltage in all of them)"
        )
    scale = scale_of(runs)
    if scale.levels < 2 and not one_command:
        follow = ", ".join(name for name, form, *_ in _entries(law, scale) if form != "constant")
        raise InputError(
            found=(
                f"all {len(runs)} training runs have one command ({runs[0].trajectory.command[0]:g} "
                f"{runs[0].run.command_unit}); how {follow or 'the coefficients'} of {law.name} follow the "
                "command cannot be identified from them"
            ),
            remedy=(
                "Add the same tests at two or more other commands, or use ⟦--one-command⟧ for a model of "
                "this command alone"
            ),
        )
    follows_temperature = temperature != "none" and fluid is None and _has_temperature(runs, temperature)
    forms: dict[str, ParameterLaw] = {}
    free: list[FreeParameter] = []
    entries = _entries(law, scale)
    temperature_dependent = all(run.trajectory.temperature is not None for run in runs)  # heeded or not
    campaign = temperature_dependent and fluid is None and temperature != "paper"
    if campaign:
        entries = [_as_campaign(entry) for entry in entries]
    if terms is None:
        terms = _usual_terms(law) if campaign else ()
    for term in terms:
        known = _terms(scale)
        if term not in known:
            raise InputError(f"no term is called {term!r}; there are {', '.join(known)}")
        entries += [entry for entry in known[term] if entry[0] not in {name for name, *_ in entries}]
    for name, form, lower, upper, how in entries:
        dependence, moved = _dependence(law, name, form, lower, upper, how, scale)
        forms[name] = dependence
        free += moved
    if fluid is not None:
        forms = apply_fluid(forms, fluid)
    elif follows_temperature:
        forms, free = apply_temperature(law, forms, free, scale.temperatures, temperature)
    lag = 0.0
    if any(run.run.constant_command is None for run in runs):
        lag = 0.01
        free.append(FreeParameter(LAG, 1e-4, 0.3, "log"))
    beyond = None if fluid is None else fluid.valid_K
    if follows_temperature:
        beyond = (scale.temperatures[0] - HELD_BEYOND_K, scale.temperatures[-1] + HELD_BEYOND_K)
    return Damper(law, forms, units.pop(), lag, temperature_range=beyond), tuple(free)


Entry = tuple[str, Form, float, float, Literal["linear", "log"]]


def _has_temperature(runs: Sequence[PreparedRun], temperature: Temperature) -> bool:
    """Say whether the runs carry temperature; all of them, or none."""
    without = [run.name for run in runs if run.trajectory.temperature is None]
    if without and (len(without) < len(runs) or temperature != "auto"):
        raise InputError(
            found=f"{len(without)} of {len(runs)} runs have no temperature channel (the first: {without[0]})",
            expected="one in every run",
            remedy=(
                "Map the channel, state it as a constant in the channel map, or leave temperature out "
                "(⟦--temperature none⟧)"
            ),
        )
    return not without


_CAMPAIGN: dict[tuple[str, Form], Form] = {
    ("yield_force", "polynomial"): "hill",
    ("second_force", "polynomial"): "hill",
    ("rate_force", "polynomial"): "hill",
    ("viscosity", "polynomial"): "line",
    ("offset", "polynomial"): "line",
    ("stiffness", "polynomial"): "constant",
    ("rho", "constant"): "exponential",
}
"""Forms of a tempered campaign where they differ: the yield force carries the current, the rest little of it.

As the paper's Eq. (12) is reconstructed. A viscosity quadratic in current fits the training runs better and
motions beyond their speeds worse: it makes up for the shape of the loop.
"""


def _as_campaign(entry: Entry) -> Entry:
    name, form, lower, upper, how = entry
    return name, _CAMPAIGN.get((name, form), form), lower, upper, how


def _usual_terms(law: HysteresisLaw) -> tuple[str, ...]:
    if law.kernel is None:
        return ()
    return ("friction", "viscosity", "thinning") if law.name == "series-valve" else ("friction", "thinning")


def _entries(law: HysteresisLaw, s: Scale) -> list[Entry]:
    """Return the coefficients that move: name, form, lower and upper bound of its size, search scale."""
    # As in the paper, c0, k0, alpha and f0 of F = c0 v + k0 x + alpha z + f0 all depend on the current.
    any_force = (-s.force, s.force)
    parallel: list[Entry] = [
        ("viscosity", "polynomial", 0.0, 2.0 * s.force / s.speed, "linear"),
        ("stiffness", "polynomial", 0.0, s.force / s.stroke, "linear"),
        ("offset", "polynomial", *any_force, "linear"),
        ("yield_force", "polynomial", 0.0, 2.0 * s.force, "linear"),
    ]
    hysteresis = _hysteresis(s)
    plain: list[Entry] = [parallel[0], ("stiffness", "constant", 0.0, s.force / s.stroke, "linear")]
    plain += [("offset", "line", *any_force, "linear"), parallel[3]]
    damping = s.force / s.speed
    known: dict[str, list[Entry]] = {
        "bouc-wen": parallel + hysteresis,
        "dahl": parallel + hysteresis[:1],
        "bouc-wen-saturating": [
            *plain,
            ("rate_force", "polynomial", 0.0, 2.0 * s.force, "linear"),
            ("saturation_velocity", "constant", 1e-3 * s.speed, 3.0 * s.speed, "log"),
            ("rho", "exponential", *hysteresis[0][2:4], "log"),
            *hysteresis[1:],
        ],
        "double-bouc-wen": [
            *plain,
            ("second_force", "polynomial", 0.0, 2.0 * s.force, "linear"),
            ("rho", "exponential", 0.5 / s.stroke, 1e4 / s.stroke, "log"),
            ("second_rho", "exponential", 0.5 / s.stroke, 1e4 / s.stroke, "log"),
            *hysteresis[1:],
        ],
        "bingham": [*parallel, ("yield_velocity", "constant", 1e-4 * s.speed, 3.0 * s.speed, "log")],
        "tanh": [
            *parallel,
            ("slope", "constant", 0.1 / s.speed, 1e3 / s.speed, "log"),
            ("shift", "constant", -10.0, 10.0, "linear"),
        ],
        "lugre": [
            *parallel,
            hysteresis[0],
            ("static_excess", "constant", 0.0, 3.0, "linear"),
            ("fade_velocity", "constant", 1e-3 * s.speed, s.speed, "log"),
            ("bristle_damping", "constant", 0.0, 2.0 * damping, "linear"),
        ],
        "spencer": _spencer(s),
        "series-valve": _series_valve(s),
    }
    return known[law.name] if law.name in known else _entries_of_python_law(law, s)


def _hysteresis(s: Scale) -> list[Entry]:
    """Return the coefficients of the hysteresis loop that move."""
    return [
        ("rho", "constant", 0.5 / s.stroke, 1e4 / s.stroke, "log"),
        ("kappa", "constant", -1.0, 0.95, "linear"),
        ("n", "constant", 0.2, 8.0, "log"),
    ]


def _spencer(s: Scale) -> list[Entry]:
    """Return the coefficients of Spencer's chain that move."""
    damping = s.force / s.speed
    return [
        ("yield_force", "hill", 1e-4 * s.force, 2.0 * s.force, "log"),
        ("series_damping", "exponential", 0.1 * damping, 1e3 * damping, "log"),
        ("inner_viscosity", "exponential", 1e-3 * damping, 10.0 * damping, "log"),
        ("inner_stiffness", "constant", 0.0, s.force / s.stroke, "linear"),
        *_hysteresis(s),
        ("offset", "constant", -s.force, s.force, "linear"),
        ("stiffness", "constant", 0.0, s.force / s.stroke, "linear"),
    ]


def _series_valve(s: Scale) -> list[Entry]:
    """Return the coefficients of the series valve that move."""
    damping = s.force / s.speed
    return [
        ("yield_force", "hill", 1e-4 * s.force, 2.0 * s.force, "log"),
        ("thinning", "constant", 1e-3 * s.speed**-0.5, 30.0 * s.speed**-0.5, "log"),
        ("thinning_exponent", "constant", 0.1, 1.2, "linear"),
        ("yield_velocity", "constant", 1e-4 * s.speed, 2.0 * s.speed, "log"),
        ("position_gain", "constant", -0.5 / s.stroke, 0.5 / s.stroke, "linear"),
        ("gap_stiffness", "constant", 3.0 * s.force / s.stroke, 3e5 * s.force / s.stroke, "log"),
        ("gap", "constant", 1e-5 * s.stroke, 0.2 * s.stroke, "log"),
        ("gap_corner", "constant", 1e-5 * s.stroke, 0.1 * s.stroke, "log"),
        ("leak_damping", "constant", 1e-3 * damping, 1e3 * damping, "log"),
        ("leak_exponent", "constant", 0.5, 1.5, "linear"),
        ("offset", "constant", -0.5 * s.force, 0.5 * s.force, "linear"),
        ("stiffness", "constant", 0.0, s.force / s.stroke, "linear"),
    ]


def _terms(s: Scale) -> dict[str, list[Entry]]:
    """Return the parallel terms that any law can be given."""
    return {
        "friction": [
            ("coulomb_friction", "constant", 0.0, s.force, "linear"),
            ("breakaway_friction", "constant", 0.0, s.force, "linear"),
            ("stribeck_velocity", "constant", 1e-3 * s.speed, s.speed, "log"),
            ("transition_velocity", "constant", 1e-4 * s.speed, 0.1 * s.speed, "log"),
        ],
        "mass": [("mass", "constant", 0.0, s.force / s.acceleration, "linear")],
        "viscosity": [("viscosity", "constant", 0.0, 2.0 * s.force / s.speed, "linear")],
        "thinning": [("viscous_exponent", "constant", 0.2, 1.5, "linear")],
    }


def _entries_of_python_law(law: HysteresisLaw, s: Scale) -> list[Entry]:
    """Return the entries of a user's law: constants between the bounds that its coefficients state."""
    entries: list[Entry] = []
    for c in law.coefficients:
        if not (np.isfinite(c.lower) and np.isfinite(c.upper)):
            raise InputError(
                place=law.name, found=f"coefficient {c.name} needs finite lower and upper bounds to be fitted"
            )
        wide = c.lower > 0.0 and c.upper / c.lower > 50.0
        entries.append(
            (c.name, "polynomial" if c.linear else "constant", c.lower, c.upper, "log" if wide else "linear")
        )
    return entries


def _dependence(
    law: HysteresisLaw,
    name: str,
    form: Form,
    lower: float,
    upper: float,
    how: Literal["linear", "log"],
    s: Scale,
) -> tuple[ParameterLaw, list[FreeParameter]]:
    """Return one coefficient's parameter law, as rich as the commands allow, and its free parameters."""
    linear = law[name].linear
    start = float(np.sqrt(lower * upper)) if how == "log" else 0.5 * (lower + upper)
    if s.levels < 2:
        form = "constant"
    if form == "constant":
        return Constant(start), [FreeParameter(f"{name}.value", lower, upper, how, linear)]
    if form == "exponential":
        rate = _steepest(law, name, lower, upper) / s.command
        return Exponential(start, 0.0), [
            FreeParameter(f"{name}.at_zero", lower, upper, how),
            FreeParameter(f"{name}.rate", -rate, rate),
        ]
    if form == "hill" and s.levels >= 3:
        parameters = [
            FreeParameter(f"{name}.base", lower, upper, how, linear),
            FreeParameter(f"{name}.gain", -upper if linear else 10.0 * lower, 2.0 * upper, how, linear),
            FreeParameter(f"{name}.half_command", 0.05 * s.command, 10.0 * s.command, "log"),
            FreeParameter(f"{name}.exponent", 0.6, 3.0 if linear else 6.0, "log"),
        ]
        return Hill(0.1 * start, start, s.command, 1.5, s.command), parameters[: min(s.levels, 4)]
    if not linear:  # two commands: a straight line that stays positive at both ends
        rate = _steepest(law, name, lower, upper) / s.command
        return Exponential(start, 0.0), [
            FreeParameter(f"{name}.at_zero", lower, upper, how),
            FreeParameter(f"{name}.rate", -rate, rate),
        ]
    degree = min(s.levels - 1, _DEGREES.get(form, 2))
    size = max(abs(lower), abs(upper))
    return Polynomial((start, *([0.0] * degree))), [
        FreeParameter(
            f"{name}.c{power}",
            lower if power == 0 else -size / s.command**power,
            size / s.command**power,
            "linear",
            linear,
        )
        for power in range(degree + 1)
    ]


def _steepest(law: HysteresisLaw, name: str, lower: float, upper: float) -> float:
    """Return the logarithm by which an exponential may grow or fall: three decades, in the law's range."""
    admissible = law[name]
    room = [np.log(1e3), np.log(admissible.upper / upper)]
    if admissible.lower > 0.0:
        room.append(np.log(lower / admissible.lower))
    return float(max(min(room), 0.1))
