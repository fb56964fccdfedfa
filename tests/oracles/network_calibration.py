"""The zone network's multipliers from a few finite-element runs.

Some six designs are run by both; the multipliers of ``drawing.Calibration`` that mend the network's few nodes
are fitted so that its fluid, coil and wall follow the finite elements'. What is the damper's own (heat
capacity, film) is left as the drawings have it. How good the network then is on other designs is for a run on
other designs to say (``NetworkError`` of each).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from mrdamper.arrays import FloatArray
from mrdamper.errors import ConvergenceError
from mrdamper.thermal.drawing import Calibration, DamperDrawing
from mrdamper.thermal.model.finite_element import heat_field
from mrdamper.thermal.model.network import zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, simulate_network

__all__ = ["NetworkCalibration", "NetworkError", "calibrate_network", "network_error"]

_FITTED = ("fluid_wall", "fluid_core", "wall_axial", "core_axial", "coil", "fin_root")
_SPAN = math.log(10.0)  # each way, from 1
_HOLD = 0.2  # pull towards 1, in kelvin per unit of the logarithm: holds what the designs do not show
_MOMENTS = 24  # at which curves are compared


@dataclass(frozen=True, slots=True)
class NetworkError:
    """Difference of the network from the finite elements on one design [K]."""

    fluid_rms: float
    fluid_max: float
    coil_rms: float
    coil_max: float
    wall_rms: float
    wall_max: float


@dataclass(frozen=True, slots=True)
class NetworkCalibration:
    """Multipliers, and what is left on the designs they come from, before and after."""

    calibration: Calibration
    before: tuple[NetworkError, ...]
    after: tuple[NetworkError, ...]


def calibrate_network(drawings: Sequence[DamperDrawing], loads: Sequence[Load]) -> NetworkCalibration:
    """Return the multipliers with which the network follows the finite elements on some designs.

    Parameters
    ----------
    drawings : designs to run by both, all with the same own calibration; some with a sink, for ``fin_root``
    loads : what heats each of them, from ambient
    """
    own = drawings[0].calibration
    moments = _moments(loads)
    truths = [_field_curves(drawing, loads, moments) for drawing in drawings]
    finned = any(drawing.sink is not None for drawing in drawings)
    fitted = _FITTED if finned else tuple(name for name in _FITTED if name != "fin_root")

    def calibrated(logs: FloatArray) -> Calibration:
        return replace(own, **{name: math.exp(log) for name, log in zip(fitted, logs.tolist(), strict=True)})

    def misses(calibration: Calibration) -> list[FloatArray]:
        return [
            _network_curves(replace(drawing, calibration=calibration), loads, moments) - truth
            for drawing, truth in zip(drawings, truths, strict=True)
        ]

    def residual(logs: FloatArray) -> FloatArray:
        found = np.concatenate([miss.ravel() for miss in misses(calibrated(logs))])
        return np.concatenate([found, _HOLD * math.sqrt(found.size) * logs])

    start = np.array([math.log(getattr(own, name)) for name in fitted])
    fit = least_squares(
        residual, start, bounds=(-_SPAN, _SPAN), x_scale=0.3, diff_step=np.full(len(start), 1e-3)
    )
    if not fit.success:
        raise ConvergenceError(f"network calibration: the fit did not settle ({fit.message})")
    found = calibrated(np.asarray(fit.x))
    plain = replace(own, **dict.fromkeys(_FITTED, 1.0))
    return NetworkCalibration(
        found,
        tuple(_error_of(miss) for miss in misses(plain)),
        tuple(_error_of(miss) for miss in misses(found)),
    )


def network_error(drawing: DamperDrawing, loads: Sequence[Load]) -> NetworkError:
    """Return how far a drawing's network, with its calibration, is from the finite elements."""
    moments = _moments(loads)
    return _error_of(_network_curves(drawing, loads, moments) - _field_curves(drawing, loads, moments))


def _moments(loads: Sequence[Load]) -> FloatArray:
    """Return the times at which curves are compared [s]."""
    whole = math.fsum(load.duration for load in loads)
    return np.linspace(0.0, whole, _MOMENTS + 1)[1:]


def _field_curves(drawing: DamperDrawing, loads: Sequence[Load], moments: FloatArray) -> FloatArray:
    course = heat_field(drawing, loads)[1]
    return np.stack(
        [np.interp(moments, course.time, each) for each in (course.fluid, course.coil, course.wall)]
    )


def _network_curves(drawing: DamperDrawing, loads: Sequence[Load], moments: FloatArray) -> FloatArray:
    course: Heating = simulate_network(zone_network(drawing), loads)
    return np.stack(
        [np.interp(moments, course.time, each) for each in (course.fluid, course.coil, course.wall)]
    )


def _error_of(miss: FloatArray) -> NetworkError:
    """Return the error from differences, shape (3, moments)."""
    rms, worst = np.sqrt((miss**2).mean(axis=1)), np.abs(miss).max(axis=1)
    return NetworkError(*(float(value) for pair in zip(rms, worst, strict=True) for value in pair))
