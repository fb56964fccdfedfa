"""Lookup tables of the normalised hysteresis curve and of the functions of speed.

A table is piecewise cubic. Most functions are strongly curved near zero. Therefore the cell width doubles
with every octave of the argument. Each table has as few cells as its error limit permits. The limit applies
to all test points and is ``curve_error`` (hysteretic state) or ``speed_error`` (function of speed). The C
file ``track_tables.h`` evaluates the tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, read_only
from mrdamper.control.settings import SETTINGS
from mrdamper.models.laws import VISCOUS_SPEED

TEST_POINTS = np.linspace(0.0625, 0.9375, 8)  # Positions in a cell where table and function are compared.

_Function = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class LookupTable:
    """A piecewise cubic function of u >= 0.

    Each cell has the four coefficients of a polynomial in the relative position in the cell, which runs from
    0 to 1. Every octave [2^k, 2^(k+1)) of u + ``offset`` is divided into 2^``bits`` cells of equal width.
    Above ``top``, the function has its value at ``top``.
    """

    offset: float
    top: float
    bits: int
    cell: FloatArray

    @property
    def native(self) -> tuple[float, float, int, FloatArray]:
        """Return the arguments of the kernel's binding."""
        return self.offset, self.top, self.bits, self.cell

    def evaluate(self, size: FloatArray | float) -> FloatArray:
        """Return the function values at ``size``, computed from the table as in the kernel."""
        t = np.minimum(np.asarray(size, dtype=np.float64) + self.offset, self.top)
        octave = np.floor(np.log2(t / self.offset))
        octave -= self.offset * 2.0**octave > t
        share = (t / (self.offset * 2.0**octave) - 1.0) * 2.0**self.bits
        index = np.minimum(np.floor(share), 2.0**self.bits - 1.0)
        c: FloatArray = self.cell[(octave * 2.0**self.bits + index).astype(np.intp)]
        place = share - index
        return c[..., 0] + place * (c[..., 1] + place * (c[..., 2] + place * c[..., 3]))


def tabulate_lookup(
    value: _Function,
    slope: _Function,
    fine: float,
    end: float,
    *,
    bits: int = 4,
    rising: bool = False,
) -> LookupTable:
    """Return the table of a function from 0 to ``end`` by piecewise cubic Hermite interpolation.

    Below ``fine``, all cells have the same width. If ``rising`` is True, the interpolation is monotone
    (Fritsch & Carlson): the slopes at both sides of a cell are limited to three times its secant slope.
    """
    offset = 2.0 ** math.floor(math.log2(fine))
    octaves = max(1, math.ceil(math.log2((end + offset) / offset)))
    per = 2**bits
    ends = np.concatenate(
        [offset * 2.0**k * (1.0 + np.arange(per) / per) for k in range(octaves)] + [[offset * 2.0**octaves]]
    )
    knots = ends - offset
    f, d, width = value(knots), slope(knots), np.diff(knots)
    rise = np.diff(f)
    before, after = d[:-1] * width, d[1:] * width
    if rising:
        most = 3.0 * np.maximum(rise, 0.0)
        before, after = np.minimum(before, most), np.minimum(after, most)
    cell = np.stack([f[:-1], before, 3.0 * rise - 2.0 * before - after, before + after - 2.0 * rise], axis=1)
    return LookupTable(offset, float(ends[-1] * (1.0 - 1e-6)), bits, read_only(cell))


def fit_lookup(
    value: _Function,
    slope: _Function,
    end: float,
    error: float,
    *,
    weight: _Function = np.ones_like,
    rising: bool = False,
) -> LookupTable:
    """Return the smallest table whose error is at most ``error``.

    ``weight`` returns the weight of the error at each argument. If no table is sufficient, the finest table
    is returned.
    """
    best: LookupTable | None = None
    for bits in range(SETTINGS.cell_bits_max + 1):
        for halvings in range(30):
            fine = 2.0 ** (math.ceil(math.log2(end)) - halvings)
            made = tabulate_lookup(value, slope, fine, end, bits=bits, rising=rising)
            if best is not None and len(made.cell) >= len(best.cell):
                break
            # One test point per cell rejects most tables, so it is compared first.
            if all(
                _error(made, value, weight, end, places) <= error
                for places in (TEST_POINTS[3:4], TEST_POINTS)
            ):
                best = made
                break
    return best or tabulate_lookup(value, slope, end / 2.0**14, end, bits=5, rising=rising)


def _error(table: LookupTable, value: _Function, weight: _Function, end: float, places: FloatArray) -> float:
    per = 2**table.bits
    octave, place = np.divmod(np.arange(len(table.cell)), per)
    begin = table.offset * 2.0**octave * (1.0 + place / per) - table.offset
    width = table.offset * 2.0**octave / per
    looked = (begin[:, None] + width[:, None] * places).ravel()
    looked = np.append(looked[looked < end], end)
    return float(np.max(weight(looked) * np.abs(table.evaluate(looked) - value(looked))))


