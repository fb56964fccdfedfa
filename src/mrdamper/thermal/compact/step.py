"""Simulation of the compact model in Python: implicit time step, temperatures, and gains of the sensors.

The time step is the same as in ``thermal.c`` (core/kernel), which runs in exported code. An export compares
the two implementations. The gains are the gains of a steady-state Kalman filter at a typical temperature. The
filter estimates the states and the *missing heat*, which is the heat flow that the model does not contain.
The missing heat is modelled as a random walk.
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
"""Duration of one time step [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class CompactLoad:
    """Inputs of a simulation with n time steps. Arrays have the shape (n,)."""

    power: FloatArray  # mechanical power [W]
    coil_W: FloatArray  # coil heat at 20 degC
    ambient: FloatArray  # ambient temperature [K]
    air_speed: FloatArray  # air speed [m/s]


@dataclass(frozen=True, slots=True, eq=False)
class CompactHeating:
    """Results at the end of each of n time steps. Arrays have the shape (n,) unless stated otherwise."""

    state: FloatArray  # shape (n, states)
    fluid: FloatArray  # mean fluid temperature [K]
    hot: FloatArray  # temperatures of the hottest points of gap, coil and seals [K], shape (n, 3)
    coil_W: FloatArray  # coil heat at the temperature of the coil
    lost_W: FloatArray  # heat losses to air and mountings


def simulate_compact(
    model: CompactModel, load: CompactLoad, *, start_K: float, step: float = UPDATE_S
) -> CompactHeating:
    """Simulate a compact model from a uniform temperature ``start_K`` with constant time steps [s]."""
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
    """Return the typical power of a damper [W], which without losses heats the damper by 100 K in 30 min."""
    return float(model.capacity[0]) * SETTINGS.typical_power_rise_K / SETTINGS.typical_power_time_s


def sensor_gains(model: CompactModel, step: float = UPDATE_S) -> FloatArray:
    """Return the Kalman gains of two sensors for n states and the missing heat, shape (2, n + 1).

    A gain is the correction per kelvin of difference between reading and model: [K/K] for the states and
    [W/K] for the missing heat. Row 0 is for the fluid thermometer, and row 1 for the coil temperature that
    follows from the coil resistance. Each row is computed for the case that the other sensor is missing.
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
    """Return the matrix of the heat losses at the present surface temperatures [W/K], shape (n, n)."""
    surface = model.reference + model.mean @ z
    films = [model.film_of(k, float(kelvin), ambient, speed) for k, kelvin in enumerate(surface)]
    return np.asarray(np.tensordot(films, model.loss, (0, 0)))
