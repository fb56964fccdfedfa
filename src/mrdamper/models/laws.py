"""Hysteresis laws: coefficients of each law, their meaning, and the conditions for a well-posed law.

The C code of the hysteresis laws is in ``core/kernel``. This module contains the list of their coefficients.
``dependence`` describes how the coefficients depend on the command. ``identify.terms`` defines the range of a
coefficient in a fit.

Extension is positive, and a force that resists extension is positive. The force of every law is

    F = law(x, v, state) + mass a + c0 v |v / v0|^(m - 1)
        + [coulomb + breakaway exp(-(v / v_s)^2)] tanh(v / v_t)

The first term depends on the hysteresis law. Friction and mass are zero by default. The viscous exponent m is
1 by default. ``viscosity`` c0 is the viscous force divided by the speed, at v0 = 0.1 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol, runtime_checkable

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.errors import InputError
from mrdamper.schema import unknown_name

VISCOUS_SPEED = 0.1
"""Speed [m/s] at which ``viscosity`` equals viscous force / speed. The name in C is ``MRD_VISCOUS_SPEED``."""


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A coefficient of a hysteresis law, with its limits.

    ``linear`` is True if the force is linear in the coefficient. A fit then computes the coefficient by
    linear least squares. A coefficient without default value (None) is required.
    """

    name: str
    unit: str
    description: str
    linear: bool
    lower: float = -math.inf
    upper: float = math.inf
    default: float | None = None


@runtime_checkable
class PythonLaw(Protocol):
    """A user-defined law in Python with one internal state, its time derivative ``rate``, and ``force``.

    The slow, adaptive reference integrator simulates the law in every job except export. ``values`` contains
    the coefficients at the effective command, by name.
    """

    @property
    def name(self) -> str: ...
    @property
    def coefficients(self) -> tuple[Coefficient, ...]: ...

    def rate(self, state: float, displacement: float, velocity: float, values: Mapping[str, float]) -> float:
        """Return the time derivative of the internal state [state unit / s]."""
        ...

    def force(self, state: float, displacement: float, velocity: float, values: Mapping[str, float]) -> float:
        """Return the damper force [N]."""
        ...


@dataclass(frozen=True, slots=True)
class HysteresisLaw:
    """A hysteresis law: name, coefficients in the order of the kernel, and conditions in words.

    ``kernel`` is the number of the hysteresis law in the C kernel. It is None for a user-defined law, which
    is in ``python``.
    """

    name: str
    title: str
    coefficients: tuple[Coefficient, ...]
    conditions: str
    kernel: int | None
    python: PythonLaw | None = None
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(c.name for c in self.coefficients))
        if (self.kernel is None) == (self.python is None):
            raise InputError(place=f"law {self.name!r}", found="give either a kernel number or a Python law")

    def __getitem__(self, name: str) -> Coefficient:
        if name not in self.names:
            raise unknown_name(f"law {self.name!r} has no coefficient {name!r}", name, self.names)
        return self.coefficients[self.names.index(name)]

    def violations(self, values: Mapping[str, FloatArray | float]) -> tuple[str, ...]:
        """Return one sentence for each coefficient outside its range."""
        found = []
        for name, value in values.items():
            coefficient = self[name]
            array = np.atleast_1d(np.asarray(value, dtype=np.float64))
            bad = ~((array >= coefficient.lower) & (array <= coefficient.upper))
            if bad.any():
                found.append(
                    f"{self.name}: {name} is {array[bad][0]:g} {coefficient.unit}; the law is well posed for "
                    f"{coefficient.lower:g} to {coefficient.upper:g} {coefficient.unit}"
                )
        return tuple(found)


_RHO = Coefficient(
    "rho", "1/m", "inverse of the displacement at which the hysteresis yields", False, 1e-2, 1e8
)
_KAPPA = Coefficient(
    "kappa", "-", "shape of the unloading branch: (gamma - beta)/(gamma + beta)", False, -1.0, 1.0
)
_EXPONENT = Coefficient("n", "-", "sharpness of the transition to yielding", False, 0.2, 20.0)
_YIELD = Coefficient("yield_force", "N", "force of the hysteretic part when it yields", True, 0.0)

