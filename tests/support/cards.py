"""Cards and dampers for tests, without a fit.

``DAMPERS`` has one damper for each hysteresis law that a controller can use. ``rig_damper`` is about as
strong as the damper ``nominal`` of the virtual rig. ``card_of`` and ``write_card_of`` create cards.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mrdamper.control.stepper import Stepper
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.damper import Damper, OperatingEnvelope
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
from mrdamper.quantities import CommandUnit

ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.08, 0.08), (293.15, 393.15))
RUN = {"name": "nobody_measured_this", "split": "training", "rmse_N": 20.0, "nrmse_percent": 3.0}
TEMPERATURE_RANGE_K = (288.15, 398.15)
PAPER_DRAWING = Path(__file__).parents[2] / "examples" / "paper_damper.toml"
LAGS = Actuation(0.008, 0.0065, 0.003, 0.0035, largest_command=2.0, hysteresis_width_A=0.025)

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
    temperature_range=TEMPERATURE_RANGE_K,
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

# These coefficients are typical of a damper on a test rig, with 0.33 mm of free play.
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
SERIES = Damper(LAWS["series-valve"], _SERIES, actuation=LAGS, temperature_range=TEMPERATURE_RANGE_K)


# Every term of the chain is active.
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
CHAIN = Damper(LAWS["chain"], _CHAIN, actuation=LAGS, temperature_range=TEMPERATURE_RANGE_K)


def at_once(damper: Damper) -> Damper:
    """Return the same damper with a force that follows the command without delay."""
    return replace(damper, actuation=Actuation(0.0, 0.0, largest_command=2.0))


_YIELD_FORCES = ("yield_force", "second_force", "rate_force")


def passive(damper: Damper, *, yields: bool = True) -> Damper:
    """Return the damper with its force at zero current, optionally without yield force."""
    at_zero = dict(zip(damper.law.names, damper.coefficients_at(np.zeros(1))[:, 0], strict=True))
    forms: dict[str, ParameterLaw] = {}
    for name, form in damper.coefficients.items():
        constant = Constant(float(at_zero[name]) if yields or name not in _YIELD_FORCES else 0.0)
        forms[name] = constant
        if isinstance(form, TemperatureDependent):
            forms[name] = replace(form, form=constant)
    return replace(damper, coefficients=forms, actuation=None)


_AnyStepper = TypeVar("_AnyStepper", bound=Stepper)


def changed(stepper: _AnyStepper, **values: object) -> _AnyStepper:
    """Return a controller or model with changed settings, for example ``faults__fall_back=0.4``."""
    config = stepper.config
    for name, value in values.items():
        part, _, field = name.partition("__")
        known: Any = getattr(config, part)
        config = replace(config, **{part: replace(known, **{field: value})})
    return replace(stepper, config=config)


RIG_LAG = Actuation(0.008, 0.0063, 0.0031, 0.0036, resistance_20_ohm=5.0, largest_command=2.0)
RIG_ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.04, 0.04), (293.15, 393.15))


def rig_forms(force: float = 1.0) -> dict[str, ParameterLaw]:
    """Return the coefficients of a damper with ``force`` times the force of the rig's damper."""
    return {
        "viscosity": TemperatureDependent(Polynomial((6950.0 * force, 620.0 * force)), Arrhenius(1511.0)),
        "viscous_exponent": Constant(0.888),
        "stiffness": Constant(1420.0 * force),
        "offset": Constant(6.0 * force),
        "breakaway_friction": Constant(25.0 * force),
        "stribeck_velocity": Constant(0.0023),
        "transition_velocity": Constant(0.0038),
        "yield_force": TemperatureDependent(
            Hill(50.0 * force, 310.0 * force, 5.54, 0.6, reference=2.0), Linear(1.6e-3)
        ),
        "second_force": TemperatureDependent(
            Hill(0.0, 970.0 * force, 1.2, 1.93, reference=2.0), Linear(1.4e-3)
        ),
        "rho": Exponential(15e3, 0.466),
        "second_rho": Exponential(4808.0, -0.063),
        "kappa": Constant(-0.41),
        "n": Constant(0.566),
    }


def rig_damper(
    *, lag: Actuation | None = RIG_LAG, temperature_dependent: bool = True, force: float = 1.0
) -> Damper:
    """Return a damper with ``force`` times the force of the rig's damper, optionally only for 20 degC."""
    coefficients = {
        name: form if temperature_dependent or not isinstance(form, TemperatureDependent) else form.form
        for name, form in rig_forms(force).items()
    }
    return Damper(LAWS["double-bouc-wen"], coefficients, actuation=lag, temperature_range=TEMPERATURE_RANGE_K)


def heated_damper(
    *, unit: CommandUnit = "A", temperature_dependent: bool = True, assumed: bool = False
) -> Damper:
    """Return a Dahl damper that dissipates about 75 W at 15 mm, 1 Hz and 2 A (or 2 V)."""
    viscosity, force = Constant(3e3), Polynomial((60.0, 450.0))
    forms: dict[str, ParameterLaw] = {
        "viscosity": viscosity,
        "yield_force": force,
        "rho": Constant(4e3),
        "offset": Constant(0.0),
    }
    if temperature_dependent:
        forms["viscosity"] = TemperatureDependent(viscosity, Arrhenius(1435.5), assumed=assumed)
        forms["yield_force"] = TemperatureDependent(force, Linear(1.3e-3), assumed=assumed)
    return Damper(LAWS["dahl"], forms, command_unit=unit)


def card_of(
    damper: Damper, *, title: str = "For a test", envelope: OperatingEnvelope = ENVELOPE
) -> ModelCard:
    """Return a model card of a damper with invented results of a fit."""
    evidence = Evidence(runs=(RUN,), method="varpro", cost=3.0, dataset_fingerprint="sha256:0")
    return ModelCard(title=title, damper=damper, envelope=envelope, evidence=evidence)


def write_card_of(
    path: Path, damper: Damper | None = None, *, envelope: OperatingEnvelope = RIG_ENVELOPE
) -> Path:
    """Write a card of a damper, by default of ``rig_damper``, into a new folder; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_card(card_of(rig_damper() if damper is None else damper, envelope=envelope), path)
    return path


def write_heated_card(
    folder: Path,
    name: str = "card.json",
    *,
    unit: CommandUnit = "A",
    temperature_dependent: bool = True,
    assumed: bool = False,
) -> Path:
    """Write a card of ``heated_damper`` into a folder and return its path."""
    damper = heated_damper(unit=unit, temperature_dependent=temperature_dependent, assumed=assumed)
    warm = (293.15, 403.15) if temperature_dependent else None
    envelope = OperatingEnvelope((0.0, 2.0), (-0.015, 0.015), (-0.0943, 0.0943), warm)
    return write_card_of(folder / name, damper, envelope=envelope)
