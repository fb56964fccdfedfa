"""Tables of the arrays in files with groups or structures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mrdamper.arrays import FloatArray
from mrdamper.data.formats.clocks import Sampling, stated_sampling, with_samplings, with_times
from mrdamper.data.formats.lines.cells import number_in
from mrdamper.data.formats.lines.properties import names_quantity, property_of
from mrdamper.data.formats.settings import SETTINGS
from mrdamper.data.formats.table import Layout, Table, as_column, as_text, require_held, shortest_names
from mrdamper.data.words.headers import means, parse_header, speaks_of, word_and_unit
from mrdamper.quantities import QUANTITIES, roles_of_unit

_PREFIX = re.compile(r"(.+?\d|[^\d_]+)_(.+)")  # "Data1_Force", "MRD_0001_Force" or "rig_Force"
_LINE_OF_MATRIX = re.compile(r"column \d+ of (.*)")


def unit_in(settings: Mapping[str, object]) -> str:
    """Return the unit that an attribute states, such as ``units`` or ``Einheit``; "" if missing."""
    return next((f"{as_text(value)}" for key, value in settings.items() if property_of(key) == "unit"), "")


def read_values(values: Any, index: Any = slice(None)) -> FloatArray:  # noqa: ANN401 - an array of numbers
    """Return the values at an index as numbers. Times are in seconds from the first time."""
    return as_column(np.asarray(values[index]))[0]


@dataclass(frozen=True, slots=True, eq=False)
class StoredArray:
    """An array that is read on first use. ``settings`` are the attributes of its groups and of the array."""

    path: tuple[str, ...]  # Names of the groups from outside to inside, then of the array.
    size: int
    read: Callable[[], FloatArray]
    unit: str = ""
    settings: Mapping[str, object] = field(default_factory=dict)
    is_clock: bool = False  # True: the format defines the array as times of a group

    @property
    def name(self) -> str:
        return self.path[-1]

    @property
    def is_time(self) -> bool:
        """Return True if the array is a clock, or its name means time."""
        return self.is_clock or (self.size > 1 and means(self.name, "time"))


def table_of_arrays(
    arrays: Iterable[StoredArray], file: Path, layout: Layout, units: Mapping[tuple[str, ...], str]
) -> Table:
    """Return the table of the arrays in ``layout.part``, or of the first of several recordings in this part.

    ``units`` are texts by path. A text with the path ``units.force`` is the unit of the array ``force``.
    """
    inside = [each for each in with_own_times(arrays) if is_in_part(each.path, layout.part)]
    others = recordings_in([each.path for each in inside if each.size > 1 and not each.is_clock])
    part = others[0] if others else layout.part
    inside = [each for each in inside if is_in_part(each.path, part)]
    named = dict(zip(shortest_names([each.path for each in inside]), inside, strict=True))
    for name, each in named.items():
        require_held(each.size, 1, file, name)
    stated = {
        path[-1]: text.strip()
        for path, text in units.items()
        if is_in_part(path, part) and any("unit" in each.lower() for each in path[:-1])
    }
    units_of = {name: each.unit or stated.get(each.name, "") for name, each in named.items()}
    table = Table(
        names=tuple(named),
        columns={name: each.read() for name, each in named.items()},
        texts={},
        layout=layout,
        rows=max((each.size for each in inside), default=0),
        units={name: unit for name, unit in units_of.items() if unit},
        title=part,
        more=others[1:],
    )
    return _on_clocks(table, named)


def _on_clocks(table: Table, arrays: Mapping[str, StoredArray]) -> Table:
    """Add a clock to each column: a time column, or a start and a time step.

    If the file has several time columns, a column uses the time column in the nearest enclosing group.
    Otherwise the attributes state the start and the time step of a column.
    """
    # The first time column of a group is used.
    times = {each.path[:-1]: name for name, each in [*arrays.items()][::-1] if each.is_time}
    if len(times) < 2:
        return with_samplings(table, {name: stated_sampling(each.settings) for name, each in arrays.items()})
    own: dict[str, str] = {}  # column -> the column of its times
    for name, each in arrays.items():
        groups = (each.path[:k] for k in range(len(each.path), -1, -1))
        time = next((times[group] for group in groups if group in times), name)
        if time != name and each.size > 1 and arrays[time].size == each.size:
            own[name] = time
    if not own:
        return table
    columns = {name: values for name, values in table.columns.items() if name not in times.values()}
    step = min(float(np.median(np.diff(table.columns[time]))) for time in own.values())
    default = "s" if Sampling(step, has_unit=False).is_plausible else ""
    units = {time: table.units.get(time) or word_and_unit(time)[1] or default for time in own.values()}
    bare = replace(table, names=tuple(columns), columns=columns, units={**table.units, **units})
    return with_times(bare, {name: table.columns[time] for name, time in own.items()}, own)


def with_prefix_groups(arrays: Iterable[StoredArray]) -> list[StoredArray]:
    """Return arrays with a group for each prefix: ``Data1_Force`` becomes ``Data1/Force``.

    A prefix that is no quantity has a time and at least two other arrays, and each long array has a prefix.
    """
    arrays = list(arrays)
    own = {each.path: _PREFIX.fullmatch(each.name) for each in arrays if each.size > 1}
    prefixes = {path: match for path, match in own.items() if match and not names_quantity(match[1])}
    split = {path: (*path[:-1], *match.groups()) for path, match in prefixes.items()}
    groups: dict[tuple[str, ...], list[bool]] = {}
    for path in split.values():
        groups.setdefault(path[:-1], []).append(speaks_of(path[-1], "time"))
    whole = [group for group, are_times in groups.items() if 0 < sum(are_times) < len(are_times) - 1]
    split = {path: new for path, new in split.items() if new[:-1] in whole}
    if any(each.size >= SETTINGS.table_rows_min and each.path not in split for each in arrays):
        return arrays
    return [replace(each, path=split.get(each.path, each.path)) for each in arrays]


def with_own_times(arrays: Iterable[StoredArray]) -> list[StoredArray]:
    """Return arrays with times such as ``time_Force`` or ``t_force_s`` in a group of their channel."""
    arrays = list(arrays)
    # (group, size, words except the word for time) -> channels, times
    named: dict[tuple[object, ...], tuple[list[StoredArray], list[StoredArray]]] = {}
    for each in arrays:
        words = re.findall(r"[^\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word_and_unit(each.name)[0]))
        others = [word.lower() for word in words if word != "t" and not speaks_of(word, "time")]
        if others and each.size > 1:
            pair = named.setdefault((each.path[:-1], each.size, *others), ([], []))
            pair[len(others) < len(words)].append(each)
    moved: dict[tuple[str, ...], StoredArray] = {}
    for channels, times in named.values():
        if len(channels) == len(times) == 1:
            path, unit = (*channels[0].path, "time"), times[0].unit or word_and_unit(times[0].name)[1]
            moved[times[0].path] = replace(times[0], path=path, unit=unit, is_clock=True)
    return [moved.get(each.path, each) for each in arrays]


def recordings_in(paths: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return the paths of groups with the same channels, from the paths of all channels of the file."""
    for depth in range(1, max(map(len, [*paths, ()]))):
        inside: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
        for path in paths:
            if len(path) > depth:
                inside.setdefault(path[:depth], set()).add(path[depth:])
        # Groups with two or more equal channel names record the same channels.
        alike = [
            group
            for group, names in inside.items()
            if any(len(names & others) >= 2 for other, others in inside.items() if other != group)
        ]
        if alike:
            return tuple("/".join(group) for group in alike)
    return ()


