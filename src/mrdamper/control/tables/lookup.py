"""Binned lookup tables: the universal curve of the hysteresis, and the functions of speed.

A table is piecewise cubic; its cells double in width with every octave of the size, so that what bends near
zero is fine there and nowhere else. Each function is given the fewest cells with which it is within
``CURVE_ERROR`` of a hysteretic state, or ``SPEED_ERROR``, everywhere it is looked at. ``track_tables.h``
reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray, read_only
from mrdamper.models.laws import VISCOUS_SPEED

CURVE_ERROR = 1e-4
"""Of a hysteretic state, which lies within -1 and 1."""

SPEED_ERROR = 1e-5
"""Of a function of speed; of the viscous one [m/s]."""

_MOST_BITS = 6
_LOOKED = np.linspace(0.0625, 0.9375, 8)  # places of a cell where table and function are compared

_Function = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class LookupTable:
    """A function of a size u >= 0 as cubics, shape (cells, 4), in the place 0 to 1 inside each cell.

    The cells of [2^k, 2^(k+1)) of u + ``offset`` number 2^``bits``; beyond ``top`` the last value holds.
    """

    offset: float
    top: float
    bits: int
    cell: FloatArray

    @property
    def native(self) -> tuple[float, float, int, FloatArray]:
        """What the kernel's binding takes."""
        return self.offset, self.top, self.bits, self.cell

    def at(self, size: FloatArray | float) -> FloatArray:
        """Return the function at sizes, as the kernel reads it."""
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
    """Return a function of a size, from 0 to ``end``, as cubics through values and slopes at the cells' ends.

    ``fine`` is the size below which the cells are of one width. With ``rising`` no slope is steeper than
    three times the chord, so that the cubics rise as their ends do (Fritsch & Carlson).
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
    """Return the smallest table that is nowhere further from the function than ``error``.

    ``weight`` of a size is what an error counts there. Where none is near enough, the finest.
    """
    best: LookupTable | None = None
    for bits in range(_MOST_BITS + 1):
        for halvings in range(30):
            fine = 2.0 ** (math.ceil(math.log2(end)) - halvings)
            made = tabulate_lookup(value, slope, fine, end, bits=bits, rising=rising)
            if best is not None and len(made.cell) >= len(best.cell):
                break
            # most tables fail already where each of their cells is looked at once
            if all(_error(made, value, weight, end, places) <= error for places in (_LOOKED[3:4], _LOOKED)):
                best = made
                break
    return best or tabulate_lookup(value, slope, end / 2.0**14, end, bits=5, rising=rising)


def _error(table: LookupTable, value: _Function, weight: _Function, end: float, places: FloatArray) -> float:
    """Return the largest weighed error of a table at ``places`` of each cell, 0 to 1, and at ``end``."""
    per = 2**table.bits
    octave, place = np.divmod(np.arange(len(table.cell)), per)
    begin = table.offset * 2.0**octave * (1.0 + place / per) - table.offset
    width = table.offset * 2.0**octave / per
    looked = (begin[:, None] + width[:, None] * places).ravel()
    looked = np.append(looked[looked < end], end)
    return float(np.max(weight(looked) * np.abs(table.at(looked) - value(looked))))


@dataclass(frozen=True, slots=True, eq=False)
class CurveTables:
    """The universal curve over places: travel from w = 0, on the branch that loads and on that which unloads.

    A turn at w sets out at -w on the other branch. What it leads from and to are sizes of places.
    """

    unloaded: float  # travel of unloading from w = -1 to 0
    loading: LookupTable  # size of w over travel
    unloading: LookupTable
    unload_map: LookupTable  # place on the unloading branch over that on the loading one
    reload_map: LookupTable  # ... and back, over the first half of the travel
    reload_map_rest: LookupTable  # the same for the second half, over what is left of it


def no_curve() -> CurveTables:
    """Return the tables of a law that has no hysteretic element: nothing is looked up in them."""
    return CurveTables(1.0, *(_nothing(1.0),) * 5)


@lru_cache(maxsize=16)  # controllers, model and plant of one card have the same
def universal_curve(kappa: float, n: float) -> CurveTables:
    """Return the tables of u' = 1 - k u^n from zero, k = 1 where it loads and kappa where it unloads."""
    end = 26.0 / n + 2.0
    dense = end * np.sinh(np.linspace(0.0, 14.0, 40_001)) / math.sinh(14.0)
    up, down = (np.maximum.accumulate(np.abs(core.curve(kappa, n, side * dense)[0])) for side in (1.0, -1.0))
    fall = dense.copy()
    stop = int(np.argmax(down >= 1.0 - 1e-12))
    if stop:  # w = -1, where unloading ends, lies between two places; with kappa 0 the curve stands still
        slope = max(1.0 - kappa * down[stop - 1] ** n, 1e-9)
        fall[stop:] = min(fall[stop], fall[stop - 1] + (down[stop] - down[stop - 1]) / slope)
    loaded = float(np.interp(1.0 - 0.2 * CURVE_ERROR, up, dense))
    unloaded = float(np.interp(1.0 - 1e-6, down, fall))

    def to_loading(u: FloatArray) -> FloatArray:
        return np.interp(u, up, dense)

    def to_unloading(u: FloatArray) -> FloatArray:
        return np.interp(u, down, fall)

    def load(tau: FloatArray) -> FloatArray:
        return np.abs(core.curve(kappa, n, tau)[0])

    def load_slope(tau: FloatArray) -> FloatArray:
        return np.asarray(1.0 - np.minimum(load(tau), 1.0) ** n)

    def unload(tau: FloatArray) -> FloatArray:  # past the end the line that the last cell may touch
        there = np.abs(core.curve(kappa, n, -np.minimum(tau, unloaded))[0])
        return np.asarray(there + (1.0 - kappa * there**n) * np.maximum(tau - unloaded, 0.0))

    def unload_slope(tau: FloatArray) -> FloatArray:
        return np.asarray(1.0 - kappa * np.minimum(unload(tau), 1.0) ** n)

    def left(rest: FloatArray) -> FloatArray:
        return np.maximum(unloaded - rest, 0.0)

    half = 0.5 * unloaded
    return CurveTables(
        unloaded=unloaded,
        loading=fit_lookup(load, load_slope, loaded, CURVE_ERROR, rising=True),
        unloading=fit_lookup(unload, unload_slope, unloaded, CURVE_ERROR, rising=True),
        unload_map=fit_lookup(
            lambda tau: to_unloading(load(tau)),
            lambda tau: load_slope(tau) / unload_slope(to_unloading(load(tau))),
            loaded,
            CURVE_ERROR,
            weight=lambda tau: unload_slope(to_unloading(load(tau))),
            rising=True,
        ),
        reload_map=fit_lookup(
            lambda tau: to_loading(unload(tau)),
            lambda tau: unload_slope(tau) / np.maximum(load_slope(to_loading(unload(tau))), 1e-9),
            half,
            CURVE_ERROR,
            weight=lambda tau: load_slope(to_loading(unload(tau))),
            rising=True,
        ),
        # sign reversed, so that it rises
        reload_map_rest=fit_lookup(
            lambda rest: -to_loading(unload(left(rest))),
            lambda rest: (
                unload_slope(left(rest)) / np.maximum(load_slope(to_loading(unload(left(rest)))), 1e-9)
            ),
            half,
            CURVE_ERROR,
            weight=lambda rest: load_slope(to_loading(unload(left(rest)))),
            rising=True,
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpeedTables:
    """What forces are multiplied with at a speed [m/s]."""

    viscous: LookupTable  # the viscosity [m/s]
    sliding: LookupTable
    breakaway: LookupTable
    saturation: LookupTable  # a yield force that saturates with speed, or one without memory


def no_functions_of_speed() -> SpeedTables:
    """Return the tables of a law that has none: nothing is looked up in them."""
    return SpeedTables(*(_nothing(1.0),) * 4)


def functions_of_speed(
    present: set[str], shape: Mapping[str, float], end: float, *, saturating: bool, memoryless: bool
) -> SpeedTables:
    """Return the functions of speed up to ``end`` [m/s]; one cell for what is not there.

    Friction is tabulated as far as it still moves.

    Parameters
    ----------
    present : rows that the law has, of viscous, sliding, breakaway
    shape : exponent and velocities of the law, by coefficient
    saturating, memoryless : whether a yield force saturates with speed, or follows its sign
    """
    nothing = _nothing(end)
    viscous = sliding = breakaway = saturation = nothing
    exponent, stribeck = shape["viscous_exponent"], shape["stribeck_velocity"]
    transition = shape["transition_velocity"]
    if "viscous" in present:
        viscous = fit_lookup(
            lambda v: v * (np.maximum(v, 1e-300) / VISCOUS_SPEED) ** (exponent - 1.0),
            lambda v: exponent * (np.maximum(v, 1e-9) / VISCOUS_SPEED) ** (exponent - 1.0),
            end,
            SPEED_ERROR,
            rising=True,
        )
    side, steepness = _side(transition)
    if "sliding" in present:
        sliding = fit_lookup(side, steepness, min(end, 7.0 * transition), SPEED_ERROR, rising=True)
    if "breakaway" in present:
        breakaway = fit_lookup(
            lambda v: side(v) * np.exp(-((v / stribeck) ** 2)),
            lambda v: (steepness(v) - 2.0 * v / stribeck**2 * side(v)) * np.exp(-((v / stribeck) ** 2)),
            min(end, 3.5 * stribeck),
            SPEED_ERROR,
        )
    if saturating:
        saturation = _saturation(shape["saturation_velocity"], end)
    elif memoryless:
        steep = shape["yield_velocity"]
        saturation = fit_lookup(*_side(steep), min(end, 7.0 * steep), SPEED_ERROR, rising=True)
    return SpeedTables(viscous, sliding, breakaway, saturation)


def _saturation(half: float, end: float) -> LookupTable:
    """Return the saturation curve v / (v + half)."""
    return fit_lookup(
        lambda v: v / (v + half), lambda v: half / (v + half) ** 2, end, SPEED_ERROR, rising=True
    )


def _side(over: float) -> tuple[_Function, _Function]:
    """Return tanh(v / over) and its slope."""
    return (
        lambda v: np.asarray(np.tanh(v / over)),
        lambda v: np.asarray((1.0 - np.tanh(v / over) ** 2) / over),
    )


def _nothing(end: float) -> LookupTable:
    return tabulate_lookup(np.zeros_like, np.zeros_like, end, end, bits=0)
