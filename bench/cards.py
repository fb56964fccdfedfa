"""Cards for the benchmarks: of dampers that nobody measured."""

from __future__ import annotations

from pathlib import Path

from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial
from mrdamper.models.laws import LAWS

__all__ = ["card_of", "write_plain"]


def card_of(damper: Damper) -> ModelCard:
    """Return a card of a damper; of 15 to 125 degC when it depends on temperature."""
    warm = (288.15, 398.15) if damper.temperature_range is not None else None
    envelope = OperatingEnvelope((0.0, 2.0), (-0.025, 0.025), (-0.5, 0.5), warm)
    run = {"name": "nobody_measured_this", "split": "training", "rmse_N": 1.0, "nrmse_percent": 1.0}
    evidence = Evidence(runs=(run,), method="varpro", cost=1.0, dataset_fingerprint="0")
    return ModelCard(title="For the benchmarks", damper=damper, envelope=envelope, evidence=evidence)


def write_plain(folder: Path) -> Path:
    """Write the card of a damper of Bouc-Wen's law, commanded from 0 to 2 A; return its file."""
    forms: dict[str, ParameterLaw] = {
        "viscosity": Constant(900.0),
        "yield_force": Polynomial((60.0, 450.0)),
        "rho": Constant(1500.0),
        "kappa": Constant(-0.4),
        "n": Constant(1.6),
    }
    folder.mkdir(parents=True, exist_ok=True)
    write_card(card_of(Damper(LAWS["bouc-wen"], forms)), folder / "card.json")
    return folder / "card.json"
