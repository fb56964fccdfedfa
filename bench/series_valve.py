"""Controllers of series-valve cards beside those of double-bouc-wen cards: on the rig, on cards of real runs.

On the rig the damper is none of the laws. Of the real dampers there are only cards: each law is tracked on
its own card's damper and on the other's, at one temperature, behind an actuation that is assumed (the runs
hold their currents). There the damper that is a law's own flatters that law.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import mrdamper
from bench.measure import Row
from bench.tracking import in_words, measured
from mrdamper.control.card_plant import CardPlant
from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS
from mrdamper.control.score import attainable_range, score_run, worst
from mrdamper.models.actuation import Actuation
from mrdamper.models.card import ModelCard
from mrdamper.rig.campaign import Campaign
from mrdamper.rig.plant import PRESETS
from tests.acceptance.followed import TARGETS, followed

__all__ = ["run"]

LAWS = ("double-bouc-wen", "series-valve")
SHOWN = ("recommended", "recommended-causal", "series-inverse", "static-preview", "paper")
STARTS = 4
ASSUMED = Actuation(0.008, 0.0065, 0.003, 0.0035, largest_command=1.0)


def run() -> list[Row]:
    """Return the scores of both laws' controllers."""
    rows = [row for preset in ("nominal", "hard", "stiff") for row in _on_rig(preset)]
    folder = os.environ.get("MRDAMPER_DATA")
    return [*rows, *_on_cards(Path(folder))] if folder else rows


def _on_rig(preset: str) -> Iterable[Row]:
    runs = measured(PRESETS[preset], Campaign())
    for law in LAWS:
        fitted = mrdamper.fit(runs, law, hold_out=Campaign().hold_out, starts=STARTS)
        controllers = controllers_for(fitted.card())
        for name in SHOWN:
            for target in TARGETS if name in controllers else ():
                score = followed(PRESETS[preset], controllers[name], SCENARIOS[target])
                cost = f"; fit {fitted.result.cost_percent:.1f} %"
                yield Row(f"{preset}, {target}: {name} of {law}", accuracy=in_words(score) + cost)


def _on_cards(folder: Path) -> Iterable[Row]:
    runs = mrdamper.read_runs([str(folder / "dev" / "utfsm_sine_*.csv")])
    cards: dict[str, ModelCard] = {}
    for law in LAWS:
        card = mrdamper.fit(runs, law, starts=STARTS).card()
        cards[law] = replace(card, damper=replace(card.damper, actuation=ASSUMED, command_lag_s=0.0))
    for truth, other in cards.items():
        plant = CardPlant(other.damper, highest=1.0)
        for target in TARGETS:
            scenario = replace(SCENARIOS[target], highest_A=1.0, temperature_degC=20.0)
            reach = attainable_range(plant, reference_trajectory(scenario, plant.step_s), 20.0, 1.0)
            for law in LAWS:
                made = controllers_for(cards[law])
                for name in ("recommended", "series-inverse"):
                    if name not in made:
                        continue
                    each = [run_loop(plant, made[name], replace(scenario, seed=seed)) for seed in (1, 2)]
                    score = worst([score_run(one, reach) for one in each])
                    yield Row(f"UTFSM as {truth}, {target}: {name} of {law}", accuracy=in_words(score))
