"""Temperature dependence of the coefficients, and the number of temperatures that a fit requires.

Viscous coefficients follow the viscosity of the fluid (Arrhenius, Reynolds or VFT). Yield forces and friction
are linear in temperature. The kind ``paper`` is a temperature polynomial, Eq. (12) of the reference paper. If
the runs have only one temperature, the temperature factors of a known fluid can be assumed instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, Protocol

import numpy as np

from mrdamper.data.prepare import PreparedRun
from mrdamper.errors import InputError
from mrdamper.identify.problem import FreeParameter
from mrdamper.identify.settings import NUMERICS
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

# Coefficients, grouped by the property whose temperature dependence they follow.
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
_MOBILE = ("creep",)  # Creep is proportional to 1 / viscosity.
_FRICTION = ("coulomb_friction", "breakaway_friction", "friction_force")
# Number of different temperatures that each kind of temperature dependence requires.
LEVEL_COUNT_MIN = {"arrhenius": 2, "reynolds": 2, "vft": 3, "paper": 3}


class FluidFactors(Protocol):
    """Temperature factors of a fluid with known properties."""

    @property
    def viscosity_factor(self) -> TemperatureFactor: ...
    @property
    def yield_factor(self) -> TemperatureFactor: ...
    @property
    def valid_K(self) -> tuple[float, float]: ...


def temperature_levels(runs: Sequence[PreparedRun]) -> tuple[float, ...]:
    """Return the different temperatures [K] of the runs in rising order, at least 5 K apart.

    A run that warms up contributes its lowest and its highest temperature. The result is empty if a run has
    no temperature.
    """
    tracks = [run.trajectory.temperature for run in runs]
    known = [track for track in tracks if track is not None]
    if len(known) < len(tracks) or not known:
        return ()
    ends = sorted({float(end) for track in known for end in (track.min(), track.max())})
    levels = [ends[0]]
    for end in ends[1:]:
        if end - levels[-1] >= NUMERICS.same_temperature_K:
            levels.append(end)
    return tuple(levels)


def select_temperature_kind(
    runs: Sequence[PreparedRun], kind: Temperature
) -> tuple[tuple[PreparedRun, ...], Temperature, str]:
    """Return the runs to fit, the kind of temperature dependence, and a remark on ignored data.

    A ``kind`` other than "auto" is returned unchanged. "auto" becomes "none" if the runs have only one
    temperature, or if fewer than half of the runs have a temperature channel. If at least half of the runs
    have this channel, the runs that lack it are ignored.
    """
    runs = tuple(runs)
    measured = tuple(run for run in runs if run.trajectory.temperature is not None)
    if kind != "auto" or not measured:
        return runs, kind, ""
    levels = temperature_levels(measured)
    if len(levels) < LEVEL_COUNT_MIN["arrhenius"]:
        at = f"{levels[0] - ZERO_CELSIUS_K:.0f} degC"
        return runs, "none", f"one temperature in the runs ({at}): fitted without temperature laws"
    lacking = len(runs) - len(measured)
    note = f"{lacking} of {len(runs)} runs have no temperature"
    if lacking > len(measured):
        return runs, "none", f"{note}: fitted without temperature laws"
    return measured, kind, f"{note}: they are ignored" if lacking else ""


def apply_temperature(
    law: HysteresisLaw,
    forms: Mapping[str, ParameterLaw],
    free: Sequence[FreeParameter],
    levels: Sequence[float],
    kind: Temperature,
    linear: Sequence[str] = (),
) -> tuple[dict[str, ParameterLaw], list[FreeParameter]]:
    """Add a temperature dependence to coefficients; return the new dependences and free parameters.

    Parameters
    ----------
    forms : dependence of each coefficient on current
    free : parameters that are fitted
    levels : different temperatures of the runs [K]
    linear : names of coefficients that are linear in temperature for every kind

    Raises
    ------
    InputError
        If there are fewer temperatures than the kind requires.
    """
    kind = "arrhenius" if kind == "auto" else kind
    needed = LEVEL_COUNT_MIN[kind]
    affected = [name for name in forms if name in (*_VISCOUS, *_YIELDING, *_FRICTION, *_MOBILE)]
    if len(levels) < needed:
        found = ", ".join(f"{level - ZERO_CELSIUS_K:.0f}" for level in levels)
        raise InputError(
            found=(
                f"the runs are at {len(levels)} temperature{'' if len(levels) == 1 else 's'} ({found} degC); "
                f"how {', '.join(affected)} of {law.name} change with temperature ({kind}) cannot be "
                "identified from them"
            ),
            remedy=(
                f"Add the same tests at {needed} or more temperatures, at least 5 K apart (for example 20, "
                "60 and 100 degC), take a fluid's laws by assumption (mrdamper fit --fluid), or ignore "
                "temperature (mrdamper fit --temperature none)"
            ),
        )
    span = max(1.0, *(abs(level - REFERENCE_K) for level in levels))
    slope_max = NUMERICS.linear_decrease_max / span
    temperature_dependent: dict[str, ParameterLaw] = dict(forms)
    moved = list(free)
    for name in affected:
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
            moved.append(FreeParameter(f"{name}.temperature_slope", -slope_max, slope_max))
    for name in linear:
        form = temperature_dependent[name]
        if isinstance(form, Constant | Polynomial):
            temperature_dependent[name], moved = _bilinear(name, form, moved, span)
    return temperature_dependent, moved


def apply_fluid(forms: Mapping[str, ParameterLaw], fluid: FluidFactors) -> dict[str, ParameterLaw]:
    """Return the dependences of coefficients with the temperature factors of a fluid, marked as assumed.

    Assumed factors are not fitted. In the series valve, a shear-thinning force |v|^m is proportional to the
    viscosity to the power m. ``scale_thinning`` applies this power after the fit, when m is known.
    """
    assumed: dict[str, ParameterLaw] = dict(forms)
    for name, form in forms.items():
        factor = fluid.viscosity_factor if name in _VISCOUS else fluid.yield_factor
        is_affected = name in (*_VISCOUS, *_YIELDING)
        if is_affected and isinstance(form, Constant | Polynomial | Hill | Exponential):
            assumed[name] = TemperatureDependent(form, factor, assumed=True)
    return assumed


def scale_thinning(damper: Damper) -> Damper:
    """Return the damper with the assumed viscosity factor of each thinning force raised to the power m.

    A force |v|^m is proportional to the viscosity to the power m. All viscosity factors are exponential in
    their first parameter. Therefore this parameter is multiplied by the fitted m.
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
    """Return a polynomial in command that is linear in temperature, and the updated free parameters."""
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
