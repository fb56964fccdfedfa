"""Cards for the benchmarks: of dampers that nobody measured."""

from __future__ import annotations

from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.damper import Damper, OperatingEnvelope

__all__ = ["card_of"]


def card_of(damper: Damper) -> ModelCard:
    """Return a card of a damper; of 15 to 125 degC when it depends on temperature."""
    warm = (288.15, 398.15) if damper.temperature_range is not None else None
    envelope = OperatingEnvelope((0.0, 2.0), (-0.025, 0.025), (-0.5, 0.5), warm)
    run = {"name": "nobody_measured_this", "split": "training", "rmse_N": 1.0, "nrmse_percent": 1.0}
    evidence = Evidence(runs=(run,), method="varpro", cost=1.0, dataset_fingerprint="0")
    return ModelCard(title="For the benchmarks", damper=damper, envelope=envelope, evidence=evidence)