COMMON: tuple[Coefficient, ...] = (
    Coefficient("viscosity", "N s/m", "viscous force divided by speed, at 0.1 m/s", True, 0.0, default=0.0),
    Coefficient("stiffness", "N/m", "stiffness of the spring (gas, seals)", True, 0.0, default=0.0),
    Coefficient("offset", "N", "constant force (gas preload)", True, default=0.0),
    Coefficient("mass", "kg", "moving mass between damper and load cell", True, 0.0, default=0.0),
    Coefficient("coulomb_friction", "N", "kinetic friction of seals and guides", True, 0.0, default=0.0),
    Coefficient("breakaway_friction", "N", "static minus kinetic friction force", True, 0.0, default=0.0),
    Coefficient(
        "stribeck_velocity", "m/s", "speed at which breakaway_friction falls to 37 %", False, 1e-6, 10.0, 3e-3
    ),
    Coefficient(
        "transition_velocity", "m/s", "speed at which friction reaches 76 %", False, 1e-7, 10.0, 5e-4
    ),
    Coefficient("viscous_exponent", "-", "exponent of the speed in the viscous force", False, 0.05, 2.0, 1.0),
)
"""Coefficients that every law of the kernel has, in the order of the kernel."""

# Spring and preload act inside the series connection of the law. Therefore the force is not linear in these
# coefficients.
_IN_CHAIN: tuple[Coefficient, ...] = tuple(
    replace(c, linear=False) if c.name in ("stiffness", "offset") else c for c in COMMON
)

_COMPLIANCE: tuple[Coefficient, ...] = (
    Coefficient("gap_stiffness", "N/m", "stiffness of the spring outside the free play", False, 1.0, 1e12),
    Coefficient("gap", "m", "half width of the free play", False, 0.0, 1.0),
    Coefficient("gap_corner", "m", "rounding radius of the corners of the free play", False, 1e-9, 1.0),
    Coefficient("leak_damping", "N (s/m)^mB", "dashpot parallel to spring and free play", False, 0.0, 1e12),
    Coefficient("leak_exponent", "-", "exponent of the speed in the dashpot force", False, 0.2, 2.0, 1.0),
)
"""Coefficients of the elastic element of the laws in series.

The element is free play in series with a spring, and a dashpot in parallel with both.
"""


def _term(
    name: str, unit: str, description: str, default: float, lower: float = 0.0, upper: float = math.inf
) -> Coefficient:
    """Return an optional coefficient of the law ``chain``. Its default value disables its effect."""
    return Coefficient(name, unit, description, False, lower, upper, default)


