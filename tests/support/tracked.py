"""A card of a damper about as strong as the virtual rig's, for the tests of tracking; nothing is fitted."""

from __future__ import annotations

from pathlib import Path

from mrdamper.models.actuation import Actuation
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import (
    Constant,
    Exponential,
    Hill,
    ParameterLaw,
    Polynomial,
    TemperatureDependent,
)
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear

LAG = Actuation(0.008, 0.0063, 0.0031, 0.0036, resistance_20_ohm=5.0, largest_command=2.0)


def forms(force: float = 1.0) -> dict[str, ParameterLaw]:
    """Return the coefficients of a damper of ``force`` times the rig's force."""
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


RUN = {"name": "nobody_measured_this", "split": "training", "rmse_N": 20.0, "nrmse_percent": 3.0}


ENVELOPE = OperatingEnvelope((0.0, 2.0), (-0.012, 0.012), (-0.04, 0.04), (293.15, 393.15))


def a_damper(
    *, lag: Actuation | None = LAG, temperature_dependent: bool = True, force: float = 1.0
) -> Damper:
    """Return the damper; not ``temperature_dependent``: as if it had been identified at 20 degC alone."""
    found = {
        name: form if temperature_dependent or not isinstance(form, TemperatureDependent) else form.form
        for name, form in forms(force).items()
    }
    held = (288.15, 398.15)
    return Damper(LAWS["double-bouc-wen"], found, actuation=lag, temperature_range=held)


def write_a_card(path: Path, damper: Damper | None = None, *, envelope: OperatingEnvelope = ENVELOPE) -> Path:
    """Write a card of the damper, or of another."""
    card = ModelCard(
        title="Strong as the rig's",
        damper=a_damper() if damper is None else damper,
        envelope=envelope,
        evidence=Evidence(runs=(RUN,), method="varpro", cost=3.0, dataset_fingerprint="sha256:0"),
    )
    write_card(card, path)
    return path
