"""Dampers for the controllers' tests: numbers like those of a rig damper, and one without lags.

And a controller or model some of whose configuration is another (``changed``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

from mrdamper.control.stepper import Stepper
from mrdamper.models.actuation import Actuation
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
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear

LAGS = Actuation(0.008, 0.0065, 0.003, 0.0035, largest_command=2.0, play=0.025)

_COMMON: dict[str, ParameterLaw] = {
    "viscosity": TemperatureDependent(Polynomial((7000.0, 700.0)), Arrhenius(1500.0)),
    "viscous_exponent": Constant(0.9),
    "stiffness": Constant(1400.0),
    "offset": Polynomial((6.0, 10.0)),
    "coulomb_friction": Bipolynomial((5.0, 0.01)),
    "breakaway_friction": Bipolynomial((6.0, -0.05)),
    "stribeck_velocity": Constant(0.014),
    "transition_velocity": Constant(8e-4),
}
_YIELD = Bipolynomial((40.0, 0.02, 400.0, -0.5, -60.0, -0.1))
_SECOND = Bipolynomial((7.0, -0.06, 300.0, -1.0, 40.0, 0.2))

DOUBLE = Damper(
    LAWS["double-bouc-wen"],
    {
        **_COMMON,
        "yield_force": _YIELD,
        "second_force": _SECOND,
        "rho": Exponential(16e3, 0.39),
        "second_rho": Exponential(5e3, -0.1),
        "kappa": Constant(-0.42),
        "n": Constant(0.57),
    },
    actuation=LAGS,
    temperature_range=(288.15, 398.15),
)
_TOTAL = Bipolynomial((47.0, -0.04, 700.0, -1.5, -20.0, 0.1))
DAMPERS = {
    "double-bouc-wen": DOUBLE,
    "bouc-wen": replace(
        DOUBLE,
        law=LAWS["bouc-wen"],
        coefficients={
            **_COMMON, "yield_force": _TOTAL, "rho": Exponential(9e3, 0.1), "kappa": Constant(-0.6),
            "n": Constant(1.3),
        },
    ),
    "dahl": replace(
        DOUBLE,
        law=LAWS["dahl"],
        coefficients={**_COMMON, "yield_force": _TOTAL, "rho": Exponential(9e3, 0.1)},
    ),
    "bouc-wen-saturating": replace(
        DOUBLE,
        law=LAWS["bouc-wen-saturating"],
        coefficients={
            **_COMMON, "yield_force": _YIELD, "rate_force": _SECOND, "saturation_velocity": Constant(0.01),
            "rho": Exponential(9e3, 0.1), "kappa": Constant(-0.6), "n": Constant(1.3),
        },
    ),
    "bingham": replace(
        DOUBLE,
        law=LAWS["bingham"],
        coefficients={**_COMMON, "yield_force": _TOTAL, "yield_velocity": Constant(2e-3)},
    ),
}  # fmt: skip


# Numbers like those that the law has on a rig damper and on a real one of half a millimetre of free play.
_SERIES: dict[str, ParameterLaw] = {
    "viscosity": TemperatureDependent(Constant(2500.0), Arrhenius(1500.0)),
    "viscous_exponent": Constant(0.9),
    "mass": Constant(0.4),
    "coulomb_friction": Constant(12.0),
    "breakaway_friction": Constant(8.0),
    "stribeck_velocity": Constant(8e-3),
    "transition_velocity": Constant(1e-3),
    "stiffness": Constant(1400.0),
    "offset": Constant(12.0),
    "yield_force": TemperatureDependent(Hill(60.0, 900.0, 1.3, 1.5, 2.0), Linear(1.4e-3)),
    "thinning": TemperatureDependent(Constant(2.5), Arrhenius(600.0)),
    "thinning_exponent": Constant(0.43),
    "yield_velocity": Constant(2.5e-3),
    "position_gain": Constant(-2.3),
    "gap_stiffness": Constant(1.2e7),
    "gap": Constant(1.67e-4),
    "gap_corner": Constant(4.6e-5),
    "leak_damping": TemperatureDependent(Constant(3e4), Arrhenius(1400.0)),
    "leak_exponent": Constant(0.95),
}
SERIES = Damper(LAWS["series-valve"], _SERIES, actuation=LAGS, temperature_range=(288.15, 398.15))


def at_once(damper: Damper) -> Damper:
    """Return the damper whose force follows the command without delay."""
    return replace(damper, actuation=Actuation(0.0, 0.0, largest_command=2.0))


_AnyStepper = TypeVar("_AnyStepper", bound=Stepper)


def changed(stepper: _AnyStepper, **values: object) -> _AnyStepper:
    """Return a controller or model some of whose values are others: ``inverse__margin=-1.0``."""
    config = stepper.config
    for name, value in values.items():
        part, _, field = name.partition("__")
        known: Any = getattr(config, part)
        config = replace(config, **{part: replace(known, **{field: value})})
    return replace(stepper, config=config)


# Every term of the chain is on; what follows the command is what a campaign's card has.
_CHAIN: dict[str, ParameterLaw] = {
    "viscosity": Constant(300.0),
    "mass": Constant(0.4),
    "offset": TemperatureDependent(Constant(30.0), Linear(1e-3)),
    "stiffness": Constant(900.0),
    "yield_force": TemperatureDependent(Hill(60.0, 1100.0, 1.3, 1.5, 2.0), Linear(1.4e-3)),
    "yield_velocity": Constant(6e-3),
    "thinning": Constant(0.3),
    "thinning_force": TemperatureDependent(Hill(250.0, 60.0, 1.0, 1.5, 2.0), Arrhenius(900.0)),
    "thinning_exponent": Constant(0.7),
    "reference_speed": Constant(0.1),
    "orifice": Constant(900.0),
    "asymmetry": Constant(0.04),
    "flow_asymmetry": Constant(0.1),
    "position_gain": Constant(-1.5),
    "position_curvature": Constant(100.0),
    "gap_stiffness": Constant(2e6),
    "gap": Constant(8e-5),
    "gap_corner": Constant(4e-5),
    "leak_damping": TemperatureDependent(Constant(1.5e4), Arrhenius(900.0)),
    "leak_exponent": Constant(0.9),
    "bristle_share": Constant(0.6),
    "bristle_stiffness": Exponential(1.5e6, 0.3),
    "bristle_spread": Constant(0.8),
    "friction_force": Constant(25.0),
    "friction_stiffness": Constant(3e5),
    "static_excess": Constant(0.3),
    "fade_velocity": Constant(5e-3),
    "memory_force": Exponential(10.0, 0.5),
    "memory_stiffness": Constant(5e3),
    "gas_force": TemperatureDependent(Constant(-60.0), Linear(1e-3)),
    "gas_length": Constant(0.08),
    "play": Constant(2e-5),
    "follow_share": Constant(0.3),
    "creep": TemperatureDependent(Constant(4e-6), Arrhenius(-900.0)),
    "knee": Constant(0.5),
    "bypass": Constant(3e-4),
}
CHAIN = Damper(LAWS["chain"], _CHAIN, actuation=LAGS, temperature_range=(288.15, 398.15))