@dataclass(frozen=True, slots=True, eq=False)
class CurveTables:
    """Tables of the loading and unloading branch of the hysteresis curve w(travel).

    Both branches begin at w = 0 and travel 0. After a reversal at w, the motion continues on the other
    branch, at the point with -w. ``unload_map`` converts the travel on the loading branch to the travel at
    this point of the unloading branch. ``reload_map`` is the inverse function. All values are absolute
    values.
    """

    unloaded: float  # travel of the unloading branch between w = 0 and w = -1
    loading: LookupTable  # |w| versus travel on the loading branch
    unloading: LookupTable  # |w| versus travel on the unloading branch
    unload_map: LookupTable  # travel on the unloading branch, for a given travel on the loading branch
    reload_map: LookupTable  # travel on the loading branch, for the first half of the unloading branch
    reload_map_rest: LookupTable  # minus this travel, for the second half; argument: travel left to w = -1


def no_curve() -> CurveTables:
    """Return placeholder tables for a damper without hysteretic element."""
    return CurveTables(1.0, *(_zero_table(1.0),) * 5)


@dataclass(frozen=True, slots=True, eq=False)
class _Branches:
    """The loading branch (k = 1) and unloading branch (k = kappa) of u' = 1 - k u^n.

    u is |w|, and u(0) = 0. Values and slopes are exact. The inverse functions are interpolated between
    samples.
    """

    kappa: float
    n: float
    travel: FloatArray  # travel at which both branches are sampled, increasing
    loading: FloatArray  # u on the loading branch
    unloading: FloatArray  # u on the unloading branch
    unloading_travel: FloatArray  # like ``travel``, but constant from the point where u reaches 1
    loaded: float  # travel at which the loading branch practically reaches w = 1
    unloaded: float  # travel at which the unloading branch reaches w = -1

    def to_loading(self, u: FloatArray) -> FloatArray:
        return np.interp(u, self.loading, self.travel)

    def to_unloading(self, u: FloatArray) -> FloatArray:
        return np.interp(u, self.unloading, self.unloading_travel)

    def load(self, tau: FloatArray) -> FloatArray:
        return np.abs(core.curve(self.kappa, self.n, tau)[0])

    def load_slope(self, tau: FloatArray) -> FloatArray:
        return np.asarray(1.0 - np.minimum(self.load(tau), 1.0) ** self.n)

    def unload(self, tau: FloatArray) -> FloatArray:
        there = np.abs(core.curve(self.kappa, self.n, -np.minimum(tau, self.unloaded))[0])
        slope = 1.0 - self.kappa * there**self.n
        return np.asarray(there + slope * np.maximum(tau - self.unloaded, 0.0))

    def unload_slope(self, tau: FloatArray) -> FloatArray:
        return np.asarray(1.0 - self.kappa * np.minimum(self.unload(tau), 1.0) ** self.n)

    def reload(self, tau: FloatArray) -> FloatArray:
        return self.to_loading(self.unload(tau))

    def reload_slope(self, tau: FloatArray) -> FloatArray:
        return self.unload_slope(tau) / np.maximum(self.load_slope(self.reload(tau)), 1e-9)


def _sample_branches(kappa: float, n: float) -> _Branches:
    end = 26.0 / n + 2.0
    dense = end * np.sinh(np.linspace(0.0, 14.0, 40_001)) / math.sinh(14.0)
    up, down = (np.maximum.accumulate(np.abs(core.curve(kappa, n, side * dense)[0])) for side in (1.0, -1.0))
    fall = dense.copy()
    stop = int(np.argmax(down >= 1.0 - 1e-12))
    if stop:  # w = -1 is between two samples. For kappa = 0, w never reaches -1.
        slope = max(1.0 - kappa * down[stop - 1] ** n, 1e-9)
        fall[stop:] = min(fall[stop], fall[stop - 1] + (down[stop] - down[stop - 1]) / slope)
    loaded = float(np.interp(1.0 - 0.2 * SETTINGS.curve_error, up, dense))
    unloaded = float(np.interp(1.0 - 1e-6, down, fall))
    return _Branches(kappa, n, dense, up, down, fall, loaded, unloaded)


