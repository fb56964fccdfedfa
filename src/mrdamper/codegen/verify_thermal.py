"""Verify an exported thermal model: simulate half an hour of a random load in compiled C and in Python.

Power, ambient temperature and air speed change every few minutes. The model receives no sensor readings,
because these would correct differences between C and Python.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.codegen.structs import steps_between_updates
from mrdamper.codegen.target import Target
from mrdamper.errors import CheckError
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.compact import CompactLoad, simulate_compact, typical_power

TOLERANCE_K: Mapping[bool, float] = {True: 10e-3, False: 1e-6}
"""Max difference of a temperature in single (True) and double precision (False) [K]."""

_COLUMNS = ("fluid", "gap", "coil", "seal")
LOAD_COMMAND = 1.0
PROGRAM_TIME_MAX_S = 120.0

Build = Callable[[Sequence[str], str], list[str]]
"""Function that compiles C files, links them to a program of the given name, and returns its command."""


def verify_thermal(target: Target, place: Path, build: Build) -> dict[str, float]:
    """Return, for each temperature of the model, the largest difference between compiled C and Python [K].

    The result is empty if the target has no thermal model.

    Raises
    ------
    CheckError
        If the compiled program fails.
    """
    model = target.thermal
    if model is None:
        return {}
    load = _draw_load(typical_power(model), model.resistance * target.amperes**2)
    rows = np.column_stack([load.power, load.ambient, load.air_speed])
    (place / "thermal_check.c").write_text(_program(target), encoding="ascii")
    program = build((f"{target.name}_thermal", "thermal_check"), "replay_thermal")
    text = "\n".join(" ".join(f"{value:.17g}" for value in row) for row in rows)
    done = subprocess.run(
        program, input=text, capture_output=True, text=True, check=False, timeout=PROGRAM_TIME_MAX_S
    )
    found = np.array(done.stdout.split(), dtype=np.float64).reshape(-1, len(_COLUMNS))
    if done.returncode != 0 or len(found) != len(rows):
        raise CheckError(
            place="verification", found=f"the thermal model's check ended with {done.returncode}"
        )
    update = steps_between_updates(target.period_s) * target.period_s
    host = simulate_compact(model, load, start_K=REFERENCE_K, step=update)
    differences = np.abs(found - np.column_stack([host.fluid, host.hot]))
    return {name: float(worst) for name, worst in zip(_COLUMNS, differences.max(axis=0), strict=True)}


def thermal_problems(differences: Mapping[str, float], *, single: bool) -> list[str]:
    """Return a sentence for each temperature difference [K] that exceeds the tolerance."""
    tolerance = TOLERANCE_K[single]
    return [
        f"thermal.{name} is up to {1e3 * worst:.3g} mK different from Python; expected {1e3 * tolerance:g}"
        for name, worst in differences.items()
        if not worst <= tolerance
    ]


def _draw_load(power: float, coil_W: float) -> CompactLoad:
    """Return a random thermal load: power up to twice the typical power [W].

    Power, ambient temperature and air speed change at random times.
    """
    update_count = 3600
    segment_count = 12
    rng = np.random.default_rng(1)
    of = np.sort(rng.integers(0, segment_count, update_count))

    def steps(values: FloatArray) -> FloatArray:
        return np.asarray(values.astype(np.float32)[of], dtype=np.float64)

    return CompactLoad(
        power=steps(power * rng.uniform(0.0, 2.0, segment_count)),
        coil_W=np.full(update_count, coil_W * LOAD_COMMAND**2),
        ambient=steps(rng.uniform(258.0, 318.0, segment_count)),
        air_speed=steps(rng.uniform(-4.0, 10.0, segment_count).clip(0.0)),
    )


def _program(target: Target) -> str:
    """Return the C source of a program that computes the temperatures of the thermal model.

    For each update, the program reads power, ambient temperature and air speed, and prints the temperatures.
    """
    name, every = target.name, steps_between_updates(target.period_s)
    return f"""#include <math.h>
#include <stdio.h>
#include "{name}_thermal.h"

int main(void)
{{
    {name}_thermal_state state;
    {name}_thermal_output out;
    double power, ambient, speed;
    int left = 1;
    {name}_thermal_start(&state, (mrd_real){REFERENCE_K});
    while (scanf("%lf %lf %lf", &power, &ambient, &speed) == 3) {{
        const {name}_thermal_input in = {{
            (mrd_real)power, (mrd_real)1, (mrd_real){LOAD_COMMAND}, (mrd_real)ambient, (mrd_real)speed,
            (mrd_real)NAN, (mrd_real)NAN}};
        for (; left > 0; left--) {name}_thermal_step(&state, &in, &out);
        left = {every};
        printf("%.17g %.17g ", (double)out.fluid, (double)out.gap);
        printf("%.17g %.17g\\n", (double)out.coil, (double)out.seal);
    }}
    return 0;
}}
"""
