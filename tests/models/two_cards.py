"""Bingham cards to compare, whose figures are closed forms."""

from __future__ import annotations

from dataclasses import replace

from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Linear

ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.02, 0.02), (-0.2, 0.2))
WARM = replace(ENVELOPE, temperature=(293.15, 393.15))
ERRORS = {"yield_force.c0": 3.0, "yield_force.c1": 4.0, "viscosity.value": 30.0}


def a_damper(strength: float = 1.0, **changed: ParameterLaw) -> Damper:
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(900.0),
        "yield_force": Polynomial((60.0 * strength, 600.0 * strength)),
        "yield_velocity": Constant(1e-6),
        "offset": Constant(35.0),
        **changed,
    }
    return Damper(LAWS["bingham"], forms, actuation=Actuation(0.01, 0.02))


def a_card(
    damper: Damper, envelope: OperatingEnvelope = ENVELOPE, *, rmse: float = 6.0, title: str = "a"
) -> ModelCard:
    run = {"name": "run", "split": "training", "rmse_N": rmse, "nrmse_percent": 3.0}
    return ModelCard(
        title=title,
        damper=damper,
        envelope=envelope,
        evidence=Evidence(runs=(run,), method="varpro", cost=3.0, dataset_fingerprint="0"),
        standard_errors={name: error for name, error in ERRORS.items() if name in damper.parameters},
    )


def warm_damper(slope: float = 1e-3) -> Damper:
    return a_damper(yield_force=TemperatureDependent(Polynomial((60.0, 600.0)), Linear(slope)))
