"""Tables of a damper, which replace powers, exponentials and polynomials in the step of a controller.

Each coefficient of the hysteresis law depends on current and temperature. It is stored as a sum of terms. A
term is a function of current (a *column* of the table) times a function of temperature (a *factor*). A
coefficient that does not depend on current is only a factor. The normalised hysteresis curve and the
functions of speed are piecewise cubics (``lookup``). The C file ``track_tables.h`` evaluates the tables.

The tables are as small as their tolerances permit, and the error is measured when the tables are built.
Linear interpolation in current deviates by at most ``current_tolerance`` of the largest yield force. For a
viscosity or an inverse yield displacement, the tolerance is relative to the maximum of the coefficient.
Quadratic interpolation in temperature deviates by at most ``temperature_tolerance``. The total error,
including the errors of ``lookup``, is about 0.1 % of the peak force. A yield force that rises like a square
root at zero current can need too many currents. In this case ``current_tolerance`` is doubled until the
number of currents is small enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.control.config import Axes, Law
from mrdamper.control.settings import SETTINGS
from mrdamper.control.tables.lookup import (
    CurveTables,
    LookupTable,
    SpeedTables,
    functions_of_speed,
    no_curve,
    no_functions_of_speed,
    universal_curve,
)
from mrdamper.control.tables.series import SeriesTables, tabulate_series
from mrdamper.errors import InputError
from mrdamper.models.damper import Damper
from mrdamper.quantities import REFERENCE_K

ROWS = (
    "offset", "stiffness", "mass", "viscous", "sliding", "breakaway", "yield", "second", "rho", "second_rho",
)  # fmt: skip
"""Rows of the table. The first eight multiply, in this order: 1, displacement, acceleration, three functions
of speed, and two hysteretic states. The last two are the inverse yield displacements of these states."""

TABULATED = ("bouc-wen", "dahl", "bouc-wen-saturating", "double-bouc-wen", "bingham")
"""Laws whose force is a sum of rows and whose curve shape does not depend on the current."""

STEPPED = ("series-valve", "chain")
"""Laws that the kernel integrates by an implicit step. Their tables are ``SeriesTables``."""

CURVES = ("loading", "unloading", "unload_map", "reload_map", "reload_map_rest")
SPEEDS = ("viscous", "sliding", "breakaway", "saturation")
"""Names of the lookup tables that are functions of speed, in the kernel's order."""

