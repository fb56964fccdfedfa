"""Intervals of a heating curve, and of the times to its limits.

Each source of uncertainty is changed up and down by the 1.645 standard deviations that hold 90 % of a
normal distribution, and the zone network is run with it. The effects of the sources are added in squares,
separately above and below the curve. Without a measured curve the sources are those of
``ModelUncertainty``. With one they are the principal axes of the calibration's covariance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.thermal.dissipation import LoopWork
from mrdamper.thermal.drawing import DamperDrawing
from mrdamper.thermal.duty import Duty
from mrdamper.thermal.estimation.calibration import PRIOR, CalibratedDrawing, with_factors
from mrdamper.thermal.limits import first_time
from mrdamper.thermal.model.network import ThermalNetwork
from mrdamper.thermal.model.stepping import Load
from mrdamper.thermal.model.transient import Heating, simulate_network
from mrdamper.thermal.temperature_rise import Rise, build_network, loads_of

PROBABILITY = 0.90
DEVIATIONS = 1.645  # standard deviations on either side that hold 90 % of a normal distribution
STOP_EXCESS_K = 50.0  # Runs end this far above all limits because nothing is asked of them there.
GRID_MARGIN_K = 20.0
MISFIT_RATIO = 0.004  # What no factor corrects in a calibrated network, as a fraction of the rise.


@dataclass(frozen=True, slots=True)
class TimeToLimit:
    """The interval of the time at which a temperature is reached; infinity: not within the duty."""

    low_s: float
    high_s: float


@dataclass(frozen=True, slots=True, eq=False)
class PredictionInterval:
    """The interval of the fluid's temperature over time, and of the times to limits."""

    time: FloatArray  # [s], shape (t,)
    median: FloatArray  # of the fluid [K], shape (t,)
    low: FloatArray  # [K], shape (t,)
    high: FloatArray
    probability: float
    to_limits: tuple[TimeToLimit, ...]  # for each of the rise's limits

    @property
    def to_limit(self) -> TimeToLimit:
        """The time to the first of the limits: the fluid's."""
        return self.to_limits[0]


@dataclass(frozen=True, slots=True)
class _Change:
    """Logarithms of factors, and a shift of the start [K]."""

    power: float = 0.0
    capacity: float = 0.0
    loss: float = 0.0
    film: float = 0.0
    fluid_wall: float = 0.0
    coil: float = 0.0
    start_K: float = 0.0

    def reversed(self) -> _Change:
        """Return the opposite change."""
        return _Change(*(-getattr(self, name) for name in self.__slots__))


