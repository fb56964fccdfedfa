"""What it costs a controller to have the thermal model's temperature in place of a thermometer's.

``python -m tests.export.unheated`` prints it for the virtual rig's damper, heated for half an hour from cold.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import reference_trajectory, run_loop
from mrdamper.control.scenario import SCENARIOS
from mrdamper.control.score import attainable_range, score_run
from mrdamper.quantities import REFERENCE_K, ZERO_CELSIUS_K
from mrdamper.thermal.compact.model import compact_model
from mrdamper.thermal.compact.step import UPDATE_S, CompactLoad, simulate_compact
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.duty import read_duty
from mrdamper.thermal.temperature_rise import simulate_rise, works_of
from mrdamper.virtual_rig.plant import PRESETS, Plant
from tests.support.heated import paper_card

DUTY = "sine:15mm:1Hz:2A:1800s"
CURRENT_A, STEPS = 2.0, 3600


def rig_work() -> LoopWork:
    """Return the power of the rig's own damper under the duty, over temperature."""
    kelvin, watts = np.linspace(293.15, 403.15, 5), []
    for each in kelvin:
        plant = Plant(PRESETS["paper"])
        time = plant.step_s * np.arange(1, round(3.0 / plant.step_s) + 1)
        phase, last = 2.0 * np.pi * time, round(2.0 / plant.step_s)
        velocity = 0.015 * 2.0 * np.pi * np.cos(phase)
        force = plant.advance_many(0.015 * np.sin(phase), velocity, CURRENT_A, each - ZERO_CELSIUS_K)
        watts.append(float((force * velocity)[-last:].mean()))
    return LoopWork(kelvin, np.array(watts), np.array(watts))


def main() -> None:
    """Print the fluid's temperature by the model against the rig's, and the force error that it adds."""
    card, drawing, duty = paper_card(), read_drawing("paper").with_sink(None), read_duty(DUTY)
    truth = simulate_rise([rig_work()], drawing, duty)
    work, model = works_of(card.damper, duty)[0], compact_model(drawing)
    coil_W, room, still = (
        np.full(STEPS, each) for each in (model.resistance * CURRENT_A**2, REFERENCE_K, 0.0)
    )
    fluid = room
    for _ in range(6):  # power at the temperature that it leads to
        load = CompactLoad(work.power_at(fluid), coil_W, room, still)
        fluid = simulate_compact(model, load, start_K=REFERENCE_K).fluid
    rig = np.interp(UPDATE_S * np.arange(1, STEPS + 1), truth.time, truth.fluid)
    print(f"fluid off by at most {np.abs(fluid - rig).max():.3f} K on the way to {rig[-1] - 273.15:.1f} degC")
    for degrees in (20.0, 60.0, 100.0, 123.0):
        off = float((fluid - rig)[np.argmin(np.abs(rig - ZERO_CELSIUS_K - degrees))])
        for name in ("sine-900N-1Hz", "sine-1100N-2Hz", "non-periodic"):
            plant, scenario = Plant(PRESETS["paper"]), replace(SCENARIOS[name], temperature_degC=degrees)
            course = reference_trajectory(scenario, plant.step_s)
            reach = attainable_range(plant, course, degrees, CURRENT_A)
            rmse = []
            for offset in (0.0, off):
                seen = replace(scenario.sensors, temperature_offset_K=offset)
                run = run_loop(
                    plant, controllers_for(card)["recommended"], replace(scenario, sensors=seen), course
                )
                rmse.append(score_run(run, reach).rmse_feasible_N or 0.0)
            print(f"{degrees:.0f} degC {name}: {rmse[0]:.2f} N with a thermometer, {rmse[1] - rmse[0]:+.2f}")


if __name__ == "__main__":
    main()
