"""Compare three controllers of a card at 20 and 100 degC: they track 900 N at 1 Hz without a force sensor.

python examples/controller_comparison.py CARD
"""

import sys
from dataclasses import replace

from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import run_loop
from mrdamper.control.scenario import SCENARIOS
from mrdamper.control.score import attainable_range, score_run
from mrdamper.models.card_schema import read_card
from mrdamper.virtual_rig.plant import PRESETS, Plant

made = controllers_for(read_card(sys.argv[1]))
plant = Plant(PRESETS["nominal"])
for degrees in (20.0, 100.0):
    scenario = replace(SCENARIOS["sine-900N-1Hz"], temperature_degC=degrees)
    for name in ("recommended", "paper", "paper-unaware"):
        run = run_loop(plant, made[name], scenario)
        score = score_run(run, attainable_range(plant, run.course, degrees, scenario.highest_A))
        print(f"{degrees:3.0f} degC {name:13} RMS {score.rmse_feasible_N:5.1f} N where it is feasible")
