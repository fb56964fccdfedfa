"""Templates: how each law's coefficients depend on command and temperature, and how far a fit may look.

Which coefficients move is the business of ``groups``; here the bounds get the size of the runs (force,
stroke, speed and command of the data, never of one damper), and the forms as many parameters as the runs can
tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.groups import FOLLOW, Form, FreeCoefficient, LawGroup, Scale, base_of, groups_of
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.temperature import (
    FluidFactors,
    Temperature,
    apply_fluid,
    apply_temperature,
    temperature_levels,
)
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial, Saturation
from mrdamper.models.laws import HysteresisLaw, find_law
from mrdamper.schema import unknown_name

__all__ = ["HELD_BEYOND_K", "Scale", "command_levels", "scale_of", "template"]

HELD_BEYOND_K = 5.0
"""So far beyond the runs' temperatures [K] a damper follows them; further out it holds the edge value."""

_DEGREES = {"line": 1, "polynomial": 2}
_BEND_LEVELS = 5  # commands that tell how sharp the bend of a saturation is


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
    groups: Sequence[str] | None = None,
    start: Mapping[str, float] | None = None,
    temperature: Temperature = "auto",
    fluid: FluidFactors | None = None,
    scale: Scale | None = None,
) -> tuple[Damper, tuple[FreeParameter, ...]]:
    """Return a law's damper with its usual dependence on command and temperature, and its free parameters.

    Three or more commands carry the usual forms (quadratic, exponential, Hill with a fixed exponent for
    exactly three); two carry straight lines; one carries constants, and must be asked for. Where a command
    varies over a run, the first-order lag [s] between command and force is free as well.

    ``groups`` are switched on by name (``groups.groups_of``); for any law ``friction`` (Stribeck), ``mass``,
    ``viscosity``, ``thinning`` (the viscous force is a power of velocity) and ``gas`` (offset and stiffness,
    both over temperature) among them. None: what a tempered campaign asks for (friction and thinning,
    viscosity beside the series valve), nothing otherwise. ``start`` is where coefficients start instead, in
    the size of the runs (a start of a group).

    ``temperature`` says how coefficients follow it (``tempering``); "auto" is "arrhenius" where the runs have
    a temperature, "none" leaves it out. With a ``fluid`` its laws are assumed instead. ``scale`` is that of
    the runs, where it is known.

    Raises
    ------
    InputError
        All runs at one command and ``one_command`` not set; runs whose commands have two units; runs at too
        few temperatures for the kind asked for; a group that the law does not have, or without one it needs.
    """
    law = find_law(law_name) if isinstance(law_name, str) else law_name
    units = {run.run.command_unit for run in runs}
    if len(units) != 1:
        raise InputError(
            f"the runs' commands have units {', '.join(sorted(units)) or 'none'}",
            expected="one unit for one fit",
            remedy="Map the channel to current or to voltage in all of them",
        )
    scale = scale or scale_of(runs)
    entries = list(base_of(law))
    if scale.levels < 2 and not one_command:
        raise _one_command(law, entries, runs)
    follows_temperature = temperature != "none" and fluid is None and _has_temperature(runs, temperature)
    temperature_dependent = all(run.trajectory.temperature is not None for run in runs)  # heeded or not
    campaign = temperature_dependent and fluid is None and temperature != "paper"
    if campaign:
        entries = [replace(e, form=_CAMPAIGN.get((e.name, e.form), e.form)) for e in entries]
    on = _switched_on(law, _usual_groups(law, campaign=campaign) if groups is None else groups)
    varies = any(run.run.constant_command is None for run in runs)
    on = [group for group in on if varies or group.name != FOLLOW]  # with the actuation, by other runs
    for group in on:
        entries += [entry for entry in group.entries if entry.name not in {e.name for e in entries}]
    forms: dict[str, ParameterLaw] = {}
    free: list[FreeParameter] = []
    for each in entries:
        entry = replace(each, start=(start or {}).get(each.name, each.start))
        size = 1.0 if law.kernel is None else scale.size_of(law[entry.name].unit)
        forms[entry.name], moved = _dependence(law, entry.sized(size), scale)
        free += moved
    if fluid is not None:
        forms = apply_fluid(forms, fluid)
    elif follows_temperature:
        lines = [name for group in on for name in group.over_temperature]
        forms, free = apply_temperature(law, forms, free, scale.temperatures, temperature, lines)
    lag = 0.0
    if varies:
        lag = 0.01
        free.append(FreeParameter(LAG, 1e-4, 0.3, "log"))
    beyond = None if fluid is None else fluid.valid_K
    if follows_temperature:
        beyond = (scale.temperatures[0] - HELD_BEYOND_K, scale.temperatures[-1] + HELD_BEYOND_K)
    return Damper(law, forms, units.pop(), lag, temperature_range=beyond), tuple(free)


def _one_command(
    law: HysteresisLaw, entries: Sequence[FreeCoefficient], runs: Sequence[PreparedRun]
) -> InputError:
    """Return the error of runs that all have one command."""
    follow = ", ".join(e.name for e in entries if e.form not in ("constant", "fixed"))
    return InputError(
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


def _switched_on(law: HysteresisLaw, names: Sequence[str]) -> list[LawGroup]:
    """Return the groups of these names."""
    known = groups_of(law)
    for name in names:
        if name not in known:
            raise unknown_name(f"no term is called {name!r}", name, known)
        missing = [each for each in known[name].needs if each not in names]
        if missing:
            raise InputError(found=f"term {name!r} needs {', '.join(missing)} as well")
    return [known[name] for name in names]


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


def _usual_groups(law: HysteresisLaw, *, campaign: bool) -> tuple[str, ...]:
    """Return the groups that are on when none are named, for a tempered campaign or without temperature."""
    if law.name == "chain":
        return ("bristles", "spread", "friction", "thinning") if campaign else ("position", "friction")
    if law.kernel is None or not campaign:
        return ()
    return ("friction", "viscosity", "thinning") if law.name == "series-valve" else ("friction", "thinning")


def _dependence(
    law: HysteresisLaw, entry: FreeCoefficient, s: Scale
) -> tuple[ParameterLaw, list[FreeParameter]]:
    """Return one coefficient's parameter law, as rich as the commands allow, and its free parameters."""
    name, form, lower, upper, how = entry.name, entry.form, entry.lower, entry.upper, entry.scale
    linear, start = law[name].linear, entry.start or 0.0
    if form == "fixed":
        return Constant(start), []
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
    if form in ("hill", "saturation") and s.levels >= 3:
        parameters = [
            FreeParameter(f"{name}.base", lower, upper, how, linear),
            FreeParameter(f"{name}.gain", -upper if linear else 10.0 * lower, 2.0 * upper, how, linear),
            FreeParameter(f"{name}.half_command", 0.05 * s.command, 10.0 * s.command, "log"),
            FreeParameter(f"{name}.exponent", 0.6, 3.0 if linear else 6.0, "log"),
        ]
        if form == "saturation" and s.levels >= _BEND_LEVELS:
            bend = FreeParameter(f"{name}.sharpness", 0.5, 6.0, "log")
            return Saturation(0.1 * start, start, s.command, 1.5, s.command), [*parameters, bend]
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
