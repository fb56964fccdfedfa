"""Functions of a size as cubics on octaves: the universal curve of the hysteresis, the functions of speed.

A cell is a cubic; cells double in width with every octave of the size, so that what bends near zero is fine
there and nowhere else. Each function is given the fewest cells with which it is within ``CURVE_ERROR`` of a
hysteretic state, or ``SPEED_ERROR``, everywhere it is looked at. ``track_tables.c`` reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mrdamper import core
from mrdamper.arrays import FloatArray

__all__ = [
    "CURVE_ERROR", "SPEED_ERROR", "CurveTables", "Octaves", "built_up", "fit_octaves", "functions_of_speed",
    "tabulate_octaves", "universal_curve",
]  # fmt: skip

CURVE_ERROR = 1e-4
"""Of a hysteretic state, which lies within -1 and 1."""

SPEED_ERROR = 1e-5
"""Of a function of speed; of the viscous one [m/s]."""

_MOST_BITS = 6
_VISCOUS_SPEED = 0.1  # [m/s], MRD_VISCOUS_SPEED of the kernel

_Function = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class Octaves:
    """A function of a size u >= 0 as cubics, shape (cells, 4), in the place 0 to 1 inside each cell.

    The cells of [2^k, 2^(k+1)) of u + ``offset`` number 2^``bits``; beyond ``top`` the last value holds.
    """

    offset: float
    top: float
    bits: int
    cell: FloatArray

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


def tabulate_octaves(
    value: _Function,
    slope: _Function,
    fine: float,
    end: float,
    *,
    bits: int = 4,
    rising: bool = False,
) -> Octaves:
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
    return Octaves(offset, float(ends[-1] * (1.0 - 1e-6)), bits, np.ascontiguousarray(cell))


def fit_octaves(
    value: _Function,
    slope: _Function,
    end: float,
    error: float,
    *,
    weight: _Function = np.ones_like,
    rising: bool = False,
) -> Octaves:
    """Return the smallest octaves that are nowhere further from the function than ``error``.

    ``weight`` of a size is what an error counts there. Where none is near enough, the finest.
    """
    inside = (np.arange(8) + 0.5) / 8.0
    best: Octaves | None = None
    for bits in range(_MOST_BITS + 1):
        for halvings in range(30):
            fine = 2.0 ** (math.ceil(math.log2(end)) - halvings)
            made = tabulate_octaves(value, slope, fine, end, bits=bits, rising=rising)
            if best is not None and len(made.cell) >= len(best.cell):
                break
            per = 2**bits
            octave, place = np.divmod(np.arange(len(made.cell)), per)
            begin = made.offset * 2.0**octave * (1.0 + place / per) - made.offset
            width = made.offset * 2.0**octave / per
            looked = (begin[:, None] + width[:, None] * inside).ravel()
            looked = np.append(looked[looked < end], end)
            if float(np.max(weight(looked) * np.abs(made.at(looked) - value(looked)))) <= error:
                best = made
                break
    return best or tabulate_octaves(value, slope, end / 2.0**14, end, bits=5, rising=rising)


@dataclass(frozen=True, slots=True, eq=False)
class CurveTables:
    """The universal curve over places: travel from w = 0, on the branch that loads and on that which unloads.

    A turn at w sets out at -w on the other branch. What it leads from and to are sizes of places.
    """

    unloaded: float  # travel of unloading from w = -1 to 0
    loading: Octaves  # size of w over travel
    unloading: Octaves
    from_loading: Octaves  # place on the unloading branch over that on the loading one
    from_unloading: Octaves  # ... and back, over the first half of the travel
    from_unloaded: Octaves  # the same for the second half, over what is left of it


def universal_curve(kappa: float, n: float, *, needed: bool = True) -> CurveTables:
    """Return the tables of u' = 1 - k u^n from zero, k = 1 where it loads and kappa where it unloads."""
    if not needed:
        nothing = _nothing(1.0)
        return CurveTables(1.0, nothing, nothing, nothing, nothing, nothing)
    end = 26.0 / n + 2.0
    dense = end * np.sinh(np.linspace(0.0, 14.0, 40_001)) / math.sinh(14.0)
    up, down = (np.maximum.accumulate(np.abs(core.curve(kappa, n, side * dense)[0])) for side in (1.0, -1.0))
    loaded = float(np.interp(1.0 - 0.2 * CURVE_ERROR, up, dense))
    unloaded = float(np.interp(1.0 - 1e-6, down, dense))

    def to_loading(u: FloatArray) -> FloatArray:
        return np.interp(u, up, dense)

    def to_unloading(u: FloatArray) -> FloatArray:
        return np.interp(u, down, dense)

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
        loading=fit_octaves(load, load_slope, loaded, CURVE_ERROR, rising=True),
        unloading=fit_octaves(unload, unload_slope, unloaded, CURVE_ERROR, rising=True),
        from_loading=fit_octaves(
            lambda tau: to_unloading(load(tau)),
            lambda tau: load_slope(tau) / unload_slope(to_unloading(load(tau))),
            loaded,
            CURVE_ERROR,
            weight=lambda tau: unload_slope(to_unloading(load(tau))),
            rising=True,
        ),
        from_unloading=fit_octaves(
            lambda tau: to_loading(unload(tau)),
            lambda tau: unload_slope(tau) / np.maximum(load_slope(to_loading(unload(tau))), 1e-9),
            half,
            CURVE_ERROR,
            weight=lambda tau: load_slope(to_loading(unload(tau))),
            rising=True,
        ),
        # sign reversed, so that it rises
        from_unloaded=fit_octaves(
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


def functions_of_speed(
    present: set[str], exponent: float, stribeck: float, transition: float, end: float
) -> dict[str, Octaves]:
    """Return what viscous, sliding and breakaway friction are multiplied with.

    One cell for what is not ``present``. Friction is tabulated as far as it still moves.
    """
    out = dict.fromkeys(("viscous", "sliding", "breakaway"), _nothing(end))
    if "viscous" in present:
        out["viscous"] = fit_octaves(
            lambda v: v * (np.maximum(v, 1e-300) / _VISCOUS_SPEED) ** (exponent - 1.0),
            lambda v: exponent * (np.maximum(v, 1e-9) / _VISCOUS_SPEED) ** (exponent - 1.0),
            end,
            SPEED_ERROR,
            rising=True,
        )
    side, steepness = _side(transition)
    if "sliding" in present:
        out["sliding"] = fit_octaves(side, steepness, min(end, 7.0 * transition), SPEED_ERROR, rising=True)
    if "breakaway" in present:
        out["breakaway"] = fit_octaves(
            lambda v: side(v) * np.exp(-((v / stribeck) ** 2)),
            lambda v: (steepness(v) - 2.0 * v / stribeck**2 * side(v)) * np.exp(-((v / stribeck) ** 2)),
            min(end, 3.5 * stribeck),
            SPEED_ERROR,
        )
    return out


def built_up(saturation: float | None, steep: float | None, end: float) -> Octaves:
    """Return the share of a yield force that is there at a speed, by the law's velocity; one cell without."""
    if saturation is not None:
        return fit_octaves(
            lambda v: v / (v + saturation),
            lambda v: saturation / (v + saturation) ** 2,
            end,
            SPEED_ERROR,
            rising=True,
        )
    if steep is not None:
        return fit_octaves(*_side(steep), min(end, 7.0 * steep), SPEED_ERROR, rising=True)
    return _nothing(end)


def _side(over: float) -> tuple[_Function, _Function]:
    """Return tanh(v / over) and its slope."""
    return (
        lambda v: np.asarray(np.tanh(v / over)),
        lambda v: np.asarray((1.0 - np.tanh(v / over) ** 2) / over),
    )


def _nothing(end: float) -> Octaves:
    return tabulate_octaves(np.zeros_like, np.zeros_like, end, end, bits=0)
