"""A damper in tables: what the controller's step reads instead of powers, exponentials and polynomials.

Force and inverse yield displacement over an even grid of currents and temperatures, the universal curve of
the hysteresis, and the functions of speed that the force is made of, each as cubics on cells that double in
width with every octave. Built once; the arrays are what an export prints. ``track_tables.c`` reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mrdamper import core
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper
from mrdamper.quantities import FloatArray

if TYPE_CHECKING:
    from mrdamper.control.series_tables import SeriesTables

__all__ = ["CURRENTS", "ROWS", "TABULATED", "DamperTables", "Octaves", "tabulate", "tabulate_octaves"]

CURRENTS = 33
"""Currents of the tables: the banks of 2, 3, 5 and 9 models lie on them."""

ROWS = ("offset", "stiffness", "mass", "viscous", "sliding", "breakaway", "yield", "second")
"""Rows of the force table: what multiplies 1, x, a, the functions of speed, and the two hysteretic states."""

TABULATED = ("bouc-wen", "dahl", "bouc-wen-saturating", "double-bouc-wen", "bingham")
"""Laws whose force is a sum over current-dependent rows, and whose shape does not depend on current."""

_TEMPERATURE_STEP_K = 10.0
_SHAPES = (
    "viscous_exponent", "stribeck_velocity", "transition_velocity", "kappa", "n", "saturation_velocity",
    "yield_velocity",
)  # fmt: skip
_INVERSE_BITS = 5
_VISCOUS_SPEED = 0.1  # [m/s], MRD_VISCOUS_SPEED of the kernel


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


@dataclass(frozen=True, slots=True, eq=False)
class DamperTables:
    """All tables of a damper, and the axes that they lie on."""

    currents: FloatArray  # [A or V], evenly from 0, shape (n,)
    temperatures: FloatArray  # [K], evenly, shape (t,)
    force: FloatArray  # [N per unit of what multiplies it], shape (t, 8, n)
    rho: FloatArray  # [1/m], shape (t, 2, n)
    elements: int
    saturating: bool
    loading: Octaves
    unloading: Octaves
    to_load: Octaves
    to_unload: Octaves
    viscous: Octaves
    sliding: Octaves
    breakaway: Octaves
    built_up: Octaves
    series: SeriesTables | None = None  # of the series valve law, which uses none of those above

    @property
    def octaves(self) -> tuple[Octaves, ...]:
        """The functions in the kernel's order."""
        curve = (self.loading, self.unloading, self.to_load, self.to_unload)
        return (*curve, self.viscous, self.sliding, self.breakaway, self.built_up)

    def scaled(
        self, yield_gain: float = 1.0, viscous_gain: float = 1.0, friction_gain: float = 1.0
    ) -> FloatArray:
        """Return the force table with its parts multiplied."""
        factors = dict.fromkeys(ROWS, 1.0)
        factors |= {"yield": yield_gain, "second": yield_gain, "viscous": viscous_gain}
        factors |= {"sliding": friction_gain, "breakaway": friction_gain}
        return np.asarray(self.force * np.array([factors[row] for row in ROWS])[:, None])


