"""Runs in memory: data frames of pandas or Polars, structured arrays, or columns by name.

A data frame is read like the table of a file (``proposal``): the name of a column states its quantity and
unit (``force_N``, ``Force [kN]``). Nothing is guessed, and missing information is requested. The second
argument of ``mrdamper.read`` maps a quantity with its unit to the name of a column, to an array or to a
constant: ``read(frame, {"force_kN": "Load", "current_A": 1.0})``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from numbers import Real
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrdamper.arrays import FloatArray
from mrdamper.data.channels import ChannelMap
from mrdamper.data.formats.table import Layout, Table, Texts, as_column
from mrdamper.data.proposal.questions import AskingError
from mrdamper.data.proposal.recordings import RigFile, runs_in
from mrdamper.data.records import Dataset, RigRun
from mrdamper.errors import InputError
from mrdamper.quantities import QUANTITIES, roles_of_unit
from mrdamper.schema import unknown_name

_CONSTANT = ("current", "voltage", "temperature")
_REMEDY = 'Write units in names (force_N), or name columns: read(frame, {"time_s": "t", "current_A": 1.0})'


class Columns(Protocol):
    """A data frame of pandas or Polars."""

    @property
    def columns(self) -> Any: ...  # noqa: ANN401

    def __getitem__(self, name: Any, /) -> Any: ...  # noqa: ANN401


FrameLike = Columns | Mapping[str, Any] | NDArray[Any]
"""A frame of pandas or Polars, a mapping of columns, or a structured array."""

Runs = Dataset | RigRun | FrameLike | str | Path | Sequence[RigRun | FrameLike | str | Path]
"""Runs, frames and paths of files or folders; a mapping may name several frames."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A data frame with the name of its run."""

    name: str
    columns: Mapping[str, Any]

    def read(self, chosen: ChannelMap) -> RigFile:
        """Return the runs of the frame.

        Raise AskingError if a needed column is missing or has no unit. Raise InputError if a column does not
        have shape (n,), or if the columns differ in length.
        """
        try:
            return runs_in((self._table(),), chosen, Path(self.name), name=self.name)
        except AskingError as fault:
            if not fault.faults:
                fault.remedy = _REMEDY
            raise

    def _table(self) -> Table:
        numbers: dict[str, FloatArray] = {}
        texts: dict[str, Texts] = {}
        units: dict[str, str] = {}
        for name, given in self.columns.items():
            if isinstance(given, np.ma.MaskedArray) and given.dtype.kind in "iuf":
                given = np.ma.filled(given.astype(np.float64), np.nan)  # noqa: PLW2901
            values = np.atleast_1d(np.asarray(given))
            if values.ndim != 1 or values.dtype.kind == "c":
                found = f"column {name!r} has shape {values.shape} and type {values.dtype}"
                raise InputError(place=self.name, found=found, expected="numbers of shape (n,)")
            if values.dtype.kind in "OUST" and any(isinstance(each, str) for each in values):
                texts[name] = [each if isinstance(each, str) else None for each in values.tolist()]
                continue
            if values.dtype.kind == "O" and len(values) and isinstance(values[0], datetime | timedelta):
                first = values[0] if isinstance(values[0], datetime) else timedelta()
                values = np.array([each - first for each in values], dtype="timedelta64[us]")
            try:
                numbers[name], units[name] = as_column(values)
            except (TypeError, ValueError) as fault:
                found = f"column {name!r} ({fault})"
                raise InputError(place=self.name, found=found, expected="numbers") from fault
        if len({len(values) for values in numbers.values()} - {1}) > 1:  # One number applies to all samples.
            sizes = ", ".join(f"{name} {len(values)}" for name, values in numbers.items())
            found = f"columns differ in length ({sizes})"
            raise InputError(place=self.name, found=found, expected="one value of each per sample")
        rows = max(map(len, numbers.values()), default=0)
        stated = {name: unit for name, unit in units.items() if unit}
        return Table((*self.columns,), numbers, texts, Layout("frame"), rows, units=stated, title=self.name)


def is_frame(given: object) -> bool:
    """Return True if a value has columns by name: a frame, a structured array, or a mapping of arrays."""
    if isinstance(given, Mapping):
        return bool(given) and not any(is_frame(each) for each in given.values())
    if isinstance(given, np.ndarray):
        return given.dtype.names is not None
    return hasattr(type(given), "columns") and hasattr(given, "__getitem__")


