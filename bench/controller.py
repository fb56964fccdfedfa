"""One step of a controller: in C over many samples, and from Python, on the same readings.

What is made once (tables, readings as objects) is not counted. Steps from Python are timed on fewer samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.measure import Asked, Row, side_by_side
from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.protocol import Measurement, Reference
from mrdamper.excitation import MOTIONS
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial, Constant, Exponential, Polynomial, TemperatureDependent
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius

__all__ = ["DAMPER", "run"]

SHOWN = ("paper", "recommended", "recommended-causal", "recommended-observer", "predictive", "pi")
SAMPLES = 200_000
MOST_NS = {
    "paper, C loop": 200.0,
    "paper, Python extension": 400.0,
    "recommended, C loop": 1000.0,
    "recommended, Python extension": 2000.0,
    "predictive, C loop": 2000.0,
    "predictive, Python extension": 2500.0,
}

# A damper like the virtual rig's `nominal`: what is timed does not depend on its numbers.
DAMPER = Damper(
    LAWS["double-bouc-wen"],
    {
        "viscosity": TemperatureDependent(Polynomial((7000.0, 700.0)), Arrhenius(1500.0)),
        "viscous_exponent": Constant(0.9),
        "stiffness": Constant(1400.0),
        "offset": Polynomial((6.0, 10.0)),
        "coulomb_friction": Bipolynomial((5.0, 0.01)),
        "breakaway_friction": Bipolynomial((6.0, -0.05)),
        "stribeck_velocity": Constant(0.014),
        "transition_velocity": Constant(8e-4),
        "yield_force": Bipolynomial((40.0, 0.02, 400.0, -0.5, -60.0, -0.1)),
        "second_force": Bipolynomial((7.0, -0.06, 300.0, -1.0, 40.0, 0.2)),
        "rho": Exponential(16e3, 0.39),
        "second_rho": Exponential(5e3, -0.1),
        "kappa": Constant(-0.42),
        "n": Constant(0.57),
    },
    actuation=Actuation(0.008, 0.0065, 0.003, 0.0035, largest_command=2.0, play=0.025),
    temperature_range=(288.15, 398.15),
)

Job = Callable[[], FloatArray | list[float]]


def run() -> list[Row]:
    """Return CPU of one step; the C loop is the measure of each controller.

    Raises
    ------
    RuntimeError
        A step from Python does not give the bits of the C loop.
    """
    every = controllers_for(DAMPER)
    rows: list[Row] = []
    for name in SHOWN:
        made = every[name]
        told = _told(made)
        few = told[: SAMPLES // 10]
        in_c, one_by_one = _in_c(made, told), _one_by_one(made, few)
        if not np.array_equal(np.asarray(in_c())[: len(few)], np.asarray(one_by_one())):
            raise RuntimeError(f"{name}: a step from Python gives another command than the C loop")
        jobs = {f"{name}, C loop": in_c, f"{name}, Python extension": one_by_one}
        timed_rows = side_by_side("one step", jobs, dict(zip(jobs, (len(told), len(few)), strict=True)))
        for row in timed_rows:
            most, ns = MOST_NS.get(row.contender), row.ns_per_sample or 0.0
            asked = () if most is None else (Asked(f"{row.contender}, one step", most, ns, "ns"),)
            rows.append(replace(row, asked=asked))
    return rows


# ------------------------------------------------------------------------------------ the contenders


def _in_c(made: ForceController, told: FloatArray) -> Job:
    return lambda: made.run(made.start(), told)[1]


def _one_by_one(made: ForceController, told: FloatArray) -> Job:
    wanted = [Reference(row[0], row[1]) for row in told.tolist()]
    seen = [Measurement(row[2], row[3], row[4]) for row in told.tolist()]

    def job() -> list[float]:
        state, step = made.start(), made.step
        commands = []
        for w, s in zip(wanted, seen, strict=True):
            state, command = step(state, w, s)
            commands.append(command)
        return commands

    return job


# ------------------------------------------------------------------------------------ the readings


def _told(made: ForceController) -> FloatArray:
    t = made.period_s * np.arange(SAMPLES)
    motion, rng = MOTIONS["nonperiodic"], np.random.default_rng(1)
    rows = np.empty((SAMPLES, 5))
    rows[:, 0] = 1000.0 * np.tanh(motion.velocity(t) / 0.02)
    rows[:, 1] = 1000.0 * np.tanh(motion.velocity(t + made.preview_s) / 0.02)
    rows[:, 2] = motion.displacement(t) + 10e-6 * rng.standard_normal(SAMPLES)
    rows[:, 3] = 333.15 + 0.3 * rng.standard_normal(SAMPLES)
    rows[:, 4] = 0.9 * rows[:, 0]
    return rows
