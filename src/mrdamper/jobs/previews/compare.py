"""Comparison of the runs in a folder by their rows: copies, and runs that probably belong to another damper.

Only the rows are compared, so that a server answers without reading files. The job ``check`` compares the
samples.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from statistics import median_high

from mrdamper.schema import Json

_SPEED_DIFFERENCE_MAX = 0.1  # max relative difference of the speeds of similar runs
_SIMILAR_COUNT_MIN = 3  # min number of similar runs for a comparison
_FORCE_RATIO_MAX = 2.0  # A run with a larger (or inverse) ratio to the median force is reported.
_MEASURED = (
    *("command_unit", "command_range", "samples", "rate_Hz"),
    *("stroke_mm", "peak_velocity_mm_s", "force_range_N"),
)


def compare_rows(rows: Sequence[Json]) -> list[Json]:
    """Return the rows of runs with ``copy_of`` (the name of another run) and ``foreign`` (the reason)."""
    first: dict[str, str] = {}
    foreign = dict(_foreign(rows))
    compared = []
    for k, row in enumerate(rows):
        key = str([row[name] for name in _MEASURED])
        compared.append({**row, "copy_of": first.get(key), "foreign": foreign.get(k)})
        if _is_read(row):
            first.setdefault(key, row["name"])
    return compared


def _foreign(rows: Sequence[Json]) -> Iterator[tuple[int, str]]:
    """Generate index and reason of each run that probably belongs to another damper."""
    units = Counter(row["command_unit"] for row in rows if row["command_unit"])
    usual = max(units, key=units.__getitem__, default=None)
    groups: dict[tuple[object, ...], list[tuple[int, Json]]] = defaultdict(list)
    for k, row in enumerate(rows):
        if row["command_unit"] not in {None, "", usual}:
            yield k, f"commanded in {row['command_unit']}, most runs are in {usual}"
        elif _is_read(row) and row["peak_velocity_mm_s"]:
            command, warm = row["command"], row["temperature_degC"]
            key = (
                row["motion"],
                None if command is None else round(command, 2),
                None if warm is None else round(warm / 5.0),
            )
            groups[key].append((k, row))
    for group in groups.values():
        for k, row in group:
            speed = row["peak_velocity_mm_s"]
            forces = [
                _force_span(other)
                for j, other in group
                if j != k and abs(other["peak_velocity_mm_s"] / speed - 1.0) <= _SPEED_DIFFERENCE_MAX
            ]
            ratio = (
                _force_span(row) / (median_high(forces) or 1.0) if len(forces) >= _SIMILAR_COUNT_MIN else 1.0
            )
            if not 1.0 / _FORCE_RATIO_MAX <= ratio <= _FORCE_RATIO_MAX:
                yield k, f"its force is {ratio:.2g} times the force of similar runs"


def _is_read(row: Json) -> bool:
    return not row["error"] and row["force_range_N"] is not None


def _force_span(row: Json) -> float:
    low, high = row["force_range_N"]
    return float(high - low)
