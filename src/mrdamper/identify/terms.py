"""Terms of the laws: coefficients that are fitted together, with their bounds and start values, as data.

A law has a base that is always fitted, and terms that are added by name. Bounds and start values are
relative to the ``Scale`` of the runs according to the unit of the coefficient: a force to their force, a
length to their stroke. They are the same for a damper of 20 N and for one of 200 kN, and they cover two to
six decades. A coefficient without an entry keeps its default.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from mrdamper.errors import InputError
from mrdamper.models.laws import HysteresisLaw

FOLLOW_TERM = "follow"
"""The term that only runs with changing current determine."""

ACCELERATION_MIN_m_s2 = 100.0
"""The moving mass is at most the force divided by this. A larger apparent mass is a time lag of the force."""

Form = Literal["fixed", "constant", "line", "polynomial", "exponential", "hill", "saturation"]


@dataclass(frozen=True, slots=True)
class Scale:
    """Typical values of the runs, which are the units of the search bounds."""

    force: float  # 99.5th percentile of |F| over all runs [N]
    stroke: float  # maximum of |x| [m]
    speed: float  # 99.5th percentile of |v| of the fastest run [m/s]
    acceleration: float  # 99.5th percentile of |a| of the run with the largest value [m/s^2]
    command: float  # maximum of |command| [A or V]
    levels: int  # number of distinct commands; a command that varies counts as four
    temperatures: tuple[float, ...]  # distinct temperatures [K]; empty unless all runs have a temperature

    def size_of(self, unit: str) -> float:
        """Return the typical value of coefficients with a unit, in this unit."""
        force, stroke, speed = self.force, self.stroke, self.speed
        sizes: Mapping[str, float] = {
            "N": force,
            "N/m": force / stroke,
            "N s/m": force / speed,
            "N (s/m)^mB": force / speed,
            "N s^2/m^2": force / speed**2,
            "kg": force / max(self.acceleration, ACCELERATION_MIN_m_s2),
            "m": stroke,
            "1/m": 1.0 / stroke,
            "1/m^2": 1.0 / stroke**2,
            "m/s": speed,
            "m/(N s)": speed / force,
            "m/(s N^0.5)": speed / math.sqrt(force),
            "s/m": 1.0 / speed,
            "(s/m)^m": speed**-0.5,
            "-": 1.0,
        }
        return sizes[unit]


@dataclass(frozen=True, slots=True)
class FreeCoefficient:
    """A coefficient with its dependence on the current, its bounds and its start value.

    All values are relative to the scale. A coefficient with the form ``fixed`` keeps its start value. Without
    ``start``, the start value is the middle of the bounds.
    """

    name: str
    form: Form
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "linear"
    start: float | None = None

    def scaled(self, size: float) -> FreeCoefficient:
        """Return the coefficient with bounds and start in physical units, multiplied by ``size``."""
        low, high, start = self.lower, self.upper, self.start
        if start is None:
            start = math.sqrt(low * high) if self.scale == "log" else 0.5 * (low + high)
        return replace(self, lower=low * size, upper=high * size, start=start * size)


@dataclass(frozen=True, slots=True)
class Term:
    """A term: coefficients that are added to a law together."""

    name: str
    entries: tuple[FreeCoefficient, ...]
    needs: tuple[str, ...] = ()  # other terms that must be present
    starts: tuple[Mapping[str, float], ...] = field(default=())  # further start values, relative to the scale
    # Coefficients that become linear in temperature with this term, if the runs have several temperatures.
    linear_in_temperature: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Archetype:
    """A typical kind of damper, with whose terms and start values a search starts.

    An *alternative* has nearly the same forces at constant current as the previous archetype in the list.
    Only runs with changing current distinguish the two archetypes. The start of an alternative contains only
    the coefficients that differ.
    """

    terms: tuple[str, ...]
    start: Mapping[str, float]
    is_alternative: bool = False


_Free = FreeCoefficient

# The factors c0, k0, alpha and f0 of F = c0 v + k0 x + alpha z + f0 depend on the current (see the paper).
_PARALLEL = (
    _Free("viscosity", "polynomial", 0.0, 2.0),
    _Free("stiffness", "polynomial", 0.0, 1.0),
    _Free("offset", "polynomial", -1.0, 1.0),
    _Free("yield_force", "polynomial", 0.0, 2.0),
)
_PLAIN = (
    _PARALLEL[0],
    _Free("stiffness", "constant", 0.0, 1.0),
    _Free("offset", "line", -1.0, 1.0),
    _PARALLEL[3],
)
_RHO = _Free("rho", "constant", 0.5, 1e4, "log")
_LOOP = (_Free("kappa", "constant", -1.0, 0.95), _Free("n", "constant", 0.2, 8.0, "log"))
_SPENCER = (
    _Free("yield_force", "hill", 1e-4, 2.0, "log"),
    _Free("series_damping", "exponential", 0.1, 1e3, "log"),
    _Free("inner_viscosity", "exponential", 1e-3, 10.0, "log"),
    _Free("inner_stiffness", "constant", 0.0, 1.0),
    _RHO,
    *_LOOP,
    _Free("offset", "constant", -1.0, 1.0),
    _Free("stiffness", "constant", 0.0, 1.0),
)
_SERIES_VALVE = (
    _Free("yield_force", "hill", 1e-4, 2.0, "log"),
    _Free("thinning", "constant", 1e-3, 30.0, "log"),
    _Free("thinning_exponent", "constant", 0.1, 1.2),
    _Free("yield_velocity", "constant", 1e-4, 2.0, "log"),
    _Free("position_gain", "constant", -0.5, 0.5),
    _Free("gap_stiffness", "constant", 3.0, 3e5, "log"),
    _Free("gap", "constant", 1e-5, 0.2, "log"),
    _Free("gap_corner", "constant", 1e-5, 0.1, "log"),
    _Free("leak_damping", "constant", 1e-3, 1e3, "log"),
    _Free("leak_exponent", "constant", 0.5, 1.5),
    _Free("offset", "constant", -0.5, 0.5),
    _Free("stiffness", "constant", 0.0, 1.0),
)

_CHAIN = (
    _Free("yield_force", "saturation", 1e-4, 3.0, "log", 0.4),
    _Free("yield_velocity", "constant", 5e-4, 1.0, "log", 0.03),
    _Free("thinning", "constant", 1e-4, 30.0, "log", 0.3),
    _Free("thinning_exponent", "constant", 0.1, 1.0, start=0.6),
    _Free("reference_speed", "fixed", 1.0, 1.0, start=1.0),
    _Free("gap_stiffness", "constant", 0.3, 1e6, "log", 50.0),
    _Free("leak_damping", "constant", 1e-3, 1e5, "log", 10.0),
    _Free("gap", "constant", 1e-5, 0.5, "log", 0.02),
    _Free("gap_corner", "constant", 1e-5, 0.5, "log", 0.01),
    _Free("offset", "constant", -3.0, 3.0, start=0.0),
)

_BASES: Mapping[str, tuple[FreeCoefficient, ...]] = MappingProxyType(
    {
        "bouc-wen": (*_PARALLEL, _RHO, *_LOOP),
        "dahl": (*_PARALLEL, _RHO),
        "bouc-wen-saturating": (
            *_PLAIN,
            _Free("rate_force", "polynomial", 0.0, 2.0),
            _Free("saturation_velocity", "constant", 1e-3, 3.0, "log"),
            replace(_RHO, form="exponential"),
            *_LOOP,
        ),
        "double-bouc-wen": (
            *_PLAIN,
            _Free("second_force", "polynomial", 0.0, 2.0),
            replace(_RHO, form="exponential"),
            replace(_RHO, form="exponential", name="second_rho"),
            *_LOOP,
        ),
        "bingham": (*_PARALLEL, _Free("yield_velocity", "constant", 1e-4, 3.0, "log")),
        "tanh": (
            *_PARALLEL,
            _Free("slope", "constant", 0.1, 1e3, "log"),
            _Free("shift", "constant", -10.0, 10.0),
        ),
        "lugre": (
            *_PARALLEL,
            _RHO,
            _Free("static_excess", "constant", 0.0, 3.0),
            _Free("fade_velocity", "constant", 1e-3, 1.0, "log"),
            _Free("bristle_damping", "constant", 0.0, 2.0),
        ),
        "spencer": _SPENCER,
        "series-valve": _SERIES_VALVE,
        "chain": _CHAIN,
    }
)

_EVERY_LAW = (
    Term(
        "friction",
        (
            _Free("coulomb_friction", "constant", 0.0, 1.0),
            _Free("breakaway_friction", "constant", 0.0, 1.0),
            _Free("stribeck_velocity", "constant", 1e-3, 1.0, "log"),
            _Free("transition_velocity", "constant", 1e-4, 0.1, "log"),
        ),
    ),
    Term("mass", (_Free("mass", "constant", 0.0, 1.0),)),
    Term("viscosity", (_Free("viscosity", "constant", 0.0, 2.0),)),
    Term("thinning", (_Free("viscous_exponent", "constant", 0.2, 1.5),)),
    Term(
        "gas",
        (_Free("offset", "constant", -1.0, 1.0), _Free("stiffness", "constant", 0.0, 1.0)),
        linear_in_temperature=("offset", "stiffness"),
    ),
)
"""Terms that can be added to every law of the kernel without terms of its own."""

_CHAIN_TERMS = (
    Term("thinning", (_Free("thinning_force", "hill", 1e-5, 5.0, "log", 0.1),)),
    Term("creep", (_Free("creep", "constant", 1e-4, 3.0, "log", 0.03),)),
    Term("bypass", (_Free("bypass", "constant", 1e-4, 3.0, "log", 0.1),)),
    Term("knee", (_Free("knee", "constant", 0.0, 1.0, start=0.5),)),
    Term("viscosity", (_Free("viscosity", "constant", 0.0, 2.0, start=0.02),)),
    Term("mass", (_Free("mass", "constant", 0.0, 1.0, start=0.05),)),
    Term("orifice", (_Free("orifice", "constant", 0.0, 5.0, start=0.02),)),
    Term(
        "bristles",
        (
            _Free("bristle_share", "constant", 0.0, 1.0, start=0.5),
            _Free("bristle_stiffness", "exponential", 0.05, 1e5, "log", 20.0),
        ),
        starts=({"bristle_stiffness": 200.0}, {"bristle_share": 0.9, "bristle_stiffness": 50.0}),
    ),
    Term("spread", (_Free("bristle_spread", "constant", 0.0, 4.0, start=1.0),), needs=("bristles",)),
    Term(
        "friction",
        (
            _Free("friction_force", "constant", 1e-5, 2.0, "log", 0.03),
            _Free("friction_stiffness", "constant", 1e-3, 1e5, "log", 2.0),
        ),
        starts=({"friction_stiffness": 20.0}, {"friction_stiffness": 0.4}),
    ),
    Term(
        "stribeck",
        (
            _Free("static_excess", "constant", 0.0, 5.0, start=0.3),
            _Free("fade_velocity", "constant", 2e-3, 1.0, "log", 0.03),
        ),
        needs=("friction",),
    ),
    Term(
        "memory",
        (
            _Free("memory_force", "exponential", 1e-5, 5.0, "log", 0.01),
            _Free("memory_stiffness", "constant", 1e-4, 10.0, "log", 0.1),
        ),
        starts=({"memory_stiffness": 0.02},),
    ),
    Term("position", (_Free("position_gain", "constant", -1.0, 1.0, start=0.0),)),
    Term("curvature", (_Free("position_curvature", "constant", -1.0, 1.0, start=0.0),), needs=("position",)),
    Term("stiffness", (_Free("stiffness", "constant", -3.0, 3.0, start=0.0),)),
    Term("asymmetry", (_Free("asymmetry", "constant", -0.5, 0.5, start=0.0),)),
    Term("flow-asymmetry", (_Free("flow_asymmetry", "constant", -0.9, 0.9, start=0.0),)),
    Term(
        "gas",
        (_Free("stiffness", "constant", -3.0, 3.0, start=0.0),),
        linear_in_temperature=("offset", "stiffness"),
    ),
    Term(
        "gas-volume",
        (
            _Free("gas_force", "constant", -5.0, 5.0, start=-0.05),
            _Free("gas_length", "constant", 1.5, 300.0, "log", 5.0),
        ),
        linear_in_temperature=("gas_force",),
    ),
    Term(
        "cavity",
        (
            _Free("cavity_length", "constant", 1e-3, 50.0, "log", 1.0),
            _Free("cavity_force", "constant", 0.02, 10.0, "log", 0.7),
            _Free("bubble_length", "constant", 1e-7, 0.1, "log", 1e-3),
        ),
        linear_in_temperature=("cavity_force",),
    ),
    Term("leak", (_Free("leak_exponent", "constant", 0.3, 1.7, start=1.0),)),
    Term("play", (_Free("play", "constant", 0.0, 0.3, start=5e-3),), starts=({"play": 0.0},)),
    Term(FOLLOW_TERM, (_Free("follow_share", "constant", 0.0, 1.0, start=0.5),), needs=("bristles",)),
)

_ELASTIC_TERMS = ("bristles", "spread", "friction", "thinning")

_CHAIN_ARCHETYPES = (
    Archetype(("position", "friction"), {}),  # Free play and a viscoplastic valve.
    Archetype(  # A shear-thinning elastic fluid behind seals,
        _ELASTIC_TERMS,
        {
            "gap_stiffness": 1e4,
            "gap": 1e-3,
            "gap_corner": 1e-3,
            "leak_damping": 100.0,
            "bristle_share": 0.9,
            "bristle_stiffness": 50.0,
            "thinning": 1e-3,
            "thinning_force": 0.3,
        },
    ),
    Archetype(  # This archetype has a leakage flow.
        _ELASTIC_TERMS,
        {"gap_stiffness": 2.0, "gap": 1e-3, "gap_corner": 1e-3, "leak_damping": 40.0},
        is_alternative=True,
    ),
    Archetype(  # A gap with a fluid that creeps before it yields.
        ("viscosity", "creep", "bypass", "knee", "friction"), {"yield_velocity": 3e-3, "creep": 0.3}
    ),
)

_CHAIN_STARTS: tuple[Mapping[str, float], ...] = tuple(
    {
        "gap_stiffness": stiffness,
        "gap": gap,
        "gap_corner": corner,
        "leak_damping": leak,
        "yield_velocity": yield_velocity,
    }
    for stiffness, gap, corner, leak, yield_velocity in (
        (50.0, 0.02, 0.01, 10.0, 0.03),
        (400.0, 0.007, 0.002, 4.0, 0.015),
        (2e3, 0.002, 0.001, 4.0, 0.015),
        (200.0, 0.02, 0.004, 40.0, 0.06),
        (1e4, 0.001, 0.001, 400.0, 0.06),
    )
)


def starts_of(law: HysteresisLaw) -> tuple[Mapping[str, float], ...]:
    """Return start values of the base of a law; empty if random starts are sufficient."""
    return _CHAIN_STARTS if law.name == "chain" else ()


def archetypes_of(law: HysteresisLaw) -> tuple[Archetype, ...]:
    """Return the archetypes of a law, from which the search for terms starts."""
    return _CHAIN_ARCHETYPES if law.name == "chain" else ()


def base_of(law: HysteresisLaw) -> tuple[FreeCoefficient, ...]:
    """Return the coefficients of a law that are always fitted; a law in Python defines its bounds."""
    return _BASES[law.name] if law.kernel is not None else _base_of_python_law(law)


def terms_of(law: HysteresisLaw) -> dict[str, Term]:
    """Return the terms of a law by name; the terms that a term requires precede this term."""
    if law.kernel is None:
        return {}
    return {term.name: term for term in (_CHAIN_TERMS if law.name == "chain" else _EVERY_LAW)}


def _base_of_python_law(law: HysteresisLaw) -> tuple[FreeCoefficient, ...]:
    entries: list[FreeCoefficient] = []
    for c in law.coefficients:
        if not (np.isfinite(c.lower) and np.isfinite(c.upper)):
            raise InputError(
                place=law.name, found=f"coefficient {c.name} needs finite lower and upper bounds to be fitted"
            )
        wide = c.lower > 0.0 and c.upper / c.lower > 50.0
        form: Form = "polynomial" if c.linear else "constant"
        entries.append(_Free(c.name, form, c.lower, c.upper, "log" if wide else "linear"))
    return tuple(entries)
