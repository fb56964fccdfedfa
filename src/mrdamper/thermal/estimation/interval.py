"""Compute 90 % intervals of a predicted heating curve, and of the times at which limits are reached.

Each uncertain quantity is increased and decreased by 1.645 standard deviations, a range that contains 90 % of
a normal distribution. The zone network is simulated with each change. The half widths of the interval, above
and below the curve, are the root sums of squares of the temperature changes. If the geometry is not
calibrated, the uncertain quantities are the fields of ``ModelUncertainty``. For a calibrated geometry, the
changes are along the principal axes of the covariance of the calibration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.models.card_draws import INTERVAL_PROBABILITY
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.calibration import PRIOR, CalibratedDrawing, with_factors
from mrdamper.thermal.limits import first_time
from mrdamper.thermal.model.lumped import lumped_network
from mrdamper.thermal.model.network import NODE_FACTORS, zone_network
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, simulate_network
from mrdamper.thermal.settings import SETTINGS
from mrdamper.thermal.temperature_rise import Model, Rise, loads_of


@dataclass(frozen=True, slots=True)
class TimeToLimit:
    """90 % interval of the time to a temperature limit; infinity: not reached."""

    low_s: float
    high_s: float


@dataclass(frozen=True, slots=True, eq=False)
class PredictionInterval:
    """90 % intervals of the fluid temperature and of the times to temperature limits."""

    time: FloatArray  # [s], shape (t,)
    median: FloatArray  # predicted fluid temperature [K], shape (t,)
    low: FloatArray  # lower end of the 90 % interval of ``median`` [K], shape (t,)
    high: FloatArray  # upper end of the 90 % interval of ``median`` [K], shape (t,)
    probability: float
    to_limits: tuple[TimeToLimit, ...]  # times to the limits of fluid, coil and seals

    @property
    def to_limit(self) -> TimeToLimit:
        """Interval of the time at which the fluid reaches its temperature limit."""
        return self.to_limits[0]


_Change = Mapping[str, float]
"""A change of uncertain quantities by name.

A value is the logarithm of a factor on power, capacity, loss, film, fluid_wall or coil. The value of start_K
is a shift of the initial temperature [K].
"""


def predict_interval(
    works: Sequence[LoopWork],
    drawing: DamperDrawing,
    duty: Duty,
    rise: Rise,
    *,
    calibrated: CalibratedDrawing | None = None,
    start_K: float | None = None,
) -> PredictionInterval:
    """Return the 90 % interval of a predicted heating curve and of the times to its limits.

    Parameters
    ----------
    works : mean power versus temperature for each segment of the load cycle
    rise : prediction for which the interval is computed
    calibrated : calibration of the geometry; None: the geometry was not calibrated
    start_K : uniform temperature at the start; None: the fitted temperature if calibrated, otherwise ambient
    """
    loads = loads_of(works, drawing, duty)
    changes = _prior_changes() if calibrated is None else _calibrated_changes(calibrated)
    start = start_K
    if start is not None:
        changes = [{**each, "start_K": 0.0} for each in changes]
    elif calibrated is not None:
        start = calibrated.start_K
    hottest = max([float(rise.fluid.max()), *(each.limit.kelvin for each in rise.limits)])
    runs = _runs(drawing, loads, changes, start, hottest + SETTINGS.stop_excess_K, rise.model)
    network, time = runs[0].network, runs[0].time
    misfit = 0.0 if calibrated is None else SETTINGS.misfit_ratio

    def band(weights: FloatArray, curve: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return ``curve`` [K] and its 90 % bounds at the times of the network simulation."""
        middle, up, down = _interval_widths(runs, weights)
        middle = middle + np.interp(time, rise.time, curve - np.interp(rise.time, time, middle))
        more = SETTINGS.interval_deviations * misfit * np.abs(middle - middle[0])
        return middle, middle - np.hypot(down, more), middle + np.hypot(up, more)

    at = {"gap": network.mechanical, "coil": network.coil, "seal": network.wall}
    reached = []
    for each in rise.limits:
        _, low, high = band(at[each.limit.part], rise.hot[each.limit.part])
        ends = (first_time(time, edge, each.limit.kelvin) for edge in (high, low))
        reached.append(TimeToLimit(*(math.inf if end is None else end for end in ends)))
    median, low, high = band(network.fluid, rise.fluid)
    return PredictionInterval(time, median, low, high, INTERVAL_PROBABILITY, tuple(reached))