_CHAIN: tuple[Coefficient, ...] = (
    *(replace(c, lower=-math.inf) if c.name == "stiffness" else c for c in _IN_CHAIN),
    Coefficient("yield_force", "N", "yield force of the valve", False, 0.0),
    Coefficient("yield_velocity", "m/s", "speed scale at which the fluid yields", False, 1e-9, 10.0),
    _term("thinning", "-", "shear-thinning force divided by yield force, at the reference speed", 0.0),
    _term("thinning_force", "N", "constant part of the shear-thinning force, at the reference speed", 0.0),
    _term("thinning_exponent", "-", "exponent of speed in both thinning forces", 0.6, 0.05, 2.0),
    _term(
        "reference_speed", "m/s", "reference speed of shear thinning and dashpot", VISCOUS_SPEED, 1e-9, 1e3
    ),
    _term("orifice", "N s^2/m^2", "orifice force divided by the square of the speed", 0.0),
    _term("asymmetry", "-", "yield force in extension / mean of both directions, minus one", 0.0, -0.5, 0.5),
    _term("flow_asymmetry", "-", "resistance of flow paths in extension / mean, minus one", 0.0, -0.9, 0.9),
    _term("position_gain", "1/m", "relative increase of the valve force per displacement", 0.0, -math.inf),
    _term(
        "position_curvature", "1/m^2", "relative increase of valve force per displacement^2", 0.0, -math.inf
    ),
    *(
        replace(c, lower=1e-6)
        if c.name == "gap_stiffness"
        else replace(c, lower=1e-12, default=1e-4)
        if c.name == "gap_corner"
        else replace(c, default=0.0)
        if c.name == "gap"
        else c
        for c in _COMPLIANCE
    ),
    _term("bristle_share", "-", "fraction of the yield force that elastic bristles carry", 0.0, 0.0, 1.0),
    _term("bristle_stiffness", "N/m", "stiffness of the first elastic bristle", 1e6),
    _term("bristle_spread", "-", "logarithm of the stiffness ratio of elastic bristles", 0.0, 0.0, 10.0),
    _term("friction_force", "N", "kinetic friction force of the friction bristle", 0.0),
    _term("friction_stiffness", "N/m", "stiffness of the friction bristle", 1e6),
    _term("static_excess", "-", "static friction divided by kinetic friction, minus one", 0.0, 0.0, 1e2),
    _term("fade_velocity", "m/s", "speed at which static_excess falls to 37 %", 1e-3, 1e-9, 10.0),
    _term("memory_force", "N", "largest force of the memory bristle, which slips after long travel", 0.0),
    _term("memory_stiffness", "N/m", "stiffness of the memory bristle", 1e4),
    _term("gas_force", "N", "force of a gas volume at zero displacement", 0.0, -math.inf),
    _term("gas_length", "m", "length of this gas volume at zero displacement", 1.0, 1e-9),
    _term("play", "m", "half width of a free play in series with the whole damper", 0.0, 0.0, 1.0),
    _term("follow_share", "-", "fraction of bristle force that follows the current at once", 0.0, 0.0, 1.0),
    _term("creep", "m/(N s)", "increase of the yield velocity per yield force", 0.0),
    _term("knee", "-", "fraction of yield_force that rises linearly with speed, to a corner", 0.0, 0.0, 1.0),
    _term("cavity_length", "m", "length of the gas charge; a cavity can open in retraction", 0.0),
    _term("cavity_force", "N", "force of the gas charge; a larger force opens the cavity", 1e3, 1e-6),
    _term("bubble_length", "m", "length of the free gas in the cavity at rest", 1e-5, 1e-12),
    _term("bypass", "m/(s N^0.5)", "speed of the flow past the valve / root of the force", 0.0),
)

