"""How sure a heating curve is: the interval about it, and about the time to the fluid's limit.

Before anything was measured the drawing and the card may be off as ``ModelUncertainty`` says. A measured
curve leaves of that what it could not tell: the covariance of P/C and UA/C, and of what lies between the
thermometer and the fluid. Beyond the curve's last time this is the early prediction for a damper that was
drawn; for one that nobody has drawn see ``prediction``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.calibration import CalibratedDrawing
from mrdamper.thermal.estimation.measured_curve import Place
from mrdamper.thermal.estimation.uncertainty import (
    BODY,
    CAPACITY,
    COIL,
    FACTORS,
    LOSS,
    ModelUncertainty,
    PredictionInterval,
    UncertainNetwork,
    WatchedPoint,
)
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.temperature_rise import Rise, build_network, loads_of

_MISFITS: Mapping[Place, float] = MappingProxyType({"fluid": 0.002, "wall": 0.004, "coil": 0.004})
"""What no multiplier mends of a calibrated network: share of the rise [-], by the thermometer's place."""

_DAMPERS = 800  # drawn: the ends of the interval are then smooth over time


def predict_interval(
    works: Sequence[LoopWork],
    drawing: DamperDrawing,
    duty: Duty,
    *,
    calibrated: CalibratedDrawing | None = None,
    start_K: float | None = None,
    rise: Rise | None = None,
) -> PredictionInterval:
    """Return the interval about a drawing's heating under a duty.

    Parameters
    ----------
    works : one for each segment of the duty
    calibrated : what a measured curve told of this very drawing; None: nothing was measured
    start_K : temperature of everything at the start; None: the fitted one, else ambient
    rise : of this drawing under this duty by any model: the dampers that are drawn lie about it, and the
        times to all its limits are told; None: about the network's own curve, and the fluid's limit alone
    """
    uncertain = UncertainNetwork(build_network(drawing, "network" if rise is None else rise.model))
    n = uncertain.nodes
    mean, covariance = np.zeros(n + len(FACTORS)), np.zeros((n + len(FACTORS),) * 2)
    mean[:n] = drawing.surroundings.ambient
    if calibrated is None:
        covariance[n:, n:] = ModelUncertainty().covariance
    else:
        mean[:n] = calibrated.parameters.start_K
        covariance = _covariance_of(calibrated, n)
    if start_K is not None:
        mean[:n] = start_K
        covariance[:n, :] = covariance[:, :n] = 0.0
    loads = loads_of(works, drawing, duty)
    return uncertain.look_ahead(
        mean,
        covariance,
        loads,
        _watched(uncertain, mean, loads, drawing, rise),
        misfit=0.0 if calibrated is None else _MISFITS[calibrated.curve.place],
        dampers=_DAMPERS,
    )


def _watched(
    uncertain: UncertainNetwork,
    mean: FloatArray,
    loads: Sequence[Load],
    drawing: DamperDrawing,
    rise: Rise | None,
) -> list[WatchedPoint]:
    """Return the fluid's mean and the hottest points, each as far above the network's node as the rise is."""
    network, limit = uncertain.network, drawing.filling.valid_K[1]
    if rise is None:
        return [WatchedPoint(network.fluid, limit, np.zeros(1), np.zeros(1))]
    hottest = max(each.limit.kelvin for each in rise.limits)
    time, nodes = uncertain.run_ahead(mean[None], loads, hottest_K=hottest + 100.0)
    node = {"gap": network.mechanical, "coil": network.coil, "seal": network.wall}
    curves = [(network.fluid, limit, rise.fluid)]
    curves += [(node[each.limit.part], each.limit.kelvin, rise.hot[each.limit.part]) for each in rise.limits]
    return [
        WatchedPoint(weights, at, rise.time, curve - np.interp(rise.time, time, nodes[:, 0] @ weights))
        for weights, at, curve in curves
    ]


def _covariance_of(calibrated: CalibratedDrawing, nodes: int) -> FloatArray:
    """Return the covariance that a fit left, of a state: the start is that of all nodes."""
    where = np.zeros((nodes + len(FACTORS), 5))
    where[:nodes, 0] = 1.0
    for column, factor in enumerate((CAPACITY, LOSS, BODY, COIL), 1):
        where[nodes + factor, column] = 1.0
    return np.asarray(where @ calibrated.spread @ where.T)
