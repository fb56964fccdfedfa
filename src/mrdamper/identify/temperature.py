"""Temperature in a template: the coefficients that follow it, their laws, and the runs that these need.

The usual choice is physical: viscous parts follow the fluid's viscosity (Arrhenius, Reynolds or VFT), yield
forces and friction are linear in temperature. ``paper`` is the separable polynomial of the paper's Eq. (12)
as reconstructed. A fluid's data can stand in for runs at several temperatures; its factors are then marked
as assumed and do not move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, Protocol

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.problem import FreeParameter
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import (
    Bipolynomial,
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.laws import HysteresisLaw
from mrdamper.models.temperature import Arrhenius, Linear, PolynomialFactor, Reynolds, TemperatureFactor, Vft
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K

Temperature = Literal["auto", "none", "arrhenius", "reynolds", "vft", "paper"]
TEMPERATURES: tuple[Temperature, ...] = ("auto", "none", "arrhenius", "reynolds", "vft", "paper")

_VISCOUS = (
    "viscosity",
    "thinning",
    "thinning_force",
    "leak_damping",
    "series_damping",
    "inner_viscosity",
    "bristle_damping",
)
_YIELDING = ("yield_force", "second_force", "rate_force", "memory_force", "bristle_stiffness")
_MOBILE = ("creep",)  # one over a viscosity
_FRICTION = ("coulomb_friction", "breakaway_friction", "friction_force")
LEVEL_K = 5.0  # temperatures closer than this are one level
_NEEDED = {"arrhenius": 2, "reynolds": 2, "vft": 3, "paper": 3}  # temperatures that a kind takes
_STEEPEST = 0.95  # share of a linear factor that may be lost at the run furthest from 20 degC


class FluidFactors(Protocol):
    """The temperature factors that a fluid gives to assumptions."""

    @property
    def viscosity_factor(self) -> TemperatureFactor: ...
    @property
    def yield_factor(self) -> TemperatureFactor: ...
    @property
    def valid_K(self) -> tuple[float, float]: ...


def temperature_levels(runs: Sequence[PreparedRun]) -> tuple[float, ...]:
    """Return the distinct temperatures [K] of the runs, 5 K or more apart; none when a run does not tell.

    A run that warms up counts with both its ends.
    """
    tracks = [run.trajectory.temperature for run in runs]
    known = [track for track in tracks if track is not None]
    if len(known) < len(tracks) or not known:
        return ()
    ends = sorted({float(end) for track in known for end in (track.min(), track.max())})
    levels = [ends[0]]
    for end in ends[1:]:
        if end - levels[-1] >= LEVEL_K:
            levels.append(end)
    return tuple(levels)


def settle_temperature(
    runs: Sequence[PreparedRun], kind: Temperature
) -> tuple[tuple[PreparedRun, ...], Temperature, str]:
    """Return the runs and the kind of temperature laws that can be fitted to them, and a note where not all.

    Only "auto" is settled. Runs at one temperature, or few among many that have a channel, are fitted without
    temperature laws; where most runs have a channel, the few without are left out.
    """
    runs = tuple(runs)
    measured = tuple(run for run in runs if run.trajectory.temperature is not None)
    if kind != "auto" or not measured:
        return runs, kind, ""
    levels = temperature_levels(measured)
    lacking = len(runs) - len(measured)
    if len(levels) < _NEEDED["arrhenius"]:
        at = f"{levels[0] - ZERO_CELSIUS_K:.0f} degC"
        return runs, "none", f"one temperature in the runs ({at}): fitted without temperature laws"
    if not lacking:
        return runs, kind, ""
    if lacking <= len(measured):
        told = f"{lacking} of {len(runs)} runs have no temperature: they are left out"
        return measured, kind, told
    told = f"{lacking} of {len(runs)} runs have no temperature: fitted without temperature laws"
    return runs, "none", told


def apply_temperature(
    law: HysteresisLaw,
    forms: Mapping[str, ParameterLaw],
    free: Sequence[FreeParameter],
    levels: Sequence[float],
    kind: Temperature,
    lines: Sequence[str] = (),
) -> tuple[dict[str, ParameterLaw], list[FreeParameter]]:
    """Return forms and free parameters with temperature in them.

    ``lines`` names further coefficients that follow it, as straight lines whatever the kind.

    Raises
    ------
    InputError
        Fewer temperatures than the kind takes: the message names what cannot be identified.
    """
    kind = "arrhenius" if kind == "auto" else kind
    needed = _NEEDED[kind]
    concerned = [name for name in forms if name in (*_VISCOUS, *_YIELDING, *_FRICTION, *_MOBILE)]
    if len(levels) < needed:
        found = ", ".join(f"{level - ZERO_CELSIUS_K:.0f}" for level in levels)
        raise InputError(
            found=(
                f"the runs are at {len(levels)} temperature{'' if len(levels) == 1 else 's'} ({found} degC); "
                f"how {', '.join(concerned)} of {law.name} change with temperature ({kind}) cannot be "
                "identified from them"
            ),
            remedy=(
                f"Add the same tests at {needed} or more temperatures, at least 5 K apart (20, 60 and 100 "
                "degC, say), take a fluid's laws by assumption (⟦--fluid⟧), or leave temperature out "
                "(⟦--temperature none⟧)"
            ),
        )
    span = max(1.0, *(abs(level - REFERENCE_K) for level in levels))
    steepest = _STEEPEST / span
    temperature_dependent: dict[str, ParameterLaw] = dict(forms)
    moved = list(free)
    for name in concerned:
        form = forms[name]
        assert isinstance(form, Constant | Polynomial | Hill | Exponential)
        if kind == "paper":
            if name in _FRICTION:
                continue
            temperature_dependent[name] = TemperatureDependent(form, PolynomialFactor((0.0, 0.0)))
            moved += [
                FreeParameter(f"{name}.t1", -2.0 / span, 2.0 / span),
                FreeParameter(f"{name}.t2", -2.0 / span**2, 2.0 / span**2),
            ]
        elif name in _VISCOUS:
            factor, parameters = _viscous(name, kind, min(levels))
            temperature_dependent[name] = TemperatureDependent(form, factor)
            moved += parameters
        elif name in _MOBILE:
            temperature_dependent[name] = TemperatureDependent(form, Arrhenius(-1200.0))
            moved.append(FreeParameter(f"{name}.activation_K", -6000.0, 500.0))
        elif law[name].linear and isinstance(form, Constant | Polynomial):
            temperature_dependent[name], moved = _bilinear(name, form, moved, span)
        else:
            temperature_dependent[name] = TemperatureDependent(form, Linear(0.5e-3))
            moved.append(FreeParameter(f"{name}.temperature_slope", -steepest, steepest))
    for name in lines:
        form = temperature_dependent[name]
        if isinstance(form, Constant | Polynomial):
            temperature_dependent[name], moved = _bilinear(name, form, moved, span)
    return temperature_dependent, moved


def apply_fluid(forms: Mapping[str, ParameterLaw], fluid: FluidFactors) -> dict[str, ParameterLaw]:
    """Return forms with a fluid's temperature factors, marked as assumed; nothing of them is free.

    Viscosity follows the fluid's; in the series valve a shear-thinning part |v|^m follows the viscosity to
    the power m, which the fitted exponent settles later (``scale_thinning``).
    """
    assumed: dict[str, ParameterLaw] = dict(forms)
    for name, form in forms.items():
        if not isinstance(form, Constant | Polynomial | Hill | Exponential):
            continue
        if name in _VISCOUS:
            assumed[name] = TemperatureDependent(form, fluid.viscosity_factor, assumed=True)
        elif name in _YIELDING:
            assumed[name] = TemperatureDependent(form, fluid.yield_factor, assumed=True)
    return assumed


def scale_thinning(damper: Damper) -> Damper:
    """Return a damper with its assumed thinning factors raised to the exponents that were fitted.

    A force that grows with |v|^m follows the viscosity to the power m; all viscosity factors are
    exponentials, linear in their first parameter.
    """
    forms = dict(damper.coefficients)
    for name, exponent in (("thinning", "thinning_exponent"), ("leak_damping", "leak_exponent")):
        form = forms.get(name)
        if isinstance(form, TemperatureDependent) and form.assumed:
            power = float(forms[exponent].value(0.0))
            first, *rest = form.factor.parameters
            forms[name] = replace(form, factor=form.factor.with_parameters((first * power, *rest)))
    return replace(damper, coefficients=forms)


def _viscous(name: str, kind: str, coldest: float) -> tuple[TemperatureFactor, list[FreeParameter]]:
    if kind == "reynolds":
        return Reynolds(0.01), [FreeParameter(f"{name}.temperature_rate", -0.01, 0.08)]
    if kind == "vft":
        pole = min(coldest, REFERENCE_K) - 15.0
        return Vft(600.0, 150.0), [
            FreeParameter(f"{name}.vft_K", 20.0, 6000.0, "log"),
            FreeParameter(f"{name}.vft_pole_K", 20.0, pole),
        ]
    return Arrhenius(1200.0), [FreeParameter(f"{name}.activation_K", -500.0, 6000.0)]


def _bilinear(
    name: str, form: Constant | Polynomial, free: Sequence[FreeParameter], span: float
) -> tuple[Bipolynomial, list[FreeParameter]]:
    """Return a polynomial in command and temperature, linear in its parameters where the force is in it."""
    old = {f"{name}.{number}": k for k, number in enumerate(form.parameter_names)}
    own = sorted((f for f in free if f.name in old), key=lambda f: old[f.name])
    parameters: list[float] = []
    moved = [f for f in free if f.name not in old]
    for power, (value, bound) in enumerate(zip(form.parameters, own, strict=True)):
        parameters += [value, 0.0]
        size = max(abs(bound.lower), abs(bound.upper))
        moved += [
            FreeParameter(f"{name}.c{power}0", bound.lower, bound.upper, "linear", bound.linear),
            FreeParameter(f"{name}.c{power}1", -size / span, size / span, "linear", bound.linear),
        ]
    return Bipolynomial(tuple(np.asarray(parameters, dtype=float).tolist()), 1), moved
