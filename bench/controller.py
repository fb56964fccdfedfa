"""One step of a controller: in C over many samples at once, and from Python sample by sample."""

from __future__ import annotations

from functools import partial

import numpy as np

from bench.measure import Row, interleaved
from mrdamper.control.controllers import ForceController, controllers_for
from mrdamper.control.protocol import Seen, Wanted
from mrdamper.excitation import MOTIONS
from mrdamper.models.actuation import Actuation
from mrdamper.models.damper import Damper
from mrdamper.models.dependence import Bipolynomial, Constant, Exponential, Polynomial, Tempered
from mrdamper.models.laws import LAWS
from mrdamper.models.temperature import Arrhenius

__all__ = ["run"]

SHOWN = ("recommended", "recommended-causal", "recommended-adaptive", "paper", "pi")
SAMPLES = 20_000

# A damper like the virtual rig's `nominal`: what is timed does not depend on its numbers.
DAMPER = Damper(
    LAWS["double-bouc-wen"],
    {
        "viscosity": Tempered(Polynomial((7000.0, 700.0)), Arrhenius(1500.0)),
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


def run() -> list[Row]:
    """Return CPU of one step for some controllers, the readings made beforehand."""
    made = {name: controllers_for(DAMPER)[name] for name in SHOWN}
    rows = []
    jobs = {f"{name}, C": partial(_all_at_once, each, _told(each)) for name, each in made.items()}
    jobs |= {f"{name}, Python": partial(_one_by_one, each, *_readings(each)) for name, each in made.items()}
    for name, spent in interleaved(jobs).items():
        bar = {"recommended, C": "1000 ns", "recommended, Python": "2000 ns"}.get(name, "")
        rows.append(Row(name, spent, 1e9 * spent / SAMPLES, bar=bar))
    return rows


def _told(made: ForceController) -> np.ndarray:
    t = made.period_s * np.arange(SAMPLES)
    motion, rng = MOTIONS["nonperiodic"], np.random.default_rng(1)
    rows = np.empty((SAMPLES, 5))
    rows[:, 0] = 1000.0 * np.tanh(motion.velocity(t) / 0.02)
    rows[:, 1] = 1000.0 * np.tanh(motion.velocity(t + made.preview_s) / 0.02)
    rows[:, 2] = motion.displacement(t) + 10e-6 * rng.standard_normal(SAMPLES)
    rows[:, 3] = 333.15 + 0.3 * rng.standard_normal(SAMPLES)
    rows[:, 4] = 0.9 * rows[:, 0]
    return rows


def _readings(made: ForceController) -> tuple[list[Wanted], list[Seen]]:
    rows = _told(made).tolist()
    return [Wanted(row[0], row[1]) for row in rows], [Seen(row[2], row[3], row[4]) for row in rows]


def _all_at_once(made: ForceController, rows: np.ndarray) -> None:
    made.run(made.start(), rows)


def _one_by_one(made: ForceController, wanted: list[Wanted], seen: list[Seen]) -> None:
    state, step = made.start(), made.step
    for w, s in zip(wanted, seen, strict=True):
        state, _ = step(state, w, s)
