"""Columns from named values: structures, lists, texts and arrays of MAT, HDF5, JSON and NumPy files.

A field of a structure is a column, such as ``run.force``. A matrix has the columns ``column 1 of data`` and
so on. If the file has lists with one word per column, the words are the names and units. If the fields of a
structure are the samples and the name of one signal, the structure is one column with this name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from mrdamper.data.formats.clocks import is_setting_of_time
from mrdamper.data.formats.groups import (
    StoredArray,
    attribute_lines,
    is_in_part,
    read_values,
    table_of_arrays,
    unit_in,
    with_prefix_groups,
    with_runs_of_matrices,
    with_values_of_runs,
)
from mrdamper.data.formats.lines.properties import names_quantity, property_of
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import SKIPPED, FileOptions, Layout, Table, as_text
from mrdamper.data.words.headers import means, speaks_of
from mrdamper.quantities import QUANTITIES, roles_of_unit

OF_COLUMNS = re.compile(r"column|channel|name|label|header|field|items|unit", re.IGNORECASE)
_NO_SETTINGS: Mapping[str, object] = MappingProxyType({})


def table_of_variables(
    variables: Mapping[str, Any], path: Path, options: FileOptions, kind: str, skipped: Sequence[str] = ()
) -> Table:
    """Return the table of all arrays in variables, at any depth. ``settings`` are attributes of a value."""
    found = _Variables(variables)
    skipped = [*skipped, *found.objects]
    notes = (f"{SKIPPED}{', '.join(skipped)}",) if skipped else ()
    layout = Layout(kind, part=options.part, notes=notes)
    found.arrays = with_values_of_runs(with_runs_of_matrices(with_prefix_groups(found.arrays)))
    # A single start time, time step or sampling rate in a structure is a setting.
    is_time = {each.path for each in found.arrays if each.size == 1 and is_setting_of_time(each.name)}
    arrays = [each for each in found.arrays if len(each.path) == 1 or each.path not in is_time]
    table = table_of_arrays(arrays, path, layout, found.texts)
    said = {"/".join(path): text for path, text in found.texts.items() if is_in_part(path, table.title)}
    inside = [each.settings for each in found.arrays if is_in_part(each.path, table.title)] or [_NO_SETTINGS]
    shared = {
        name: value for name, value in inside[0].items() if all(each.get(name) == value for each in inside)
    }
    return replace(table, said=attribute_lines(said | shared))


class _Variables:
    """Search for arrays and texts in structures and lists."""

    def __init__(self, variables: Mapping[str, Any]) -> None:
        self.arrays: list[StoredArray] = []
        self.texts: dict[tuple[str, ...], str] = {}
        self.objects: list[str] = []  # Objects of MATLAB's classes, which only MATLAB reads.
        self._words = [*_lists_of_words("", variables)]
        self._collect((), variables, "", _NO_SETTINGS)

    def _collect(self, path: tuple[str, ...], value: Any, unit: str, outer: Mapping[str, object]) -> None:  # noqa: ANN401
        """Collect the arrays in a value. ``outer`` are the single values of the enclosing structures."""
        own = getattr(value, "settings", _NO_SETTINGS)
        settings = {**outer, **own}
        class_name = _class_name(value)
        value = np.array([value]) if isinstance(value, bool | int | float) else value
        if isinstance(value, Mapping):
            self._collect_fields(path, value, settings)
        elif class_name:
            self.objects.append(f"{'/'.join(path)} ({class_name})")
        elif isinstance(value, str):
            self.texts[path] = value
        elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object):
            elements = value[: SETTINGS.element_count_max] if isinstance(value, list) else value.flat
            for k, inner in enumerate(elements):
                self._collect((*path[:-1], f"{path[-1]}({k + 1})"), inner, "", outer)
        elif _is_numbers(value):
            unit = unit_in(own) or unit
            columns: list[tuple[tuple[str, ...], Any]] = []  # path and index of each column
            if value.size == max(value.shape, default=1):
                columns = [(path, ...)]
            elif value.ndim == 2 and min(value.shape) <= SETTINGS.table_columns_max:
                across = 0 if value.shape[0] < value.shape[1] else 1
                for k, title in enumerate(self._names_of_columns(path, value, across)):
                    index = (slice(None), k) if across else (k, slice(None))
                    columns.append(((*path[:-1], *title), index))
            for each, index in columns:
                read, size = partial(read_values, value, index), max(value.shape, default=1)
                self.arrays.append(StoredArray(each, size, read, unit, settings))

    def _collect_fields(
        self, path: tuple[str, ...], value: Mapping[str, Any], outer: Mapping[str, object]
    ) -> None:
        named = {str(k): inner for k, inner in value.items() if not f"{k}".startswith("__")}
        fields = _signals_by_axis(_with_units(named))
        own = {name: one for name, inner in fields.items() if (one := _single(inner)) is not None}
        settings = {name: inner for name, inner in outer.items() if property_of(name) != "unit"} | own
        signal = _find_signal(path, fields)
        for name, inner in fields.items():
            if not signal or name in signal or not _is_numbers(inner):
                # Simulink's "structure with time" has its time in seconds.
                default = "s" if name == "time" and "signals" in fields else ""
                own_path, unit = signal.get(name, ((*path, name), default))
                self._collect(own_path, inner, unit, settings)

    def _names_of_columns(self, path: tuple[str, ...], matrix: Any, across: int) -> list[tuple[str, ...]]:  # noqa: ANN401
        """Return the last parts of the path of each column of a matrix.

        The names come from a list of words, in this order of priority: a list in the attributes of the
        matrix, a list whose name begins with the same word, a list with a name such as "names".
        """
        own = [("", words) for words in getattr(matrix, "words", ())]
        begin = path[-1].split("_")[0]  # pandas names the columns of block0_values in block0_items.
        near = sorted(
            self._words, key=lambda each: (each[0].split("_")[0] != begin, not OF_COLUMNS.search(each[0]))
        )
        lists = [words for _, words in (*own, *near) if len(words) == matrix.shape[across]]
        units = next((each for each in lists if all(roles_of_unit(word) or not word for word in each)), None)
        names = next((each for each in lists if each is not units and len({*each}) == len(each)), None)
        if names is None:
            return [(f"column {k + 1} of {path[-1]}",) for k in range(matrix.shape[across])]
        stated = [f" [{unit}]" if unit else "" for unit in units or [""] * len(names)]
        return [(path[-1], f"{name}{unit}") for name, unit in zip(names, stated, strict=True)]


def _find_signal(path: tuple[str, ...], fields: Mapping[str, Any]) -> dict[str, tuple[tuple[str, ...], str]]:
    """Return path and unit of the field of samples and of the field of times, if a structure is one signal.

    Examples are dSPACE's ``Y(2).Name`` and ``Y(2).Data``, Simulink's ``signals(2).label`` and
    ``signals(2).values``, and a structure ``force`` with the arrays ``time`` and ``data``. The result is
    empty if the structure has no name of a signal, or more than one signal.
    """
    said = {
        key.lower(): each.strip() for key, each in fields.items() if isinstance(each, str) and each.strip()
    }
    shapes = {key: each.shape for key, each in fields.items() if _is_numbers(each)}
    size = max(map(math.prod, shapes.values()), default=1)
    vectors = [key for key, shape in shapes.items() if math.prod(shape) == max(shape, default=1) == size > 1]
    times = [key for key in vectors if means(key, "time")]
    samples = [key for key in vectors if key not in times]
    name = next((said[key] for key in ("name", "label", "title") if key in said), "")
    is_channel = bool(name or (path and any(means(path[-1], role) for role in QUANTITIES)))
    if not is_channel or len(samples) != 1 or len(times) > 1 or names_quantity(samples[0]):
        return {}
    unit = unit_in(said)
    # MATLAB's time series, and structures with the name of their signal, have times in seconds.
    in_seconds = name or [each.lower() for each in (*times, *samples)] == ["time", "data"]
    found = {samples[0]: ((*path, name) if name else path, unit)}
    return found | {time: ((*path, time), "s" if in_seconds else "") for time in times}


def _signals_by_axis(fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return dSPACE's fields with a structure for each time axis ``X``: its times, and its signals ``Y``.

    The ``XIndex`` of a signal is the number of its axis. The name of an axis may be empty.
    """
    axes, signals = (_elements(fields.get(key)) for key in "XY")
    if not all(isinstance(each, Mapping) and _is_numbers(each.get("Data")) for each in (*axes, *signals)):
        return fields
    titles = [_single(each.get("Name")) or "time" for each in axes]
    units = [_single(each.get("Unit")) or "s" for each in axes]
    indices = [int(_single(each.get("XIndex")) or 0) if len(axes) > 1 else 1 for each in signals]
    if not (all(speaks_of(title, "time") for title in titles) and {*indices} <= {*range(1, len(axes) + 1)}):
        return fields
    by_axis = {
        f"X({k})": {
            f"{titles[k - 1]} [{units[k - 1]}]": axis["Data"],
            **{f"Y({n})": each for n, each in enumerate(signals, 1) if indices[n - 1] == k},
        }
        for k, axis in enumerate(axes, 1)
    }
    return {name: inner for name, inner in fields.items() if name not in {"X", "Y"}} | by_axis


