"""Tables of the fitted coefficients of each law, with bounds and start values, grouped into terms.

A law has a *base*, whose coefficients are always fitted, and optional *terms*, which are groups of further
coefficients. Bounds and start values are divided by a typical value of the runs (``Scale``) that has the unit
of the coefficient: forces by the typical force, lengths by the stroke. Therefore the same tables are used for
a damper of 20 N and for a damper of 200 kN. The bounds cover two to six decades. A coefficient without an
entry keeps the default value of the law.
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
"""Name of the term that can be identified only from runs with changing current."""

ACCELERATION_MIN_m_s2 = 100.0
"""The upper bound of the moving mass is the typical force divided by this acceleration.

A larger apparent mass is not physical. It is caused by a time lag of the force signal.
"""

Form = Literal["fixed", "constant", "line", "polynomial", "exponential", "hill", "saturation"]


@dataclass(frozen=True, slots=True)
class Scale:
    """Typical force, stroke, speed and command of the runs, which scale the search bounds."""

    force: float  # 99.5th percentile of |F| over all runs [N]
    stroke: float  # maximum of |x| [m]
    speed: float  # 99.5th percentile of |v| of the fastest run [m/s]
    acceleration: float  # largest 99.5th percentile of |a| of a run [m/s^2]
    command: float  # maximum of |command| [A or V]
    levels: int  # number of different constant commands; at least 4 if a command changes during a run
    temperatures: tuple[float, ...]  # different temperatures [K]; empty unless all runs have a temperature

    def size_of(self, unit: str) -> float:
        """Return the typical value of a coefficient that has the given unit, in this unit."""
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
    """A coefficient with its dependence on current (``form``), its bounds and its start value.

    All values are divided by the typical value of the coefficient (``Scale``). A coefficient with the form
    ``fixed`` keeps its start value. Without ``start``, the start value is the middle of the bounds.
    """

    name: str
    form: Form
    lower: float
    upper: float
    scale: Literal["linear", "log"] = "linear"
    start: float | None = None

    def scaled(self, size: float) -> FreeCoefficient:
        """Return the coefficient with bounds and start value multiplied by the typical value ``size``."""
        low, high, start = self.lower, self.upper, self.start
        if start is None:
            start = math.sqrt(low * high) if self.scale == "log" else 0.5 * (low + high)
        return replace(self, lower=low * size, upper=high * size, start=start * size)


@dataclass(frozen=True, slots=True)
class Term:
    """A group of coefficients that are added to a law together."""

    name: str
    entries: tuple[FreeCoefficient, ...]
    needs: tuple[str, ...] = ()  # names of the terms that this term requires
    # Further start values by name of the coefficient, divided by the typical value of the coefficient.
    starts: tuple[Mapping[str, float], ...] = field(default=())
    # Coefficients that become linear in temperature with this term, if the runs have several temperatures.
    linear_in_temperature: tuple[str, ...] = ()
    # Terms with the same effect have similar forces. A round of the forward selection fits only one of them.
    effect: str = ""


@dataclass(frozen=True, slots=True)
class Archetype:
    """Terms (groups of coefficients) and start values that are typical of one kind of damper.

    ``alternative`` contains different start values of some coefficients. They lead to a damper with nearly
    the same forces at constant current. Only runs with changing current distinguish the two dampers.
    """

    terms: tuple[str, ...]
    start: Mapping[str, float]
    alternative: Mapping[str, float] = field(default_factory=dict)


_Free = FreeCoefficient

# The factors c0, k0, alpha and f0 of F = c0 v + k0 x + alpha z + f0 depend on the current (see the reference
# paper).
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
        "spencer": (
            _Free("yield_force", "hill", 1e-4, 2.0, "log"),
            _Free("series_damping", "exponential", 0.1, 1e3, "log"),
            _Free("inner_viscosity", "exponential", 1e-3, 10.0, "log"),
            _Free("inner_stiffness", "constant", 0.0, 1.0),
            _RHO,
            *_LOOP,
            _Free("offset", "constant", -1.0, 1.0),
            _Free("stiffness", "constant", 0.0, 1.0),
        ),
        "series-valve": (
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
        ),
        "chain": (
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
        ),
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
"""Terms of all laws of the kernel except ``chain``, which has its own terms."""

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
    Term("stiffness", (_Free("stiffness", "constant", -3.0, 3.0, start=0.0),), effect="spring"),
    Term("asymmetry", (_Free("asymmetry", "constant", -0.5, 0.5, start=0.0),)),
    Term("flow-asymmetry", (_Free("flow_asymmetry", "constant", -0.9, 0.9, start=0.0),)),
    Term(
        "gas",
        (_Free("stiffness", "constant", -3.0, 3.0, start=0.0),),
        linear_in_temperature=("offset", "stiffness"),
        effect="spring",
    ),
    Term(
        "gas-volume",
        (
            _Free("gas_force", "constant", -5.0, 5.0, start=-0.05),
            _Free("gas_length", "constant", 1.5, 300.0, "log", 5.0),
        ),
        linear_in_temperature=("gas_force",),
        effect="spring",
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

_CHAIN_ARCHETYPES = (
    Archetype(("position", "friction"), {}),  # Damper with free play and a viscoplastic valve.
    # Damper with a shear-thinning elastic fluid and seal friction. The alternative has more leakage, but is
    # less stiff in the gap.
    Archetype(
        ("bristles", "spread", "friction", "thinning"),
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
        alternative={"gap_stiffness": 2.0, "gap": 1e-3, "gap_corner": 1e-3, "leak_damping": 40.0},
    ),
    Archetype(  # Damper with a fluid that creeps in the gap before it yields.
        ("viscosity", "creep", "bypass", "knee", "friction"), {"yield_velocity": 3e-3, "creep": 0.3}
    ),
)

BASE_STARTS: tuple[Mapping[str, float], ...] = tuple(
    dict(zip(("gap_stiffness", "gap", "gap_corner", "leak_damping", "yield_velocity"), values, strict=True))
    for values in (
        (50.0, 0.02, 0.01, 10.0, 0.03),
        (400.0, 0.007, 0.002, 4.0, 0.015),
        (2e3, 0.002, 0.001, 4.0, 0.015),
        (200.0, 0.02, 0.004, 40.0, 0.06),
        (1e4, 0.001, 0.001, 400.0, 0.06),
    )
)
"""Start values of base coefficients of ``chain``. Each set is combined with each archetype."""


def archetypes_of(law: HysteresisLaw) -> tuple[Archetype, ...]:
    """Return the typical sets of terms with which the selection for a law starts; empty for most laws."""
    return _CHAIN_ARCHETYPES if law.name == "chain" else ()


def base_of(law: HysteresisLaw) -> tuple[FreeCoefficient, ...]:
    """Return the coefficients of a law that are always fitted. A law of the user defines their bounds."""
    if law.kernel is not None:
        return _BASES[law.name]
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


def terms_of(law: HysteresisLaw) -> dict[str, Term]:
    """Return the terms of a law by name, ordered so that required terms precede the terms that need them."""
    if law.kernel is None:
        return {}
    return {term.name: term for term in (_CHAIN_TERMS if law.name == "chain" else _EVERY_LAW)}
