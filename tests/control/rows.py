"""Input rows of controllers: target, previewed target, displacement, temperature and force."""

from __future__ import annotations

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.controllers import ForceController
from mrdamper.excitation import MOTIONS

MOTION = MOTIONS["nonperiodic"]
ROOM = 293.15


def motion_rows(
    controller: ForceController,
    seconds: float,
    *,
    amplitude: float = 900.0,
    kelvin: float = ROOM,
    noise: float = 10e-6,
    seed: int = 1,
) -> FloatArray:
    """Return input rows of a non-periodic motion. The target force is in phase with the velocity."""
    t = controller.period_s * np.arange(round(seconds / controller.period_s))
    rng = np.random.default_rng(seed)
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = amplitude * np.tanh(MOTION.velocity(t) / 0.02)
    rows[:, 1] = amplitude * np.tanh(MOTION.velocity(t + controller.preview_s) / 0.02)
    rows[:, 2] = MOTION.displacement(t) + noise * rng.standard_normal(len(t))
    rows[:, 3] = kelvin
    return rows


def state_at_speed(controller: ForceController, speed: float = 0.03, *, kelvin: float = ROOM) -> bytes:
    """Return the controller state after 0.5 s at constant velocity, with fully developed hysteresis."""
    t = controller.period_s * np.arange(round(0.5 / controller.period_s))
    rows = np.full((len(t), 5), np.nan)
    rows[:, 0] = rows[:, 1] = 0.0
    rows[:, 2], rows[:, 3] = speed * (t - t[-1]), kelvin
    return controller.run(controller.start(), rows)[0]


def command_at_speed(
    controller: ForceController, state: bytes, wanted: float, speed: float = 0.03, *, kelvin: float = ROOM
) -> float:
    """Return the command of a controller after 60 ms at constant velocity with a constant target."""
    rows = constant_speed_rows(controller, wanted, speed, kelvin=kelvin)
    return float(controller.run(state, rows)[1][-1])


def constant_speed_rows(
    controller: ForceController, wanted: float, speed: float = 0.03, *, kelvin: float = ROOM
) -> FloatArray:
    """Return input rows for 60 ms. The velocity is constant, and the measured force equals the target."""
    rows = np.full((round(0.06 / controller.period_s), 5), wanted)
    rows[:, 2] = speed * controller.period_s * (1.0 + np.arange(len(rows)))
    rows[:, 3] = kelvin
    return rows
