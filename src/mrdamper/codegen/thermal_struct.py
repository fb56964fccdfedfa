"""Compute the values of the C struct ``mrd_thermal`` of the kernel for a compact thermal model."""

from __future__ import annotations

import numpy as np

from mrdamper.codegen.track_struct import Table, Value
from mrdamper.thermal.compact.model import PARTS, POINT_COUNT, CompactModel
from mrdamper.thermal.compact.step import UPDATE_S, sensor_gains, typical_power

__all__ = ["FROZEN_K", "HORIZON_S", "steps_between_updates", "thermal_members"]

_STILL_K, FROZEN_K, _WRONG_K = 0.1, 5.0, 25.0
HORIZON_S = 7200.0  # same value as MRD_THERMAL_HORIZON of the kernel


def steps_between_updates(period_s: float) -> int:
    """Return the number of control periods in half a second, the time between two updates of the states."""
    return max(round(UPDATE_S / period_s), 1)


def thermal_members(model: CompactModel, period_s: float, amperes_per_command: float) -> dict[str, Value]:
    """Return the members of the C struct ``mrd_thermal`` for a compact model and a control period [s].

    ``amperes_per_command`` is the coil current divided by the command [A/A or A/V]; 0 if it is unknown.
    """
    power_filter_s = 30.0  # time constant of the power filter for the predicted time to the limit
    # *Missing heat* is the estimated heat flow that the model does not contain. Without a valid reading, the
    # estimate decays with this time constant.
    missing_heat_decay_s = 1800.0
    missing_heat_max_ratio = 0.3  # max missing heat, divided by the typical power
    command_min_A = 0.2  # The coil resistance is used as a measurement only above this current.
    surface_kind_count_max = 8
    n, kinds, every = model.states, len(model.law), steps_between_updates(period_s)
    update, power, films = every * period_s, typical_power(model), model.films
    points = len(PARTS) * POINT_COUNT
    rows = np.vstack([model.fluid, model.coil, model.spots.reshape(points, n)])
    through = np.vstack(
        [model.fluid_feedthrough, model.coil_feedthrough, model.spots_feedthrough.reshape(points, 2)]
    )
    law = (*model.law, *[0] * (surface_kind_count_max - kinds))
    limits = {f"limit_{part}": float(each) for part, each in zip(PARTS, model.limits, strict=True)}
    return {
        "states": n,
        "kinds": kinds,
        "every": every,
        "speeds": len(films.speed),
        "differences": len(films.above),
        "update": update,
        "reference": model.reference,
        "film_ambient": float(films.ambient[1]),
        "film_width": float(films.ambient[1] - films.ambient[0]),
        "air_speed": model.air_speed,
        "coil_heat": model.resistance * amperes_per_command**2,
        "resistance": model.resistance,
        "least_command": command_min_A / amperes_per_command if amperes_per_command else 1e6,
        "smoothing": update / power_filter_s,
        "most_excess": missing_heat_max_ratio * power,
        "fading": float(np.exp(-update / missing_heat_decay_s)),
        "still": _STILL_K,
        "frozen_change": FROZEN_K,
        "wrong": _WRONG_K,
        **limits,
        "law": law,
        "capacity": Table(model.capacity, f"[{n} states], heat capacity [J/K]"),
        "conductance": Table(model.conductance, f"[{n} states], conductance [W/K]"),
        "mechanical": Table(model.mechanical, f"[{n} states], fraction of the mechanical power"),
        "electrical": Table(model.electrical, f"[{n} states], fraction of the coil heat"),
        "area": Table(model.loss, f"[{kinds} kinds of surface][{n}][{n}], area [m^2]"),
        "mean": Table(model.mean, f"[{kinds} kinds of surface][{n}], mean temperature"),
        "radiation": Table(model.radiation, f"[{kinds} kinds of surface], [W/(m^2 K^4)]"),
        "mount": Table(model.mount, f"[{kinds} kinds of surface], [W/(m^2 K)]"),
        "speed": Table(films.speed, "air speed [m/s]"),
        "above": Table(films.above, "surface minus ambient [K]"),
        "film": Table(films.film, f"[{len(films.film)} laws][3 ambients][speeds][differences], [W/(m^2 K)]"),
        "row": Table(rows, f"[{len(rows)} rows][{n}]"),
        "through": Table(through, f"[{len(rows)} rows][power, coil heat], [K/W]"),
        "gain": Table(sensor_gains(model, update), f"[2 sensors][{n} states, missing heat]"),
    }
