"""The compact model on the host: its implicit step, its temperatures, and the gains of its thermometers.

The step is that of ``thermal.c`` (core/kernel), which a target runs; an export compares the two. The gains
are those of a steady Kalman filter at a usual temperature: of the states, and of a heat that the model does
not have, which wanders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from mrdamper.arrays import FloatArray
from mrdamper.quantities import REFERENCE_K
from mrdamper.thermal.compact.model import CompactModel
from mrdamper.thermal.materials import COPPER_PER_K

UPDATE_S = 0.5
"""Time of one step [s]."""

_USUAL_K, _USUAL_S = 100.0, 1800.0  # a damper's rise without losses, and in what time: its usual power
_USUAL_ABOVE_K = 60.0  # above ambient, where the gains' filter is linear
_POWER_SHARE, _POWER_S = 0.15, 60.0  # by which power is off, and for how long
_EXCESS_SHARE, _EXCESS_S = 0.15, 1800.0  # by how much the missing heat wanders in what time
_FLUID_K, _COIL_K, _SENSOR_S = 0.5, 3.0, 10.0  # errors of the readings, and for how long


@dataclass(frozen=True, slots=True, eq=False)
class CompactLoad:
    """What heats and cools through each step, shape (n,) each."""

    power: FloatArray  # mechanical [W]
    coil_W: FloatArray  # coil heat at 20 degC
    ambient: FloatArray  # [K]
    air_speed: FloatArray  # [m/s]


@dataclass(frozen=True, slots=True, eq=False)
class CompactHeating:
    """Temperatures at the ends of the steps [K], shape (n,), and the heat that goes in and out."""

    state: FloatArray  # shape (n, states)
    fluid: FloatArray  # mean
    hot: FloatArray  # hottest points of gap, coil and seals, shape (n, 3)
    coil_W: FloatArray  # at the coil's temperature
    lost_W: FloatArray  # to air and mountings


def simulate_compact(
    model: CompactModel, load: CompactLoad, *, start_K: float, step: float = UPDATE_S
) -> CompactHeating:
    """Return the course of a compact model from one temperature everywhere, in even steps [s]."""
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


def usual_power(model: CompactModel) -> float:
    """Return a power that heats a damper usually [W]: 100 K in half an hour, without losses."""
    return float(model.capacity[0]) * _USUAL_K / _USUAL_S


def sensor_gains(model: CompactModel, step: float = UPDATE_S) -> FloatArray:
    """Return by how much a kelvin of a reading corrects states and missing heat [W], shape (2, n + 1).

    The readings are the fluid's thermometer and the coil's resistance; each gain is that of one alone.
    """
    n, power = model.states, usual_power(model)
    matrix = np.diag(model.capacity / step + model.conductance)
    matrix += _losses(model, np.eye(n)[0] * _USUAL_ABOVE_K, model.reference, model.air_speed)
    forward = np.zeros((n + 1, n + 1))
    forward[:n, :n] = np.linalg.solve(matrix, np.diag(model.capacity / step))
    forward[:n, n] = np.linalg.solve(matrix, model.mechanical)
    forward[n, n] = 1.0
    noise = np.zeros((n + 1, n + 1))
    into = forward[:n, n]
    noise[:n, :n] = np.outer(into, into) * (_POWER_SHARE * power) ** 2 * _POWER_S / step
    noise[:n, :n] += np.diag(1e-9 * model.capacity[0] / model.capacity)
    noise[n, n] = (_EXCESS_SHARE * power) ** 2 * step / _EXCESS_S
    gains = []
    for row, error in ((model.fluid, _FLUID_K), (model.coil, _COIL_K)):
        sees = np.append(row, 0.0)[None, :]
        heard = np.array([[error**2 * _SENSOR_S / step]])
        spread = solve_discrete_are(forward.T, sees.T, noise, heard)
        gains.append((spread @ sees.T / (sees @ spread @ sees.T + heard))[:, 0])
    return np.array(gains)


def _losses(model: CompactModel, z: FloatArray, ambient: float, speed: float) -> FloatArray:
    """Return the losses' conductance at the surfaces' temperatures [W/K], shape (n, n)."""
    surface = model.reference + model.mean @ z
    films = [model.film_of(k, float(kelvin), ambient, speed) for k, kelvin in enumerate(surface)]
    return np.asarray(np.tensordot(films, model.loss, (0, 0)))