@lru_cache(maxsize=16)  # A card's controllers, model and simulated damper use the same curve.
def universal_curve(kappa: float, n: float) -> CurveTables:
    """Tabulate the hysteresis curve u(travel) and its inverse, where u = |w|.

    The curve is the solution of u' = 1 - k u^n, u(0) = 0, with k = 1 (loading) and k = kappa (unloading).
    """
    curve = _sample_branches(kappa, n)
    loaded, unloaded, half = curve.loaded, curve.unloaded, 0.5 * curve.unloaded

    def position(rest: FloatArray) -> FloatArray:
        return np.maximum(unloaded - rest, 0.0)

    def unload_slope_after(tau: FloatArray) -> FloatArray:
        return curve.unload_slope(curve.to_unloading(curve.load(tau)))

    return CurveTables(
        unloaded=unloaded,
        loading=fit_lookup(curve.load, curve.load_slope, loaded, SETTINGS.curve_error, rising=True),
        unloading=fit_lookup(curve.unload, curve.unload_slope, unloaded, SETTINGS.curve_error, rising=True),
        unload_map=fit_lookup(
            lambda tau: curve.to_unloading(curve.load(tau)),
            lambda tau: curve.load_slope(tau) / unload_slope_after(tau),
            loaded,
            SETTINGS.curve_error,
            weight=unload_slope_after,
            rising=True,
        ),
        reload_map=fit_lookup(
            curve.reload,
            curve.reload_slope,
            half,
            SETTINGS.curve_error,
            weight=lambda tau: curve.load_slope(curve.reload(tau)),
            rising=True,
        ),
        # ``fit_lookup`` requires a rising function. Therefore this table contains negative travel.
        reload_map_rest=fit_lookup(
            lambda rest: -curve.reload(position(rest)),
            lambda rest: curve.reload_slope(position(rest)),
            half,
            SETTINGS.curve_error,
            weight=lambda rest: curve.load_slope(curve.reload(position(rest))),
            rising=True,
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpeedTables:
    """Functions of the speed [m/s] that multiply forces."""

    viscous: LookupTable  # viscous force divided by the viscosity [m/s]
    sliding: LookupTable  # factor on the kinetic friction force
    breakaway: LookupTable  # factor on the breakaway friction force
    saturation: LookupTable  # factor on a yield force that increases with the speed


def no_functions_of_speed() -> SpeedTables:
    """Return placeholder tables for a damper without functions of speed."""
    return SpeedTables(*(_zero_table(1.0),) * 4)


def functions_of_speed(
    present: set[str], shape: Mapping[str, float], end: float, *, saturating: bool, memoryless: bool
) -> SpeedTables:
    """Tabulate the functions of speed up to ``end`` [m/s]; unused ones get one cell.

    Friction is tabulated up to the speed at which it becomes constant.

    Parameters
    ----------
    present : rows of the damper's tables (``card_tables.ROWS``); of these, viscous, sliding and breakaway
        need a function
    shape : values of the exponent and of the velocities of the hysteresis law, by coefficient name
    saturating : True if a yield force saturates with speed
    memoryless : True if the yield force depends on the velocity only (no hysteresis)
    """
    nothing = _zero_table(end)
    viscous = sliding = breakaway = saturation = nothing
    names = ("viscous_exponent", "stribeck_velocity", "transition_velocity")
    exponent, stribeck, transition = (shape[name] for name in names)
    if "viscous" in present:
        viscous = fit_lookup(
            lambda v: v * (np.maximum(v, 1e-300) / VISCOUS_SPEED) ** (exponent - 1.0),
            lambda v: exponent * (np.maximum(v, 1e-9) / VISCOUS_SPEED) ** (exponent - 1.0),
            end,
            SETTINGS.speed_error,
            rising=True,
        )
    side, steepness = _side(transition)
    if "sliding" in present:
        sliding = fit_lookup(side, steepness, min(end, 7.0 * transition), SETTINGS.speed_error, rising=True)
    if "breakaway" in present:
        breakaway = fit_lookup(
            lambda v: side(v) * np.exp(-((v / stribeck) ** 2)),
            lambda v: (steepness(v) - 2.0 * v / stribeck**2 * side(v)) * np.exp(-((v / stribeck) ** 2)),
            min(end, 3.5 * stribeck),
            SETTINGS.speed_error,
        )
    if saturating:
        saturation = _saturation(shape["saturation_velocity"], end)
    elif memoryless:
        steep = shape["yield_velocity"]
        saturation = fit_lookup(*_side(steep), min(end, 7.0 * steep), SETTINGS.speed_error, rising=True)
    return SpeedTables(viscous, sliding, breakaway, saturation)


def _saturation(half: float, end: float) -> LookupTable:
    return fit_lookup(
        lambda v: v / (v + half), lambda v: half / (v + half) ** 2, end, SETTINGS.speed_error, rising=True
    )


def _side(over: float) -> tuple[_Function, _Function]:
    return (
        lambda v: np.asarray(np.tanh(v / over)),
        lambda v: np.asarray((1.0 - np.tanh(v / over) ** 2) / over),
    )


def _zero_table(end: float) -> LookupTable:
    return tabulate_lookup(np.zeros_like, np.zeros_like, end, end, bits=0)
