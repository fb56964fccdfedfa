"""Make the damper at which a fit starts: its coefficients versus current and temperature, with bounds.

``terms`` defines which coefficients are fitted. This module multiplies their bounds by typical values of the
runs (force, stroke, speed and current). The dependence of a coefficient on current has as many parameters as
the number of currents in the runs can determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mrdamper.arrays import level_numbers
from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.settings import NUMERICS
from mrdamper.identify.temperature import (
    FluidFactors,
    Temperature,
    apply_fluid,
    apply_temperature,
    temperature_levels,
)
from mrdamper.identify.terms import FOLLOW_TERM, Form, FreeCoefficient, Scale, Term, base_of, terms_of
from mrdamper.models.damper import LAG, Damper
from mrdamper.models.dependence import Constant, Exponential, Hill, ParameterLaw, Polynomial, Saturation
from mrdamper.models.laws import HysteresisLaw, find_law
from mrdamper.schema import unknown_name


def scale_of(runs: Sequence[PreparedRun]) -> Scale:
    """Return typical force, stroke, speed and command of runs. Search bounds are multiples of them."""
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
    """Return the number of different constant commands of the runs.

    Commands are equal if they differ by at most 3 % of the largest command.
    """
    commands = np.array([c for run in runs if (c := run.run.constant_command) is not None])
    numbers = level_numbers(commands, 0.03 * np.abs(commands).max(initial=0.0))
    return int(numbers.max(initial=-1)) + 1


def template(
    law_name: str | HysteresisLaw,
    runs: Sequence[PreparedRun],
    *,
    one_command: bool = False,
    terms: Sequence[str] | None = None,
    start: Mapping[str, float] | None = None,
    temperature: Temperature = "auto",
    fluid: FluidFactors | None = None,
    scale: Scale | None = None,
) -> tuple[Damper, tuple[FreeParameter, ...]]:
    """Return a damper with the default dependence on current and temperature, and its free parameters.

    If the runs have three or more currents, coefficients are quadratic, exponential or Hill functions of the
    current. For exactly three currents, the exponent of Hill functions is fixed. For two currents,
    coefficients are straight lines. For a single current, coefficients are constant. If the current changes
    during a run, the first-order lag [s] between current and force is also a free parameter.

    Parameters
    ----------
    terms : names of the terms (``terms.terms_of``); None: the default terms
    start : start values of coefficients, divided by their typical values; they replace the default ones
    temperature : kind of the temperature dependence; "auto" is "arrhenius" if the runs have a temperature

    Raises
    ------
    InputError
        If all runs have one current and ``one_command`` is False, if currents and voltages are mixed, if
        there are too few temperatures for the kind, if a term is unknown, or if a required term is missing.
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
        raise InputError(
            found=(
                f"all {len(runs)} training runs have one command ({runs[0].trajectory.command[0]:g} "
                f"{runs[0].run.command_unit}); they do not determine how the force depends on the command"
            ),
            remedy="Add the same tests at two or more other commands, or use mrdamper fit --one-command",
        )
    follows_temperature = temperature != "none" and fluid is None and _has_temperature(runs, temperature)
    temperature_dependent = all(run.trajectory.temperature is not None for run in runs)
    campaign = temperature_dependent and fluid is None and temperature != "paper"
    if campaign:
        entries = [replace(e, form=_CAMPAIGN_FORMS.get((e.name, e.form), e.form)) for e in entries]
    on = _find_terms(law, _default_terms(law, campaign=campaign) if terms is None else terms)
    varies = any(run.run.constant_command is None for run in runs)
    # The follow term describes the response to a changing current. Constant currents do not determine it.
    on = [term for term in on if varies or term.name != FOLLOW_TERM]
    for term in on:
        entries += [entry for entry in term.entries if entry.name not in {e.name for e in entries}]
    forms: dict[str, ParameterLaw] = {}
    free: list[FreeParameter] = []
    for each in entries:
        entry = replace(each, start=(start or {}).get(each.name, each.start))
        size = 1.0 if law.kernel is None else scale.size_of(law[entry.name].unit)
        forms[entry.name], moved = _dependence(law, entry.scaled(size), scale)
        free += moved
    if fluid is not None:
        forms = apply_fluid(forms, fluid)
    elif follows_temperature:
        linear = [name for term in on for name in term.linear_in_temperature]
        forms, free = apply_temperature(law, forms, free, scale.temperatures, temperature, linear)
    lag = 0.0
    if varies:
        lag = 0.01
        free.append(FreeParameter(LAG, 1e-4, 0.3, "log"))
    beyond = None if fluid is None else fluid.valid_K
    if follows_temperature:
        margin = NUMERICS.temperature_margin_K
        beyond = (scale.temperatures[0] - margin, scale.temperatures[-1] + margin)
    return Damper(law, forms, units.pop(), lag, temperature_range=beyond), tuple(free)