def with_values_of_runs(arrays: Sequence[StoredArray]) -> list[StoredArray]:
    """Add the values that apply to a run to the ``settings`` of the run's arrays.

    A file may have the runs ``run1`` to ``run4`` and an array ``current_A = [0 0.5 1 1.5]`` with one value
    for each run. The values are in the order of the run numbers.
    """
    runs = recordings_in([each.path for each in arrays if each.size > 1 and not each.is_clock])
    numbers = {run: int(digits[-1]) for run in runs if (digits := re.findall(r"\d{1,9}", run))}
    order = sorted(numbers, key=numbers.__getitem__)
    own = {each.path: next((run for run in runs if is_in_part(each.path, run)), "") for each in arrays}
    lists = [each for each in arrays if each.size == len(runs) > 1 and not own[each.path]]
    if not lists or len({*numbers.values()}) < len(runs):
        return [*arrays]
    values = {each.name: each.read().tolist() for each in lists}
    settings = {run: {name: row[k] for name, row in values.items()} for k, run in enumerate(order)}
    return [replace(each, settings={**settings.get(own[each.path], {}), **each.settings}) for each in arrays]


def with_runs_of_matrices(arrays: Sequence[StoredArray]) -> list[StoredArray]:
    """Return arrays with a group for each run, from matrices with a line for each run: ``run 1/force_N``.

    At least two matrices of different quantities have the same shape. Their lines are runs if another matrix
    of this shape contains currents, or if an array has one current for each line. Arrays with the length of
    the lines, such as common times, are in each group.
    """
    matrices: dict[str, list[StoredArray]] = {}
    for each in arrays:
        if line := _LINE_OF_MATRIX.fullmatch(each.name):
            matrices.setdefault(line[1], []).append(each)
    count, size = next(((len(lines), lines[0].size) for lines in matrices.values()), (0, 0))
    roles = {role for name in matrices for role in QUANTITIES if means(name, role)}
    lists = [each.name for each in arrays if each.size == count]
    has_currents = any(means(name, role) for name in (*matrices, *lists) for role in ("current", "voltage"))
    is_equal = all((len(lines), lines[0].size) == (count, size) for lines in matrices.values())
    if not (is_equal and has_currents and len(matrices) == len(roles) > 1 and count != size):
        return [*arrays]
    shared = [each for each in arrays if each.size == size and not _LINE_OF_MATRIX.fullmatch(each.name)]
    runs = [(f"run {k + 1}", name, lines[k]) for k in range(count) for name, lines in matrices.items()]
    runs += [(f"run {k + 1}", each.name, each) for k in range(count) for each in shared]
    others = [each for each in arrays if each.size != size]
    return [*others, *(replace(each, path=(run, name)) for run, name, each in runs)]


def is_in_part(path: Sequence[str], part: str) -> bool:
    """Return True if a channel is in the group with the name or path ``part``."""
    groups = path[:-1]
    return not part or part in groups or any("/".join(groups[:k]) == part for k in range(len(path)))


def attribute_lines(attributes: Mapping[str, object]) -> tuple[str, ...]:
    """Return attributes as lines ``name: value``; a number is followed by the unit in its name."""
    lines = []
    for key, value in list(attributes.items())[: SETTINGS.attribute_lines_max]:
        text = f"{as_text(value)}"
        header = parse_header(key)
        unit = (header[1] if header else word_and_unit(key)[1]) or as_text(
            attributes.get(f"{key}_unit", attributes.get(f"{key}_units", ""))
        )
        number = number_in(text.strip(), ".")
        if isinstance(unit, str) and roles_of_unit(unit) and number is not None:
            text = f"{number:g} {unit}"
        lines.append(f"{key}: {text}"[: SETTINGS.attribute_length_max])
    return tuple(lines)