def tabulate(
    damper: Damper,
    largest: float,
    *,
    speed: float = 1.0,
    currents: int = CURRENTS,
    temperatures: tuple[float, float] | None = None,
) -> DamperTables:
    """Return the tables of a damper from 0 to the ``largest`` current [A or V].

    Parameters
    ----------
    speed : speed up to which the functions of speed are tabulated [m/s]
    temperatures : lowest and highest [K]; None: the damper's own range, or 20 degC alone where it has none

    Raises
    ------
    InputError
        A law that has no such tables, or one whose shape moves with current or temperature; a force that does
        not depend on the current; a law that is not well posed somewhere on the grid.
    """
    if damper.law.name == "series-valve":
        from mrdamper.control.series_tables import tabulate_series

        return tabulate_series(damper, largest, temperatures=temperatures)
    if damper.law.name not in TABULATED:
        raise InputError(
            f"controller: the law is {damper.law.name!r}; expected one of {', '.join(TABULATED)}, "
            "series-valve. Identify the same runs with one of these"
        )
    if not (math.isfinite(largest) and largest > 0.0):
        raise InputError(f"controller: the largest command is {largest}; expected a positive number")
    low, high = temperatures or damper.temperature_range or (293.15, 293.15)
    sheets = (
        1 if not damper.tempered or high <= low else max(2, math.ceil((high - low) / _TEMPERATURE_STEP_K) + 1)
    )
    warm = np.linspace(low, high, sheets)
    at = np.linspace(0.0, largest, currents)
    values = {
        name: np.array(rows)
        for name, rows in zip(
            damper.law.names,
            np.stack([damper.coefficients_at(at, kelvin) for kelvin in warm], axis=1),
            strict=True,
        )
    }
    problems = damper.violations(np.tile(at, sheets), np.repeat(warm, currents))
    if problems:
        raise InputError(f"controller: {problems[0]}")
    shapes = {name: _constant(name, values[name]) for name in _SHAPES if name in values}

    zero = np.zeros((sheets, currents))
    yields = values["yield_force"]
    second = values.get("second_force", values.get("rate_force", zero))
    if np.ptp(yields[0] + second[0]) <= 1e-9 * float(np.max(yields[0] + second[0])):
        raise InputError(
            f"controller: the yield force of this card does not depend on the command (it is "
            f"{yields[0, 0] + second[0, 0]:g} N from 0 to {largest:g} {damper.command_unit}), so no "
            "command can track a force. Identify runs at two or more commands"
        )
    rows = (
        values["offset"], values["stiffness"], values["mass"], values["viscosity"],
        values["coulomb_friction"], values["breakaway_friction"], yields, second,
    )  # fmt: skip
    rho = (values.get("rho", zero), values.get("second_rho", zero))
    elements = 0 if damper.law.name == "bingham" else 2 if "second_force" in values else 1
    kappa, n = shapes.get("kappa", -1.0), shapes.get("n", 1.0)  # those of the Dahl law
    stribeck, transition = shapes["stribeck_velocity"], shapes["transition_velocity"]
    exponent = shapes["viscous_exponent"]
    half, steep = shapes.get("saturation_velocity"), shapes.get("yield_velocity")

    def fade(v: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-((v / stribeck) ** 2)))

    def side(v: FloatArray, over: float = transition) -> FloatArray:
        return np.asarray(np.tanh(v / over))

    def steepness(v: FloatArray, over: float = transition) -> FloatArray:
        return np.asarray((1.0 - np.tanh(v / over) ** 2) / over)

    def power(v: FloatArray) -> FloatArray:
        return np.asarray(v * (np.maximum(v, 1e-300) / _VISCOUS_SPEED) ** (exponent - 1.0))

    def power_slope(
        v: FloatArray,
    ) -> FloatArray:  # at rest that of the first cell, which a slope may not leave
        return np.asarray(exponent * (np.maximum(v, 1e-6) / _VISCOUS_SPEED) ** (exponent - 1.0))

    slow = min(transition, stribeck) / 16.0
    if half is not None:
        built_up = tabulate_octaves(
            lambda v: v / (v + half), lambda v: half / (v + half) ** 2, half / 16.0, speed
        )
    elif steep is not None:
        built_up = tabulate_octaves(
            lambda v: side(v, steep), lambda v: steepness(v, steep), steep / 16.0, speed, rising=True
        )
    else:
        built_up = tabulate_octaves(np.ones_like, np.zeros_like, speed / 4.0, speed)
    return DamperTables(
        currents=at,
        temperatures=warm,
        force=np.ascontiguousarray(np.stack(rows, axis=1)),
        rho=np.ascontiguousarray(np.stack(rho, axis=1)),
        elements=elements,
        saturating="rate_force" in values,
        loading=_branch(kappa, n, loading=True),
        unloading=_branch(kappa, n, loading=False),
        to_load=_inverse_branch(1.0, n, from_one=True),
        to_unload=_inverse_branch(kappa, n, from_one=False),
        viscous=tabulate_octaves(power, power_slope, 1e-5, speed, rising=True),
        sliding=tabulate_octaves(side, steepness, slow, speed, rising=True),
        breakaway=tabulate_octaves(
            lambda v: side(v) * fade(v),
            lambda v: (steepness(v) - 2.0 * v / stribeck**2 * side(v)) * fade(v),
            slow,
            speed,
        ),
        built_up=built_up,
    )


