"""Draw README's picture: loops at a temperature that was not fitted, heating, force tracking. Virtual rig.

python docs/pictures/overview.py    (writes overview.svg next to this file; 10 s of CPU)
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

import mrdamper
from mrdamper.control.controllers import controllers_for
from mrdamper.control.loop import run_loop
from mrdamper.control.scenario import SCENARIOS
from mrdamper.models.simulate import simulate
from mrdamper.thermal.drawing_file import read_drawing
from mrdamper.thermal.heatsink import HeatSink
from mrdamper.virtual_rig.campaign import Campaign
from mrdamper.virtual_rig.measurement import measure
from mrdamper.virtual_rig.plant import PRESETS, Plant

MEASURED, MODEL = "#9aa5b1", "#c2410c"
COLD, WARM, COOL = "#1d4e89", "#c2410c", "#2f855a"

mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "mrdamper", "font.size": 9, "axes.grid": True})
mpl.rcParams.update({"grid.alpha": 0.25, "axes.spines.top": False, "axes.spines.right": False})

tests = Campaign(
    motions=("sine15mm1Hz", "sine5mm1Hz", "sine3mm2Hz", "nonperiodic"),
    currents_A=(0.0, 1.0, 2.0),
    temperatures_degC=(20.0, 60.0, 100.0, 120.0),
    held_out_temperatures_degC=(60.0,),
    held_out_motions=(),
)
runs = [run for run, _ in measure(PRESETS["nominal"], tests)]
fitted = mrdamper.fit(runs, hold_out=tests.hold_out)
card = fitted.card()
figure, (loops, heat, track) = plt.subplots(1, 3, figsize=(10.0, 2.9), layout="constrained")

for held in (each for each in fitted.held_out if "sine5mm1Hz" in each.run.name):
    cycle = slice(500, 1005, 4)  # one second at 500 Hz
    x = 1e3 * held.trajectory.displacement[cycle]
    loops.plot(x, 1e-3 * held.force[cycle], color=MEASURED, lw=3.0)
    loops.plot(x, 1e-3 * simulate(card.damper, held.trajectory)[cycle], color=MODEL, lw=1.0)
loops.plot([], [], color=MEASURED, lw=3.0, label="rig")
loops.plot([], [], color=MODEL, lw=1.0, label="model")
loops.set(title="60 °C, not fitted: 0, 1, 2 A", xlabel="displacement [mm]", ylabel="force [kN]")
loops.legend(frameon=False, ncols=2, loc="center", bbox_to_anchor=(0.5, 0.67))
loops.set_ylim(-1.7, 1.7)

drawing = read_drawing("paper")
assert drawing.sink is not None
dense: HeatSink = replace(drawing.sink, fins=12, thickness=1e-3, pitch=7.4e-3)
for sink, label, colour in (
    (None, "bare", WARM),
    (drawing.sink, "5 fins, 202 g", COLD),
    (dense, "12 fins, 162 g", COOL),
):
    rise = mrdamper.heat(card, drawing.with_sink(sink), past_limit=True).rise
    heat.plot(rise.time / 60.0, rise.fluid_degC, color=colour, label=label)
heat.axhline(130.0, color="black", lw=0.8, ls=":")
heat.set(title="15 mm, 1 Hz, 2 A", xlabel="time [min]", ylabel="fluid [°C]")
heat.legend(frameon=False)

scenario = replace(SCENARIOS["sine-900N-1Hz"], temperature_degC=100.0)
made = controllers_for(card)
for name, label, colour in (
    ("recommended", "with temperature", COOL),
    ("paper-unaware", "without", WARM),
):
    run = run_loop(Plant(PRESETS["nominal"]), made[name], scenario)
    shown = slice(20000, 32500, 100)
    track.plot(run.course.time[shown], 1e-3 * run.force[shown], color=colour, lw=1.2, label=label)
wanted = 1e-3 * run.course.target[shown]
track.plot(run.course.time[shown], wanted, color="black", lw=0.8, ls="--", label="wanted")
track.set(title="900 N at 100 °C, no force sensor", xlabel="time [s]", ylabel="force [kN]")
track.legend(frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 0.0))
track.set(xlim=(1.98, 3.9), ylim=(-1.0, 1.0))

figure.savefig(Path(__file__).with_name("overview.svg"), metadata={"Date": None})
