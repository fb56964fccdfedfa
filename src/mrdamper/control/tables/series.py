"""Series valve and chain in tables: what ``core/kernel/track_series.h`` and ``track_chain.h`` read.

The yield force over an even grid of commands and temperatures, the other coefficients over temperature, the
powers of speed, and two functions that are the same for every damper: tanh u and exp(-u^2).

The inverse of the series valve is explicit because the yield force alone follows the command. Of the chain
shear thinning, bristles and memory may follow it as well (``PLANES``). The exponents are constant, everything
else may move with temperature.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.tables.lookup import LookupTable, tabulate_lookup
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper
from mrdamper.models.laws import VISCOUS_SPEED

CURRENTS = 33
"""Commands of the yield force's table: one more than a power of two."""

CHAIN = (
    "offset", "stiffness", "thinning", "yield_velocity", "position_gain", "gap_stiffness", "gap",
    "gap_corner", "leak_damping", "mass", "viscosity", "coulomb_friction", "breakaway_friction",
    "transition_velocity", "stribeck_velocity",
)  # fmt: skip
"""Coefficients over temperature, in the kernel's order."""

OF_CHAIN = (
    "orifice", "asymmetry", "flow_asymmetry", "position_curvature", "bristle_share", "bristle_spread",
    "friction_force", "friction_stiffness", "static_excess", "fade_velocity", "memory_stiffness", "gas_force",
    "gas_length", "play", "follow_share", "creep", "knee", "bypass", "cavity_length", "cavity_force",
    "bubble_length",
)  # fmt: skip
"""Further ones, of the chain."""

PLANES = ("yield_force", "thinning_force", "bristle_stiffness", "memory_force")
"""What may follow the command, in the kernel's order; of the series valve the first alone."""

