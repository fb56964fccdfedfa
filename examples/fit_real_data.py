"""Fit a card to three motions of a real damper from a public rig, and predict a fourth motion and a chirp.

python examples/fit_real_data.py DIR    (DIR contains utfsm_sine_*.csv and utfsm_chirp_*.csv, one run per
file)
"""

import sys

import mrdamper

folder = sys.argv[1]
sines = mrdamper.read_runs([f"{folder}/utfsm_sine_*.csv"])
fitted = mrdamper.fit(sines, "series-valve", hold_out=["*25mm0p5Hz*"])
errors = mrdamper.assess(fitted).runs
for split in ("training", "held_out"):
    found = sorted(error.nrmse_percent for error in errors if error.split == split)
    print(f"{split}: median {found[len(found) // 2]:.2f} %, worst {found[-1]:.2f} %")

chirps = mrdamper.evaluate(fitted.card(), mrdamper.read_runs([f"{folder}/utfsm_chirp_1.00A.csv"]))
print(f"chirp: {chirps[0].nrmse_percent:.2f} %, {chirps[0].rmse_N:.0f} N")