def tabulate_octaves(
    value: Callable[[FloatArray], FloatArray],
    slope: Callable[[FloatArray], FloatArray],
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


def _branch(kappa: float, n: float, *, loading: bool) -> Octaves:
    """Return one branch of the universal curve: u' = 1 - k u^n from zero, k = 1 or kappa."""
    k, sign = (1.0, 1.0) if loading else (kappa, -1.0)
    end = 26.0 / n + 2.0

    def size(tau: FloatArray) -> FloatArray:
        return np.asarray(np.abs(core.curve(kappa, n, sign * tau)[0]))

    if not loading:  # no further than where all is unloaded; past it the line that the last cell may touch
        tau = np.linspace(0.0, end, 200_001)
        end = float(tau[min(int(np.searchsorted(size(tau), 1.0 - 1e-6)), len(tau) - 1)])

    def value(tau: FloatArray) -> FloatArray:
        there = size(np.minimum(tau, end))
        return there + (1.0 - k * there**n) * np.maximum(tau - end, 0.0)

    def slope(tau: FloatArray) -> FloatArray:
        return np.asarray(1.0 - k * np.minimum(size(np.minimum(tau, end)), 1.0) ** n)

    bits = 4 if n <= 2.0 else 5 if n < 6.0 else 6
    fine = 2.0**bits * 4e-8 ** (1.0 / (n + 1.0))
    return tabulate_octaves(value, slope, min(fine, 0.5), end, bits=bits, rising=True)


def _inverse_branch(k: float, n: float, *, from_one: bool) -> Octaves:
    """Return the travel tau of u' = 1 - k u^n from zero to u, over 1 - u or over u.

    ``from_one`` keeps the cells fine where the loading branch creeps up to one; at one itself, which it never
    reaches, the travel of the last cell's inner end is kept.
    """

    def slope(u: FloatArray) -> FloatArray:
        return np.asarray(1.0 / np.maximum(1.0 - k * u**n, 1e-6))

    def travel(u: FloatArray) -> FloatArray:
        order = np.argsort(u)
        ends = np.concatenate([[0.0], u[order]])
        nodes, weights = np.polynomial.legendre.leggauss(12)
        half = 0.5 * np.diff(ends)
        inside = slope(ends[:-1, None] + half[:, None] * (1.0 + nodes)) @ weights * half
        out = np.empty_like(u)
        out[order] = np.cumsum(inside)
        return out

    if not from_one:
        return tabulate_octaves(
            lambda u: travel(np.minimum(u, 1.0)), lambda u: slope(np.minimum(u, 1.0)), 2.0**-10, 1.0
        )
    last = 2.0**-14 / 2.0**_INVERSE_BITS

    def inside(rest: FloatArray) -> FloatArray:
        return np.clip(1.0 - rest, 0.0, 1.0 - last)

    return tabulate_octaves(
        lambda rest: travel(inside(rest)),
        lambda rest: np.where(rest < last, 0.0, -slope(inside(rest))),
        2.0**-14,
        1.0,
        bits=_INVERSE_BITS,
    )


def _constant(name: str, values: FloatArray) -> float:
    """Return the one value of a coefficient that must not move over the grid."""
    first = float(values.flat[0])
    if float(np.ptp(values)) > 1e-9 * abs(first):
        raise InputError(
            f"controller: {name} goes from {values.min():g} to {values.max():g} over current and "
            "temperature; the controller's tables need it constant. Identify with this coefficient constant"
        )
    return first
