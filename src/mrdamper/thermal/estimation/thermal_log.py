"""What a logger wrote beside a damper that heats: power, current, and what its thermometers read.

``ThermalLog`` is the table as it stands, in SI. What a voltage says of the coil, and what an observer makes
of it all, is the business of the job ``observe``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrdamper.arrays import FloatArray, read_only
from mrdamper.data.tables import read_table
from mrdamper.data.words.headers import parse_header
from mrdamper.errors import InputError
from mrdamper.notes import Note
from mrdamper.quantities import find_quantity, is_unit, to_si
from mrdamper.thermal.estimation.measured_curve import MOST_BAD_SHARE

_BODY = ("body", "wall")


@dataclass(frozen=True, slots=True, eq=False)
class ThermalLog:
    """Columns of a record, each of shape (n,) and read-only; None: the record has no such column.

    NaN in ``voltage``, ``resistance`` and ``body`` is a row without a reading. A row's power and current are
    means since the row before.
    """

    time: FloatArray  # rising [s]
    current: FloatArray  # of the coil [A]
    power: FloatArray | None = None  # mechanical [W]
    voltage: FloatArray | None = None  # at the driver [V]
    resistance: FloatArray | None = None  # of the coil [ohm]
    body: FloatArray | None = None  # thermocouple on the body [K]
    name: str = "record"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for column in ("time", "current", "power", "voltage", "resistance", "body"):
            values = getattr(self, column)
            if values is not None:
                object.__setattr__(self, column, read_only(values))
                if values.shape != self.time.shape:
                    raise InputError(
                        place=self.name,
                        found=f"{column} has shape {values.shape}, time {self.time.shape}",
                        expected="the same",
                    )
        if self.time.ndim != 1 or len(self.time) < 2 or not (np.diff(self.time) > 0.0).all():
            raise InputError(
                place=self.name,
                found="time does not rise",
                expected="two rows or more, seconds in order, none twice",
            )
        if self.voltage is None and self.resistance is None and self.body is None:
            raise InputError(
                place=self.name,
                found="it has no reading of a temperature",
                expected="a column voltage_V (of the coil, beside current_A), resistance_ohm or body_degC",
            )


def read_thermal_log(path: str | Path) -> ThermalLog:
    """Return the record in a table with ``time_s``, ``current_A`` and what was read.

    That is one or more of ``voltage_V`` (or ``resistance_ohm``) and ``body_degC``; and ``power_W``, the
    mechanical power. Readings of the body that are no plausible temperature are left out, and counted.

    Raises
    ------
    InputError
        A column that is missing; more than a fifth of the body's readings are none.
    """
    file = Path(path)
    table = read_table(file)
    found: dict[str, FloatArray] = {}
    for header, values in table.columns.items():
        known = _role_of(header)
        if known is not None:
            role, unit = known
            found.setdefault(role, to_si(values, unit, "temperature" if role == "body" else role))
    for column, role in (("power_W", "power"), ("resistance_ohm", "resistance")):
        if column in table.columns:
            found[role] = table.columns[column]
    missing = [column for column in ("time_s", "current_A") if column.partition("_")[0] not in found]
    if missing:
        raise InputError(
            place=file.name,
            found=f"has columns {', '.join(table.names)}",
            expected=f"{' and '.join(missing)} among them",
        )
    body, notes = _plausible(found.pop("body", None), file.name)
    return ThermalLog(**found, body=body, name=file.name, notes=notes)


def _role_of(header: str) -> tuple[str, str] | None:
    """Return role and unit of a column that has a quantity's name, or the body's."""
    known = parse_header(header)
    if known is not None:
        return known if known[0] in {"time", "current", "voltage"} else None
    word, _, unit = header.strip().rpartition("_")
    is_body = word.split("_")[0].lower() in _BODY and is_unit(unit, ["temperature"])
    return ("body", unit) if is_body else None


def _plausible(kelvin: FloatArray | None, name: str) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return the body's readings with NaN for those that are no temperature, and what to say of it."""
    if kelvin is None:
        return None, ()
    limits = find_quantity("temperature")
    bad = np.isfinite(kelvin) & ~((kelvin >= limits.low) & (kelvin <= limits.high))
    if not bad.any():
        return kelvin, ()
    said = f"{bad.sum()} of {len(bad)} readings of the body are no plausible temperature"
    if bad.sum() > MOST_BAD_SHARE * len(bad):
        raise InputError(
            place=name,
            found=said,
            expected=f"{limits.low:g} to {limits.high:g} K",
            remedy="Check the sensor and the column's unit",
        )
    return np.where(bad, np.nan, kelvin), (Note("left_out", "{what}: left out", what=said),)
