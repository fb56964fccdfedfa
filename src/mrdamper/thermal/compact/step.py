"""The compact model in Python: implicit step, temperatures, and gains of the sensors.

The step equals that of ``thermal.c`` (core/kernel), which runs on a target; an export compares both. The
gains are those of a steady-state Kalman filter at a typical temperature, for the states and for the missing
heat. The missing heat is the heat flow that the model does not contain; it is modelled as a random walk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from mrdamper.arrays import FloatArray
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.compact.model import CompactModel
from mrdamper.thermal.materials import COPPER_PER_K
from mrdamper.thermal.settings import SETTINGS

UPDATE_S = 0.5
"""Duration of one step [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class CompactLoad:
    """Inputs of each step, shape (n,) each."""

    power: FloatArray  # mechanical [W]
    coil_W: FloatArray  # coil heat at 20 degC
    ambient: FloatArray  # [K]
    air_speed: FloatArray  # [m/s]


@dataclass(frozen=True, slots=True, eq=False)
class CompactHeating:
    """Temperatures at the ends of the steps [K], shape (n,), and heat flows."""

    state: FloatArray  # shape (n, states)
    fluid: FloatArray  # mean
    hot: FloatArray  # hottest points of gap, coil and seals, shape (n, 3)
    coil_W: FloatArray  # at the coil's temperature
    lost_W: FloatArray  # losses to air and mountings


def simulate_compact(
    model: CompactModel, load: CompactLoad, *, start_K: float, step: float = UPDATE_S
) -> CompactHeating:
    """Simulate a compact model from a uniform temperature with equal steps [s]."""
    n = len(load.power)
    z = np.zeros(model.states)
    z[0] = start_K - model.reference
    states, coil_W, lost = np.empty((n, model.states)), np.empty(n), np.empty(n)
    for k in range(n):
        ambient, speed = float(load.ambient[k]), float(load.air_speed[k])
        warm = model.reference + float(model.coil @ z) - REFERENCE_K
        coil_W[k] = load.coil_W[k] * min(max(1.0 + COPPER_PER_K * warm, 0.2), 3.0)
        losses = _losses(model, z, ambient, speed)
        above = z.copy()
        above[0] -= ambient - model.reference
        heat = model.mechanical * load.power[k] + model.electrical * coil_W[k]
        rate = heat - model.conductance * z - losses @ above
        matrix = losses + np.diag(model.conductance + model.capacity / step)
        move = np.linalg.solve(matrix, rate)
        z = z + move
        states[k], lost[k] = z, float(losses[0] @ (above + move))
    sources = np.column_stack([load.power, coil_W])
    hot = states @ model.spots.reshape(-1, model.states).T
    hot += sources @ model.spots_feedthrough.reshape(-1, 2).T
    return CompactHeating(
        state=states,
        fluid=model.reference + states @ model.fluid + sources @ model.fluid_feedthrough,
        hot=model.reference + hot.reshape(n, *model.spots.shape[:2]).max(axis=2),
        coil_W=coil_W,
        lost_W=lost,
    )


def typical_power(model: CompactModel) -> float:
    """Return a typical power of a damper [W]: 100 K in half an hour without losses."""
    return float(model.capacity[0]) * SETTINGS.typical_power_rise_K / SETTINGS.typical_power_time_s


def sensor_gains(model: CompactModel, step: float = UPDATE_S) -> FloatArray:
    """Return the Kalman gains of states and missing heat [W] per kelvin of innovation, shape (2, n + 1).

    Row 0 is for the fluid thermometer, row 1 for the coil temperature from its resistance. Each row is
    computed as if the other sensor were absent.
    """
    n, power = model.states, typical_power(model)
    matrix = np.diag(model.capacity / step + model.conductance)
    matrix += _losses(model, np.eye(n)[0] * SETTINGS.typical_rise_K, model.reference, model.air_speed)
    forward = np.zeros((n + 1, n + 1))
    forward[:n, :n] = np.linalg.solve(matrix, np.diag(model.capacity / step))
    forward[:n, n] = np.linalg.solve(matrix, model.mechanical)
    forward[n, n] = 1.0
    noise = np.zeros((n + 1, n + 1))
    into = forward[:n, n]
    noise[:n, :n] = (
        np.outer(into, into) * (SETTINGS.power_error_ratio * power) ** 2 * SETTINGS.power_error_time_s / step
    )
    noise[:n, :n] += np.diag(1e-9 * model.capacity[0] / model.capacity)
    noise[n, n] = (SETTINGS.missing_heat_ratio * power) ** 2 * step / SETTINGS.missing_heat_time_s
    gains = []
    for row, error in ((model.fluid, SETTINGS.fluid_noise_K), (model.coil, SETTINGS.coil_noise_K)):
        sees = np.append(row, 0.0)[None, :]
        heard = np.array([[error**2 * SETTINGS.sensor_noise_time_s / step]])
        spread = solve_discrete_are(forward.T, sees.T, noise, heard)
        gains.append((spread @ sees.T / (sees @ spread @ sees.T + heard))[:, 0])
    return np.array(gains)


def _losses(model: CompactModel, z: FloatArray, ambient: float, speed: float) -> FloatArray:
    """Return the conductance of the losses at the surface temperatures [W/K], shape (n, n)."""
    surface = model.reference + model.mean @ z
    films = [model.film_of(k, float(kelvin), ambient, speed) for k, kelvin in enumerate(surface)]
    return np.asarray(np.tensordot(films, model.loss, (0, 0)))