def predict_interval(
    works: Sequence[LoopWork],
    drawing: DamperDrawing,
    duty: Duty,
    rise: Rise,
    *,
    calibrated: CalibratedDrawing | None = None,
    start_K: float | None = None,
) -> PredictionInterval:
    """Return the interval about a rise of a geometry under a duty.

    Parameters
    ----------
    works : one for each segment of the duty
    calibrated : the calibration that gave the geometry; None: nothing was measured
    start_K : temperature of everything at the start, if it is known; None: the fitted one, else ambient
    """
    loads = loads_of(works, drawing, duty)
    changes = list(_prior_changes()) if calibrated is None else list(_calibrated_changes(calibrated))
    start = start_K
    if start is not None:
        changes = [replace(each, start_K=0.0) for each in changes]
    elif calibrated is not None:
        start = calibrated.start_K
    hottest = max([float(rise.fluid.max()), *(each.limit.kelvin for each in rise.limits)])
    model = "lumped" if rise.model == "lumped" else "network"
    runs = _runs(drawing, loads, changes, start, hottest + STOP_EXCESS_K, model)
    network, time = runs[0].network, runs[0].time
    misfit = 0.0 if calibrated is None else MISFIT_RATIO

    def band(weights: FloatArray, curve: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a curve [K] at all times, and its ends: beyond its last time it follows the network."""
        middle, up, down = _spread(runs, weights)
        middle = middle + np.interp(time, rise.time, curve - np.interp(rise.time, time, middle))
        more = DEVIATIONS * misfit * np.abs(middle - middle[0])
        return middle, middle - np.hypot(down, more), middle + np.hypot(up, more)

    at = {"gap": network.mechanical, "coil": network.coil, "seal": network.wall}
    reached = []
    for each in rise.limits:
        _, low, high = band(at[each.limit.part], rise.hot[each.limit.part])
        ends = (first_time(time, edge, each.limit.kelvin) for edge in (high, low))
        reached.append(TimeToLimit(*(math.inf if end is None else end for end in ends)))
    median, low, high = band(network.fluid, rise.fluid)
    return PredictionInterval(time, median, low, high, PROBABILITY, tuple(reached))


def rise_factors(drawing: DamperDrawing, load: Load, at: FloatArray) -> FloatArray:
    """Return the ends of the interval of a rise, as factors of it, at times [s]; shape (len(at), 2).

    The rise is that of the node that takes the mechanical power, from ambient on.
    """
    ambient = drawing.surroundings.ambient
    runs = _runs(drawing, [load], list(_prior_changes()), None, ambient + 250.0, "network")
    middle, up, down = _spread(runs, runs[0].network.mechanical)
    ends = np.column_stack([middle - down, middle + up]) - ambient
    factors = ends / np.maximum(middle - ambient, 1e-9)[:, None]
    return np.column_stack([np.interp(at, runs[0].time, column) for column in factors.T])


def _prior_changes() -> Iterator[_Change]:
    for name in ("power", "capacity", "loss", "fluid_wall", "coil"):
        yield _Change(**{name: DEVIATIONS * getattr(PRIOR, name)})


def _calibrated_changes(calibrated: CalibratedDrawing) -> Iterator[_Change]:
    """Yield the change along each principal axis of the covariance."""
    values, vectors = np.linalg.eigh(calibrated.covariance)
    for value, vector in zip(values, vectors.T, strict=True):
        start, capacity, film = DEVIATIONS * math.sqrt(max(float(value), 0.0)) * vector
        yield _Change(start_K=float(start), capacity=float(capacity), film=float(film))


def _runs(
    drawing: DamperDrawing,
    loads: Sequence[Load],
    changes: Sequence[_Change],
    start: float | None,
    stop_at: float,
    model: str,
) -> list[Heating]:
    """Return the network's course as drawn, then with each change up and down."""
    first = drawing.surroundings.ambient if start is None else start

    def run(change: _Change) -> Heating:
        network = _changed(drawing, change, model)
        stop = min(stop_at, float(network.grid[-1]) - GRID_MARGIN_K)
        more = math.exp(change.power)
        driven = [replace(each, power=_Scaled(each, more)) for each in loads]
        return simulate_network(network, driven, start=first + change.start_K, stop_at=stop)

    return [run(_Change()), *(run(each) for change in changes for each in (change, change.reversed()))]


@dataclass(frozen=True, slots=True)
class _Scaled:
    """The power of a load times a factor."""

    load: Load
    factor: float

    def __call__(self, kelvin: FloatArray) -> FloatArray:
        return np.asarray(self.factor * self.load.power(kelvin))


def _changed(drawing: DamperDrawing, change: _Change, model: str) -> ThermalNetwork:
    own = drawing.calibration
    inner = replace(
        own, fluid_wall=own.fluid_wall * math.exp(change.fluid_wall), coil=own.coil * math.exp(change.coil)
    )
    changed = with_factors(replace(drawing, calibration=inner), 1.0, math.exp(change.film))
    network = build_network(changed, "lumped" if model == "lumped" else "network")
    return replace(
        network,
        capacity=network.capacity * math.exp(change.capacity),
        watts=network.watts * math.exp(change.loss),
    )


def _spread(runs: Sequence[Heating], weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a weighted temperature as drawn, and how far its interval reaches above and below it [K]."""
    time = runs[0].time
    middle, *changed = (np.interp(time, each.time, each.temperature @ weights) for each in runs)
    off = (np.array(changed) - middle).reshape(-1, 2, len(time))
    up, down = (np.sqrt((np.maximum(side, 0.0).max(axis=1) ** 2).sum(axis=0)) for side in (off, -off))
    return middle, up, down