_LAWS = (
    HysteresisLaw(
        "bouc-wen",
        "Bouc-Wen, normalised",
        (*COMMON, _YIELD, _RHO, _KAPPA, _EXPONENT),
        "rho > 0, -1 <= kappa <= 1, n >= 0.2: bounded (|w| <= 1) and unique; kappa <= 0 keeps the loop's "
        "unloading at least as steep as its loading; passive for yield_force, viscosity >= 0",
        0,
    ),
    HysteresisLaw(
        "dahl",
        "viscous and Dahl",
        (*COMMON, _YIELD, _RHO),
        "rho > 0; the Bouc-Wen law with kappa = -1 and n = 1; passive for yield_force, viscosity >= 0",
        1,
    ),
    HysteresisLaw(
        "bouc-wen-saturating",
        "Bouc-Wen with a force that saturates in velocity",
        (
            *COMMON,
            _YIELD,
            Coefficient("rate_force", "N", "hysteretic force that builds up with speed", True, 0.0),
            Coefficient(
                "saturation_velocity", "m/s", "speed at which half of rate_force acts", False, 1e-6, 1e2
            ),
            _RHO,
            _KAPPA,
            _EXPONENT,
        ),
        "as bouc-wen, saturation_velocity > 0; passive for yield_force + rate_force >= 0 and viscosity >= 0",
        2,
    ),
    HysteresisLaw(
        "double-bouc-wen",
        "two Bouc-Wen elements in parallel",
        (
            *COMMON,
            _YIELD,
            Coefficient("second_force", "N", "force of the second, slower hysteretic part", True, 0.0),
            _RHO,
            replace(_RHO, name="second_rho", description="as rho, for the second part"),
            _KAPPA,
            _EXPONENT,
        ),
        "as bouc-wen, second_rho > 0; passive for yield_force, second_force, viscosity >= 0",
        8,
    ),
    HysteresisLaw(
        "bingham",
        "Bingham, regularised",
        (
            *COMMON,
            _YIELD,
            Coefficient("yield_velocity", "m/s", "speed at which 76 % of yield_force act", False, 1e-7, 10.0),
        ),
        "yield_velocity > 0; passive for yield_force, viscosity >= 0; no hysteresis",
        3,
    ),
    HysteresisLaw(
        "tanh",
        "hyperbolic tangent (Kwok)",
        (
            *COMMON,
            _YIELD,
            Coefficient("slope", "s/m", "steepness of the yield force versus velocity", False, 1e-3, 1e6),
            Coefficient("shift", "-", "shift of the curve by the sign of displacement", False, -20.0, 20.0),
        ),
        "slope > 0, yield_force, viscosity >= 0; with shift != 0 it can push for a moment near zero "
        "velocity, though a closed cycle about x = 0 takes work",
        4,
    ),
    HysteresisLaw(
        "lugre",
        "LuGre friction (bristles)",
        (
            *COMMON,
            _YIELD,
            _RHO,
            Coefficient("static_excess", "-", "static / kinetic yield force, minus one", False, 0.0, 1e2),
            Coefficient(
                "fade_velocity", "m/s", "speed at which static_excess falls to 37 %", False, 1e-6, 10.0
            ),
            Coefficient("bristle_damping", "N s/m", "damping of the bristle deflection", True, 0.0),
        ),
        "rho > 0, static_excess >= 0: bounded (|w| <= 1 + static_excess) and unique; passive for "
        "yield_force, bristle_damping >= 0 and viscosity >= static_excess bristle_damping (enough)",
        5,
    ),
    HysteresisLaw(
        "spencer",
        "modified Bouc-Wen (Spencer)",
        (
            *COMMON,
            replace(_YIELD, linear=False),
            Coefficient(
                "series_damping", "N s/m", "dashpot in series with the hysteresis", False, 1e-3, 1e12
            ),
            Coefficient("inner_viscosity", "N s/m", "dashpot parallel to the hysteresis", False, 0.0, 1e12),
            Coefficient("inner_stiffness", "N/m", "spring parallel to the hysteresis", False, 0.0, 1e12),
            _RHO,
            _KAPPA,
            _EXPONENT,
        ),
        "as bouc-wen, series_damping > 0; passive for yield_force, inner_viscosity, inner_stiffness >= 0",
        6,
    ),
    HysteresisLaw(
        "series-valve",
        "MR valve in series with free play and compliance",
        (
            *_IN_CHAIN,
            Coefficient("yield_force", "N", "yield force of the valve", False, 0.0),
            Coefficient(
                "thinning", "(s/m)^m", "shear-thinning force divided by yield force at 1 m/s", False, 0.0, 1e4
            ),
            Coefficient(
                "thinning_exponent", "-", "exponent of speed in the thinning force", False, 0.05, 1.5
            ),
            Coefficient("yield_velocity", "m/s", "speed at which 76 % of yield_force act", False, 1e-7, 10.0),
            Coefficient(
                "position_gain", "1/m", "relative increase of the valve force per displacement", False
            ),
            *_COMPLIANCE,
        ),
        "yield_force, thinning, leak_damping >= 0, 1 + position_gain x > 0 over the stroke: then passive by "
        "construction (a potential, a dashpot and a valve that opposes its own velocity)",
        7,
    ),
    HysteresisLaw(
        "chain",
        "elasticity and free play in series with a valve, bristles, gas",
        _CHAIN,
        "yield_force, thinning, leak_damping >= 0: passive at constant current and temperature by "
        "construction (potentials, dashpots, a valve that opposes its own velocity, bristles that store "
        "f^2/(2 stiffness)); with follow_share = 0 while the current changes, too, if bristle_stiffness is "
        "constant",
        9,
    ),
)

LAWS: Mapping[str, HysteresisLaw] = MappingProxyType({law.name: law for law in _LAWS})
"""The laws of the kernel, by name."""


def find_law(name: str) -> HysteresisLaw:
    """Return the law with a given name.

    Raises
    ------
    InputError
        If there is no such law; the message lists all laws.
    """
    if name in LAWS:
        return LAWS[name]
    raise unknown_name(f"there is no hysteresis law {name!r}", name, LAWS)