LEVEL_ROW_COUNT = 6  # Only the first six rows can have terms that do not depend on current.
_GROUPS = (0, 6, 7, 8, 9)  # Index of the first row in each group of rows, as grouped in the kernel
_PIECES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
TERM_COUNT_MAX = 48  # max number of terms; equals MRD_TRACK_TERMS in the kernel
_SHAPES = (
    "viscous_exponent", "stribeck_velocity", "transition_velocity", "kappa", "n", "saturation_velocity",
    "yield_velocity",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class DamperTables:
    """Tables of the coefficients of a damper versus current and temperature, with their axes."""

    currents: FloatArray  # [A or V], rising from 0, shape (n,); closer where the coefficients are curved
    temperatures: FloatArray  # boundaries of equal intervals (pieces) of temperature [K], shape (pieces + 1,)
    rows: tuple[int, ...]  # index in ROWS of each term's coefficient; terms without current are first
    factor: FloatArray  # parabola of temperature of each term in each piece, shape (pieces, terms, 3)
    column: FloatArray  # function of current of each term that depends on current, shape (n, columns)
    elements: int
    saturating: bool
    curve: CurveTables
    speed: SpeedTables
    series: SeriesTables | None = None  # only these tables are used for series-valve and chain

    @property
    def lookups(self) -> tuple[LookupTable, ...]:
        of_curve = tuple(getattr(self.curve, name) for name in CURVES)
        return (*of_curve, *(getattr(self.speed, name) for name in SPEEDS))

    def axes(self, period: float) -> Axes:
        """Return the part ``Axes`` of a configuration for a sampling period [s]."""
        return Axes(
            period=period,
            largest=float(self.currents[-1]),
            coldest=float(self.temperatures[0]),
            warmest=float(self.temperatures[-1]),
        )

    def law(self, *, substeps: int) -> Law:
        """Return the part ``Law`` of a configuration.

        ``substeps`` is the number of integration steps per sampling period for ``series-valve`` and
        ``chain``.
        """
        return Law(
            series=self.series is not None and not self.series.is_chain,
            chain=self.series is not None and self.series.is_chain,
            elements=self.elements,
            saturating=self.saturating,
            unloaded=self.curve.unloaded,
            substeps=substeps,
        )

    @property
    def levels(self) -> int:
        """Return the number of terms that do not depend on current."""
        return len(self.rows) - int(self.column.shape[1])

    @property
    def begin(self) -> tuple[int, ...]:
        """Return the first column of each row group, then the number of columns."""
        of_columns = self.rows[self.levels :]
        return tuple(sum(row < first for row in of_columns) for first in (*_GROUPS, len(ROWS)))

    @property
    def quarters(self) -> tuple[int, ...]:
        """Return the indices of 0, 1/4, 1/2, 3/4 and 1 times the largest current in ``currents``.

        These are the five constant currents of the controller ``paper``.
        """
        wanted = np.linspace(0.0, float(self.currents[-1]), 5)
        return tuple(int(np.argmin(np.abs(self.currents - each))) for each in wanted)

    @property
    def yield_force_table(self) -> FloatArray:
        """Return the sum of both yield forces [N], shape (temperatures, n)."""
        if self.series is not None:
            return np.asarray(self.series.yield_force[0])
        rows = [self.evaluate(float(kelvin)) for kelvin in self.temperatures]
        return np.stack([row[6] + row[7] for row in rows])

    def evaluate(self, kelvin: float) -> FloatArray:
        """Return all rows at all currents for one temperature, as in C, shape (10, n)."""
        low, high, pieces = self.temperatures[0], self.temperatures[-1], len(self.factor)
        fraction = (kelvin - low) / (high - low) if high > low else 0.0
        place = float(np.clip(fraction, 0.0, 1.0)) * pieces
        piece = min(int(place), pieces - 1)
        of_terms = self.factor[piece] @ (place - piece) ** np.arange(3)
        out = np.zeros((len(ROWS), len(self.currents)))
        columns = np.concatenate([np.ones((self.levels, len(self.currents))), self.column.T])
        np.add.at(out, list(self.rows), of_terms[:, None] * columns)
        return out


def tabulate(
    damper: Damper,
    largest: float,
    *,
    speed: float = 1.0,
    temperatures: tuple[float, float] | None = None,
) -> DamperTables:
    """Return the tables of a damper from 0 to the ``largest`` current [A or V].

    Parameters
    ----------
    speed : maximum speed of the tables [m/s]
    temperatures : lowest and highest temperature [K]; None: the temperature range of the damper, or only 20
        degC if this range is unknown

    Raises
    ------
    InputError
        If the hysteresis law cannot be tabulated, its curve shape depends on current or temperature, or a
        coefficient is invalid.
    """
    if not (math.isfinite(largest) and largest > 0.0):
        raise InputError(
            place="real-time model", found=f"the largest command is {largest}", expected="a positive number"
        )
    low, high = temperatures or damper.temperature_range or (REFERENCE_K, REFERENCE_K)
    if damper.law.name in STEPPED:
        return _complete_series_tables(*tabulate_series(damper, largest, (low, high)), largest)
    if damper.law.name not in TABULATED:
        raise InputError(
            place="real-time model",
            found=f"the law is {damper.law.name!r}",
            expected=f"one of {', '.join((*TABULATED, *STEPPED))}",
            remedy="Fit the same runs with one of these",
        )
    high = max(low, high) if damper.temperature_dependent else low
    fine = _coefficients(damper, np.linspace(0.0, largest, 1025), np.linspace(low, high, 7))
    shapes = {name: _constant_coefficient(name, fine[name]) for name in _SHAPES if name in fine}
    scale = _scales(_rows(fine))
    at = largest * _current_fractions(_rows(fine), scale)
    warm = np.linspace(low, high, SETTINGS.temperature_count)
    rows, factor, column, pieces = _terms(_rows(_coefficients(damper, at, warm)), scale)
    if len(rows) > TERM_COUNT_MAX:
        raise InputError(
            place="real-time model",
            found=(
                f"the coefficients of this card are a sum of {len(rows)} products of current and temperature"
            ),
            expected=f"at most {TERM_COUNT_MAX}",
            remedy="Fit with simpler temperature laws",
        )

    elements = 0 if damper.law.name == "bingham" else 2 if "second_force" in fine else 1
    saturating = "rate_force" in fine
    return DamperTables(
        currents=at,
        temperatures=np.linspace(low, high, pieces + 1),
        rows=rows,
        factor=factor,
        column=column,
        elements=elements,
        saturating=saturating,
        # A hysteresis law without the coefficients kappa and n has the curve of the Dahl law.
        curve=universal_curve(shapes.get("kappa", -1.0), shapes.get("n", 1.0)) if elements else no_curve(),
        speed=functions_of_speed(
            {ROWS[row] for row in rows}, shapes, speed, saturating=saturating, memoryless=elements == 0
        ),
    )


def _complete_series_tables(series: SeriesTables, temperatures: FloatArray, largest: float) -> DamperTables:
    """Complete ``series`` by placeholders for tables that the kernel does not use."""
    pieces = max(len(temperatures) - 1, 1)
    return DamperTables(
        currents=np.linspace(0.0, largest, 9),
        temperatures=np.linspace(temperatures[0], temperatures[-1], pieces + 1),
        rows=(ROWS.index("yield"),),
        factor=np.zeros((pieces, 1, 3)),
        column=np.zeros((9, 1)),
        elements=1,
        saturating=False,
        curve=no_curve(),
        speed=no_functions_of_speed(),
        series=series,
    )


def _coefficients(damper: Damper, at: FloatArray, warm: FloatArray) -> dict[str, FloatArray]:
    current, kelvin = np.tile(at, len(warm)), np.repeat(warm, len(at))
    problems = damper.violations(current, kelvin)
    if problems:
        raise InputError(place="real-time model", found=problems[0])
    values = damper.coefficients_at(current, kelvin)
    return dict(zip(damper.law.names, values.reshape(-1, len(warm), len(at)), strict=True))


def _rows(values: dict[str, FloatArray]) -> FloatArray:
    """Return coefficients of shape (t, n) in the order of ``ROWS`` as one array of shape (10, t, n)."""
    zero = np.zeros_like(values["offset"])
    second = values.get("second_force", values.get("rate_force", zero))
    names = (
        "offset", "stiffness", "mass", "viscosity", "coulomb_friction", "breakaway_friction", "yield_force",
    )  # fmt: skip
    inverse = (values.get(name, zero) for name in ("rho", "second_rho"))
    return np.stack([*(values[name] for name in names), second, *inverse])


def _scales(rows: FloatArray) -> FloatArray:
    """Return the scale of each coefficient (row). Tolerances are relative to these scales.

    A force has the largest yield force as scale. A passive damper may have no yield force; then its force at
    a low speed is used. For stiffness and mass, this scale is divided by a typical stroke or acceleration.
    The scale of a viscosity or of an inverse yield displacement is its maximum.
    """
    own = np.abs(rows).max(axis=(1, 2))
    passive = own[0] + own[3] * SETTINGS.low_speed_m_s + own[4] + own[5]
    force = max(float(np.abs(rows[6] + rows[7]).max()), float(passive))
    at = {
        "stiffness": force / SETTINGS.typical_stroke_m,
        "mass": force / SETTINGS.typical_acceleration_m_s2,
        "viscous": own[3],
        "rho": own[8],
        "second_rho": own[9],
    }
    return np.array([at.get(name, force) for name in ROWS])


def _current_fractions(
    rows: FloatArray, scale: FloatArray, tolerance: float = SETTINGS.current_tolerance
) -> FloatArray:
    """Return table currents as fractions of the largest current.

    Linear interpolation between them is within the tolerance. The multiples of 1/8 are always included. Other
    intervals are as long as the tolerance permits. The tolerance is doubled until there are few enough
    currents.
    """
    count = rows.shape[2] - 1
    there = scale > 0.0
    lines = rows[there] / scale[there, None, None]
    adding = np.array([name not in ("viscous", "rho", "second_rho") for name in np.array(ROWS)[there]])

    def is_near(low: int, high: int) -> bool:
        inside = np.linspace(0.0, 1.0, high - low + 1)
        chord = lines[:, :, [low]] + inside * (lines[:, :, [high]] - lines[:, :, [low]])
        off = np.abs(lines[:, :, low : high + 1] - chord)
        return bool(off[adding].sum(axis=0).max() <= tolerance and off.max() <= tolerance)

    knots = [0]
    while knots[-1] < count:
        low, high = knots[-1], (knots[-1] // (count // 8) + 1) * (count // 8)
        far = low + 1
        while far < high:  # Bisection is valid because the error grows with the length of the line.
            middle = (far + high + 1) // 2
            if is_near(low, middle):
                far = middle
            else:
                high = middle - 1
        knots.append(far)
    if len(knots) > SETTINGS.current_count_max:
        return _current_fractions(rows, scale, 2.0 * tolerance)
    return np.asarray(np.array(knots) / count)


def _terms(rows: FloatArray, scale: FloatArray) -> tuple[tuple[int, ...], FloatArray, FloatArray, int]:
    """Return row, factor and column of each term, and the number of temperature parts.

    Each row contains a coefficient as a matrix with the axes temperature and current. Cross approximation
    subtracts one term after another from this matrix. The term is the rank-one matrix that equals the
    remaining matrix in the line and in the column of its largest element.
    """
    levels: list[tuple[int, FloatArray]] = []
    columns: list[tuple[int, FloatArray, FloatArray]] = []
    for r, values in enumerate(rows):
        left, size = values.copy(), float(np.abs(values).max())
        if size > 0.0 and np.ptp(values, axis=1).max() <= 1e-12 * size:
            if r < LEVEL_ROW_COUNT:
                levels.append((r, values[:, 0]))
            else:
                columns.append((r, values[:, 0], np.ones(values.shape[1])))
            continue
        while float(np.abs(left).max()) > SETTINGS.rank_tolerance * size:
            i, j = np.unravel_index(int(np.argmax(np.abs(left))), left.shape)
            factor, column = left[:, j].copy(), left[i] / left[i, j]
            left -= np.outer(factor, column)
            columns.append((r, factor, column))
    if not columns:  # The kernel requires a column, but a passive damper without yield force has none.
        columns.append((ROWS.index("yield"), np.zeros(rows.shape[1]), np.ones(rows.shape[2])))
    terms = [*levels, *((r, factor) for r, factor, _ in columns)]
    dense = np.array([factor for _, factor in terms])
    allowed = np.array([
        SETTINGS.temperature_tolerance * scale[r] / sum(other == r for other, _ in terms) for r, _ in terms
    ])  # fmt: skip
    for pieces in _PIECES:
        cells = _parabolas(dense, pieces)
        if (np.abs(_parabola_values(cells, dense.shape[1]) - dense).max(axis=1) <= allowed).all():
            break
    rows_of = tuple(r for r, _ in terms)
    column_of = np.ascontiguousarray(np.transpose([column for _, _, column in columns]))
    return rows_of, np.ascontiguousarray(cells.transpose(1, 0, 2)), column_of, pieces


def _parabolas(values: FloatArray, pieces: int) -> FloatArray:
    """Return parabolas through the first, middle and last value of each piece.

    The result has shape (terms, pieces, 3), lowest power first.
    """
    step = (values.shape[1] - 1) // pieces
    begin, middle, end = values[:, :-1:step], values[:, step // 2 :: step], values[:, step::step]
    return np.stack([begin, 4.0 * middle - 3.0 * begin - end, 2.0 * (begin + end) - 4.0 * middle], axis=2)


def _parabola_values(cells: FloatArray, count: int) -> FloatArray:
    """Evaluate the parabolas of each term at ``count`` evenly spaced temperatures.

    ``cells`` has shape (terms, pieces, 3), the result (terms, count).
    """
    place = np.linspace(0.0, cells.shape[1], count)
    piece = np.minimum(place.astype(np.intp), cells.shape[1] - 1)
    fraction = place - piece
    c = cells[:, piece]
    return np.asarray(c[..., 0] + fraction * (c[..., 1] + fraction * c[..., 2]))


def _constant_coefficient(name: str, values: FloatArray) -> float:
    first = float(values.flat[0])
    if float(np.ptp(values)) > 1e-9 * abs(first):
        raise InputError(
            place="real-time model",
            found=(
                f"{name} changes from {values.min():g} to {values.max():g} over current and temperature; the "
                "real-time tables need it constant"
            ),
            remedy="Fit with this coefficient constant",
        )
    return first
