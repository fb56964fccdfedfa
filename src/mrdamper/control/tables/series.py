"""Tables of ``series-valve`` and ``chain`` for the controllers in C.

These two hysteresis laws need four kinds of tables. The yield force is tabulated on an even grid of commands
and temperatures, and the other coefficients versus temperature. Further tables contain powers of speed, and
the functions tanh u and exp(-u^2). The last two are the same for all dampers.

In ``series-valve``, only the yield force can depend on the command. In ``chain``, the coefficients of shear
thinning, bristle and memory force can also depend on the command (``PLANES``). The exponents are constant.
All other coefficients can depend on temperature.
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

COMMAND_COUNT = 33
"""Number of commands in the table of the yield force: one more than a power of two."""

CHAIN = (
    "offset", "stiffness", "thinning", "yield_velocity", "position_gain", "gap_stiffness", "gap",
    "gap_corner", "leak_damping", "mass", "viscosity", "coulomb_friction", "breakaway_friction",
    "transition_velocity", "stribeck_velocity",
)  # fmt: skip
"""Coefficients that are tabulated versus temperature, in the order of the kernel."""

OF_CHAIN = (
    "orifice", "asymmetry", "flow_asymmetry", "position_curvature", "bristle_share", "bristle_spread",
    "friction_force", "friction_stiffness", "static_excess", "fade_velocity", "memory_stiffness", "gas_force",
    "gas_length", "play", "follow_share", "creep", "knee", "bypass", "cavity_length", "cavity_force",
    "bubble_length",
)  # fmt: skip
"""Coefficients of the chain that are tabulated versus temperature after those in ``CHAIN``."""

PLANES = ("yield_force", "thinning_force", "bristle_stiffness", "memory_force")
"""Coefficients that can depend on the command, in the order of the kernel. The series valve has only the
first."""

_INVERTED = (
    "yield_velocity", "gap_corner", "transition_velocity", "stribeck_velocity", "fade_velocity", "gas_length",
    "cavity_length",
)  # fmt: skip
_EXPONENTS = ("thinning_exponent", "leak_exponent", "viscous_exponent")
_GAS_EXPONENT = -1.3  # The gas force is this power of the gas volume, as in chain.c.
SPEED_MIN_M_S = 2.0**-20  # A straight line through zero replaces the power function at lower speeds.
OCTAVE_COUNT = 23  # number of octaves from the minimum speed to 8 m/s
_TEMPERATURE_STEP_K = {"series-valve": 5.0, "chain": 10.0}
CELL_BITS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Power:
    """Table of a power function of u >= 0.

    ``cell`` contains the cubics of the cells in one octave, shape (2^bits, 4). All octaves use these cubics,
    multiplied by the octave's factor in ``scale``.
    """

    exponent: float
    least: float
    top: float
    bits: int
    scale: FloatArray
    cell: FloatArray

    @property
    def native(self) -> tuple[float, float, float, int, FloatArray, FloatArray]:
        """Return the arguments of the kernel's binding."""
        return self.exponent, self.least, self.top, self.bits, self.scale, self.cell

    def evaluate(self, size: FloatArray | float) -> FloatArray:
        """Return the power of ``size``, computed from the table as in the kernel."""
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
    """The tables of a damper with the hysteresis law ``series-valve`` or ``chain``."""

    yield_force: FloatArray  # coefficients in ``PLANES``, shape (1 or 4, temperatures, COMMAND_COUNT)
    # Coefficients in the order of ``CHAIN``, for the law ``chain`` also ``OF_CHAIN``; shape (temperatures,
    # n). The coefficients in ``_INVERTED`` are stored as reciprocals.
    chain: FloatArray
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
        """Return the arguments of the kernel's binding."""
        powers = [each.native for each in (self.thinning, self.leak, self.viscous, self.gas)]
        lookups = [each.native for each in (self.side, self.fade)]
        return self.interleaved, self.chain, powers, lookups

    @property
    def interleaved(self) -> FloatArray:
        """Return ``yield_force`` in the kernel's memory order, with ``PLANES`` as last axis."""
        return np.ascontiguousarray(np.moveaxis(self.yield_force, 0, -1))

    @property
    def is_chain(self) -> bool:
        return len(self.yield_force) == len(PLANES)


