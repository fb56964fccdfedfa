"""Cards for the tests of heating: one identified on the virtual rig's preset ``paper``, and simple ones."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from mrdamper.data.records import Dataset
from mrdamper.identify.fit import fit_law
from mrdamper.identify.fit_data import FitData
from mrdamper.models.card import Evidence, ModelCard
from mrdamper.models.card_schema import write_card
from mrdamper.models.damper import Damper, OperatingEnvelope
from mrdamper.models.dependence import Constant, ParameterLaw, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius, Linear
from mrdamper.quantities import CommandUnit
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import DEFAULT_DUTY, Duty, read_duty
from mrdamper.thermal.temperature_rise import Model, Rise, notes_of, simulate_rise, works_of
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure_run
from mrdamper.virtual_rig.plant import PRESETS

DRAWING = Path(__file__).parents[2] / "examples" / "paper_damper.toml"

# The motions of the paper's heating and hysteresis tests. A random motion would make the law represent the
# slow rise of the yield force as a viscous force that grows with current. The loss of peak force
# would be half a percentage point too large (docs/thermal.md).
CAMPAIGN = Campaign(
    motions=("sine15mm1Hz", "sine5mm1Hz"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 45.0, 75.0, 105.0, 130.0),
    steps=None,
)


@cache
def paper_card() -> ModelCard:
    """Return the card that a campaign on the rig's preset leads to: two seconds."""
    damper = PRESETS["paper"]
    runs = tuple(measure_run(damper, plan, CAMPAIGN, seed=1)[0] for plan in CAMPAIGN.runs(damper.name))
    return fit_law(FitData.prepare(Dataset(runs))).card()


def plain_card(
    folder: Path,
    name: str = "card.json",
    *,
    unit: CommandUnit = "A",
    temperature_dependent: bool = True,
    assumed: bool = False,
) -> Path:
    """Write the card of a Dahl damper of some 75 W at 15 mm, 1 Hz and 2 A (or 2 V); return its path."""
    viscosity, force = Constant(3e3), Polynomial((60.0, 450.0))
    forms: dict[str, ParameterLaw] = {
        "viscosity": TemperatureDependent(viscosity, Arrhenius(1435.5), assumed=assumed)
        if temperature_dependent
        else viscosity,
        "yield_force": TemperatureDependent(force, Linear(1.3e-3), assumed=assumed)
        if temperature_dependent
        else force,
        "rho": Constant(4e3),
        "offset": Constant(0.0),
    }
    card = ModelCard(
        title="plain",
        damper=Damper(LAWS["dahl"], forms, command_unit=unit),
        envelope=OperatingEnvelope(
            (0.0, 2.0),
            (-0.015, 0.015),
            (-0.0943, 0.0943),
            (293.15, 403.15) if temperature_dependent else None,
        ),
        evidence=Evidence(
            runs=({"name": "a", "split": "training", "rmse_N": 1.0, "nrmse_percent": 1.0},),
            method="varpro",
            cost=1.0,
            dataset_fingerprint="0",
        ),
    )
    write_card(card, folder / name)
    return folder / name


def predict_rise(
    card: ModelCard | Damper,
    drawing: DamperDrawing,
    duty: Duty | str = DEFAULT_DUTY,
    *,
    model: Model = "reduced",
    stop_at_limit: bool = True,
    longest_step: float = 60.0,
) -> Rise:
    """Return how a damper heats under a duty from ambient temperature on, with the card's notes."""
    damper = card.damper if isinstance(card, ModelCard) else card
    plan = duty if isinstance(duty, Duty) else read_duty(duty)
    found = simulate_rise(
        works_of(damper, plan),
        drawing,
        plan,
        model=model,
        stop_at_limit=stop_at_limit,
        longest_step=longest_step,
    )
    return replace(found, notes=(*notes_of(card, plan), *found.notes))
