"""Spencer's modified Bouc-Wen damper, simulated by Runge-Kutta of order 4.

    F   = c1 y' + k1 (x - x0)
    y'  = [alpha z + c0 v + k0 (x - y)] / (c0 + c1)
    z'  = -gamma |v - y'| z |z| - beta (v - y') z^2 + A (v - y')          (exponent n = 2)
    alpha = alpha_a + alpha_b u,  c0 = c0_a + c0_b u,  c1 = c1_a + c1_b u

The voltage u is constant in every run, so that its first-order lag has no effect. This program does not use
``core`` and ``models``. Tests compare their law ``spencer`` with it.

The constants belong to the 3 kN prototype of Spencer, Dyke, Sain & Carlson (1997), quoted from memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.records import RigRun
from mrdamper.errors import InputError
from mrdamper.excitation import Motion

REST_s = 0.3  # Time at rest before the motion [s]
SOFT_START_s = 0.25  # Ramp time of the amplitude [s].


@dataclass(frozen=True, slots=True)
class SpencerDamper:
    """Constants of the model in SI units. Names with ``_per_V`` are slopes versus voltage."""

    c0: float = 2100.0  # [N s/m]
    c0_per_V: float = 350.0  # [N s/(m V)]
    c1: float = 28300.0  # [N s/m]
    c1_per_V: float = 295.0  # [N s/(m V)]
    k0: float = 4690.0  # [N/m]
    k1: float = 500.0  # Stiffness of the accumulator [N/m]
    x0: float = 0.143  # initial displacement of the accumulator spring [m]
    alpha: float = 14000.0  # [N/m]
    alpha_per_V: float = 69500.0  # [N/(m V)]
    gamma: float = 3.63e6  # [1/m^2]
    beta: float = 3.63e6  # [1/m^2]
    a: float = 301.0  # [-]


@dataclass(frozen=True, slots=True)
class Sensors:
    """White noise (standard deviation) and quantisation steps of the sensors."""

    rate_Hz: float = 1000.0
    displacement_noise_m: float = 2e-6
    displacement_step_m: float = 3e-6
    force_noise_N: float = 8.0
    force_step_N: float = 3.0


SENSORS = Sensors()


@dataclass(frozen=True, slots=True)
class Campaign:
    """Motions with labels. Each motion is run at each voltage."""

    motions: tuple[tuple[str, Motion], ...]
    voltages: tuple[float, ...] = (0.0, 0.75, 1.5, 2.25)
    duration_s: float = 4.0


def simulate(
    damper: SpencerDamper,
    motions: Sequence[Motion],
    voltages: Sequence[float],
    *,
    duration_s: float,
    rate_Hz: float = 10_000.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time [s], shape (n,), displacement [m] and force [N], shape (runs, n), one motion per voltage.

    The damper is at rest first, then the amplitude rises smoothly. ``rate_Hz`` is the rate of the integration
    and of the result.
    """
    if len(motions) != len(voltages):
        raise InputError(f"{len(motions)} motions and {len(voltages)} voltages; expected as many")
    steps = round(duration_s * rate_Hz)
    step = 1.0 / rate_Hz
    # The Runge-Kutta method also needs the middle of each step.
    halves = 0.5 * step * np.arange(2 * steps + 1, dtype=np.float64)
    paths = [_soft_start(motion, halves) for motion in motions]
    x, v = (np.array([path[k] for path in paths]).T.copy() for k in (0, 1))
    u = np.asarray(voltages, dtype=np.float64)
    c0, c1 = damper.c0 + damper.c0_per_V * u, damper.c1 + damper.c1_per_V * u
    alpha = damper.alpha + damper.alpha_per_V * u
    share = 1.0 / (c0 + c1)
    drive = (c0 * v + damper.k0 * x) * share  # The motion alone determines this part of y'.
    by_z, by_y = alpha * share, damper.k0 * share

    def rates(k: int, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        inner = drive[k] + by_z * z - by_y * y
        slip = v[k] - inner
        return inner, slip * (damper.a - damper.beta * z * z) - damper.gamma * np.abs(slip) * z * np.abs(z)

    y, z = np.zeros_like(u), np.zeros_like(u)
    inner_velocity = np.empty((steps + 1, len(u)))
    for i in range(steps + 1):
        k = 2 * i
        y1, z1 = rates(k, y, z)
        inner_velocity[i] = y1
        if i == steps:
            break
        y2, z2 = rates(k + 1, y + 0.5 * step * y1, z + 0.5 * step * z1)
        y3, z3 = rates(k + 1, y + 0.5 * step * y2, z + 0.5 * step * z2)
        y4, z4 = rates(k + 2, y + step * y3, z + step * z3)
        y = y + step / 6.0 * (y1 + 2.0 * (y2 + y3) + y4)
        z = z + step / 6.0 * (z1 + 2.0 * (z2 + z3) + z4)
    force = c1 * inner_velocity + damper.k1 * (x[::2] - damper.x0)
    return halves[::2], x[::2].T.copy(), force.T.copy()


def measure(
    plan: Campaign, *, seed: int = 0, damper: SpencerDamper | None = None, sensors: Sensors = SENSORS
) -> tuple[RigRun, ...]:
    """Return the runs of a campaign with sensor noise and names such as ``spencer_1.50V_sine5mm1Hz``."""
    pairs = [(label, motion, voltage) for label, motion in plan.motions for voltage in plan.voltages]
    every = round(10_000.0 / sensors.rate_Hz)
    time, displacement, force = simulate(
        damper or SpencerDamper(),
        [motion for _, motion, _ in pairs],
        [voltage for _, _, voltage in pairs],
        duration_s=plan.duration_s,
        rate_Hz=every * sensors.rate_Hz,
    )
    noise = np.random.default_rng(seed)
    runs = []
    for row, (label, _, voltage) in enumerate(pairs):
        x = displacement[row, ::every]
        f = force[row, ::every]
        x = _quantised(
            x + sensors.displacement_noise_m * noise.standard_normal(len(x)), sensors.displacement_step_m
        )
        f = _quantised(f + sensors.force_noise_N * noise.standard_normal(len(f)), sensors.force_step_N)
        runs.append(
            RigRun(
                name=f"spencer_{voltage:.2f}V_{label}",
                time=time[::every],
                displacement=x,
                force=f,
                command=np.full(len(x), voltage),
                command_unit="V",
                session="simulated",
                source="simulated: Spencer's modified Bouc-Wen",
            )
        )
    return tuple(runs)


def _soft_start(motion: Motion, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return displacement and velocity of a motion whose amplitude rises smoothly after a rest."""
    t = np.maximum(time - REST_s, 0.0)
    s = np.clip(t / SOFT_START_s, 0.0, 1.0)
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    slope = 30.0 * s * s * (1.0 - s) ** 2 / SOFT_START_s
    x = motion.displacement(t)
    return share * x, share * motion.velocity(t) + slope * x


def _quantised(values: FloatArray, step: float) -> FloatArray:
    return step * np.round(values / step)