def parts_of(given: Any) -> list[Any]:  # noqa: ANN401 - a path, run or frame, or a sequence of these
    """Return a list of paths, runs and frames. The keys of a mapping name its frames."""
    if isinstance(given, str | Path | RigRun):
        return [given]
    if is_frame(given):
        given = {"frame": given}
    if isinstance(given, Mapping):
        return [Frame(str(name), _columns_of(each)) for name, each in given.items()]
    if isinstance(given, np.ndarray) or not isinstance(given, Iterable):
        expected = 'paths, runs, or columns by name: {"time_s": t, "displacement_mm": x, "force_N": f}'
        raise InputError(place="runs", found=f"a {type(given).__name__} without names", expected=expected)
    return [
        Frame(f"frame_{number}", _columns_of(each)) if is_frame(each) else each
        for number, each in enumerate(given, 1)
    ]


def _columns_of(frame: Any) -> Mapping[str, Any]:  # noqa: ANN401 - of pandas, Polars, NumPy, or a mapping
    """Return the columns of a frame, and an index of pandas with a name or with times."""
    if isinstance(frame, Mapping):
        return {str(name): values for name, values in frame.items()}
    if isinstance(frame, np.ndarray):
        return {name: frame[name] for name in frame.dtype.names or ()}
    if hasattr(frame, "collect"):  # The frame is lazy (Polars).
        frame = frame.collect()
    columns = {_name_of(key): frame[key] for key in frame.columns}
    if len(columns) < len(frame.columns):
        found = f"several of the columns {', '.join(map(repr, columns))} have the same name"
        raise InputError(place="frame", found=found, remedy="Rename or drop the others")
    index: Any = getattr(frame, "index", None)
    if getattr(index, "name", None) or getattr(getattr(index, "dtype", None), "kind", "") in {"m", "M"}:
        return {_name_of(index.name or "time"): index} | columns
    return columns


def _name_of(name: object) -> str:
    """Return the name of a column. The pandas header (Force, N) becomes ``Force [N]``."""
    if not isinstance(name, tuple):
        return str(name)
    words = [str(word) for word in name if str(word)]
    has_unit = len(words) == 2 and roles_of_unit(words[1])
    return f"{words[0]} [{words[1]}]" if has_unit else " ".join(words)


def columns_by_name(
    given: Runs | None, columns: Mapping[str, str | float | ArrayLike]
) -> tuple[Any, ChannelMap | None]:
    """Return the runs with the given columns added, and the channel map that assigns columns to roles.

    Parameters
    ----------
    given : paths, runs or frames; None: ``columns`` contain all data of the run
    columns : quantity with or without unit (``force_kN``) -> name of a column, the column itself, or one
        number for the whole run; the key ``rate_Hz`` is the sampling rate

    Raise InputError if a key is not a quantity or has no valid unit, or if columns are given for several
    frames.
    """
    if not columns:
        return given, None
    channels: dict[str, dict[str, str]] = {}
    constant: dict[str, float] = {}
    added: dict[str, Any] = {}
    for key, value in columns.items():
        role, _, unit = key.partition("_")
        if key != "rate_Hz" and role not in QUANTITIES:
            raise unknown_name(f"there is no quantity {role!r}", role, QUANTITIES, "columns")
        if isinstance(value, str):
            channels[role] = {"name": value} | ({"unit": unit} if unit else {})
        elif isinstance(value, Real) and (key == "rate_Hz" or role in _CONSTANT):
            constant[key] = float(value)
        else:
            added[key] = value
            channels[role] = {"name": key}
    chosen = ChannelMap.from_dict({"channel": channels, "constant": constant}, "columns")
    if not added:
        return given, chosen
    parts: Sequence[Any] = [Frame("frame", {})] if given is None else parts_of(given)
    if len(parts) != 1 or not isinstance(parts[0], Frame):
        found = f"{', '.join(added)} together with {', '.join(type(each).__name__ for each in parts)}"
        raise InputError(place="columns", found=found, expected="arrays with one frame, or alone")
    return [replace(parts[0], columns={**parts[0].columns, **added})], chosen
