"""CPU time of the Gram matrix of each hysteresis model, which takes most of the time of a fit.

Times are per sample and candidate. They are measured with 8 candidates on 12 runs of about 3,000 samples, for
every instruction set of the machine. Ratios are relative to the widest instruction set.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from bench.measure import Row, side_by_side
from mrdamper import core
from mrdamper.excitation import Sine, drive
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Constant
from mrdamper.models.laws import LAWS

COEFFICIENTS = {
    "bouc-wen": {"yield_force": 500.0, "rho": 1500.0, "kappa": -0.4, "n": 1.6},
    "double-bouc-wen": {
        **{"yield_force": 500.0, "second_force": 200.0, "rho": 1500.0, "second_rho": 200.0},
        **{"kappa": -0.4, "n": 1.6},
    },
    "bingham": {"yield_force": 500.0, "yield_velocity": 0.01},
    "tanh": {"yield_force": 500.0, "slope": 50.0, "shift": 0.1},
    "series-valve": {
        **{
            "stiffness": 731.0,
            "offset": 48.0,
            "yield_force": 500.0,
            "thinning": 3.2,
            "thinning_exponent": 0.43,
        },
        **{"yield_velocity": 2.5e-3, "position_gain": -2.3, "gap_stiffness": 1.2e7, "gap": 1.67e-4},
        **{"gap_corner": 4.6e-5, "leak_damping": 3e4, "leak_exponent": 0.994},
    },
    "chain": {
        **{"yield_force": 500.0, "thinning": 3.2, "thinning_exponent": 0.43, "yield_velocity": 2.5e-3},
        **{"position_gain": -2.3, "gap_stiffness": 1.2e7, "gap": 1.67e-4, "gap_corner": 4.6e-5},
        **{"leak_damping": 3e4, "leak_exponent": 0.994, "orifice": 100.0},
    },
    "lugre": {
        **{"yield_force": 500.0, "rho": 1500.0, "static_excess": 0.4, "fade_velocity": 0.01},
        **{"bristle_damping": 600.0},
    },
    "spencer": {
        **{"yield_force": 800.0, "series_damping": 3e4, "inner_viscosity": 2500.0, "inner_stiffness": 5000.0},
        **{"rho": 1500.0, "kappa": -0.4, "n": 1.6},
    },
}


def run() -> list[Row]:
    """Measure the time of the Gram matrices of 8 candidates on 12 runs with every instruction set."""
    best, rows = core.level(), []
    paths = [drive(Sine(0.006 + 0.001 * k, 1.0 + 0.2 * k), duration=3.0 - 0.04 * k, rate_Hz=1e3, command=0.0)
             for k in range(12)]  # fmt: skip
    records, zeros = [core.open_record(path) for path in paths], [np.zeros(len(path)) for path in paths]
    samples = 8 * sum(map(len, paths))
    for law, named in COEFFICIENTS.items():
        damper = Damper(LAWS[law], {name: Constant(value) for name, value in named.items()})
        number, values = LAWS[law].kernel or 0, damper.coefficients_at(0.0)[:, 0]
        near = np.random.default_rng(0).uniform(0.8, 1.2, (8, 12, len(values))) * values
        near[:, :, LAWS[law].names.index("viscous_exponent")] = 1.0
        if law in ("bouc-wen", "double-bouc-wen", "spencer"):
            # As in a fit, the shape parameters (last four) are equal in all runs of a candidate.
            near[:, :, -4:] = near[:, :1, -4:]
        places = sorted({0, 1, 2, *map(LAWS[law].names.index, named)})

        def sums(
            level: str, number: int = number, near: np.ndarray = near, places: list[int] = places
        ) -> None:
            core.use_level(level)
            core.gram_sums(number, records, zeros, [0] * 12, near, places)

        levels = core.levels()[::-1]
        jobs = {f"{law}, {len(places)} tangents, {level}": partial(sums, level) for level in levels}
        group = "Gram sums of 8 candidates on 12 runs of 3,000 samples"
        law_rows = side_by_side(group, jobs, dict.fromkeys(jobs, samples))
        core.use_level(best)
        rows += law_rows
    return rows