def _find_terms(law: HysteresisLaw, names: Sequence[str]) -> list[Term]:
    known = terms_of(law)
    for name in names:
        if name not in known:
            raise unknown_name(f"no term is called {name!r}", name, known)
        missing = [each for each in known[name].needs if each not in names]
        if missing:
            raise InputError(found=f"term {name!r} needs {', '.join(missing)} as well")
    return [known[name] for name in names]


def _has_temperature(runs: Sequence[PreparedRun], temperature: Temperature) -> bool:
    """Return True if all runs have a temperature channel, and False if no run has this channel.

    Raise InputError if only some runs have the channel, or if the requested ``temperature`` kind needs it.
    """
    without = [run.name for run in runs if run.trajectory.temperature is None]
    if without and (len(without) < len(runs) or temperature != "auto"):
        raise InputError(
            found=f"{len(without)} of {len(runs)} runs have no temperature channel (the first: {without[0]})",
            expected="one in every run",
            remedy=(
                "Map the channel, state it as a constant in the channel map, or ignore temperature "
                "(mrdamper fit --temperature none)"
            ),
        )
    return not without


_CAMPAIGN_FORMS: dict[tuple[str, Form], Form] = {
    ("yield_force", "polynomial"): "hill",
    ("second_force", "polynomial"): "hill",
    ("rate_force", "polynomial"): "hill",
    ("viscosity", "polynomial"): "line",
    ("offset", "polynomial"): "line",
    ("stiffness", "polynomial"): "constant",
    ("rho", "constant"): "exponential",
}
"""Dependences on current that replace the default ones if the runs have a temperature.

They follow the reconstructed Eq. (12) of the reference paper: mainly the yield force depends on current. A
viscosity that is quadratic in current has a smaller training error but a larger error at higher speeds,
because it compensates for the shape of the loop.
"""


def _default_terms(law: HysteresisLaw, *, campaign: bool) -> tuple[str, ...]:
    """Return the names of the default terms; ``campaign`` is True if the runs have a temperature channel."""
    if law.name == "chain":
        return ("bristles", "spread", "friction", "thinning") if campaign else ("position", "friction")
    if law.kernel is None or not campaign:
        return ()
    return ("friction", "viscosity", "thinning") if law.name == "series-valve" else ("friction", "thinning")


def _dependence(
    law: HysteresisLaw, entry: FreeCoefficient, s: Scale
) -> tuple[ParameterLaw, list[FreeParameter]]:
    """Return a coefficient as a function of current, and the free parameters of this function.

    The number of parameters does not exceed the number of different commands.
    """
    name, form, lower, upper, how = entry.name, entry.form, entry.lower, entry.upper, entry.scale
    linear, start = law[name].linear, entry.start or 0.0
    if form == "fixed":
        return Constant(start), []
    if s.levels < 2:
        form = "constant"
    if form == "constant":
        return Constant(start), [FreeParameter(f"{name}.value", lower, upper, how, linear)]
    if form in ("hill", "saturation") and s.levels >= 3:
        parameters = [
            FreeParameter(f"{name}.base", lower, upper, how, linear),
            FreeParameter(f"{name}.gain", -upper if linear else 10.0 * lower, 2.0 * upper, how, linear),
            FreeParameter(f"{name}.half_command", 0.05 * s.command, 10.0 * s.command, "log"),
            FreeParameter(f"{name}.exponent", 0.6, 3.0 if linear else 6.0, "log"),
        ]
        if form == "saturation" and s.levels >= NUMERICS.sharpness_level_count_min:
            bend = FreeParameter(f"{name}.sharpness", 0.5, 6.0, "log")
            return Saturation(0.1 * start, start, s.command, 1.5, s.command), [*parameters, bend]
        return Hill(0.1 * start, start, s.command, 1.5, s.command), parameters[: min(s.levels, 4)]
    if form == "exponential" or not linear:  # An exponential has two parameters and stays positive.
        rate = _log_range(law, name, lower, upper) / s.command
        return Exponential(start, 0.0), [
            FreeParameter(f"{name}.at_zero", lower, upper, how),
            FreeParameter(f"{name}.rate", -rate, rate),
        ]
    degree = min(s.levels - 1, 1 if form == "line" else 2)
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


def _log_range(law: HysteresisLaw, name: str, lower: float, upper: float) -> float:
    """Return the maximum change of the logarithm of an exponential coefficient over the current range.

    The change is at most three decades, and the coefficient stays within the valid range of the law.
    """
    admissible = law[name]
    ranges = [np.log(1e3), np.log(admissible.upper / upper)]
    if admissible.lower > 0.0:
        ranges.append(np.log(lower / admissible.lower))
    return float(max(min(ranges), 0.1))
