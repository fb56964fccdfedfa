"""Groups of channels: which of them are recordings of the same channels, and what their attributes say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from mrdamper.data.words.headers import parse_header, word_and_unit
from mrdamper.quantities import roles_of_unit

_COMMON = 2  # channels of one name that make two groups recordings of the same
_MOST_LINES, _LONGEST = 64, 200  # of attributes


def recordings_in(paths: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Return the groups, as ``options.part`` names them, that hold recordings of the same channels.

    ``paths`` are those of the channels, their own names at the end; empty where no two groups are alike.
    """
    for depth in range(1, max(map(len, [*paths, ()]))):
        inside: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
        for path in paths:
            if len(path) > depth:
                inside.setdefault(path[:depth], set()).add(path[depth:])
        alike = [
            group
            for group in inside
            if any(len(inside[group] & inside[other]) >= _COMMON for other in inside if other != group)
        ]
        if alike:
            return tuple("/".join(group) for group in alike)
    return ()


def is_in_part(path: Sequence[str], part: str) -> bool:
    """Tell whether a channel lies in a group: by a name of the group, or by the path that leads to it."""
    groups = path[:-1]
    return not part or part in groups or any("/".join(groups[:k]) == part for k in range(len(path)))


def attribute_lines(attributes: Mapping[str, object]) -> tuple[str, ...]:
    """Return attributes as lines ``name: value``; a number gets the unit in its name behind it."""
    lines = []
    for key, value in list(attributes.items())[:_MOST_LINES]:
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else f"{value}"
        header = parse_header(key)
        unit = header[1] if header is not None else word_and_unit(key)[1]
        beside = attributes.get(f"{key}_unit", attributes.get(f"{key}_units", ""))
        if not unit and isinstance(beside, str | bytes):
            unit = beside.decode("utf-8", "replace") if isinstance(beside, bytes) else beside
        if unit and roles_of_unit(unit) and _is_number(text):
            text = f"{float(text):g} {unit}"
        lines.append(f"{key}: {text}"[:_LONGEST])
    return tuple(lines)


def units_beside(names: Iterable[str], texts: Mapping[tuple[str, ...], str], part: str) -> dict[str, str]:
    """Return the units of channels that texts of the same names state, in a structure called ``units``."""
    stated = {
        path[-1]: text.strip()
        for path, text in texts.items()
        if is_in_part(path, part) and any("unit" in each.lower() for each in path[:-1])
    }
    return {name: stated[name] for name in names if name in stated}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
