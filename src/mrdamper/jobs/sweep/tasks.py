"""What a worker does with a task: one function, importable in any process, JSON in and JSON out.

A result holds no time and no path of the worker, so that the same task gives the same result everywhere. A
fault of the input is a result, too; a fault of the program is raised.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import find_scenario
from mrdamper.control.score import attainable_range, score_run, worst
from mrdamper.errors import MrdamperError
from mrdamper.identify.assess import summary
from mrdamper.jobs.fit import fit, options_for
from mrdamper.jobs.inputs import read_dataset
from mrdamper.jobs.options import FitOptions, HeatsinkOptions
from mrdamper.jobs.sweep.plan import What
from mrdamper.jobs.thermal.heatsink import heatsink
from mrdamper.jobs.track import TEMPERATURES_DEGC
from mrdamper.models.card_schema import card_text, read_card
from mrdamper.quantities import ZERO_CELSIUS_K
from mrdamper.runtime.worker_process import Handler, Reply
from mrdamper.schema import Json, read_record
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.virtual_rig.damper import find_preset
from mrdamper.virtual_rig.plant import Plant


def task_handler() -> Handler:
    """Return what answers in a worker of this machine: a task is a question, its result the answer."""
    return lambda question: Reply(run_task(**question))


def run_task(kind: str, seed: int, what: What) -> What:
    """Return ``{"figures": numbers by name}``, ``card`` where one was identified, or ``{"error": why}``."""
    try:
        return _KINDS[kind](seed, **what)
    except MrdamperError as fault:
        return {"error": str(fault)}


def _fit(seed: int, *, path: str, law: str | None, channels: str | None, options: Json) -> What:
    """Return a campaign's figures and card."""
    dataset = read_dataset([path], None if channels is None else Path(channels))
    asked = read_record(FitOptions, options | {"seed": seed % 2**31}, path)
    fitted = fit(dataset, law, options=replace(options_for(dataset, asked), jobs=1))  # a worker a core
    judged = fitted.assessment
    figures: dict[str, float | None] = {}
    for split in ("training", "held_out"):
        errors = [error for error in judged.runs if error.split == split]
        if errors:
            figures |= {f"{split}_{name}": value for name, value in summary(errors).items()}
    figures |= {f"{each.name}": each.value for each in fitted.estimates}
    return {"figures": _plain(figures), "card": json.loads(card_text(fitted.card(judged)))}


def _tolerance(
    seed: int,
    *,
    card: str,
    plant: str,
    spread_percent: float,
    controller: str,
    targets: Sequence[str],
    temperatures_degC: Sequence[float],
    rate_Hz: float,
) -> What:
    """Return the tracking errors on one damper that is drawn around another."""
    known = read_card(card)
    damper = find_preset(plant).draw(np.random.default_rng(seed), spread_percent / 100.0)
    largest = min(damper.highest_A, known.envelope.command[1])
    made = controllers_for(known, period_s=1.0 / rate_Hz, largest=largest)[controller]
    rig = Plant(damper)
    figures: dict[str, float | None] = {}
    for target in targets:
        scores = []
        for degrees in temperatures_degC or TEMPERATURES_DEGC:
            scenario = replace(
                find_scenario(target), temperature_degC=degrees, highest_A=largest, seed=seed % 2**31
            )
            course = reference_trajectory(scenario, rig.step_s)
            reach = attainable_range(rig, course, degrees, largest)
            run = run_loop(rig, made, scenario, course)
            scores.append(score_run(run, reach, resistance_ohm=damper.coil_resistance_ohm(degrees)))
        score = worst(scores)
        figures |= {
            f"{target}_max_N": score.max_N,
            f"{target}_max_feasible_N": score.max_feasible_N,
            f"{target}_rmse_feasible_N": score.rmse_feasible_N,
            f"{target}_feasible_share": score.feasible_share,
        }
    return {"figures": _plain(figures)}


def _heatsink(_seed: int, *, card: str, damper: str, duty: str, options: Json) -> What:
    """Return the temperatures without fins, as drawn and with the best sink, and that sink."""
    asked = read_record(HeatsinkOptions, options, damper)
    run = heatsink(read_card(card), read_drawing(damper), read_duty(duty), asked)
    best = run.best.sink
    assert best is not None  # a search returns sinks
    return {
        "figures": _plain(
            {
                "bare_degC": run.bare.fluid - ZERO_CELSIUS_K,
                "reference_degC": run.reference.fluid - ZERO_CELSIUS_K,
                "best_degC": run.best.fluid - ZERO_CELSIUS_K,
                "best_mass_kg": run.best.mass,
                "best_fins": float(best.fins),
                "best_width_m": best.width,
                "best_thickness_m": best.thickness,
            }
        )
    }


def _plain(figures: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return figures as JSON has them: what is not finite is None."""
    return {
        name: None if value is None or not np.isfinite(value) else float(value)
        for name, value in figures.items()
    }


_KINDS: Mapping[str, Callable[..., What]] = {
    "fit": _fit,
    "tolerance": _tolerance,
    "heatsink": _heatsink,
}