def _elements(value: Any) -> list[Any]:  # noqa: ANN401 - any value
    """Return the elements of a list or of MATLAB's array of structures, else a list of the value alone."""
    return [*value.flat] if isinstance(value, np.ndarray) else value if isinstance(value, list) else [value]


def _with_units(fields: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return ``oil: {value: 24, unit: degC}`` as ``oil [degC]: 24``, and other fields unchanged.

    Settings of time in a structure ``sampling`` also get the name of the structure.
    """
    found: dict[str, Any] = {}
    for name, inner in fields.items():
        single = {key: _single(each) for key, each in inner.items()} if isinstance(inner, Mapping) else {}
        units = [key for key in single if property_of(key) == "unit"]
        unit = "".join(f" [{single.pop(key)}]" for key in units)
        times = [key for key in single if "sampl" in name.lower() and is_setting_of_time(f"{name} {key}")]
        if times:
            found |= {f"{name} {key}{unit}": single[key] for key in times}
        elif unit and [*map(type, single.values())] in ([int], [float]):
            found |= {f"{name}{unit}": number for number in single.values()}
        else:
            found[name] = inner
    return found


def _single(value: Any) -> Any:  # noqa: ANN401 - any value
    """Return a text or a single number, None for any other value."""
    if isinstance(value, str | int | float):
        return value
    return np.ravel(value[...])[0].item() if _is_numbers(value) and value.size == 1 else None


def words_in(value: Any) -> list[str]:  # noqa: ANN401 - any value
    """Return a list or an array of several words, [] for any other value."""
    is_text = isinstance(value, np.ndarray) and value.dtype.kind in "OSU"
    if is_text and value.size <= SETTINGS.table_columns_max:
        value = value.ravel().tolist()
    if not isinstance(value, list) or not all(isinstance(each, str | bytes) for each in value):
        return []
    return [as_text(word).strip() for word in value] if len(value) > 1 else []


def _lists_of_words(name: str, value: Any) -> Iterator[tuple[str, list[str]]]:  # noqa: ANN401 - any value
    """Generate (name, words) of the lists of words at any depth. The words may be column names or units."""
    if words := words_in(value):
        yield name, words
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _lists_of_words(f"{key}", inner)
    elif isinstance(value, list):
        for inner in value[: SETTINGS.element_count_max]:
            yield from _lists_of_words(name, inner)


def _class_name(value: Any) -> str:  # noqa: ANN401 - any value
    """Return the class of a MATLAB object or function, "" for any other value."""
    if type(value).__name__ == "MatlabFunction":
        return "function"
    if {"s1", "s2"} <= {*(getattr(getattr(value, "dtype", None), "names", None) or ())}:
        return f"{value.ravel()[0]['s2'].decode('utf-8', 'replace')} object"
    return f"{value.classname} object" if hasattr(value, "classname") else ""


def _is_numbers(value: Any) -> bool:  # noqa: ANN401 - any value
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    return bool(kind and kind in "fiub" and value.size > 0 and hasattr(value, "shape"))