_INVERTED = (
    "yield_velocity", "gap_corner", "transition_velocity", "stribeck_velocity", "fade_velocity", "gas_length",
    "cavity_length",
)  # fmt: skip
_EXPONENTS = ("thinning_exponent", "leak_exponent", "viscous_exponent")
_GAS_EXPONENT = -1.3  # of the volume, as in chain.c
_LEAST_SPEED = 2.0**-20  # [m/s], below which a power goes straight to zero
_SPEEDS = 23  # octaves from there: to 8 m/s
_TEMPERATURE_STEP_K = {"series-valve": 5.0, "chain": 10.0}
_BITS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Power:
    """A power of a size: cubics over one octave, shape (2^bits, 4), and a factor per octave."""

    exponent: float
    least: float
    top: float
    bits: int
    scale: FloatArray
    cell: FloatArray

    @property
    def native(self) -> tuple[float, float, float, int, FloatArray, FloatArray]:
        """What the kernel's binding takes."""
        return self.exponent, self.least, self.top, self.bits, self.scale, self.cell

    def at(self, size: FloatArray | float) -> FloatArray:
        """Return the power at sizes, as the kernel reads it."""
        u = np.asarray(size, dtype=np.float64)
        t = np.clip(u, self.least, self.top)
        octave = np.floor(np.log2(t / self.least))
        share = (t / (self.least * 2.0**octave) - 1.0) * 2.0**self.bits
        index = np.minimum(np.floor(share), 2.0**self.bits - 1.0)
        c: FloatArray = self.cell[index.astype(np.intp)]
        place = share - index
        value = c[..., 0] + place * (c[..., 1] + place * (c[..., 2] + place * c[..., 3]))
        return np.asarray(self.scale[octave.astype(np.intp)] * value * np.minimum(u / self.least, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class SeriesTables:
    """The tables of the series valve law, or of the chain."""

    yield_force: FloatArray  # what follows the command, shape (1 or planes, temperatures, CURRENTS)
    chain: FloatArray  # ``CHAIN``, and ``OF_CHAIN``; lengths and speeds inverted, shape (temperatures, n)
    thinning: Power
    leak: Power
    viscous: Power
    gas: Power
    side: LookupTable
    fade: LookupTable

    @property
    def native(
        self,
    ) -> tuple[
        FloatArray,
        FloatArray,
        list[tuple[float, float, float, int, FloatArray, FloatArray]],
        list[tuple[float, float, int, FloatArray]],
    ]:
        """What the kernel's binding takes."""
        powers = [each.native for each in (self.thinning, self.leak, self.viscous, self.gas)]
        lookups = [each.native for each in (self.side, self.fade)]
        return self.interleaved, self.chain, powers, lookups

    @property
    def interleaved(self) -> FloatArray:
        """What follows the command, planes side by side, shape (temperatures, CURRENTS, planes)."""
        return np.ascontiguousarray(np.moveaxis(self.yield_force, 0, -1))

    @property
    def is_chain(self) -> bool:
        """Whether these are the chain's."""
        return len(self.yield_force) == len(PLANES)


def tabulate_series(
    damper: Damper, largest: float, temperatures: tuple[float, float]
) -> tuple[SeriesTables, FloatArray]:
    """Return tables of series valve or chain from 0 to the ``largest`` command [A or V], and temperatures.

    Raises
    ------
    InputError
        A coefficient beyond ``PLANES`` (of the series valve: the first) that follows the command, an exponent
        that follows temperature, a law that is not well posed.
    """
    low, high = temperatures
    single = not damper.temperature_dependent or high <= low
    sheets = 1 if single else max(2, math.ceil((high - low) / _TEMPERATURE_STEP_K[damper.law.name]) + 1)
    warm = np.linspace(low, high, sheets)
    at = np.linspace(0.0, largest, CURRENTS)
    grid = np.stack([damper.coefficients_at(at, kelvin) for kelvin in warm], axis=1)
    values: Mapping[str, FloatArray] = dict(zip(damper.law.names, grid, strict=True))
    problems = damper.violations(np.tile(at, sheets), np.repeat(warm, CURRENTS))
    if problems:
        raise InputError(place="real-time model", found=problems[0])
    is_chain = damper.law.name == "chain"
    planes = PLANES if is_chain else PLANES[:1]
    _check_tabulated(values, damper.law.name, planes)
    exponents = {name: float(values[name].flat[0]) for name in _EXPONENTS}
    rows = {name: values[name][:, 0].copy() for name in ((*CHAIN, *OF_CHAIN) if is_chain else CHAIN)}
    rows["viscosity"] *= VISCOUS_SPEED ** (1.0 - exponents["viscous_exponent"])
    moved = {name: values[name] for name in planes}
    if is_chain:  # thinning and dashpot stated at 1 m/s, as the powers are
        speed = values["reference_speed"][:, 0]
        rows["thinning"] *= speed ** -exponents["thinning_exponent"]
        moved["thinning_force"] = moved["thinning_force"] * speed[:, None] ** -exponents["thinning_exponent"]
        rows["leak_damping"] *= speed ** (1.0 - exponents["leak_exponent"])
        rows["bristle_spread"] = np.exp(rows["bristle_spread"])
    for name in set(_INVERTED) & set(rows):
        rows[name] = np.divide(1.0, rows[name], out=np.zeros_like(rows[name]), where=rows[name] > 0.0)
    tables = SeriesTables(
        yield_force=np.ascontiguousarray(np.stack([moved[name] for name in planes])),
        chain=np.ascontiguousarray(np.stack(list(rows.values()), axis=1)),
        thinning=tabulate_power(exponents["thinning_exponent"]),
        leak=tabulate_power(exponents["leak_exponent"]),
        viscous=tabulate_power(exponents["viscous_exponent"]),
        gas=tabulate_power(_GAS_EXPONENT if is_chain else exponents["viscous_exponent"]),
        side=tabulate_lookup(np.tanh, lambda u: 1.0 - np.tanh(u) ** 2, 0.25, 9.0, bits=_BITS, rising=True),
        fade=tabulate_lookup(
            lambda u: np.exp(-u * u), lambda u: -2.0 * u * np.exp(-u * u), 0.25, 4.5, bits=_BITS
        ),
    )
    return tables, warm


def tabulate_power(exponent: float) -> Power:
    """Return the power u^exponent of a speed [m/s], from 1e-6 to 8 m/s."""
    knots = 1.0 + np.arange(2**_BITS + 1) / 2**_BITS
    f, d = knots**exponent, exponent * knots ** (exponent - 1.0) / 2**_BITS
    rise = np.diff(f)
    cell = np.stack([f[:-1], d[:-1], 3.0 * rise - 2.0 * d[:-1] - d[1:], d[:-1] + d[1:] - 2.0 * rise], axis=1)
    scale = np.asarray((_LEAST_SPEED * 2.0 ** np.arange(_SPEEDS)) ** exponent, dtype=np.float64)
    top = _LEAST_SPEED * 2.0**_SPEEDS * (1.0 - 1e-6)
    return Power(exponent, _LEAST_SPEED, top, _BITS, scale, np.ascontiguousarray(cell))


def _check_tabulated(values: Mapping[str, FloatArray], law: str, planes: tuple[str, ...]) -> None:
    """Raise ``InputError`` if a coefficient depends on a quantity over which it has no table."""
    for name, rows in values.items():
        if name not in planes and float(np.ptp(rows, axis=1).max()) > 1e-9 * float(np.abs(rows).max()):
            raise InputError(
                place="real-time model",
                found=f"{name} of this {law} card depends on the command",
                expected=f"{', '.join(planes)} alone to follow it",
                remedy=f"Fit with {name} constant in the command",
            )
    for name in (*_EXPONENTS, *(["reference_speed"] if law == "chain" else [])):
        rows = values[name]
        if float(np.ptp(rows)) > 1e-9 * float(rows.flat[0]):
            raise InputError(
                place="real-time model",
                found=(
                    f"{name} goes from {rows.min():g} to {rows.max():g} over temperature; the "
                    "real-time tables need it constant"
                ),
                remedy="Fit with this coefficient constant",
            )