def tabulate_series(
    damper: Damper, largest: float, temperatures: tuple[float, float]
) -> tuple[SeriesTables, FloatArray]:
    """Return the tables of a damper and the tabulated temperatures [K].

    Parameters
    ----------
    largest : largest command of the tables [A or V]; the smallest is 0
    temperatures : lowest and highest temperature [K]

    Raises
    ------
    InputError
        If an exponent depends on temperature, or a coefficient is invalid. Also if a coefficient depends on
        the command that is not in ``PLANES``, or for ``series-valve`` not the yield force.
    """
    low, high = temperatures
    single = not damper.temperature_dependent or high <= low
    sheets = 1 if single else max(2, math.ceil((high - low) / _TEMPERATURE_STEP_K[damper.law.name]) + 1)
    warm = np.linspace(low, high, sheets)
    at = np.linspace(0.0, largest, COMMAND_COUNT)
    grid = np.stack([damper.coefficients_at(at, kelvin) for kelvin in warm], axis=1)
    values: Mapping[str, FloatArray] = dict(zip(damper.law.names, grid, strict=True))
    problems = damper.violations(np.tile(at, sheets), np.repeat(warm, COMMAND_COUNT))
    if problems:
        raise InputError(place="real-time model", found=problems[0])
    is_chain = damper.law.name == "chain"
    planes = PLANES if is_chain else PLANES[:1]
    _check_tabulated(values, damper.law.name, planes)
    thinning, leak, viscous = (float(values[name].flat[0]) for name in _EXPONENTS)
    rows = {name: values[name][:, 0].copy() for name in ((*CHAIN, *OF_CHAIN) if is_chain else CHAIN)}
    moved = {name: values[name] for name in planes}
    factors: dict[str, float | FloatArray] = {"viscosity": VISCOUS_SPEED ** (1.0 - viscous)}
    if is_chain:  # Shear thinning and leak force are tabulated for 1 m/s, not ``reference_speed``.
        speed = values["reference_speed"]
        factors |= {"thinning": speed[:, 0] ** -thinning, "leak_damping": speed[:, 0] ** (1.0 - leak)}
        moved |= {"thinning_force": values["thinning_force"] * speed[:, :1] ** -thinning}
        rows |= {"bristle_spread": np.exp(rows["bristle_spread"])}
    for name, factor in factors.items():
        rows[name] *= factor
    for name in set(_INVERTED) & set(rows):
        rows[name] = np.divide(1.0, rows[name], out=np.zeros_like(rows[name]), where=rows[name] > 0.0)
    tables = SeriesTables(
        yield_force=np.ascontiguousarray(np.stack([moved[name] for name in planes])),
        chain=np.ascontiguousarray(np.stack(list(rows.values()), axis=1)),
        thinning=tabulate_power(thinning),
        leak=tabulate_power(leak),
        viscous=tabulate_power(viscous),
        gas=tabulate_power(_GAS_EXPONENT if is_chain else viscous),
        side=tabulate_lookup(
            np.tanh, lambda u: 1.0 - np.tanh(u) ** 2, 0.25, 9.0, bits=CELL_BITS, rising=True
        ),
        fade=tabulate_lookup(
            lambda u: np.exp(-u * u), lambda u: -2.0 * u * np.exp(-u * u), 0.25, 4.5, bits=CELL_BITS
        ),
    )
    return tables, warm


def tabulate_power(exponent: float) -> Power:
    """Return the table of u^exponent for speeds u from 1e-6 to 8 m/s."""
    knots = 1.0 + np.arange(2**CELL_BITS + 1) / 2**CELL_BITS
    f, d = knots**exponent, exponent * knots ** (exponent - 1.0) / 2**CELL_BITS
    rise = np.diff(f)
    cell = np.stack([f[:-1], d[:-1], 3.0 * rise - 2.0 * d[:-1] - d[1:], d[:-1] + d[1:] - 2.0 * rise], axis=1)
    scale = np.asarray((SPEED_MIN_M_S * 2.0 ** np.arange(OCTAVE_COUNT)) ** exponent, dtype=np.float64)
    top = SPEED_MIN_M_S * 2.0**OCTAVE_COUNT * (1.0 - 1e-6)
    return Power(exponent, SPEED_MIN_M_S, top, CELL_BITS, scale, np.ascontiguousarray(cell))


def _check_tabulated(values: Mapping[str, FloatArray], law: str, planes: tuple[str, ...]) -> None:
    """Raise ``InputError`` if a coefficient depends on a quantity that is not an axis of its table."""
    for name, rows in values.items():
        if name not in planes and float(np.ptp(rows, axis=1).max()) > 1e-9 * float(np.abs(rows).max()):
            raise InputError(
                place="real-time model",
                found=f"{name} of this {law} card depends on the command",
                expected=f"{', '.join(planes)} to be the only coefficients that depend on it",
                remedy=f"Fit with {name} constant in the command",
            )
    for name in (*_EXPONENTS, *(["reference_speed"] if law == "chain" else [])):
        rows = values[name]
        if float(np.ptp(rows)) > 1e-9 * float(rows.flat[0]):
            raise InputError(
                place="real-time model",
                found=(
                    f"{name} changes from {rows.min():g} to {rows.max():g} over temperature; the "
                    "real-time tables need it constant"
                ),
                remedy="Fit with this coefficient constant",
            )
