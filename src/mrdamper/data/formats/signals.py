"""Signals in structures, as test bench tools store recordings in MAT files.

A structure with one signal and its name, such as dSPACE's ``Y(2).Name`` and ``Y(2).Data`` or Simulink's
``signals(2).label`` and ``signals(2).values``, is a column of that name. ``mat`` and ``hdf5`` read the files.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

_NAMES, _SIGNALS, _UNITS = ("name", "label", "title"), ("data", "values"), ("unit", "units")
_TIMES = ("time", "t")


@dataclass(frozen=True, slots=True)
class Signal:
    """The only signal in a structure."""

    name: str
    field: str  # The field of the samples.
    unit: str
    time: str  # The field of the times; "" if the structure has no times.


def find_signal(texts: Mapping[str, str], shapes: Mapping[str, tuple[int, ...]]) -> Signal | None:
    """Return the signal of a structure, given its texts and the shapes of its arrays of numbers.

    Return None if the structure has no name, or more than one signal, such as a table under a title.
    """
    said = {key.lower(): text.strip() for key, text in texts.items() if text.strip()}
    long = {key: shape for key, shape in shapes.items() if math.prod(shape) > 1}
    fields = {key.lower(): key for key in long}
    name = next((said[key] for key in _NAMES if key in said), "")
    field = next((fields[key] for key in _SIGNALS if key in fields), "")
    if not name or not field:
        return None
    size = math.prod(long[field])
    time = next((fields[key] for key in _TIMES if key in fields and math.prod(long[fields[key]]) == size), "")
    columns = [key for key, shape in long.items() if math.prod(shape) == size and key != time]
    if size != max(long[field]) or len(columns) > 1:
        return None
    return Signal(name, field, next((said[key] for key in _UNITS if key in said), ""), time)


def unit_of_field(name: str, beside: Collection[str]) -> str:
    """Return the implied unit of a field: seconds for the time in Simulink's "structure with time"."""
    return "s" if name == "time" and "signals" in beside else ""