def rise_factors(drawing: DamperDrawing, load: Load, at: FloatArray) -> FloatArray:
    """Return the bounds of the 90 % interval of the rise, divided by predicted rise.

    ``at`` are the times [s]. The rise is the fluid temperature in the gap minus the ambient temperature. The
    result has the shape (times, 2).
    """
    ambient = drawing.surroundings.ambient
    runs = _runs(drawing, [load], _prior_changes(), None, ambient + 250.0, "network")
    middle, up, down = _interval_widths(runs, runs[0].network.mechanical)
    ends = np.column_stack([middle - down, middle + up]) - ambient
    factors = ends / np.maximum(middle - ambient, 1e-9)[:, None]
    return np.column_stack([np.interp(at, runs[0].time, column) for column in factors.T])


def _prior_changes() -> list[_Change]:
    names = ("power", "capacity", "loss", "fluid_wall", "coil")
    return [{name: SETTINGS.interval_deviations * getattr(PRIOR, name)} for name in names]


def _calibrated_changes(calibrated: CalibratedDrawing) -> list[_Change]:
    """Return one change along each principal axis of the covariance of a calibration."""
    values, vectors = np.linalg.eigh(calibrated.covariance)
    axes = SETTINGS.interval_deviations * np.sqrt(np.maximum(values, 0.0)) * vectors
    return [dict(zip(("start_K", "capacity", "film"), axis.tolist(), strict=True)) for axis in axes.T]


def _runs(
    drawing: DamperDrawing,
    loads: Sequence[Load],
    changes: Sequence[_Change],
    start: float | None,
    stop_at: float,
    model: Model,
) -> list[Heating]:
    """Simulate the network with the nominal geometry, then with each change and the opposite change."""
    first = drawing.surroundings.ambient if start is None else start

    def run(change: _Change, side: float = 1.0) -> Heating:
        def factor(name: str) -> float:
            return math.exp(side * change.get(name, 0.0))

        changed = with_factors(drawing, 1.0, factor("film"))
        wall, coil = NODE_FACTORS.fluid_wall * factor("fluid_wall"), NODE_FACTORS.coil * factor("coil")
        nodes = replace(NODE_FACTORS, fluid_wall=wall, coil=coil)
        network = lumped_network(changed) if model == "lumped" else zone_network(changed, nodes)
        capacity, watts = network.capacity * factor("capacity"), network.watts * factor("loss")
        network = replace(network, capacity=capacity, watts=watts)
        stop = min(stop_at, float(network.grid[-1]) - SETTINGS.run_margin_K)
        driven = [each.scaled(factor("power")) for each in loads]
        begin = first + side * change.get("start_K", 0.0)
        return simulate_network(network, driven, start=begin, stop_at=stop)

    return [run({}), *(run(change, side) for change in changes for side in (1.0, -1.0))]


def _interval_widths(
    runs: Sequence[Heating], weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a weighted mean of node temperatures, and its deviations up and down [K]."""
    time = runs[0].time
    middle, *changed = (np.interp(time, each.time, each.temperature @ weights) for each in runs)
    off = (np.array(changed) - middle).reshape(-1, 2, len(time))
    up, down = (np.sqrt((np.maximum(side, 0.0).max(axis=1) ** 2).sum(axis=0)) for side in (off, -off))
    return middle, up, down
