"""Export damper and controller of a card as one FMU, and simulate two seconds of a sine with FMPy.

python examples/fmu_in_fmpy.py card.json    (needs a C compiler and `pip install fmpy`)
"""

import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np

from mrdamper.codegen.fmu import write_fmu
from mrdamper.codegen.target import target_of
from mrdamper.codegen.verify import verify_c
from mrdamper.models.card_schema import read_card

target = target_of(read_card(sys.argv[1]), content="both", precision="float", period_s=1e-3)
time = 1e-3 * np.arange(2000)
motion = np.zeros(len(time), dtype=[(name, float) for name in ("time", "displacement", "wanted_force")])
motion["time"] = time
motion["displacement"] = 5e-3 * np.sin(2.0 * np.pi * time)
motion["wanted_force"] = 600.0 * np.cos(2.0 * np.pi * time)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "damper.fmu"
    write_fmu(target, path, verification=verify_c(target, samples=10_000))
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=2.0,
        output_interval=1e-3,
        start_values={"temperature": 313.15},
        input=motion,
        output=["current", "force", "flags"],
    )
print(f"current up to {found['current'][1000:].max():.3f} {target.command_unit}")
print(f"force up to {np.abs(found['force'][1000:]).max():.1f} N")
